//! Charts that tell a lasting change from noise.

use super::FrameCondition;
use super::cusum::Cusum;
use crate::error::ForceError;
use tactile_core::Requirement;

/// What counts as a change, and how often a healthy sensor may be suspected.
///
/// ```
/// use tactile_force::HealthOptions;
///
/// let strict = HealthOptions::default()
///     .with_brightness_change(0.01)?
///     .with_noise_change(0.1)?
///     .with_false_alarm_interval(100_000.0)?
///     .with_baseline_frames(800)?;
/// assert!(strict.with_brightness_change(f64::NAN).is_err());
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HealthOptions {
    brightness_change: f64,
    noise_change: f64,
    false_alarm_interval: f64,
    baseline_frames: usize,
}

impl Default for HealthOptions {
    /// A change of brightness by 2 % or of noise by 20 %, one false alarm in 40 000 frames, a baseline of 400 frames.
    fn default() -> Self {
        Self {
            brightness_change: 0.02,
            noise_change: 0.2,
            // Half as often as one in 20 000: the baseline's own scatter takes the rest.
            false_alarm_interval: 40_000.0,
            // Five seconds at 80 frames a second; a mean known to a twentieth of a frame's scatter.
            baseline_frames: 400,
        }
    }
}

impl HealthOptions {
    /// Looks for this relative change of brightness.
    ///
    /// # Errors
    /// A change that is not above zero and below one.
    pub fn with_brightness_change(mut self, share: f64) -> Result<Self, ForceError> {
        self.brightness_change = Requirement::OpenUnitInterval.check("brightness_change", share)?;
        Ok(self)
    }

    /// Looks for this relative change of the noise's standard deviation.
    ///
    /// # Errors
    /// A change that is not above zero and below one.
    pub fn with_noise_change(mut self, share: f64) -> Result<Self, ForceError> {
        self.noise_change = Requirement::OpenUnitInterval.check("noise_change", share)?;
        Ok(self)
    }

    /// Allows one false alarm in this number of frames, all charts together.
    ///
    /// # Errors
    /// Fewer than one frame, or not finite.
    pub fn with_false_alarm_interval(mut self, frames: f64) -> Result<Self, ForceError> {
        self.false_alarm_interval =
            Requirement::AtLeastOne.check("false_alarm_interval", frames)?;
        Ok(self)
    }

    /// Learns mean and scatter of a healthy sensor from this number of frames.
    ///
    /// # Errors
    /// Fewer than ten frames.
    pub fn with_baseline_frames(mut self, frames: usize) -> Result<Self, ForceError> {
        Requirement::NonNegative.check("baseline_frames", frames as f64 - 10.0)?;
        self.baseline_frames = frames;
        Ok(self)
    }
}

/// The state of one chart.
///
/// ```
/// use tactile_force::{Estimate, FrameCondition, HealthMonitor, HealthOptions, ChartState};
///
/// let mut monitor = HealthMonitor::new(HealthOptions::default());
/// let brightness = Estimate::new(1.0, 1e-3);
/// let report = monitor.update(&FrameCondition { brightness, background_grey: 40.0, noise_ratio: 1.0 });
/// assert_eq!(report.brightness, ChartState::Learning);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ChartState {
    /// The baseline is not complete.
    Learning,
    /// No lasting change.
    Healthy,
    /// The mean has changed.
    Changed,
    /// Frames scatter so much that a change as small as asked for would take this number of frames to find, more than fifty.
    Insensitive {
        /// Mean number of frames until the change would be found.
        delay_frames: f64,
    },
}

/// The charts after a frame.
///
/// ```
/// use tactile_force::{ChartState, HealthReport};
///
/// let report = HealthReport { brightness: ChartState::Changed, noise: ChartState::Healthy, background_grey: 41.0 };
/// assert!(report.has_changed());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct HealthReport {
    /// Gain of camera and illumination, by the background's brightness.
    pub brightness: ChartState,
    /// Noise of the camera.
    pub noise: ChartState,
    /// Background of the frame in grey levels.
    pub background_grey: f64,
}

impl HealthReport {
    /// Whether any chart is in alarm.
    pub fn has_changed(&self) -> bool {
        self.brightness == ChartState::Changed || self.noise == ChartState::Changed
    }
}

/// Follows a sensor's condition and tells lasting changes from noise: two cumulative-sum charts, after a baseline of healthy frames.
///
/// Thresholds come from Siegmund's approximation of the run length. With frames whose brightness scatters by 0.5 %, a change
/// of 2 % is found in 5 frames on average; where it scatters by 2.9 % (±5 % from frame to frame) in some 45. O(1) a frame.
///
/// The background shows the product of illumination and camera gain, so a change of either is seen; light that leaks from
/// contacts can also change on its own, which only a known load shows.
///
/// ```
/// use tactile_force::{ChartState, Estimate, FrameCondition, HealthMonitor, HealthOptions};
///
/// let mut monitor = HealthMonitor::new(HealthOptions::default());
/// let mut frame = |k: u32, gain: f64| {
///     let flicker = 0.004 * (f64::from(k) * 2.3).sin();
///     monitor.update(&FrameCondition {
///         brightness: Estimate::new(gain * (1.0 + flicker), 1e-4),
///         background_grey: 40.0,
///         noise_ratio: 1.0 + 0.02 * (f64::from(k) * 1.7).sin(),
///     })
/// };
/// assert!((0..1000).all(|k| !frame(k, 1.0).has_changed()));
/// // The camera's gain rises by 2 %.
/// let found = (1000..1050).find(|k| frame(*k, 1.02).has_changed()).expect("within 50 frames");
/// assert!(found < 1010);
/// ```
#[derive(Clone, Debug)]
pub struct HealthMonitor {
    options: HealthOptions,
    brightness: Chart,
    noise: Chart,
}

impl HealthMonitor {
    /// A monitor that starts with its baseline.
    pub fn new(options: HealthOptions) -> Self {
        Self {
            options,
            brightness: Chart::default(),
            noise: Chart::default(),
        }
    }

    /// Takes the condition of the next frame.
    pub fn update(&mut self, condition: &FrameCondition) -> HealthReport {
        let o = &self.options;
        // The charts share the false alarms.
        let interval = 2.0 * o.false_alarm_interval;
        let chart = |chart: &mut Chart, value: f64, change: f64| {
            chart.update(value, change, interval, o.baseline_frames)
        };
        HealthReport {
            brightness: chart(
                &mut self.brightness,
                condition.brightness.value,
                o.brightness_change,
            ),
            noise: chart(&mut self.noise, condition.noise_ratio, o.noise_change),
            background_grey: condition.background_grey,
        }
    }
}

/// A quantity's baseline, then its chart.
#[derive(Clone, Debug, Default)]
struct Chart {
    count: usize,
    mean: f64,
    /// Sum of squared distances from the mean.
    squares: f64,
    cusum: Option<Cusum>,
}

impl Chart {
    fn update(&mut self, value: f64, change: f64, interval: f64, baseline: usize) -> ChartState {
        if self.count < baseline {
            // Welford's running mean and variance.
            self.count += 1;
            let before = value - self.mean;
            self.mean += before / self.count as f64;
            self.squares += before * (value - self.mean);
            return ChartState::Learning;
        }
        let count = self.count as f64;
        // A quantity that never moved has the resolution of the change sought, not none.
        let sd = (self.squares / (count - 1.0))
            .sqrt()
            .max(0.01 * change * self.mean.abs());
        let shift = change * self.mean.abs() / sd;
        let cusum = self
            .cusum
            .get_or_insert_with(|| Cusum::new(shift, interval, count.sqrt().recip()));
        let delay_frames = cusum.delay(shift);
        if cusum.update((value - self.mean) / sd) {
            ChartState::Changed
        } else if delay_frames > 50.0 {
            ChartState::Insensitive { delay_frames }
        } else {
            ChartState::Healthy
        }
    }
}
