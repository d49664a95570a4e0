//! The box of the pixels that differ from the reference, refined from tiles to pixels.

use std::ops::Range;

use tactile_core::{BoundingBox, vectorised};

use crate::tiles::{TILE_COLUMNS, Tiles};

/// An image in standard layout with its tiles.
#[derive(Clone, Copy)]
pub(crate) struct Tiled<'a> {
    pub(crate) image: &'a [u8],
    pub(crate) tiles: &'a Tiles,
}

/// A frame f and its reference r, both of the same size (rows, columns).
pub(crate) struct Pair<'a> {
    pub(crate) frame: Tiled<'a>,
    pub(crate) reference: Tiled<'a>,
    pub(crate) size: (usize, usize),
}

impl Pair<'_> {
    /// The box of the tiles in which |f − r| exceeds a threshold.
    pub(crate) fn tiles_above(&self, threshold: u8) -> Option<BoundingBox> {
        let (size, tiles) = (self.size, self.frame.tiles);
        let of_band = |band: usize| {
            let mut here = self.band(band);
            if !self.may_exceed(here.clone(), threshold) {
                return None;
            }
            // Tiles between the outermost ones are not examined.
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
    pub(crate) fn band(&self, band: usize) -> Range<usize> {
        let columns = self.frame.tiles.columns;
        band * columns..(band + 1) * columns
    }

    /// Whether |f − r| exceeds a threshold in a tile.
    pub(crate) fn exceeds(&self, tile: usize, threshold: u8) -> bool {
        let [f, r] = [self.frame.tiles, self.reference.tiles];
        let (dark, bright) = (f.darkest[tile], f.brightest[tile]);
        let (darkest, brightest) = (r.darkest[tile], r.brightest[tile]);
        // The extremes of both images decide most tiles without examining their pixels.
        let most = u8::max(
            bright.saturating_sub(darkest),
            brightest.saturating_sub(dark),
        );
        let least = u8::max(bright.abs_diff(brightest), dark.abs_diff(darkest));
        most > threshold && (least > threshold || self.difference(tile) > threshold)
    }

    /// Whether |f − r| may exceed a threshold in any of some tiles.
    pub(crate) fn may_exceed(&self, tiles: Range<usize>, threshold: u8) -> bool {
        let [f, r] = [self.frame.tiles, self.reference.tiles];
        let [dark, bright] = [&f.darkest[tiles.clone()], &f.brightest[tiles.clone()]];
        let [darkest, brightest] = [&r.darkest[tiles.clone()], &r.brightest[tiles]];
        excess(bright, darkest).max(excess(brightest, dark)) > threshold
    }

    /// Largest |f − r| in a tile.
    pub(crate) fn difference(&self, tile: usize) -> u8 {
        let at = self.frame.tiles.pixels(tile, self.size);
        let images = [self.frame.image, self.reference.image];
        vectorised(
            #[inline(always)]
            || {
                let mut greatest = [0_u8; TILE_COLUMNS];
                for row in at.row_start..at.row_end {
                    let first = row * self.size.1;
                    let span = first + at.column_start..first + at.column_end;
                    let [f, r] = images.map(|image| &image[span.clone()]);
                    for ((greatest, f), r) in greatest.iter_mut().zip(f).zip(r) {
                        *greatest = f.abs_diff(*r).max(*greatest);
                    }
                }
                greatest.into_iter().fold(0, u8::max)
            },
        )
    }
}

/// The largest a − b of two lists of numbers, zero if negative.
pub(crate) fn excess(a: &[u8], b: &[u8]) -> u8 {
    vectorised(
        #[inline(always)]
        || {
            let (a, rest_of_a) = a.as_chunks::<16>();
            let (b, rest_of_b) = b.as_chunks::<16>();
            let mut lanes = [0_u8; 16];
            for (a, b) in a.iter().zip(b) {
                for k in 0..16 {
                    lanes[k] = lanes[k].max(a[k].saturating_sub(b[k]));
                }
            }
            let rest = rest_of_a.iter().zip(rest_of_b);
            let rest = rest.map(|(a, b)| a.saturating_sub(*b));
            lanes.into_iter().chain(rest).fold(0, u8::max)
        },
    )
}

/// Shrinks a box of whole tiles to the pixels with |frame − reference| > threshold. Both images are
/// row-major.
pub(crate) fn tighten(
    mut tight: BoundingBox,
    images: [&[u8]; 2],
    width: usize,
    threshold: u8,
) -> BoundingBox {
    let row = |row: usize, columns: Range<usize>| {
        let span = row * width + columns.start..row * width + columns.end;
        images.map(|image| &image[span.clone()])
    };
    vectorised(
        #[inline(always)]
        || {
            let is_over = |at: usize, tight: &BoundingBox| {
                let [f, r] = row(at, tight.column_start..tight.column_end);
                let differences = f.iter().zip(r).map(|(f, r)| f.abs_diff(*r));
                differences.fold(0, u8::max) > threshold
            };
            while tight.rows() > 1 && !is_over(tight.row_start, &tight) {
                tight.row_start += 1;
            }
            while tight.rows() > 1 && !is_over(tight.row_end - 1, &tight) {
                tight.row_end -= 1;
            }
            // Largest |frame − reference| in each column of a strip, at most one tile wide.
            let greatest = |strip: Range<usize>| {
                let mut greatest = [0_u8; TILE_COLUMNS];
                for at in tight.row_start..tight.row_end {
                    let [f, r] = row(at, strip.clone());
                    for ((greatest, f), r) in greatest.iter_mut().zip(f).zip(r) {
                        *greatest = f.abs_diff(*r).max(*greatest);
                    }
                }
                greatest.map(|level| level > threshold)
            };
            // The outermost tile on each side contains such a pixel; otherwise the box would be
            // smaller.
            let (start, end) = (tight.column_start, tight.column_end);
            let width = (end - start).min(TILE_COLUMNS);
            if let Some(at) = greatest(start..start + width)[..width]
                .iter()
                .position(|over| *over)
            {
                tight.column_start = start + at;
            }
            if let Some(at) = greatest(end - width..end)[..width]
                .iter()
                .rposition(|over| *over)
            {
                tight.column_end = end - width + at + 1;
            }
            tight
        },
    )
}
