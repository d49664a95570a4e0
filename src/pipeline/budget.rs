//! Which inputs the error of a modulus comes from, and which of them were assumed.
use super::loads::beyond;
use super::settings::Settings;
use super::time::{NEGLIGIBLE, quiet, with_relative_error};
use crate::elasticity::modulus::{LoadSeries, ModulusEstimator};
use std::fmt::{self, Display, Formatter};

/// An input whose error a modulus carries.
///
/// ```
/// use tactile_imaging::pipeline::ErrorSource;
/// assert_eq!(ErrorSource::ObjectRadius.to_string(), "the object's radius");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum ErrorSource {
    /// Noise of the frames, in forces and contact radii.
    Noise,
    /// The calibration of light to force.
    Force,
    /// What the object scatters beside what the calibrator scattered.
    Coupling,
    /// Size of a pixel on the sensing surface.
    PixelSize,
    /// Radius of the object.
    ObjectRadius,
    /// Poisson's ratio of the object.
    PoissonRatio,
    /// Adhesion of a ball.
    Adhesion,
    /// Moduli, thicknesses and Poisson ratios of the guide's layers.
    Guide,
    /// The contact law, and what else the estimator adds.
    Law,
}

impl Display for ErrorSource {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Noise => "noise of the frames",
            Self::Force => "the calibration of the force",
            Self::Coupling => "the light that the object couples",
            Self::PixelSize => "the size of a pixel",
            Self::ObjectRadius => "the object's radius",
            Self::PoissonRatio => "the object's Poisson ratio",
            Self::Adhesion => "adhesion",
            Self::Guide => "the guide's layers",
            Self::Law => "the contact law",
        })
    }
}

/// The part of a modulus' relative standard error that one input is responsible for. The parts'
/// squares add up to the whole.
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// use tactile_imaging::pipeline::{ErrorShare, ErrorSource};
/// // A ball of 3 mm whose radius is known to 0.3 mm.
/// let pipeline = trial
///     .pipeline()?
///     .with_settings(|settings| settings.object_radius_error_m = Some(0.3e-3))?;
/// let budget: Vec<ErrorShare> = trial.press(&pipeline)?.measure().error_budget;
/// assert_eq!(budget[0].source, ErrorSource::ObjectRadius, "the largest first");
/// assert!(
///     budget[0].relative_error > 0.1,
///     "E is proportional to R, and the guide takes a part of the compliance"
/// );
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ErrorShare {
    /// The input.
    pub source: ErrorSource,
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

impl ErrorSource {
    /// The least effort that makes this input better known.
    fn remedy(self) -> &'static str {
        match self {
            Self::Noise => "more frames of the same loads",
            Self::Force => "more pairs of the calibration, by a better gauge",
            Self::Coupling => "a press of this object under a known weight ([[check]])",
            Self::PixelSize => "a frame of a target of known pitch",
            Self::ObjectRadius => "a calliper on the object (radius_error_m)",
            Self::PoissonRatio => "a statement of its error (poisson_ratio_error)",
            Self::Adhesion => "larger forces, or talc and a statement of adhesion_error_j_per_m2",
            Self::Guide => "a press of a ball of known radius and modulus ([[check]])",
            Self::Law => "a contact table by finite elements",
        }
    }

    /// Whether nothing was stated of it.
    fn is_assumed(self, settings: &Settings) -> bool {
        let checked = settings.checked_gain.map(|checked| checked.gain.value);
        match self {
            Self::Noise | Self::Law => false,
            Self::Force => settings.force_scale_error.is_none(),
            Self::Coupling => settings.coupling_error.or(checked).is_none(),
            Self::PixelSize => settings.length_scale_error.is_none(),
            Self::ObjectRadius => settings.object_radius_error_m.is_none(),
            Self::PoissonRatio => settings.poisson_ratio_error.is_none(),
            Self::Adhesion => settings.adhesion_error_j_per_m2.is_none(),
            Self::Guide => settings.layer_covariance.is_none(),
        }
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
        largest.source.remedy()
    ))
}

/// By how much the squared standard error falls without each input's error, the largest part first.
pub fn error_budget(
    estimator: &dyn ModulusEstimator,
    series: &LoadSeries,
    settings: &Settings,
    by_light: bool,
) -> Vec<ErrorShare> {
    let Some(all) = relative_variance(estimator, series) else {
        return Vec::new();
    };
    let shared = *series.shared_errors();
    let coupling = if by_light { settings.coupling() } else { 0.0 };
    let uncoupled = beyond(shared.force_scale, coupling);
    let quiet = LoadSeries::new(series.loads().iter().map(quiet).collect::<Vec<_>>())
        .with_shared_errors(shared)
        .ok();
    let without = |source: ErrorSource| {
        let mut errors = shared;
        match source {
            ErrorSource::Noise => return quiet.clone(),
            ErrorSource::Coupling => errors.force_scale = uncoupled.max(NEGLIGIBLE),
            ErrorSource::Force => errors.force_scale = coupling.max(NEGLIGIBLE),
            ErrorSource::PixelSize => errors.length_scale = 0.0,
            ErrorSource::ObjectRadius => errors.size = 0.0,
            ErrorSource::PoissonRatio => errors.poisson_ratio = 0.0,
            ErrorSource::Adhesion => errors.adhesion_n = 0.0,
            ErrorSource::Guide => errors.other_body = 0.0,
            // What is left of all.
            ErrorSource::Law => return None,
        }
        series.clone().with_shared_errors(errors).ok()
    };
    let sources = [
        ErrorSource::Noise,
        ErrorSource::Coupling,
        ErrorSource::Force,
        ErrorSource::PixelSize,
        ErrorSource::ObjectRadius,
        ErrorSource::PoissonRatio,
        ErrorSource::Adhesion,
        ErrorSource::Guide,
    ];
    let mut rest = all;
    let mut shares = Vec::new();
    for source in sources {
        let left = without(source).and_then(|series| relative_variance(estimator, &series));
        let part = left.map_or(0.0, |left| (all - left).clamp(0.0, rest));
        rest -= part;
        shares.push(ErrorShare {
            source,
            relative_error: part.sqrt(),
            assumed: source.is_assumed(settings),
        });
    }
    shares.push(ErrorShare {
        source: ErrorSource::Law,
        relative_error: rest.sqrt(),
        assumed: false,
    });
    shares.sort_by(|a, b| b.relative_error.total_cmp(&a.relative_error));
    shares
}

fn relative_variance(estimator: &dyn ModulusEstimator, series: &LoadSeries) -> Option<f64> {
    with_relative_error(estimator, series).map(|(_, relative)| relative * relative)
}
