//! Models of affine and rigid warps.

use nalgebra::Point;

use crate::{Affine, Rigid, Scalar, TpsError, Warp, WarpModel};

/// The [`WarpModel`] of [`Affine::fit`].
///
/// ```
/// # use nalgebra::Point2;
/// # use tactile_tps::{AffineModel, Warp, WarpModel};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let doubled = sources.map(|p| p * 2.0);
/// let warp: Box<dyn Warp<f64, 2> + Send + Sync> = AffineModel.fit(&sources, &doubled, None)?;
/// assert!((warp.apply(&Point2::new(5.0, 1.0)) - Point2::new(10.0, 2.0)).norm() < 1e-14);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AffineModel;

/// The [`WarpModel`] of [`Rigid::fit`].
///
/// ```
/// # use nalgebra::{Point2, Vector2};
/// # use tactile_tps::{RigidModel, WarpModel};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let shifted = sources.map(|p| p + Vector2::new(1.0, 2.0));
/// let warp = RigidModel.fit(&sources, &shifted, None)?;
/// assert!((warp.apply(&Point2::origin()) - Point2::new(1.0, 2.0)).norm() < 1e-14);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RigidModel;

/// A model whose one rule is the fit of its type of warp.
macro_rules! model {
    ($model:ident fits $warp:ident) => {
        impl<T: Scalar, const D: usize> WarpModel<T, D> for $model {
            fn fit(
                &self,
                sources: &[Point<T, D>],
                targets: &[Point<T, D>],
                weights: Option<&[T]>,
            ) -> Result<Box<dyn Warp<T, D> + Send + Sync>, TpsError> {
                Ok(Box::new($warp::fit(sources, targets, weights)?))
            }
        }
    };
}
model!(AffineModel fits Affine);
model!(RigidModel fits Rigid);
