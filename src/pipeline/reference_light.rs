//! The light of the calibration's reference, and its change since then.
use super::flag::Flag;
use crate::force::{Estimate, ReferenceFrame};
use ndarray::{ArrayView1, ArrayView2, Axis, Slice};

/// Blocks along each side of a frame.
const BLOCKS: usize = 8;

/// Mean square of eight rows of blocks over their variance, which noise exceeds in one of a thousand
/// references.
const MOST_OF_ROWS: f64 = 3.5;

/// Blocks darker than this have clipped pixels.
const CLIPPED_GREY: f64 = 1.0;

/// The blocks' spread over that of their noise from which the background has a structure.
const LEAST_STRUCTURE: f64 = 20.0;

/// Standard error of ln g beside the structure's: lamps and other light may both have changed.
const BOTH: f64 = 0.04;

/// A factor with a larger error than this corrects nothing.
const LARGEST_ERROR: f64 = 5e-3;

/// Share of the squared change from which a pattern of rows is bands of light.
const LEAST_OF_BANDS: f64 = 0.5;

/// Largest share of a parabola in bands.
const PARABOLA_OF_BANDS: f64 = 0.1;

/// Scatters above the rest from which a block glows, and the most blocks that glow: one in so many.
const GLOW: f64 = 5.0;
const MOST_OF_GLOW: usize = 4;

/// Brightness of a reference in 8 × 8 blocks, stored with a calibration. Lamps and exposure change
/// the background and the leaked light by one factor, so a later reference reveals the error of the
/// forces. Room light and the black level only add to the background. An uneven background
/// separates the two; with an even one the force has an error that covers both.
///
/// ```
/// use tactile_imaging::{Object, Pipeline, pipeline::ReferenceLight};
/// use tactile_imaging::force::{CalibrationPair, ReferenceFrame};
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let hertz = |level: f64, peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
///     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
///     (level * (20.0 + c as f64 / 2.0 + peak * (1.0 - d * d).sqrt())).round() as u8
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

    /// The change of the light since then. `None` if the calibration had too little light to measure
    /// it.
    ///
    /// Lamps and exposure multiply the light, room light and the black level add to it: now = g
    /// then + b. Both are fitted to the blocks. The structure of the background determines g; how
    /// well is its error. An even background leaves open which of the two changed: ln g is then
    /// half of the logarithm of the ratio, with as much as its error.
    pub(super) fn changed(&self, now: &ReferenceFrame) -> Option<LightChange> {
        let rows = row_error_grey(now);
        let now = Self::of(now);
        if self.grey.len() != now.grey.len() {
            return None;
        }
        let noise = now.error_grey.hypot(self.error_grey);
        // The rows of the calibration had the same noise, and the blocks of a row share it.
        let of_rows = noise.hypot((2.0 * BLOCKS as f64).sqrt() * rows);
        // Clipped blocks have lost the light that they would be compared by.
        let mut now = now;
        without_bands(&self.grey, &mut now.grey);
        let both = self.grey.iter().copied().zip(now.grey.iter().copied());
        let usable = |(then, now): &(f64, f64)| *then > CLIPPED_GREY && *now > CLIPPED_GREY;
        let mut blocks: Vec<(f64, f64)> = both.filter(usable).collect();
        let glow = without_glow(&mut blocks, noise);
        let count = blocks.len() as f64;
        let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
            blocks.iter().map(|&(then, now)| f(then, now)).sum()
        };
        let squares = sum(&|then, _| then * then);
        let error = of_rows / squares.sqrt();
        if blocks.len() < 3 || noise / squares.sqrt() > LARGEST_ERROR {
            // Blocks that had light and have none now show another black level, or lamps that are
            // off.
            let lit = |then: &&f64| **then > 5.0 * noise + CLIPPED_GREY;
            let lit = self.grey.iter().filter(lit).count();
            return (2 * lit > self.grey.len()).then_some(LightChange::LOST);
        }
        let ratio = sum(&|then, now| then * now) / squares;
        let uneven = |squares_left: f64| {
            let by_chance = noise * noise + MOST_OF_ROWS * rows * rows;
            let left = (squares_left / count - by_chance).max(0.0);
            (left * count / squares).sqrt()
        };
        let alone = uneven(sum(&|then, now| (now - ratio * then).powi(2)));
        let [mean, mean_now] = [sum(&|then, _| then) / count, sum(&|_, now| now) / count];
        let spread = sum(&|then, _| (then - mean).powi(2));
        // Noise of the blocks adds to their spread and makes the slope flatter.
        let structure = spread - count * self.error_grey.powi(2);
        let gain = sum(&|then, now| (then - mean) * now) / structure;
        let left = sum(&|then, now| (now - mean_now - gain * (then - mean)).powi(2));
        let is_structured = structure > LEAST_STRUCTURE * (spread - structure) && gain > 0.0;
        let by_structure = match is_structured {
            true => (left / (count - 2.0)).sqrt().max(of_rows) / structure.sqrt() / gain,
            false => f64::INFINITY,
        };
        let changed = (ratio - 1.0).abs() > 0.01 + 5.0 * error
            || alone > 0.01
            || is_structured && gain.ln().abs() > 0.01 + 5.0 * by_structure;
        let seen = changed || glow > 0.01;
        if !changed {
            let of_change = 0.1 * (ratio - 1.0);
            return Some(LightChange {
                gain: Estimate::new(ratio, error.hypot(alone).hypot(of_change)),
                stray_grey: 0.0,
                uneven: alone.hypot(glow),
                seen,
            });
        }
        let half = 0.5 * ratio.ln();
        let weights = [by_structure, half.hypot(BOTH)].map(|error| error.powi(-2));
        let total = weights[0] + weights[1];
        let log_gain = match is_structured {
            true => (weights[0] * gain.ln() + weights[1] * half) / total,
            false => half,
        };
        let gain = log_gain.exp();
        let uneven = if is_structured { uneven(left) } else { 0.0 };
        Some(LightChange {
            gain: Estimate::new(gain, gain * total.powf(-0.5).hypot(uneven)),
            stray_grey: mean_now - gain * mean,
            uneven,
            seen,
        })
    }
}

/// Standard error of a block from the noise that the pixels of a row share, in grey levels: second
/// differences of the means of the rows, without the noise of their pixels.
fn row_error_grey(reference: &ReferenceFrame) -> f64 {
    let image = reference.image();
    let columns = image.ncols().max(1) as f64;
    let mean = |row: ArrayView1<'_, u8>| row.iter().map(|v| f64::from(*v)).sum::<f64>() / columns;
    let means: Vec<f64> = image.rows().into_iter().map(mean).collect();
    let squares = means.windows(3).map(|m| (m[0] - 2.0 * m[1] + m[2]).powi(2));
    // Second differences have six times the variance.
    let variance = squares.sum::<f64>() / (6.0 * means.len().saturating_sub(2).max(1) as f64);
    let level = means.iter().sum::<f64>() / means.len().max(1) as f64;
    let of_pixels = reference.noise().variance(level) / columns;
    let rows_of_block = (means.len() / BLOCKS).max(1) as f64;
    ((variance - of_pixels).max(0.0) / rows_of_block).sqrt()
}

/// The factor between blocks then and now, by least squares.
fn ratio_of(blocks: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let products = blocks.clone().map(|(then, now)| then * now).sum::<f64>();
    products / blocks.map(|(then, _)| then * then).sum::<f64>()
}

/// Removes a pattern of rows from the present light, such as the bands of lamps on mains: the means
/// of the rows without their parabola, which lamps have too, if they are most of the change.
fn without_bands(then: &[f64], now: &mut [f64]) {
    let ratio = ratio_of(then.iter().copied().zip(now.iter().copied()));
    let left: Vec<f64> = (then.iter().zip(&*now))
        .map(|(then, now)| now - ratio * then)
        .collect();
    let rows = left.chunks(BLOCKS);
    let mut bands: Vec<f64> = rows
        .map(|row| row.iter().sum::<f64>() / BLOCKS as f64)
        .collect();
    let mut means = bands.clone();
    let middle = 0.5 * (BLOCKS as f64 - 1.0);
    let mean_square = middle * (middle + 1.0) / 3.0;
    let polynomials: [fn(f64, f64) -> f64; 3] =
        [|_, _| 1.0, |y, _| y, |y, mean_square| y * y - mean_square];
    for polynomial in polynomials {
        let at = |row: usize| polynomial(row as f64 - middle, mean_square);
        let squares: f64 = (0..BLOCKS).map(|row| at(row).powi(2)).sum();
        let product: f64 = bands.iter().enumerate().map(|(row, b)| b * at(row)).sum();
        for (row, band) in bands.iter_mut().enumerate() {
            *band -= product / squares * at(row);
        }
    }
    let squares = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    let of_bands = BLOCKS as f64 * squares(&bands);
    // Bands have a parabola, too, because a frame cuts them. A larger one is that of a lamp.
    let mean = means.iter().sum::<f64>() / BLOCKS as f64;
    means.iter_mut().for_each(|row| *row -= mean);
    if squares(&means) < (1.0 + PARABOLA_OF_BANDS) * squares(&bands) {
        bands = means;
    }
    if of_bands > LEAST_OF_BANDS * left.iter().map(|l| l * l).sum::<f64>() {
        let rows = now.chunks_mut(BLOCKS).zip(&bands);
        rows.for_each(|(row, band)| row.iter_mut().for_each(|now| *now -= band));
    }
}

/// Removes the blocks of a scratch or a spot that glows: few, and much brighter than the rest. Returns
/// their root mean square change relative to the light, over all blocks: an object that rests on the
/// sensor glows too.
fn without_glow(blocks: &mut Vec<(f64, f64)>, noise: f64) -> f64 {
    let most = blocks.len() / MOST_OF_GLOW;
    let mut kept = blocks.clone();
    for _ in 0..3 {
        let mut ratios: Vec<f64> = kept.iter().map(|(then, now)| now / then).collect();
        if ratios.is_empty() {
            return 0.0;
        }
        ratios.sort_unstable_by(f64::total_cmp);
        let middle = ratios[ratios.len() / 2];
        let left = |&(then, now): &(f64, f64)| now - middle * then;
        let mut sizes: Vec<f64> = kept.iter().map(|block| left(block).abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let limit = GLOW * (1.4826 * sizes[sizes.len() / 2]).max(noise);
        kept.retain(|block| left(block) <= limit);
    }
    if kept.len() == blocks.len() || blocks.len() - kept.len() > most {
        return 0.0;
    }
    let ratio = ratio_of(kept.iter().copied());
    let change = blocks
        .iter()
        .map(|(then, now)| (now / then - ratio).powi(2));
    let uneven = (change.sum::<f64>() / blocks.len() as f64).sqrt();
    *blocks = kept;
    uneven
}

/// The change of the light since the calibration.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightChange {
    /// The factor of the lamps.
    pub gain: Estimate,
    /// Light that was added to theirs, in grey levels.
    stray_grey: f64,
    /// Deviation from a common change: relative root mean square over the blocks.
    uneven: f64,
    /// Whether the change deserves a caution.
    seen: bool,
}

impl LightChange {
    /// The background of the calibration is gone: forces may be off by half.
    const LOST: Self = Self {
        gain: Estimate::new(1.0, 0.5),
        stray_grey: f64::NAN,
        uneven: f64::NAN,
        seen: true,
    };

    pub(super) fn caution(&self) -> Option<Flag> {
        self.seen.then_some(Flag::LightChanged {
            change: self.gain.value - 1.0,
            change_error: self.gain.standard_error,
            stray_grey: self.stray_grey,
            uneven: self.uneven,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    /// Frame of 128 × 128 pixels with light that rises to one side.
    fn frame(light: impl Fn(f64, f64) -> f64) -> ReferenceFrame {
        let grey = |(y, x): (usize, usize)| {
            let (y, x) = (y as f64, x as f64);
            // Positions scattered evenly stand for noise, which the rounding needs.
            let noise = (37.0 * y + x) * 0.754_877_666_2 % 1.0 - 0.5;
            (20.0 + x / 8.0 + noise + light(y, x)).round() as u8
        };
        ReferenceFrame::new(Array2::from_shape_fn((128, 128), grey).view()).unwrap()
    }

    #[test]
    fn bands_and_a_scratch_are_no_change_of_the_lamps() {
        let light = ReferenceLight::of(&frame(|_, _| 0.0));
        let bands = |y: f64, _: f64| 2.0 * (y / 5.0).sin();
        let scratch = |y: f64, x: f64| 15.0 * f64::from(u8::from((y - 0.4 * x - 20.0).abs() < 1.0));
        let half = |y: f64, _: f64| if y < 64.0 { 1.0 } else { -1.0 };
        let found = [
            light.changed(&frame(bands)),
            light.changed(&frame(scratch)),
            light.changed(&frame(half)),
        ];
        let found = found.map(|change| change.expect("enough light"));
        // Gains are known to the rounding of the blocks. A scratch is named, because an object that
        // rests on the sensor glows too. Half of the frame that is brighter is a lamp.
        for change in &found[..2] {
            assert!((change.gain.value - 1.0).abs() < 3e-3, "{change:?}");
            assert!(change.gain.standard_error < 4e-3, "{change:?}");
        }
        assert_eq!(found.map(|change| change.seen), [false, true, true]);
    }
}
