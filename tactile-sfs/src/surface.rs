//! The result of a reconstruction: heights, flags and a report.

use core::ops::{BitOr, BitOrAssign};

use ndarray::{Array2, ArrayView2};
use tactile_core::StopReason;

use crate::domain::same_shape;
use crate::{BoundingBox, Domain, PixelScalar, SfsError, SurfaceWorkspace};

/// State of one pixel: a set of the constants below.
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::{DepthTable, Domain, Image, PixelFlags, SurfaceReconstruction};
/// let table = DepthTable::new(&[(0.0, 0.0), (10.0, 1e-3)])?;
/// let surface = table.reconstruct(
///     Image::new(array![[5.0, 12.0, f64::NAN]].view(), Domain::new([1e-4, 1e-4])?)
/// )?;
/// assert_eq!(surface.flags[[0, 0]], PixelFlags::NONE);
/// assert!(surface.flags[[0, 1]].contains(PixelFlags::OUT_OF_RANGE)); // the last depth is used
/// assert!((PixelFlags::DARK | PixelFlags::UNREACHED).contains(PixelFlags::DARK));
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelFlags(u8);

impl PixelFlags {
    /// No flag.
    pub const NONE: Self = Self(0);
    /// Brighter than the model allows (reflectance above 1). Treated as 1.
    pub const SATURATED: Self = Self(1);
    /// At or below the ambient: the slope is unbounded and was limited by the method.
    pub const DARK: Self = Self(2);
    /// The input was NaN or infinite. The pixel was filled from its neighbours.
    pub const NON_FINITE: Self = Self(4);
    /// No known height reaches the pixel. Its height is NaN.
    pub const UNREACHED: Self = Self(8);
    /// Outside the range of a calibration. The nearest end was used.
    pub const OUT_OF_RANGE: Self = Self(16);

    /// Flags of a reflectance that disagrees with the model: above 1, below `least`, or not finite.
    pub(crate) fn of_reflectance<T: PixelScalar>(reflectance: T, least: T) -> Self {
        if !reflectance.is_finite() {
            Self::NON_FINITE
        } else if reflectance > T::one() {
            Self::SATURATED
        } else if reflectance < least {
            Self::DARK
        } else {
            Self::NONE
        }
    }

    /// Whether every flag of `other` is set here.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether no flag is set.
    pub(crate) fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl BitOr for PixelFlags {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for PixelFlags {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

/// One connected region of the solved pixels.
///
/// ```
/// use ndarray::{Array2, array};
/// use tactile_sfs::{Component, Domain, MaskedLeastSquares, SlopeIntegrator};
/// let mask = array![[true, true, false, true], [true, true, false, true]]; // two contacts
/// let slopes = Array2::<f64>::zeros((2, 4));
/// let domain = Domain::default().with_mask(mask.view());
/// let report = MaskedLeastSquares::default()
///     .integrate(slopes.view(), slopes.view(), &domain)?
///     .report;
/// assert_eq!(report.components.len(), 2);
/// let Component { pixels, first, .. } = report.components[1];
/// assert_eq!((pixels, first), (2, [0, 3]));
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Component<T> {
    /// Number of pixels.
    pub pixels: usize,
    /// Row and column of its first pixel in reading order.
    pub first: [usize; 2],
    /// Its mean height: 0, or the value determined by its known heights.
    pub mean_height: T,
}

/// Report of a reconstruction.
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::{DepthTable, Domain, Image, StopReason, SurfaceReconstruction};
/// let table = DepthTable::new(&[(0.0, 0.0), (10.0, 1e-3)])?;
/// let (image, domain) = (array![[5.0, 12.0, f64::NAN]], Domain::new([1e-4, 1e-4])?);
/// let report = table.reconstruct(Image::new(image.view(), domain))?.report;
/// assert_eq!((report.stop, report.iterations), (StopReason::Direct, 0));
/// // One pixel is out of range, and one has no height.
/// assert_eq!((report.solved, report.flagged), (2, 2));
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SurfaceReport<T> {
    /// Why the method stopped.
    pub stop: StopReason,
    /// Number of iterations (sweeps, conjugate-gradient steps, …), 0 for direct methods.
    pub iterations: usize,
    /// Last residual or change, in the unit documented by each method.
    pub residual: T,
    /// Number of pixels with a height.
    pub solved: usize,
    /// Number of pixels with at least one flag.
    pub flagged: usize,
    /// Connected regions, if the method determines them (masked least squares).
    pub components: Vec<Component<T>>,
}

impl<T: Default> Default for SurfaceReport<T> {
    /// The report of a direct method that has not solved anything yet.
    fn default() -> Self {
        Self {
            stop: StopReason::Direct,
            iterations: 0,
            residual: T::default(),
            solved: 0,
            flagged: 0,
            components: Vec::new(),
        }
    }
}

/// Heights over the frame, in the unit of the pixel size.
///
/// `heights` is NaN outside `mask`. If a surface is reused as output, only the last written
/// rectangle is cleared, so that the cost of a small contact in a large frame stays low. Heights
/// that a caller has changed outside that rectangle remain.
///
/// ```
/// use ndarray::{Array2, array};
/// use tactile_sfs::{CosinePoisson, Domain, SlopeIntegrator, Surface, SurfaceWorkspace};
/// let mask = array![[true, true, true, false], [true, true, true, false]];
/// let (p, q) = (Array2::from_elem((2, 4), 1.0), Array2::zeros((2, 4)));
/// // Both are reused for every frame.
/// let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::<f64>::default());
/// let domain = Domain::default().with_mask(mask.view());
/// CosinePoisson.integrate_with(&mut workspace, p.view(), q.view(), &domain, &mut surface)?;
/// assert!(surface.heights[[0, 3]].is_nan() && !surface.mask[[0, 3]]);
/// assert_eq!(surface.report.solved, 6);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Surface<T> {
    /// Heights z(row, column), NaN at pixels without a height.
    pub heights: Array2<T>,
    /// Pixels that have a height.
    pub mask: Array2<bool>,
    /// Flags of each pixel.
    pub flags: Array2<PixelFlags>,
    /// Report of the reconstruction.
    pub report: SurfaceReport<T>,
    /// The rectangle that contains every pixel with a height or a flag.
    pub(crate) bounding_box: BoundingBox,
}

impl<T: Default> Default for Surface<T> {
    /// Without pixels, to be filled.
    fn default() -> Self {
        Self {
            heights: Array2::default((0, 0)),
            mask: Array2::default((0, 0)),
            flags: Array2::default((0, 0)),
            report: SurfaceReport::default(),
            bounding_box: BoundingBox::whole((0, 0)),
        }
    }
}

impl<T: PixelScalar> Surface<T> {
    /// Creates a surface from heights, for a user-defined reconstruction. Pixels that are not
    /// finite have no height.
    ///
    /// Flags and report may be set afterwards: `surface.flags[[row, column]] |= PixelFlags::DARK`.
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::Surface;
    /// let surface = Surface::from_heights(array![[1e-3, f64::NAN, 2e-3]]);
    /// assert_eq!(surface.mask, array![[true, false, true]]);
    /// assert_eq!(surface.report.solved, 2);
    /// ```
    pub fn from_heights(heights: Array2<T>) -> Self {
        let mask = heights.mapv(T::is_finite);
        Self {
            flags: Array2::default(heights.dim()),
            bounding_box: BoundingBox::whole(heights.dim()),
            report: SurfaceReport {
                solved: mask.iter().filter(|solved| **solved).count(),
                ..SurfaceReport::default()
            },
            heights,
            mask,
        }
    }

    /// The output of a method that is called with a new workspace and a new surface.
    pub(crate) fn made_by(
        method: impl FnOnce(&mut SurfaceWorkspace<T>, &mut Self) -> Result<(), SfsError>,
    ) -> Result<Self, SfsError> {
        let mut surface = Self::default();
        method(&mut SurfaceWorkspace::default(), &mut surface)?;
        Ok(surface)
    }

    /// First step of every reconstruction: checks the domain against an image of this shape,
    /// empties the surface and returns the mask's box. On an error the surface is unchanged.
    pub(crate) fn enter(
        &mut self,
        shape: (usize, usize),
        domain: &Domain<'_, T>,
    ) -> Result<BoundingBox, SfsError> {
        let area = domain.bounding_box(shape)?;
        if self.heights.dim() == shape {
            self.clear();
        } else {
            fill_shape(&mut self.heights, shape, T::nan());
            fill_shape(&mut self.mask, shape, false);
            fill_shape(&mut self.flags, shape, PixelFlags::NONE);
        }
        self.bounding_box = area;
        // The list keeps its memory, so that a stream of frames does not allocate.
        let mut components = core::mem::take(&mut self.report.components);
        components.clear();
        self.report = SurfaceReport {
            components,
            ..SurfaceReport::default()
        };
        Ok(area)
    }

    /// Like `enter`, but for the integrators.
    pub(crate) fn enter_slopes(
        &mut self,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
    ) -> Result<BoundingBox, SfsError> {
        domain.bounding_box(p.dim())?;
        same_shape("slopes along y", p.dim(), q.dim())?;
        self.enter(p.dim(), domain)
    }

    /// Clears the last written rectangle.
    fn clear(&mut self) {
        let area = self.bounding_box;
        area.of_mut(self.heights.view_mut()).fill(T::nan());
        area.of_mut(self.mask.view_mut()).fill(false);
        area.of_mut(self.flags.view_mut()).fill(PixelFlags::NONE);
    }

    /// Writes one height and marks the pixel as solved (unless the height is not finite).
    #[inline]
    pub(crate) fn set(&mut self, row: usize, column: usize, height: T) {
        self.heights[[row, column]] = height;
        self.mask[[row, column]] = height.is_finite();
    }

    /// Counts solved and flagged pixels.
    pub(crate) fn finish(&mut self, domain: &Domain<'_, T>) {
        let area = self.bounding_box;
        let (mut solved, mut flagged) = (0, 0);
        let flags = area.of(self.flags.view());
        for (r, line) in area.of(self.mask.view()).rows().into_iter().enumerate() {
            solved += line
                .iter()
                .map(|&solved| usize::from(solved))
                .sum::<usize>();
            // Most rows have no flag. A fold without an early exit is computed with SIMD
            // instructions.
            let flags = flags.row(r);
            if flags
                .iter()
                .fold(false, |any, flags| any | !flags.is_empty())
            {
                let inside = |c: usize| domain.contains(area.row_start + r, area.column_start + c);
                let set = flags
                    .iter()
                    .enumerate()
                    .filter(|(_, flags)| !flags.is_empty());
                flagged += set.filter(|(c, _)| inside(*c)).count();
            }
        }
        (self.report.solved, self.report.flagged) = (solved, flagged);
    }
}

/// Fills an array of the given shape with `value`, and reuses its memory if that is large enough.
pub(crate) fn fill_shape<V: Copy>(array: &mut Array2<V>, shape: (usize, usize), value: V) {
    let empty = Array2::from_shape_simple_fn((0, 0), || value);
    let (mut memory, _) = core::mem::replace(array, empty).into_raw_vec_and_offset();
    memory.clear();
    memory.resize(shape.0 * shape.1, value);
    *array = match Array2::from_shape_vec(shape, memory) {
        Ok(array) => array,
        Err(_) => unreachable!("as many values as the shape has places"),
    };
}
