//! The pass over a frame, which reads every pixel once.

use ndarray::{ArrayView2, Zip};

use super::statistics::FrameStatistics;
use super::strip::{OfTiles, summarise};
use super::tiles::{TILE_COLUMNS, TILE_ROWS, Tiles};

/// The tiles of an image in standard layout and of nonzero size, and the number of its pixels at 255. `band` is scratch.
pub(super) fn scan(
    image: &[u8],
    size: (usize, usize),
    tiles: &mut Tiles,
    band: &mut Vec<u8>,
) -> usize {
    tiles.reset(size);
    let mut saturated = 0;
    for (number, rows) in image.chunks(TILE_ROWS * size.1).enumerate() {
        let here = number * tiles.columns..(number + 1) * tiles.columns;
        let brightest = &mut tiles.brightest[here.clone()];
        let of_band = OfTiles {
            sums: &mut tiles.sums[here.clone()],
            darkest: &mut tiles.darkest[here],
            brightest,
        };
        // As memory has them, pixels that come from far arrive in half the time that they take where tiles fetch them from eight rows in turn.
        band.clear();
        band.extend_from_slice(rows);
        summarise_band(band, size.1, of_band);
        if brightest.contains(&u8::MAX) {
            let full = rows.iter().map(|&p| usize::from(p == u8::MAX));
            saturated += full.sum::<usize>();
        }
    }
    saturated
}

/// The tiles of up to eight rows.
fn summarise_band(rows: &[u8], width: usize, mut tiles: OfTiles<'_>) {
    let is_whole = rows.len() == TILE_ROWS * width;
    let whole = if is_whole { width / TILE_COLUMNS } else { 0 };
    if is_whole {
        let row = |k: usize| rows[k * width..(k + 1) * width].as_chunks().0;
        summarise(std::array::from_fn(row), tiles.first(whole));
    }
    // At the image's edges some have fewer rows or columns.
    for tile in whole..tiles.sums.len() {
        let columns = tile * TILE_COLUMNS..width.min((tile + 1) * TILE_COLUMNS);
        let (mut sum, mut darkest, mut brightest) = (0, u8::MAX, 0);
        for row in rows.chunks(width) {
            for &pixel in &row[columns.clone()] {
                sum += i32::from(pixel);
                darkest = darkest.min(pixel);
                brightest = brightest.max(pixel);
            }
        }
        tiles.sums[tile] = sum;
        (tiles.darkest[tile], tiles.brightest[tile]) = (darkest, brightest);
    }
}

impl FrameStatistics {
    /// The tiles give extremes on their own side of zero only; where every difference is on one side, computes them anew.
    pub(super) fn correct_extremes(
        &mut self,
        frame: ArrayView2<'_, u8>,
        reference: ArrayView2<'_, u8>,
    ) {
        let all_equal = self.least == 0 && self.greatest == 0;
        if all_equal || (self.least < 0 && self.greatest > 0) {
            return;
        }
        (self.least, self.greatest) = (i16::MAX, i16::MIN);
        Zip::from(frame).and(reference).for_each(|&f, &r| {
            let d = i16::from(f) - i16::from(r);
            self.least = self.least.min(d);
            self.greatest = self.greatest.max(d);
        });
    }
}
