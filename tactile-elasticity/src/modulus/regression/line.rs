//! A straight line through points with errors in both coordinates.

use crate::modulus::statistics::chi_squared_tail;
use tactile_core::Estimate;

/// A straight line with its errors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    pub(super) slope: f64,
    pub(super) intercept: f64,
    pub(super) slope_error: f64,
    pub(super) intercept_error: f64,
    pub(super) chi_squared: f64,
    pub(super) degrees: usize,
    pub(super) learnt: bool,
    pub(super) excess: Option<f64>,
}

pub(super) struct Point {
    pub(super) load: usize,
    pub(super) strain: Estimate,
    pub(super) stress: Estimate,
}

impl Line {
    /// The line through the points, or through them and the origin; weighted by their errors where these are known. The
    /// weights depend on the slope, so that the fit is iterated.
    pub(super) fn fit(points: &[Point], free: bool, known: bool) -> Self {
        let mut line = Self::weighted(points, |_| 1.0, free, false);
        if !known {
            return line;
        }
        for _ in 0..50 {
            let slope = line.slope;
            let variance = |p: &Point| {
                p.stress.standard_error.powi(2) + (slope * p.strain.standard_error).powi(2)
            };
            let floor = points.iter().map(variance).fold(0.0, f64::max) * 1e-12;
            line = Self::weighted(points, |p| 1.0 / variance(p).max(floor), free, true);
            if (line.slope - slope).abs() <= 1e-12 * slope.abs() {
                break;
            }
        }
        line
    }

    /// Weighted least squares about the weighted centre, which keeps the two parameters apart.
    fn weighted(points: &[Point], weight: impl Fn(&Point) -> f64, free: bool, known: bool) -> Self {
        let sum = |f: &dyn Fn(&Point) -> f64| points.iter().map(|p| weight(p) * f(p)).sum::<f64>();
        let total = sum(&|_| 1.0);
        let (cx, cy) = if free {
            (
                sum(&|p| p.strain.value) / total,
                sum(&|p| p.stress.value) / total,
            )
        } else {
            (0.0, 0.0)
        };
        let sxx = sum(&|p| (p.strain.value - cx).powi(2));
        let slope = sum(&|p| (p.strain.value - cx) * (p.stress.value - cy)) / sxx;
        let intercept = cy - slope * cx;
        let chi_squared = sum(&|p| (p.stress.value - intercept - slope * p.strain.value).powi(2));
        let degrees = points.len() - if free { 2 } else { 1 };
        let reduced = chi_squared / degrees.max(1) as f64;
        let excess = (known && degrees > 0 && chi_squared_tail(chi_squared, degrees) < 1e-3)
            .then_some(reduced);
        let learnt = !known || excess.is_some();
        let unit = if learnt { reduced } else { 1.0 };
        let intercept_variance = if free {
            unit * (1.0 / total + cx * cx / sxx)
        } else {
            0.0
        };
        Self {
            slope,
            intercept,
            slope_error: (unit / sxx).sqrt(),
            intercept_error: intercept_variance.sqrt(),
            chi_squared,
            degrees,
            learnt,
            excess,
        }
    }
}
