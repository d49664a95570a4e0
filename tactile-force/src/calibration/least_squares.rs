//! Least squares with a few parameters, and iteratively reweighted least squares for outliers.

use nalgebra::{DMatrix, DVector};

use super::options::Robustness;
use crate::error::ForceError;
use tactile_core::StopReason;

const HUBER: f64 = 1.345;
const TUKEY: f64 = 4.685;
/// Turns the median absolute deviation of a normal sample into its standard deviation, 1/Φ⁻¹(3/4).
const MAD_TO_SD: f64 = 1.482_602_218_505_602;
const SWEEPS: usize = 100;

/// A solved linear model y = X c + e.
pub(crate) struct Fit {
    pub(crate) coefficients: Vec<f64>,
    /// Covariance of the coefficients.
    pub(crate) covariance: DMatrix<f64>,
    pub(crate) residuals: Vec<f64>,
    /// Weight of every observation, 1 for a trusted one.
    pub(crate) weights: Vec<f64>,
    /// Standard deviation of the errors: least squares, or robust scale.
    pub(crate) residual_sd: f64,
    pub(crate) iterations: usize,
    pub(crate) stop: StopReason,
}

/// Solves for the coefficients of the design's columns.
pub(crate) fn solve(
    design: &DMatrix<f64>,
    y: &[f64],
    robustness: Robustness,
) -> Result<Fit, ForceError> {
    let y = DVector::from_column_slice(y);
    let mut weights = vec![1.0; y.len()];
    let mut coefficients = weighted(design, &y, &weights)?;
    let (mut iterations, mut stop) = (1, StopReason::Direct);
    let stages: &[Robustness] = match robustness {
        Robustness::None => &[],
        Robustness::Huber => &[Robustness::Huber],
        Robustness::Tukey => &[Robustness::Huber, Robustness::Tukey],
    };
    let mut scale = 0.0;
    for &stage in stages {
        let sweeps;
        (scale, sweeps, stop) = reweighted(design, &y, stage, &mut coefficients, &mut weights)?;
        iterations += sweeps;
    }
    let residuals: Vec<f64> = (&y - design * &coefficients).iter().copied().collect();
    let (variance, residual_sd) = error_variance(robustness, &residuals, scale, design.ncols());
    let covariance = inverse_gram(design)? * variance;
    let coefficients = coefficients.iter().copied().collect();
    Ok(Fit {
        coefficients,
        covariance,
        residuals,
        weights,
        residual_sd,
        iterations,
        stop,
    })
}

/// Solves again and again with the weights of the last residuals until the curve stands still; returns the robust scale, the
/// number of solves and why they stopped.
fn reweighted(
    design: &DMatrix<f64>,
    y: &DVector<f64>,
    stage: Robustness,
    coefficients: &mut DVector<f64>,
    weights: &mut [f64],
) -> Result<(f64, usize, StopReason), ForceError> {
    let mut scale = 0.0;
    for sweep in 1..=SWEEPS {
        let residuals = y - design * &*coefficients;
        scale = robust_scale(residuals.as_slice(), design.ncols());
        for (w, r) in weights.iter_mut().zip(residuals.iter()) {
            *w = robust_weight(stage, *r, scale);
        }
        let next = weighted(design, y, weights)?;
        let step = (design * (&next - &*coefficients)).amax();
        *coefficients = next;
        if step <= 1e-10 * scale {
            return Ok((scale, sweep, StopReason::Converged));
        }
    }
    Ok((scale, SWEEPS, StopReason::IterationLimit))
}

fn weighted(
    design: &DMatrix<f64>,
    y: &DVector<f64>,
    weights: &[f64],
) -> Result<DVector<f64>, ForceError> {
    let root = DVector::from_iterator(y.len(), weights.iter().map(|w| w.sqrt()));
    let mut scaled = design.clone();
    for mut column in scaled.column_iter_mut() {
        column.component_mul_assign(&root);
    }
    let qr = scaled.qr();
    let rhs = qr.q().transpose() * y.component_mul(&root);
    let r = qr.r();
    check_rank(&r)?;
    r.solve_upper_triangular(&rhs)
        .ok_or(ForceError::DegeneratePairs { span: 0.0 })
}

/// (XᵀX)⁻¹ by QR.
fn inverse_gram(design: &DMatrix<f64>) -> Result<DMatrix<f64>, ForceError> {
    let r = design.clone().qr().r();
    check_rank(&r)?;
    let identity = DMatrix::identity(r.ncols(), r.ncols());
    let inverse = r
        .solve_upper_triangular(&identity)
        .ok_or(ForceError::DegeneratePairs { span: 0.0 })?;
    Ok(&inverse * inverse.transpose())
}

/// The design's columns are of order one, so a pivot at rounding level means they do not span.
fn check_rank(r: &DMatrix<f64>) -> Result<(), ForceError> {
    let diagonal = r.diagonal().abs();
    let (least, greatest) = (diagonal.min(), diagonal.max());
    if least > 1e-13 * greatest {
        Ok(())
    } else {
        Err(ForceError::DegeneratePairs { span: least })
    }
}

/// Normalised median absolute residual, with the p residuals that a fit makes zero left out.
fn robust_scale(residuals: &[f64], parameters: usize) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let kept = &sizes[parameters.min(sizes.len() - 1)..];
    MAD_TO_SD * 0.5 * (kept[kept.len() / 2] + kept[(kept.len() - 1) / 2])
}

fn robust_weight(stage: Robustness, residual: f64, scale: f64) -> f64 {
    if residual == 0.0 {
        return 1.0;
    }
    let u = residual.abs() / scale;
    match stage {
        Robustness::None => 1.0,
        Robustness::Huber => (HUBER / u).min(1.0),
        Robustness::Tukey => (1.0 - (u / TUKEY).powi(2)).max(0.0).powi(2),
    }
}

/// Variance to put before (XᵀX)⁻¹, and the standard deviation of one error.
///
/// Robust fits take Huber's K² [s² Σψ²/(n − p)] / (mean ψ′)² (Huber 1981, section 7.6).
fn error_variance(robustness: Robustness, residuals: &[f64], scale: f64, p: usize) -> (f64, f64) {
    let n = residuals.len() as f64;
    let freedom = n - p as f64;
    if robustness == Robustness::None || scale == 0.0 {
        let variance = residuals.iter().map(|r| r * r).sum::<f64>() / freedom;
        return (variance, variance.sqrt());
    }
    let psi = |r: f64| robust_weight(robustness, r, scale) * r / scale;
    let slope = |r: f64| match robustness {
        Robustness::Huber => f64::from(r.abs() <= HUBER * scale),
        _ => {
            let q = (r / (TUKEY * scale)).powi(2);
            if q < 1.0 {
                (1.0 - q) * (1.0 - 5.0 * q)
            } else {
                0.0
            }
        }
    };
    let mean = residuals.iter().map(|&r| slope(r)).sum::<f64>() / n;
    let spread = residuals
        .iter()
        .map(|&r| (slope(r) - mean).powi(2))
        .sum::<f64>()
        / n;
    let correction = 1.0 + p as f64 / n * spread / (mean * mean);
    let psi2 = residuals.iter().map(|&r| psi(r).powi(2)).sum::<f64>() / freedom;
    (
        correction.powi(2) * scale * scale * psi2 / (mean * mean),
        scale,
    )
}
