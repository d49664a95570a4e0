//! How far a frame differs from its reference, and where: read off the extremes of the tiles of both, and of the pixels where these leave it open.
//!
//! With f₋ and f₊ the darkest and the brightest pixel of a tile of the frame, r₋ and r₊ those of the reference, the greatest f − r of the tile is between f₊ − r₊
//! and f₊ − r₋, the greatest r − f between r₋ − f₋ and r₊ − f₋. So hardly more of the reference is read than the tiles of the brightest differences and those of the
//! contact's edge.

use std::ops::Range;

use super::tiles::{TILE_COLUMNS, Tiles};
use crate::simd::vectorized;
use tactile_core::BoundingBox;

/// An image in standard layout with its tiles.
#[derive(Clone, Copy)]
pub(super) struct Tiled<'a> {
    pub(super) image: &'a [u8],
    pub(super) tiles: &'a Tiles,
}

/// A frame f beside its reference r, both of the same size (rows, columns).
pub(super) struct Pair<'a> {
    pub(super) frame: Tiled<'a>,
    pub(super) reference: Tiled<'a>,
    pub(super) size: (usize, usize),
}

impl Pair<'_> {
    /// Greatest f − r and greatest r − f, zero if negative.
    pub(super) fn greatest(&self) -> [u8; 2] {
        let tiles = self.frame.tiles;
        let mut greatest = self.least();
        for band in 0..tiles.rows {
            let here = self.band(band);
            if !self.may_exceed(here.clone(), greatest) {
                continue;
            }
            for tile in here {
                let [above, below] = self.of_tile(tile).map(|[_, most]| most);
                if above > greatest[0] || below > greatest[1] {
                    greatest = larger(greatest, self.differences(tile));
                }
            }
        }
        greatest
    }

    /// The box of the tiles in which |f − r| exceeds a threshold.
    pub(super) fn tiles_above(&self, threshold: u8) -> Option<BoundingBox> {
        let (size, tiles) = (self.size, self.frame.tiles);
        let of_band = |band: usize| {
            let mut here = self.band(band);
            if !self.may_exceed(here.clone(), [threshold; 2]) {
                return None;
            }
            // Those between the outermost are not looked at.
            let first = here.find(|&tile| self.exceeds(tile, threshold))?;
            let last = here.rfind(|&tile| self.exceeds(tile, threshold));
            let last = last.unwrap_or(first);
            Some(tiles.pixels(first, size).union(tiles.pixels(last, size)))
        };
        (0..tiles.rows)
            .filter_map(of_band)
            .reduce(BoundingBox::union)
    }

    /// The tiles of a band.
    fn band(&self, band: usize) -> Range<usize> {
        let columns = self.frame.tiles.columns;
        band * columns..(band + 1) * columns
    }

    /// Whether |f − r| exceeds a threshold in a tile.
    fn exceeds(&self, tile: usize, threshold: u8) -> bool {
        let exceeds = |[above, below]: [u8; 2]| above.max(below) > threshold;
        let [above, below] = self.of_tile(tile);
        exceeds([above[1], below[1]])
            && (exceeds([above[0], below[0]]) || exceeds(self.differences(tile)))
    }

    /// Whether f − r or r − f may exceed these in some tiles.
    fn may_exceed(&self, tiles: Range<usize>, [above, below]: [u8; 2]) -> bool {
        let most = self.most(tiles);
        most[0] > above || most[1] > below
    }

    /// The greatest f − r of a tile, what it is at least and at most, and the greatest r − f.
    #[inline]
    fn of_tile(&self, tile: usize) -> [[u8; 2]; 2] {
        let [f, r] = [self.frame.tiles, self.reference.tiles];
        let (dark, bright) = (f.darkest[tile], f.brightest[tile]);
        let (darkest, brightest) = (r.darkest[tile], r.brightest[tile]);
        [
            [brightest, darkest].map(|level| bright.saturating_sub(level)),
            [darkest, brightest].map(|level| level.saturating_sub(dark)),
        ]
    }

    /// What the greatest f − r and the greatest r − f are at least.
    fn least(&self) -> [u8; 2] {
        let [f, r] = [self.frame.tiles, self.reference.tiles];
        [
            excess(&f.brightest, &r.brightest),
            excess(&r.darkest, &f.darkest),
        ]
    }

    /// What the greatest f − r and the greatest r − f of some tiles are at most.
    fn most(&self, tiles: Range<usize>) -> [u8; 2] {
        let [f, r] = [self.frame.tiles, self.reference.tiles];
        let [dark, bright] = [&f.darkest[tiles.clone()], &f.brightest[tiles.clone()]];
        let [darkest, brightest] = [&r.darkest[tiles.clone()], &r.brightest[tiles]];
        [excess(bright, darkest), excess(brightest, dark)]
    }

    /// Greatest f − r and greatest r − f of a tile, zero if negative.
    fn differences(&self, tile: usize) -> [u8; 2] {
        let at = self.frame.tiles.pixels(tile, self.size);
        let first = at.row_start * self.size.1 + at.column_start;
        vectorized(Differences {
            images: [&self.frame.image[first..], &self.reference.image[first..]],
            rows: at.rows(),
            columns: at.columns(),
            stride: self.size.1,
        })
    }
}

/// The greatest a − b of two lists of numbers, zero if negative.
fn excess(a: &[u8], b: &[u8]) -> u8 {
    vectorized(Excess { a, b })
}

struct Excess<'a> {
    a: &'a [u8],
    b: &'a [u8],
}

impl pulp::NullaryFnOnce for Excess<'_> {
    type Output = u8;

    #[inline(always)]
    fn call(self) -> u8 {
        let (a, rest_of_a) = self.a.as_chunks::<LANES>();
        let (b, rest_of_b) = self.b.as_chunks::<LANES>();
        let mut lanes = [0_u8; LANES];
        for (a, b) in a.iter().zip(b) {
            for k in 0..LANES {
                lanes[k] = lanes[k].max(a[k].saturating_sub(b[k]));
            }
        }
        let mut greatest = 0;
        for lane in lanes {
            greatest = lane.max(greatest);
        }
        for (a, b) in rest_of_a.iter().zip(rest_of_b) {
            greatest = a.saturating_sub(*b).max(greatest);
        }
        greatest
    }
}

/// Part of two images, from its first pixel on.
struct Differences<'a> {
    images: [&'a [u8]; 2],
    rows: usize,
    columns: usize,
    stride: usize,
}

impl pulp::NullaryFnOnce for Differences<'_> {
    type Output = [u8; 2];

    #[inline(always)]
    fn call(self) -> [u8; 2] {
        let (mut above, mut below) = ([0_u8; TILE_COLUMNS], [0_u8; TILE_COLUMNS]);
        for row in 0..self.rows {
            let first = row * self.stride;
            let [f, r] = self.images.map(|image| &image[first..first + self.columns]);
            match (
                <&[u8; TILE_COLUMNS]>::try_from(f),
                <&[u8; TILE_COLUMNS]>::try_from(r),
            ) {
                (Ok(f), Ok(r)) => {
                    for k in 0..TILE_COLUMNS {
                        above[k] = above[k].max(f[k].saturating_sub(r[k]));
                        below[k] = below[k].max(r[k].saturating_sub(f[k]));
                    }
                }
                _ => {
                    for (k, (f, r)) in f.iter().zip(r).enumerate() {
                        above[k] = above[k].max(f.saturating_sub(*r));
                        below[k] = below[k].max(r.saturating_sub(*f));
                    }
                }
            }
        }
        let mut greatest = [0; 2];
        for k in 0..TILE_COLUMNS {
            greatest = [above[k].max(greatest[0]), below[k].max(greatest[1])];
        }
        greatest
    }
}

/// Numbers that are compared at once.
const LANES: usize = 16;

fn larger(one: [u8; 2], other: [u8; 2]) -> [u8; 2] {
    [one[0].max(other[0]), one[1].max(other[1])]
}
