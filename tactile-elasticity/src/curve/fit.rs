//! Fitting one law to a curve.

use super::profile::{Problem, Profile};
use super::{IndentationCurve, Indenter};
use crate::error::{ElasticityError, Quantity, finite, poisson};
use crate::modulus::{ContactLaw, EstimatorKind, FitStatistics, Warning};
use tactile_core::{Interval, statistics::quantile_95};

/// Whether the force before contact is zero.
///
/// ```
/// use tactile_elasticity::curve::{Baseline, CurveOptions};
///
/// // A gauge that was tared before contact.
/// let options = CurveOptions { baseline: Baseline::Zero, ..CurveOptions::default() };
/// assert_ne!(options, CurveOptions::default());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Baseline {
    /// Whichever Schwarz's criterion prefers.
    #[default]
    Auto,
    /// Zero: the gauge was tared.
    Zero,
    /// A constant, fitted.
    Offset,
}

/// Where contact begins.
///
/// ```
/// use tactile_elasticity::curve::{ContactPoint, CurveOptions, IndentationCurve, Indenter, fit_curve};
/// use tactile_elasticity::modulus::EstimatorKind;
///
/// let z: Vec<f64> = (0..50).map(|i| i as f64 * 2e-5).collect();
/// let f: Vec<f64> = z.iter().map(|z| 2.0 * 20e3 / 0.75 * 1e-3 * (z - 2e-4).max(0.0)).collect();
/// let known = CurveOptions { contact_point: ContactPoint::At(2e-4), ..CurveOptions::default() };
/// let punch = Indenter::Punch { radius_m: 1e-3 };
/// let fit = fit_curve(&IndentationCurve::new(&z, &f)?, &punch, 0.5, EstimatorKind::FlatPunch, &known)?;
/// assert_eq!(fit.contact_point_m, 2e-4);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ContactPoint {
    /// Where the fit is best.
    #[default]
    Search,
    /// Known (m).
    At(f64),
}

/// How a curve is fitted.
///
/// ```
/// use tactile_elasticity::curve::{Baseline, ContactPoint, CurveOptions};
///
/// let options = CurveOptions { baseline: Baseline::Offset, contact_point: ContactPoint::At(1e-4) };
/// assert_ne!(options, CurveOptions::default());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CurveOptions {
    /// Force before contact.
    pub baseline: Baseline,
    /// Contact point.
    pub contact_point: ContactPoint,
}

/// A law fitted to a curve.
///
/// ```
/// use tactile_elasticity::curve::{CurveOptions, IndentationCurve, Indenter, fit_curve};
/// use tactile_elasticity::modulus::EstimatorKind;
///
/// // A cone of 45° on 20 kPa, its readings rounded to 10 µN.
/// let z: Vec<f64> = (0..60).map(|i| i as f64 * 1e-5).collect();
/// let force = |d: f64| std::f64::consts::FRAC_2_PI * 20e3 / 0.75 * d * d;
/// let f: Vec<f64> = z.iter().map(|d| (force(*d) * 1e5).round() / 1e5).collect();
/// let cone = Indenter::Cone { half_angle_tangent: 1.0 };
/// let fit = fit_curve(&IndentationCurve::new(&z, &f)?, &cone, 0.5, EstimatorKind::Cone, &CurveOptions::default())?;
/// assert!((fit.youngs_modulus_pa - 20e3).abs() < 4.0 * fit.standard_error_pa);
/// assert!(fit.residual_sd_n < 1e-5 && fit.fitted_n.len() == 60);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct CurveFit {
    /// Which law.
    pub model: EstimatorKind,
    /// Young's modulus of the sample.
    pub youngs_modulus_pa: f64,
    /// Its standard error, from the 95 % interval's width.
    pub standard_error_pa: f64,
    /// 95 % interval by profile likelihood, and by the error that finite strain makes in the law.
    pub interval_95: Interval,
    /// Relative standard error of the law itself, which is part of the interval.
    pub model_error: f64,
    /// Position where contact begins.
    pub contact_point_m: f64,
    /// Force before contact.
    pub offset_n: f64,
    /// Standard deviation of the residuals.
    pub residual_sd_n: f64,
    /// Correlation of each residual with the next; near zero where the law is right.
    pub residual_autocorrelation: f64,
    /// Fitted force at every position.
    pub fitted_n: Vec<f64>,
    /// Largest a/R, for spheres.
    pub contact_ratio: Option<f64>,
    /// Information criteria.
    pub statistics: FitStatistics,
    /// Where the law's assumptions fail; their load is the curve's last point.
    pub warnings: Vec<Warning>,
}

/// Fits one law of a rigid `indenter` on a sample with Poisson ratio `nu`.
///
/// # Errors
/// [`ElasticityError::OutOfRange`] where the law does not reach as far as the curve or does not belong to the indenter;
/// [`ElasticityError::PoissonRatio`] and the indenter's own.
///
/// ```
/// use tactile_elasticity::curve::{CurveOptions, IndentationCurve, Indenter, fit_curve};
/// use tactile_elasticity::modulus::EstimatorKind;
/// // A 1 mm punch on 20 kPa, contact at 0.2 mm.
/// let z: Vec<f64> = (0..50).map(|i| i as f64 * 2e-5).collect();
/// let f: Vec<f64> = z.iter().map(|z| 2.0 * 20e3 / 0.75 * 1e-3 * (z - 2e-4).max(0.0)).collect();
/// let curve = IndentationCurve::new(&z, &f)?;
/// let punch = Indenter::Punch { radius_m: 1e-3 };
/// let fit = fit_curve(&curve, &punch, 0.5, EstimatorKind::FlatPunch, &CurveOptions::default())?;
/// assert!((fit.youngs_modulus_pa - 20e3).abs() < 1e-3 && (fit.contact_point_m - 2e-4).abs() < 1e-9);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn fit_curve(
    curve: &IndentationCurve,
    indenter: &Indenter,
    nu: f64,
    model: EstimatorKind,
    options: &CurveOptions,
) -> Result<CurveFit, ElasticityError> {
    let unreachable = ElasticityError::OutOfRange {
        quantity: Quantity::Indentation,
        found: curve.span().1 - curve.span().0,
        limit: 0.0,
    };
    let law = indenter.law(model, poisson(nu)?)?.ok_or(unreachable)?;
    let solve = |offset: bool| {
        let problem = Problem {
            curve,
            law: &*law,
            offset,
        };
        solve(&problem, options.contact_point).map(|p| (problem, p))
    };
    let (problem, best) = match options.baseline {
        Baseline::Zero => solve(false)?,
        Baseline::Offset => solve(true)?,
        Baseline::Auto => {
            let (plain, shifted) = (solve(false), solve(true)?);
            match plain {
                Ok(plain) if !worth_an_offset(&plain.1, &shifted.1, curve.force_n().len()) => plain,
                _ => shifted,
            }
        }
    };
    Ok(report(&problem, &best, nu, options, indenter))
}

fn solve(problem: &Problem<'_>, contact: ContactPoint) -> Result<Profile, ElasticityError> {
    let best = match contact {
        ContactPoint::Search => problem.best(),
        ContactPoint::At(z) => problem.at(finite(z, Quantity::Indentation)?),
    };
    let (first, last) = problem.curve.span();
    best.ok_or(ElasticityError::OutOfRange {
        quantity: Quantity::Indentation,
        found: last - first,
        limit: 0.0,
    })
}

/// n ln(S₀/S₁) > ln n.
fn worth_an_offset(plain: &Profile, shifted: &Profile, n: usize) -> bool {
    let n = n as f64;
    n * (plain.squares / shifted.squares).ln() > n.ln()
}

fn report(
    problem: &Problem<'_>,
    best: &Profile,
    nu: f64,
    options: &CurveOptions,
    indenter: &Indenter,
) -> CurveFit {
    let (curve, law) = (problem.curve, problem.law);
    let n = curve.force_n().len();
    let parameters = 1
        + usize::from(problem.offset)
        + usize::from(options.contact_point == ContactPoint::Search);
    let fitted_n: Vec<f64> = curve
        .position_m()
        .iter()
        .map(|&z| force(law, best, z))
        .collect();
    let residuals: Vec<f64> = curve
        .force_n()
        .iter()
        .zip(&fitted_n)
        .map(|(f, g)| f - g)
        .collect();
    let correlation = autocorrelation(&residuals);
    let degrees = n - parameters;
    let limits = interval(
        problem,
        best,
        degrees,
        inflation(correlation),
        options.contact_point,
    );
    let to_modulus = 1.0 - nu * nu;
    let minus_two_log = n as f64 * (best.squares / n as f64).ln();
    let depth = curve.span().1 - best.contact_m;
    let model_error = indenter.model_error(law, depth, nu);
    let (lower, upper) = widened(limits, best.modulus, model_error);
    let (lower, upper) = (lower * to_modulus, upper * to_modulus);
    let contact_ratio = law.contact_ratio(None, Some(depth));
    CurveFit {
        model: law.kind(),
        youngs_modulus_pa: best.modulus * to_modulus,
        standard_error_pa: (upper - lower) / (2.0 * quantile_95(Some(degrees as f64))),
        interval_95: Interval::new(lower, Some(upper)),
        model_error,
        contact_point_m: best.contact_m,
        offset_n: best.offset,
        residual_sd_n: (best.squares / degrees as f64).sqrt(),
        residual_autocorrelation: correlation,
        fitted_n,
        contact_ratio,
        // The variance is a parameter too.
        statistics: FitStatistics::new(n, parameters + 1, best.squares, minus_two_log),
        warnings: warnings(law, depth, contact_ratio, n - 1),
    }
}

/// Limits around a modulus with the law's own standard error of ln F, which no number of points averages away.
fn widened((lower, upper): (f64, f64), modulus: f64, model_error: f64) -> (f64, f64) {
    if model_error == 0.0 {
        return (lower, upper);
    }
    let own = quantile_95(None) * model_error;
    let below = (modulus / lower).ln().hypot(own);
    let above = (upper / modulus).ln().hypot(own);
    (modulus * (-below).exp(), modulus * above.exp())
}

fn force(law: &dyn ContactLaw, p: &Profile, z: f64) -> f64 {
    let d = z - p.contact_m;
    let pressed = if d > 0.0 {
        law.of_indentation(d, 0.0)
            .map_or(f64::NAN, |l| l.value.exp())
    } else {
        0.0
    };
    p.offset + p.modulus * pressed
}

/// Lag-one autocorrelation.
fn autocorrelation(r: &[f64]) -> f64 {
    let total: f64 = r.iter().map(|x| x * x).sum();
    if total > 0.0 {
        r.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / total
    } else {
        0.0
    }
}

/// n points that follow one another say as much as n(1 − ρ)/(1 + ρ) that do not.
fn inflation(correlation: f64) -> f64 {
    ((1.0 + correlation.max(0.0)) / (1.0 - correlation.max(0.0))).max(1.0)
}

/// Moduli between which S ≤ S_min (1 + t² inflation/ν), by bisection of the profile on either side.
fn interval(
    p: &Problem<'_>,
    best: &Profile,
    degrees: usize,
    inflation: f64,
    contact: ContactPoint,
) -> (f64, f64) {
    let t = quantile_95(Some(degrees as f64));
    let bound = best.squares * (1.0 + t * t * inflation / degrees as f64);
    let reach = 0.5 * (p.curve.span().1 - best.contact_m);
    let inside = |ln_ratio: f64| {
        let modulus = best.modulus * ln_ratio.exp();
        let profile = match contact {
            ContactPoint::Search => p.best_at_modulus(best.contact_m, reach, modulus),
            ContactPoint::At(z) => p.at_modulus(z, modulus),
        };
        profile.is_some_and(|q| q.squares <= bound)
    };
    let limit = |sign: f64| best.modulus * (sign * reach_of(|step| inside(sign * step))).exp();
    (limit(-1.0), limit(1.0))
}

/// How far from zero `inside` holds, by doubling and bisection.
fn reach_of(inside: impl Fn(f64) -> bool) -> f64 {
    let mut step = 1e-6;
    while step < 20.0 && inside(step) {
        step *= 2.0;
    }
    let (mut low, mut high) = (0.5 * step, step);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if inside(middle) {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

fn warnings(law: &dyn ContactLaw, depth: f64, ratio: Option<f64>, load: usize) -> Vec<Warning> {
    let limit = law.contact_ratio_limit();
    let mut all = Vec::new();
    if let Some(ratio) = ratio.filter(|&r| r > limit) {
        all.push(Warning::LargeContact { load, ratio, limit });
    }
    if let Some((ratio, limit)) = law.layer_ratio(None, Some(depth)).filter(|(r, l)| r > l) {
        all.push(Warning::ThinLayer { load, ratio, limit });
    }
    all
}
