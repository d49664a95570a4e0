//! Drift of illumination and stray light since the reference was taken, from the pixels outside the
//! contact.

use nalgebra::{Matrix3, Vector3};

use tactile_core::vectorised;

use crate::tiles::{TILE_COLUMNS, TILE_ROWS, TileSum};

/// A third of a normal variable's absolute values is below this number of standard deviations.
pub(crate) const THIRD: f64 = 0.4307;

/// Minimum grey level of a usable reference.
const LEAST_REFERENCE_GREY: f64 = 1e-3;

/// Probability at which a change is attributed to stray light: the lamps of a sensor drift more
/// often than the light around it.
const SURE: f64 = 0.9;

/// The light counts as unchanged within this number of standard errors of the level.
const CHANGED: f64 = 2.0;

/// Largest number of steps of a fit. Most take three.
const MOST_STEPS: usize = 20;

/// If changes of stray light alone and of illumination alone both deviate from the background's
/// structure by more than these squared standard errors, both have changed.
const BOTH: f64 = 16.0;

/// The change of illumination or stray light that is corrected. The default of detection is
/// [`Automatic`](Self::Automatic).
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::*;
///
/// /// One newton per million grey levels.
/// struct Line;
///
/// impl StressCalibration for Line {
///     fn force_n(&self, integrated_pixel_value: f64) -> f64 {
///         1e-6 * integrated_pixel_value
///     }
/// }
///
/// let drift = |correction, at_rest: u8, now: u8| -> Result<IlluminationDrift, ForceError> {
///     let [reference, frame] = [at_rest, now].map(|grey| Array2::from_elem((160, 160), grey));
///     let contact = ContactOptions::default().with_drift(correction);
///     let options = ForceOptions::default().with_contact(contact);
///     let m = measure_force(frame.view(), reference.view(), [20e-6; 2], &Line, &options)?;
///     assert!(m.contact.is_none(), "a change of light is not a contact");
///     Ok(m.drift)
/// };
/// // Illumination that is a tenth brighter.
/// let brighter = drift(DriftCorrection::Automatic, 100, 110)?;
/// assert!((brighter.coefficients[0] - 1.1).abs() < 1e-9);
/// assert_eq!((brighter.outcome, brighter.tiles), (DriftOutcome::Corrected, 20 * 5));
/// // A black background reveals nothing about the illumination.
/// let black = drift(DriftCorrection::Automatic, 0, 0)?;
/// assert!(matches!(black.outcome, DriftOutcome::TooDark { .. }));
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum DriftCorrection {
    /// Frames are not corrected.
    #[default]
    None,
    /// Illumination whose distribution changed, for example by a moved LED: d = f/(g + gₓ x + g_y
    /// y) − r.
    TiltedIllumination,
    /// Illumination g and stray light b together, d = (f − b)/g − r, if the frame reveals its level
    /// ([`DriftOutcome`]); otherwise no correction. The structure of the background reveals which
    /// of them changed. A uniform background does not: the change is then attributed to the
    /// illumination, and the error of the signal's scale covers both.
    Automatic,
}

/// Whether the drift of a frame is known. See [`DriftCorrection`] for an example.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum DriftOutcome {
    /// No correction was requested.
    #[default]
    NotRequested,
    /// The drift was estimated and corrected.
    Corrected,
    /// The background is too dark compared with its noise: the standard error of the illumination
    /// would exceed the required 0.5 %. Nothing was corrected.
    TooDark {
        /// Standard error of the relative illumination.
        standard_error: f64,
    },
    /// Less than half of the frame or of its border agrees on one illumination, for example under a
    /// contact that covers most of it. Nothing was corrected.
    TooLittleBackground {
        /// Fraction of the tiles that agree, in the frame or along its border.
        share: f64,
    },
    /// The light is less than half or more than twice that of the reference: the exposure has
    /// changed or the frame is saturated. Nothing was corrected.
    OtherLight {
        /// Light of the frame relative to that of the reference.
        ratio: f64,
    },
}

/// The drift found in one frame. See [`DriftCorrection`] for an example.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct IlluminationDrift {
    /// The correction that was applied.
    pub correction: DriftCorrection,
    /// Whether the drift is known.
    pub outcome: DriftOutcome,
    /// Illumination at the centre of the frame relative to that of the reference, and its change
    /// per column and per row.
    pub coefficients: [f64; 3],
    /// Stray light in addition to the illumination, in grey levels.
    pub stray_grey: f64,
    /// Variance of the signal's scale, for an illumination that is known less accurately than the
    /// background.
    scale_variance: f64,
    /// Standard error of the first coefficient.
    pub standard_error: f64,
    /// Number of tiles of 8 × 32 pixels used.
    pub tiles: usize,
    middle: [f64; 2],
    /// Covariance of the coefficients.
    covariance: [[f64; 3]; 3],
    /// Mean grey level of the reference in these tiles.
    reference: f64,
}

impl Default for IlluminationDrift {
    /// Unchanged light.
    fn default() -> Self {
        Self {
            correction: DriftCorrection::None,
            outcome: DriftOutcome::NotRequested,
            coefficients: [1.0, 0.0, 0.0],
            stray_grey: 0.0,
            scale_variance: 0.0,
            standard_error: 0.0,
            tiles: 0,
            middle: [0.0; 2],
            covariance: [[0.0; 3]; 3],
            reference: 0.0,
        }
    }
}

/// The correction along one row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DriftLine {
    start: f32,
    step: f32,
    stray: f32,
}

impl DriftLine {
    /// Corrected difference of the pixel `x` columns from the start of the line.
    #[inline(always)]
    pub(crate) fn difference(&self, x: usize, frame: f32, reference: f32) -> f32 {
        // Frames are narrower than 2³¹, and this conversion has SIMD instructions.
        let level = self.start + self.step * (x as i32) as f32;
        (frame - self.stray) / level - reference
    }
}

impl IlluminationDrift {
    pub(crate) fn is_zero(&self) -> bool {
        self.correction == DriftCorrection::None
    }

    pub(crate) fn line(&self, row: usize, first_column: usize) -> DriftLine {
        let [value, per_column, per_row] = self.coefficients;
        let y = row as f64 - self.middle[1];
        let x = first_column as f64 - self.middle[0];
        // Double precision for the start of the line; single precision is sufficient for the step
        // from there.
        let start = value + per_column * x + per_row * y;
        DriftLine {
            start: start as f32,
            step: per_column as f32,
            stray: self.stray_grey as f32,
        }
    }

    /// Variances due to the error of the correction at a position: of the background in squared
    /// grey levels, and of the signal's scale.
    pub(crate) fn variances(&self, x: f64, y: f64) -> [f64; 2] {
        let at = [1.0, x - self.middle[0], y - self.middle[1]];
        let mut variance = 0.0;
        for i in 0..3 {
            for j in 0..3 {
                variance += at[i] * self.covariance[i][j] * at[j];
            }
        }
        [
            variance * self.reference * self.reference,
            variance + self.scale_variance,
        ]
    }

    /// Background that the correction subtracts from a frame at a position, for a reference level
    /// of `reference`.
    fn level(&self, x: f64, y: f64, reference: f64) -> f64 {
        reference * (self.at(x, y) - 1.0) + self.stray_grey
    }

    #[inline]
    fn at(&self, x: f64, y: f64) -> f64 {
        let [value, per_column, per_row] = self.coefficients;
        if per_column == 0.0 && per_row == 0.0 {
            return value;
        }
        value + per_column * (x - self.middle[0]) + per_row * (y - self.middle[1])
    }

    /// The largest background, in grey levels, that the correction removes anywhere in a frame of a
    /// given size, for a reference of uniform brightness `mean`.
    pub(crate) fn greatest_grey(&self, (rows, columns): (usize, usize), mean: f64) -> f64 {
        if self.is_zero() {
            return 0.0;
        }
        let (right, bottom) = (columns as f64 - 1.0, rows as f64 - 1.0);
        let corners = [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]];
        corners
            .iter()
            .map(|[x, y]| self.level(*x, *y, mean).abs())
            .fold(0.0, f64::max)
    }

    /// The summed difference of a tile after the correction.
    #[inline]
    pub(crate) fn residual(&self, tile: &TileSum) -> f64 {
        let illumination = tile.reference * (self.at(tile.x, tile.y) - 1.0);
        tile.difference - illumination - tile.pixels * self.stray_grey
    }

    /// The automatic correction if its error is small enough; otherwise none, with the reason.
    /// `residuals` are those of the tiles per pixel.
    fn accepted(self, levels: &Levels, residuals: &[f64], sd: f64) -> Self {
        let (mut agree, mut all) = ([0.0; 2], [0.0; 2]);
        let mut root = RootOfPixels::default();
        let tiles = levels.own.iter().zip(&levels.pixels).zip(&levels.at_border);
        for (((own, &pixels), &at_border), residual) in tiles.zip(residuals) {
            // A tile agrees if its drift deviates by at most a hundredth of the background.
            let limit = 3.0 * sd * root.of(pixels) + 0.01 * own * pixels;
            let agrees = f64::from(u8::from(residual * pixels <= limit));
            let at_border = f64::from(u8::from(at_border));
            agree[0] += agrees;
            agree[1] += agrees * at_border;
            all[0] += 1.0;
            all[1] += at_border;
        }
        let [whole, border] = [0, 1].map(|k| agree[k] / f64::max(all[k], 1.0));
        let share = f64::min(whole, border);
        let standard_error = self.standard_error;
        // At 0.5 % the error of the force is at most that of a good gauge.
        let known = standard_error > 0.0 && standard_error <= 0.005 && self.reference > 0.0;
        let refused = |outcome| Self {
            outcome,
            ..Self::default()
        };
        if !known {
            return refused(DriftOutcome::TooDark { standard_error });
        }
        // With less background another illumination may agree as well.
        if share < 0.5 {
            return refused(DriftOutcome::TooLittleBackground { share });
        }
        let ratio = self.coefficients[0] + self.stray_grey / self.reference;
        if !(0.5..=2.0).contains(&ratio) {
            return refused(DriftOutcome::OtherLight { ratio });
        }
        Self {
            outcome: DriftOutcome::Corrected,
            ..self
        }
    }

    /// One least-squares step of the coefficients, using the tiles whose level per pixel is within
    /// a limit. `sd` is the noise of one pixel. Returns the number of tiles.
    ///
    /// Positions are relative to the centre of the frame, in units of half the frame.
    fn step(&mut self, tiles: impl Iterator<Item = TileSum>, limit: f64, sd: f64) -> usize {
        // Slopes per half frame give the three columns similar sizes, and the matrix a good
        // condition number.
        let scale = [1.0, self.middle[0].max(1.0), self.middle[1].max(1.0)];
        let (mut matrix, mut right) = (Matrix3::<f64>::zeros(), Vector3::<f64>::zeros());
        let (mut count, mut reference, mut pixels) = (0, 0.0, 0.0);
        for tile in tiles {
            let residual = self.residual(&tile);
            let is_near = (residual / tile.pixels).abs() <= limit;
            if !is_near {
                continue;
            }
            let slopes = Vector3::new(
                1.0,
                (tile.x - self.middle[0]) / scale[1],
                (tile.y - self.middle[1]) / scale[2],
            ) * weight(&tile);
            // The variance of a tile's sum is proportional to its number of pixels.
            let by = slopes / tile.pixels;
            right += by * residual;
            matrix += by * slopes.transpose();
            count += 1;
            reference += tile.reference;
            pixels += tile.pixels;
        }
        let Some(inverse) = matrix.try_inverse() else {
            return count;
        };
        let step = inverse * right;
        for i in 0..3 {
            self.coefficients[i] += step[i] / scale[i];
            for j in 0..3 {
                self.covariance[i][j] = inverse[(i, j)] * sd * sd / (scale[i] * scale[j]);
            }
        }
        self.standard_error = self.covariance[0][0].sqrt();
        self.reference = reference / f64::max(pixels, 1.0);
        count
    }

    /// Sets illumination and stray light by the sums over the tiles of the background. A line through
    /// their changes over the reference reveals which of them changed; otherwise the change is
    /// attributed to the illumination. `sd` is the noise of a pixel, and `scatter` the ratio of the
    /// tiles' scatter to the noise of a tile.
    fn set_both(&mut self, of: &BackgroundSums, sd: f64, scatter: f64) {
        let pixels = f64::max(of.pixels, 1.0);
        let [
            reference,
            change,
            other,
            square,
            with_own,
            with_change,
            own,
            moved,
        ] = of.sums.map(|sum| sum / pixels);
        let covariances = [with_own - other * reference, with_change - other * change];
        let variance = (square - other * other).max(f64::MIN_POSITIVE);
        let level_error = (sd / pixels.sqrt()).max(1e-6);
        // Attributed to illumination alone, with its error.
        let own = own.max(LEAST_REFERENCE_GREY * LEAST_REFERENCE_GREY);
        let (all, error) = (moved / own, level_error / own.sqrt());
        let noise = variance * (scatter * level_error).powi(2);
        let information = covariances[0] * covariances[0] / noise;
        let misfit = |gain: f64| (covariances[1] - gain * covariances[0]).powi(2) / noise;
        let [by_light, by_illumination] = [misfit(0.0), misfit(all)];
        let both = by_light.min(by_illumination).min(information * all * all) > BOTH;
        // If there is a significant change, the error covers the rejected explanation, weighted by
        // its probability.
        let light = 1.0 / (1.0 + (0.5 * (by_light - by_illumination)).exp());
        let apart = (all * all - (CHANGED * error).powi(2)).max(0.0);
        let (gain, stray, open) = if both {
            let slope = covariances[1] / covariances[0];
            (slope, change - slope * reference, information.recip())
        } else if light > SURE && apart > 0.0 {
            (0.0, change, (1.0 - light) * apart / (1.0 + all).powi(2))
        } else {
            (all, 0.0, light * apart)
        };
        self.coefficients[0] = 1.0 + gain;
        self.stray_grey = stray;
        self.scale_variance = open;
        self.reference = reference;
        self.standard_error = error;
        self.covariance[0][0] = self.standard_error.powi(2);
    }
}

/// Quantities of tiles per pixel, by column.
#[derive(Clone, Debug, Default)]
struct Levels {
    /// Numbers of pixels.
    pixels: Vec<f64>,
    /// Derivatives by the illumination.
    own: Vec<f64>,
    changes: Vec<f64>,
    /// Whether tiles are at the border of the frame. A face that covers most of the frame is also
    /// uniform, but it does not reach the border.
    at_border: Vec<bool>,
}

impl Levels {
    /// Takes the tiles of a frame with this middle.
    fn fill(&mut self, tiles: impl Iterator<Item = TileSum> + Clone, middle: [f64; 2]) {
        let reach = [
            middle[0] - TILE_COLUMNS as f64,
            middle[1] - TILE_ROWS as f64,
        ];
        let at_border = |tile: &TileSum| {
            (tile.x - middle[0]).abs() > reach[0] || (tile.y - middle[1]).abs() > reach[1]
        };
        self.at_border.clear();
        self.at_border
            .extend(tiles.clone().map(|tile| at_border(&tile)));
        self.pixels.clear();
        self.pixels.extend(tiles.clone().map(|tile| tile.pixels));
        self.own.clear();
        self.own
            .extend(tiles.clone().map(|tile| weight(&tile) / tile.pixels));
        self.changes.clear();
        self.changes
            .extend(tiles.map(|tile| tile.difference / tile.pixels));
    }

    /// Absolute residuals of a change of the light of the whole frame.
    #[inline(always)]
    fn residuals(&self, drift: &IlluminationDrift, residuals: &mut Vec<f64>) {
        let (gain, stray) = (drift.coefficients[0] - 1.0, drift.stray_grey);
        residuals.clear();
        let levels = self.own.iter().zip(&self.changes);
        residuals.extend(levels.map(|(own, change)| (change - own * gain - stray).abs()));
    }
}

/// Sums over the tiles whose residual is within a limit.
struct BackgroundSums {
    tiles: usize,
    pixels: f64,
    /// Sums over the pixels, see [`BackgroundSums::over`].
    sums: [f64; 8],
}

impl BackgroundSums {
    /// Sums of own level o, change c and preceding level p: o, c, p, p², p o, p c, o² and o c.
    ///
    /// The preceding tile stands for the structure of the reference: the change of a tile contains
    /// the noise of its own reference level, which would cause a spurious slope.
    #[inline(always)]
    fn over(levels: &Levels, residuals: &[f64], limit: f64) -> Self {
        let (mut tiles, mut pixels, mut sums) = (0, 0.0, [0.0; 8]);
        let mut before = None;
        let rows = levels.own.iter().zip(&levels.changes).zip(&levels.pixels);
        for (((&own, &change), &count), residual) in rows.zip(residuals) {
            let is_near = *residual <= limit;
            if !is_near {
                continue;
            }
            let other = before.replace(own).unwrap_or(own);
            let left = [own, change, other, other, other, other, own, own];
            let right = [1.0, 1.0, 1.0, other, own, change, own, change];
            for k in 0..8 {
                sums[k] += count * (left[k] * right[k]);
            }
            pixels += count;
            tiles += 1;
        }
        Self {
            tiles,
            pixels,
            sums,
        }
    }
}

/// Square root of the number of a tile's pixels, which nearly all tiles have in common.
#[derive(Default)]
pub(crate) struct RootOfPixels {
    pixels: f64,
    root: f64,
}

impl RootOfPixels {
    #[inline(always)]
    pub(crate) fn of(&mut self, pixels: f64) -> f64 {
        if pixels != self.pixels {
            (self.pixels, self.root) = (pixels, pixels.sqrt());
        }
        self.root
    }
}

/// Derivative of a tile's sum by the illumination.
fn weight(tile: &TileSum) -> f64 {
    tile.reference.max(1.0)
}

/// Buffers of the fit.
#[derive(Clone, Debug, Default)]
pub(crate) struct FitWorkspace {
    levels: Levels,
    values: Vec<f64>,
    scratch: Vec<f64>,
}

/// Fits the correction by least squares to all tiles except outliers (the contact), repeated until
/// the number of tiles settles. `sd` is the noise of one pixel's difference, `sign` that of a
/// contact.
pub(crate) fn fit(
    correction: DriftCorrection,
    (rows, columns): (usize, usize),
    tiles: impl Iterator<Item = TileSum> + Clone,
    sd: f64,
    sign: f64,
    workspace: &mut FitWorkspace,
) -> IlluminationDrift {
    let FitWorkspace {
        levels,
        values,
        scratch,
    } = workspace;
    let mut drift = IlluminationDrift {
        correction,
        middle: [0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0)],
        ..IlluminationDrift::default()
    };
    levels.fill(tiles.clone(), drift.middle);
    let automatic = correction == DriftCorrection::Automatic;
    // A contact changes tiles to one side. The third on the other side is background even if a
    // contact covers more than half of a small frame.
    let changes = levels.changes.iter().zip(&levels.own);
    values.clear();
    values.extend(changes.map(|(change, own)| sign * (change / own)));
    drift.coefficients[0] += sign * quantile(values, 3, scratch);
    let noise = sd / ((TILE_ROWS * TILE_COLUMNS) as f64).sqrt();
    let mut seen = [[f64::NAN; 4]; MOST_STEPS];
    let (mut steps, mut end) = (0, MOST_STEPS);
    let mut background: Option<BackgroundSums> = None;
    while steps < end {
        if automatic {
            vectorised(
                #[inline(always)]
                || levels.residuals(&drift, values),
            );
        } else {
            let level = |tile: &TileSum| (drift.residual(tile) / tile.pixels).abs();
            values.clear();
            values.extend(tiles.clone().map(|tile| level(&tile)));
        }
        // Scatter of the third that is nearest, which tiles of the contact hardly widen, but at least
        // the noise.
        let limit = 3.0 * (quantile(values, 3, scratch) / THIRD).max(noise);
        let before = drift.tiles;
        drift.tiles = if automatic {
            let near = values.iter().filter(|residual| **residual <= limit).count();
            let of = match background.take() {
                // Nearly always the same tiles.
                Some(of) if of.tiles == near => of,
                _ => vectorised(
                    #[inline(always)]
                    || BackgroundSums::over(levels, values, limit),
                ),
            };
            drift.set_both(&of, sd, limit / (3.0 * noise));
            background.insert(of).tiles
        } else {
            drift.step(tiles.clone(), limit, sd)
        };
        // An equal number of tiles nearly always means the same tiles, so the fit has converged.
        if drift.tiles == before {
            break;
        }
        // Tiles at the limit may come and go for ever. A step depends on the last state alone, so the
        // state after the last step is known as soon as one repeats.
        let [value, per_column, per_row] = drift.coefficients;
        let state = [value, per_column, per_row, drift.stray_grey];
        if end == MOST_STEPS
            && let Some(earlier) = seen[..steps].iter().rposition(|other| *other == state)
        {
            end = steps + 1 + (MOST_STEPS - steps - 1) % (steps - earlier);
        }
        seen[steps] = state;
        steps += 1;
    }
    if automatic {
        levels.residuals(&drift, values);
        return drift.accepted(levels, values, sd);
    }
    drift.outcome = DriftOutcome::Corrected;
    drift
}

/// The value below which one in `parts` lies, by [`f64::total_cmp`] (0 if there are no values): for
/// two the upper median. `scratch` is overwritten. A sample brackets it, so that most values are only
/// counted. The result does not depend on the sample: if the bracket misses, all values are
/// examined.
fn quantile(values: &[f64], parts: usize, scratch: &mut Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / parts;
    scratch.clear();
    // One in 32 values is sampled first. For the quarter of a frame's 5 700 tiles, collecting the
    // values would cost more than sorting them saves.
    scratch.extend(values.iter().step_by(32));
    scratch.sort_unstable_by(f64::total_cmp);
    // Three standard deviations of a rank in the sample, each ½√n.
    let reach = (1.5 * (scratch.len() as f64).sqrt()).ceil() as usize;
    let centre = scratch.len() / parts;
    let low = scratch[centre.saturating_sub(reach)];
    let high = scratch[(centre + reach).min(scratch.len() - 1)];
    if low <= high {
        // NaN of either sign is neither below nor above, so it is among the examined values.
        scratch.resize(values.len(), 0.0);
        let (mut below, mut between, mut whole) = (0, 0, true);
        for value in values {
            // Written unconditionally and kept conditionally, which avoids a branch.
            scratch[between] = *value;
            below += usize::from(*value < low);
            between += usize::from((*value >= low) & (*value <= high));
            whole &= !value.is_nan();
        }
        if whole && (below..below + between).contains(&middle) {
            let inside = &mut scratch[..between];
            return *inside
                .select_nth_unstable_by(middle - below, f64::total_cmp)
                .1;
        }
    }
    scratch.clear();
    scratch.extend_from_slice(values);
    *scratch.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn is_one_of_the_sorted_values(
            mut values in proptest::collection::vec(prop_oneof![
                8 => -1.0..1.0_f64,
                2 => Just(0.0), 1 => Just(-0.0), 1 => Just(f64::INFINITY),
            ], 0..400),
            nan in proptest::option::of(0_usize..400), period in 1_usize..40,
            parts in 2_usize..4,
        ) {
            // A sample at equal steps misses everything between them.
            values.iter_mut().step_by(period).for_each(|v| *v += 10.0);
            if let Some(value) = nan.and_then(|at| values.get_mut(at)) {
                *value = -f64::NAN;
            }
            let found = quantile(&values, parts, &mut vec![3.0]);
            values.sort_by(f64::total_cmp);
            let expected = values.get(values.len() / parts).copied().unwrap_or(0.0);
            prop_assert_eq!(found.to_bits(), expected.to_bits());
        }
    }
}
