//! Whether a modulus changes with time, and whether the sample relaxes or the sensor drifts.
//!
//! Loads at known times each give a modulus $E_k = F_k/x_k$, where $x_k$ is derived by the law from
//! the size of the contact: for a ball $x \propto a^3$. In a standard linear solid, a spring
//! $E_\infty$ in parallel with a spring $E_0 - E_\infty$ in series with a dashpot,
//!
//! $F(t) = \int_0^t E(t - s)\, \mathrm d x(s), \qquad E(t) = E_\infty + (E_0 - E_\infty)\,
//! e^{-t/\tau}$
//!
//! holds for a growing contact (Lee and Radok, J. Appl. Mech. 27 (1960) 438). For any history it
//! follows that
//!
//! $E_k = E_\infty + (E_0 - E_\infty)\, g_k(x, \tau), \qquad \frac 1 {E_k} = \frac 1 {E_\infty} -
//! \Bigl(\frac 1 {E_\infty} - \frac 1 {E_0}\Bigr) g_k(F, \tau_c), \qquad g_k(u, \tau) = \frac 1
//! {u_k} \int_0^{t_k} e^{-(t_k - s)/\tau}\, \mathrm d u(s)$
//!
//! with $\tau_c = \tau E_0/E_\infty$. A held approach ($x$ constant) is relaxation, a held force
//! ($F$ constant) is creep. Of the two forms, the one whose history varies less is used, because
//! the history between the frames is unknown and is interpolated linearly.
//!
//! A drifting gain multiplies the forces, and with them the moduli, by $1 + \gamma t$ for any
//! history.
//!
//! # References
//! R. M. Christensen, *Theory of Viscoelasticity* (1982). R. E. Kass & A. E. Raftery, J. Am. Stat.
//! Assoc. 90 (1995) 773. R. B. Davies, Biometrika 74 (1987) 33: without relaxation the time
//! constant is meaningless, which makes the likelihood ratio larger than χ².

use crate::error::{ElasticityError, Quantity};
use crate::numerics::golden_section;
use nalgebra::{Matrix3, Vector3};
use tactile_core::{Estimate, Interval, statistics::quantile_95};

/// The modulus from one load, with its time.
///
/// ```
/// use tactile_elasticity::modulus::Estimate;
/// use tactile_elasticity::relaxation::{TimeDependence, TimedModulus};
///
/// let at = |time_s: f64| TimedModulus {
///     time_s,
///     force_n: 0.7,
///     youngs_modulus_pa: Estimate::new(100e3, 500.0),
/// };
/// assert_eq!(
///     TimeDependence::of(&[0.0, 1.0, 2.0, 4.0, 8.0].map(at), 0.01, 0.0)?,
///     TimeDependence::Steady
/// );
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedModulus {
    /// Seconds since the object touched.
    pub time_s: f64,
    /// Normal force.
    pub force_n: f64,
    /// The modulus from this load alone, with the part of its error that is independent of other
    /// loads.
    pub youngs_modulus_pa: Estimate,
}

/// Time dependence of a series of moduli.
///
/// ```
/// use tactile_elasticity::modulus::Estimate;
/// use tactile_elasticity::relaxation::{TimeDependence, TimedModulus};
///
/// let series = |modulus: fn(f64) -> f64| {
///     [0.0, 1.0, 2.0, 3.0, 5.0, 8.0].map(|time_s| TimedModulus {
///         time_s,
///         force_n: modulus(time_s) * 1e-5, // a held approach
///         youngs_modulus_pa: Estimate::new(modulus(time_s), 300.0),
///     })
/// };
/// let relaxing = TimeDependence::of(&series(|t| 80e3 + 30e3 * (-t / 2.0).exp()), 0.0, 0.0)?;
/// assert!(matches!(relaxing, TimeDependence::Relaxes(_)));
/// // No sample stiffens while it is held, but a gain may rise.
/// let rising = TimeDependence::of(&series(|t| 80e3 * (1.0 + 0.01 * t)), 0.0, 0.0)?;
/// assert!(
///     matches!(rising, TimeDependence::Drifts { per_s } if (per_s.value - 0.01).abs() < 0.001)
/// );
/// // A sample that relaxes over hours looks like a gain that falls steadily.
/// let falling = TimeDependence::of(&series(|t| 80e3 * (1.0 - 0.01 * t)), 0.0, 0.0)?;
/// assert!(
///     matches!(falling, TimeDependence::Undecided { change } if (change + 0.08).abs() < 0.01)
/// );
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "kind", rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum TimeDependence {
    /// No change beyond the errors (one constant series in a hundred is classified as one of the
    /// others).
    Steady,
    /// The sample relaxes as a standard linear solid.
    Relaxes(StandardLinearSolid),
    /// The gain of the sensor rises in proportion to time.
    Drifts {
        /// Relative change of the gain per second.
        per_s: Estimate,
    },
    /// The moduli change with time for an undetermined reason. Either there are too few loads, or
    /// the moduli fall in proportion to time (a falling gain, or a time constant longer than the
    /// series), or neither model explains the change.
    Undecided {
        /// Relative change from the first load to the last.
        change: f64,
    },
}

/// E(t) = E∞ + (E₀ − E∞) exp(−t/τ). Each parameter has a 95 % profile-likelihood interval.
///
/// ```
/// use tactile_elasticity::modulus::Estimate;
/// use tactile_elasticity::relaxation::{TimeDependence, TimedModulus};
///
/// // A weight of 0.7 N on 110 kPa that relax to 80 kPa with 2 s: the compliance creeps with 2 s ·
/// // 110/80.
/// let loads = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0].map(|time_s: f64| {
///     let compliance = 1.0 / 80e3 - (1.0 / 80e3 - 1.0 / 110e3) * (-time_s / 2.75).exp();
///     TimedModulus {
///         time_s,
///         force_n: 0.7,
///         youngs_modulus_pa: Estimate::new(1.0 / compliance, 300.0),
///     }
/// });
/// let TimeDependence::Relaxes(solid) = TimeDependence::of(&loads, 0.0, 0.0)? else {
///     unreachable!()
/// };
/// assert!(
///     (solid.instantaneous_pa / 110e3 - 1.0).abs() < 1e-3
///         && solid.instantaneous_95_pa.contains(110e3)
/// );
/// assert!(
///     (solid.equilibrium_pa / 80e3 - 1.0).abs() < 1e-3 && solid.equilibrium_95_pa.contains(80e3)
/// );
/// assert!(
///     (solid.time_constant_s / 2.0 - 1.0).abs() < 1e-3 && solid.time_constant_95_s.contains(2.0)
/// );
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct StandardLinearSolid {
    /// E₀, the modulus of a load too fast to relax.
    pub instantaneous_pa: f64,
    /// Interval of E₀.
    pub instantaneous_95_pa: Interval,
    /// E∞, the modulus of a load held indefinitely.
    pub equilibrium_pa: f64,
    /// Interval of E∞.
    pub equilibrium_95_pa: Interval,
    /// τ of the relaxation under a held approach. Under a held force the creep time is τ E₀/E∞.
    pub time_constant_s: f64,
    /// Interval of τ.
    pub time_constant_95_s: Interval,
}

// Minimum number of different times: with fewer, the three parameters of a solid leave no test of
// the fit.
const FEWEST_LOADS: usize = 5;

// Threshold of the likelihood ratio of a change against none. With a free time constant it does not
// follow χ². The value was chosen by simulation of constant series, of which about 1 % exceed it
// (`cargo test -p tactile-elasticity --test suite false_alarms -- --nocapture`).
const CHANGE: f64 = 8.0;

// Threshold of a trend alone if no solid is fitted: χ² with one degree of freedom at 1 %.
const TREND: f64 = 6.63;

// Difference of the Bayesian information criterion that is strong evidence (Kass & Raftery 1995,
// table in § 3.2).
const STRONG_EVIDENCE: f64 = 6.0;

impl TimeDependence {
    /// Distinguishes a relaxing sample from a drifting sensor, from the moduli of single loads in
    /// the order of time.
    ///
    /// `scale_error` is the relative standard error common to all moduli, which widens the
    /// intervals of E₀ and E∞. `law_error` is the relative error of the law behind the moduli, for
    /// loads that differ by a factor of e. It prevents an increasing load from being mistaken for
    /// an effect of time.
    ///
    /// Five loads at different times are needed. With fewer, only a significant trend is reported,
    /// as [`Undecided`](Self::Undecided). A solid is reported if the likelihood ratio against a
    /// constant exceeds 8 (1 % of constant series do), the Bayesian criterion prefers it to a drift
    /// by more than 6, and its time constant does not exceed the duration of the series. If the
    /// moduli scatter about the best solid by more than their errors, the errors are scaled up.
    /// O(n) for each of about 400 time constants.
    ///
    /// # Errors
    /// [`ElasticityError::TooFewLoads`] without loads, [`ElasticityError::NotPositive`] for forces,
    /// moduli and their errors, [`ElasticityError::Negative`] for times and for the two errors,
    /// [`ElasticityError::TimeDecreases`].
    ///
    /// ```
    /// use tactile_elasticity::ElasticityError;
    /// use tactile_elasticity::modulus::Estimate;
    /// use tactile_elasticity::relaxation::{TimeDependence, TimedModulus};
    ///
    /// let at = |time_s: f64, kpa: f64| TimedModulus {
    ///     time_s,
    ///     force_n: 0.7,
    ///     youngs_modulus_pa: Estimate::new(1e3 * kpa, 200.0),
    /// };
    /// // Three loads reveal a change, but not its cause.
    /// let few = TimeDependence::of(&[at(0.0, 100.0), at(1.0, 97.0), at(2.0, 95.0)], 0.0, 0.0)?;
    /// assert!(matches!(few, TimeDependence::Undecided { change } if (change + 0.05).abs() < 0.01));
    /// let back = TimeDependence::of(&[at(1.0, 100.0), at(0.0, 97.0)], 0.0, 0.0).unwrap_err();
    /// assert_eq!(
    ///     back,
    ///     ElasticityError::TimeDecreases {
    ///         load: 1,
    ///         before_s: 1.0,
    ///         found_s: 0.0
    ///     }
    /// );
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn of(
        moduli: &[TimedModulus],
        scale_error: f64,
        law_error: f64,
    ) -> Result<Self, ElasticityError> {
        let scale_error = Quantity::StandardError.not_negative(scale_error)?;
        let law_error = Quantity::StandardError.not_negative(law_error)?;
        let times = checked_times(moduli)?;
        if times < 2 {
            return Ok(Self::Steady);
        }
        let series = Series::new(moduli, law_error);
        let (constant, trend) = (series.constant(), series.trend());
        if times < FEWEST_LOADS {
            let changes = constant.chi_squared - trend.chi_squared > TREND;
            return Ok(match changes {
                true => undecided(&series, &trend),
                false => Self::Steady,
            });
        }
        let profile = Profile::new(&series);
        let best = profile.best();
        let count = moduli.len() as f64;
        let least = best.map_or(f64::INFINITY, |(_, line)| line.chi_squared);
        // Scatter beyond the errors about the better model, common to constants, trends and solids.
        let excess = (least / (count - 3.0))
            .min(trend.chi_squared / (count - 2.0))
            .max(1.0);
        let fall = (constant.chi_squared - least) / excess;
        let steady_change = (constant.chi_squared - trend.chi_squared) / excess;
        if fall.max(steady_change) <= CHANGE {
            return Ok(Self::Steady);
        }
        let preference = (trend.chi_squared - least) / excess - count.ln();
        if let Some((time_constant_s, _)) = best
            && preference > STRONG_EVIDENCE
            && time_constant_s <= series.times_s[series.times_s.len() - 1]
            && let Some(solid) = profile.solid(excess, count, scale_error)
        {
            return Ok(Self::Relaxes(solid));
        }
        let slope = relative_slope(&series, &trend);
        let error = excess.sqrt() * slope.standard_error;
        if slope.value > 0.0 && steady_change > CHANGE {
            return Ok(Self::Drifts {
                per_s: Estimate::new(slope.value, error),
            });
        }
        Ok(undecided(&series, &trend))
    }
}

/// The number of different times. Rejects invalid series.
fn checked_times(moduli: &[TimedModulus]) -> Result<usize, ElasticityError> {
    let mut different = 0;
    let mut before_s = f64::NEG_INFINITY;
    for (load, modulus) in moduli.iter().enumerate() {
        let found_s = Quantity::Time.not_negative(modulus.time_s)?;
        Quantity::Force.positive(modulus.force_n)?;
        Quantity::YoungsModulus.positive(modulus.youngs_modulus_pa.value)?;
        Quantity::StandardError.positive(modulus.youngs_modulus_pa.standard_error)?;
        if found_s < before_s {
            return Err(ElasticityError::TimeDecreases {
                load,
                before_s,
                found_s,
            });
        }
        different += usize::from(found_s > before_s);
        before_s = found_s;
    }
    match different {
        0 => Err(ElasticityError::TooFewLoads {
            expected: 1,
            found: 0,
        }),
        _ => Ok(different),
    }
}

/// Relative slope of E at time 0.
fn relative_slope(series: &Series, trend: &Line) -> Estimate {
    let (slope, error) = trend.combination(0.0, 1.0);
    let sign = match series.form {
        Form::Relaxation => 1.0,
        Form::Creep => -1.0,
    };
    Estimate::new(sign * slope / trend.a, error / trend.a)
}

fn undecided(series: &Series, trend: &Line) -> TimeDependence {
    let [first, last] = [0, series.times_s.len() - 1]
        .map(|k| series.form.modulus(trend.a + trend.b * series.times_s[k]));
    TimeDependence::Undecided {
        change: last / first - 1.0,
    }
}

/// Whose history is used: the quantity that varies less is better known between the loads.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// E, with the history of the deformation.
    Relaxation,
    /// 1/E, with the history of the force.
    Creep,
}

impl Form {
    /// Converts the fitted response, E or 1/E, to E.
    fn modulus(self, response: f64) -> f64 {
        match self {
            Self::Relaxation => response,
            Self::Creep => 1.0 / response,
        }
    }
}

/// Moduli prepared for the fits.
struct Series {
    form: Form,
    times_s: Vec<f64>,
    held: Vec<f64>,
    /// E, or 1/E.
    response: Vec<f64>,
    /// Standard errors of the response.
    sigma: Vec<f64>,
    /// Effect of one standard error of the law on each response: zero at the mean load, and the
    /// full error at e times the mean.
    law: Vec<f64>,
}

/// y = a + b g, with the slope of the law fitted too.
#[derive(Clone, Copy, Debug)]
struct Line {
    a: f64,
    b: f64,
    /// Variances of a and b, and their covariance.
    variance: [f64; 3],
    chi_squared: f64,
}

impl Line {
    /// A combination of both parameters with its standard error.
    fn combination(&self, of_a: f64, of_b: f64) -> (f64, f64) {
        let [aa, bb, ab] = self.variance;
        let variance = of_a * of_a * aa + 2.0 * of_a * of_b * ab + of_b * of_b * bb;
        (of_a * self.a + of_b * self.b, variance.max(0.0).sqrt())
    }
}

impl Series {
    fn new(moduli: &[TimedModulus], law_error: f64) -> Self {
        let forces: Vec<f64> = moduli.iter().map(|m| m.force_n).collect();
        let moduli_pa = || moduli.iter().map(|m| m.youngs_modulus_pa);
        let relative: Vec<f64> = moduli_pa().map(|e| e.standard_error / e.value).collect();
        let deformations: Vec<f64> = moduli_pa()
            .zip(&forces)
            .map(|(e, force)| force / e.value)
            .collect();
        let form = match spread_of_logs(&deformations) < spread_of_logs(&forces) {
            true => Form::Relaxation,
            false => Form::Creep,
        };
        let held = match form {
            Form::Relaxation => without_noise(deformations, &relative),
            Form::Creep => forces.clone(),
        };
        let response: Vec<f64> = moduli_pa().map(|e| form.modulus(e.value)).collect();
        let mean_log = mean(forces.iter().map(|force| force.ln()));
        let law = (forces.iter().zip(&response))
            .map(|(force, y)| law_error * (force.ln() - mean_log) * y);
        Self {
            form,
            times_s: moduli.iter().map(|m| m.time_s).collect(),
            held,
            sigma: response.iter().zip(&relative).map(|(y, r)| y * r).collect(),
            law: law.collect(),
            response,
        }
    }

    /// y = a.
    fn constant(&self) -> Line {
        self.line(&vec![0.0; self.times_s.len()])
    }

    /// y = a + b t.
    fn trend(&self) -> Line {
        self.line(&self.times_s)
    }

    /// y = a + b g(τ). `None` if it is not a solid with this time constant: E∞ or E₀ would not be
    /// positive, or E would rise.
    fn solid(&self, time_constant_s: f64) -> Option<Line> {
        let line = self.line(&memory(&self.times_s, &self.held, time_constant_s));
        let (fresh, settled) = (line.a + line.b, line.a);
        let falls = match self.form {
            Form::Relaxation => line.b >= 0.0,
            Form::Creep => line.b <= 0.0,
        };
        (falls && fresh > 0.0 && settled > 0.0).then_some(line)
    }

    /// Weighted least squares. The slope of the law has a standard normal prior. A vanishing column
    /// gets the coefficient zero.
    fn line(&self, column: &[f64]) -> Line {
        let mut normal = Matrix3::zeros();
        let mut right = Vector3::zeros();
        let scale = column.iter().fold(0.0_f64, |most, g| most.max(g.abs()));
        let unit = if scale > 0.0 { scale } else { 1.0 };
        let row = |k: usize| Vector3::new(1.0, column[k] / unit, self.law[k]) / self.sigma[k];
        for k in 0..column.len() {
            let (row, y) = (row(k), self.response[k] / self.sigma[k]);
            normal += row * row.transpose();
            right += row * y;
        }
        normal[(2, 2)] += 1.0;
        // A column that hardly differs from its mean carries no information. Its coefficient must
        // not grow by rounding.
        let contrast = normal[(1, 1)] - normal[(0, 1)].powi(2) / normal[(0, 0)];
        let told = contrast > CONTRAST * normal[(1, 1)] && scale > 0.0;
        if !told {
            (normal[(0, 1)], normal[(1, 0)]) = (0.0, 0.0);
            (normal[(1, 2)], normal[(2, 1)]) = (0.0, 0.0);
            (normal[(1, 1)], right[1]) = (1.0, 0.0);
        }
        let inverse = normal.try_inverse().unwrap_or_else(Matrix3::zeros);
        let solution = inverse * right;
        let used = if told {
            solution
        } else {
            Vector3::new(solution[0], 0.0, solution[2])
        };
        let residuals = (0..column.len())
            .map(|k| (self.response[k] / self.sigma[k] - row(k).dot(&used)).powi(2));
        Line {
            a: used[0],
            b: used[1] / unit,
            variance: [
                inverse[(0, 0)],
                inverse[(1, 1)] / (unit * unit),
                inverse[(0, 1)] / unit,
            ],
            chi_squared: residuals.sum::<f64>() + used[2] * used[2],
        }
    }
}

// Minimum fraction of a column's weight that differs from its mean. Below, the normal equations
// have lost half of their digits.
const CONTRAST: f64 = 1e-10;

/// If a deformation scatters no more than its errors, it was held: returns its mean. Noise in the
/// history would count as relaxation.
fn without_noise(deformations: Vec<f64>, relative_errors: &[f64]) -> Vec<f64> {
    let count = deformations.len() as f64;
    let centre = mean(deformations.iter().copied());
    let chi_squared: f64 = (deformations.iter().zip(relative_errors))
        .map(|(x, error)| ((x / centre - 1.0) / error).powi(2))
        .sum();
    // Three standard deviations above the mean of χ² with n − 1 degrees of freedom.
    let noise = (count - 1.0) + 3.0 * (2.0 * (count - 1.0)).sqrt();
    match chi_squared <= noise {
        true => vec![centre; deformations.len()],
        false => deformations,
    }
}

fn spread_of_logs(values: &[f64]) -> f64 {
    let logs = || values.iter().map(|v| v.ln());
    let centre = mean(logs());
    mean(logs().map(|log| (log - centre).powi(2))).sqrt()
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

// Number of time constants tried, from a tenth of the shortest interval to ten times the whole, in
// logarithmic steps.
const STEPS: usize = 200;

/// χ² as a function of the time constant, with the other parameters fitted.
struct Profile<'a> {
    series: &'a Series,
    shortest_s: f64,
    longest_s: f64,
}

impl<'a> Profile<'a> {
    fn new(series: &'a Series) -> Self {
        let times = &series.times_s;
        let steps = times.windows(2).map(|pair| pair[1] - pair[0]);
        let first = times[0];
        let shortest = (steps.chain([first])).filter(|step| *step > 0.0);
        Self {
            series,
            shortest_s: 0.1 * shortest.fold(f64::INFINITY, f64::min),
            longest_s: 10.0 * times[times.len() - 1],
        }
    }

    fn at(&self, log_time: f64) -> Option<Line> {
        self.series.solid(log_time.exp())
    }

    fn chi_squared(&self, log_time: f64) -> f64 {
        self.at(log_time)
            .map_or(f64::INFINITY, |line| line.chi_squared)
    }

    /// The best time constant with its parameters: the best of the steps, refined by golden
    /// sections.
    fn best(&self) -> Option<(f64, Line)> {
        let (low, high) = (self.shortest_s.ln(), self.longest_s.ln());
        let step = (high - low) / STEPS as f64;
        let on_grid = |k: usize| low + k as f64 * step;
        let least = (0..=STEPS)
            .map(on_grid)
            .min_by(|x, y| self.chi_squared(*x).total_cmp(&self.chi_squared(*y)))?;
        // Each section leaves 0.62 of the bracket: after 40, 1e-8 of a step remains.
        let middle = golden_section((least - step).max(low), (least + step).min(high), 40, |x| {
            self.chi_squared(x)
        });
        let refined = match self.chi_squared(middle) < self.chi_squared(least) {
            true => middle,
            false => least,
        };
        Some((refined.exp(), self.at(refined)?))
    }

    /// The time constant at which χ² has risen to the allowed value on one side of the best. `None`
    /// if it does not rise as far within the range tried.
    fn limit(&self, best: f64, end: f64, allowed: f64) -> Option<f64> {
        let step = (end - best) / STEPS as f64;
        let outside = (1..=STEPS)
            .map(|k| best + k as f64 * step)
            .find(|x| self.chi_squared(*x) > allowed)?;
        let (mut inside, mut outside) = (outside - step, outside);
        // Bisection to a millionth of a step.
        for _ in 0..20 {
            let middle = 0.5 * (inside + outside);
            match self.chi_squared(middle) > allowed {
                true => outside = middle,
                false => inside = middle,
            }
        }
        Some(inside)
    }

    /// The solid with its intervals. `None` if the longest time constant tried still fits.
    ///
    /// At a fixed τ the fit is linear, so a combination q of its parameters may deviate by √(Δ −
    /// χ²(τ) + χ²_min) of its standard errors. The interval of q is the union of these over all τ
    /// in the interval of τ.
    fn solid(&self, excess: f64, count: f64, scale_error: f64) -> Option<StandardLinearSolid> {
        let (time_constant_s, best) = self.best()?;
        let learnt = (excess > 1.0).then_some(count - 3.0);
        let room = excess * quantile_95(learnt).powi(2);
        let allowed = best.chi_squared + room;
        let centre = time_constant_s.ln();
        let upper = self.limit(centre, self.longest_s.ln(), allowed)?;
        let lower = self.limit(centre, self.shortest_s.ln(), allowed);
        let from = lower.unwrap_or(self.shortest_s.ln());
        let mut fresh = Range::default();
        let mut settled = Range::default();
        let mut relaxation = Range::default();
        for k in 0..=STEPS {
            let log_time = from + (upper - from) * k as f64 / STEPS as f64;
            let Some(line) = self.at(log_time) else {
                continue;
            };
            let reach = (allowed - line.chi_squared).max(0.0).sqrt();
            fresh.include(line.combination(1.0, 1.0), reach);
            settled.include(line.combination(1.0, 0.0), reach);
            relaxation.include(self.relaxation_time(log_time.exp(), &line), reach);
        }
        let (first, last) = (best.a + best.b, best.a);
        let widened = |value: f64, range: Range| {
            let common = quantile_95(None) * scale_error;
            let factor = |limit: f64| (limit / value).ln().abs().hypot(common).exp();
            Interval::new(
                value / factor(range.lower.max(0.0)),
                Some(value * factor(range.upper)).filter(|limit| limit.is_finite()),
            )
        };
        let [instantaneous_pa, equilibrium_pa] =
            [first, last].map(|response| self.series.form.modulus(response));
        let [instantaneous, equilibrium] = match self.series.form {
            Form::Relaxation => [fresh, settled],
            Form::Creep => [fresh.inverse(), settled.inverse()],
        };
        let (time_constant, _) = self.relaxation_time(time_constant_s, &best);
        Some(StandardLinearSolid {
            instantaneous_pa,
            instantaneous_95_pa: widened(instantaneous_pa, instantaneous),
            equilibrium_pa,
            equilibrium_95_pa: widened(equilibrium_pa, equilibrium),
            time_constant_s: time_constant,
            time_constant_95_s: Interval::new(
                lower.map_or(0.0, |_| relaxation.lower.max(0.0)),
                Some(relaxation.upper),
            ),
        })
    }

    /// The time constant of relaxation with its standard error, for a fixed time constant of the
    /// fit: the same value, or for creep its product with E∞/E₀.
    fn relaxation_time(&self, time_constant_s: f64, line: &Line) -> (f64, f64) {
        match self.series.form {
            Form::Relaxation => (time_constant_s, 0.0),
            Form::Creep => {
                let ratio = 1.0 + line.b / line.a;
                let (_, error) = line.combination(-line.b / (line.a * line.a), 1.0 / line.a);
                (time_constant_s * ratio, time_constant_s * error)
            }
        }
    }
}

/// The union of intervals.
#[derive(Clone, Copy, Debug)]
struct Range {
    lower: f64,
    upper: f64,
}

impl Default for Range {
    fn default() -> Self {
        Self {
            lower: f64::INFINITY,
            upper: f64::NEG_INFINITY,
        }
    }
}

impl Range {
    fn include(&mut self, (value, error): (f64, f64), reach: f64) {
        self.lower = self.lower.min(value - reach * error);
        self.upper = self.upper.max(value + reach * error);
    }

    /// The interval of the reciprocal of a positive quantity.
    fn inverse(self) -> Self {
        Self {
            lower: 1.0 / self.upper,
            // Infinity if the lower end is zero or negative.
            upper: 1.0 / self.lower.max(0.0),
        }
    }
}

/// g_k(u, τ) = (1/u_k) ∫₀^{t_k} e^{−(t_k − s)/τ} du(s), and the part added by a change of u_k
/// alone, in O(n).
///
/// The first load is applied at time 0 and kept. Between loads u is linear.
fn memory(times_s: &[f64], held: &[f64], time_constant_s: f64) -> Vec<f64> {
    let mut remaining = 0.0;
    let mut before = (0.0, 0.0);
    let of_load = |(&time_s, &now): (&f64, &f64)| {
        let (last_s, last) = before;
        let elapsed = (time_s - last_s) / time_constant_s;
        let decay = (-elapsed).exp();
        // The first load is applied completely at the start. A later change is a steady growth,
        // which leaves (1 − e^{−u})/u.
        let growth = match (last > 0.0, elapsed > 0.0) {
            (false, _) => decay,
            (true, false) => 1.0,
            (true, true) => -(-elapsed).exp_m1() / elapsed,
        };
        remaining = remaining * decay + (now - last) * growth;
        before = (time_s, now);
        remaining / now
    };
    times_s.iter().zip(held).map(of_load).collect()
}

#[cfg(test)]
#[path = "relaxation_tests.rs"]
mod tests;
