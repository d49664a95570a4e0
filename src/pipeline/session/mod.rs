//! A session: one sensor, one object, a stream of frames.
//!
//! The first frames without contact make the reference; then every frame gives its contact and force, and every contact
//! refines the modulus. Shear is followed where its stiffnesses are known, drift of the light watched in frames without
//! contact. Strain is followed for who asks ([`Session::strain`]), from the load where that began: its surface, points and
//! spline are kept, and each match begins where the last one ended. Memory is constant: similar loads are merged.
//! [`Session::push`] and, with the default stages, [`Session::strain`] allocate nothing once their buffers have their size.
mod drift;
mod health;
mod loads;
mod results;
mod strain;
mod update;

use super::composition::Pipeline;
use super::contact::{ContactReading, FrameContact, resize};
use super::error::PipelineError;
use super::face;
use super::report::{Report, SkipReason, Stage};
use super::runner::{SkipRecords, StageRunner};
use super::same_image::is_same_image;
use crate::force::{HealthOptions, HealthReport, ShearCalibration, ShearTracker};
pub use drift::DriftWatch;
use health::SensorHealth;
use loads::{MOST_LOADS, SeenLoads};
use ndarray::{Array2, ArrayView2};
use std::sync::Arc;
use strain::FollowedStrain;
pub use strain::SessionStrain;
pub use update::Update;

/// Follows a stream of frames from one sensor pressed on one object. `Send`: one session a thread.
///
/// ```
/// use std::sync::Arc;
/// use tactile_imaging::pipeline::Session;
/// use tactile_simulate::Trial;
/// use tactile_simulate::{CalibrationRun, Camera, PressOptions};
/// let camera = Camera::default().coarser(8);
/// let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
/// let mut session = Session::new(&trial.pipeline()?, &[trial.simulation.reference.view()])?;
/// for frame in &trial.simulation.frames {
///     assert!(session.push(frame.view())?.contact.is_some());
/// }
/// let modulus = session.modulus()?;
/// assert!((modulus.youngs_modulus_pa / 103e3 - 1.0).abs() < 0.0538);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Session {
    runner: StageRunner,
    contact: FrameContact,
    last: Array2<u8>,
    /// Whether `contact` is that of `last`, and which frame that was.
    measured: bool,
    measured_frame: u64,
    frames: u64,
    loads: SeenLoads,
    shear: Option<ShearTracker>,
    strain: FollowedStrain,
    /// The first contact that a flat face's loads are compared with.
    first_contact: Option<ContactReading>,
    drift: DriftWatch,
    health: SensorHealth,
}

impl Session {
    /// Loads that a session keeps apart; more are merged.
    pub const MOST_LOADS: usize = MOST_LOADS;

    /// A session whose reference is the mean of one or more frames without contact; of more, the noise is measured too.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tactile_imaging::pipeline::{Object, Pipeline, Session};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let empty = hertz(0.0);
    /// let mut session = Session::new(&pipeline, &[empty.view(), empty.view(), empty.view()])?;
    /// let force = session.push(hertz(60.0).view())?.contact.and_then(|c| c.force_n).expect("a force");
    /// assert!((force.value / 0.503 - 1.0).abs() < 0.01);
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::Sensor`] for no frames, or frames that differ in size.
    pub fn new(
        pipeline: &Pipeline,
        references: &[ArrayView2<'_, u8>],
    ) -> Result<Self, PipelineError> {
        let reference = Arc::new(pipeline.reference_frame(references)?);
        Ok(Self {
            runner: StageRunner::new(pipeline.clone(), reference, SkipRecords::Summed),
            contact: FrameContact::default(),
            last: Array2::default((0, 0)),
            measured: false,
            measured_frame: 0,
            frames: 0,
            loads: SeenLoads::new(),
            shear: None,
            strain: FollowedStrain::default(),
            first_contact: None,
            drift: DriftWatch::default(),
            health: SensorHealth::new(HealthOptions::default()),
        })
    }

    /// Follows shear too: F_x = K_x u_x, F_y = K_y u_y, u the way of the centroid since contact began.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use std::sync::Arc;
    /// use tactile_imaging::force::{Estimate, ShearCalibration};
    /// use tactile_imaging::pipeline::{Object, Pipeline, Session};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// // A contact that slides along x by two pixels of 50 µm, held by 400 N/m.
    /// let press = |x: f64| Array2::from_shape_fn((64, 64), |(r, c)| {
    ///     let d = ((r as f64 - 32.0).hypot(c as f64 - x) / 20.0).min(1.0);
    ///     10 + (120.0 * (1.0 - d * d).sqrt()).round() as u8
    /// });
    /// let stiffness_n_per_m = [Estimate::new(400.0, 4.0); 2];
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let mut session = Session::new(&pipeline, &[Array2::from_elem((64, 64), 10).view()])?
    ///     .with_shear(ShearCalibration { stiffness_n_per_m, residual_sd_n: [0.0; 2] });
    /// session.push(press(32.0).view())?;
    /// let shear = session.push(press(34.0).view())?.shear.expect("stiffnesses are known");
    /// assert!((shear.force_n[0].value - 0.04).abs() < 1e-3 && shear.force_n[1].value.abs() < 1e-3);
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    #[must_use]
    pub fn with_shear(mut self, calibration: ShearCalibration) -> Self {
        self.shear = Some(ShearTracker::new(calibration));
        self
    }

    /// Sets what counts as a change of the sensor; [`health`](Self::health) starts anew. The default is a change of the brightness by 2 %
    /// or of the noise by 20 %.
    ///
    /// ```
    /// use tactile_imaging::force::{ChartState, HealthOptions};
    /// use tactile_imaging::pipeline::{Object, Pipeline, Session};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let frame = |k: usize, grey: usize| ndarray::Array2::from_shape_fn((96, 96), |(r, c)| {
    ///     (grey + (7 * r + 13 * c + 5 * k) % 4) as u8
    /// });
    /// let options = HealthOptions::default().with_baseline_frames(50)?;
    /// let mut session = Session::new(&pipeline, &[frame(0, 40).view()])?.with_health(options);
    /// for k in 0..60 {
    ///     session.push(frame(k, 40).view())?;
    /// }
    /// assert_eq!(session.health().map(|h| h.brightness), Some(ChartState::Healthy));
    /// // The light rises by a fortieth.
    /// for k in 60..110 {
    ///     session.push(frame(k, 41).view())?;
    /// }
    /// assert_eq!(session.health().map(|h| h.brightness), Some(ChartState::Changed));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_health(mut self, options: HealthOptions) -> Self {
        self.health = SensorHealth::new(options);
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
        let skip = self.runner.pipeline().settings().skips.equal_frames;
        let repeated = skip && self.measured && is_same_image(self.last.view(), frame);
        if repeated {
            self.runner.skip(
                Stage::Contact,
                number as usize,
                SkipReason::EqualFrame,
                frame.len(),
            );
        } else {
            self.measure(number, frame)?;
        }
        let contact = self.contact.reading;
        let size = self.runner.pipeline().contact().pixel_size_m();
        let centroid = contact.map(|c| std::array::from_fn(|k| c.centroid_px[k] * size[k]));
        let shear = self
            .shear
            .as_mut()
            .and_then(|tracker| tracker.update(centroid));
        Ok(Update {
            frame: number,
            contact,
            repeated,
            shear,
        })
    }

    fn measure(&mut self, number: u64, frame: ArrayView2<'_, u8>) -> Result<(), PipelineError> {
        self.measured = false;
        resize(&mut self.last, frame.dim());
        match (self.last.as_slice_mut(), frame.as_slice()) {
            (Some(to), Some(from)) => to.copy_from_slice(from),
            _ => self.last.assign(&frame),
        }
        self.runner
            .contact(number as usize, frame, None, &mut self.contact)?;
        self.measured = true;
        self.measured_frame = number;
        if let Some(reading) = &self.contact.reading {
            let object = self.runner.pipeline().settings().object;
            let flat = object.flat_face().is_some();
            if !flat || self.check_face(reading).is_ok() {
                self.first_contact.get_or_insert(*reading);
                self.loads.learn(reading, None);
            }
        }
        if let Some(grey) = self.contact.background_step_grey {
            self.drift.watch(grey);
        }
        let condition = self.runner.condition();
        self.health.watch(number, frame, condition);
        Ok(())
    }

    /// Refuses a contact that is not that of one flat face, the same as in the first frame.
    fn check_face(&self, contact: &ContactReading) -> Result<(), PipelineError> {
        let object = self.runner.pipeline().settings().object;
        let both = self.first_contact.iter().chain([contact]);
        face::check(
            both.map(|contact| (self.measured_frame as usize, contact)),
            object,
        )
    }

    /// Frames seen so far.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Loads kept apart so far, at most [`MOST_LOADS`](Self::MOST_LOADS).
    ///
    /// ```
    /// # use std::sync::Arc;
    /// # use tactile_imaging::pipeline::{Object, Pipeline, Session};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// # let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let mut session = Session::new(&pipeline, &[hertz(0.0).view()])?;
    /// for peak in [120.0, 60.0, 120.0] {
    ///     session.push(hertz(peak).view())?;
    ///     session.push(hertz(0.0).view())?;
    /// }
    /// assert_eq!((session.frames(), session.loads()), (6, 3), "frames without contact are no load");
    /// for k in 0..40 {
    ///     session.push(hertz(100.0 + f64::from(k)).view())?;
    /// }
    /// assert_eq!(session.loads(), Session::MOST_LOADS, "forty forces, the closest merged");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn loads(&self) -> usize {
        self.loads.len()
    }

    /// What frames without contact say of the light.
    ///
    /// ```
    /// use tactile_imaging::pipeline::Flag;
    /// # use std::sync::Arc;
    /// # use tactile_imaging::pipeline::{Object, Pipeline, Session};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// # let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let mut session = Session::new(&pipeline, &[hertz(0.0).view()])?;
    /// session.push(hertz(0.0).mapv(|v| v - 2).view())?;
    /// session.push(hertz(120.0).view())?;
    /// let drift = session.drift();
    /// assert_eq!((drift.frames, drift.last_grey), (1, -2.0), "contacts say nothing of the light");
    /// assert_eq!(drift.caution, Some(Flag::LightDrifted { grey: -2.0 }));
    /// session.push(hertz(0.0).view())?;
    /// assert_eq!(session.drift().caution, None, "the light is back");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn drift(&self) -> &DriftWatch {
        &self.drift
    }

    /// Gain and noise of the sensor as its background shows them, contacts or not, against the session's first frames
    /// ([`HealthOptions::with_baseline_frames`]); `None` before a frame, and where the contact stage does not look at the background.
    pub fn health(&self) -> Option<HealthReport> {
        self.health.report()
    }

    /// Pixels (row, column) that have kept one grey level while their neighbours changed; every 64th frame is looked at, and none is
    /// named before sixteen looks. O(pixels).
    ///
    /// ```
    /// use tactile_imaging::pipeline::{Object, Pipeline, Session};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let frame = |k: usize| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    ///     if (r, c) == (12, 30) { 44 } else { (40 + (7 * r + 13 * c + k / 64) % 4) as u8 }
    /// });
    /// let mut session = Session::new(&pipeline, &[frame(0).view()])?;
    /// for k in 0..1024 {
    ///     session.push(frame(k).view())?;
    /// }
    /// assert_eq!(session.stuck_pixels(), [(12, 30)]);
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn stuck_pixels(&self) -> Vec<(usize, usize)> {
        self.health.stuck_pixels()
    }

    /// What ran and what was skipped so far; skips of one kind are added up.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tactile_imaging::pipeline::{Object, Pipeline, Session, SkipReason, Stage};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let mut session = Session::new(&pipeline, &[hertz(0.0).view()])?;
    /// for peak in [0.0, 120.0, 120.0, 120.0] {
    ///     session.push(hertz(peak).view())?;
    /// }
    /// let report = session.report();
    /// assert_eq!(report.work(Stage::Contact).runs, 2);
    /// let equal = report.skips.iter().find(|s| s.reason == SkipReason::EqualFrame).expect("two equal frames");
    /// assert_eq!(equal.saved, 2 * 64 * 64, "pixels of both");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn report(&self) -> &Report {
        self.runner.report()
    }
}
