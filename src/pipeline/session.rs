//! A session: one sensor, one object, a stream of frames.
//!
//! The first frames without contact make the reference; then every frame gives its contact and force, and every contact
//! refines the modulus. Memory is constant: similar loads are merged. [`Session::push`] allocates nothing once its buffers
//! have their size.
use super::contact::{ContactReading, FrameContact, resize};
use super::error::PipelineError;
use super::object::{LoadReading, best_estimate, radius_with_floor, split_errors};
use super::report::{Report, SkipReason, Stage};
use super::stages::Stages;
use crate::elasticity::modulus::ModulusEstimate;
use crate::force::{ForceWorkspace, ReferenceFrame};
use ndarray::{Array2, ArrayView2};
use std::sync::Arc;
use std::time::Instant;

/// Loads that a session keeps apart; more are merged.
pub const SESSION_LOADS: usize = 32;

/// What one frame of a stream says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// Number of the frame, counted from 0.
    pub frame: u64,
    /// The contact; `None` where nothing touches.
    pub contact: Option<ContactReading>,
    /// The frame equals the one before it, bit for bit, and was not measured again.
    pub repeated: bool,
}

/// Force and radius at one load, averaged over the frames taken there.
#[derive(Clone, Copy, Debug)]
struct MergedLoad {
    frames: f64,
    force_n: f64,
    radius_m: f64,
    force_variance: f64,
    radius_variance: f64,
    calibration: f64,
}

impl MergedLoad {
    fn of(reading: &ContactReading) -> Option<Self> {
        let force = reading.force_n?;
        Some(Self {
            frames: 1.0,
            force_n: force.value,
            radius_m: reading.contact_radius_m.value,
            force_variance: reading.force_noise_n.powi(2),
            radius_variance: reading.contact_radius_m.standard_error.powi(2),
            calibration: (reading.force_calibration_n / force.value).abs(),
        })
    }

    /// The mean of both. Radii are averaged as cubes, which grow in proportion to the force.
    fn merged(self, other: Self) -> Self {
        let frames = self.frames + other.frames;
        let (a, b) = (self.frames / frames, other.frames / frames);
        Self {
            frames,
            force_n: a * self.force_n + b * other.force_n,
            radius_m: (a * self.radius_m.powi(3) + b * other.radius_m.powi(3)).cbrt(),
            force_variance: a * a * self.force_variance + b * b * other.force_variance,
            radius_variance: a * a * self.radius_variance + b * b * other.radius_variance,
            calibration: a * self.calibration + b * other.calibration,
        }
    }

    fn reading(&self, pixel_size_m: [f64; 2]) -> LoadReading {
        LoadReading {
            force_n: self.force_n,
            noise_n: self.force_variance.sqrt(),
            calibration_n: self.calibration * self.force_n,
            radius_m: radius_with_floor(self.radius_m, self.radius_variance.sqrt(), pixel_size_m),
        }
    }
}

/// Follows a stream of frames from one sensor pressed on one object. `Send`: one session a thread.
///
/// ```
/// use std::sync::Arc;
/// use tactile_imaging::pipeline::{Session, Trial};
/// use tactile_imaging::simulate::{CalibrationOptions, Camera, PressOptions};
/// let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
/// let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
/// let mut session = Session::new(Arc::new(trial.pipeline()?), trial.simulation.reference.view())?;
/// for frame in &trial.simulation.frames {
///     assert!(session.push(frame.view())?.contact.is_some());
/// }
/// let modulus = session.modulus()?;
/// assert!((modulus.youngs_modulus_pa / 103e3 - 1.0).abs() < 0.0538);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Session {
    stages: Arc<dyn Stages>,
    reference: ReferenceFrame,
    workspace: ForceWorkspace,
    contact: FrameContact,
    last: Array2<u8>,
    /// Whether `contact` is that of `last`.
    measured: bool,
    frames: u64,
    loads: Vec<MergedLoad>,
    report: Report,
}

impl Session {
    /// A session whose reference is one frame without contact.
    ///
    /// # Errors
    /// [`PipelineError::Sensor`].
    pub fn new(stages: Arc<dyn Stages>, reference: ArrayView2<'_, u8>) -> Result<Self, PipelineError> {
        Self::from_frames(stages, &[reference])
    }

    /// A session whose reference is the mean of frames without contact, from which the noise is measured too.
    ///
    /// # Errors
    /// [`PipelineError::Sensor`] for no frames, or frames that differ in size.
    pub fn from_frames(
        stages: Arc<dyn Stages>,
        references: &[ArrayView2<'_, u8>],
    ) -> Result<Self, PipelineError> {
        Ok(Self {
            stages,
            reference: ReferenceFrame::from_frames(references).map_err(PipelineError::Sensor)?,
            workspace: ForceWorkspace::default(),
            contact: FrameContact::default(),
            last: Array2::default((0, 0)),
            measured: false,
            frames: 0,
            loads: Vec::with_capacity(SESSION_LOADS + 1),
            report: Report::default(),
        })
    }

    /// Measures the next frame. A contact that is whole, unsaturated and inside the calibration refines the modulus.
    ///
    /// # Errors
    /// [`PipelineError::Contact`]; the session can go on with the next frame.
    pub fn push(&mut self, frame: ArrayView2<'_, u8>) -> Result<Update, PipelineError> {
        let number = self.frames;
        self.frames += 1;
        let skip = self.stages.settings().skips.equal_frames;
        if skip && self.measured && self.last == frame {
            self.report.count_skip(Stage::Contact, SkipReason::EqualFrame, frame.len());
            return Ok(Update { frame: number, contact: self.contact.reading, repeated: true });
        }
        let start = Instant::now();
        self.measured = false;
        resize(&mut self.last, frame.dim());
        self.last.assign(&frame);
        self.stages
            .contact()
            .measure(&mut self.workspace, frame, &self.reference, None, &mut self.contact)
            .map_err(|source| PipelineError::Contact { frame: number as usize, source })?;
        self.measured = true;
        self.report.ran(Stage::Contact, start.elapsed());
        let contact = self.contact.reading;
        match contact {
            None => self.report.count_skip(Stage::Surface, SkipReason::NoContact, frame.len()),
            Some(reading) => self.learn(&reading),
        }
        Ok(Update { frame: number, contact, repeated: false })
    }

    /// Young's modulus from all loads so far, by the estimator that fits the object best. Objects whose modulus needs
    /// strain need two whole frames: give them to a [`Press`](super::Press).
    ///
    /// # Errors
    /// [`PipelineError::Modulus`].
    pub fn modulus(&mut self) -> Result<ModulusEstimate<f64>, PipelineError> {
        let start = Instant::now();
        let settings = self.stages.settings();
        let size = self.stages.contact().pixel_size_m();
        let readings = self.loads.iter().map(|load| load.reading(size));
        let (loads, shared) = split_errors(readings, settings);
        let estimate = best_estimate(&settings.object, settings.waveguide.as_ref(), &loads, shared);
        self.report.ran(Stage::Modulus, start.elapsed());
        estimate.map_err(PipelineError::Modulus)
    }

    /// Frames seen so far.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Loads kept apart so far, at most [`SESSION_LOADS`].
    pub fn loads(&self) -> usize {
        self.loads.len()
    }

    /// What ran and what was skipped so far; skips of one kind are added up.
    pub fn report(&self) -> &Report {
        &self.report
    }

    fn learn(&mut self, reading: &ContactReading) {
        let whole = !reading.touches_edge && !reading.out_of_calibration && reading.converged;
        let trusted = whole && reading.saturated_share == 0.0;
        let Some(load) = MergedLoad::of(reading).filter(|l| trusted && l.force_n > 0.0) else { return };
        let at = self.loads.partition_point(|l| l.force_n < load.force_n);
        self.loads.insert(at, load);
        if self.loads.len() > SESSION_LOADS {
            // The neighbours that are closest by ratio become one.
            let gap = |i: usize| self.loads[i + 1].force_n / self.loads[i].force_n;
            let closest = (0..SESSION_LOADS).min_by(|&i, &j| gap(i).total_cmp(&gap(j))).unwrap_or(0);
            self.loads[closest] = self.loads[closest].merged(self.loads[closest + 1]);
            self.loads.remove(closest + 1);
        }
    }
}
