//! The region of a frame around a contact: its differences, the mask and the aperture.

use ndarray::ArrayView2;

use super::differences;
use super::every_nth::EveryNth;
use super::runs::{self, Components, Run, push_runs};
use crate::drift::IlluminationDrift;
use crate::frame::ReferenceFrame;
use crate::simd::vectorized;
use tactile_core::BoundingBox;

/// Differences over one box, row-major, and the contact in it as runs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Region {
    pub(crate) place: Option<BoundingBox>,
    /// Corrected frame − reference, sign turned so that contact is positive.
    pub(crate) difference: Vec<f32>,
    /// The contact.
    pub(crate) mask: Vec<Run>,
    /// The contact and a margin around it, over which sums run.
    pub(crate) aperture: Vec<Run>,
    /// The mask pixel by pixel, 1 inside.
    pub(crate) pixels: Vec<u8>,
    components: Components,
    scratch: Vec<Run>,
    smooth: Vec<f32>,
    column_sums: Vec<f32>,
}

/// A mask's size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) area: usize,
    /// Other components that are not small.
    pub(super) others: usize,
}

impl Region {
    /// Number of columns.
    pub(crate) fn columns(&self) -> usize {
        self.place.map_or(1, |p| p.columns())
    }

    /// Takes the differences inside a box, corrected for drift and vignetting, and returns the greatest of them, zero if none is positive.
    pub(super) fn load(
        &mut self,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        place: BoundingBox,
        drift: &IlluminationDrift,
        sign: f32,
    ) -> f32 {
        self.place = Some(place);
        // Every pixel is written below.
        self.difference.resize(place.rows() * place.columns(), 0.0);
        let rows = differences::Rows {
            frame,
            levels: reference.levels(),
            place,
            drift: (!drift.is_zero()).then_some(drift),
            flat: reference.flat_field(),
            sign,
        };
        rows.take(&mut self.difference)
    }

    /// Thresholds the mean over a box of `width` pixels, keeps the largest component and fills its holes.
    pub(super) fn segment(&mut self, width: usize, limit: f32, notable: usize) -> Extent {
        let columns = self.columns();
        let rows = self.difference.len() / columns;
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
        vectorized(Threshold {
            mask: &mut self.mask,
            smooth,
            columns,
            limit,
        });
        let (kept, others) = self.components.keep_largest(&mut self.mask, notable);
        let filled = self
            .components
            .fill_holes(&mut self.mask, &mut self.scratch, rows, columns);
        Extent {
            area: kept + filled,
            others,
        }
    }

    /// Grows the mask to the aperture and paints the pixels.
    pub(super) fn finish(&mut self, margin: usize) {
        let columns = self.columns();
        runs::grow(
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

    /// Every so many rows and columns of what runs cover.
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

    /// Box of runs in frame coordinates.
    pub(super) fn bounds(&self, runs: &[Run]) -> Option<BoundingBox> {
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

/// The runs of every row of a smoothed region that exceed a limit.
struct Threshold<'a> {
    mask: &'a mut Vec<Run>,
    smooth: &'a [f32],
    columns: usize,
    limit: f32,
}

impl pulp::NullaryFnOnce for Threshold<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for (y, row) in self.smooth.chunks(self.columns).enumerate() {
            push_runs(self.mask, y, row, |s| *s > self.limit);
        }
    }
}

/// Sums over a box of odd width centred at every pixel; beyond the region there is nothing to add.
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn box_sums_are_sums_over_boxes(
            values in proptest::collection::vec(-255_i32..256, 1..200), columns in 1_usize..20, half in 0_usize..7
        ) {
            let rows = values.len() / columns;
            prop_assume!(rows > 0);
            let values: Vec<f32> = values[..rows * columns].iter().map(|v| *v as f32).collect();
            let mut sums = Vec::new();
            box_sums(&values, columns, 2 * half + 1, &mut Vec::new(), &mut sums);
            for y in 0..rows {
                for x in 0..columns {
                    let mut expected = 0.0;
                    for v in y.saturating_sub(half)..(y + half + 1).min(rows) {
                        for u in x.saturating_sub(half)..(x + half + 1).min(columns) {
                            expected += values[v * columns + u];
                        }
                    }
                    // Whole numbers below 2²⁴: exact.
                    prop_assert_eq!(sums[y * columns + x], expected);
                }
            }
        }
    }
}
