//! Brightness and noise of a frame outside the contact.

use crate::drift::{DriftCorrection, FitWorkspace, IlluminationDrift, fit, median};
use crate::frame::TileSum;
use tactile_core::Estimate;

/// The state of a sensor as one frame shows it outside the contact.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ContactDetector, ContactOptions, Detection, DetectorWorkspace, ReferenceFrame};
///
/// let reference = ReferenceFrame::new(Array2::from_elem((160, 160), 50_u8).view())?;
/// let frame = Array2::from_elem((160, 160), 51_u8);
/// let mut workspace = DetectorWorkspace::default();
/// let _: Detection =
///     ContactDetector::new(ContactOptions::default()).detect_with(&mut workspace, frame.view(), &reference)?;
/// let condition = workspace.condition(&reference).expect("a frame of that size");
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
    /// Scatter of the background over what the reference's noise explains, as a ratio of standard deviations.
    pub noise_ratio: f64,
}

/// Tiles that a condition is read from. The ratio of noise, a median, is known from so many to 3 %, where charts look for 20 %, and the
/// brightness to a hundredth of what they look for. All 5,764 tiles of a frame of 1392 × 1042 pixels take five times as long, a fifth of the
/// time that contact and force take (`cargo bench -p tactile-benches --bench pipeline`, a frame without contact).
const MOST_TILES: usize = 1500;

impl FrameCondition {
    /// Every how many of `tiles`, in rows of `columns`, are looked at. No divisor in common with the columns: else whole columns were never seen.
    pub(crate) fn tile_step(tiles: usize, columns: usize) -> usize {
        let least = tiles.div_ceil(MOST_TILES).max(1);
        let shares_none = |step: &usize| greatest_common_divisor(*step, columns) == 1;
        (least..).find(shares_none).unwrap_or(least)
    }

    /// From the tiles of a frame of the given size; `sd` is the noise of one pixel's difference. `None` without background.
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
            if drift_agrees(residual) {
                values.push(residual.abs());
                grey += tile.reference + tile.difference;
                pixels += tile.pixels;
            }
        }
        if pixels == 0.0 || values.is_empty() {
            return None;
        }
        Some(Self {
            brightness: brightness(&drift),
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

fn brightness(drift: &IlluminationDrift) -> Estimate {
    Estimate::new(drift.coefficients[0], drift.standard_error)
}

/// A tile within five standard deviations of the fitted brightness is background.
fn drift_agrees(score: f64) -> bool {
    score.abs() < 5.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_looked_at_are_enough_and_in_every_column() {
        for (rows, columns) in [
            (1, 1),
            (30, 40),
            (131, 44),
            (260, 87),
            (500, 210),
            (2, 30_030),
        ] {
            let tiles = rows * columns;
            let step = FrameCondition::tile_step(tiles, columns);
            let looked_at = tiles.div_ceil(step);
            assert!(looked_at <= MOST_TILES && 2 * looked_at >= tiles.min(MOST_TILES));
            let mut seen = vec![false; columns];
            (0..tiles)
                .step_by(step)
                .for_each(|tile| seen[tile % columns] = true);
            let all = looked_at >= columns;
            assert!(
                !all || seen.iter().all(|seen| *seen),
                "{rows} × {columns}: {step}"
            );
        }
        // No columns, no tiles.
        assert_eq!(FrameCondition::tile_step(0, 0), 1);
    }

    /// A fifth of the tiles says what all say, to the errors that are stated.
    #[test]
    fn a_part_of_the_tiles_knows_the_frame() {
        let (rows, columns, sd) = (131, 44, 2.0);
        let mut state = 1_u64;
        let mut normal = || {
            let mut uniform = || {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            (-2.0 * (1.0 - uniform()).ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
        };
        // 1.2 times the reference's noise, and light that falls off from column to column.
        let tiles: Vec<_> = (0..rows * columns)
            .map(|i| {
                let reference = 256.0 * (40.0 - 0.5 * (i % columns) as f64);
                TileSum {
                    x: 32.0 * (i % columns) as f64,
                    y: 8.0 * (i / columns) as f64,
                    pixels: 256.0,
                    reference,
                    difference: 0.01 * reference + 1.2 * sd * 16.0 * normal(),
                }
            })
            .collect();
        let step = FrameCondition::tile_step(tiles.len(), columns);
        assert!(step > 3);
        let size = (8 * rows, 32 * columns);
        let of = |step: usize| {
            let tiles = tiles.iter().copied().step_by(step);
            FrameCondition::of(size, tiles, sd, &mut FitWorkspace::default()).expect("background")
        };
        let (all, part) = (of(1), of(step));
        let error = (part.brightness.value - all.brightness.value).abs();
        // Four standard errors; 2 % is what charts look for.
        assert!(
            error < 4.0 * part.brightness.standard_error && error < 2e-4,
            "{error}"
        );
        // The median of |z| of n tiles has a relative standard error of 1.17/√n, 3.4 % of these; four of them.
        let looked_at = tiles.len().div_ceil(step) as f64;
        let error = (part.noise_ratio / 1.2 - 1.0).abs();
        assert!(error < 4.0 * 1.17 / looked_at.sqrt(), "{part:?}");
        // Every column is looked at as often as others: the fall of the light leaves no trace.
        assert!((part.background_grey - all.background_grey).abs() < 0.1);
    }
}
