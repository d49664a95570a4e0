//! A press: frames at one or more loads, of which nothing is computed before it is asked for.
mod frame_image;
mod measure;
mod modulus;
mod results;
mod time;

use super::composition::Pipeline;
use super::contact::FrameContact;
use super::error::PipelineError;
use super::pair::PairStrain;
use super::report::{Report, SkipReason, Stage};
use super::runner::{SkipRecords, StageRunner};
use super::surface::{ContactSurface, ControlPoints};
use crate::force::{Estimate, ReferenceFrame};
use crate::matching::Matching;
use frame_image::{FrameImage, fingerprint};
use ndarray::{Array2, ArrayView2};
use ndarray::{CowArray, Ix2};
use std::collections::HashMap;
use std::sync::Arc;

/// A frame and what is known of it so far.
struct Loaded<'a> {
    image: FrameImage<'a>,
    gauge: Option<Estimate>,
    /// Seconds since the object touched, where they are known.
    time_s: Option<f64>,
    // Boxed, so that thousands of frames, whose strain nobody asks for, take no room for it.
    contact: Option<Box<KnownContact>>,
    surface: Option<Box<ContactSurface>>,
    points: Option<ControlPoints>,
    matching: Option<Box<Matching<3>>>,
    strain: Option<Box<PairStrain>>,
}

/// The contact of a frame, and what is known of its image.
struct KnownContact {
    /// Without its mask where the image is read on demand: nothing as large as an image is kept of such a frame.
    contact: FrameContact,
    /// Number of the contact's pixels.
    pixels: usize,
    /// The median of frame minus reference outside the contact, of an image that is read on demand.
    light_step_grey: Option<i32>,
}

/// Frames at one or more loads. Every result is computed when it is first asked for, with what it needs and nothing else,
/// and kept. Matches, displacements and strains are from the first frame to a later one.
///
/// Made by [`Pipeline::press`].
///
/// ```
/// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
/// # let camera = Camera::default().coarser(8);
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
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
    runner: StageRunner,
    frames: Vec<Loaded<'a>>,
    /// The frame that a frame equals: itself, or the first equal one before it.
    twins: Vec<usize>,
    /// Frames that may be equal, by a hash of some of their pixels.
    by_fingerprint: HashMap<u64, Vec<usize>>,
}

impl Pipeline {
    /// Starts a press: add frames, then ask for what you want. The press holds a clone of the pipeline.
    ///
    /// # Errors
    /// [`PipelineError::Sensor`] for a reference without pixels, or too dark for the flat field that was asked for.
    pub fn press<'a>(&self, reference: ArrayView2<'_, u8>) -> Result<Press<'a>, PipelineError> {
        Ok(self.press_on(Arc::new(self.reference_frame(&[reference])?)))
    }

    /// Starts a press on a reference made before: its noise is measured once for many presses.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tactile_imaging::{Object, Pipeline, force::ReferenceFrame};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let reference = Arc::new(ReferenceFrame::new(hertz(0.0).view())?);
    /// for (peak, newton) in [(60.0, 0.503), (120.0, 1.005)] {
    ///     let frame = hertz(peak);
    ///     let mut press = pipeline.press_on(Arc::clone(&reference));
    ///     press.add_frame(frame.view());
    ///     let force = press.contact(0)?.and_then(|c| c.force_n).expect("a force");
    ///     assert!((force.value / newton - 1.0).abs() < 0.01);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn press_on<'a>(&self, reference: Arc<ReferenceFrame>) -> Press<'a> {
        Press {
            runner: StageRunner::new(self.clone(), reference, SkipRecords::EachFrame),
            frames: Vec::new(),
            twins: Vec::new(),
            by_fingerprint: HashMap::new(),
        }
    }
}

impl<'a> Press<'a> {
    /// The same frames on the same reference, of which nothing is computed yet: to time it again.
    #[must_use]
    pub fn renewed(&self) -> Self {
        let reference = Arc::clone(self.runner.reference());
        let mut press = self.pipeline().press_on(reference);
        for (index, frame) in self.frames.iter().enumerate() {
            press.push(frame.image.clone(), frame.gauge, self.twins[index]);
            press.frames[index].time_s = frame.time_s;
        }
        press.by_fingerprint.clone_from(&self.by_fingerprint);
        press
    }

    /// Adds a frame; returns its number.
    pub fn add_frame(&mut self, image: ArrayView2<'a, u8>) -> usize {
        self.add_gauged_frame(image, None)
    }

    /// Adds a frame with a gauge's reading of the force in newtons (standard error 0: exact but for
    /// [`Settings::force_scale_error`](super::Settings::force_scale_error)); returns its number.
    ///
    /// ```
    /// use tactile_imaging::force::Estimate;
    /// use tactile_imaging::pipeline::{DarkContact, Object, Pipeline, PipelineError};
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// // A sensor that darkens knows depth, not force.
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
        image: ArrayView2<'a, u8>,
        gauge: Option<Estimate>,
    ) -> usize {
        let frame = FrameImage::Lent(image);
        let twin = self.twin_of(&frame, fingerprint(image), gauge);
        self.push(frame, gauge, twin)
    }

    /// Adds a frame that is read whenever a stage needs it and never kept, for more frames than memory takes; returns its
    /// number. `image` is what `read` gives; an error of `read` is a sentence and becomes
    /// [`PipelineError::Unreadable`].
    ///
    /// ```
    /// use tactile_imaging::{Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let mut press = pipeline.press(hertz(0.0).view())?;
    /// for peak in [60.0, 120.0] {
    ///     // In earnest: of a file.
    ///     let read = move || Ok(hertz(peak));
    ///     press.add_frame_on_demand(hertz(peak).view(), None, read);
    /// }
    /// assert!(press.contact(1)?.is_some());
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn add_frame_on_demand(
        &mut self,
        image: ArrayView2<'_, u8>,
        gauge: Option<Estimate>,
        read: impl Fn() -> Result<Array2<u8>, String> + Send + Sync + 'static,
    ) -> usize {
        let frame = FrameImage::on_demand(image, Arc::new(read));
        let twin = self.twin_of(&frame, fingerprint(image), gauge);
        self.push(frame, gauge, twin)
    }

    /// The frame that a new one equals: an earlier one, or itself.
    fn twin_of(
        &mut self,
        image: &FrameImage<'a>,
        fingerprint: u64,
        gauge: Option<Estimate>,
    ) -> usize {
        let index = self.frames.len();
        let equal = |&&at: &&usize| {
            let earlier = &self.frames[at];
            earlier.gauge == gauge && earlier.image.equals(image)
        };
        let alike = self.by_fingerprint.entry(fingerprint).or_default();
        let twin = alike.iter().find(equal).copied();
        twin.unwrap_or_else(|| {
            alike.push(index);
            index
        })
    }

    fn push(&mut self, image: FrameImage<'a>, gauge: Option<Estimate>, twin: usize) -> usize {
        let index = self.frames.len();
        if twin != index && self.pipeline().settings().skips.equal_frames {
            let pixels = self.runner.reference().image().len();
            self.runner
                .skip(Stage::Contact, index, SkipReason::EqualFrame, pixels);
        }
        self.twins.push(twin);
        self.frames.push(Loaded {
            image,
            gauge,
            time_s: None,
            contact: None,
            surface: None,
            points: None,
            matching: None,
            strain: None,
        });
        index
    }

    /// The pipeline.
    pub fn pipeline(&self) -> &Pipeline {
        self.runner.pipeline()
    }

    /// The image of a frame.
    pub fn image(&self, frame: usize) -> Result<CowArray<'a, u8, Ix2>, PipelineError> {
        let frames = self.frames.len();
        let loaded = self.frames.get(frame);
        let loaded = loaded.ok_or(PipelineError::NoSuchFrame { frame, frames })?;
        loaded.image.get(frame)
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frames.len()
    }

    /// What was computed and skipped so far.
    pub fn report(&self) -> &Report {
        self.runner.report()
    }

    /// The gauge's reading of a frame's force, if there was one.
    pub fn gauge(&self, frame: usize) -> Option<Estimate> {
        self.frames.get(frame)?.gauge
    }

    /// The frame whose results a frame shares: itself, or an equal one before it.
    fn twin(&self, frame: usize) -> Result<usize, PipelineError> {
        let frames = self.frames.len();
        let twin = self.twins.get(frame);
        let twin = *twin.ok_or(PipelineError::NoSuchFrame { frame, frames })?;
        let share = self.pipeline().settings().skips.equal_frames;
        Ok(if share { twin } else { frame })
    }

    /// Whether a frame equals an earlier one, bit for bit: what it says has been said.
    fn is_repeated(&self, frame: usize) -> bool {
        self.twins[frame] != frame
    }
}
