//! The results of a press as plain data, for people ([`Display`]) and programs (feature `serde`).
use super::assumptions::{CheckedGain, CheckedGuide};
use super::budget::{self, ErrorShare};
use super::contact::ContactReading;
use super::error::PipelineError;
use super::flag::Flag;
use super::report::Report;
use super::session::{DriftWatch, Update};
#[cfg(feature = "serde")]
use super::text::outcome;
use super::text::{interval_text, with_error, with_its_error};
use super::time::TimeResult;
use crate::elasticity::modulus::{EstimatorKind, ModulusEstimate, Warning};
use crate::force::Estimate;
use crate::matching::StopReason;
use std::fmt::{self, Display, Formatter};

/// A modulus with its error.
///
/// ```
/// use tactile_imaging::elasticity::modulus::{
///     Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator,
/// };
/// use tactile_imaging::pipeline::ModulusResult;
/// // A ball of 3 mm radius under 10 mN, in contact up to 0.5 mm: E = (1 − ν²) 3FR/(4a³) = 135 kPa.
/// let load = LoadState::new(Estimate::new(10e-3, 0.1e-3))
///     .with_radius(Estimate::new(0.5e-3, 1e-6));
/// let modulus =
///     ModulusResult::from(&HertzSphere::new(3e-3, 0.5)?.estimate(&LoadSeries::new([load]))?);
/// assert!((modulus.value - 135e3).abs() < 1.0);
/// assert!(modulus.interval_95.0 < modulus.value && modulus.warnings.is_empty());
/// assert!(modulus.to_string().starts_with("135.0 ± 1.6 kPa"));
/// # Ok::<(), tactile_imaging::elasticity::ElasticityError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct ModulusResult {
    /// Young's modulus in pascals.
    pub value: f64,
    /// Standard error in pascals.
    pub standard_error: f64,
    /// 95 % interval in pascals. The upper end is `None` if the loads do not bound it.
    pub interval_95: (f64, Option<f64>),
    /// The estimator.
    #[cfg_attr(feature = "serde", serde(serialize_with = "outcome::text"))]
    pub estimator: EstimatorKind,
    /// Violated assumptions of the estimator.
    #[cfg_attr(feature = "serde", serde(serialize_with = "outcome::texts"))]
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

/// Results of one frame.
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
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
#[non_exhaustive]
pub struct FrameResult {
    /// Normal force in newtons.
    #[cfg_attr(feature = "serde", serde(serialize_with = "outcome::one"))]
    pub force_n: Result<Estimate, PipelineError>,
    /// Force by a gauge, in newtons. `None` without a gauge reading.
    pub gauge_force_n: Option<f64>,
    /// Contact radius in metres. For a flat face it is that of a disc of equal area.
    pub contact_radius_m: Estimate,
    /// Contact radius over the ball's radius: small-contact theory holds up to 0.3.
    pub contact_ratio: Option<f64>,
    /// Centroid (x, y) in pixels.
    pub centroid_px: [Estimate; 2],
    /// Area of the contact in square metres.
    pub contact_area_m2: f64,
    /// F/(π a²) in pascals.
    pub mean_stress_pa: Option<Estimate>,
    /// Maximum height of the reconstructed surface in metres.
    #[cfg_attr(feature = "serde", serde(serialize_with = "outcome::one"))]
    pub surface_height_m: Result<Estimate, PipelineError>,
    /// Whether the surface is apparent: the pressure interpreted as shading. The face of the sensor
    /// has another shape.
    pub surface_apparent: bool,
    /// Indentation of the guide by a ball on the axis, in metres, by the law of the guide's layers.
    /// See [`Press::guide_depression_m`](super::Press::guide_depression_m).
    pub guide_depression_m: Option<Estimate>,
}

/// Summary of the match between the control points of the first and the last frame.
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// use tactile_imaging::pipeline::MatchResult;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let matching: MatchResult = trial.press(&pipeline)?.measure().matching?;
/// assert_eq!(matching.points, 60);
/// assert!(matching.matched > 50 && matching.mean_confidence > 0.5);
/// assert!(
///     matching.residual_m < matching.mean_displacement_m,
///     "the warp maps points to their partners"
/// );
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct MatchResult {
    /// Control points on the first surface.
    pub points: usize,
    /// Control points with a partner on the last surface.
    pub matched: usize,
    /// Mean confidence of the matches.
    pub mean_confidence: f64,
    /// Root mean square distance between warped points and their partners in metres.
    pub residual_m: f64,
    /// Mean length of the displacement in metres.
    pub mean_displacement_m: f64,
    /// Iterations of the matcher.
    pub iterations: usize,
    /// Why the matcher stopped.
    pub stop: StopReason,
}

/// The strain between the first and the last frame.
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
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
#[non_exhaustive]
pub struct StrainResult {
    /// Name of the strain measure.
    pub measure: &'static str,
    /// Whether the strain is that of apparent surfaces ([`FrameResult::surface_apparent`]) rather
    /// than of a material. Under a ball e_zz is then positive.
    pub apparent: bool,
    /// Mean over the control points, as rows of the tensor (x, y, z).
    pub mean: [[f64; 3]; 3],
    /// Standard error of the mean.
    pub standard_error: [[f64; 3]; 3],
    /// Standard deviation over the control points.
    pub spread: [[f64; 3]; 3],
    /// Number of control points used.
    pub used: usize,
    /// Number of control points where the warp folds.
    pub folded: usize,
}

/// All results of a press. Each is the result of a stage or the error that prevented it,
/// independently of the other stages.
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// use tactile_imaging::Measurement;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let measurement: Measurement = trial.press(&pipeline)?.measure();
/// let modulus = measurement.youngs_modulus_pa.as_ref().expect("two loads");
/// assert!((modulus.value / 103e3 - 1.0).abs() < 0.0538, "the ball's 103 kPa");
/// assert_eq!(measurement.frames.len(), 2);
/// assert!(measurement.estimators.contains(modulus), "in addition to the paper's ratio");
/// assert!(measurement.to_string().starts_with(&format!("Young's modulus  {modulus}")));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Measurement {
    /// Young's modulus by the pipeline's estimator.
    #[cfg_attr(feature = "serde", serde(serialize_with = "outcome::one"))]
    pub youngs_modulus_pa: Result<ModulusResult, PipelineError>,
    /// Time range of the modulus and its change in that range. `None` if the frames have no times.
    pub time: Option<TimeResult>,
    /// Gain of the sensor by presses of known force. `None` without such presses.
    pub checked_gain: Option<CheckedGain>,
    /// Stiffness of the guide by presses of balls of known modulus. `None` without such presses.
    pub checked_guide: Option<CheckedGuide>,
    /// Error sources of the modulus, the largest first. Empty without a modulus.
    pub error_budget: Vec<ErrorShare>,
    /// Moduli by every estimator that the frames permit, the paper's ratio first.
    pub estimators: Vec<ModulusResult>,
    /// Results of each frame.
    #[cfg_attr(feature = "serde", serde(serialize_with = "outcome::each"))]
    pub frames: Vec<Result<FrameResult, PipelineError>>,
    /// The strain between the first frame and the last.
    #[cfg_attr(feature = "serde", serde(serialize_with = "outcome::one"))]
    pub strain: Result<StrainResult, PipelineError>,
    /// The match between the first frame and the last.
    #[cfg_attr(
        feature = "serde",
        serde(rename = "match", serialize_with = "outcome::one")
    )]
    pub matching: Result<MatchResult, PipelineError>,
    /// Cautions.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Vec::is_empty"))]
    pub flags: Vec<Flag>,
    /// Record of the stages that ran and those that were skipped.
    pub report: Report,
    /// Number of the first frame in messages.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(super) first_frame: usize,
}

impl ModulusResult {
    fn numbered_from(mut self, first: usize) -> Self {
        let warnings = self.warnings.into_iter();
        self.warnings = warnings
            .map(|warning| warning.numbered_from(first))
            .collect();
        self
    }
}

impl Measurement {
    /// This measurement with frames and loads counted from `first` instead of 0, in its text and in
    /// the messages of its errors and cautions.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let measurement = trial.press(&pipeline)?.measure();
    /// assert!(measurement.to_string().contains("\nframe 0 "));
    /// assert!(measurement.numbered_from(1).to_string().contains("\nframe 2 "));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn numbered_from(mut self, first: usize) -> Self {
        let error = |error: PipelineError| error.numbered_from(first);
        let modulus = |modulus: ModulusResult| modulus.numbered_from(first);
        let frame = |mut frame: FrameResult| {
            frame.force_n = frame.force_n.map_err(error);
            frame.surface_height_m = frame.surface_height_m.map_err(error);
            frame
        };
        let frames = self.frames.into_iter();
        self.youngs_modulus_pa = self.youngs_modulus_pa.map(modulus).map_err(error);
        self.estimators = self.estimators.into_iter().map(modulus).collect();
        self.frames = frames
            .map(|found| found.map(frame).map_err(error))
            .collect();
        self.strain = self.strain.map_err(error);
        self.matching = self.matching.map_err(error);
        let flags = self.flags.into_iter();
        self.flags = flags.map(|flag| flag.numbered_from(first)).collect();
        self.first_frame += first;
        self
    }
}

impl Display for ModulusResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let error = self.standard_error;
        write!(f, "{} kPa", with_error(self.value, error, 1e-3))?;
        let (low, high) = self.interval_95;
        if high.is_some() || low > 0.0 {
            let ends = interval_text((low, high), error, 1e-3);
            write!(f, "   95 %: {ends} kPa")?;
        } else {
            f.write_str("   no interval: the errors are unknown")?;
        }
        write!(f, "   ({})", self.estimator)
    }
}

impl Display for FrameResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.force_n {
            Ok(force) => write!(f, "force {} N", with_its_error(force, 1.0))?,
            Err(_) => f.write_str("force unknown")?,
        }
        let radius = self.contact_radius_m;
        if let Some(gauge) = self.gauge_force_n {
            write!(f, " (gauge {gauge:.4} N)")?;
        }
        write!(f, "   contact radius {} mm", with_its_error(radius, 1e3))?;
        if let Some(ratio) = self.contact_ratio {
            write!(f, "   a/R {ratio:.3}")?;
        }
        if let Some(depth) = self.guide_depression_m {
            write!(
                f,
                "   guide pressed in by {} mm",
                with_its_error(depth, 1e3)
            )?;
        }
        let [x, y] = self.centroid_px.map(|c| c.value);
        write!(f, "   centroid ({x:.2}, {y:.2}) px")?;
        match self.mean_stress_pa {
            Some(stress) => write!(f, "   mean stress {} kPa", with_its_error(stress, 1e-3)),
            None => Ok(()),
        }
    }
}

impl Display for MatchResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} control points matched, residual {:.1} µm, mean displacement {:.1} µm, {} \
             after {} iterations",
            self.matched,
            self.points,
            self.residual_m * 1e6,
            self.mean_displacement_m * 1e6,
            stop_text(self.stop),
            self.iterations
        )
    }
}

impl Display for StrainResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // The strain between equal frames is zero to rounding: digits beyond the sixth are never
        // significant.
        let error = |i: usize, j: usize| self.standard_error[i][j].max(1e-6);
        let e = |i: usize, j: usize| with_error(self.mean[i][j], error(i, j), 1.0);
        write!(
            f,
            "{}: e_xx {}  e_yy {}  e_zz {}{}",
            self.measure,
            e(0, 0),
            e(1, 1),
            e(2, 2),
            if self.apparent {
                "   (of the apparent surface: the pressure interpreted as shading)"
            } else {
                ""
            }
        )
    }
}

/// Writes the first three cautions of each kind and the number of further ones: in a press of
/// thousands of frames each may have the same caution.
fn cautions(f: &mut Formatter<'_>, flags: &[Flag]) -> fmt::Result {
    let kind = |flag: &Flag| {
        let warning = match flag {
            Flag::Assumption { warning } => Some(std::mem::discriminant(warning)),
            _ => None,
        };
        (std::mem::discriminant(flag), warning)
    };
    let mut printed = Vec::new();
    for flag in flags {
        if printed.contains(&kind(flag)) {
            continue;
        }
        printed.push(kind(flag));
        let alike = || flags.iter().filter(|other| kind(other) == kind(flag));
        for flag in alike().take(3) {
            writeln!(f, "  {flag}")?;
        }
        let more = alike().count().saturating_sub(3);
        if more > 0 {
            writeln!(f, "  … and {more} more like it")?;
        }
    }
    Ok(())
}

/// Writes a result under its heading, or the reason why there is none.
fn line<T: Display>(
    f: &mut Formatter<'_>,
    heading: &str,
    result: &Result<T, PipelineError>,
) -> fmt::Result {
    match result {
        Ok(value) => writeln!(f, "{heading:<16} {value}"),
        Err(error) => writeln!(f, "{heading:<16} none: {error}"),
    }
}

fn stop_text(stop: StopReason) -> &'static str {
    match stop {
        StopReason::Converged => "converged",
        StopReason::Exact => "exact",
        StopReason::IterationLimit => "not converged",
        StopReason::Cancelled => "stopped by the caller",
        StopReason::Degenerate => "degenerate",
        _ => "stopped",
    }
}

impl Display for Measurement {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        line(f, "Young's modulus", &self.youngs_modulus_pa)?;
        if let Some(sentence) = budget::sentence(&self.error_budget) {
            writeln!(f, "{:<16} {sentence}", "error budget")?;
        }
        if let Some(checked) = &self.checked_gain {
            writeln!(f, "{:<16} {checked}", "check")?;
        }
        if let Some(checked) = &self.checked_guide {
            writeln!(f, "{:<16} {checked}", "check")?;
        }
        if let Some(time) = &self.time {
            writeln!(f, "{:<16} {time}", "over time")?;
        }
        for (i, frame) in self.frames.iter().enumerate() {
            line(f, &format!("frame {}", self.first_frame + i), frame)?;
        }
        line(f, "match", &self.matching)?;
        line(f, "strain", &self.strain)?;
        if !self.estimators.is_empty() {
            writeln!(f, "all estimators:")?;
        }
        for estimate in &self.estimators {
            writeln!(f, "  {estimate}")?;
        }
        if !self.flags.is_empty() {
            writeln!(f, "cautions:")?;
            cautions(f, &self.flags)?;
        }
        Ok(())
    }
}

impl Display for ContactReading {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.force_n {
            Some(force) => write!(f, "force {} N", with_its_error(force.total(), 1.0))?,
            None => f.write_str("force unknown")?,
        }
        write!(
            f,
            "   contact radius {} mm",
            with_its_error(self.contact_radius_m.total(), 1e3)
        )?;
        if let Some(depth) = self.indentation_m {
            write!(f, "   indentation {} mm", with_its_error(depth, 1e3))?;
        }
        let [x, y] = self.centroid_px.map(|c| with_its_error(c, 1.0));
        write!(f, "   centroid ({x}, {y}) px")?;
        self.flags(0)
            .try_for_each(|flag| write!(f, "   [{}]", flag.without_frame()))
    }
}

impl Display for Update {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "frame {}: ", self.frame)?;
        match &self.contact {
            Some(contact) => write!(f, "{contact}")?,
            None => f.write_str("no contact")?,
        }
        if let Some(shear) = &self.shear {
            let [x, y] = shear.force_n.map(|e| with_its_error(e, 1.0));
            write!(f, "   shear ({x}, {y}) N")?;
        }
        Ok(())
    }
}

impl Display for DriftWatch {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self {
            frames,
            last_grey,
            greatest_grey,
            ..
        } = self;
        let s = if *frames == 1 { "" } else { "s" };
        write!(
            f,
            "light {last_grey:+.2} grey levels from the reference, {greatest_grey:+.2} at most, in "
        )?;
        write!(f, "{frames} frame{s} without contact")
    }
}
