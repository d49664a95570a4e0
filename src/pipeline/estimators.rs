//! Loads, the errors they share, and the modulus estimators that fit the object.
use super::choice::EstimatorChoice;
use super::error::PipelineError;
use super::object::Object;
use super::settings::Settings;
use crate::elasticity::ElasticityError;
use crate::elasticity::contact::Waveguide;
use crate::elasticity::modulus::{
    Estimate, Evidence, FlatPunch, HertzSphere, LoadSeries, LoadState, ModulusEstimate,
    ModulusEstimator, PaperRatio, SharedErrors, StrainReference, StressStrainRegression,
};

/// What one load says, before errors are split into its own and those that all loads share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoadReading {
    pub force_n: f64,
    /// Error of the force from noise.
    pub noise_n: f64,
    /// Error of the force from the calibration.
    pub calibration_n: f64,
    pub radius_m: Estimate<f64>,
}

/// Loads and the relative errors they share. Of the calibration's errors the smallest relative one is common to all loads (the
/// slope's); what a load has beyond that (the offset's) is its own.
pub(crate) fn split_errors(
    readings: impl Iterator<Item = LoadReading> + Clone,
    settings: &Settings,
) -> (Vec<LoadState<f64>>, SharedErrors<f64>) {
    let relative = |r: &LoadReading| (r.calibration_n / r.force_n).abs();
    let common = readings
        .clone()
        .map(|r| relative(&r))
        .fold(f64::INFINITY, f64::min);
    let common = if common.is_finite() { common } else { 0.0 };
    let load = |r: LoadReading| {
        let rest = (r.calibration_n.powi(2) - (common * r.force_n).powi(2))
            .max(0.0)
            .sqrt();
        LoadState::new(Estimate::new(r.force_n, r.noise_n.hypot(rest)))
            .with_contact_radius(r.radius_m)
    };
    let shared = SharedErrors {
        force_scale: common.hypot(settings.force_scale_error),
        length_scale: settings.length_scale_error,
        ..SharedErrors::default()
    };
    (readings.map(load).collect(), shared)
}

/// The contact radius with what no profile can know better: a hundredth of a pixel, by which a rim of pixels, blur and the
/// contact's true shape differ from the fitted profile.
pub(crate) fn radius_with_floor(
    value: f64,
    standard_error: f64,
    pixel_size_m: [f64; 2],
) -> Estimate<f64> {
    let floor = 0.01 * (pixel_size_m[0] * pixel_size_m[1]).sqrt();
    Estimate::new(value, standard_error.hypot(floor))
}

/// Loads with the errors that they share.
pub(crate) fn series(
    loads: Vec<LoadState<f64>>,
    shared: SharedErrors<f64>,
) -> Result<LoadSeries<f64>, PipelineError> {
    LoadSeries::new(loads)
        .with_shared_errors(shared)
        .map_err(PipelineError::Modulus)
}

type Attempt = Result<ModulusEstimate<f64>, ElasticityError>;

/// The estimate that the settings ask for.
pub(crate) fn chosen_estimate(
    settings: &Settings,
    loads: &LoadSeries<f64>,
) -> Result<ModulusEstimate<f64>, PipelineError> {
    let (object, waveguide, choice) = (
        settings.object,
        settings.waveguide.as_ref(),
        settings.estimator,
    );
    let attempt = match (choice, object) {
        (
            EstimatorChoice::Best | EstimatorChoice::Sphere,
            Object::Sphere {
                radius_m,
                poisson_ratio,
            },
        ) => {
            hertz(radius_m, poisson_ratio, waveguide, Evidence::All).and_then(|e| e.estimate(loads))
        }
        (
            EstimatorChoice::FlatPunch,
            Object::FlatPunch {
                radius_m,
                poisson_ratio,
            },
        ) => flat_punch(radius_m, poisson_ratio, waveguide).and_then(|e| e.estimate(loads)),
        (EstimatorChoice::Best | EstimatorChoice::PaperRatio, _) => {
            paper_ratio(&object).and_then(|e| e.estimate(loads))
        }
        (EstimatorChoice::Regression, _) => StressStrainRegression::new().estimate(loads),
        (EstimatorChoice::Sphere, _) => {
            return Err(PipelineError::WrongEstimator {
                estimator: choice,
                needs: "a ball",
            });
        }
        (EstimatorChoice::FlatPunch, _) => {
            return Err(PipelineError::WrongEstimator {
                estimator: choice,
                needs: "a flat punch",
            });
        }
    };
    attempt.map_err(PipelineError::Modulus)
}

/// Every estimate that the loads allow: the paper's ratio first, then the others that make sense for the object. What an
/// estimator cannot do with these loads is left out.
pub(crate) fn all_estimates(
    object: &Object,
    waveguide: Option<&Waveguide<f64>>,
    loads: &LoadSeries<f64>,
) -> Vec<ModulusEstimate<f64>> {
    let mut attempts: Vec<Attempt> = vec![paper_ratio(object).and_then(|e| e.estimate(loads))];
    match *object {
        Object::Sphere {
            radius_m,
            poisson_ratio,
        } => {
            let both = hertz(radius_m, poisson_ratio, waveguide, Evidence::All);
            attempts.push(both.and_then(|e| e.estimate(loads)));
        }
        Object::FlatPunch {
            radius_m,
            poisson_ratio,
        } => {
            let punch = flat_punch(radius_m, poisson_ratio, waveguide);
            attempts.push(punch.and_then(|e| e.estimate(loads)));
        }
        Object::Unknown { .. } => {}
    }
    attempts.push(StressStrainRegression::new().estimate(loads));
    attempts.into_iter().filter_map(Result::ok).collect()
}

fn hertz(
    radius_m: f64,
    poisson_ratio: f64,
    waveguide: Option<&Waveguide<f64>>,
    evidence: Evidence,
) -> Result<HertzSphere, ElasticityError> {
    let estimator = HertzSphere::new(radius_m, poisson_ratio)?.with_evidence(evidence);
    Ok(match waveguide {
        Some(waveguide) => estimator.with_waveguide(waveguide),
        None => estimator,
    })
}

fn flat_punch(
    radius_m: f64,
    poisson_ratio: f64,
    waveguide: Option<&Waveguide<f64>>,
) -> Result<FlatPunch, ElasticityError> {
    let punch = FlatPunch::new(radius_m, poisson_ratio)?;
    Ok(match waveguide {
        Some(waveguide) => punch.with_waveguide(waveguide),
        None => punch,
    })
}

/// Stress over strain, counted from the first load, as the paper matches two pressed frames.
fn paper_ratio(object: &Object) -> Result<PaperRatio, ElasticityError> {
    let ratio = PaperRatio::new().with_reference(StrainReference::FirstLoad);
    match object.sphere_radius_m() {
        Some(radius_m) => ratio.with_sphere_radius(radius_m),
        None => Ok(ratio),
    }
}
