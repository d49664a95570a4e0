//! Domain of a reconstruction: mask, pixel size and known heights.

use ndarray::ArrayView2;
use tactile_core::Requirement;

use crate::{BoundingBox, PixelScalar, SfsError};

/// Pixels to solve for, their size, and the known heights.
///
/// `mask` selects the pixels whose height is computed (all pixels without a mask). Pixels outside
/// its bounding box are neither read nor computed. `known_heights` fixes heights at the pixels that
/// are not NaN, inside or outside the mask: a height known outside is a boundary value. Heights
/// have the unit of `pixel_size_m`. [`Default`] is the whole image with heights in pixels.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::Domain;
/// let mask = Array2::from_elem((4, 6), true);
/// let domain = Domain::new([5e-5, 6e-5])?.with_mask(mask.view());
/// assert!(Domain::new([0.0, 1.0]).is_err());
/// # let _ = domain;
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Domain<'a, T> {
    /// Pixels to solve for, or all pixels if `None`.
    pub mask: Option<ArrayView2<'a, bool>>,
    /// Width (x) and height (y) of a pixel in metres.
    pub pixel_size_m: [T; 2],
    /// Known heights, NaN where unknown.
    pub known_heights: Option<ArrayView2<'a, T>>,
}

impl<T: PixelScalar> Default for Domain<'_, T> {
    /// The whole image with heights in pixels.
    fn default() -> Self {
        Self {
            mask: None,
            pixel_size_m: [T::one(); 2],
            known_heights: None,
        }
    }
}

impl<'a, T: PixelScalar> Domain<'a, T> {
    /// The whole image with pixels of the given width and height, and without known heights.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] if a size is not positive and finite.
    pub fn new(pixel_size_m: [T; 2]) -> Result<Self, SfsError> {
        let domain = Self {
            mask: None,
            pixel_size_m,
            known_heights: None,
        };
        domain.check_pixel_size()?;
        Ok(domain)
    }

    /// Restricts the solution to the pixels where `mask` is true.
    pub fn with_mask(self, mask: ArrayView2<'a, bool>) -> Self {
        Self {
            mask: Some(mask),
            ..self
        }
    }

    /// Fixes the heights that are not NaN.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{CosinePoisson, Domain, SlopeIntegrator};
    /// let (p, q) = (Array2::from_elem((4, 5), 0.5), Array2::zeros((4, 5)));
    /// let mut known = Array2::from_elem((4, 5), f64::NAN);
    /// known[[0, 0]] = 10.0;
    /// let domain = Domain::default().with_known_heights(known.view());
    /// let z = CosinePoisson.integrate(p.view(), q.view(), &domain)?.heights;
    /// assert!((z[[0, 0]] - 10.0).abs() < 1e-12 && (z[[3, 4]] - 12.0).abs() < 1e-12);
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    pub fn with_known_heights(self, known: ArrayView2<'a, T>) -> Self {
        Self {
            known_heights: Some(known),
            ..self
        }
    }

    fn check_pixel_size(&self) -> Result<(), SfsError> {
        let [width, height] = self.pixel_size_m.map(T::as_f64);
        Requirement::Positive.check("pixel width", width)?;
        Requirement::Positive.check("pixel height", height)?;
        Ok(())
    }

    /// Checks the domain against an image of `shape` (rows, columns) and returns the bounding box
    /// of the mask.
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::{Domain, SfsError};
    /// let mask = array![[false, true, true], [false, true, false]];
    /// let domain = Domain::<f64>::default().with_mask(mask.view());
    /// assert_eq!(domain.bounding_box((2, 3))?.columns(), 2);
    /// assert!(domain.bounding_box((4, 4)).is_err()); // another shape
    /// # Ok::<(), SfsError>(())
    /// ```
    ///
    /// # Errors
    /// [`SfsError::EmptyImage`], [`SfsError::EmptyMask`], [`SfsError::ShapeMismatch`] for the mask
    /// or the known heights, and [`SfsError::InvalidOption`] for a pixel size that is not positive
    /// and finite.
    pub fn bounding_box(&self, shape: (usize, usize)) -> Result<BoundingBox, SfsError> {
        self.check_pixel_size()?;
        let (rows, columns) = shape;
        if rows == 0 || columns == 0 {
            return Err(SfsError::EmptyImage { rows, columns });
        }
        if let Some(known) = self.known_heights {
            same_shape("known heights", shape, known.dim())?;
        }
        let Some(mask) = self.mask else {
            return Ok(BoundingBox::whole(shape));
        };
        same_shape("mask", shape, mask.dim())?;
        BoundingBox::of_mask(mask).ok_or(SfsError::EmptyMask)
    }

    /// Whether the height of a pixel is to be computed.
    ///
    /// # Panics
    /// If the pixel lies outside the mask array.
    #[inline]
    pub fn contains(&self, row: usize, column: usize) -> bool {
        self.mask.is_none_or(|mask| mask[[row, column]])
    }

    /// The known height of a pixel. `None` if it is not known.
    ///
    /// # Panics
    /// If the pixel lies outside the array of known heights.
    #[inline]
    pub fn known(&self, row: usize, column: usize) -> Option<T> {
        self.known_heights
            .map(|known| known[[row, column]])
            .filter(|height| height.is_finite())
    }
}

/// Returns an error if an input has another shape.
pub(crate) fn same_shape(
    input: &'static str,
    expected: (usize, usize),
    found: (usize, usize),
) -> Result<(), SfsError> {
    if found == expected {
        return Ok(());
    }
    Err(SfsError::ShapeMismatch {
        input,
        expected: expected.into(),
        found: found.into(),
    })
}

/// The regions of the mask with this `value` that are connected by the sides of their pixels, as
/// `[row, column]`.
pub(crate) fn parts(mask: ArrayView2<'_, bool>, value: bool) -> Vec<Vec<[usize; 2]>> {
    let columns = mask.ncols();
    let mut open: Vec<bool> = mask.iter().map(|m| *m == value).collect();
    let mut parts = Vec::new();
    for start in 0..open.len() {
        if !core::mem::take(&mut open[start]) {
            continue;
        }
        let mut part = vec![[start / columns, start % columns]];
        let mut next = 0;
        while let Some(&[r, c]) = part.get(next) {
            next += 1;
            let at = r * columns + c;
            if c > 0 && core::mem::take(&mut open[at - 1]) {
                part.push([r, c - 1]);
            }
            if c + 1 < columns && core::mem::take(&mut open[at + 1]) {
                part.push([r, c + 1]);
            }
            if r > 0 && core::mem::take(&mut open[at - columns]) {
                part.push([r - 1, c]);
            }
            if open.get_mut(at + columns).is_some_and(core::mem::take) {
                part.push([r + 1, c]);
            }
        }
        parts.push(part);
    }
    parts
}
