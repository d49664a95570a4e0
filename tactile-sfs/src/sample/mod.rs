//! Control points on a surface: the trait and its implementations.

mod adaptive;
mod contact;
mod crowded;
mod equally_spaced;
mod lattice;
mod random;
mod strips;

use std::sync::Arc;

use nalgebra::Point3;
use ndarray::ArrayView2;

pub use adaptive::CurvatureAdaptive;
pub use contact::ContactSampler;
pub use equally_spaced::EquallySpaced;
pub use random::Random;

use crate::{Scalar, SfsError, Workspace};

/// A way to choose control points on a surface.
///
/// Points are (x, y, z) in metres, x = column · width, y = row · height of a pixel; between pixels the height is
/// interpolated. None lies outside the mask (for [`ContactSampler`]: outside the contour) or where the height is not
/// finite, no two coincide, and the same input gives
/// the same points. Exactly `count` points are returned. Object safe; an implementor writes
/// [`sample_with`](Self::sample_with) alone.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, EquallySpaced};
/// let flat = Array2::<f64>::zeros((60, 80));
/// let points = EquallySpaced.sample(flat.view(), None, [1e-4, 1e-4], 48)?;
/// assert_eq!(points.len(), 48);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
pub trait ControlPointSampler<T: Scalar> {
    /// Chooses `count` points on `surface` inside `mask` and puts them into `points`, whose contents are replaced, with the
    /// buffers of `workspace`. The samplers of this crate allocate nothing once both have grown.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{ControlPointSampler, Random, Workspace};
    /// let (z, mut workspace, mut points) = (Array2::<f64>::zeros((9, 9)), Workspace::default(), Vec::new());
    /// for count in [20, 5] {
    ///     Random { seed: 1 }.sample_with(&mut workspace, z.view(), None, [1.0, 1.0], count, &mut points)?;
    ///     assert_eq!(points.len(), count);
    /// }
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// [`SfsError::EmptyImage`], [`SfsError::EmptyMask`], [`SfsError::ShapeMismatch`],
    /// [`SfsError::NotPositive`] for a pixel size, [`SfsError::TooManyPoints`] for more points than pixels; `points` is then
    /// empty.
    fn sample_with(
        &self,
        workspace: &mut Workspace<T>,
        surface: ArrayView2<'_, T>,
        mask: Option<ArrayView2<'_, bool>>,
        pixel_size_m: [T; 2],
        count: usize,
        points: &mut Vec<Point3<T>>,
    ) -> Result<(), SfsError>;

    /// Chooses `count` points on `surface` inside `mask`.
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::{ControlPointSampler, EquallySpaced};
    /// let z = array![[5.0, 5.0], [5.0, f64::NAN]];
    /// let points = EquallySpaced.sample(z.view(), None, [1.0, 2.0], 3)?;
    /// assert!(points.iter().all(|point| point.z == 5.0 && (point.x, point.y) != (1.0, 2.0)));
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// As [`sample_with`](Self::sample_with).
    fn sample(
        &self,
        surface: ArrayView2<'_, T>,
        mask: Option<ArrayView2<'_, bool>>,
        pixel_size_m: [T; 2],
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError> {
        let mut points = Vec::with_capacity(count);
        self.sample_with(
            &mut Workspace::default(),
            surface,
            mask,
            pixel_size_m,
            count,
            &mut points,
        )?;
        Ok(points)
    }
}

/// A sampler behind a pointer is one.
macro_rules! forward {
    ($pointer:ident) => {
        impl<T: Scalar, S: ControlPointSampler<T> + ?Sized> ControlPointSampler<T> for $pointer<S> {
            fn sample_with(
                &self,
                workspace: &mut Workspace<T>,
                surface: ArrayView2<'_, T>,
                mask: Option<ArrayView2<'_, bool>>,
                pixel_size_m: [T; 2],
                count: usize,
                points: &mut Vec<Point3<T>>,
            ) -> Result<(), SfsError> {
                (**self).sample_with(workspace, surface, mask, pixel_size_m, count, points)
            }
        }
    };
}
forward!(Box);
forward!(Arc);

/// Buffers of the samplers, kept between calls.
#[derive(Debug, Default)]
pub(crate) struct SampleBuffers {
    /// Squared heights.
    squares: Vec<f64>,
    /// Weights of the lattice's nodes.
    weight: Vec<f64>,
    /// Nodes in the order they are cut or drawn, and the key of each.
    nodes: Vec<usize>,
    keys: Vec<(f64, usize)>,
    /// Curvature at the nodes.
    curvatures: Vec<f64>,
    chosen: Vec<usize>,
    strips: strips::Strips,
    pixels: Vec<[usize; 2]>,
}
