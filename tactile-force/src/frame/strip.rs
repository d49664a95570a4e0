//! The inner loop of the pass: a strip of eight rows, tile by tile.
//!
//! The sums are linear, so they are taken over the frame alone; those of the reference are known beforehand and are subtracted at the
//! end. Only the extremes of the difference need both images. Plain loops over the bytes of a tile, which become the widest instructions of the
//! processor: some eight for every row of a tile.

use super::tiles::{TILE_COLUMNS, TILE_ROWS};
use crate::simd::vectorized;

/// Most tiles of a strip.
pub(super) const STRIP_TILES: usize = 64;

/// Eight rows of equal length, a whole number of tiles.
pub(super) type Rows<'a> = [&'a [u8]; TILE_ROWS];

/// A row of a tile.
type Row = [u8; TILE_COLUMNS];

/// What the pass keeps of a strip of a frame f, beside the sums of its tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Strip {
    /// Greatest f − r and greatest r − f, zero if negative.
    pub(super) above: u8,
    pub(super) below: u8,
    /// First tile with |f − r| above the threshold, and one past the last; equal if there is none.
    pub(super) hits: [usize; 2],
}

/// Compares a strip of the frame with that of the reference; `sums` receives Σ f of every tile.
pub(super) fn compare(
    frame: &Rows<'_>,
    reference: &Rows<'_>,
    threshold: u8,
    sums: &mut [i32],
) -> Strip {
    vectorized(Comparison {
        frame,
        reference,
        threshold,
        sums,
    })
}

struct Comparison<'a, 'b> {
    frame: &'a Rows<'b>,
    reference: &'a Rows<'b>,
    threshold: u8,
    sums: &'a mut [i32],
}

impl pulp::NullaryFnOnce for Comparison<'_, '_> {
    type Output = Strip;

    #[inline(always)]
    fn call(self) -> Strip {
        let tiles = self.sums.len();
        let frame: [&[Row]; TILE_ROWS] = self.frame.map(|row| &row.as_chunks().0[..tiles]);
        let reference: [&[Row]; TILE_ROWS] = self.reference.map(|row| &row.as_chunks().0[..tiles]);
        let mut strip = Strip::default();
        for t in 0..tiles {
            // Tile after tile, so that nothing but its sums leaves the registers: 0.09 ms for the paper's frame where row after row, as memory has
            // the pixels, takes 0.16. Only a frame that no cache holds comes in slower through eight streams, in 0.23 ms instead of 0.19.
            let (mut above, mut below) = ([0_u8; TILE_COLUMNS], [0_u8; TILE_COLUMNS]);
            let mut columns = [0_u16; TILE_COLUMNS];
            for k in 0..TILE_ROWS {
                let (f, r) = (&frame[k][t], &reference[k][t]);
                // A loop for every width of numbers: mixed, the bytes fill half a register.
                for j in 0..TILE_COLUMNS {
                    above[j] = above[j].max(f[j].saturating_sub(r[j]));
                    below[j] = below[j].max(r[j].saturating_sub(f[j]));
                }
                for j in 0..TILE_COLUMNS {
                    // Eight times 255 fits; checked, the sum would be taken pixel by pixel.
                    columns[j] = columns[j].wrapping_add(u16::from(f[j]));
                }
            }
            let (mut sum, mut highest, mut deepest) = (0, 0, 0);
            for j in 0..TILE_COLUMNS {
                sum = i32::wrapping_add(sum, i32::from(columns[j]));
                highest = above[j].max(highest);
                deepest = below[j].max(deepest);
            }
            self.sums[t] = sum;
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
