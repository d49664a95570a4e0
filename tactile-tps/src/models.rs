//! Models of affine and rigid warps.

use nalgebra::Point;

use crate::{Affine, Scalar, TpsError, Warp, WarpModel};

/// The [`WarpModel`] of affine maps: all of them, or rotations and translations alone.
///
/// ```
/// # use nalgebra::{Point2, Vector2};
/// # use tactile_tps::{AffineModel, Warp, WarpModel};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let doubled = sources.map(|p| p * 2.0 + Vector2::new(1.0, 2.0));
/// let warp: Box<dyn Warp<f64, 2> + Send + Sync> = AffineModel::General.fit(&sources, &doubled, None)?;
/// assert!((warp.apply(&Point2::new(5.0, 1.0)) - Point2::new(11.0, 4.0)).norm() < 1e-14);
/// let motion = AffineModel::Rigid.fit(&sources, &doubled, None)?;
/// assert!((motion.jacobian(&Point2::origin()).determinant() - 1.0_f64).abs() < 1e-14);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum AffineModel {
    /// Any affine map: [`Affine::fit`].
    #[default]
    General,
    /// A rotation and a translation: [`Affine::fit_rigid`].
    Rigid,
}

impl<T: Scalar, const D: usize> WarpModel<T, D> for AffineModel {
    fn fit(
        &self,
        sources: &[Point<T, D>],
        targets: &[Point<T, D>],
        weights: Option<&[T]>,
    ) -> Result<Box<dyn Warp<T, D> + Send + Sync>, TpsError> {
        let fit = match self {
            Self::General => Affine::fit,
            Self::Rigid => Affine::fit_rigid,
        };
        Ok(Box::new(fit(sources, targets, weights)?))
    }
}
