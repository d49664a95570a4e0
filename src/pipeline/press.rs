//! A press: frames at one or more loads, whose results are computed on request.
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
use crate::force::{Estimate, ReferenceFrame};
use crate::matching::Matching;
use nalgebra::Point3;
use ndarray::{Array2, ArrayView2, CowArray, Ix2};
use std::borrow::Cow;
use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// Reads an image when a stage needs it. The error is a message.
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

/// A result that is computed on first use.
type Lazy<T> = OnceLock<Result<T, PipelineError>>;

/// A frame with its results so far.
struct Loaded<'a> {
    image: FrameImage<'a>,
    gauge: Option<Estimate>,
    /// Seconds since the object touched. `None` if unknown.
    time_s: Option<f64>,
    // Boxed, so that thousands of frames without a requested strain need little memory.
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

/// Relative changes of the modulus for one per cent of what frames cannot show.
///
/// See [`Press::per_percent`] for an example.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct PerPercent {
    /// For forces that are 1 % larger.
    pub force: f64,
    /// For pixels that are 1 % larger.
    pub pixel_size: f64,
    /// For a lens that displaces the corners by 1 % of their distance to the middle, in the middle
    /// of the frame less. Zero if the lens is stated.
    pub distortion: f64,
}

/// The contact of a frame.
struct KnownContact {
    /// The contact. Frames read on demand have no mask here, so that nothing of the size of an
    /// image is kept.
    contact: FrameContact,
    /// Number of the contact's pixels.
    pixels: usize,
    /// The largest force of the press up to this frame.
    greatest_n: f64,
}

/// Frames at one or more loads. Each result is computed on first use, together with only the inputs
/// it needs, and is then kept. Matches, displacements and strains are from the first frame to a
/// later one.
///
/// Created by [`Pipeline::press`].
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
///     "nothing is requested yet"
/// );
/// let force = press.contact(0)?.and_then(|c| c.force_n).expect("a force");
/// assert!((force.value / 0.7 - 1.0).abs() < 0.02);
/// assert!(
///     (press.modulus()?.youngs_modulus_pa / 103e3 - 1.0).abs() < 0.0538,
///     "Hertz, from both contacts"
/// );
/// assert_eq!(press.report().work(Stage::Surface).runs, 0, "no surface yet");
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
    /// Starts a press: add frames, then request results. The press holds a clone of the pipeline.
    ///
    /// # Errors
    /// [`PipelineError::Sensor`] for a reference without pixels, or one that is too dark for the
    /// requested flat field.
    pub fn press<'a>(&self, reference: ArrayView2<'_, u8>) -> Result<Press<'a>, PipelineError> {
        Ok(self.press_on(Arc::new(self.reference_frame(&[reference])?)))
    }

    /// Starts a press on an existing reference, whose noise is measured once for many presses.
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
    /// The same frames and reference without any results, to time the computation again.
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

    /// Adds a frame, as a view or an owned array. Returns its number.
    pub fn add_frame(&mut self, image: impl Into<CowArray<'a, u8, Ix2>>) -> usize {
        self.add_gauged_frame(image, None)
    }

    /// Adds a frame with a gauge reading of the force in newtons. A standard error of 0 means that
    /// the reading is exact except for [`Source::Gain`](crate::core::Source::Gain). Returns the
    /// number of the frame.
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

    /// Adds a frame that is read whenever a stage needs it and is never kept, for presses that do
    /// not fit in memory. Returns its number. An error of `read` is a message and becomes
    /// [`PipelineError::Unreadable`].
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?;
    /// let mut press = pipeline.press(trial.simulation.reference.view())?;
    /// for frame in trial.simulation.frames {
    ///     // A program would read the frame from a file here.
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

    /// The pipeline of the press.
    pub fn pipeline(&self) -> &Pipeline {
        &self.stages.pipeline
    }

    /// The frame without contact.
    pub fn reference(&self) -> &ReferenceFrame {
        &self.stages.reference
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

    /// The stages that ran so far and those that were skipped.
    pub fn report(&self) -> Report {
        self.scratch().report.clone()
    }

    /// The gauge reading of a frame's force. `None` if there is none.
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

    /// The contact of a frame with its force. `None` without contact.
    ///
    /// # Errors
    /// [`PipelineError::Contact`], [`PipelineError::NoSuchFrame`].
    pub fn contact(&self, frame: usize) -> Result<Option<&ContactReading>, PipelineError> {
        Ok(self.known(frame)?.contact.reading.as_ref())
    }

    /// Depths in metres to which a ball indents the guide at distances (m) from the centre of the
    /// contact: the real surface, as opposed to the apparent one of [`surface`](Self::surface).
    /// `None` without contact, if the object is not a ball, or if the force or the layers of the
    /// guide are unknown.
    ///
    /// The depths are those of
    /// [`depression_m`](crate::elasticity::contact::Waveguide::depression_m) for the force and
    /// contact radius of the frame. The standard error includes force, radius, layers and
    /// the law, which assumes small strains.
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
    /// // The guide is indented by 2.13 mm on the axis under 1.2 N.
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

    /// The cautions about one frame, with or without contact. [`measure`](Self::measure) gives them
    /// for all frames.
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
            // Earlier frames are measured first, one after the other.
            let greatest_n = match self.stages.unknown_hysteresis() > 0.0 {
                true => (0..frame).fold(0.0, |before, k| {
                    self.known(k).map_or(before, |k| k.greatest_n)
                }),
                false => 0.0,
            };
            let greatest_n = self.stages.with_hysteresis(greatest_n, &mut contact);
            if let FrameImage::Read(_) = loaded.image {
                contact.mask = Array2::default((0, 0));
            }
            Ok(Box::new(KnownContact {
                contact,
                pixels,
                greatest_n,
            }))
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

    /// A frame's image and its contact with the mask. If the mask was not kept, it is computed
    /// again.
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

    /// The contact of a frame. A frame without contact is an error.
    pub(super) fn reading(&self, frame: usize) -> Result<ContactReading, PipelineError> {
        if let Some(reading) = self.contact(frame)? {
            return Ok(*reading);
        }
        let image = self.image(frame)?;
        Err(match self.stages.reference.background_shift(image.view()) {
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
    /// // Hertz's pressure interpreted as shading is a hemisphere of the contact's radius.
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
            // All surfaces use the grid of the first.
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
    /// // All are within the contact, whose centre is that of the frame: (86.5, 64.5) pixels.
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

    /// The matches of the first frame's control points with those of a later frame.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let press = trial.press(&pipeline)?;
    /// let matching = press.matching(1)?;
    /// let partners: Vec<_> = matching.assignment.iter().flatten().copied().collect();
    /// assert!(partners.len() > 50);
    /// assert_eq!(matching.warped.len(), 60, "new positions of the first frame's points");
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

    /// The strain between the first frame and a later one. For an object with a flat face it
    /// follows from the growth of the face's area and is equal at all points.
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

    /// Young's modulus by the estimator of the pipeline. For a ball it needs only the contacts, and
    /// no surface is reconstructed.
    ///
    /// # Errors
    /// [`PipelineError::Modulus`], [`PipelineError::NoForce`], and those of the stages it needs.
    pub fn modulus(&self) -> Result<ModulusEstimate, PipelineError> {
        let estimator = self.pipeline().estimator()?;
        let loads = self.loads(estimator.needs_strain())?;
        self.stages
            .modulus(&mut self.scratch(), estimator.as_ref(), &loads)
    }

    /// The load of each frame and the errors common to all loads, which is the input of
    /// [estimators](crate::elasticity::modulus::ModulusEstimator). The strain is counted from the
    /// first frame, for at most 32 frames at even intervals. For a flat face it is counted from the
    /// unloaded state, for all frames.
    ///
    /// A frame whose contact repeats an earlier one adds no information, and a contact cut by the
    /// edge of the frame is wrong: their loads have only a force.
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

    /// Young's modulus by every estimator that the frames permit, the paper's ratio first.
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
    /// Those of the contacts. Estimators that fail are left out.
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

    /// By how much the modulus changes if forces, the pixel size or the distortion of the lens are
    /// one per cent larger than stated.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?;
    /// let found = trial.press(&pipeline)?.per_percent()?;
    /// // E is nearly proportional to F/a³, and more so because the guide yields, too.
    /// assert!(found.force > 0.01 && found.pixel_size < -0.03 && found.distortion < 0.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`modulus`](Self::modulus).
    pub fn per_percent(&self) -> Result<PerPercent, PipelineError> {
        let pipeline = self.pipeline();
        let estimator = pipeline.estimator()?;
        let (size, bodies) = (pipeline.contact().pixel_size_m(), pipeline.bodies());
        let mut loads = Vec::with_capacity(self.frames.len());
        for frame in 0..self.frames.len() {
            let load = Load::of(&self.reading(frame)?);
            loads.push(load.ok_or(PipelineError::NoForce { frame })?);
        }
        self.leave_out(&mut loads);
        let shape = self.stages.reference.image().dim();
        // The local curve sums pressures over areas, which a larger pixel increases, too.
        let of_area = f64::from(u8::from(pipeline.contact().pressure_curve().is_some()));
        let lens = pipeline.contact().lens().is_none();
        let with = |growth: &dyn Fn(&ContactReading) -> [f64; 2]| {
            let changed = loads.iter().map(|load| {
                let [force, radius] = growth(&load.contact).map(|growth| 1.0 + growth);
                let mut load = *load;
                load.force_n = load.force_n * force;
                load.contact.contact_radius_m = load.contact.contact_radius_m * radius;
                load
            });
            let series = loads::series(changed, Arc::clone(bodies), size);
            let found = estimator
                .estimate(&series)
                .map_err(PipelineError::Modulus)?;
            Ok::<_, PipelineError>(found.youngs_modulus_pa)
        };
        let plain = with(&|_| [0.0; 2])?;
        let relative = |changed: f64| changed / plain - 1.0;
        let distorted = |contact: &ContactReading| {
            let growth = contact.per_distortion(shape, size).filter(|_| lens);
            growth.unwrap_or_default()
        };
        Ok(PerPercent {
            force: relative(with(&|_| [0.01, 0.0])?),
            pixel_size: relative(with(&|_| [0.0201 * of_area, 0.01])?),
            distortion: relative(with(&distorted)?),
        })
    }

    /// The load of each frame, and the relative errors common to all.
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
                // If all contacts are cut, the first is rejected.
                let all_cut = loads.iter().all(|load| load.contact.touches_edge);
                let numbered = loads.iter().map(|load| &load.contact).enumerate();
                flat.check(numbered.filter(|(_, contact)| all_cut || !contact.touches_edge))?;
                flat.strained(&series, pipeline.strain())
            }
            _ => Ok(series),
        }
    }

    /// Excludes from the modulus frames whose contact repeats an earlier one bit for bit, and
    /// contacts cut by the edge of the frame.
    fn leave_out(&self, loads: &mut [Load]) {
        let mut seen = HashSet::new();
        for (load, frame) in loads.iter_mut().zip(&self.frames) {
            let (contact, gauge) = (&load.contact, frame.gauge.map(|gauge| gauge.value));
            let [x, y] = contact.centroid_px.map(|c| c.value);
            // Noise changes each of these values, so equal bits come from the same image.
            let values = [load.force_n.value, contact.contact_radius_m.value, x, y];
            let new = seen.insert((values.map(f64::to_bits), gauge.map(f64::to_bits)));
            load.counts = new && !contact.touches_edge;
        }
    }

    /// The frames whose strain enters the modulus: at most 32, at even intervals, of those that do
    /// not repeat an earlier one. A match takes milliseconds, so thousands of them would take
    /// minutes. More frames would not reduce the error of the mean strain, because it comes from
    /// the first surface, which all share.
    fn strained_frames(&self, loads: &[Load]) -> Vec<usize> {
        let new: Vec<usize> = (1..loads.len()).filter(|&k| loads[k].counts).collect();
        let kept = new.len().min(32);
        // The last frame is always included.
        (1..=kept).map(|k| new[k * new.len() / kept - 1]).collect()
    }

    /// The largest change of the light since the reference was taken, in grey levels, outside the
    /// contacts of the measured frames.
    pub(super) fn light_step_grey(&self) -> Option<f64> {
        let known = self.frames.iter().filter_map(|frame| frame.contact.get());
        let contacts = known.filter_map(|known| known.as_ref().ok());
        let pressed = contacts.filter(|known| known.contact.reading.is_some());
        let steps = pressed.filter_map(|known| known.contact.background_step_grey);
        steps.max_by(|a, b| a.abs().total_cmp(&b.abs()))
    }

    /// Sets when a frame was taken, in seconds since the object touched. Frames without a time are
    /// ignored in time-dependent results.
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
    /// [`PipelineError::NoSuchFrame`], [`PipelineError::Time`] for a negative or non-finite time,
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

    /// When a frame was taken. `None` if unknown.
    pub(super) fn time_s(&self, frame: usize) -> Option<f64> {
        self.frames.get(frame)?.time_s
    }
}
