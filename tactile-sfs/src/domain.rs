//! Where to solve: mask, pixel size and the heights that are known.

use ndarray::{ArrayView2, ArrayViewMut2, Axis, Slice};

use crate::error::positive;
use crate::{Scalar, SfsError};

/// The pixels to solve for, their size, and what is known of the heights.
///
/// `mask` selects the pixels whose height is wanted (all without one); nothing outside its bounding box is read or
/// costs time. `known_heights` fixes heights where it is not NaN, inside the mask or outside it: a height known
/// outside is a boundary value. Heights have the unit of `pixel_size_m`; [`Default`] is the whole image with heights in pixels.
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
    /// Pixels to solve for; all of them if `None`.
    pub mask: Option<ArrayView2<'a, bool>>,
    /// Width (x) and height (y) of a pixel in metres.
    pub pixel_size_m: [T; 2],
    /// Known heights, NaN where unknown.
    pub known_heights: Option<ArrayView2<'a, T>>,
}

impl<T: Scalar> Default for Domain<'_, T> {
    /// The whole image with heights in pixels.
    fn default() -> Self {
        Self {
            mask: None,
            pixel_size_m: [T::one(); 2],
            known_heights: None,
        }
    }
}

impl<'a, T: Scalar> Domain<'a, T> {
    /// The whole image, pixels of the given width and height, nothing known.
    ///
    /// # Errors
    /// [`SfsError::NotPositive`] unless both sizes are positive and finite.
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
        positive("pixel width", self.pixel_size_m[0].as_f64())?;
        positive("pixel height", self.pixel_size_m[1].as_f64())
    }

    /// Checks everything against an image of `rows` × `columns` and returns the box that holds the mask.
    pub(crate) fn validate(&self, rows: usize, columns: usize) -> Result<BoundingBox, SfsError> {
        self.check_pixel_size()?;
        if rows == 0 || columns == 0 {
            return Err(SfsError::EmptyImage { rows, columns });
        }
        if let Some(known) = self.known_heights {
            same_shape("known heights", [rows, columns], known.dim())?;
        }
        let Some(mask) = self.mask else {
            return Ok(BoundingBox {
                top: 0,
                left: 0,
                rows,
                columns,
            });
        };
        same_shape("mask", [rows, columns], mask.dim())?;
        BoundingBox::of(mask).ok_or(SfsError::EmptyMask)
    }

    /// Whether the pixel is to be solved for.
    #[inline]
    pub(crate) fn contains(&self, row: usize, column: usize) -> bool {
        self.mask.is_none_or(|mask| mask[[row, column]])
    }

    /// The known height of a pixel, if there is one.
    #[inline]
    pub(crate) fn known(&self, row: usize, column: usize) -> Option<T> {
        self.known_heights
            .map(|known| known[[row, column]])
            .filter(|height| height.is_finite())
    }
}

/// Refuses an input of another shape.
pub(crate) fn same_shape(
    input: &'static str,
    expected: [usize; 2],
    (rows, columns): (usize, usize),
) -> Result<(), SfsError> {
    let found = [rows, columns];
    if found == expected {
        Ok(())
    } else {
        Err(SfsError::ShapeMismatch {
            input,
            expected,
            found,
        })
    }
}

/// The smallest rectangle that holds a mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(crate) struct BoundingBox {
    /// First row.
    pub(crate) top: usize,
    /// First column.
    pub(crate) left: usize,
    /// Number of rows.
    pub(crate) rows: usize,
    /// Number of columns.
    pub(crate) columns: usize,
}

impl BoundingBox {
    /// The box of the true pixels, `None` if there are none.
    pub(crate) fn of(mask: ArrayView2<'_, bool>) -> Option<Self> {
        let (mut top, mut bottom, mut left, mut right) = (usize::MAX, 0, usize::MAX, 0);
        for (row, line) in mask.outer_iter().enumerate() {
            let Some((first, last)) = ends(line) else {
                continue;
            };
            top = top.min(row);
            bottom = row;
            left = left.min(first);
            right = right.max(last);
        }
        (top != usize::MAX).then(|| Self {
            top,
            left,
            rows: bottom - top + 1,
            columns: right - left + 1,
        })
    }

    /// Number of pixels.
    pub(crate) fn area(&self) -> usize {
        self.rows * self.columns
    }

    /// Row and column of its pixels, in reading order.
    pub(crate) fn pixels(self) -> impl Iterator<Item = (usize, usize)> {
        let columns = self.left..self.left + self.columns;
        (self.top..self.top + self.rows)
            .flat_map(move |row| columns.clone().map(move |column| (row, column)))
    }

    /// Whether every pixel of `other` lies in this box.
    pub(crate) fn holds(&self, other: Self) -> bool {
        self.top <= other.top
            && self.left <= other.left
            && other.top + other.rows <= self.top + self.rows
            && other.left + other.columns <= self.left + self.columns
    }

    /// The part of an array inside the box.
    pub(crate) fn view<'a, A>(&self, mut array: ArrayView2<'a, A>) -> ArrayView2<'a, A> {
        array.slice_axis_inplace(Axis(0), Slice::from(self.top..self.top + self.rows));
        array.slice_axis_inplace(Axis(1), Slice::from(self.left..self.left + self.columns));
        array
    }

    /// The part of a mutable array inside the box.
    pub(crate) fn view_mut<'a, A>(&self, mut array: ArrayViewMut2<'a, A>) -> ArrayViewMut2<'a, A> {
        array.slice_axis_inplace(Axis(0), Slice::from(self.top..self.top + self.rows));
        array.slice_axis_inplace(Axis(1), Slice::from(self.left..self.left + self.columns));
        array
    }
}

/// First and last true element of a line; whole blocks of false are skipped at once.
fn ends(line: ndarray::ArrayView1<'_, bool>) -> Option<(usize, usize)> {
    let Some(slice) = line.as_slice() else {
        let first = line.iter().position(|&inside| inside)?;
        let last = line.iter().rposition(|&inside| inside)?;
        return Some((first, last));
    };
    const BLOCK: usize = 64;
    let any = |block: &[bool]| block.iter().fold(false, |any, &inside| any | inside);
    let start = slice.chunks(BLOCK).position(any)? * BLOCK;
    let first = start + slice[start..].iter().position(|&inside| inside)?;
    let last = slice.iter().rposition(|&inside| inside)?;
    Some((first, last))
}
