//! The light of the calibration's reference, and its change since then.
use crate::force::{Estimate, ReferenceFrame};
use ndarray::{ArrayView2, Axis, Slice};

/// Blocks along each side of a frame.
const BLOCKS: usize = 8;

/// Brightness of a reference in 8 × 8 blocks, stored with a calibration. Lamps and exposure change
/// the background and the leaked light by one factor, so a later reference reveals the error of the
/// forces. Stray room light changes only the background and, if the background is even, looks the
/// same: a tenth of the change is therefore the error of the factor.
///
/// ```
/// use tactile_imaging::{Object, Pipeline, pipeline::ReferenceLight};
/// use tactile_imaging::force::{CalibrationPair, ReferenceFrame};
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let hertz = |level: f64, peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
///     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
///     (level * (20.0 + peak * (1.0 - d * d).sqrt())).round() as u8
/// });
/// let calibrated = ReferenceFrame::new(hertz(1.0, 0.0).view())?;
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?.with_settings(
///     |settings| settings.calibrated_light = Some(ReferenceLight::of(&calibrated)),
/// )?;
/// // The lamps are a tenth darker, and a new reference was taken.
/// let mut press = pipeline.press(hertz(0.9, 0.0).view())?;
/// press.add_frame(hertz(0.9, 120.0));
/// let force = press.contact(0)?.and_then(|c| c.force_n).expect("a force");
/// assert!((force.value / 1.005 - 1.0).abs() < 0.01, "a tenth less light does not change the force");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ReferenceLight {
    /// Mean grey level of each block, row by row.
    pub grey: Vec<f64>,
    /// Standard error of one block from noise.
    pub error_grey: f64,
}

impl ReferenceLight {
    /// Computes the brightness of a reference. O(pixels).
    #[must_use]
    pub fn of(reference: &ReferenceFrame) -> Self {
        let image = reference.image();
        let (rows, columns) = image.dim();
        let edge = |length: usize, k: usize| length * k / BLOCKS;
        let mean = |block: ArrayView2<'_, u8>| {
            let sum: f64 = block.iter().map(|v| f64::from(*v)).sum();
            sum / block.len().max(1) as f64
        };
        let block = |k: usize| {
            let [row, column] = [k / BLOCKS, k % BLOCKS];
            let down = edge(rows, row)..edge(rows, row + 1);
            let across = edge(columns, column)..edge(columns, column + 1);
            let band = image.slice_axis(Axis(0), Slice::from(down));
            mean(band.slice_axis(Axis(1), Slice::from(across)))
        };
        let grey: Vec<f64> = (0..BLOCKS * BLOCKS).map(block).collect();
        let level = grey.iter().sum::<f64>() / grey.len() as f64;
        let pixels = (image.len() / grey.len()).max(1) as f64;
        Self {
            error_grey: (reference.noise().variance(level) / pixels).sqrt(),
            grey,
        }
    }

    /// The change of the light since then. `None` if there is too little light to measure it.
    pub(super) fn changed(&self, now: &ReferenceFrame) -> Option<LightChange> {
        let now = Self::of(now);
        let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
            let both = self.grey.iter().zip(&now.grey);
            both.map(|(then, now)| f(*then, *now)).sum()
        };
        let squares = sum(&|then, _| then * then);
        let gain = sum(&|then, now| then * now) / squares;
        let noise = now.error_grey.hypot(gain * self.error_grey);
        let error = noise / squares.sqrt();
        // A factor with an error above half a per cent corrects nothing.
        let known = self.grey.len() == now.grey.len() && gain > 0.0 && error < 5e-3;
        if !known {
            return None;
        }
        let count = self.grey.len() as f64;
        let residual = sum(&|then, now| (now - gain * then).powi(2)) / count;
        let uneven = (residual - noise * noise).max(0.0).sqrt() / (squares / count).sqrt();
        let of_change = 0.1 * (gain - 1.0);
        Some(LightChange {
            gain: Estimate::new(gain, error.hypot(uneven).hypot(of_change)),
            uneven,
            seen: (gain - 1.0).abs() > 0.01 + 5.0 * error || uneven > 0.01,
        })
    }
}

/// The change of the light since the calibration.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightChange {
    /// The factor common to the whole frame.
    pub gain: Estimate,
    /// Deviation from a common factor: relative root mean square over the blocks.
    pub uneven: f64,
    /// Whether the change deserves a caution.
    pub seen: bool,
}
