//! A session: one sensor, one object, a stream of frames.
//!
//! The first frames without contact make the reference. Then each frame gives its contact and
//! force, and each contact refines the modulus. Shear is followed if the stiffnesses are known, and
//! drift of the light is monitored in frames without contact. Strain is followed on request
//! ([`Session::strain`]), from the load of the first request. The surface, points and spline of
//! that load are kept, and each match starts from the last result. Memory is constant, because
//! similar loads are merged. [`Session::push`] and, with the default stages, [`Session::strain`]
//! allocate nothing once their buffers have grown.
use super::contact::{ContactReading, FrameContact, resize};
use super::error::PipelineError;
use super::flag::Flag;
use super::loads::{self, Load, MOST_LOADS, SeenLoads};
use super::pipeline::Pipeline;
use super::report::{Report, SkipReason, Stage};
use super::specimen::{FlatSpecimen, Specimen};
use super::stages::{MatchedPoints, Scratch, Stages};
use super::strain::PairStrain;
use super::surface::{ContactSurface, ControlPoints};
use crate::elasticity::modulus::ModulusEstimate;
use crate::force::{ShearCalibration, ShearMeasurement, ShearTracker};
use crate::matching::{MatchReport, MatchedPairs, WarmStart};
use ndarray::{Array2, ArrayView2};
use std::sync::Arc;

/// The results of one frame of a stream.
///
/// ```
/// use tactile_imaging::pipeline::{Session, Update};
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// let mut session = Session::new(&trial.pipeline()?, &[trial.simulation.reference.view()])?;
/// let first: Update = session.push(trial.simulation.frames[1].view())?;
/// assert_eq!((first.frame, first.shear), (0, None), "the stiffnesses are not known");
/// assert!(first.to_string().starts_with("frame 0: force 1."));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Update {
    /// Number of the frame, counted from 0.
    pub frame: u64,
    /// The contact. `None` without contact.
    pub contact: Option<ContactReading>,
    /// Shear since contact began. `None` if the session has no shear stiffnesses.
    pub shear: Option<ShearMeasurement>,
}

/// Drift of the light since the reference was taken, measured in frames without contact, in grey
/// levels: the mean of frame minus reference.
///
/// ```
/// use tactile_imaging::pipeline::{DriftWatch, Flag, Object, Pipeline, Session};
/// use tactile_imaging::force::CalibrationPair;
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let empty = ndarray::Array2::from_elem((64, 64), 10_u8);
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// let mut session = Session::new(&pipeline, &[empty.view()])?;
/// // The light fades by two grey levels and recovers by one.
/// for loss in [0, 2, 1] {
///     session.push(empty.mapv(|v| v - loss).view())?;
/// }
/// let drift: &DriftWatch = session.drift();
/// assert_eq!((drift.frames, drift.last_grey, drift.greatest_grey), (3, -1.0, -2.0));
/// assert_eq!(drift.caution, Some(Flag::LightDrifted { grey: -1.0 }));
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct DriftWatch {
    /// Number of frames without contact so far.
    pub frames: u64,
    /// Drift in the last of them.
    pub last_grey: f64,
    /// The largest drift so far, with its sign.
    pub greatest_grey: f64,
    /// Set if the light had drifted by more than half a grey level when the sensor was last free.
    /// Take a new reference, or let the contact stage correct drift.
    pub caution: Option<Flag>,
}

impl DriftWatch {
    /// Drift above which a new reference should be taken.
    const LIMIT_GREY: f64 = 0.5;

    fn watch(&mut self, grey: f64) {
        self.frames += 1;
        self.last_grey = grey;
        self.caution = (grey.abs() > Self::LIMIT_GREY).then_some(Flag::LightDrifted { grey });
        if grey.abs() > self.greatest_grey.abs() {
            self.greatest_grey = grey;
        }
    }
}

/// Follows a stream of frames from one sensor pressed against one object. It is `Send`: use one
/// session per thread.
///
/// ```
/// use tactile_imaging::pipeline::Session;
/// use tactile_simulate::Trial;
/// use tactile_simulate::{CalibrationRun, Camera, PressOptions};
/// let camera = Camera::default().coarser(8);
/// let trial = Trial::new(
///     PressOptions {
///         camera,
///         ..PressOptions::default()
///     },
///     &CalibrationRun::default(),
/// )?;
/// let mut session = Session::new(&trial.pipeline()?, &[trial.simulation.reference.view()])?;
/// for frame in &trial.simulation.frames {
///     assert!(session.push(frame.view())?.contact.is_some());
/// }
/// let modulus = session.modulus()?;
/// assert!((modulus.youngs_modulus_pa / 103e3 - 1.0).abs() < 0.0538);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Session {
    stages: Stages,
    scratch: Scratch,
    contact: FrameContact,
    last: Array2<u8>,
    /// Whether `contact` belongs to the frame `last`, and the number of that frame.
    measured: bool,
    measured_frame: u64,
    frames: u64,
    loads: SeenLoads,
    shear: Option<ShearTracker>,
    strain: FollowedStrain,
    /// The first contact, with which the loads of a flat face are compared.
    first_contact: Option<ContactReading>,
    drift: DriftWatch,
    /// The largest force since the last frame without contact.
    greatest_n: f64,
    /// The last requested surface.
    surface: ContactSurface,
}

impl Session {
    /// Number of loads that a session keeps separate. Further loads are merged.
    pub const MOST_LOADS: usize = MOST_LOADS;

    /// Starts a session whose reference is the mean of one or more frames without contact. From two
    /// frames on, their noise is measured too.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{Object, Pipeline, Session};
    /// use tactile_imaging::force::CalibrationPair;
    /// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    ///     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    ///     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let empty = hertz(0.0);
    /// let mut session = Session::new(&pipeline, &[empty.view(), empty.view(), empty.view()])?;
    /// let force = session
    ///     .push(hertz(60.0).view())?
    ///     .contact
    ///     .and_then(|c| c.force_n)
    ///     .expect("a force");
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
            stages: Stages::new(pipeline.clone(), reference),
            scratch: Scratch::default(),
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
            greatest_n: 0.0,
            surface: ContactSurface::default(),
        })
    }

    /// Also follows shear: F_x = K_x u_x, F_y = K_y u_y, where u is the displacement of the
    /// centroid since contact began.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_imaging::force::CalibrationPair;
    /// use tactile_imaging::force::{Estimate, ShearCalibration};
    /// use tactile_imaging::pipeline::{Object, Pipeline, Session};
    /// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// // A contact that slides along x by two pixels of 50 µm, held by 400 N/m.
    /// let press = |x: f64| {
    ///     Array2::from_shape_fn((64, 64), |(r, c)| {
    ///         let d = ((r as f64 - 32.0).hypot(c as f64 - x) / 20.0).min(1.0);
    ///         10 + (120.0 * (1.0 - d * d).sqrt()).round() as u8
    ///     })
    /// };
    /// let stiffness_n_per_m = [Estimate::new(400.0, 4.0); 2];
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let mut session = Session::new(&pipeline, &[Array2::from_elem((64, 64), 10).view()])?
    ///     .with_shear(ShearCalibration::new(stiffness_n_per_m));
    /// session.push(press(32.0).view())?;
    /// let shear = session.push(press(34.0).view())?.shear.expect("stiffnesses are known");
    /// assert!(
    ///     (shear.force_n[0].value - 0.04).abs() < 1e-3 && shear.force_n[1].value.abs() < 1e-3
    /// );
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    #[must_use]
    pub fn with_shear(mut self, calibration: ShearCalibration) -> Self {
        self.shear = Some(ShearTracker::new(calibration));
        self
    }

    /// Measures the next frame. A complete contact within the calibration refines the modulus. A
    /// frame without contact updates the drift of the light.
    ///
    /// # Errors
    /// [`PipelineError::Contact`]. The session can continue with the next frame.
    pub fn push(&mut self, frame: ArrayView2<'_, u8>) -> Result<Update, PipelineError> {
        let number = self.frames;
        self.frames += 1;
        self.measure(number, frame)?;
        let contact = self.contact.reading;
        let size = self.stages.pipeline.contact().pixel_size_m();
        let centroid = contact.map(|c| std::array::from_fn(|k| c.centroid_px[k] * size[k]));
        let shear = self
            .shear
            .as_mut()
            .and_then(|tracker| tracker.update(centroid));
        Ok(Update {
            frame: number,
            contact,
            shear,
        })
    }

    fn measure(&mut self, number: u64, frame: ArrayView2<'_, u8>) -> Result<(), PipelineError> {
        self.measured = false;
        resize(&mut self.last, frame.dim());
        self.last.assign(&frame);
        let before = self.contact.reading;
        let (scratch, contact) = (&mut self.scratch, &mut self.contact);
        self.stages
            .contact(scratch, number as usize, frame, None, contact)?;
        self.greatest_n = self.stages.with_hysteresis(self.greatest_n, contact);
        self.measured = true;
        self.measured_frame = number;
        // Noise changes the readings, so equal readings come from the same image. Counting them
        // twice would add no information.
        if let Some(reading) = self.contact.reading
            && before != Some(reading)
        {
            let usable = match self.stages.specimen {
                Specimen::Curved => true,
                Specimen::Flat(flat) => self.check_face(flat, &reading).is_ok(),
            };
            if usable {
                self.first_contact.get_or_insert(reading);
                self.loads.learn(&reading, None);
            }
        }
        if self.contact.reading.is_none()
            && let Some(grey) = self.contact.background_step_grey
            && !self.stages.is_black(grey)
        {
            self.drift.watch(grey);
        }
        Ok(())
    }

    /// The cautions about the last frame. Empty before the first frame and after a frame that could
    /// not be measured.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{Flag, Session};
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let frames = [&trial.simulation.reference, &trial.simulation.frames[0]];
    /// // The camera sees the right half of the contact.
    /// let [reference, frame] = frames.map(|image| image.slice(ndarray::s![.., 87..]));
    /// let mut session = Session::new(&trial.pipeline()?, &[reference])?;
    /// session.push(frame)?;
    /// assert!(session.cautions().contains(&Flag::TouchesEdge { frame: 0 }));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn cautions(&self) -> Vec<Flag> {
        if !self.measured {
            return Vec::new();
        }
        let frame = self.measured_frame as usize;
        self.stages
            .cautions(frame, self.last.view(), &self.contact, None)
    }

    /// The cautions about all frames: about the calibration, and the change of the light since.
    pub fn standing_cautions(&self) -> Vec<Flag> {
        self.stages.standing_cautions().collect()
    }

    /// Rejects a contact that is not that of one flat face, the same as in the first frame.
    fn check_face(
        &self,
        flat: FlatSpecimen,
        contact: &ContactReading,
    ) -> Result<(), PipelineError> {
        let both = self.first_contact.iter().chain([contact]);
        flat.check(both.map(|contact| (self.measured_frame as usize, contact)))
    }

    /// Frames seen so far.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Number of separate loads so far, at most [`MOST_LOADS`](Self::MOST_LOADS).
    ///
    /// ```
    /// use tactile_imaging::pipeline::{Object, Pipeline, Session};
    /// use tactile_imaging::force::CalibrationPair;
    /// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    ///     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    ///     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let mut session = Session::new(&pipeline, &[hertz(0.0).view()])?;
    /// for peak in [120.0, 60.0, 120.0] {
    ///     session.push(hertz(peak).view())?;
    ///     session.push(hertz(0.0).view())?;
    /// }
    /// assert_eq!(
    ///     (session.frames(), session.loads()),
    ///     (6, 2),
    ///     "frames without contact and repeated images are not loads"
    /// );
    /// for k in 0..40 {
    ///     session.push(hertz(100.0 + f64::from(k)).view())?;
    /// }
    /// assert_eq!(session.loads(), Session::MOST_LOADS, "forty forces, the closest merged");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn loads(&self) -> usize {
        self.loads.len()
    }

    /// Drift of the light in frames without contact.
    ///
    /// ```
    /// use tactile_imaging::pipeline::Flag;
    /// use tactile_imaging::pipeline::{Object, Pipeline, Session};
    /// use tactile_imaging::force::CalibrationPair;
    /// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    ///     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    ///     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let mut session = Session::new(&pipeline, &[hertz(0.0).view()])?;
    /// session.push(hertz(0.0).mapv(|v| v - 2).view())?;
    /// session.push(hertz(120.0).view())?;
    /// let drift = session.drift();
    /// assert_eq!((drift.frames, drift.last_grey), (1, -2.0), "contacts give no light level");
    /// assert_eq!(drift.caution, Some(Flag::LightDrifted { grey: -2.0 }));
    /// session.push(hertz(0.0).view())?;
    /// assert_eq!(session.drift().caution, None, "the light is as before");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn drift(&self) -> &DriftWatch {
        &self.drift
    }

    /// The stages that ran so far and those that were skipped.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{Session, SkipReason, Stage};
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let (reference, frames) = (&trial.simulation.reference, &trial.simulation.frames);
    /// let mut session = Session::new(&trial.pipeline()?, &[reference.view()])?;
    /// for frame in [reference, &frames[0], &frames[1]] {
    ///     session.push(frame.view())?;
    /// }
    /// let report = session.report();
    /// assert_eq!(report.work(Stage::Contact).runs, 3);
    /// assert_eq!((report.skips[0].reason, report.skips[0].frames), (SkipReason::NoContact, 1));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn report(&self) -> &Report {
        &self.scratch.report
    }

    /// The surface of the last frame's contact, on a grid that suits its size. Each call computes
    /// it again, reusing memory.
    ///
    /// ```
    /// use tactile_imaging::pipeline::Session;
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let mut session = Session::new(&trial.pipeline()?, &[trial.simulation.reference.view()])?;
    /// session.push(trial.simulation.frames[0].view())?;
    /// let heights = &session.surface()?.surface.heights;
    /// let top = heights.iter().copied().filter(|h| h.is_finite()).fold(0.0, f64::max);
    /// // Hertz's pressure interpreted as shading is a hemisphere of the contact's radius.
    /// let radius = trial.simulation.truth[0].contact.contact_radius_m;
    /// assert!((top / radius - 1.0).abs() < 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoContact`] without contact, [`PipelineError::Surface`].
    pub fn surface(&mut self) -> Result<&ContactSurface, PipelineError> {
        self.last_reading()?;
        self.stages.surface(
            &mut self.scratch,
            self.measured_frame as usize,
            self.last.view(),
            &self.contact,
            self.contact.pixels(),
            &mut self.surface,
        )?;
        Ok(&self.surface)
    }

    /// The last frame's contact. Without contact it is an error.
    fn last_reading(&self) -> Result<ContactReading, PipelineError> {
        let reading = self.contact.reading.filter(|_| self.measured);
        reading.ok_or(PipelineError::NoContact {
            frame: self.frames.saturating_sub(1) as usize,
        })
    }

    /// Strain of the last frame relative to the load of the first request. For that load itself the
    /// result is `None`.
    ///
    /// The first call makes the load of its frame the origin of strain, until
    /// [`restart_strain`](Self::restart_strain) is called. A call costs the surface, control
    /// points, match and strain of one frame. A repeated call without a new frame costs nothing.
    ///
    /// ```
    /// use tactile_imaging::pipeline::Session;
    /// use tactile_simulate::Trial;
    /// use tactile_simulate::{Camera, CalibrationRun, PressLoad, PressOptions};
    /// let camera = Camera::default().coarser(4);
    /// let loads = [0.7, 1.0, 1.2].map(PressLoad::normal).to_vec();
    /// let trial = Trial::new(
    ///     PressOptions {
    ///         camera,
    ///         loads,
    ///         ..PressOptions::default()
    ///     },
    ///     &CalibrationRun::default(),
    /// )?;
    /// let mut session = Session::new(&trial.pipeline()?, &[trial.simulation.reference.view()])?;
    /// let mut across = Vec::new();
    /// for frame in &trial.simulation.frames {
    ///     session.push(frame.view())?;
    ///     across.extend(session.strain()?.map(|found| found.strain.summary.mean[(0, 0)]));
    /// }
    /// // From 0.7 N on, the surface of a ball grows with the cube root of the load.
    /// let truth = |force: f64| 0.5 * ((force / 0.7_f64).powf(2.0 / 3.0) - 1.0);
    /// assert_eq!(across.len(), 2);
    /// assert!((across[0] - truth(1.0)).abs() < 0.02 && (across[1] - truth(1.2)).abs() < 0.02);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoContact`] without contact, and the errors of the strain of a
    /// [`Press`](crate::pipeline::Press).
    pub fn strain(&mut self) -> Result<Option<&SessionStrain>, PipelineError> {
        let frame = Frame {
            reading: self.last_reading()?,
            number: self.measured_frame,
            image: self.last.view(),
            contact: &self.contact,
        };
        self.strain.follow(&self.stages, &mut self.scratch, &frame)
    }

    /// Makes the load of the next call of [`strain`](Self::strain) the new origin of strain.
    ///
    /// ```
    /// use tactile_imaging::pipeline::Session;
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let mut session = Session::new(&trial.pipeline()?, &[trial.simulation.reference.view()])?;
    /// session.push(trial.simulation.frames[0].view())?;
    /// assert!(session.strain()?.is_none());
    /// session.push(trial.simulation.frames[1].view())?;
    /// session.restart_strain();
    /// assert!(session.strain()?.is_none(), "strain is now counted from this frame");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn restart_strain(&mut self) {
        self.strain = FollowedStrain::default();
    }

    /// Young's modulus from all loads so far, by the estimator of the pipeline. If the estimator
    /// needs strain, only loads with a requested [`strain`](Self::strain) are used; for a flat face
    /// all are.
    ///
    /// # Errors
    /// [`PipelineError::Modulus`], and [`PipelineError::NotUniaxial`] if the last contact is not
    /// that of a flat face.
    pub fn modulus(&mut self) -> Result<ModulusEstimate, PipelineError> {
        let pipeline = &self.stages.pipeline;
        let estimator = pipeline.estimator()?;
        let (bodies, size) = (
            Arc::clone(pipeline.bodies()),
            pipeline.contact().pixel_size_m(),
        );
        let loads = match self.stages.specimen {
            Specimen::Curved if estimator.needs_strain() => {
                loads::series(self.strain.loads(), bodies, size)
            }
            Specimen::Flat(flat) if estimator.needs_strain() => {
                if let Some(contact) = &self.contact.reading {
                    self.check_face(flat, contact)?;
                }
                let series = loads::series(self.loads.loads(), bodies, size);
                flat.strained(&series, pipeline.strain())?
            }
            _ => loads::series(self.loads.loads(), bodies, size),
        };
        self.stages
            .modulus(&mut self.scratch, estimator.as_ref(), &loads)
    }
}

/// Strain of one frame of a stream.
///
/// ```
/// use tactile_imaging::pipeline::Session;
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// let mut session = Session::new(&trial.pipeline()?, &[trial.simulation.reference.view()])?;
/// for frame in &trial.simulation.frames {
///     session.push(frame.view())?;
///     if let Some(found) = session.strain()? {
///         assert_eq!((found.from, found.to), (0, 1));
///         assert!(found.strain.summary.mean[(0, 0)] > 0.0, "the load increased: the surface grew");
///     }
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct SessionStrain {
    /// The frame whose load is the origin of strain, from 0.
    pub from: u64,
    /// The strained frame.
    pub to: u64,
    /// Number of control points with a partner on the strained surface. It is 0 for a flat face,
    /// whose strain follows from its area.
    pub matched: usize,
    /// Report of the match.
    pub report: MatchReport,
    /// The strain at the control points of the original load.
    pub strain: PairStrain,
}

/// The frame whose strain is requested.
struct Frame<'a> {
    number: u64,
    image: ArrayView2<'a, u8>,
    contact: &'a FrameContact,
    reading: ContactReading,
}

/// The load that is the origin of strain.
struct Anchor {
    frame: u64,
    reading: ContactReading,
    /// Number of pixels of its contact: all surfaces use its grid.
    pixels: usize,
    /// `None` for a flat face, whose strain follows from its area.
    points: Option<ControlPoints>,
}

/// Working memory of the stages before the strain.
#[derive(Default)]
struct Buffers {
    surface: ContactSurface,
    points: ControlPoints,
    pairs: MatchedPairs,
}

impl Buffers {
    /// Writes the control points of a frame's surface into `points`.
    fn sample(
        &mut self,
        stages: &Stages,
        scratch: &mut Scratch,
        frame: &Frame<'_>,
        grid_pixels: usize,
    ) -> Result<(), PipelineError> {
        let (number, surface) = (frame.number as usize, &mut self.surface);
        stages.surface(
            scratch,
            number,
            frame.image,
            frame.contact,
            grid_pixels,
            surface,
        )?;
        stages.control_points(scratch, number, surface, &mut self.points)
    }
}

/// Strain followed from frame to frame.
#[derive(Default)]
struct FollowedStrain {
    anchor: Option<Anchor>,
    warm: WarmStart,
    buffers: Buffers,
    last: Option<SessionStrain>,
    loads: Option<SeenLoads>,
}

impl FollowedStrain {
    /// The strain of `frame`. `None` if it is the origin of strain.
    fn follow(
        &mut self,
        stages: &Stages,
        scratch: &mut Scratch,
        frame: &Frame<'_>,
    ) -> Result<Option<&SessionStrain>, PipelineError> {
        let Some(anchor) = &self.anchor else {
            let pixels = frame.contact.pixels();
            let points = match stages.specimen {
                Specimen::Curved => {
                    self.buffers.sample(stages, scratch, frame, pixels)?;
                    Some(std::mem::take(&mut self.buffers.points))
                }
                Specimen::Flat(_) => None,
            };
            self.anchor = Some(Anchor {
                frame: frame.number,
                reading: frame.reading,
                pixels,
                points,
            });
            return Ok(None);
        };
        if anchor.frame == frame.number {
            return Ok(None);
        }
        let known = |last: &SessionStrain| last.to == frame.number;
        if !self.last.as_ref().is_some_and(known) {
            // If the strain fails, no earlier strain remains.
            let mut found = self.last.take().unwrap_or_default();
            (found.from, found.to) = (anchor.frame, frame.number);
            let (buffers, warm) = (&mut self.buffers, &mut self.warm);
            strain_since(anchor, buffers, warm, stages, scratch, frame, &mut found)?;
            let force_n = |reading: &ContactReading| reading.force_n.map_or(0.0, |f| f.value);
            let step = force_n(&frame.reading) - force_n(&anchor.reading);
            self.loads
                .get_or_insert_with(SeenLoads::new)
                .learn(&frame.reading, Some(found.strain.of_load(step)));
            self.last = Some(found);
        }
        Ok(self.last.as_ref())
    }

    /// The load at the origin of strain, then all others with their strains.
    fn loads(&self) -> impl Iterator<Item = Load> + Clone + '_ {
        let anchor = self.anchor.as_ref();
        let first = anchor.and_then(|anchor| Load::of(&anchor.reading));
        let later = self.loads.iter().flat_map(SeenLoads::loads);
        first.into_iter().chain(later)
    }
}

fn strain_since(
    anchor: &Anchor,
    buffers: &mut Buffers,
    warm: &mut WarmStart,
    stages: &Stages,
    scratch: &mut Scratch,
    frame: &Frame<'_>,
    found: &mut SessionStrain,
) -> Result<(), PipelineError> {
    let frames = [anchor.frame as usize, frame.number as usize];
    if let Specimen::Flat(flat) = stages.specimen {
        let contacts = [&anchor.reading, &frame.reading];
        let measure = stages.pipeline.strain();
        found.strain = scratch.timed(Stage::Strain, |_| flat.strain(frames, contacts, measure))?;
        return Ok(());
    }
    let Some(model) = &anchor.points else {
        return Err(PipelineError::NoContact { frame: frames[0] });
    };
    buffers.sample(stages, scratch, frame, anchor.pixels)?;
    scratch
        .report
        .skipped(Stage::Surface, SkipReason::KeptFromBefore);
    if found.report.iterations > 0 {
        scratch
            .report
            .skipped(Stage::Match, SkipReason::NearLastAnswer);
    }
    let (pairs, target) = (&mut buffers.pairs, &buffers.points.points);
    stages.next_pairs(scratch, frames, warm, [&model.points, target], pairs)?;
    let matched = MatchedPoints {
        model,
        target,
        assignment: &pairs.assignment,
        confidence: &pairs.confidence,
    };
    stages.strain(scratch, frames, &matched, &mut found.strain)?;
    found.matched = pairs.assignment.iter().flatten().count();
    found.report.clone_from(&pairs.report);
    Ok(())
}
