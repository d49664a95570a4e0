//! Which inputs the error of a modulus comes from, and which of them were assumed.
use super::settings::Settings;
use crate::core::{Source, Uncertain};
use std::fmt::{self, Display, Formatter};

/// The part of a modulus' relative standard error that one source is responsible for. The parts'
/// squares add up to the whole.
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// use tactile_imaging::force::Source;
/// use tactile_imaging::pipeline::ErrorShare;
/// // A ball of 3 mm whose radius is known to 0.3 mm.
/// let pipeline = trial
///     .pipeline()?
///     .with_settings(|settings| settings.object_radius_error_m = Some(0.3e-3))?;
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
pub struct ErrorShare {
    /// The source.
    pub source: Source,
    /// Its standard error's part in the modulus, relative to the modulus.
    pub relative_error: f64,
    /// Nothing was stated of the input: its error is the default of [`Settings`].
    pub assumed: bool,
}

impl Display for ErrorShare {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let percent = 100.0 * self.relative_error;
        let assumed = if self.assumed { ", assumed" } else { "" };
        write!(f, "{} {percent:.2} %{assumed}", self.source)
    }
}

/// The least effort that makes a source's error smaller.
fn remedy(source: Source) -> &'static str {
    match source {
        Source::Noise => "more frames of the same loads",
        Source::Calibration => "more pairs of the calibration, by a better gauge",
        Source::Gain => "a better gauge, or a flat field",
        Source::Coupling => "a press of this object under a known weight ([[check]])",
        Source::PixelSize => "a frame of a target of known pitch",
        Source::Profile => "a rounder contact, lit evenly",
        Source::ObjectSize => "a calliper on the object (radius_error_m)",
        Source::PoissonRatio => "a statement of its error (poisson_ratio_error)",
        Source::Adhesion => "larger forces, or talc and a statement of adhesion_error_j_per_m2",
        Source::Guide => "a press of a ball of known radius and modulus ([[check]])",
        Source::Law => "a contact table by finite elements",
        _ => "what the estimator's author states",
    }
}

/// Whether nothing was stated of the input that is a source.
fn is_assumed(source: Source, settings: &Settings) -> bool {
    let checked = settings.checked_gain.map(|checked| checked.gain.value);
    match source {
        Source::Gain => settings.force_scale_error.is_none(),
        Source::Coupling => settings.coupling_error.or(checked).is_none(),
        Source::PixelSize => settings.length_scale_error.is_none(),
        Source::ObjectSize => settings.object_radius_error_m.is_none(),
        Source::PoissonRatio => settings.poisson_ratio_error.is_none(),
        Source::Adhesion => settings.adhesion_error_j_per_m2.is_none(),
        Source::Guide => settings.layer_covariance.is_none(),
        _ => false,
    }
}

/// The budget in one sentence, shares below a tenth of the largest left out, and what would narrow
/// the interval most.
pub fn sentence(budget: &[ErrorShare]) -> Option<String> {
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

/// The sources of a modulus' error, the largest part first. None of an error that is not known.
pub fn error_budget(modulus_pa: &Uncertain, settings: &Settings) -> Vec<ErrorShare> {
    if !modulus_pa.relative_error().is_finite() {
        return Vec::new();
    }
    let share = |(source, part): (Source, f64)| ErrorShare {
        source,
        relative_error: (part / modulus_pa.value).abs(),
        assumed: is_assumed(source, settings),
    };
    let mut shares: Vec<_> = modulus_pa.parts().map(share).collect();
    shares.sort_by(|a, b| b.relative_error.total_cmp(&a.relative_error));
    shares
}
