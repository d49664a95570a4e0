//! Maps of space onto itself, and models that find one from pairs of points.

use nalgebra::{Point, SMatrix};

use crate::{Scalar, TpsError, error::Input};

/// A map of `D`-dimensional space onto itself. Object safe: a `Box<dyn Warp<f64, 3>>` is a warp.
///
/// ```
/// use nalgebra::{Point2, Matrix2, Vector2};
/// use tactile_tps::{Affine, Warp};
/// let warp: Box<dyn Warp<f64, 2>> = Box::new(Affine::new(Matrix2::identity() * 2.0, Vector2::new(1.0, 0.0)));
/// assert_eq!(warp.apply(&Point2::new(1.0, 3.0)), Point2::new(3.0, 6.0));
/// ```
pub trait Warp<T: Scalar, const D: usize> {
    /// The image of a point.
    fn apply(&self, point: &Point<T, D>) -> Point<T, D>;

    /// The Jacobian ∂fᵢ/∂xⱼ at a point (row i, column j); for a deformation this is the deformation gradient.
    fn jacobian(&self, point: &Point<T, D>) -> SMatrix<T, D, D>;

    /// The images of many points, into the caller's memory.
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    fn apply_into(&self, points: &[Point<T, D>], images: &mut [Point<T, D>]) -> Result<(), TpsError> {
        same_length(points.len(), images.len())?;
        points.iter().zip(images).for_each(|(point, image)| *image = self.apply(point));
        Ok(())
    }

    /// The Jacobians at many points, into the caller's memory.
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    fn jacobian_into(
        &self,
        points: &[Point<T, D>],
        jacobians: &mut [SMatrix<T, D, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), jacobians.len())?;
        points.iter().zip(jacobians).for_each(|(point, jacobian)| *jacobian = self.jacobian(point));
        Ok(())
    }
}

impl<T: Scalar, const D: usize, W: Warp<T, D> + ?Sized> Warp<T, D> for Box<W> {
    fn apply(&self, point: &Point<T, D>) -> Point<T, D> {
        (**self).apply(point)
    }
    fn jacobian(&self, point: &Point<T, D>) -> SMatrix<T, D, D> {
        (**self).jacobian(point)
    }
    fn apply_into(&self, points: &[Point<T, D>], images: &mut [Point<T, D>]) -> Result<(), TpsError> {
        (**self).apply_into(points, images)
    }
    fn jacobian_into(
        &self,
        points: &[Point<T, D>],
        jacobians: &mut [SMatrix<T, D, D>],
    ) -> Result<(), TpsError> {
        (**self).jacobian_into(points, jacobians)
    }
}

/// A family of warps with a rule to choose one from weighted pairs of points.
pub trait WarpModel<T: Scalar, const D: usize> {
    /// The warp it fits.
    type Warp: Warp<T, D>;

    /// The warp that takes each source to its target as nearly as the model's rule says; no weights means all one.
    ///
    /// # Errors
    /// See [`TpsError`].
    fn fit(
        &self,
        sources: &[Point<T, D>],
        targets: &[Point<T, D>],
        weights: Option<&[T]>,
    ) -> Result<Self::Warp, TpsError>;
}

/// The output must be as long as the input.
pub(crate) fn same_length(expected: usize, found: usize) -> Result<(), TpsError> {
    if expected == found { Ok(()) } else { Err(TpsError::Length { input: Input::Output, expected, found }) }
}
