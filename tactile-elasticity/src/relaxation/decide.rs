//! The choice among a constant, a drift and a relaxation.

use super::fit::{Form, Line, Series};
use super::profile::Profile;
use super::{TimeDependence, TimedModulus};
use crate::error::{ElasticityError, Quantity, not_negative, positive};
use crate::modulus::Estimate;

/// Loads at different times below which three parameters of a solid leave nothing that could speak against it.
const FEWEST_LOADS: usize = 5;

/// What the likelihood ratio of a change against none must exceed. With the time constant free it is no χ²: chosen by simulation of constant series,
/// of which about 1 % exceed it (`cargo test -p tactile-elasticity --test suite false_alarms -- --nocapture`).
const CHANGE: f64 = 8.0;

/// What a trend alone must exceed where a solid is not tried: χ² of one degree of freedom at 1 %.
const TREND: f64 = 6.63;

/// Difference of Bayes' information criterion that is strong evidence (Kass & Raftery 1995, Table in § 3.2).
const STRONG_EVIDENCE: f64 = 6.0;

/// Tells a sample that relaxes from a sensor that drifts, from the moduli of single loads in the order of time.
///
/// `scale_error` is the relative standard error that all moduli share: it widens the intervals of E₀ and E∞. `law_error` is the relative error of the
/// law that gave the moduli: between loads that differ by a factor of e they are taken to differ by as much, so that a load that
/// grows with time is not mistaken for time.
///
/// Needs five loads at different times; of fewer only a significant trend is reported, as [`TimeDependence::Undecided`]. A solid is told where
/// the likelihood ratio against a constant exceeds 8 (1 % of constant series do), Bayes' criterion prefers it to a drift by more than 6,
/// and its time constant is no longer than the loads lasted. Where the moduli scatter about the best solid by more than their errors, these are scaled up. O(n) for each
/// of some 400 time constants.
///
/// # Errors
/// [`ElasticityError::TooFewLoads`] of none, [`ElasticityError::NotPositive`] for forces, moduli and their errors, [`ElasticityError::Negative`] for
/// times and for the two errors, [`ElasticityError::TimeDecreases`].
///
/// ```
/// use tactile_elasticity::ElasticityError;
/// use tactile_elasticity::modulus::Estimate;
/// use tactile_elasticity::relaxation::{TimeDependence, TimedModulus, time_dependence};
///
/// let at = |time_s: f64, kpa: f64| TimedModulus { time_s, force_n: 0.7, youngs_modulus_pa: Estimate::new(1e3 * kpa, 200.0) };
/// // Three loads say that something changed, not what.
/// let few = time_dependence(&[at(0.0, 100.0), at(1.0, 97.0), at(2.0, 95.0)], 0.0, 0.0)?;
/// assert!(matches!(few, TimeDependence::Undecided { change } if (change + 0.05).abs() < 0.01));
/// let back = time_dependence(&[at(1.0, 100.0), at(0.0, 97.0)], 0.0, 0.0).unwrap_err();
/// assert_eq!(back, ElasticityError::TimeDecreases { load: 1, before_s: 1.0, found_s: 0.0 });
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn time_dependence(
    moduli: &[TimedModulus],
    scale_error: f64,
    law_error: f64,
) -> Result<TimeDependence, ElasticityError> {
    let scale_error = not_negative(scale_error, Quantity::StandardError)?;
    let law_error = not_negative(law_error, Quantity::StandardError)?;
    let times = checked_times(moduli)?;
    if times < 2 {
        return Ok(TimeDependence::Steady);
    }
    let series = Series::new(moduli, law_error);
    let (constant, trend) = (series.constant(), series.trend());
    if times < FEWEST_LOADS {
        let changes = constant.chi_squared - trend.chi_squared > TREND;
        return Ok(match changes {
            true => undecided(&series, &trend),
            false => TimeDependence::Steady,
        });
    }
    let profile = Profile::new(&series);
    let best = profile.best();
    let count = moduli.len() as f64;
    let least = best.map_or(f64::INFINITY, |(_, line)| line.chi_squared);
    // Scatter beyond the errors about whichever explains more; constants, trends and solids share it.
    let excess = (least / (count - 3.0))
        .min(trend.chi_squared / (count - 2.0))
        .max(1.0);
    let fall = (constant.chi_squared - least) / excess;
    let steady_change = (constant.chi_squared - trend.chi_squared) / excess;
    if fall.max(steady_change) <= CHANGE {
        return Ok(TimeDependence::Steady);
    }
    let preference = (trend.chi_squared - least) / excess - count.ln();
    if let Some((time_constant_s, _)) = best
        && preference > STRONG_EVIDENCE
        && time_constant_s <= series.times_s[series.times_s.len() - 1]
        && let Some(solid) = profile.solid(excess, count, scale_error)
    {
        return Ok(TimeDependence::Relaxes(solid));
    }
    let slope = relative_slope(&series, &trend);
    let error = excess.sqrt() * slope.standard_error;
    if slope.value > 0.0 && steady_change > CHANGE {
        return Ok(TimeDependence::Drifts {
            per_s: Estimate::new(slope.value, error),
        });
    }
    Ok(undecided(&series, &trend))
}

/// The number of different times; refuses what no series can have.
fn checked_times(moduli: &[TimedModulus]) -> Result<usize, ElasticityError> {
    let mut different = 0;
    let mut before_s = f64::NEG_INFINITY;
    for (load, modulus) in moduli.iter().enumerate() {
        let found_s = not_negative(modulus.time_s, Quantity::Time)?;
        positive(modulus.force_n, Quantity::Force)?;
        positive(modulus.youngs_modulus_pa.value, Quantity::YoungsModulus)?;
        positive(
            modulus.youngs_modulus_pa.standard_error,
            Quantity::StandardError,
        )?;
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
    let [first, last] = [0, series.times_s.len() - 1].map(|k| {
        let response = trend.a + trend.b * series.times_s[k];
        match series.form {
            Form::Relaxation => response,
            Form::Creep => 1.0 / response,
        }
    });
    TimeDependence::Undecided {
        change: last / first - 1.0,
    }
}
