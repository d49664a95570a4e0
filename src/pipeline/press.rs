//! A press: frames at one or more loads, of which nothing is computed before it is asked for.
use super::contact::{ContactReading, FrameContact};
use super::depression;
use super::error::PipelineError;
use super::estimators::that_fit;
use super::flag::Flag;
use super::loads::{self, Load};
use super::pipeline::Pipeline;
use super::report::{Report, SkipReason, Stage};
use super::specimen::{Object, Specimen};
use super::stages::{MatchedPoints, Scratch, Stages};
use super::strain::PairStrain;
use super::surface::{ContactSurface, ControlPoints};
use crate::elasticity::modulus::{LoadSeries, ModulusEstimate};
use crate::force::{Estimate, ReferenceFrame, background_shift};
use crate::matching::Matching;
use nalgebra::Point3;
use ndarray::{Array2, ArrayView2, CowArray, Ix2};
use std::borrow::Cow;
use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// Reads an image whenever a stage needs it. The error is a sentence.
type Read = Arc<dyn Fn() -> Result<Array2<u8>, String> + Send + Sync>;

#[derive(Clone)]
enum FrameImage<'a> {
    Kept(CowArray<'a, u8, Ix2>),
    Read(Read),
}

impl FrameImage<'_> {
    /// The image of the frame with this number.
    fn get(&self, frame: usize) -> Result<CowArray<'_, u8, Ix2>, PipelineError> {
        match self {
            Self::Kept(image) => Ok(CowArray::from(image.view())),
            Self::Read(read) => match read() {
                Ok(image) => Ok(CowArray::from(image)),
                Err(reason) => Err(PipelineError::Unreadable { frame, reason }),
            },
        }
    }
}

/// An answer that is computed when it is first asked for.
type Lazy<T> = OnceLock<Result<T, PipelineError>>;

/// A frame and its answers so far.
struct Loaded<'a> {
    image: FrameImage<'a>,
    gauge: Option<Estimate>,
    /// Seconds since the object touched, where they are known.
    time_s: Option<f64>,
    // Boxed, so that thousands of frames, whose strain nobody asks for, take no room for it.
    contact: Lazy<Box<KnownContact>>,
    surface: Lazy<Box<ContactSurface>>,
    points: Lazy<Box<ControlPoints>>,
    matching: Lazy<Box<Matching<3>>>,
    strain: Lazy<Box<PairStrain>>,
}

impl<'a> Loaded<'a> {
    fn new(image: FrameImage<'a>, gauge: Option<Estimate>) -> Self {
        Self {
            image,
            gauge,
            time_s: None,
            contact: Lazy::new(),
            surface: Lazy::new(),
            points: Lazy::new(),
            matching: Lazy::new(),
            strain: Lazy::new(),
        }
    }
}

/// The contact of a frame.
struct KnownContact {
    /// Without its mask where the image is read: nothing as large as an image is kept of such a
    /// frame.
    contact: FrameContact,
    /// Number of the contact's pixels.
    pixels: usize,
}

/// Frames at one or more loads. Every result is computed when it is first asked for, with what it
/// needs and nothing else, and kept. Matches, displacements and strains are from the first frame to
/// a later one.
///
/// Made by [`Pipeline::press`].
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// use tactile_imaging::pipeline::Stage;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let press = trial.press(&pipeline)?;
/// assert_eq!(
///     (press.frames(), press.report().work(Stage::Contact).runs),
///     (2, 0),
///     "nothing is asked for yet"
/// );
/// let force = press.contact(0)?.and_then(|c| c.force_n).expect("a force");
/// assert!((force.value / 0.7 - 1.0).abs() < 0.02);
/// assert!(
///     (press.modulus()?.youngs_modulus_pa / 103e3 - 1.0).abs() < 0.0538,
///     "Hertz, from both contacts"
/// );
/// assert_eq!(press.report().work(Stage::Surface).runs, 0, "no surface so far");
/// press.strain(1)?;
/// assert_eq!(press.report().work(Stage::Surface).runs, 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Press<'a> {
    pub(super) stages: Stages,
    frames: Vec<Loaded<'a>>,
    /// Locked while a stage runs.
    scratch: Mutex<Scratch>,
}

impl Pipeline {
    /// Starts a press: add frames, then ask for what you want. The press holds a clone of the
    /// pipeline.
    ///
    /// # Errors
    /// [`PipelineError::Sensor`] for a reference without pixels, or too dark for the flat field
    /// that was asked for.
    pub fn press<'a>(&self, reference: ArrayView2<'_, u8>) -> Result<Press<'a>, PipelineError> {
        Ok(self.press_on(Arc::new(self.reference_frame(&[reference])?)))
    }

    /// Starts a press on a reference made before: its noise is measured once for many presses.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tactile_imaging::force::ReferenceFrame;
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?;
    /// let reference = Arc::new(ReferenceFrame::new(trial.simulation.reference.view())?);
    /// for (frame, newton) in trial.simulation.frames.iter().zip([0.7, 1.2]) {
    ///     let mut press = pipeline.press_on(Arc::clone(&reference));
    ///     press.add_frame(frame.view());
    ///     let force = press.contact(0)?.and_then(|c| c.force_n).expect("a force");
    ///     assert!((force.value / newton - 1.0).abs() < 0.02);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn press_on<'a>(&self, reference: Arc<ReferenceFrame>) -> Press<'a> {
        Press {
            stages: Stages::new(self.clone(), reference),
            frames: Vec::new(),
            scratch: Mutex::default(),
        }
    }
}

impl<'a> Press<'a> {
    /// The same frames on the same reference, of which nothing is computed yet: to time it again.
    #[must_use]
    pub fn renewed(&self) -> Self {
        let renewed = |frame: &Loaded<'a>| Loaded {
            time_s: frame.time_s,
            ..Loaded::new(frame.image.clone(), frame.gauge)
        };
        Self {
            stages: self.stages.clone(),
            frames: self.frames.iter().map(renewed).collect(),
            scratch: Mutex::default(),
        }
    }

    /// Adds a frame, a view or an array of its own. Returns its number.
    pub fn add_frame(&mut self, image: impl Into<CowArray<'a, u8, Ix2>>) -> usize {
        self.add_gauged_frame(image, None)
    }

    /// Adds a frame with a gauge's reading of the force in newtons (standard error 0: exact but for
    /// [`Source::Gain`](crate::core::Source::Gain)). Returns its number.
    ///
    /// ```
    /// use tactile_imaging::force::Estimate;
    /// use tactile_imaging::pipeline::{DarkContact, Object, Pipeline, PipelineError};
    /// let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    ///     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    ///     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// });
    /// // A sensor that darkens measures depth, not force.
    /// let contact = DarkContact::new(&[(0.0, 0.0), (150.0, 0.5e-3)], [50e-6; 2])?;
    /// let pipeline = Pipeline::new(contact, Object::sphere(3e-3))?;
    /// let (reference, frame) = (hertz(0.0).mapv(|v| 255 - v), hertz(120.0).mapv(|v| 255 - v));
    /// let mut press = pipeline.press(reference.view())?;
    /// let gauge = Estimate::new(0.9, 2e-3);
    /// assert_eq!(press.add_gauged_frame(frame.view(), Some(gauge)), 0);
    /// assert!(press.modulus().is_ok());
    /// press.add_frame(frame.view());
    /// assert_eq!(press.modulus().unwrap_err(), PipelineError::NoForce { frame: 1 });
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn add_gauged_frame(
        &mut self,
        image: impl Into<CowArray<'a, u8, Ix2>>,
        gauge: Option<Estimate>,
    ) -> usize {
        let image = FrameImage::Kept(image.into());
        self.frames.push(Loaded::new(image, gauge));
        self.frames.len() - 1
    }

    /// Adds a frame that is read whenever a stage needs it and never kept, for more frames than
    /// memory takes; returns its number. An error of `read` is a sentence and becomes
    /// [`PipelineError::Unreadable`].
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?;
    /// let mut press = pipeline.press(trial.simulation.reference.view())?;
    /// for frame in trial.simulation.frames {
    ///     // In earnest: of a file.
    ///     press.add_frame_on_demand(None, move || Ok(frame.clone()));
    /// }
    /// assert!(press.contact(1)?.is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn add_frame_on_demand(
        &mut self,
        gauge: Option<Estimate>,
        read: impl Fn() -> Result<Array2<u8>, String> + Send + Sync + 'static,
    ) -> usize {
        let image = FrameImage::Read(Arc::new(read));
        self.frames.push(Loaded::new(image, gauge));
        self.frames.len() - 1
    }

    /// The pipeline.
    pub fn pipeline(&self) -> &Pipeline {
        &self.stages.pipeline
    }

    /// The image of a frame.
    ///
    /// # Errors
    /// [`PipelineError::NoSuchFrame`], [`PipelineError::Unreadable`].
    pub fn image(&self, frame: usize) -> Result<CowArray<'_, u8, Ix2>, PipelineError> {
        self.loaded(frame)?.image.get(frame)
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frames.len()
    }

    /// The stages that ran so far, and those that were skipped.
    pub fn report(&self) -> Report {
        self.scratch().report.clone()
    }

    /// The gauge's reading of a frame's force, if there was one.
    pub fn gauge(&self, frame: usize) -> Option<Estimate> {
        self.frames.get(frame)?.gauge
    }

    fn scratch(&self) -> MutexGuard<'_, Scratch> {
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn loaded(&self, frame: usize) -> Result<&Loaded<'a>, PipelineError> {
        let frames = self.frames.len();
        let loaded = self.frames.get(frame);
        loaded.ok_or(PipelineError::NoSuchFrame { frame, frames })
    }

    /// The contact of a frame with its force. `None` where nothing touches.
    ///
    /// # Errors
    /// [`PipelineError::Contact`], [`PipelineError::NoSuchFrame`].
    pub fn contact(&self, frame: usize) -> Result<Option<&ContactReading>, PipelineError> {
        Ok(self.known(frame)?.contact.reading.as_ref())
    }

    /// Depths in metres to which a ball presses the guide at distances (m) from the contact's
    /// centre: the real surface beside the apparent one of [`surface`](Self::surface). `None` where
    /// nothing touches, the object is no ball, or the force or the guide's layers are not known.
    ///
    /// [`depression_m`](crate::elasticity::contact::depression_m) under the force and the contact
    /// radius of the frame. The standard error is that of force, radius, layers and of the law,
    /// which is for small strains.
    ///
    /// ```
    /// use tactile_simulate::{CalibrationRun, Camera, ContactModel, PressOptions, Trial};
    /// let options = PressOptions {
    ///     law: ContactModel::FiniteElements,
    ///     camera: Camera::default().coarser(8),
    ///     ..PressOptions::default()
    /// };
    /// let trial = Trial::new(options, &CalibrationRun::default())?;
    /// let press = trial.press(&trial.pipeline()?)?;
    /// let depths = press.guide_depression_m(1, &[0.0, 2e-3])?.expect("a ball on layers");
    /// // The guide yields by 2.13 mm on the axis under 1.2 N.
    /// assert!((depths[0].value - 2.134e-3).abs() < 1.96 * depths[0].standard_error);
    /// assert!(depths[1].value < depths[0].value);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`contact`](Self::contact).
    pub fn guide_depression_m(
        &self,
        frame: usize,
        distances_m: &[f64],
    ) -> Result<Option<Vec<Estimate>>, PipelineError> {
        let bodies = self.pipeline().bodies();
        let is_ball = matches!(bodies.object(), Object::Sphere { .. });
        let contact = self.contact(frame)?.filter(|_| is_ball);
        Ok(contact.and_then(|contact| depression::depths(contact, bodies, distances_m)))
    }

    /// The cautions about a frame's contact, or about a frame without one, which
    /// [`measure`](Self::measure) gives for all frames.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{Flag, Object, Pipeline};
    /// use tactile_imaging::force::CalibrationPair;
    /// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let reference = ndarray::Array2::from_elem((64, 64), 60_u8);
    /// let mut press = pipeline.press(reference.view())?;
    /// press.add_frame(reference.mapv(|level| level - 20));
    /// assert_eq!(press.cautions(0)?, [Flag::OppositeSignal { frame: 0, grey: -20.0 }]);
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`contact`](Self::contact).
    pub fn cautions(&self, frame: usize) -> Result<Vec<Flag>, PipelineError> {
        let contact = &self.known(frame)?.contact;
        let (image, gauge) = (self.image(frame)?, self.gauge(frame));
        Ok(self.stages.cautions(frame, image.view(), contact, gauge))
    }

    fn known(&self, frame: usize) -> Result<&KnownContact, PipelineError> {
        let loaded = self.loaded(frame)?;
        let known = loaded.contact.get_or_init(|| {
            let image = loaded.image.get(frame)?;
            let mut contact = self.measured(frame, image.view())?;
            let pixels = contact.pixels();
            if let FrameImage::Read(_) = loaded.image {
                contact.mask = Array2::default((0, 0));
            }
            Ok(Box::new(KnownContact { contact, pixels }))
        });
        known.as_deref().map_err(Clone::clone)
    }

    fn measured(
        &self,
        frame: usize,
        image: ArrayView2<'_, u8>,
    ) -> Result<FrameContact, PipelineError> {
        let mut contact = FrameContact::default();
        let gauge = self.gauge(frame);
        self.stages
            .contact(&mut self.scratch(), frame, image, gauge, &mut contact)?;
        Ok(contact)
    }

    /// A frame's image and its contact with the mask, which is found again where the frame keeps
    /// none.
    fn masked(
        &self,
        frame: usize,
    ) -> Result<(CowArray<'_, u8, Ix2>, Cow<'_, FrameContact>), PipelineError> {
        let known = self.known(frame)?;
        let image = self.image(frame)?;
        let contact = match self.frames[frame].image {
            FrameImage::Kept(_) => Cow::Borrowed(&known.contact),
            FrameImage::Read(_) => Cow::Owned(self.measured(frame, image.view())?),
        };
        Ok((image, contact))
    }

    /// The contact of a frame that must have one.
    pub(super) fn reading(&self, frame: usize) -> Result<ContactReading, PipelineError> {
        if let Some(reading) = self.contact(frame)? {
            return Ok(*reading);
        }
        let image = self.image(frame)?;
        let reference = self.stages.reference.image();
        Err(match background_shift(image.view(), reference) {
            Some(grey) => PipelineError::OppositeSignal { frame, grey },
            None => PipelineError::NoContact { frame },
        })
    }

    /// The surface of a frame's contact.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?;
    /// let press = trial.press(&pipeline)?;
    /// let surface = press.surface(0)?;
    /// let top =
    ///     surface.surface.heights.iter().copied().filter(|h| h.is_finite()).fold(0.0, f64::max);
    /// // Hertz's pressure read as shading is a hemisphere as high as the contact's radius.
    /// let radius = trial.simulation.truth[0].contact.contact_radius_m;
    /// assert!((top / radius - 1.0).abs() < 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoContact`], [`PipelineError::Surface`], and those of
    /// [`contact`](Self::contact).
    pub fn surface(&self, frame: usize) -> Result<&ContactSurface, PipelineError> {
        self.reading(frame)?;
        let surface = self.frames[frame].surface.get_or_init(|| {
            // All surfaces have the grid of the first.
            let pixels = self.known(0)?.pixels;
            let (image, contact) = self.masked(frame)?;
            let mut surface = Box::<ContactSurface>::default();
            let scratch = &mut self.scratch();
            self.stages
                .surface(scratch, frame, image.view(), &contact, pixels, &mut surface)?;
            Ok(surface)
        });
        surface.as_deref().map_err(Clone::clone)
    }

    /// Control points on a frame's surface, in metres from the frame's first pixel.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let press = trial.press(&pipeline)?;
    /// let points = press.control_points(0)?;
    /// assert_eq!(points.len(), 60);
    /// // All within the contact, whose middle is the frame's: (86.5, 64.5) pixels.
    /// let radius = 1.1 * trial.simulation.truth[0].contact.contact_radius_m;
    /// assert!(
    ///     points.iter().all(|p| (p.x - 86.5 * 172.4e-6).hypot(p.y - 64.5 * 172.4e-6) < radius)
    /// );
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`surface`](Self::surface).
    pub fn control_points(&self, frame: usize) -> Result<&[Point3<f64>], PipelineError> {
        Ok(&self.sampled(frame)?.points)
    }

    fn sampled(&self, frame: usize) -> Result<&ControlPoints, PipelineError> {
        let surface = self.surface(frame)?;
        let points = self.frames[frame].points.get_or_init(|| {
            let mut points = Box::<ControlPoints>::default();
            self.stages
                .control_points(&mut self.scratch(), frame, surface, &mut points)?;
            Ok(points)
        });
        points.as_deref().map_err(Clone::clone)
    }

    /// The matches of the first frame's control points to those of a later frame.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let press = trial.press(&pipeline)?;
    /// let matching = press.matching(1)?;
    /// let partners: Vec<_> = matching.assignment.iter().flatten().copied().collect();
    /// assert!(partners.len() > 50);
    /// assert_eq!(matching.warped.len(), 60, "where the first frame's points have gone");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::Match`] and those of [`control_points`](Self::control_points).
    pub fn matching(&self, frame: usize) -> Result<&Matching<3>, PipelineError> {
        let model = self.control_points(0)?;
        let target = self.control_points(frame)?;
        let matching = self.frames[frame].matching.get_or_init(|| {
            self.stages
                .matching(&mut self.scratch(), [0, frame], model, target)
                .map(Box::new)
        });
        matching.as_deref().map_err(Clone::clone)
    }

    /// The strain between the first frame and a later one. Of an object with a flat face by the
    /// growth of its area, the same at all points.
    ///
    /// # Errors
    /// [`PipelineError::TooFewMatches`], [`PipelineError::Warp`], [`PipelineError::Strain`] and
    /// those of [`matching`](Self::matching).
    pub fn strain(&self, frame: usize) -> Result<&PairStrain, PipelineError> {
        let loaded = self.loaded(frame)?;
        let strain = loaded.strain.get_or_init(|| {
            let mut strain = Box::<PairStrain>::default();
            match self.stages.specimen {
                Specimen::Flat(flat) => {
                    let contacts = [self.reading(0)?, self.reading(frame)?];
                    let measure = self.pipeline().strain();
                    *strain = self.scratch().timed(Stage::Strain, |_| {
                        flat.strain([0, frame], contacts.each_ref(), measure)
                    })?;
                }
                Specimen::Curved => {
                    let matching = self.matching(frame)?;
                    let matched = MatchedPoints {
                        model: self.sampled(0)?,
                        target: self.control_points(frame)?,
                        assignment: &matching.assignment,
                        confidence: &matching.confidence,
                    };
                    let scratch = &mut self.scratch();
                    self.stages
                        .strain(scratch, [0, frame], &matched, &mut strain)?;
                }
            }
            Ok(strain)
        });
        strain.as_deref().map_err(Clone::clone)
    }

    /// Young's modulus by the estimator of the pipeline. For a
    /// ball that takes the contacts alone: no surface is reconstructed.
    ///
    /// # Errors
    /// [`PipelineError::Modulus`], [`PipelineError::NoForce`], and those of the stages it needs.
    pub fn modulus(&self) -> Result<ModulusEstimate, PipelineError> {
        let estimator = self.pipeline().estimator()?;
        let loads = self.loads(estimator.needs_strain())?;
        self.stages
            .modulus(&mut self.scratch(), estimator.as_ref(), &loads)
    }

    /// The load of every frame, with the strain since the first (of at most 32 frames, evenly
    /// chosen. Of a flat face, of all frames and since the unloaded state) and the errors that all
    /// share. This is the input of
    /// [estimators](crate::elasticity::modulus::ModulusEstimator).
    ///
    /// A frame whose contact repeats an earlier one carries no information, and a contact that the
    /// frame's edge cuts is wrong: their loads have a force alone.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?;
    /// let series = trial.press(&pipeline)?.load_series()?;
    /// let loads = series.loads();
    /// assert!((loads[1].force_n.value - 1.2).abs() < 0.01);
    /// assert!(loads[0].mean_strain.is_none() && loads[1].mean_strain.is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoForce`], and those of the contacts and of [`strain`](Self::strain).
    pub fn load_series(&self) -> Result<LoadSeries, PipelineError> {
        self.loads(true)
    }

    /// Young's modulus by every estimator that the frames allow, the paper's ratio first.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// use tactile_imaging::elasticity::modulus::EstimatorKind;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let press = trial.press(&pipeline)?;
    /// let estimates = press.estimates()?;
    /// assert_eq!(estimates[0].estimator, EstimatorKind::PaperRatio, "stress over strain");
    /// let best = press.modulus()?;
    /// assert!(estimates.contains(&best) && best.estimator == EstimatorKind::HertzSphere);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of the contacts. What an estimator cannot do is left out.
    pub fn estimates(&self) -> Result<Vec<ModulusEstimate>, PipelineError> {
        let loads = match self.loads(true) {
            Ok(loads) => loads,
            Err(_) => self.loads(false)?,
        };
        let settings = self.pipeline().settings();
        let mut estimators = that_fit(settings.object, settings.waveguide.as_ref())?;
        if let Ok(chosen) = self.pipeline().estimator()
            && estimators.iter().all(|e| e.kind() != chosen.kind())
        {
            estimators.push(chosen);
        }
        let scratch = &mut self.scratch();
        let estimates = estimators.iter().filter_map(|estimator| {
            self.stages
                .modulus(scratch, estimator.as_ref(), &loads)
                .ok()
        });
        Ok(estimates.collect())
    }

    /// The load of every frame, and the relative errors that all share.
    pub(super) fn loads(&self, with_strain: bool) -> Result<LoadSeries, PipelineError> {
        let mut loads = Vec::with_capacity(self.frames.len());
        for frame in 0..self.frames.len() {
            let load = Load::of(&self.reading(frame)?);
            loads.push(load.ok_or(PipelineError::NoForce { frame })?);
        }
        self.leave_out(&mut loads);
        if let (true, Specimen::Curved) = (with_strain, self.stages.specimen) {
            for frame in self.strained_frames(&loads) {
                let step = loads[frame].force_n.value - loads[0].force_n.value;
                loads[frame].mean_strain = Some(self.strain(frame)?.of_load(step));
            }
        }
        let pipeline = self.pipeline();
        let size = pipeline.contact().pixel_size_m();
        let bodies = Arc::clone(pipeline.bodies());
        let series = loads::series(loads.iter().copied(), bodies, size);
        match self.stages.specimen {
            Specimen::Flat(flat) if with_strain => {
                // Where all are cut the first is refused.
                let all_cut = loads.iter().all(|load| load.contact.touches_edge);
                let numbered = loads.iter().map(|load| &load.contact).enumerate();
                flat.check(numbered.filter(|(_, contact)| all_cut || !contact.touches_edge))?;
                flat.strained(&series, pipeline.strain())
            }
            _ => Ok(series),
        }
    }

    /// Leaves out of the modulus the frames whose contact repeats an earlier one, bit for bit, and
    /// those whose contact is cut by the frame's edge.
    fn leave_out(&self, loads: &mut [Load]) {
        let mut seen = HashSet::new();
        for (load, frame) in loads.iter_mut().zip(&self.frames) {
            let (contact, gauge) = (&load.contact, frame.gauge.map(|gauge| gauge.value));
            let [x, y] = contact.centroid_px.map(|c| c.value);
            // Noise moves every one of these: equal bits are those of one image.
            let values = [load.force_n.value, contact.contact_radius_m.value, x, y];
            let new = seen.insert((values.map(f64::to_bits), gauge.map(f64::to_bits)));
            load.counts = new && !contact.touches_edge;
        }
    }

    /// The frames whose strain enters the modulus: at most 32 of those that repeat no earlier one,
    /// chosen evenly. A match takes milliseconds, so that thousands would take minutes. The error
    /// of the mean strain is that of the first surface, which all share, and does not fall with
    /// more.
    fn strained_frames(&self, loads: &[Load]) -> Vec<usize> {
        let new: Vec<usize> = (1..loads.len()).filter(|&k| loads[k].counts).collect();
        let kept = new.len().min(32);
        // The last frame is always one of them.
        (1..=kept).map(|k| new[k * new.len() / kept - 1]).collect()
    }

    /// The largest step of the light since the reference was taken, in grey levels, away from the
    /// contacts of the frames that were measured.
    pub(super) fn light_step_grey(&self) -> Option<f64> {
        let known = self.frames.iter().filter_map(|frame| frame.contact.get());
        let contacts = known.filter_map(|known| known.as_ref().ok());
        let pressed = contacts.filter(|known| known.contact.reading.is_some());
        let steps = pressed.filter_map(|known| known.contact.background_step_grey);
        steps.max_by(|a, b| a.abs().total_cmp(&b.abs()))
    }

    /// Sets when a frame was taken, in seconds since the object touched. Frames without a time do
    /// not count where time does.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// use tactile_imaging::pipeline::PipelineError;
    /// let pipeline = trial.pipeline()?;
    /// let mut press = trial.press(&pipeline)?;
    /// press.set_time_s(0, 2.0)?;
    /// let error = press.set_time_s(1, 1.5).unwrap_err();
    /// assert_eq!(error, PipelineError::TimeDecreases { frame: 1, before_s: 2.0, found_s: 1.5 });
    /// press.set_time_s(1, 2.5)?;
    /// let time = press.measure().time.expect("two loads with their times");
    /// assert_eq!((time.from_s, time.to_s, time.loads), (2.0, 2.5, 2));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoSuchFrame`], [`PipelineError::Time`] for what is negative or not finite,
    /// [`PipelineError::TimeDecreases`].
    pub fn set_time_s(&mut self, frame: usize, time_s: f64) -> Result<(), PipelineError> {
        self.loaded(frame)?;
        if !(time_s >= 0.0 && time_s.is_finite()) {
            let found_s = time_s;
            return Err(PipelineError::Time { frame, found_s });
        }
        let timed = |(k, other): (usize, &Loaded<'_>)| Some((k, other.time_s?));
        let frames = || self.frames.iter().enumerate();
        let before = frames().take(frame).rev().find_map(timed);
        let before = before.map(|(_, before_s)| (frame, before_s, time_s));
        let after = frames().skip(frame + 1).find_map(timed);
        let after = after.map(|(next, next_s)| (next, time_s, next_s));
        let mut steps = before.into_iter().chain(after);
        let decrease = steps.find(|(_, before_s, found_s)| found_s < before_s);
        if let Some((frame, before_s, found_s)) = decrease {
            return Err(PipelineError::TimeDecreases {
                frame,
                before_s,
                found_s,
            });
        }
        self.frames[frame].time_s = Some(time_s);
        Ok(())
    }

    /// Whether a frame's surface has been reconstructed.
    pub(super) fn has_surface(&self, frame: usize) -> bool {
        let loaded = self.frames.get(frame);
        loaded.is_some_and(|loaded| loaded.surface.get().is_some())
    }

    pub(super) fn skipped(&self, stage: Stage, reason: SkipReason) {
        self.scratch().report.skipped(stage, reason);
    }

    /// When a frame was taken, where that is known.
    pub(super) fn time_s(&self, frame: usize) -> Option<f64> {
        self.frames.get(frame)?.time_s
    }
}
