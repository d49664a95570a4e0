//! The inner loop of the pass: a strip of eight rows, tile by tile.
//!
//! The sums are linear, so they are taken over the frame alone; those of the reference are known beforehand and are subtracted at the
//! end. Only the extremes of the difference need both images, and only where they may grow: the darkest and the brightest pixel of a tile in either
//! image bound its differences, and most tiles of a frame show less than has been seen before them. So of the reference hardly more is read than what the
//! contact covers. Plain loops over the bytes of a tile, which become the widest instructions of the processor.

use super::tiles::{TILE_COLUMNS, TILE_ROWS};
use crate::simd::vectorized;

/// Most tiles of a strip.
pub(super) const STRIP_TILES: usize = 64;

/// Eight rows of equal length, a whole number of tiles.
pub(super) type Rows<'a> = [&'a [u8]; TILE_ROWS];

/// A row of a tile.
type Row = [u8; TILE_COLUMNS];

/// What the pass keeps of a strip of a frame f, beside what it writes of its tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Strip {
    /// Greatest f − r and greatest r − f so far, zero if negative.
    pub(super) above: u8,
    pub(super) below: u8,
    /// First tile with |f − r| above the threshold, and one past the last; equal if there is none.
    pub(super) hits: [usize; 2],
}

/// A strip of the reference r: its pixels, and the darkest and the brightest of every tile.
#[derive(Clone, Copy)]
pub(super) struct Beside<'a, 'b> {
    pub(super) rows: &'a Rows<'b>,
    pub(super) extremes: &'a [[u8; 2]],
}

/// What a strip receives: Σ f of every tile, and its darkest and brightest pixel.
pub(super) struct OfTiles<'a> {
    pub(super) sums: &'a mut [i32],
    pub(super) extremes: &'a mut [[u8; 2]],
}

/// Compares a strip of the frame with that of the reference, of which differences up to `seen` (upwards, downwards) are known already.
pub(super) fn compare(
    frame: &Rows<'_>,
    reference: Beside<'_, '_>,
    threshold: u8,
    seen: [u8; 2],
    tiles: OfTiles<'_>,
) -> Strip {
    vectorized(Comparison {
        frame,
        reference,
        threshold,
        seen,
        tiles,
    })
}

struct Comparison<'a, 'b> {
    frame: &'a Rows<'b>,
    reference: Beside<'a, 'b>,
    threshold: u8,
    seen: [u8; 2],
    tiles: OfTiles<'a>,
}

impl pulp::NullaryFnOnce for Comparison<'_, '_> {
    type Output = Strip;

    #[inline(always)]
    fn call(self) -> Strip {
        let OfTiles { sums, extremes } = self.tiles;
        let tiles = sums.len();
        let bounds = &self.reference.extremes[..tiles];
        let frame: [&[Row]; TILE_ROWS] = self.frame.map(|row| &row.as_chunks().0[..tiles]);
        let reference: [&[Row]; TILE_ROWS] =
            self.reference.rows.map(|row| &row.as_chunks().0[..tiles]);
        let [above, below] = self.seen;
        let mut strip = Strip {
            above,
            below,
            hits: [0; 2],
        };
        for t in 0..tiles {
            // Tile after tile, so that nothing but its sums leaves the registers: row after row, as memory has the pixels, takes nearly twice as long.
            let (mut low, mut high) = ([u8::MAX; TILE_COLUMNS], [0_u8; TILE_COLUMNS]);
            let mut columns = [0_u16; TILE_COLUMNS];
            for row in frame {
                let f = &row[t];
                // A loop for every width of numbers: mixed, the bytes fill half a register.
                for j in 0..TILE_COLUMNS {
                    low[j] = low[j].min(f[j]);
                    high[j] = high[j].max(f[j]);
                }
                for j in 0..TILE_COLUMNS {
                    // Eight times 255 fits; checked, the sum would be taken pixel by pixel.
                    columns[j] = columns[j].wrapping_add(u16::from(f[j]));
                }
            }
            let (mut sum, mut darkest, mut brightest) = (0, u8::MAX, 0);
            for j in 0..TILE_COLUMNS {
                sum = i32::wrapping_add(sum, i32::from(columns[j]));
                darkest = low[j].min(darkest);
                brightest = high[j].max(brightest);
            }
            (sums[t], extremes[t]) = (sum, [darkest, brightest]);
            let most_above = brightest.saturating_sub(bounds[t][0]);
            let most_below = bounds[t][1].saturating_sub(darkest);
            let known = most_above <= strip.above && most_below <= strip.below;
            if known && most_above.max(most_below) <= self.threshold {
                continue;
            }
            let [highest, deepest] = differences(&frame, &reference, t);
            if highest.max(deepest) > self.threshold {
                if strip.hits[1] == 0 {
                    strip.hits[0] = t;
                }
                strip.hits[1] = t + 1;
            }
            strip.above = strip.above.max(highest);
            strip.below = strip.below.max(deepest);
        }
        strip
    }
}

/// Greatest f − r and greatest r − f of a tile, zero if negative.
#[inline(always)]
fn differences(
    frame: &[&[Row]; TILE_ROWS],
    reference: &[&[Row]; TILE_ROWS],
    tile: usize,
) -> [u8; 2] {
    let (mut above, mut below) = ([0_u8; TILE_COLUMNS], [0_u8; TILE_COLUMNS]);
    for k in 0..TILE_ROWS {
        let (f, r) = (&frame[k][tile], &reference[k][tile]);
        for j in 0..TILE_COLUMNS {
            above[j] = above[j].max(f[j].saturating_sub(r[j]));
            below[j] = below[j].max(r[j].saturating_sub(f[j]));
        }
    }
    let (mut highest, mut deepest) = (0, 0);
    for j in 0..TILE_COLUMNS {
        highest = above[j].max(highest);
        deepest = below[j].max(deepest);
    }
    [highest, deepest]
}
