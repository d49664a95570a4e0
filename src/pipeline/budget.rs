//! Error budget of a modulus: its sources, and which of them are defaults.
use super::assumptions::Assumption;
use super::settings::Settings;
use crate::core::{Source, Uncertain};
use std::fmt::{self, Display, Formatter};

/// The contribution of one source to the relative standard error of a modulus. The squares of the
/// contributions add up to the total.
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// use tactile_imaging::force::Source;
/// use tactile_imaging::pipeline::ErrorShare;
/// // A ball of 3 mm whose radius is known to 0.3 mm.
/// let pipeline = trial
///     .pipeline()?
///     .with_settings(|settings| settings.assumptions.state(Source::ObjectSize, 0.1))?;
/// let budget: Vec<ErrorShare> = trial.press(&pipeline)?.measure().error_budget;
/// assert_eq!(budget[0].source, Source::ObjectSize, "the largest first");
/// assert!(
///     budget[0].relative_error > 0.1,
///     "E is proportional to R, and the guide takes a part of the compliance"
/// );
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct ErrorShare {
    /// The error source.
    pub source: Source,
    /// Contribution of the source to the standard error, relative to the modulus.
    pub relative_error: f64,
    /// Whether the error of the input is a default of [`Settings`] rather than stated.
    pub assumed: bool,
}

impl Display for ErrorShare {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let percent = 100.0 * self.relative_error;
        let assumed = if self.assumed { ", assumed" } else { "" };
        write!(f, "{} {percent:.2} %{assumed}", self.source)
    }
}

/// The easiest way to reduce the error of a source.
fn remedy(source: Source) -> &'static str {
    match (Assumption::of(source), source) {
        (Some(assumption), _) => assumption.remedy,
        (None, Source::Noise) => "more frames of the same loads",
        (None, Source::Calibration) => "more calibration pairs, or a better gauge",
        (None, Source::Profile) => "a rounder contact with even illumination",
        (None, Source::Law) => "a contact table by finite elements",
        _ => "what the estimator's author states",
    }
}

/// The budget in one sentence, and the best way to narrow the interval. Contributions below a tenth
/// of the largest are left out.
pub(super) fn sentence(budget: &[ErrorShare]) -> Option<String> {
    let largest = budget.first()?;
    let counts = |share: &&ErrorShare| share.relative_error >= 0.1 * largest.relative_error;
    let shares: Vec<String> = budget
        .iter()
        .filter(counts)
        .map(ErrorShare::to_string)
        .collect();
    Some(format!(
        "{}; narrowed most by {}",
        shares.join("; "),
        remedy(largest.source)
    ))
}

/// The sources of a modulus' error, the largest contribution first. Empty if the error is unknown.
pub(super) fn error_budget(modulus_pa: &Uncertain, settings: &Settings) -> Vec<ErrorShare> {
    if !modulus_pa.relative_error().is_finite() {
        return Vec::new();
    }
    let share = |(source, part): (Source, f64)| ErrorShare {
        source,
        relative_error: (part / modulus_pa.value).abs(),
        assumed: settings.assumes(source),
    };
    let mut shares: Vec<_> = modulus_pa.parts().map(share).collect();
    shares.sort_by(|a, b| b.relative_error.total_cmp(&a.relative_error));
    shares
}
