//! The contact circle of a pressed ball, where the signal exceeds a threshold.

use ndarray::Array2;

use crate::SfsError;

/// Fewest pixels of contact a calibration makes sense for.
pub(super) const FEWEST: usize = 100;

/// Centroid (px) and radius of equal area (m) of the largest connected patch above the threshold: whatever else exceeds
/// it, uneven light at the frame's edge say, is no contact. O(pixels).
///
/// Stray pixels are kept from counting by demanding that four of the eight neighbours are above the threshold too.
pub(super) fn contact_circle(
    signals: &Array2<f64>,
    threshold: f64,
    step: [f64; 2],
) -> Result<([f64; 2], f64), SfsError> {
    let above = |r: usize, c: usize| signals.get([r, c]).is_some_and(|&s| s > threshold);
    let counted = Array2::from_shape_fn(signals.dim(), |(r, c)| {
        let near = (0..9)
            .filter(|k| above((r + k / 3).wrapping_sub(1), (c + k % 3).wrapping_sub(1)))
            .count();
        above(r, c) && near > 4
    });
    let patch = largest_patch(counted);
    if patch.len() < FEWEST {
        return Err(SfsError::TooFewPixels {
            needed: FEWEST,
            available: patch.len(),
        });
    }
    let n = patch.len() as f64;
    let mean = |axis: usize| patch.iter().map(|at| at[axis] as f64).sum::<f64>() / n;
    let radius = (n * step[0] * step[1] / core::f64::consts::PI).sqrt();
    Ok(([mean(1), mean(0)], radius))
}

/// The most pixels, `[row, column]`, that are connected by their sides.
fn largest_patch(mut open: Array2<bool>) -> Vec<[usize; 2]> {
    let (rows, columns) = open.dim();
    let mut largest = Vec::new();
    for start in 0..rows * columns {
        let start = [start / columns, start % columns];
        let mut patch = Vec::new();
        if core::mem::take(&mut open[start]) {
            patch.push(start);
        }
        let mut next = 0;
        while let Some(&[r, c]) = patch.get(next) {
            next += 1;
            let (above, left) = (r.wrapping_sub(1), c.wrapping_sub(1));
            for beside in [[above, c], [r + 1, c], [r, left], [r, c + 1]] {
                if let Some(pixel) = open.get_mut(beside)
                    && core::mem::take(pixel)
                {
                    patch.push(beside);
                }
            }
        }
        if patch.len() > largest.len() {
            largest = patch;
        }
    }
    largest
}
