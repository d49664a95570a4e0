//! A press: frames at one or more loads, of which nothing is computed before it is asked for.
use super::contact::{ContactReading, FrameContact};
use super::error::PipelineError;
use super::object::{
    LoadReading, SharedErrors, all_estimates, chosen_estimate, radius_with_floor, split_errors,
};
use super::pair::{self, PairStrain};
use super::report::{Report, SkipReason, Stage};
use super::stages::{Stages, reference_frame};
use super::surface::{self, ContactSurface, SurfaceWorkspace};
use crate::elasticity::modulus::{Estimate, LoadState, ModulusEstimate};
use crate::force::{ForceWorkspace, ReferenceFrame};
use crate::matching::Matching;
use nalgebra::Point3;
use ndarray::ArrayView2;
use std::sync::Arc;
use std::time::Instant;

/// A frame and what is known of it so far.
struct Loaded<'a> {
    image: ArrayView2<'a, u8>,
    gauge_n: Option<f64>,
    contact: Option<FrameContact>,
    surface: Option<ContactSurface>,
    points: Option<Vec<Point3<f64>>>,
    matching: Option<Matching<f64, 3>>,
    strain: Option<PairStrain>,
}

/// Frames at one or more loads. Every result is computed when it is first asked for, with what it needs and nothing else,
/// and kept. Matches, displacements and strains are from the first frame to a later one.
///
/// Made by [`Pipeline::press`](super::Pipeline::press).
///
/// ```
/// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
/// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
/// use tactile_imaging::pipeline::Stage;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let mut press = trial.press(&pipeline)?;
/// assert_eq!((press.frames(), press.report().work(Stage::Contact).runs), (2, 0), "nothing is asked for yet");
/// let force = press.contact(0)?.and_then(|c| c.force_n).expect("a force");
/// assert!((force.value / 0.7 - 1.0).abs() < 0.02);
/// assert!((press.modulus()?.youngs_modulus_pa / 103e3 - 1.0).abs() < 0.0538, "Hertz, from both contacts");
/// assert_eq!(press.report().work(Stage::Surface).runs, 0, "no surface so far");
/// press.strain(1)?;
/// assert_eq!(press.report().work(Stage::Surface).runs, 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Press<'a> {
    stages: &'a dyn Stages,
    reference: Arc<ReferenceFrame>,
    frames: Vec<Loaded<'a>>,
    /// The frame whose results a frame shares: itself, or an equal one before it.
    twins: Vec<usize>,
    force: ForceWorkspace,
    surface: SurfaceWorkspace,
    report: Report,
}

impl<'a> Press<'a> {
    /// Starts a press with stages as an object; see [`Pipeline::press`](super::Pipeline::press).
    ///
    /// ```
    /// use tactile_imaging::pipeline::{BoxedPipeline, LightContact, Object, Press, StagesConfig};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// let light = Box::new(LightContact::from_pairs(&pairs, [50e-6; 2])?);
    /// let stages = BoxedPipeline::from_config(light, Object::sphere(3e-3), &StagesConfig::default())?;
    /// let (reference, frame) = (hertz(0.0), hertz(120.0));
    /// let mut press = Press::new(&stages, reference.view())?;
    /// press.add_frame(frame.view());
    /// assert_eq!(press.stages().settings().object, Object::sphere(3e-3));
    /// let force = press.contact(0)?.and_then(|c| c.force_n).expect("a force");
    /// assert!((force.value / 1.005 - 1.0).abs() < 0.01);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::Sensor`] for a reference without pixels, or too dark for the flat field that was asked for.
    pub fn new(stages: &'a dyn Stages, reference: ArrayView2<'_, u8>) -> Result<Self, PipelineError> {
        Ok(Self::with_reference(stages, Arc::new(reference_frame(stages, &[reference])?)))
    }

    /// Starts a press on a reference made before: its noise is measured once for many presses.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tactile_imaging::force::ReferenceFrame;
    /// use tactile_imaging::pipeline::{Object, Pipeline, Press};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let (empty, frame) = (hertz(0.0), hertz(120.0));
    /// // The mean of several exposures has less noise than one.
    /// let reference = Arc::new(ReferenceFrame::from_frames(&[empty.view(), empty.view(), empty.view()])?);
    /// let mut press = Press::with_reference(&pipeline, reference);
    /// press.add_frame(frame.view());
    /// let radius = press.contact(0)?.expect("a contact").contact_radius_m;
    /// assert!((radius.value / 1e-3 - 1.0).abs() < 0.01);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn with_reference(stages: &'a dyn Stages, reference: Arc<ReferenceFrame>) -> Self {
        Self {
            stages,
            reference,
            frames: Vec::new(),
            twins: Vec::new(),
            force: ForceWorkspace::default(),
            surface: SurfaceWorkspace::default(),
            report: Report::default(),
        }
    }

    /// The same frames on the same reference, of which nothing is computed yet: to time it again.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::pipeline::Stage;
    /// let pipeline = trial.pipeline()?;
    /// let mut press = trial.press(&pipeline)?;
    /// let modulus = press.modulus()?;
    /// let mut again = press.renewed();
    /// assert_eq!((again.frames(), again.report().work(Stage::Contact).runs), (2, 0));
    /// assert_eq!(again.modulus()?, modulus);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn renewed(&self) -> Self {
        let mut press = Self::with_reference(self.stages, Arc::clone(&self.reference));
        for frame in &self.frames {
            press.add_gauged_frame(frame.image, frame.gauge_n);
        }
        press
    }

    /// Adds a frame; returns its number.
    pub fn add_frame(&mut self, image: ArrayView2<'a, u8>) -> usize {
        self.add_gauged_frame(image, None)
    }

    /// Adds a frame with a gauge's reading of the force; returns its number.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{DarkContact, Object, Pipeline, PipelineError};
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// // A sensor that darkens knows depth, not force.
    /// let contact = DarkContact::new(&[(0.0, 0.0), (150.0, 0.5e-3)], [50e-6; 2])?;
    /// let pipeline = Pipeline::new(contact, Object::sphere(3e-3));
    /// let (reference, frame) = (hertz(0.0).mapv(|v| 255 - v), hertz(120.0).mapv(|v| 255 - v));
    /// let mut press = pipeline.press(reference.view())?;
    /// assert_eq!(press.add_gauged_frame(frame.view(), Some(0.9)), 0);
    /// assert_eq!((press.gauge_n(0), press.image(0)), (Some(0.9), Some(frame.view())));
    /// assert!(press.modulus().is_ok());
    /// press.add_frame(frame.view());
    /// assert_eq!(press.modulus().unwrap_err(), PipelineError::NoForce { frame: 1 });
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn add_gauged_frame(&mut self, image: ArrayView2<'a, u8>, gauge_n: Option<f64>) -> usize {
        let index = self.frames.len();
        let equal = |f: &Loaded<'_>| f.gauge_n == gauge_n && f.image == image;
        let skip = self.stages.settings().skips.equal_frames;
        let twin = if skip { self.frames.iter().position(equal) } else { None };
        if twin.is_some() {
            self.report.skipped(Stage::Contact, index, SkipReason::EqualFrame, image.len());
        }
        self.twins.push(twin.unwrap_or(index));
        let (contact, surface, points, matching, strain) = (None, None, None, None, None);
        self.frames.push(Loaded { image, gauge_n, contact, surface, points, matching, strain });
        index
    }

    /// The stages.
    pub fn stages(&self) -> &'a dyn Stages {
        self.stages
    }

    /// The image of a frame.
    pub fn image(&self, frame: usize) -> Option<ArrayView2<'a, u8>> {
        Some(self.frames.get(frame)?.image)
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frames.len()
    }

    /// What was computed and skipped so far.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// The gauge's reading of a frame's force, if there was one.
    pub fn gauge_n(&self, frame: usize) -> Option<f64> {
        self.frames.get(frame)?.gauge_n
    }

    fn twin(&self, frame: usize) -> Result<usize, PipelineError> {
        let frames = self.frames.len();
        self.twins.get(frame).copied().ok_or(PipelineError::NoSuchFrame { frame, frames })
    }

    /// The contact of a frame with its force; `None` where nothing touches.
    ///
    /// # Errors
    /// [`PipelineError::Contact`], [`PipelineError::NoSuchFrame`].
    pub fn contact(&mut self, frame: usize) -> Result<Option<&ContactReading>, PipelineError> {
        let at = self.twin(frame)?;
        if self.frames[at].contact.is_none() {
            let start = Instant::now();
            let mut contact = FrameContact::default();
            let loaded = &self.frames[at];
            self.stages
                .contact()
                .measure(&mut self.force, loaded.image, &self.reference, loaded.gauge_n, &mut contact)
                .map_err(|source| PipelineError::Contact { frame, source })?;
            let pixels = loaded.image.len();
            match contact.region {
                None => self.report.skipped(Stage::Surface, frame, SkipReason::NoContact, pixels),
                Some(region) if self.stages.settings().skips.outside_contact => {
                    let saved = pixels - region.rows() * region.columns();
                    self.report.skipped(Stage::Surface, frame, SkipReason::OutsideContact, saved);
                }
                Some(_) => contact = contact.widened(loaded.image.dim()),
            }
            self.report.ran(Stage::Contact, start.elapsed());
            self.frames[at].contact = Some(contact);
        }
        Ok(self.frames[at].contact.as_ref().and_then(|c| c.reading.as_ref()))
    }

    /// The contact of a frame that must have one.
    fn reading(&mut self, frame: usize) -> Result<ContactReading, PipelineError> {
        self.contact(frame)?.copied().ok_or(PipelineError::NoContact { frame })
    }

    /// The surface of a frame's contact.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// let pipeline = trial.pipeline()?;
    /// let mut press = trial.press(&pipeline)?;
    /// let surface = press.surface(0)?;
    /// let top = surface.surface.heights.iter().copied().filter(|h| h.is_finite()).fold(0.0, f64::max);
    /// // Hertz's pressure read as shading is a hemisphere as high as the contact's radius.
    /// let radius = trial.truth().frames[0].contact_radius_m;
    /// assert!((top / radius - 1.0).abs() < 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoContact`], [`PipelineError::Surface`], and those of [`contact`](Self::contact).
    pub fn surface(&mut self, frame: usize) -> Result<&ContactSurface, PipelineError> {
        self.reading(frame)?;
        self.contact(0)?;
        let at = self.twin(frame)?;
        if self.frames[at].surface.is_none() {
            let start = Instant::now();
            let loaded = &self.frames[at];
            let contact = loaded.contact.as_ref().ok_or(PipelineError::NoContact { frame })?;
            let images = [loaded.image, self.reference.image()];
            // All surfaces have the first one's grid, so that what the grid does to them leaves no strain.
            let first = self.frames[0].contact.as_ref().unwrap_or(contact);
            let pixels = first.mask.iter().filter(|m| **m).count();
            let surface = surface::reconstruct(self.stages, &mut self.surface, images, contact, pixels)
                .map_err(|source| PipelineError::Surface { frame, source })?;
            self.report.ran(Stage::Surface, start.elapsed());
            self.frames[at].surface = Some(surface);
        }
        self.frames[at].surface.as_ref().ok_or(PipelineError::NoContact { frame })
    }

    /// Control points on a frame's surface, in metres from the frame's first pixel.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let mut press = trial.press(&pipeline)?;
    /// let points = press.control_points(0)?;
    /// assert_eq!(points.len(), 60);
    /// // All within the contact, whose middle is the frame's: (86.5, 64.5) pixels.
    /// let radius = 1.1 * trial.truth().frames[0].contact_radius_m;
    /// assert!(points.iter().all(|p| (p.x - 86.5 * 172.4e-6).hypot(p.y - 64.5 * 172.4e-6) < radius));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`surface`](Self::surface).
    pub fn control_points(&mut self, frame: usize) -> Result<&[Point3<f64>], PipelineError> {
        self.surface(frame)?;
        let at = self.twin(frame)?;
        if self.frames[at].points.is_none() {
            let start = Instant::now();
            let surface = self.frames[at].surface.as_ref().ok_or(PipelineError::NoContact { frame })?;
            let points = surface::sample(self.stages, surface)
                .map_err(|source| PipelineError::Surface { frame, source })?;
            self.report.ran(Stage::ControlPoints, start.elapsed());
            self.frames[at].points = Some(points);
        }
        Ok(self.frames[at].points.as_deref().unwrap_or_default())
    }

    /// The matches of the first frame's control points to those of a later frame.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let mut press = trial.press(&pipeline)?;
    /// let matching = press.matching(1)?;
    /// let partners: Vec<_> = matching.assignment.iter().flatten().copied().collect();
    /// assert!(partners.len() > 50);
    /// assert_eq!(matching.warped.len(), 60, "where the first frame's points have gone");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::Match`] and those of [`control_points`](Self::control_points).
    pub fn matching(&mut self, frame: usize) -> Result<&Matching<f64, 3>, PipelineError> {
        self.control_points(0)?;
        self.control_points(frame)?;
        let at = self.twin(frame)?;
        if self.frames[at].matching.is_none() {
            let start = Instant::now();
            let points = |i: usize| self.frames[i].points.as_deref().unwrap_or_default();
            let matching = pair::match_points(self.stages, [0, frame], points(0), points(at))?;
            self.report.ran(Stage::Match, start.elapsed());
            self.frames[at].matching = Some(matching);
        }
        self.frames[at].matching.as_ref().ok_or(PipelineError::NoContact { frame })
    }

    /// The strain between the first frame and a later one.
    ///
    /// # Errors
    /// [`PipelineError::TooFewMatches`], [`PipelineError::Warp`], [`PipelineError::Strain`] and those of
    /// [`matching`](Self::matching).
    pub fn strain(&mut self, frame: usize) -> Result<&PairStrain, PipelineError> {
        self.matching(frame)?;
        let at = self.twin(frame)?;
        if self.frames[at].strain.is_none() {
            let start = Instant::now();
            let points = |i: usize| self.frames[i].points.as_deref().unwrap_or_default();
            let matching = self.frames[at].matching.as_ref().ok_or(PipelineError::NoContact { frame })?;
            let grid_m =
                self.frames[at].surface.as_ref().map_or(0.0, |s| s.pixel_size_m[0].max(s.pixel_size_m[1]));
            let strain = pair::strain(self.stages, [0, frame], points(0), points(at), matching, grid_m)?;
            self.report.ran(Stage::Strain, start.elapsed());
            self.frames[at].strain = Some(strain);
        }
        self.frames[at].strain.as_ref().ok_or(PipelineError::NoContact { frame })
    }

    /// Young's modulus by the estimator of the settings: unless another was chosen, the one that fits the object best. For a
    /// ball that takes the contacts alone: no surface is reconstructed.
    ///
    /// # Errors
    /// [`PipelineError::Modulus`], [`PipelineError::NoForce`], and those of the stages it needs.
    pub fn modulus(&mut self) -> Result<ModulusEstimate<f64>, PipelineError> {
        let with_strain = self.stages.settings().needs_strain();
        let (loads, shared) = self.loads(with_strain)?;
        let start = Instant::now();
        let estimate = chosen_estimate(self.stages.settings(), &loads, shared);
        self.report.ran(Stage::Modulus, start.elapsed());
        estimate
    }

    /// What every frame says of its load, with the strain since the first: what an estimator of your own needs
    /// ([`ModulusEstimator`](crate::elasticity::modulus::ModulusEstimator)).
    ///
    /// ```
    /// # use tactile_imaging::pipeline::Trial;
    /// # use tactile_imaging::simulate::{CalibrationOptions, Camera, PressOptions};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// # let pipeline = trial.pipeline()?;
    /// let loads = trial.press(&pipeline)?.load_states()?;
    /// assert!((loads[1].force_n.value - 1.2).abs() < 0.01);
    /// assert!(loads[0].mean_strain.is_none() && loads[1].mean_strain.is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoForce`], and those of the contacts and of [`strain`](Self::strain).
    pub fn load_states(&mut self) -> Result<Vec<LoadState<f64>>, PipelineError> {
        Ok(self.loads(true)?.0)
    }

    /// Young's modulus by every estimator that the frames allow, the paper's ratio first.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::elasticity::modulus::EstimatorKind;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let mut press = trial.press(&pipeline)?;
    /// let estimates = press.estimates()?;
    /// assert_eq!(estimates[0].estimator, EstimatorKind::PaperRatio, "stress over strain");
    /// let best = press.modulus()?;
    /// assert!(estimates.contains(&best) && best.estimator == EstimatorKind::HertzSphere);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of the contacts; what an estimator cannot do is left out.
    pub fn estimates(&mut self) -> Result<Vec<ModulusEstimate<f64>>, PipelineError> {
        let (loads, shared) = match self.loads(true) {
            Ok(loads) => loads,
            Err(_) => self.loads(false)?,
        };
        let start = Instant::now();
        let settings = self.stages.settings();
        let estimates = all_estimates(&settings.object, settings.waveguide.as_ref(), &loads, shared);
        self.report.ran(Stage::Modulus, start.elapsed());
        Ok(estimates)
    }

    /// What every frame says of its load, and the relative errors that all share.
    fn loads(&mut self, with_strain: bool) -> Result<(Vec<LoadState<f64>>, SharedErrors), PipelineError> {
        let mut readings = Vec::with_capacity(self.frames.len());
        let mut depths = Vec::with_capacity(self.frames.len());
        let size = self.stages.contact().pixel_size_m();
        for frame in 0..self.frames.len() {
            let reading = self.reading(frame)?;
            let force = reading.force_n.ok_or(PipelineError::NoForce { frame })?;
            let a = reading.contact_radius_m;
            readings.push(LoadReading {
                force_n: force.value,
                noise_n: reading.force_noise_n,
                calibration_n: reading.force_calibration_n,
                radius_m: radius_with_floor(a.value, a.standard_error, size),
            });
            depths.push(reading.indentation_m);
        }
        let (mut loads, shared) = split_errors(readings.iter().copied(), self.stages.settings());
        for (load, depth) in loads.iter_mut().zip(depths) {
            load.indentation_m = depth.map(|d| Estimate::new(d.value, d.standard_error));
        }
        for frame in 1..if with_strain { loads.len() } else { 0 } {
            if self.twins[frame] != 0 {
                let step = readings[frame].force_n - readings[0].force_n;
                let summary = &self.strain(frame)?.summary;
                // (31) takes the strain's size; its sign says whether the load rose.
                let value = summary.mean[(2, 2)].abs().copysign(step);
                loads[frame].mean_strain = Some(Estimate::new(value, summary.standard_error[(2, 2)]));
            }
        }
        Ok((loads, shared))
    }
}
