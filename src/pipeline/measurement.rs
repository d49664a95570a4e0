//! All results of a press as plain data: for people ([`Display`](std::fmt::Display)) and programs (feature `serde`).
use super::error::PipelineError;
use super::error_budget::ErrorShare;
use super::flag::Flag;
use super::report::Report;
use super::time::TimeResult;
use crate::elasticity::modulus::{EstimatorKind, ModulusEstimate, Warning};
use crate::force::Estimate;
use crate::matching::StopReason;

/// A modulus with its error.
///
/// ```
/// use tactile_imaging::elasticity::modulus::{Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator};
/// use tactile_imaging::pipeline::ModulusResult;
/// // A ball of 3 mm radius under 10 mN, in contact up to 0.5 mm: E = (1 − ν²) 3FR/(4a³) = 135 kPa.
/// let load = LoadState { contact_radius_m: Some(Estimate::new(0.5e-3, 1e-6)), ..LoadState::new(Estimate::new(10e-3, 0.1e-3)) };
/// let modulus = ModulusResult::from(&HertzSphere::new(3e-3, 0.5)?.estimate(&LoadSeries::new([load]))?);
/// assert!((modulus.value - 135e3).abs() < 1.0);
/// assert!(modulus.interval_95.0 < modulus.value && modulus.warnings.is_empty());
/// assert!(modulus.to_string().starts_with("135.0 ± 1.6 kPa"));
/// # Ok::<(), tactile_imaging::elasticity::ElasticityError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ModulusResult {
    /// Young's modulus in pascals.
    pub value: f64,
    /// Its standard error in pascals.
    pub standard_error: f64,
    /// Its 95 % interval in pascals; no upper end where the loads do not bound it.
    pub interval_95: (f64, Option<f64>),
    /// Which estimator.
    #[cfg_attr(feature = "serde", serde(serialize_with = "super::outcome::text"))]
    pub estimator: EstimatorKind,
    /// Where the estimator's assumptions fail.
    #[cfg_attr(feature = "serde", serde(serialize_with = "super::outcome::texts"))]
    pub warnings: Vec<Warning>,
}

impl From<&ModulusEstimate> for ModulusResult {
    fn from(estimate: &ModulusEstimate) -> Self {
        Self {
            value: estimate.youngs_modulus_pa,
            standard_error: estimate.standard_error_pa,
            interval_95: (estimate.interval_95.lower, estimate.interval_95.upper),
            estimator: estimate.estimator,
            warnings: estimate.warnings.clone(),
        }
    }
}

/// What one frame says.
///
/// ```
/// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
/// # let camera = Camera::default().coarser(8);
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
/// use tactile_imaging::pipeline::FrameResult;
/// let pipeline = trial.pipeline()?;
/// let measurement = trial.press(&pipeline)?.measure();
/// let frames: Vec<&FrameResult> = measurement.frames.iter().flatten().collect();
/// // A ball of 3 mm radius under 0.7 N and 1.2 N.
/// for (frame, force_n) in frames.iter().zip([0.7, 1.2]) {
///     let force = frame.force_n.as_ref().expect("a calibrated sensor").value;
///     assert!((force / force_n - 1.0).abs() < 0.02);
///     let radius = frame.contact_radius_m.value;
///     assert!((frame.contact_ratio.expect("a ball") - radius / 3e-3).abs() < 1e-12);
///     let stress = frame.mean_stress_pa.expect("a force").value;
///     assert!((stress * std::f64::consts::PI * radius * radius - force).abs() < 1e-12);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct FrameResult {
    /// Normal force in newtons.
    #[cfg_attr(feature = "serde", serde(serialize_with = "super::outcome::one"))]
    pub force_n: Result<Estimate, PipelineError>,
    /// What a gauge read, in newtons.
    pub gauge_force_n: Option<f64>,
    /// Contact radius in metres; of a flat face that of a disc of its area.
    pub contact_radius_m: Estimate,
    /// Contact radius over the ball's radius: small-contact theory holds up to 0.3.
    pub contact_ratio: Option<f64>,
    /// Centroid (x, y) in pixels.
    pub centroid_px: [f64; 2],
    /// One standard deviation of the centroid, in pixels.
    pub centroid_sd_px: [f64; 2],
    /// Area of the contact in square metres.
    pub contact_area_m2: f64,
    /// F/(π a²) in pascals.
    pub mean_stress_pa: Option<Estimate>,
    /// Greatest height of the reconstructed surface in metres.
    #[cfg_attr(feature = "serde", serde(serialize_with = "super::outcome::one"))]
    pub surface_height_m: Result<f64, PipelineError>,
}

/// How the control points of the first and the last frame were matched.
///
/// ```
/// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
/// # let camera = Camera::default().coarser(8);
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
/// use tactile_imaging::pipeline::MatchResult;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let matching: MatchResult = trial.press(&pipeline)?.measure().matching?;
/// assert_eq!(matching.points, 60);
/// assert!(matching.matched > 50 && matching.mean_confidence > 0.5);
/// assert!(matching.residual_m < matching.mean_displacement_m, "the warp takes points to their partners");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct MatchResult {
    /// Control points on the first surface.
    pub points: usize,
    /// Those with a partner on the last.
    pub matched: usize,
    /// Mean confidence of the matches.
    pub mean_confidence: f64,
    /// Root mean square distance between warped points and their partners in metres.
    pub residual_m: f64,
    /// Mean length of the displacement in metres.
    pub mean_displacement_m: f64,
    /// Iterations.
    pub iterations: usize,
    /// Why the matcher stopped.
    pub stop: StopReason,
}

/// The strain between the first and the last frame.
///
/// ```
/// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
/// # let camera = Camera::default().coarser(8);
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
/// use tactile_imaging::pipeline::StrainResult;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let strain: StrainResult = trial.press(&pipeline)?.measure().strain?;
/// // From 0.7 N to 1.2 N the apparent surface grows by s = (1.2/0.7)^⅓: e_xx = (s² − 1)/2 = 0.216.
/// assert!((strain.mean[0][0] - 0.216).abs() < 0.03);
/// assert_eq!(strain.mean[0][2], strain.mean[2][0], "symmetric");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct StrainResult {
    /// The name of the measure of strain.
    pub measure: &'static str,
    /// Mean over the control points, rows of the tensor (x, y, z).
    pub mean: [[f64; 3]; 3],
    /// Standard error of the mean.
    pub standard_error: [[f64; 3]; 3],
    /// Standard deviation over the control points.
    pub spread: [[f64; 3]; 3],
    /// Control points that count.
    pub used: usize,
    /// Control points where the warp folds over.
    pub folded: usize,
}

/// All results of a press: what a stage computed, or why it could not, whatever became of the others.
///
/// ```
/// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
/// # let camera = Camera::default().coarser(8);
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
/// use tactile_imaging::Measurement;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let measurement: Measurement = trial.press(&pipeline)?.measure();
/// let modulus = measurement.youngs_modulus_pa.as_ref().expect("two loads");
/// assert!((modulus.value / 103e3 - 1.0).abs() < 0.0538, "the ball's 103 kPa");
/// assert_eq!(measurement.frames.len(), 2);
/// assert!(measurement.estimators.contains(modulus), "beside the paper's ratio");
/// assert!(measurement.to_string().starts_with(&format!("Young's modulus  {modulus}")));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Measurement {
    /// Young's modulus by the pipeline's estimator.
    #[cfg_attr(feature = "serde", serde(serialize_with = "super::outcome::one"))]
    pub youngs_modulus_pa: Result<ModulusResult, PipelineError>,
    /// The time that the modulus is of, where frames say when they were taken, and whether it changed meanwhile.
    pub time: Option<TimeResult>,
    /// Which inputs the modulus' error comes from, the largest first; empty without a modulus.
    pub error_budget: Vec<ErrorShare>,
    /// By every estimator that the frames allow, the paper's ratio first.
    pub estimators: Vec<ModulusResult>,
    /// What every frame says.
    #[cfg_attr(feature = "serde", serde(serialize_with = "super::outcome::each"))]
    pub frames: Vec<Result<FrameResult, PipelineError>>,
    /// The strain between the first frame and the last.
    #[cfg_attr(feature = "serde", serde(serialize_with = "super::outcome::one"))]
    pub strain: Result<StrainResult, PipelineError>,
    /// The match between the first frame and the last.
    #[cfg_attr(
        feature = "serde",
        serde(rename = "match", serialize_with = "super::outcome::one")
    )]
    pub matching: Result<MatchResult, PipelineError>,
    /// Cautions.
    pub flags: Vec<Flag>,
    /// What was computed and what was skipped.
    pub report: Report,
}
