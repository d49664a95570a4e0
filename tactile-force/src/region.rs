//! The region of a frame around a contact: its differences, mask and aperture as runs of pixels,
//! and the sums over them.
//!
//! Thresholding, labelling, filling and dilation of runs cost time in proportion to the outline
//! rather than the area.

use std::ops::Range;

use ndarray::ArrayView2;
use tactile_core::{BoundingBox, Loop, vectorised};

use crate::drift::{DriftLine, IlluminationDrift};
use crate::flat_field::FlatLine;
use crate::frame::{Levels, ReferenceFrame, neighbours};
use crate::noise::{DifferenceNoise, trimmed_variance};
use crate::runs::{Components, Run, grow, push_runs};

/// Differences over one box, row-major, with its contact as runs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Region {
    pub place: Option<BoundingBox>,
    /// Corrected frame − reference, with the sign chosen so that contact is positive.
    pub difference: Vec<f32>,
    /// The contact.
    pub mask: Vec<Run>,
    /// The contact with a margin, over which sums run.
    pub aperture: Vec<Run>,
    /// The mask as pixels, 1 inside.
    pub pixels: Vec<u8>,
    components: Components,
    scratch: Vec<Run>,
    smooth: Vec<f32>,
    column_sums: Vec<f32>,
}

/// Size of a mask.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub area: usize,
    /// Number of other components that are not small.
    pub others: usize,
}

impl Region {
    /// Number of columns.
    pub(crate) fn columns(&self) -> usize {
        self.place.map_or(1, |p| p.columns())
    }

    /// Loads the differences inside a box, corrected for drift and vignetting. Returns the largest
    /// of them, or zero if none is positive.
    pub(crate) fn load(
        &mut self,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        place: BoundingBox,
        drift: &IlluminationDrift,
        sign: f32,
    ) -> f32 {
        self.place = Some(place);
        // All pixels are written below.
        self.difference.resize(place.rows() * place.columns(), 0.0);
        let (first_column, flat) = (place.column_start, reference.flat_field());
        let lines = |y: usize| {
            let row = place.row_start + y;
            let drift = (!drift.is_zero()).then(|| drift.line(row, first_column));
            (drift, flat.map(|flat| flat.line(row, first_column)))
        };
        let (frame, differences) = (place.of(frame), &mut self.difference);
        let greatest = match reference.levels() {
            Levels::Whole(levels) => take(frame, place.of(levels), lines, sign, differences),
            Levels::Fine(levels) => take(frame, place.of(levels), lines, sign, differences),
        };
        self.mend(reference, place);
        greatest
    }

    /// Gives hot and dead pixels the mean of their neighbours.
    fn mend(&mut self, reference: &ReferenceFrame, place: BoundingBox) {
        let (rows, columns) = (place.rows(), place.columns());
        for (row, column) in reference.defects_in(place) {
            let (y, x) = (row - place.row_start, column - place.column_start);
            let beside = neighbours((y, x), (rows, columns));
            let sum = beside.fold((0.0, 0.0), |sum, (y, x)| {
                (sum.0 + self.difference[y * columns + x], sum.1 + 1.0)
            });
            self.difference[y * columns + x] = sum.0 / f32::max(sum.1, 1.0);
        }
    }

    /// Applies the threshold to the mean over a box of `width` pixels, keeps the largest component
    /// and fills its holes.
    pub(crate) fn segment(&mut self, width: usize, limit: f32, notable: usize) -> Extent {
        let columns = self.columns();
        let rows = self.difference.len() / columns;
        // Compared with sums instead of means, which saves a division per pixel.
        let limit = limit * (width * width) as f32;
        let smooth = if width == 1 {
            &self.difference
        } else {
            box_sums(
                &self.difference,
                columns,
                width,
                &mut self.column_sums,
                &mut self.smooth,
            );
            &self.smooth
        };
        self.mask.clear();
        let mask = &mut self.mask;
        vectorised(
            #[inline(always)]
            || {
                for (y, row) in smooth.chunks(columns).enumerate() {
                    push_runs(mask, y, row, |s| *s > limit);
                }
            },
        );
        let (kept, others) = self.components.keep_largest(&mut self.mask, notable);
        let filled = self
            .components
            .fill_holes(&mut self.mask, &mut self.scratch, rows, columns);
        Extent {
            area: kept + filled,
            others,
        }
    }

    /// Extends the mask to the aperture and paints the pixels.
    pub(crate) fn finish(&mut self, margin: usize) {
        let columns = self.columns();
        grow(
            &self.mask,
            &mut self.aperture,
            margin,
            self.difference.len() / columns,
            columns,
        );
        self.pixels.clear();
        self.pixels.resize(self.difference.len(), 0);
        for run in &self.mask {
            self.pixels[run.span(columns)].fill(1);
        }
    }

    /// Every n-th row and column of the pixels of some runs.
    pub(crate) fn every_nth(&self, runs: &[Run], step: usize) -> [EveryNth; 2] {
        let start = runs.iter().map(|run| run.start).min().unwrap_or(0) as usize;
        let end = runs.iter().map(|run| run.end).max().unwrap_or(1) as usize;
        let first = runs.first().map_or(0, |run| run.row) as usize;
        let last = runs.last().map_or(0, |run| run.row) as usize;
        [
            EveryNth::of(first..last + 1, step),
            EveryNth::of(start..end, step),
        ]
    }

    /// Bounding box of runs in frame coordinates.
    pub(crate) fn bounds(&self, runs: &[Run]) -> Option<BoundingBox> {
        let place = self.place?;
        let boxes = runs.iter().map(|r| BoundingBox {
            row_start: place.row_start + r.row as usize,
            row_end: place.row_start + r.row as usize + 1,
            column_start: place.column_start + r.start as usize,
            column_end: place.column_start + r.end as usize,
        });
        boxes.reduce(BoundingBox::union)
    }
}

/// Sums over a box of odd width centred at each pixel. Values outside the region are zero.
fn box_sums(
    difference: &[f32],
    columns: usize,
    width: usize,
    scratch: &mut Vec<f32>,
    sums: &mut Vec<f32>,
) {
    let (rows, half) = (difference.len() / columns, width / 2);
    scratch.clear();
    scratch.resize(columns, 0.0);
    sums.clear();
    sums.resize(difference.len(), 0.0);
    let row = |y: usize| &difference[y * columns..(y + 1) * columns];
    for y in 0..half.min(rows) {
        scratch.iter_mut().zip(row(y)).for_each(|(s, d)| *s += d);
    }
    for y in 0..rows {
        if y + half < rows {
            scratch
                .iter_mut()
                .zip(row(y + half))
                .for_each(|(s, d)| *s += d);
        }
        if y > half {
            scratch
                .iter_mut()
                .zip(row(y - half - 1))
                .for_each(|(s, d)| *s -= d);
        }
        // The window sums slide along rows and columns, so the cost does not depend on the width.
        let mut running: f32 = scratch[..half.min(columns)].iter().sum();
        for (x, sum) in sums[y * columns..(y + 1) * columns].iter_mut().enumerate() {
            running += scratch.get(x + half).copied().unwrap_or(0.0);
            if x > half {
                running -= scratch[x - half - 1];
            }
            *sum = running;
        }
    }
}

/// Writes the differences of a box. Returns the largest of them, or zero if none is positive.
/// `lines` holds the corrections along each row, and `sign` is −1 if contact darkens.
fn take<P: Copy + Into<f32>>(
    frame: ArrayView2<'_, u8>,
    levels: ArrayView2<'_, P>,
    lines: impl Fn(usize) -> (Option<DriftLine>, Option<FlatLine>),
    sign: f32,
    differences: &mut [f32],
) -> f32 {
    let rows = differences.chunks_exact_mut(frame.ncols()).enumerate();
    let mut greatest = 0.0;
    for ((y, differences), (frame, levels)) in rows.zip(frame.rows().into_iter().zip(levels.rows()))
    {
        let (drift, flat) = lines(y);
        let mut take = |frame: &[u8], levels: &[P]| {
            let row = Row {
                frame,
                levels,
                drift,
                flat,
                sign,
                differences,
            };
            greatest = larger(greatest, vectorised(row));
        };
        match (frame.to_slice(), levels.to_slice()) {
            (Some(frame), Some(levels)) => take(frame, levels),
            _ => take(&frame.to_vec(), &levels.to_vec()),
        }
    }
    greatest
}

/// One row. The largest difference is computed while the row is in the first-level cache.
struct Row<'a, P> {
    frame: &'a [u8],
    levels: &'a [P],
    drift: Option<DriftLine>,
    flat: Option<FlatLine>,
    sign: f32,
    differences: &'a mut [f32],
}

impl<P: Copy + Into<f32>> Loop for Row<'_, P> {
    type Output = f32;

    #[inline(always)]
    fn run(self) -> f32 {
        let Self {
            differences, sign, ..
        } = self;
        let n = differences.len();
        let (frame, levels) = (&self.frame[..n], &self.levels[..n]);
        match self.drift {
            None => {
                for x in 0..n {
                    differences[x] = sign * (f32::from(frame[x]) - levels[x].into());
                }
            }
            Some(line) => {
                for x in 0..n {
                    let (frame, level) = (f32::from(frame[x]), levels[x].into());
                    differences[x] = sign * line.difference(x, frame, level);
                }
            }
        }
        if let Some(flat) = self.flat {
            for (x, difference) in differences.iter_mut().enumerate() {
                *difference /= flat.at(x);
            }
        }
        greatest_of(differences)
    }
}

/// Largest of the values, or zero if none is positive.
pub(crate) fn greatest(values: &[f32]) -> f32 {
    vectorised(
        #[inline(always)]
        || greatest_of(values),
    )
}

#[inline(always)]
fn greatest_of(values: &[f32]) -> f32 {
    let mut lanes = [0.0_f32; 16];
    let (chunks, rest) = values.as_chunks::<16>();
    for chunk in chunks {
        lanes = std::array::from_fn(|k| larger(lanes[k], chunk[k]));
    }
    lanes.iter().chain(rest).copied().fold(0.0, larger)
}

/// The larger of two values, or the first if the second is NaN. This comparison has a SIMD
/// instruction.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

/// Buffers of the estimate.
#[derive(Clone, Debug, Default)]
pub(crate) struct NoiseWorkspace {
    histogram: Vec<u64>,
    bends: Vec<f32>,
}

/// Number of absolute responses of the second-difference filter, in integer grey levels.
const RESPONSES: usize = 4081;

/// Gain of the noise: the variance of the pixels brighter than half the peak, minus that of the
/// background, over their mean. The variance comes from second differences in both directions, like
/// the noise of the reference (see [`crate::NoiseModel`]). The edge, where the signal itself bends,
/// is darker and not included. For a large contact every n-th row and column is enough: 8 000
/// pixels determine a variance to 2 %, and a standard error to half of that.
pub(crate) fn gain(
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
    let step = (area as f64 / 8192.0).sqrt().ceil() as usize;
    let [every_row, every_column] = region.every_nth(&region.mask, step);
    for run in &region.mask {
        let row = run.row as usize;
        if row == 0 || row + 1 >= rows || !every_row.contains(row) {
            continue;
        }
        // The filter extends one pixel to each side.
        let inner = (run.start as usize).max(1)..(run.end as usize).min(columns - 1);
        if inner.is_empty() {
            continue;
        }
        let span = inner.start - 1..inner.end + 1;
        let line = |y: usize| &d[y * columns + span.start..y * columns + span.end];
        let here = line(row);
        bends.clear();
        bends.resize(span.len(), 0.0);
        let (up, down) = (line(row - 1), line(row + 1));
        vectorised(
            #[inline(always)]
            || {
                for (((bend, up), here), down) in bends.iter_mut().zip(up).zip(here).zip(down) {
                    *bend = up - 2.0 * here + down;
                }
            },
        );
        // Uses internal iteration: a loop over two chained ranges would test at each step which
        // range it is in.
        every_column.within(inner).for_each(|column| {
            let at = column - span.start;
            if here[at] > 0.5 * peak {
                let [left, middle, right] = [bends[at - 1], bends[at], bends[at + 1]];
                let response = (left - 2.0 * middle + right).abs();
                // Rounds by hand. `round` is a function call if the code is compiled for older
                // processors.
                let bin = ((response + 0.5) as i32 as usize).min(RESPONSES - 1);
                histogram[bin] += 1;
                highest = bin.max(highest);
                count += 1;
                signal += f64::from(here[at]);
            }
        });
    }
    // Fewer pixels do not reveal their noise.
    if count < 30 {
        return 0.0;
    }
    let seen = &histogram[..=highest];
    // The filter response has 36 times the variance of a pixel. The excess over the background is
    // proportional to the signal.
    ((trimmed_variance(seen) / 36.0 - background) * count as f64 / signal).max(0.0)
}

/// Every n-th number of a range, counted from its middle to both sides. The selected rows and
/// columns of a contact therefore do not change if the image is mirrored, rotated or shifted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EveryNth {
    /// The middle of the range, rounded down and up.
    low: usize,
    high: usize,
    step: usize,
}

impl EveryNth {
    /// Creates the selection from a non-empty range.
    pub(crate) fn of(range: Range<usize>, step: usize) -> Self {
        let ends = range.start + range.end.saturating_sub(1);
        Self {
            low: ends / 2,
            high: ends.div_ceil(2),
            step: step.max(1),
        }
    }

    /// Whether a number is selected.
    pub(crate) fn contains(&self, at: usize) -> bool {
        let away = if at <= self.low {
            self.low - at
        } else {
            at - self.high
        };
        away.is_multiple_of(self.step)
    }

    /// The selected numbers within a range, in order.
    #[inline]
    pub(crate) fn within(&self, range: Range<usize>) -> impl Iterator<Item = usize> {
        let step = self.step;
        let first = range.start + self.low.saturating_sub(range.start) % step;
        let down = (first..range.end.min(self.low + 1)).step_by(step);
        // If both middles coincide, they are counted once.
        let above = if self.low == self.high {
            self.high + step
        } else {
            self.high
        };
        let skipped = range.start.saturating_sub(above).next_multiple_of(step);
        down.chain((above + skipped..range.end).step_by(step))
    }
}

/// Sums over the aperture. Coordinates are relative to the first pixel of the region.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    /// Number of pixels and their moments: 1, x, y, x², y².
    pub plain: [f64; 5],
    /// The same moments weighted by the difference.
    pub weighted: [f64; 5],
}

impl Sums {
    /// Computes the sums. `columns` is working memory.
    pub(crate) fn over(region: &Region, columns: &mut Vec<f64>) -> Self {
        let mut plain = [0.0; 5];
        for run in &region.aperture {
            let (y, n) = (f64::from(run.row), run.len() as f64);
            let (first, last) = (f64::from(run.start), f64::from(run.end) - 1.0);
            // Σ x and Σ x² of consecutive integers.
            let cubes = |t: f64| t * (t + 1.0) * (2.0 * t + 1.0) / 6.0;
            let terms = [
                n,
                0.5 * n * (first + last),
                y * n,
                cubes(last) - cubes(first - 1.0),
                y * y * n,
            ];
            for (sum, term) in plain.iter_mut().zip(terms) {
                *sum += term;
            }
        }
        columns.clear();
        columns.resize(region.columns(), 0.0);
        let [d, dy, dyy] = vectorised(Moments { region, columns });
        let (mut dx, mut dxx) = (0.0, 0.0);
        for (x, column) in columns.iter().enumerate() {
            let x = x as f64;
            dx += x * column;
            dxx += x * x * column;
        }
        Self {
            plain,
            weighted: [d, dx, dy, dxx, dyy],
        }
    }

    pub(crate) fn sum(&self) -> f64 {
        self.weighted[0]
    }

    pub(crate) fn centroid(&self) -> [f64; 2] {
        [
            self.weighted[1] / self.weighted[0],
            self.weighted[2] / self.weighted[0],
        ]
    }

    /// Variance of Σ d: from the noise of each pixel and from the common errors of background and
    /// scale, which are fully correlated.
    pub(crate) fn variance(&self, noise: &DifferenceNoise) -> f64 {
        // Independent noise adds in quadrature. Errors of background and scale have one cause, so
        // they are added before squaring.
        noise.background * self.plain[0]
            + noise.gain * self.weighted[0].max(0.0)
            + (noise.common.sqrt() * self.plain[0] + noise.scale.sqrt() * self.weighted[0]).powi(2)
            + noise.flat_field * self.weighted[0] * self.weighted[0]
    }

    /// Variance of the centroid along x (0) or y (1): Σ var(d) (x − x̄)²/(Σ d)², plus the effect of
    /// the common error.
    pub(crate) fn centroid_variance(&self, axis: usize, noise: &DifferenceNoise) -> f64 {
        let at = self.centroid()[axis];
        let about = |s: &[f64; 5]| s[3 + axis] - 2.0 * at * s[1 + axis] + at * at * s[0];
        let lever = self.plain[1 + axis] - at * self.plain[0];
        let total = self.weighted[0];
        let white =
            noise.background * about(&self.plain) + noise.gain * about(&self.weighted).max(0.0);
        (white + noise.common * lever * lever) / (total * total)
    }
}

/// Σ d for each column of the aperture, and Σ d, Σ y d, Σ y² d. With these, moments need no product
/// per pixel.
struct Moments<'a> {
    region: &'a Region,
    columns: &'a mut [f64],
}

impl Loop for Moments<'_> {
    type Output = [f64; 3];

    #[inline(always)]
    fn run(self) -> [f64; 3] {
        const LANES: usize = 8;
        let width = self.region.columns();
        let mut moments = [0.0; 3];
        for run in &self.region.aperture {
            let columns = &mut self.columns[run.start as usize..run.end as usize];
            let (columns, rest) = columns.as_chunks_mut::<LANES>();
            let (chunks, tail) = self.region.difference[run.span(width)].as_chunks::<LANES>();
            // Summed in lanes, so that no addition waits for the previous one.
            let mut lanes = [0.0; LANES];
            for (columns, chunk) in columns.iter_mut().zip(chunks) {
                for k in 0..LANES {
                    let d = f64::from(chunk[k]);
                    columns[k] += d;
                    lanes[k] += d;
                }
            }
            for (column, d) in rest.iter_mut().zip(tail) {
                *column += f64::from(*d);
                lanes[0] += f64::from(*d);
            }
            let (y, sum) = (f64::from(run.row), lanes.iter().sum::<f64>());
            moments[0] += sum;
            moments[1] += y * sum;
            moments[2] += y * y * sum;
        }
        moments
    }
}

#[cfg(test)]
#[path = "region_tests.rs"]
mod tests;
