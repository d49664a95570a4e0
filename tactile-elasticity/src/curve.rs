//! Force–indentation curves: contact point, modulus, and which law fits.
//!
//! A curve is F_i at positions z_i of a rigid indenter. With contact at z₀,
//!
//! F(z) = F₀ + E* f(z − z₀) beyond z₀, F₀ before,
//!
//! which is linear in (F₀, E*) at a given z₀: the squared residuals, minimised over these, are a
//! function of z₀ alone, scanned and then refined. Intervals are those of the profile likelihood.
//! Residuals that follow one another (the sign of a wrong law) widen them.

use crate::contact::{Bond, Waveguide};
use crate::error::{ElasticityError, Quantity, poisson};
pub use crate::modulus::SelectionReason;
use crate::modulus::{
    ConeLaw, ContactLaw, EstimatorKind, FitStatistics, HertzLaw, LayerLaw, LayerTheory, NoSlipLaw,
    PunchLaw, TataraLaw, TipOnBallLaw, Warning, WaveguideLaw,
};
use crate::modulus::{akaike_weights, in_order, rank};
use crate::numerics::golden_section;
use tactile_core::{Interval, statistics::quantile_95};

/// Forces over positions, widened to f64.
///
/// ```
/// use tactile_elasticity::curve::IndentationCurve;
///
/// // In any order: a curve is sorted by position.
/// let curve = IndentationCurve::new(
///     &[3e-6, 1e-6, 2e-6, 0.0, 5e-6, 4e-6],
///     &[3e-4, 1e-4, 2e-4, 0.0, 5e-4, 4e-4],
/// )?;
/// assert_eq!((curve.position_m()[1], curve.force_n()[1]), (1e-6, 1e-4));
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct IndentationCurve {
    position_m: Vec<f64>,
    force_n: Vec<f64>,
}

// Points below which contact point, baseline, modulus and their scatter cannot be told apart.
const FEWEST_POINTS: usize = 6;

impl IndentationCurve {
    /// From positions (m, growing into the sample, in any order) and forces (N, pressing positive).
    ///
    /// # Errors
    /// [`ElasticityError::LengthMismatch`], [`ElasticityError::TooFewLoads`] below six points,
    /// [`ElasticityError::NotFinite`], and [`ElasticityError::EqualLoads`] where all forces or all
    /// positions are equal.
    pub fn new(position_m: &[f64], force_n: &[f64]) -> Result<Self, ElasticityError> {
        let found = force_n.len();
        Quantity::Force.entries(found, position_m.len())?;
        if found < FEWEST_POINTS {
            return Err(ElasticityError::TooFewLoads {
                expected: FEWEST_POINTS,
                found,
            });
        }
        let [position_m, force_n] = [position_m, force_n].map(|v| v.to_vec());
        for (values, quantity) in [
            (&position_m, Quantity::Indentation),
            (&force_n, Quantity::Force),
        ] {
            for &value in values {
                quantity.finite(value)?;
            }
            if values.iter().all(|x| *x == values[0]) {
                return Err(ElasticityError::EqualLoads);
            }
        }
        let mut order: Vec<usize> = (0..found).collect();
        order.sort_by(|&i, &j| position_m[i].total_cmp(&position_m[j]));
        let sorted = |v: Vec<f64>| order.iter().map(|&i| v[i]).collect();
        Ok(Self {
            position_m: sorted(position_m),
            force_n: sorted(force_n),
        })
    }

    /// Positions, ascending.
    pub fn position_m(&self) -> &[f64] {
        &self.position_m
    }

    /// Forces, in the order of the positions.
    pub fn force_n(&self) -> &[f64] {
        &self.force_n
    }

    /// First and last position.
    fn span(&self) -> (f64, f64) {
        (
            self.position_m[0],
            self.position_m[self.position_m.len() - 1],
        )
    }

    fn unreachable(&self) -> ElasticityError {
        let (first, last) = self.span();
        Quantity::Indentation.beyond(last - first, 0.0)
    }
}

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
/// use tactile_elasticity::curve::{
///     ContactPoint, CurveOptions, IndentationCurve, Indenter, fit_curve,
/// };
/// use tactile_elasticity::modulus::EstimatorKind;
///
/// let z: Vec<f64> = (0..50).map(|i| i as f64 * 2e-5).collect();
/// let f: Vec<f64> = z
///     .iter()
///     .map(|z| 2.0 * 20e3 / 0.75 * 1e-3 * (z - 2e-4).max(0.0))
///     .collect();
/// let known = CurveOptions {
///     contact_point: ContactPoint::At(2e-4),
///     ..CurveOptions::default()
/// };
/// let punch = Indenter::Punch { radius_m: 1e-3 };
/// let fit = fit_curve(
///     &IndentationCurve::new(&z, &f)?,
///     &punch,
///     0.5,
///     EstimatorKind::FlatPunch,
///     &known,
/// )?;
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
/// let options = CurveOptions {
///     baseline: Baseline::Offset,
///     contact_point: ContactPoint::At(1e-4),
/// };
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
/// let cone = Indenter::Cone {
///     half_angle_tangent: 1.0,
/// };
/// let fit = fit_curve(
///     &IndentationCurve::new(&z, &f)?,
///     &cone,
///     0.5,
///     EstimatorKind::Cone,
///     &CurveOptions::default(),
/// )?;
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
    /// Correlation of each residual with the next. Near zero where the law is right.
    pub residual_autocorrelation: f64,
    /// Fitted force at every position.
    pub fitted_n: Vec<f64>,
    /// Largest a/R, for spheres.
    pub contact_ratio: Option<f64>,
    /// Information criteria.
    pub statistics: FitStatistics,
    /// Where the law's assumptions fail. Their load is the curve's last point.
    pub warnings: Vec<Warning>,
}

/// Fits one law of a rigid `indenter` on a sample with Poisson ratio `nu`.
///
/// # Errors
/// [`ElasticityError::OutOfRange`] where the law does not reach as far as the curve or does not
/// belong to the indenter. [`ElasticityError::PoissonRatio`] and the indenter's own.
///
/// ```
/// use tactile_elasticity::curve::{CurveOptions, IndentationCurve, Indenter, fit_curve};
/// use tactile_elasticity::modulus::EstimatorKind;
/// // A 1 mm punch on 20 kPa, contact at 0.2 mm.
/// let z: Vec<f64> = (0..50).map(|i| i as f64 * 2e-5).collect();
/// let f: Vec<f64> = z
///     .iter()
///     .map(|z| 2.0 * 20e3 / 0.75 * 1e-3 * (z - 2e-4).max(0.0))
///     .collect();
/// let curve = IndentationCurve::new(&z, &f)?;
/// let punch = Indenter::Punch { radius_m: 1e-3 };
/// let fit = fit_curve(
///     &curve,
///     &punch,
///     0.5,
///     EstimatorKind::FlatPunch,
///     &CurveOptions::default(),
/// )?;
/// assert!(
///     (fit.youngs_modulus_pa - 20e3).abs() < 1e-3 && (fit.contact_point_m - 2e-4).abs() < 1e-9
/// );
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn fit_curve(
    curve: &IndentationCurve,
    indenter: &Indenter,
    nu: f64,
    model: EstimatorKind,
    options: &CurveOptions,
) -> Result<CurveFit, ElasticityError> {
    let law = indenter.law(model, poisson(nu)?)?;
    let law = law.ok_or(curve.unreachable())?;
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
        ContactPoint::At(z) => problem.at(Quantity::Indentation.finite(z)?),
    };
    best.ok_or(problem.curve.unreachable())
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

/// Limits around a modulus with the law's own standard error of ln F, which no number of points
/// averages away.
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
    p.offset + p.modulus * shape(law, z - p.contact_m).unwrap_or(f64::NAN)
}

/// f of an indentation, zero before contact. None where the law does not reach so far.
fn shape(law: &dyn ContactLaw, indentation: f64) -> Option<f64> {
    if indentation > 0.0 {
        Some(law.log_force_at_indentation(indentation, 0.0)?.value.exp())
    } else {
        Some(0.0)
    }
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

/// The best line at one contact point.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Profile {
    contact_m: f64,
    /// E*.
    modulus: f64,
    offset: f64,
    squares: f64,
}

/// A curve, a law, and whether the force may be offset.
#[derive(Clone, Copy)]
struct Problem<'a> {
    curve: &'a IndentationCurve,
    law: &'a dyn ContactLaw,
    offset: bool,
}

// Golden sections.
const DOWN_TO_ROUNDING: usize = 70;

impl Problem<'_> {
    /// f(z − z₀) of every point. None where the law does not reach so far.
    fn shape(&self, contact: f64) -> Option<Vec<f64>> {
        let positions = self.curve.position_m().iter();
        positions.map(|z| shape(self.law, z - contact)).collect()
    }

    /// Minimum over offset and modulus.
    fn at(&self, contact: f64) -> Option<Profile> {
        let g = self.shape(contact)?;
        let f = self.curve.force_n();
        let n = g.len() as f64;
        let (mg, mf) = if self.offset {
            (g.iter().sum::<f64>() / n, f.iter().sum::<f64>() / n)
        } else {
            (0.0, 0.0)
        };
        let scale = g.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let (mut sgg, mut sgf) = (0.0, 0.0);
        for (g, f) in g.iter().zip(f) {
            sgg += ((g - mg) / scale).powi(2);
            sgf += (g - mg) / scale * (f - mf);
        }
        let modulus = sgf / sgg / scale;
        self.finish(contact, &g, modulus)
            .filter(|p| p.modulus > 0.0 && p.squares.is_finite())
    }

    /// Minimum over the offset alone.
    fn at_modulus(&self, contact: f64, modulus: f64) -> Option<Profile> {
        self.finish(contact, &self.shape(contact)?, modulus)
    }

    fn finish(&self, contact_m: f64, g: &[f64], modulus: f64) -> Option<Profile> {
        let f = self.curve.force_n();
        let rest = || g.iter().zip(f).map(|(g, f)| f - modulus * g);
        let offset = if self.offset {
            rest().sum::<f64>() / f.len() as f64
        } else {
            0.0
        };
        Some(Profile {
            contact_m,
            modulus,
            offset,
            squares: rest().map(|r| (r - offset).powi(2)).sum(),
        })
    }

    /// The contact point that leaves the least, from one span before the first point up to the
    /// fifth last point.
    fn best(&self) -> Option<Profile> {
        let (first, last) = self.curve.span();
        let z = self.curve.position_m();
        let (from, to) = (first - (last - first), z[z.len() - 5]);
        let scan = 300;
        let step = (to - from) / f64::from(scan);
        let scanned = (0..=scan).filter_map(|k| self.at(from + step * f64::from(k)));
        let start = scanned.min_by(|a, b| a.squares.total_cmp(&b.squares))?;
        let (low, high) = (
            (start.contact_m - step).max(from),
            (start.contact_m + step).min(to),
        );
        let squares = |x| self.at(x).map_or(f64::INFINITY, |profile| profile.squares);
        let refined = self.at(golden_section(low, high, DOWN_TO_ROUNDING, squares))?;
        Some(if refined.squares <= start.squares {
            refined
        } else {
            start
        })
    }

    /// The least at a given modulus, the contact point sought around `near`.
    fn best_at_modulus(&self, near: f64, reach: f64, modulus: f64) -> Option<Profile> {
        let at = |x| self.at_modulus(x, modulus);
        let squares = |x| at(x).map_or(f64::INFINITY, |profile| profile.squares);
        at(golden_section(
            near - reach,
            near + reach,
            DOWN_TO_ROUNDING,
            squares,
        ))
    }
}

/// A rigid indenter and its sample. Lengths in m.
///
/// ```
/// use tactile_elasticity::contact::Bond;
/// use tactile_elasticity::curve::Indenter;
/// use tactile_elasticity::modulus::EstimatorKind;
///
/// let on_a_layer = Indenter::Sphere {
///     radius_m: 5e-3,
///     thickness_m: Some(2e-3),
///     bond: Bond::Bonded,
/// };
/// assert_eq!(
///     on_a_layer.candidates()[0],
///     EstimatorKind::LayerIntegralEquation
/// );
/// assert_eq!(
///     Indenter::Punch { radius_m: 1e-3 }.candidates(),
///     [EstimatorKind::FlatPunch]
/// );
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Indenter {
    /// A sphere on a sample, which may be a layer.
    Sphere {
        /// Relative radius of curvature.
        radius_m: f64,
        /// Thickness of the sample on its rigid base, where it is not deep.
        thickness_m: Option<f64>,
        /// How the sample sits on its base.
        bond: Bond,
    },
    /// A flat plate on a soft ball that lies on another. The indentation is that of one contact.
    Ball {
        /// The ball's radius.
        radius_m: f64,
    },
    /// A rigid spherical tip on a soft ball that lies on a rigid plate. The indentation is the
    /// tip's travel.
    TipOnBall {
        /// The tip's radius.
        tip_radius_m: f64,
        /// The ball's radius.
        ball_radius_m: f64,
    },
    /// A flat circular punch.
    Punch {
        /// The punch's radius.
        radius_m: f64,
    },
    /// A cone.
    Cone {
        /// Tangent of the half opening angle from the axis.
        half_angle_tangent: f64,
    },
}

/// Which law to fit.
///
/// ```
/// use tactile_elasticity::curve::Model;
/// use tactile_elasticity::modulus::EstimatorKind;
///
/// assert_eq!(Model::default(), Model::Auto);
/// assert_ne!(Model::Named(EstimatorKind::HertzSphere), Model::Named(EstimatorKind::TataraSphere));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Model {
    /// The information criterion's choice among those that apply.
    #[default]
    Auto,
    /// This one.
    Named(EstimatorKind),
}

impl Indenter {
    /// The laws that apply, the most general theory first. The published layer series and contact
    /// without slip, which a curve cannot tell from contact without friction on a softer sample,
    /// only where they are asked for by name.
    pub fn candidates(&self) -> Vec<EstimatorKind> {
        use EstimatorKind as K;
        match self {
            Self::Sphere {
                thickness_m: Some(_),
                ..
            } => {
                vec![
                    K::LayerIntegralEquation,
                    K::LayerCorrectedSeries,
                    K::HertzSphere,
                ]
            }
            Self::Sphere {
                thickness_m: None, ..
            } => vec![K::HertzSphere],
            Self::Ball { .. } => vec![K::SphereOnFlat, K::TataraSphere, K::HertzSphere],
            Self::TipOnBall { .. } => vec![K::TipOnBall],
            Self::Punch { .. } => vec![K::FlatPunch],
            Self::Cone { .. } => vec![K::Cone],
        }
    }

    /// Standard error of ln F that the law of this indenter makes at an indentation on a sample
    /// with Poisson ratio ν, by finite strain above all.
    ///
    /// Against finite elements, neo-Hookean. Half balls, ν = 0.495: Hertz's law of a ball's
    /// indentation carries 5 % too much at δ/R = 0.02, 12 % at 0.08 and 28 % at 0.21. Tatara's 5 %
    /// and 9 % at the first and last. Rigid indenters, sliding or sticking: δ/R = 0.4 takes 7 % off
    /// a sphere's force at ν = 0.495 and adds 13 % at ν = 0, where points slide inwards. A layer
    /// adds up to 12 % at δ/h = 0.3. A cone of 70.3° carries 2 % too much at ν = 0.495 and 12 % too
    /// little at ν = 0. A punch 1 % at δ/a = 0.1.
    fn model_error(&self, law: &dyn ContactLaw, indentation: f64, nu: f64) -> f64 {
        let own = law.model_error(None, Some(indentation));
        let ratio = law.contact_ratio(None, Some(indentation)).unwrap_or(0.0);
        let inwards = 1.0 - 2.0 * nu;
        match (self, law.kind()) {
            (_, EstimatorKind::SphereOnFlat) => own,
            (_, EstimatorKind::TataraSphere) => 0.2 * ratio,
            (Self::Ball { .. } | Self::TipOnBall { .. }, _) => 0.35 * ratio + 0.5 * ratio * ratio,
            (Self::Sphere { thickness_m, .. }, _) => {
                let squeeze = thickness_m.map_or(0.0, |h| indentation / h);
                0.2 * inwards * ratio + 0.17 * ratio * ratio + 0.4 * squeeze
            }
            (Self::Cone { half_angle_tangent }, _) => (0.07 + 0.34 * inwards) / half_angle_tangent,
            (Self::Punch { radius_m }, _) => 0.1 * indentation / radius_m,
        }
    }

    /// The law of a kind for this indenter. None where it does not apply.
    fn law(
        &self,
        kind: EstimatorKind,
        nu: f64,
    ) -> Result<Option<Box<dyn ContactLaw>>, ElasticityError> {
        use EstimatorKind as K;
        let law: Box<dyn ContactLaw> = match *self {
            Self::Sphere {
                radius_m,
                thickness_m,
                bond,
            } => match (kind, thickness_m) {
                (K::HertzSphere, _) => Box::new(HertzLaw::new(radius_m)?),
                (K::SphereWithoutSlip, None) => Box::new(NoSlipLaw::sphere(radius_m, nu)?),
                (kind, Some(thickness_m)) => {
                    let theory = match kind {
                        K::LayerIntegralEquation => LayerTheory::IntegralEquation,
                        K::LayerCorrectedSeries => LayerTheory::CorrectedSeries,
                        K::LayerPublishedSeries => LayerTheory::PublishedSeries,
                        _ => return Ok(None),
                    };
                    Box::new(LayerLaw::new(radius_m, thickness_m, nu, bond, theory)?.tabulated())
                }
                _ => return Ok(None),
            },
            Self::Ball { radius_m } => match kind {
                K::HertzSphere => Box::new(HertzLaw::new(radius_m)?),
                K::TataraSphere => Box::new(TataraLaw::new(radius_m, nu)?),
                K::SphereOnFlat => {
                    let flat = Waveguide::rigid();
                    Box::new(WaveguideLaw::new(radius_m, nu, &flat, Bond::Bonded)?)
                }
                _ => return Ok(None),
            },
            Self::TipOnBall {
                tip_radius_m,
                ball_radius_m,
            } if kind == K::TipOnBall => Box::new(TipOnBallLaw::new(tip_radius_m, ball_radius_m)?),
            Self::Punch { radius_m } => match kind {
                K::FlatPunch => Box::new(PunchLaw::new(radius_m)?),
                K::FlatPunchWithoutSlip => Box::new(NoSlipLaw::punch(radius_m, nu)?),
                _ => return Ok(None),
            },
            Self::Cone { half_angle_tangent } => match kind {
                K::Cone => Box::new(ConeLaw::new(half_angle_tangent)?),
                K::ConeWithoutSlip => Box::new(NoSlipLaw::cone(half_angle_tangent, nu)?),
                _ => return Ok(None),
            },
            Self::TipOnBall { .. } => return Ok(None),
        };
        Ok(Some(law))
    }
}

/// All laws tried, the best first.
///
/// ```
/// use tactile_elasticity::contact::Bond;
/// use tactile_elasticity::curve::{
///     CurveOptions, IndentationCurve, Indenter, Model, SelectionReason, select_model,
/// };
/// use tactile_elasticity::modulus::EstimatorKind;
///
/// // A 5 mm sphere on 30 kPa, deep: Hertz's law is asked for by name.
/// let z: Vec<f64> = (0..40).map(|i| i as f64 * 5e-6).collect();
/// let f: Vec<f64> = z
///     .iter()
///     .map(|d| 4.0 / 3.0 * 40e3 * 5e-3_f64.sqrt() * d.powf(1.5))
///     .collect();
/// let sphere = Indenter::Sphere {
///     radius_m: 5e-3,
///     thickness_m: None,
///     bond: Bond::Bonded,
/// };
/// let hertz = Model::Named(EstimatorKind::HertzSphere);
/// let selection = select_model(
///     &IndentationCurve::new(&z, &f)?,
///     &sphere,
///     0.5,
///     hertz,
///     &CurveOptions::default(),
/// )?;
/// assert_eq!(selection.reason, SelectionReason::Asked);
/// assert!((selection.chosen().youngs_modulus_pa / 30e3 - 1.0).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct CurveSelection {
    /// Fits. The first is the chosen one, the others follow by AICc.
    pub fits: Vec<CurveFit>,
    /// Akaike weights of the fits, in their order.
    pub weights: Vec<f64>,
    /// Why the first was chosen.
    pub reason: SelectionReason,
}

impl CurveSelection {
    /// The chosen fit.
    pub fn chosen(&self) -> &CurveFit {
        &self.fits[0]
    }
}

/// Fits the law asked for, or all that apply, and chooses by AICc: among those within 2 of the
/// best, the most general theory, which holds wherever the others do.
///
/// # Errors
/// As [`fit_curve`], where no law can be fitted.
///
/// ```
/// use tactile_elasticity::curve::{
///     CurveOptions, IndentationCurve, Indenter, Model, select_model,
/// };
///
/// let z: Vec<f64> = (0..40).map(|i| i as f64 * 5e-6).collect();
/// let f: Vec<f64> = z.iter().map(|d| 2.0 * 40e3 * 1e-3 * d).collect();
/// let punch = Indenter::Punch { radius_m: 1e-3 };
/// let selection = select_model(
///     &IndentationCurve::new(&z, &f)?,
///     &punch,
///     0.5,
///     Model::Auto,
///     &CurveOptions::default(),
/// )?;
/// assert!((selection.chosen().youngs_modulus_pa / 30e3 - 1.0).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn select_model(
    curve: &IndentationCurve,
    indenter: &Indenter,
    nu: f64,
    model: Model,
    options: &CurveOptions,
) -> Result<CurveSelection, ElasticityError> {
    let candidates = match model {
        Model::Named(kind) => vec![kind],
        Model::Auto => indenter.candidates(),
    };
    let mut errors = Vec::new();
    let mut fitted = |kind| {
        let fit = fit_curve(curve, indenter, nu, kind, options);
        fit.map_err(|error| errors.push(error)).ok()
    };
    let fits: Vec<CurveFit> = candidates.into_iter().filter_map(&mut fitted).collect();
    if fits.is_empty() {
        // Of the most general law: there is a candidate at least.
        return Err(errors.swap_remove(0));
    }
    let criteria: Vec<f64> = fits.iter().map(|f| f.statistics.aicc).collect();
    let (order, reason) = rank(&criteria);
    let reason = if matches!(model, Model::Named(_)) {
        SelectionReason::Asked
    } else {
        reason
    };
    let weights = akaike_weights(order.iter().map(|&k| criteria[k]));
    Ok(CurveSelection {
        fits: in_order(fits, &order),
        weights,
        reason,
    })
}
