//! Control points on a surface: the trait and its implementations.

mod adaptive;
mod crowded;
mod equally_spaced;
mod lattice;
mod random;
mod strips;

use nalgebra::Point3;
use ndarray::ArrayView2;

pub use adaptive::CurvatureAdaptive;
pub use equally_spaced::EquallySpaced;
pub use random::Random;

use crate::{Scalar, SfsError};

/// A way to choose control points on a surface.
///
/// Points are (x, y, z) in metres, x = column · width, y = row · height of a pixel; between pixels the height is
/// interpolated. None lies outside the mask or where the height is not finite, no two coincide, and the same input gives
/// the same points. Exactly `count` points are returned. Object safe.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, EquallySpaced};
/// let flat = Array2::<f64>::zeros((60, 80));
/// let points = EquallySpaced::new().sample(flat.view(), None, [1e-4, 1e-4], 48)?;
/// assert_eq!(points.len(), 48);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
pub trait ControlPointSampler<T: Scalar> {
    /// Chooses `count` points on `surface` inside `mask`.
    ///
    /// # Errors
    /// [`SfsError::EmptyImage`], [`SfsError::EmptyMask`], [`SfsError::ShapeMismatch`],
    /// [`SfsError::InvalidOption`] for a pixel size, [`SfsError::TooManyPoints`] for more points than pixels.
    fn sample(
        &self,
        surface: ArrayView2<'_, T>,
        mask: Option<ArrayView2<'_, bool>>,
        pixel_size_m: [T; 2],
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError>;
}
