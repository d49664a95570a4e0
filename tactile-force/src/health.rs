//! Sensor health: brightness, noise and dead pixels against what they were when the sensor was
//! calibrated.

use ndarray::{Array2, ArrayView2};
use tactile_core::{Estimate, InvalidOption};

use crate::drift::{DriftCorrection, FitWorkspace, fit, median};
use crate::error::ForceError;
use crate::frame::TileSum;

/// The state of a sensor as one frame shows it outside the contact.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{
///     ContactDetector, ContactOptions, Detection, DetectorWorkspace, ReferenceFrame,
/// };
///
/// let reference = ReferenceFrame::new(Array2::from_elem((160, 160), 50_u8).view())?;
/// let frame = Array2::from_elem((160, 160), 51_u8);
/// let mut workspace = DetectorWorkspace::default();
/// let _: Detection = ContactDetector::new(ContactOptions::default()).detect_with(
///     &mut workspace,
///     frame.view(),
///     &reference,
/// )?;
/// let condition = workspace
///     .condition(&reference)
///     .expect("a frame of that size");
/// assert!((condition.brightness.value - 1.02).abs() < 1e-9);
/// assert!((condition.background_grey - 51.0).abs() < 1e-9);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FrameCondition {
    /// Background relative to the reference's: illumination times the camera's gain.
    pub brightness: Estimate,
    /// Mean grey level of the background.
    pub background_grey: f64,
    /// Scatter of the background over what the reference's noise explains, as a ratio of standard
    /// deviations.
    pub noise_ratio: f64,
}

impl FrameCondition {
    /// Every how many of `tiles`, in rows of `columns`, are looked at. No divisor in common with
    /// the columns: else whole columns would never be looked at.
    pub(crate) fn tile_step(tiles: usize, columns: usize) -> usize {
        // Tiles that a condition is read from. The ratio of noise, a median, is known from these to
        // 3 %, where charts look for 20 %, and the brightness to a hundredth of what they look for.
        // All 5,764 tiles of a frame of 1392 × 1042 pixels take five times as long, a fifth of the
        // time that contact and force take (`cargo bench -p tactile-benches --bench pipeline`, a
        // frame without contact).
        let least = tiles.div_ceil(1500).max(1);
        let shares_none = |step: &usize| greatest_common_divisor(*step, columns) == 1;
        (least..).find(shares_none).unwrap_or(least)
    }

    /// From the tiles of a frame of the given size. `sd` is the noise of one pixel's difference.
    /// `None` without background.
    pub(crate) fn of(
        size: (usize, usize),
        tiles: impl Iterator<Item = TileSum>,
        sd: f64,
        workspace: &mut FitWorkspace,
    ) -> Option<Self> {
        let drift = fit(DriftCorrection::Illumination, size, tiles, sd, workspace);
        let FitWorkspace {
            tiles,
            values,
            scratch,
            ..
        } = workspace;
        let (mut grey, mut pixels) = (0.0, 0.0);
        values.clear();
        // Nearly all tiles have the same number of pixels.
        let (mut number, mut noise) = (1.0, sd);
        for tile in tiles.iter() {
            if tile.pixels != number {
                (number, noise) = (tile.pixels, sd * tile.pixels.sqrt());
            }
            let residual = drift.residual(tile) / noise;
            // Within five standard deviations of the fitted brightness it is background.
            if residual.abs() < 5.0 {
                values.push(residual.abs());
                grey += tile.reference + tile.difference;
                pixels += tile.pixels;
            }
        }
        if pixels == 0.0 || values.is_empty() {
            return None;
        }
        Some(Self {
            brightness: Estimate::new(drift.coefficients[0], drift.standard_error),
            background_grey: grey / pixels,
            // The median of |z| of a normal sample is 0.6745.
            noise_ratio: median(values, scratch) / 0.674_489_750_196_081_7,
        })
    }
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 {
        a
    } else {
        greatest_common_divisor(b, a % b)
    }
}

/// From how many frames the healthy sensor is learned. Looked for are a change of brightness by 2 %
/// and one of noise by 20 %, with one false alarm in 40 000 frames.
///
/// ```
/// use tactile_force::HealthOptions;
///
/// let patient = HealthOptions::default().with_baseline_frames(800)?;
/// assert!(patient.with_baseline_frames(9).is_err());
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HealthOptions {
    baseline_frames: usize,
}

impl Default for HealthOptions {
    /// A baseline of 400 frames.
    fn default() -> Self {
        Self {
            // Five seconds at 80 frames a second. A mean known to a twentieth of a frame's scatter.
            baseline_frames: 400,
        }
    }
}

impl HealthOptions {
    /// Learns mean and scatter of a healthy sensor from this number of frames.
    ///
    /// # Errors
    /// Fewer than ten frames.
    pub fn with_baseline_frames(mut self, frames: usize) -> Result<Self, ForceError> {
        if frames < 10 {
            let found = frames as f64;
            return Err(InvalidOption::new("baseline_frames", found, "at least ten frames").into());
        }
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
/// let report = monitor.update(&FrameCondition {
///     brightness,
///     background_grey: 40.0,
///     noise_ratio: 1.0,
/// });
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
    /// Frames scatter so much that a change as small as asked for would take this number of frames
    /// to find, more than fifty.
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
/// let report = HealthReport {
///     brightness: ChartState::Changed,
///     noise: ChartState::Healthy,
///     background_grey: 41.0,
/// };
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

/// Follows a sensor's condition and separates lasting changes from noise: two cumulative-sum
/// charts, after a baseline of healthy frames.
///
/// Thresholds come from Siegmund's approximation of the run length. With frames whose brightness
/// scatters by 0.5 %, a change of 2 % is found in 5 frames on average. Where it scatters by 2.9 %
/// (±5 % from frame to frame) in some 45. O(1) a frame.
///
/// The background shows the product of illumination and camera gain, so a change of either shows.
/// Light that leaks from contacts can also change on its own, which only a known load shows.
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
        let baseline = self.options.baseline_frames;
        HealthReport {
            brightness: self
                .brightness
                .update(condition.brightness.value, 0.02, baseline),
            noise: self.noise.update(condition.noise_ratio, 0.2, baseline),
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

/// Frames from one false alarm of a chart to the next, on average. Both charts together raise one
/// in 40 000, half as often as one in 20 000: the baseline's own scatter takes the rest.
const INTERVAL: f64 = 80_000.0;

impl Chart {
    /// Looks for a relative `change` of the mean.
    fn update(&mut self, value: f64, change: f64, baseline: usize) -> ChartState {
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
        // The change that is looked for, in standard deviations of one frame.
        let shift = change * self.mean.abs() / sd;
        let cusum = self
            .cusum
            .get_or_insert_with(|| Cusum::new(shift, INTERVAL, count.sqrt().recip()));
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

/// Standard scores beyond this count as this: one odd frame is no drift.
const CLIP: f64 = 4.0;

/// A two-sided cumulative-sum chart (E. S. Page, Biometrika 41 (1954) 100–115) of standard scores
/// z: S⁺ ← max(0, S⁺ + z − k), S⁻ ← max(0, S⁻ − z − k), alarm at S > h. It is the likelihood-ratio
/// test of a shift by 2k.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cusum {
    allowance: f64,
    threshold: f64,
    above: f64,
    below: f64,
}

impl Cusum {
    /// A chart for a shift of `shift` standard deviations with one false alarm in `interval` frames
    /// on average, where the mean is known to `mean_error` standard deviations.
    fn new(shift: f64, interval: f64, mean_error: f64) -> Self {
        // Half the shift is optimal. Beyond 2 standard deviations one or two frames show it anyway,
        // and the approximation of the threshold holds no more.
        let allowance = 0.5 * shift.min(2.0);
        Self {
            allowance,
            // A baseline that is off by its own error brings the sums nearer to the threshold by as
            // much a frame.
            threshold: threshold((allowance - mean_error).max(0.1 * allowance), interval),
            above: 0.0,
            below: 0.0,
        }
    }

    /// Takes the next score. Whether the chart is in alarm. It stays so until the scores return.
    fn update(&mut self, score: f64) -> bool {
        let score = score.clamp(-CLIP, CLIP);
        // What a return needs is bounded, so that a long alarm ends when its cause does.
        let most = self.threshold + CLIP;
        self.above = (self.above + score - self.allowance).clamp(0.0, most);
        self.below = (self.below - score - self.allowance).clamp(0.0, most);
        self.above.max(self.below) > self.threshold
    }

    /// Mean number of frames until a shift of `shift` standard deviations is found.
    fn delay(&self, shift: f64) -> f64 {
        let drift = shift.min(CLIP) - self.allowance;
        if drift <= 0.0 {
            return f64::INFINITY;
        }
        run_length(drift, self.threshold).max(1.0)
    }
}

/// Siegmund's approximation of the mean run length of a one-sided chart whose sums drift by Δ a
/// frame (D. Siegmund, *Sequential Analysis*, 1985, section 2.6): (e^(−2Δb) + 2Δb − 1)/(2Δ²) with b
/// = h + 1.166.
fn run_length(drift: f64, threshold: f64) -> f64 {
    let b = threshold + 1.166;
    let twice = 2.0 * drift * b;
    ((-twice).exp() + twice - 1.0) / (2.0 * drift * drift)
}

/// The h for which both sides together give one false alarm in `interval` frames: each side in
/// twice as many.
fn threshold(allowance: f64, interval: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    // The run length grows exponentially with the threshold, so that few doublings bracket it.
    while run_length(-allowance, high) < 2.0 * interval {
        high *= 2.0;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if run_length(-allowance, middle) < 2.0 * interval {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Finds pixels whose grey level does not change while their neighbours' do: dead, hot or stuck
/// ones.
///
/// Feed it frames some time apart, loads among them: a pixel is stuck if it has kept one grey level
/// over all frames while at least five of its eight neighbours have changed in a quarter of them.
/// O(pixels) a frame.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::StuckPixels;
///
/// let mut stuck = StuckPixels::new((40, 40))?;
/// for k in 0..32_u32 {
///     let mut frame = Array2::from_shape_fn((40, 40), |(y, x)| {
///         50 + ((y * 7 + x * 13 + k as usize * 5) % 4) as u8
///     });
///     frame[[12, 30]] = 255;
///     stuck.update(frame.view())?;
/// }
/// assert_eq!(stuck.pixels(), [(12, 30)]);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug)]
pub struct StuckPixels {
    last: Option<Array2<u8>>,
    changes: Array2<u16>,
    frames: u16,
}

impl StuckPixels {
    /// A search in frames of the given size (rows, columns).
    ///
    /// # Errors
    /// A size without pixels.
    pub fn new((rows, columns): (usize, usize)) -> Result<Self, ForceError> {
        if rows == 0 || columns == 0 {
            return Err(ForceError::EmptyImage { rows, columns });
        }
        Ok(Self {
            last: None,
            changes: Array2::zeros((rows, columns)),
            frames: 0,
        })
    }

    /// Takes a frame.
    ///
    /// # Errors
    /// A frame of another size.
    pub fn update(&mut self, frame: ArrayView2<'_, u8>) -> Result<(), ForceError> {
        let (expected, found) = (self.changes.dim(), frame.dim());
        if expected != found {
            return Err(ForceError::SizeMismatch { expected, found });
        }
        match &mut self.last {
            None => self.last = Some(frame.to_owned()),
            Some(last) => {
                ndarray::Zip::from(&mut self.changes)
                    .and(&mut *last)
                    .and(frame)
                    .for_each(|changes, last, now| {
                        *changes = changes.saturating_add(u16::from(*last != *now));
                        *last = *now;
                    });
            }
        }
        // A long search stops counting instead of starting again at zero.
        self.frames = self.frames.saturating_add(1);
        Ok(())
    }

    /// The stuck pixels as (row, column). None before sixteen frames.
    pub fn pixels(&self) -> Vec<(usize, usize)> {
        // Fewest frames before a pixel can be called stuck. Of a healthy pixel that rounds to one
        // of two levels at random all differences between 16 frames vanish once in 2¹⁵.
        if self.frames < 16 {
            return Vec::new();
        }
        let unchanged = self.changes.indexed_iter().filter(|(_, c)| **c == 0);
        unchanged
            .map(|(place, _)| place)
            .filter(|place| self.lively_neighbours(*place) >= 5)
            .collect()
    }

    /// Number of neighbours that changed in a quarter of the frames. Those beyond the frame's edge
    /// count as the others do.
    fn lively_neighbours(&self, (row, column): (usize, usize)) -> usize {
        let (mut lively, mut all) = (0, 0);
        for y in row.saturating_sub(1)..=row + 1 {
            for x in column.saturating_sub(1)..=column + 1 {
                let Some(changes) = self.changes.get((y, x)) else {
                    continue;
                };
                if (y, x) != (row, column) {
                    all += 1;
                    lively += usize::from(4 * u32::from(*changes) >= u32::from(self.frames));
                }
            }
        }
        (8 * lively).checked_div(all).unwrap_or(0)
    }
}

#[cfg(test)]
#[path = "health_tests.rs"]
mod tests;
