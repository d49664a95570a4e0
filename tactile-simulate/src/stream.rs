//! Frames of loading–unloading cycles at camera rate.

use crate::error::{SimulateError, finite, not_negative, positive, within};
use crate::light::Illumination;
use crate::press::{PressLoad, PressOptions, PressScene, PressTruth};
use ndarray::Array2;
use std::f64::consts::PI;
use tactile_imaging::pipeline::FrameSource;

/// Load as a function of time: rest, then cycles of F(t) = F_max sin²(πt/T).
///
/// ```
/// use tactile_simulate::{Camera, LoadCycle, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let scene = PressScene::new(PressOptions {
///     camera,
///     ..PressOptions::default()
/// })?;
/// let cycle = LoadCycle {
///     cycles: 2,
///     rest_s: 0.5,
///     light_drift_per_s: 0.01,
///     ..LoadCycle::default()
/// };
/// let stream = scene.stream(cycle)?;
/// assert_eq!(stream.len(), 200, "2.5 s at 80 frames per second");
/// let forces: Vec<_> = stream.map(|f| f.truth.contact.force_n).collect();
/// assert!(
///     forces[..40].iter().all(|&n| n == 0.0) && (forces[80] - 1.2).abs() < 1e-12,
///     "half a period after the rest"
/// );
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoadCycle {
    /// Largest force F_max in newtons.
    pub largest_force_n: f64,
    /// Largest shear force (x, y) in newtons. It is proportional to the normal force.
    pub largest_shear_n: [f64; 2],
    /// Time T of one cycle in seconds.
    pub period_s: f64,
    /// Number of cycles.
    pub cycles: usize,
    /// Time without contact before the first cycle, in seconds.
    pub rest_s: f64,
    /// Frames per second.
    pub frame_rate_hz: f64,
    /// Relative change of the brightness per second.
    pub light_drift_per_s: f64,
    /// Change per second of the tilt (x, y) of the illumination, see [`Illumination::tilt`].
    pub light_tilt_per_s: [f64; 2],
}

impl Default for LoadCycle {
    /// One cycle of one second up to 1.2 N after a tenth of a second of rest, at the paper's 80
    /// frames per second.
    fn default() -> Self {
        Self {
            largest_force_n: 1.2,
            largest_shear_n: [0.0; 2],
            period_s: 1.0,
            cycles: 1,
            rest_s: 0.1,
            frame_rate_hz: 80.0,
            light_drift_per_s: 0.0,
            light_tilt_per_s: [0.0; 2],
        }
    }
}

/// One frame of a stream.
///
/// ```
/// use tactile_simulate::{Camera, LoadCycle, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// let cycle = LoadCycle { rest_s: 0.0, frame_rate_hz: 8.0, ..LoadCycle::default() };
/// let frames: Vec<_> = scene.stream(cycle)?.collect();
/// assert_eq!((frames[4].time_s, frames[4].frame.dim()), (0.5, (65, 87)));
/// assert!(
///     frames
///         .windows(2)
///         .take(4)
///         .all(|f| f[0].truth.contact.force_n < f[1].truth.contact.force_n)
/// );
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct StreamedFrame {
    /// Time of the frame in seconds.
    pub time_s: f64,
    /// The frame.
    pub frame: Array2<u8>,
    /// Truth of the frame.
    pub truth: PressTruth,
}

/// Iterator over the frames of a [`LoadCycle`], generated one by one.
///
/// ```
/// use tactile_simulate::{Camera, LoadCycle, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// let mut stream = scene.stream(LoadCycle { frame_rate_hz: 10.0, ..LoadCycle::default() })?;
/// assert_eq!(stream.len(), 11);
/// let first = stream.next().map(|f| f.truth.contact.force_n);
/// assert_eq!((first, stream.len()), (Some(0.0), 10), "at rest; made one by one");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct FrameStream {
    scene: PressScene,
    cycle: LoadCycle,
    next: usize,
    count: usize,
}

impl PressScene {
    /// The frames of `cycle` with the object, sensor, light and gain of this scene (its own loads
    /// only determine the gain).
    ///
    /// ```
    /// use tactile_simulate::{Camera, LoadCycle, PressOptions, PressScene};
    /// let camera = Camera::default().coarser(16);
    /// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
    /// let cycle = LoadCycle { rest_s: 0.0, frame_rate_hz: 8.0, ..LoadCycle::default() };
    /// let forces = scene.stream(cycle)?.map(|f| f.truth.contact.force_n);
    /// let largest = forces.fold(0.0, f64::max);
    /// assert!((largest - 1.2).abs() < 1e-12, "half-way through the cycle");
    /// assert!(scene.stream(LoadCycle { period_s: 0.0, ..cycle }).is_err());
    /// # Ok::<(), tactile_simulate::SimulateError>(())
    /// ```
    ///
    /// # Errors
    /// [`SimulateError::OutOfRange`] for an invalid cycle.
    pub fn stream(&self, cycle: LoadCycle) -> Result<FrameStream, SimulateError> {
        let options = self.options();
        within(
            "largest_force_n",
            cycle.largest_force_n,
            0.0,
            (options.law).largest_force_n(&options.object, &options.waveguide)?,
        )?;
        positive("period_s", cycle.period_s)?;
        not_negative("rest_s", cycle.rest_s)?;
        positive("frame_rate_hz", cycle.frame_rate_hz)?;
        finite("light_drift_per_s", cycle.light_drift_per_s)?;
        for k in 0..2 {
            finite("largest_shear_n", cycle.largest_shear_n[k])?;
            finite("light_tilt_per_s", cycle.light_tilt_per_s[k])?;
        }
        let frames = (cycle.rest_s + cycle.period_s * cycle.cycles as f64) * cycle.frame_rate_hz;
        within("frames", frames, 0.0, 1e9)?;
        Ok(FrameStream {
            scene: self.clone(),
            cycle,
            next: 0,
            count: frames.ceil() as usize,
        })
    }
}

impl FrameStream {
    /// Load and illumination at a time.
    fn load_at(&self, time_s: f64) -> PressLoad {
        let c = &self.cycle;
        let phase = ((time_s - c.rest_s) / c.period_s).max(0.0);
        // The rate of loading is 0 at the start and the end of a cycle, so that cycles join
        // smoothly.
        let share = (PI * phase).sin().powi(2);
        let level = (1.0 + c.light_drift_per_s * time_s).max(0.0);
        let tilt = c.light_tilt_per_s.map(|rate| rate * time_s);
        PressLoad {
            force_n: c.largest_force_n * share,
            shear_n: c.largest_shear_n.map(|s| s * share),
            illumination: Illumination { level, tilt },
        }
    }
}

impl Iterator for FrameStream {
    type Item = StreamedFrame;

    fn next(&mut self) -> Option<StreamedFrame> {
        if self.next == self.count {
            return None;
        }
        let k = self.next;
        self.next += 1;
        let time_s = k as f64 / self.cycle.frame_rate_hz;
        let load = self.load_at(time_s);
        let PressOptions { object, law, .. } = self.scene.options();
        let scene = self.scene.with_object(*object, law.clone(), vec![load]);
        let scene = scene.ok()?;
        let light = scene.expected_frame(0);
        let camera = scene.options().camera;
        // Above the frame numbers of a scene itself, which are below 2⁴⁷.
        let frame = camera.expose(light.view(), scene.options().seed, 1 << 47 | k as u64);
        Some(StreamedFrame {
            time_s,
            frame,
            truth: scene.truth(0),
        })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.count - self.next;
        (left, Some(left))
    }
}

impl ExactSizeIterator for FrameStream {}

impl FrameSource for FrameStream {
    type Error = std::convert::Infallible;

    fn next_frame(&mut self, frame: &mut Array2<u8>) -> Result<Option<f64>, Self::Error> {
        Ok(self.next().map(|streamed| {
            *frame = streamed.frame;
            streamed.time_s
        }))
    }
}
