//! The growth of the noise with the signal, estimated from the contact itself.

use super::region::Region;
use super::runs::Run;
use crate::frame::trimmed_variance;
use crate::simd::vectorized;

/// Buffers of the estimate.
#[derive(Clone, Debug, Default)]
pub(super) struct NoiseWorkspace {
    histogram: Vec<u64>,
    bends: Vec<f32>,
}

/// Absolute responses of the second-difference filter, in whole grey levels.
const RESPONSES: usize = 4081;

/// Pixels beyond which some are left out.
const ENOUGH: f64 = 8192.0;

/// Fewest pixels from which the noise is estimated.
const FEWEST: u64 = 30;

/// Variance per grey level: that of the pixels brighter than half the peak, by their second differences in both directions
/// (as the reference's own noise, see [`crate::NoiseModel`]), less the background's, over their mean. The edge, where the signal itself bends, is darker.
/// Of a large contact every so many rows and columns are enough: 8 000 pixels know a variance to 2 %, a standard error to half of that.
pub(super) fn gain(
    region: &Region,
    workspace: &mut NoiseWorkspace,
    background: f64,
    peak: f32,
) -> f64 {
    let NoiseWorkspace { histogram, bends } = workspace;
    histogram.clear();
    histogram.resize(RESPONSES, 0);
    let columns = region.columns();
    let d = &region.difference;
    let rows = d.len() / columns;
    let (mut count, mut signal, mut highest) = (0_u64, 0.0, 0);
    let area: usize = region.mask.iter().map(Run::len).sum();
    let step = (area as f64 / ENOUGH).sqrt().ceil() as usize;
    let [every_row, every_column] = region.every_nth(&region.mask, step);
    for run in &region.mask {
        let row = run.row as usize;
        if row == 0 || row + 1 >= rows || !every_row.contains(row) {
            continue;
        }
        let inner = (run.start as usize).max(1)..(run.end as usize).min(columns - 1);
        if inner.is_empty() {
            continue;
        }
        let span = inner.start - 1..inner.end + 1;
        let line = |y: usize| &d[y * columns + span.start..y * columns + span.end];
        let here = line(row);
        bends.clear();
        bends.resize(span.len(), 0.0);
        vectorized(Bends {
            lines: [line(row - 1), here, line(row + 1)],
            bends,
        });
        // Walked by the iterator itself: a loop over two chained parts asks at every step which one it is in.
        every_column.within(inner).for_each(|column| {
            let at = column - span.start;
            if here[at] > 0.5 * peak {
                let [left, middle, right] = [bends[at - 1], bends[at], bends[at + 1]];
                let response = (left - 2.0 * middle + right).abs();
                // Rounds; `round` itself is a call where the processor is not known to have it.
                let bin = ((response + 0.5) as i32 as usize).min(RESPONSES - 1);
                histogram[bin] += 1;
                highest = bin.max(highest);
                count += 1;
                signal += f64::from(here[at]);
            }
        });
    }
    if count < FEWEST {
        return 0.0;
    }
    let seen = &histogram[..=highest];
    ((trimmed_variance(seen) / 36.0 - background) * count as f64 / signal).max(0.0)
}

/// Second differences across three rows.
struct Bends<'a> {
    lines: [&'a [f32]; 3],
    bends: &'a mut [f32],
}

impl pulp::NullaryFnOnce for Bends<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let [up, here, down] = self.lines;
        for (((bend, up), here), down) in self.bends.iter_mut().zip(up).zip(here).zip(down) {
            *bend = up - 2.0 * here + down;
        }
    }
}
