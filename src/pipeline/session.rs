//! A session: one sensor, one object, a stream of frames.
//!
//! The first frames without contact make the reference; then every frame gives its contact and force, and every contact
//! refines the modulus. Shear is followed where its stiffnesses are known, drift of the light watched in frames without
//! contact. Memory is constant: similar loads are merged. [`Session::push`] allocates nothing once its buffers have their
//! size.
use super::contact::{ContactReading, FrameContact, resize};
use super::error::PipelineError;
use super::flag::Flag;
use super::loads::SeenLoads;
use super::object::{best_estimate, split_errors};
use super::report::{Report, SkipReason, Stage};
use super::shear::ShearFollower;
use super::stages::{Stages, reference_frame};
use crate::elasticity::modulus::ModulusEstimate;
use crate::force::{ForceWorkspace, ReferenceFrame, ShearCalibration, ShearMeasurement};
use ndarray::{Array2, ArrayView2};
use std::sync::Arc;
use std::time::Instant;

/// Grey levels by which frames without contact may differ from the reference in the mean before a session speaks of drift:
/// half the camera's step.
pub const DRIFT_LIMIT_GREY: f64 = 0.5;

/// What one frame of a stream says.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Update {
    /// Number of the frame, counted from 0.
    pub frame: u64,
    /// The contact; `None` where nothing touches.
    pub contact: Option<ContactReading>,
    /// The frame equals the one before it, bit for bit, and was not measured again.
    pub repeated: bool,
    /// Shear since contact began, where the session knows the stiffnesses.
    pub shear: Option<ShearMeasurement<f64>>,
}

/// What frames without contact say of the light since the reference was taken, in grey levels: the mean of frame minus
/// reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct DriftWatch {
    /// Frames without contact so far.
    pub frames: u64,
    /// In the last of them.
    pub last_grey: f64,
    /// The greatest so far, with its sign.
    pub greatest_grey: f64,
}

impl DriftWatch {
    fn watch(&mut self, grey: f64) {
        self.frames += 1;
        self.last_grey = grey;
        if grey.abs() > self.greatest_grey.abs() {
            self.greatest_grey = grey;
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
    loads: SeenLoads,
    shear: Option<ShearFollower>,
    drift: DriftWatch,
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
            reference: reference_frame(stages.as_ref(), references)?,
            stages,
            workspace: ForceWorkspace::default(),
            contact: FrameContact::default(),
            last: Array2::default((0, 0)),
            measured: false,
            frames: 0,
            loads: SeenLoads::new(),
            shear: None,
            drift: DriftWatch::default(),
            report: Report::default(),
        })
    }

    /// Follows shear too: F_x = K_x u_x, F_y = K_y u_y, u the way of the centroid since contact began.
    #[must_use]
    pub fn with_shear(mut self, calibration: ShearCalibration<f64>) -> Self {
        self.shear = Some(ShearFollower::new(calibration));
        self
    }

    /// Measures the next frame. A contact that is alone, whole, unsaturated and inside the calibration refines the modulus;
    /// a frame without contact is watched for drift of the light.
    ///
    /// # Errors
    /// [`PipelineError::Contact`]; the session can go on with the next frame.
    pub fn push(&mut self, frame: ArrayView2<'_, u8>) -> Result<Update, PipelineError> {
        let number = self.frames;
        self.frames += 1;
        let skip = self.stages.settings().skips.equal_frames;
        let repeated = skip && self.measured && self.last == frame;
        if repeated {
            self.report.count_skip(Stage::Contact, SkipReason::EqualFrame, frame.len());
        } else {
            self.measure(number, frame)?;
        }
        let contact = self.contact.reading;
        let size = self.stages.contact().pixel_size_m();
        let shear = self.shear.as_mut().and_then(|follower| follower.update(contact.as_ref(), size));
        Ok(Update { frame: number, contact, repeated, shear })
    }

    fn measure(&mut self, number: u64, frame: ArrayView2<'_, u8>) -> Result<(), PipelineError> {
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
        match self.contact.reading {
            None => self.report.count_skip(Stage::Surface, SkipReason::NoContact, frame.len()),
            Some(reading) => self.loads.learn(&reading),
        }
        if let Some(grey) = self.contact.background_step_grey {
            self.drift.watch(grey);
        }
        Ok(())
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
        let (loads, shared) = split_errors(self.loads.readings(size), settings);
        let estimate = best_estimate(&settings.object, settings.waveguide.as_ref(), &loads, shared);
        self.report.ran(Stage::Modulus, start.elapsed());
        estimate.map_err(PipelineError::Modulus)
    }

    /// Frames seen so far.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Loads kept apart so far, at most [`SESSION_LOADS`](super::SESSION_LOADS).
    pub fn loads(&self) -> usize {
        self.loads.len()
    }

    /// What frames without contact say of the light.
    pub fn drift(&self) -> DriftWatch {
        self.drift
    }

    /// A caution if the light has drifted by more than [`DRIFT_LIMIT_GREY`] when the sensor was last free: the reference
    /// should be taken anew, or the contact stage told to correct drift.
    pub fn drift_flag(&self) -> Option<Flag> {
        let grey = self.drift.last_grey;
        (grey.abs() > DRIFT_LIMIT_GREY).then_some(Flag::LightDrifted { grey })
    }

    /// What ran and what was skipped so far; skips of one kind are added up.
    pub fn report(&self) -> &Report {
        &self.report
    }
}
