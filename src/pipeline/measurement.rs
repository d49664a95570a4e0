//! All results of a press as plain data: for people ([`Display`](std::fmt::Display)) and programs (feature `serde`).
use super::error::PipelineError;
use super::flag::Flag;
use super::press::Press;
use super::report::Report;
use crate::elasticity::modulus::ModulusEstimate;
use crate::force::Estimate;
use crate::matching::StopReason;
use nalgebra::Matrix3;

/// A modulus with its error.
///
/// ```
/// use tactile_imaging::elasticity::modulus::{Estimate, HertzSphere, LoadState, ModulusEstimator};
/// use tactile_imaging::pipeline::ModulusResult;
/// // A ball of 3 mm radius under 10 mN, in contact up to 0.5 mm: E = (1 − ν²) 3FR/(4a³) = 135 kPa.
/// let load = LoadState::new(Estimate::new(10e-3, 0.1e-3)).with_contact_radius(Estimate::new(0.5e-3, 1e-6));
/// let modulus = ModulusResult::from(&HertzSphere::new(3e-3, 0.5)?.estimate(&[load])?);
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
    pub estimator: String,
    /// Where the estimator's assumptions fail.
    pub warnings: Vec<String>,
}

impl From<&ModulusEstimate<f64>> for ModulusResult {
    fn from(estimate: &ModulusEstimate<f64>) -> Self {
        Self {
            value: estimate.youngs_modulus_pa,
            standard_error: estimate.standard_error_pa,
            interval_95: (estimate.interval_95.lower, estimate.interval_95.upper),
            estimator: estimate.estimator.to_string(),
            warnings: estimate.warnings.iter().map(ToString::to_string).collect(),
        }
    }
}

/// What one frame says.
///
/// ```
/// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
/// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
/// use tactile_imaging::pipeline::FrameResult;
/// let pipeline = trial.pipeline()?;
/// let frames: Vec<FrameResult> = trial.press(&pipeline)?.measure()?.frames;
/// // A ball of 3 mm radius under 0.7 N and 1.2 N.
/// for (frame, force_n) in frames.iter().zip([0.7, 1.2]) {
///     assert!((frame.force_n.value / force_n - 1.0).abs() < 0.02);
///     let radius = frame.contact_radius_m.value;
///     assert!((frame.contact_ratio.expect("a ball") - radius / 3e-3).abs() < 1e-12);
///     let stress = frame.mean_stress_pa.expect("a force").value;
///     assert!((stress * std::f64::consts::PI * radius * radius - frame.force_n.value).abs() < 1e-12);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct FrameResult {
    /// Normal force in newtons.
    pub force_n: Estimate<f64>,
    /// What a gauge read, in newtons.
    pub gauge_force_n: Option<f64>,
    /// Contact radius in metres.
    pub contact_radius_m: Estimate<f64>,
    /// Contact radius over the ball's radius: small-contact theory holds up to 0.3.
    pub contact_ratio: Option<f64>,
    /// Centroid (x, y) in pixels.
    pub centroid_px: [f64; 2],
    /// One standard deviation of the centroid, in pixels.
    pub centroid_sd_px: [f64; 2],
    /// Area of the contact in square metres.
    pub contact_area_m2: f64,
    /// F/(π a²) in pascals.
    pub mean_stress_pa: Option<Estimate<f64>>,
    /// Greatest height of the reconstructed surface in metres, where it was reconstructed.
    pub surface_height_m: Option<f64>,
}

/// How the control points of the first and the last frame were matched.
///
/// ```
/// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
/// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
/// use tactile_imaging::pipeline::MatchResult;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let matching: MatchResult = trial.press(&pipeline)?.measure()?.matching.expect("two frames");
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
    pub stop: String,
}

/// The strain between the first and the last frame.
///
/// ```
/// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
/// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
/// use tactile_imaging::pipeline::StrainResult;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let strain: StrainResult = trial.press(&pipeline)?.measure()?.strain.expect("two frames");
/// // From 0.7 N to 1.2 N the apparent surface grows by s = (1.2/0.7)^⅓: e_xx = (s² − 1)/2 = 0.216.
/// assert!((strain.mean[0][0] - 0.216).abs() < 0.03);
/// assert_eq!(strain.mean[0][2], strain.mean[2][0], "symmetric");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct StrainResult {
    /// The measure of strain.
    pub measure: String,
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

/// All results of a press.
///
/// ```
/// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
/// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
/// use tactile_imaging::Measurement;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let measurement: Measurement = trial.press(&pipeline)?.measure()?;
/// let modulus = &measurement.youngs_modulus_pa;
/// assert!((modulus.value / 103e3 - 1.0).abs() < 0.0538, "the ball's 103 kPa");
/// assert_eq!(measurement.frames.len(), 2);
/// assert!(measurement.estimators.contains(modulus), "beside the paper's ratio");
/// assert!(measurement.to_string().starts_with(&format!("Young's modulus  {modulus}")));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Measurement {
    /// Young's modulus by the estimator that fits the object best.
    pub youngs_modulus_pa: ModulusResult,
    /// By every estimator that the frames allow, the paper's ratio first.
    pub estimators: Vec<ModulusResult>,
    /// What every frame says.
    pub frames: Vec<FrameResult>,
    /// The strain; none with one frame.
    pub strain: Option<StrainResult>,
    /// The match; none with one frame.
    #[cfg_attr(feature = "serde", serde(rename = "match"))]
    pub matching: Option<MatchResult>,
    /// Cautions.
    pub flags: Vec<Flag>,
    /// What was computed and what was skipped.
    pub report: Report,
}

impl Press<'_> {
    /// Measures everything: all stages on all frames.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let measurement = trial.press(&pipeline)?.measure()?;
    /// let height = measurement.frames[0].surface_height_m.expect("a surface");
    /// assert!((height / trial.truth().frames[0].surface_height_m - 1.0).abs() < 0.1);
    /// // At 0.7 N the ball is in contact beyond its own radius: Hertz holds for a/R up to 0.3.
    /// assert!(measurement.flags.iter().any(|flag| flag.to_string().contains("small-contact theory does not hold")));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError`]: a frame without contact or force, loads that do not determine a modulus. Where the modulus
    /// does without strain, trouble with surfaces and matches is a flag, not an error.
    pub fn measure(&mut self) -> Result<Measurement, PipelineError> {
        let youngs_modulus_pa = ModulusResult::from(&self.modulus()?);
        let mut flags = Vec::new();
        let last = self.frames().saturating_sub(1);
        let (mut matching, mut strain) = (None, None);
        if last > 0 {
            match self.match_and_strain(last, &mut flags) {
                Ok((m, s)) => (matching, strain) = (Some(m), Some(s)),
                Err(error) => flags.push(Flag::NoStrain { reason: error.to_string() }),
            }
        }
        let estimators: Vec<_> = self.estimates()?.iter().map(ModulusResult::from).collect();
        let frames =
            (0..self.frames()).map(|i| self.frame_result(i, &mut flags)).collect::<Result<_, _>>()?;
        let warnings = youngs_modulus_pa.warnings.iter().cloned();
        flags.extend(warnings.map(|warning| Flag::Assumption { warning }));
        let report = self.report().clone();
        Ok(Measurement { youngs_modulus_pa, estimators, frames, strain, matching, flags, report })
    }

    fn frame_result(&mut self, frame: usize, flags: &mut Vec<Flag>) -> Result<FrameResult, PipelineError> {
        let reading = *self.contact(frame)?.ok_or(PipelineError::NoContact { frame })?;
        let force_n = reading.force_n.ok_or(PipelineError::NoForce { frame })?;
        let gauge_force_n = self.gauge_n(frame);
        flags.extend(reading.flags(frame));
        if let Some(gauge_n) = gauge_force_n {
            let apart = (gauge_n - force_n.value).abs();
            if apart > 3.0 * force_n.standard_error && apart > 0.02 * gauge_n {
                flags.push(Flag::GaugeDisagrees { frame, measured_n: force_n.value, gauge_n });
            }
        }
        let radius = self.stages().settings().object.sphere_radius_m();
        let surface_height_m = self.surface(frame).ok().map(|s| {
            let heights = s.surface.heights.iter().copied().filter(|h| h.is_finite());
            heights.fold(0.0, f64::max)
        });
        Ok(FrameResult {
            force_n,
            gauge_force_n,
            contact_radius_m: reading.contact_radius_m,
            contact_ratio: radius.map(|r| reading.contact_radius_m.value / r),
            centroid_px: reading.centroid_px.map(|c| c.value),
            centroid_sd_px: reading.centroid_px.map(|c| c.standard_error),
            contact_area_m2: reading.area_m2,
            mean_stress_pa: reading.mean_stress_pa(),
            surface_height_m,
        })
    }

    fn match_and_strain(
        &mut self,
        frame: usize,
        flags: &mut Vec<Flag>,
    ) -> Result<(MatchResult, StrainResult), PipelineError> {
        let model = self.control_points(0)?.to_vec();
        let matching = self.matching(frame)?;
        let n = model.len() as f64;
        let lengths = model.iter().zip(&matching.warped).map(|(a, b)| (b - a).norm());
        let result = MatchResult {
            points: model.len(),
            matched: matching.assignment.iter().flatten().count(),
            mean_confidence: matching.confidence.iter().sum::<f64>() / n,
            residual_m: matching.report.residual,
            mean_displacement_m: lengths.sum::<f64>() / n,
            iterations: matching.report.iterations,
            stop: format!("{:?}", matching.report.stop),
        };
        if matching.report.stop == StopReason::IterationLimit {
            flags.push(Flag::MatchNotConverged);
        }
        if result.matched < result.points {
            flags.push(Flag::Unmatched { points: result.points - result.matched });
        }
        let strain = self.strain(frame)?;
        let summary = &strain.summary;
        if !summary.folded.is_empty() {
            flags.push(Flag::Folded { points: summary.folded.len() });
        }
        let strain = StrainResult {
            measure: strain.measure.into(),
            mean: rows(&summary.mean),
            standard_error: rows(&summary.standard_error),
            spread: rows(&summary.spread),
            used: summary.used,
            folded: summary.folded.len(),
        };
        Ok((result, strain))
    }
}

fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}
