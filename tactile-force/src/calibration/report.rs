//! How well a calibration fits its pairs.

use super::{Branch, CalibrationPair, least_squares::Fit};
use crate::{Estimate, Real};

/// Why a fit stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum StopReason {
    /// Solved without iterating.
    Direct,
    /// The last step was below the tolerance.
    Converged,
    /// The iterations ran out first.
    IterationLimit,
}

/// The difference between loading and unloading.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Hysteresis<T> {
    /// Greatest difference of the two branches at one pixel value, loading minus unloading, in newtons.
    pub greatest_n: T,
    /// Mean difference over the range both branches cover, and its standard error, in newtons.
    pub mean_n: Estimate<T>,
    /// |greatest| as a share of the full scale.
    pub share_of_full_scale: T,
}

/// Quality of a calibration.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CalibrationReport<T> {
    /// Number of pairs.
    pub pairs: usize,
    /// Number of parameters fitted.
    pub parameters: usize,
    /// Coefficient of determination, 1 − Σr²/Σ(F − F̄)².
    pub r_squared: T,
    /// Standard deviation of the residuals, √(Σr²/(n − p)); a robust scale where outliers were discounted. Newtons.
    pub residual_sd_n: T,
    /// Residual of every pair, measured minus fitted, in newtons.
    pub residuals_n: Vec<T>,
    /// Weight of every pair: 1 for a trusted one, 0 for an outlier that counts nothing.
    pub weights: Vec<T>,
    /// Loading against unloading; `None` unless both branches were given and overlap.
    pub hysteresis: Option<Hysteresis<T>>,
    /// Greatest departure of the fitted curve from the straight line through its data, as a share of the full scale.
    pub linearity_error: T,
    /// Mean sensitivity over the range, (F(V₁) − F(V₀))/(V₁ − V₀), in newtons per grey level.
    pub sensitivity_n: T,
    /// Smallest force resolved: three residual standard deviations, in newtons.
    pub smallest_force_n: T,
    /// Greatest force minus least force of the pairs, in newtons.
    pub full_scale_n: T,
    /// The curve rises everywhere in its range.
    pub monotone: bool,
    /// Solves, one if nothing was reweighted.
    pub iterations: usize,
    /// Why the fit stopped.
    pub stop: StopReason,
}

/// What a report needs to know of the curve itself.
pub(super) struct Shape {
    pub(super) linearity_error: f64,
    pub(super) sensitivity: f64,
    pub(super) monotone: bool,
}

pub(super) fn build<T: Real>(pairs: &[CalibrationPair<T>], fit: &Fit, shape: Shape) -> CalibrationReport<T> {
    let forces: Vec<f64> = pairs.iter().map(|p| p.force_n.as_f64()).collect();
    let mean = forces.iter().sum::<f64>() / forces.len() as f64;
    let total: f64 = forces.iter().map(|f| (f - mean).powi(2)).sum();
    let left: f64 = fit.residuals.iter().map(|r| r * r).sum();
    let full_scale = full_scale(&forces);
    let cast = |values: &[f64]| values.iter().map(|&v| T::nearest(v)).collect();
    CalibrationReport {
        pairs: pairs.len(),
        parameters: fit.coefficients.len(),
        r_squared: T::nearest(1.0 - left / total),
        residual_sd_n: T::nearest(fit.residual_sd),
        residuals_n: cast(&fit.residuals),
        weights: cast(&fit.weights),
        hysteresis: hysteresis(pairs, &fit.residuals, full_scale),
        linearity_error: T::nearest(shape.linearity_error),
        sensitivity_n: T::nearest(shape.sensitivity),
        smallest_force_n: T::nearest(3.0 * fit.residual_sd),
        full_scale_n: T::nearest(full_scale),
        monotone: shape.monotone,
        iterations: fit.iterations,
        stop: fit.stop,
    }
}

pub(super) fn full_scale(forces: &[f64]) -> f64 {
    let least = forces.iter().copied().fold(f64::INFINITY, f64::min);
    forces.iter().copied().fold(f64::NEG_INFINITY, f64::max) - least
}

/// Compares the residuals of each branch with the other branch's, interpolated at the same pixel value. Residuals are
/// nearly flat where forces are steep, so that interpolation adds next to nothing.
fn hysteresis<T: Real>(
    pairs: &[CalibrationPair<T>],
    residuals: &[f64],
    full_scale: f64,
) -> Option<Hysteresis<T>> {
    let branch = |wanted: Branch| {
        let mut points: Vec<(f64, f64)> = pairs
            .iter()
            .zip(residuals)
            .filter(|(p, _)| p.branch == wanted)
            .map(|(p, &r)| (p.integrated_pixel_value.as_f64(), r))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let (up, down) = (branch(Branch::Loading), branch(Branch::Unloading));
    let at_loading = up.iter().filter_map(|&(v, r)| interpolate(&down, v).map(|other| r - other));
    let at_unloading = down.iter().filter_map(|&(v, r)| interpolate(&up, v).map(|other| other - r));
    let differences: Vec<f64> = at_loading.chain(at_unloading).collect();
    let greatest = differences.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n;
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0) / n;
    Some(Hysteresis {
        greatest_n: T::nearest(greatest),
        mean_n: Estimate::nearest(mean, variance),
        share_of_full_scale: T::nearest(greatest.abs() / full_scale),
    })
}

/// Piecewise linear through points sorted by abscissa; `None` outside them.
fn interpolate(points: &[(f64, f64)], v: f64) -> Option<f64> {
    let after = points.partition_point(|p| p.0 < v);
    let &(v1, r1) = points.get(after)?;
    if v1 == v {
        return Some(r1);
    }
    let &(v0, r0) = points.get(after.checked_sub(1)?)?;
    Some(r0 + (r1 - r0) * (v - v0) / (v1 - v0))
}
