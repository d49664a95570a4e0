//! The growth of the noise with the signal, estimated from the contact itself.

use super::region::Region;
use super::runs::Run;
use crate::frame::trimmed_variance;

/// Absolute responses of the second-difference filter, in whole grey levels.
pub(super) const RESPONSES: usize = 4081;

/// Pixels beyond which some are left out.
const ENOUGH: f64 = 8192.0;

/// Fewest pixels from which the noise is estimated.
const FEWEST: u64 = 30;

/// Variance per grey level: that of the pixels brighter than half the peak, by their second differences in both directions
/// (as the reference's own noise, see [`crate::NoiseModel`]), less the background's, over their mean. The edge, where the signal itself bends, is darker.
/// Of a large contact every so many rows and columns are enough: 8 000 pixels know a variance to 2 %, a standard error to half of that.
pub(super) fn gain(region: &Region, histogram: &mut Vec<u64>, background: f64, peak: f32) -> f64 {
    histogram.clear();
    histogram.resize(RESPONSES, 0);
    let columns = region.columns();
    let d = &region.difference;
    let rows = d.len() / columns;
    let (mut count, mut signal) = (0_u64, 0.0);
    let area: usize = region.mask.iter().map(Run::len).sum();
    let step = (area as f64 / ENOUGH).sqrt().ceil() as usize;
    let [every_row, every_column] = region.every_nth(&region.mask, step);
    for run in &region.mask {
        let row = run.row as usize;
        if row == 0 || row + 1 >= rows || !every_row.contains(row) {
            continue;
        }
        let inner = (run.start as usize).max(1)..(run.end as usize).min(columns - 1);
        for column in every_column.within(inner) {
            let at = row * columns + column;
            if d[at] > 0.5 * peak {
                // Rounds; `round` itself is a call where the processor is not known to have it.
                let bin = (response(d, at, columns) + 0.5) as i32 as usize;
                histogram[bin.min(RESPONSES - 1)] += 1;
                count += 1;
                signal += f64::from(d[at]);
            }
        }
    }
    if count < FEWEST {
        return 0.0;
    }
    ((trimmed_variance(histogram) / 36.0 - background) * count as f64 / signal).max(0.0)
}

/// The absolute second difference in both directions at a pixel that has neighbours on every side.
fn response(d: &[f32], at: usize, columns: usize) -> f32 {
    let row = |at: usize| [d[at - 1], d[at], d[at + 1]];
    let [up, here, down] = [row(at - columns), row(at), row(at + columns)];
    let corners = up[0] + up[2] + down[0] + down[2];
    let edges = up[1] + down[1] + here[0] + here[2];
    (corners - 2.0 * edges + 4.0 * here[1]).abs()
}
