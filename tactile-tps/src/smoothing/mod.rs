//! How closely a spline follows its targets.

mod blocked;
mod robust;

use crate::{Scalar, TpsError};
pub use blocked::StrainSpline;
pub use robust::{RobustFit, RobustSpline};

/// How closely the spline follows its targets.
///
/// ```
/// # use nalgebra::Point2;
/// # use tactile_tps::{FitOptions, Smoothing, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<Point2<f64>> = (0..25).map(|i| Point2::new(f64::from(i % 5), f64::from(i / 5))).collect();
/// let noise = |i: usize| 0.01 * ((i * 7919 % 101) as f64 / 50.0 - 1.0);
/// let targets: Vec<_> = sources.iter().enumerate().map(|(i, p)| Point2::new(p.x + noise(i), p.y)).collect();
/// let options = FitOptions::default().with_smoothing(Smoothing::Gcv)?;
/// let smooth = ThinPlateSpline::fit(&sources, &targets, &options)?;
/// let through = ThinPlateSpline::fit(&sources, &targets, &options.with_smoothing(Smoothing::None)?)?;
/// assert!(smooth.report.lambda > 0.0 && smooth.bending_energy() < through.bending_energy());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Smoothing<T> {
    /// Interpolate: λ = 0.
    #[default]
    None,
    /// Minimise Σ weightᵢ |f(xᵢ) − yᵢ|² + λ wᵀKw for this λ ≥ 0, in the units of the points and the kernel.
    Lambda(T),
    /// The λ of least generalised cross-validation (Craven & Wahba 1979; Golub, Heath & Wahba 1979).
    Gcv,
}

/// A λ must be finite and not negative.
pub(crate) fn validate_smoothing<T: Scalar>(smoothing: &Smoothing<T>) -> Result<(), TpsError> {
    match smoothing {
        Smoothing::Lambda(lambda) if !(lambda.widen() >= 0.0 && lambda.widen().is_finite()) => {
            Err(TpsError::Lambda {
                value: lambda.widen(),
            })
        }
        _ => Ok(()),
    }
}
