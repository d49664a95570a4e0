//! How the noise grows with the signal, from the contact itself.

use super::region::Region;
use crate::frame::trimmed_variance;

/// Absolute responses of the second-difference filter, in whole grey levels.
pub(super) const RESPONSES: usize = 4081;

/// Fewest pixels that say something of the noise.
const FEWEST: u64 = 30;

/// Variance per grey level: that of the pixels brighter than half the peak, by their second differences in both directions
/// (see [`crate::NoiseModel::of_frame`]), less the background's, over their mean. The rim, where the signal itself bends, is darker.
pub(super) fn gain(region: &Region, histogram: &mut Vec<u64>, background: f64, peak: f32) -> f64 {
    histogram.clear();
    histogram.resize(RESPONSES, 0);
    let columns = region.columns();
    let d = &region.difference;
    let rows = d.len() / columns;
    let (mut count, mut signal) = (0_u64, 0.0);
    for run in region.mask.iter().filter(|r| r.row > 0 && (r.row as usize) + 1 < rows) {
        let span = run.span(columns);
        let first = span.start.max(run.row as usize * columns + 1);
        let last = span.end.min((run.row as usize + 1) * columns - 1);
        for at in (first..last).filter(|at| d[*at] > 0.5 * peak) {
            let (up, down) = (at - columns, at + columns);
            let corners = d[up - 1] + d[up + 1] + d[down - 1] + d[down + 1];
            let edges = d[up] + d[down] + d[at - 1] + d[at + 1];
            let response = (corners - 2.0 * edges + 4.0 * d[at]).abs();
            histogram[(response.round() as usize).min(RESPONSES - 1)] += 1;
            count += 1;
            signal += f64::from(d[at]);
        }
    }
    if count < FEWEST {
        return 0.0;
    }
    ((trimmed_variance(histogram) / 36.0 - background) * count as f64 / signal).max(0.0)
}
