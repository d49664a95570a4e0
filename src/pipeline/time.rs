//! Change of the modulus over the time of a press.
use super::text::{decimals_of, fixed, interval_text, with_error};
use crate::core::Interval;
use crate::core::Source;
use crate::elasticity::modulus::{Estimate, LoadSeries, ModulusEstimator};
use crate::elasticity::relaxation::{TimeDependence, TimedModulus};
use std::fmt::{self, Display, Formatter};

/// The time range of a modulus, and its change in that range.
///
/// ```
/// use tactile_imaging::elasticity::relaxation::TimeDependence;
/// use tactile_imaging::pipeline::TimeResult;
/// let change = TimeDependence::Undecided { change: -0.08 };
/// let result = TimeResult {
///     from_s: 0.5,
///     to_s: 8.0,
///     loads: 3,
///     change,
/// };
/// assert_eq!(
///     result.to_string(),
///     "0.5 to 8 s: the moduli of 3 loads change by -8.0 %, as a relaxing sample or a drifting \
///      sensor would"
/// );
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct TimeResult {
    /// Time of the first load that has a modulus, in seconds since the object touched.
    pub from_s: f64,
    /// Time of the last load that has a modulus.
    pub to_s: f64,
    /// Number of loads with a time and a modulus.
    pub loads: usize,
    /// The change of their moduli.
    pub change: TimeDependence,
}

impl TimeResult {
    /// Relative change from the first time to the last.
    pub(super) fn relative_change(&self) -> f64 {
        match self.change {
            TimeDependence::Relaxes(solid) => {
                let at = |time_s: f64| {
                    let fresh = solid.instantaneous_pa - solid.equilibrium_pa;
                    solid.equilibrium_pa + fresh * (-time_s / solid.time_constant_s).exp()
                };
                at(self.to_s) / at(self.from_s) - 1.0
            }
            TimeDependence::Drifts { per_s } => per_s.value * (self.to_s - self.from_s),
            TimeDependence::Undecided { change } => change,
            _ => 0.0,
        }
    }
}

impl Display for TimeResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {} s: ", self.from_s, self.to_s)?;
        match self.change {
            TimeDependence::Relaxes(solid) => {
                let modulus = |value: f64, interval| within(value, interval, 1e-3, "kPa");
                write!(
                    f,
                    "the sample relaxes from {} to {} with a time constant of {}",
                    modulus(solid.instantaneous_pa, solid.instantaneous_95_pa),
                    modulus(solid.equilibrium_pa, solid.equilibrium_95_pa),
                    within(solid.time_constant_s, solid.time_constant_95_s, 1.0, "s"),
                )
            }
            TimeDependence::Drifts { per_s } => write!(
                f,
                "the sensor's gain rises by {} % per second",
                with_error(per_s.value, per_s.standard_error, 100.0)
            ),
            TimeDependence::Undecided { change } => write!(
                f,
                "the moduli of {} loads change by {:+.1} %, as a relaxing sample or a drifting \
                 sensor would",
                self.loads,
                100.0 * change
            ),
            _ => write!(f, "no change beyond the errors of {} loads", self.loads),
        }
    }
}

/// Formats a value with its unit and its 95 % interval.
fn within(value: f64, interval: Interval, scale: f64, unit: &str) -> String {
    // The digits are those of a quarter of the interval's width, as for a normal distribution. The
    // standard error is unknown and therefore not printed.
    let digits_of = interval.upper.map_or(value, |upper| upper - interval.lower) / 4.0;
    let ends = interval_text((interval.lower, interval.upper), digits_of, scale);
    let value = fixed(value * scale, decimals_of(digits_of * scale).unwrap_or(4));
    format!("{value} {unit} (95 %: {ends})")
}

/// Time dependence of the moduli of single loads. `times_s` has an entry for each load. Loads
/// without a time or without a modulus of their own are skipped. `None` if fewer than two remain.
pub(super) fn of_moduli(
    estimator: &dyn ModulusEstimator,
    series: &LoadSeries,
    times_s: &[Option<f64>],
) -> Option<TimeResult> {
    let mut moduli = Vec::with_capacity(times_s.len());
    let (mut law_error, mut scale_error) = (0.0_f64, 0.0_f64);
    for (load, time_s) in series.loads().iter().zip(times_s) {
        let Some(time_s) = *time_s else {
            continue;
        };
        // Errors of this load: its own noise and the common part.
        let alone = series.with_loads([*load]);
        let Ok(modulus_pa) = estimator.estimate(&alone).map(|found| found.by_source) else {
            continue;
        };
        if !modulus_pa.relative_error().is_finite() {
            continue;
        }
        let common = modulus_pa.without(Source::Noise);
        law_error = law_error.max((common.part(Source::Law) / common.value).abs());
        scale_error = scale_error.max(common.relative_error());
        let noise = modulus_pa.part(Source::Noise).abs();
        moduli.push(TimedModulus {
            time_s,
            force_n: load.force_n.value,
            youngs_modulus_pa: Estimate::new(modulus_pa.value, noise),
        });
    }
    result(&moduli, scale_error, law_error)
}

/// Time dependence of the sensor's gain: forces by the light over those by a gauge.
pub(super) fn of_gains(forces: &[(f64, Estimate, Estimate)]) -> Option<TimeResult> {
    let ratios: Vec<TimedModulus> = (forces.iter())
        .map(|&(time_s, light, gauge)| {
            let relative = |force: Estimate| force.standard_error / force.value;
            let ratio = light.value / gauge.value;
            let error = ratio * relative(light).hypot(relative(gauge));
            TimedModulus {
                time_s,
                force_n: gauge.value,
                // The ratio takes the place of a modulus, which is proportional to the gain.
                youngs_modulus_pa: Estimate::new(ratio, error),
            }
        })
        .collect();
    result(&ratios, 0.0, 0.0)
}

fn result(moduli: &[TimedModulus], scale_error: f64, law_error: f64) -> Option<TimeResult> {
    let [first, .., last] = moduli else {
        return None;
    };
    let change = TimeDependence::of(moduli, scale_error, law_error).ok()?;
    Some(TimeResult {
        from_s: first.time_s,
        to_s: last.time_s,
        loads: moduli.len(),
        change,
    })
}
