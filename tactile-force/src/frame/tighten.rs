//! The box of the pixels above a threshold, within a box of whole tiles.

use super::tiles::TILE_COLUMNS;
use crate::simd::vectorized;
use tactile_core::BoundingBox;

/// Shrinks a box of whole tiles to the pixels with |frame − reference| > threshold, side by side. Both images lie in memory row by row.
pub(super) fn tighten(
    tight: BoundingBox,
    images: [&[u8]; 2],
    columns: usize,
    threshold: u8,
) -> BoundingBox {
    vectorized(Tighten {
        tight,
        images,
        columns,
        threshold,
    })
}

struct Tighten<'a> {
    tight: BoundingBox,
    images: [&'a [u8]; 2],
    columns: usize,
    threshold: u8,
}

impl Tighten<'_> {
    /// Greatest |frame − reference| of every column of a strip, at most a tile wide, over the rows of the box.
    #[inline(always)]
    fn greatest(&self, strip: std::ops::Range<usize>) -> [u8; TILE_COLUMNS] {
        let mut greatest = [0; TILE_COLUMNS];
        for row in self.tight.row_start..self.tight.row_end {
            let [f, r] = self.row(row, strip.clone());
            for ((greatest, f), r) in greatest.iter_mut().zip(f).zip(r) {
                *greatest = f.abs_diff(*r).max(*greatest);
            }
        }
        greatest
    }

    #[inline(always)]
    fn row(&self, row: usize, columns: std::ops::Range<usize>) -> [&[u8]; 2] {
        let first = row * self.columns;
        self.images
            .map(|image| &image[first + columns.start..first + columns.end])
    }

    /// Whether a row of the box has a pixel above the threshold.
    #[inline(always)]
    fn is_over(&self, row: usize) -> bool {
        let [f, r] = self.row(row, self.tight.column_start..self.tight.column_end);
        let mut greatest = 0;
        for (f, r) in f.iter().zip(r) {
            greatest = f.abs_diff(*r).max(greatest);
        }
        greatest > self.threshold
    }
}

impl pulp::NullaryFnOnce for Tighten<'_> {
    type Output = BoundingBox;

    #[inline(always)]
    fn call(mut self) -> BoundingBox {
        while self.tight.rows() > 1 && !self.is_over(self.tight.row_start) {
            self.tight.row_start += 1;
        }
        while self.tight.rows() > 1 && !self.is_over(self.tight.row_end - 1) {
            self.tight.row_end -= 1;
        }
        // The outermost tile of a side has the pixel that is looked for, or the box had been smaller.
        let is_over = |level: &u8| *level > self.threshold;
        let (start, end) = (self.tight.column_start, self.tight.column_end);
        let width = (end - start).min(TILE_COLUMNS);
        let first = self.greatest(start..start + width);
        if let Some(at) = first[..width].iter().position(is_over) {
            self.tight.column_start = start + at;
        }
        let last = self.greatest(end - width..end);
        if let Some(at) = last[..width].iter().rposition(is_over) {
            self.tight.column_end = end - width + at + 1;
        }
        self.tight
    }
}
