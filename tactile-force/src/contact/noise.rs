//! The growth of the noise with the signal, estimated from the contact itself.

use super::region::Region;
use super::runs::Run;
use crate::frame::trimmed_variance;

/// Absolute responses of the second-difference filter, in whole grey levels.
pub(super) const RESPONSES: usize = 4081;

/// Pixels beyond which rows are left out.
const ENOUGH: usize = 1 << 13;

/// Fewest pixels from which the noise is estimated.
const FEWEST: u64 = 30;

/// Variance per grey level: that of the pixels brighter than half the peak, by their second differences in both directions
/// (as the reference's own noise, see [`crate::NoiseModel`]), less the background's, over their mean. The edge, where the signal itself bends, is darker.
/// Of a large contact every so many rows are enough: 8 000 pixels know a variance to 2 %, a standard error to half of that.
pub(super) fn gain(region: &Region, histogram: &mut Vec<u64>, background: f64, peak: f32) -> f64 {
    histogram.clear();
    histogram.resize(RESPONSES, 0);
    let columns = region.columns();
    let d = &region.difference;
    let rows = d.len() / columns;
    let (mut count, mut signal) = (0_u64, 0.0);
    let area: usize = region.mask.iter().map(Run::len).sum();
    let stride = area.div_ceil(ENOUGH).max(1);
    let evaluated = |r: &&Run| {
        r.row > 0 && (r.row as usize) + 1 < rows && (r.row as usize).is_multiple_of(stride)
    };
    for run in region.mask.iter().filter(evaluated) {
        let span = run.span(columns);
        let first = span.start.max(run.row as usize * columns + 1);
        let last = span.end.min((run.row as usize + 1) * columns - 1);
        for start in (first..last).step_by(BLOCK) {
            let here = &d[start..last.min(start + BLOCK)];
            let responses = responses(d, start, here.len(), columns);
            for (value, response) in here.iter().zip(responses).filter(|(v, _)| **v > 0.5 * peak) {
                // Rounds; `round` itself is a call where the processor is not known to have it.
                histogram[((response + 0.5) as i32 as usize).min(RESPONSES - 1)] += 1;
                count += 1;
                signal += f64::from(*value);
            }
        }
    }
    if count < FEWEST {
        return 0.0;
    }
    ((trimmed_variance(histogram) / 36.0 - background) * count as f64 / signal).max(0.0)
}

/// Pixels filtered at once.
const BLOCK: usize = 32;

/// Absolute responses at `width` pixels of one row from `start` on, by wide instructions.
fn responses(d: &[f32], start: usize, width: usize, columns: usize) -> [f32; BLOCK] {
    let row = |at: usize| &d[at - 1..at + width + 1];
    let (up, here, down) = (row(start - columns), row(start), row(start + columns));
    let mut responses = [0.0; BLOCK];
    for (k, response) in responses.iter_mut().enumerate().take(width) {
        let corners = up[k] + up[k + 2] + down[k] + down[k + 2];
        let edges = up[k + 1] + down[k + 1] + here[k] + here[k + 2];
        *response = (corners - 2.0 * edges + 4.0 * here[k + 1]).abs();
    }
    responses
}
