//! Which input the error of a modulus comes from.
use super::time::quiet;
use crate::elasticity::modulus::{LoadSeries, ModulusEstimator, SharedErrors};
use std::fmt;

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
    /// Size of a pixel on the sensing surface.
    PixelSize,
    /// Radius of the object.
    ObjectRadius,
    /// Poisson's ratio of the object.
    PoissonRatio,
    /// Moduli, thicknesses and Poisson ratios of the guide's layers.
    Guide,
    /// The contact law, and what else the estimator adds.
    Law,
}

impl fmt::Display for ErrorSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Noise => "noise of the frames",
            Self::Force => "the calibration of the force",
            Self::PixelSize => "the size of a pixel",
            Self::ObjectRadius => "the object's radius",
            Self::PoissonRatio => "the object's Poisson ratio",
            Self::Guide => "the guide's layers",
            Self::Law => "the contact law",
        })
    }
}

/// The part of a modulus' relative standard error that one input is responsible for; the parts' squares add up to the whole.
///
/// ```
/// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
/// # let camera = Camera::default().coarser(8);
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
/// use tactile_imaging::pipeline::{ErrorShare, ErrorSource};
/// // A ball of 3 mm whose radius is known to 0.3 mm.
/// let pipeline = trial.pipeline()?.with_settings(|settings| settings.object_radius_error_m = 0.3e-3)?;
/// let budget: Vec<ErrorShare> = trial.press(&pipeline)?.measure().error_budget;
/// assert_eq!(budget[0].source, ErrorSource::ObjectRadius, "the largest first");
/// assert!(budget[0].relative_error > 0.1, "E is proportional to R, and the guide takes a part of the compliance");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ErrorShare {
    /// The input.
    pub source: ErrorSource,
    /// Its standard error's part in the modulus, relative to the modulus.
    pub relative_error: f64,
}

/// What is left of an error that is taken out: an estimator without any error gives no interval.
const NEGLIGIBLE: f64 = 1e-9;

/// By how much the squared standard error falls without each input's error, the largest part first.
pub(super) fn of(estimator: &dyn ModulusEstimator, series: &LoadSeries) -> Vec<ErrorShare> {
    let Some(all) = relative_variance(estimator, series) else {
        return Vec::new();
    };
    let shared = *series.shared_errors();
    let without = |shared: SharedErrors| series.clone().with_shared_errors(shared).ok();
    let quiet = LoadSeries::new(series.loads().iter().map(quiet).collect::<Vec<_>>())
        .with_shared_errors(shared)
        .ok();
    let reduced = [
        (ErrorSource::Noise, quiet),
        (
            ErrorSource::Force,
            without(SharedErrors {
                force_scale: NEGLIGIBLE,
                ..shared
            }),
        ),
        (
            ErrorSource::PixelSize,
            without(SharedErrors {
                length_scale: 0.0,
                ..shared
            }),
        ),
        (
            ErrorSource::ObjectRadius,
            without(SharedErrors {
                size: 0.0,
                ..shared
            }),
        ),
        (
            ErrorSource::PoissonRatio,
            without(SharedErrors {
                poisson_ratio: 0.0,
                ..shared
            }),
        ),
        (
            ErrorSource::Guide,
            without(SharedErrors {
                other_body: 0.0,
                ..shared
            }),
        ),
    ];
    let mut rest = all;
    let mut shares = Vec::new();
    for (source, reduced) in reduced {
        let left = reduced.and_then(|series| relative_variance(estimator, &series));
        let part = left.map_or(0.0, |left| (all - left).clamp(0.0, rest));
        rest -= part;
        shares.push(ErrorShare {
            source,
            relative_error: part.sqrt(),
        });
    }
    shares.push(ErrorShare {
        source: ErrorSource::Law,
        relative_error: rest.sqrt(),
    });
    shares.sort_by(|a, b| b.relative_error.total_cmp(&a.relative_error));
    shares
}

fn relative_variance(estimator: &dyn ModulusEstimator, series: &LoadSeries) -> Option<f64> {
    let estimate = estimator.estimate(series).ok()?;
    let relative = estimate.standard_error_pa / estimate.youngs_modulus_pa;
    relative.is_finite().then_some(relative * relative)
}
