//! The pass over a frame, which reads every pixel once.

use std::ops::Range;

use ndarray::{ArrayView2, Zip};

use super::statistics::{BoundingBox, FrameStatistics};
use super::strip::{Rows, STRIP_TILES, Strip, compare};
use super::tiles::{TILE_COLUMNS, TILE_ROWS, Tiles};

/// What a frame without a reference, or a band below the image, is compared with.
const ZEROS: [u8; STRIP_TILES * TILE_COLUMNS] = [0; STRIP_TILES * TILE_COLUMNS];

/// The sum of the frame itself, extremes and the box of |frame − reference| > threshold. Both images are in standard layout
/// and have the same, nonzero size; without a reference it counts as black. With the reference come the brightest
/// pixels of its bands of eight rows: only where they leave room for 255 are saturated pixels counted one by one.
pub(super) fn scan(
    frame: &[u8],
    reference: Option<(&[u8], &[u8])>,
    size: (usize, usize),
    threshold: u8,
    tiles: &mut Tiles,
) -> FrameStatistics {
    tiles.reset(size);
    let mut s = FrameStatistics::empty(size);
    let brightest = reference.map(|(_, b)| b);
    let reference = reference.map(|(r, _)| r);
    let pass = Pass {
        frame,
        reference,
        size,
        threshold,
    };
    for band in 0..tiles.rows {
        let sums = &mut tiles.sums[band * tiles.columns..(band + 1) * tiles.columns];
        let above = pass.band(band, sums, &mut s);
        if above >= u8::MAX - brightest.map_or(0, |b| b[band]) {
            s.saturated += pixels_of(band, frame, size.1)
                .iter()
                .map(|&p| usize::from(p == u8::MAX))
                .sum::<usize>();
        }
    }
    s.sum = tiles.sums.iter().map(|&sum| i64::from(sum)).sum();
    s
}

/// The inputs of a pass.
struct Pass<'a> {
    frame: &'a [u8],
    reference: Option<&'a [u8]>,
    size: (usize, usize),
    threshold: u8,
}

impl Pass<'_> {
    /// Adds a band of eight rows; returns its greatest frame − reference.
    #[inline]
    fn band(&self, band: usize, sums: &mut [i32], s: &mut FrameStatistics) -> u8 {
        let whole = self.size.1 / TILE_COLUMNS;
        let mut above = 0;
        for first in (0..whole).step_by(STRIP_TILES) {
            let last = (first + STRIP_TILES).min(whole);
            let strip = self.strip(band, first..last, &mut sums[first..last]);
            above = above.max(strip.above);
            s.add(&strip, band, first);
        }
        if whole < sums.len() {
            let strip = self.margin(band, whole, &mut sums[whole..]);
            above = above.max(strip.above);
            s.add(&strip, band, whole);
        }
        above
    }

    /// A strip of whole tiles.
    #[inline]
    fn strip(&self, band: usize, tiles: Range<usize>, sums: &mut [i32]) -> Strip {
        let columns = tiles.start * TILE_COLUMNS..tiles.end * TILE_COLUMNS;
        let f = rows(self.frame, self.size, band, columns.clone());
        let r = match self.reference {
            Some(r) => rows(r, self.size, band, columns),
            None => [&ZEROS[..columns.len()]; TILE_ROWS],
        };
        compare(&f, &r, self.threshold, sums)
    }

    /// The columns beyond the last whole tile, filled up to one.
    #[inline]
    fn margin(&self, band: usize, whole: usize, sums: &mut [i32]) -> Strip {
        let columns = whole * TILE_COLUMNS..self.size.1;
        let f = padded(rows(self.frame, self.size, band, columns.clone()));
        let r = padded(
            self.reference
                .map_or([&[]; TILE_ROWS], |r| rows(r, self.size, band, columns)),
        );
        let (f, r) = (f.each_ref().map(|p| &p[..]), r.each_ref().map(|p| &p[..]));
        compare(&f, &r, self.threshold, sums)
    }
}

/// The pixels of a band of eight rows.
pub(super) fn pixels_of(band: usize, image: &[u8], columns: usize) -> &[u8] {
    let length = TILE_ROWS * columns;
    &image[band * length..((band + 1) * length).min(image.len())]
}

/// Part of the eight rows of a band; rows below the image are black.
fn rows(
    image: &[u8],
    (height, width): (usize, usize),
    band: usize,
    columns: Range<usize>,
) -> Rows<'_> {
    std::array::from_fn(|k| {
        let y = band * TILE_ROWS + k;
        if y < height {
            &image[y * width + columns.start..y * width + columns.end]
        } else {
            &ZEROS[..columns.len()]
        }
    })
}

/// The image's last columns, filled up with black to a whole tile.
fn padded(rows: Rows<'_>) -> [[u8; TILE_COLUMNS]; TILE_ROWS] {
    rows.map(|row| {
        let mut tile = [0; TILE_COLUMNS];
        tile[..row.len()].copy_from_slice(row);
        tile
    })
}

impl FrameStatistics {
    fn empty((rows, columns): (usize, usize)) -> Self {
        Self {
            rows,
            columns,
            sum: 0,
            least: 0,
            greatest: 0,
            saturated: 0,
            bounding_box: None,
        }
    }

    /// Adds a strip whose first pixel is that of tile (band, first); the box grows by whole tiles.
    fn add(&mut self, strip: &Strip, band: usize, first: usize) {
        let s = strip;
        self.greatest = self.greatest.max(i16::from(s.above));
        self.least = self.least.min(-i16::from(s.below));
        if s.hits[1] > s.hits[0] {
            let here = BoundingBox {
                row_start: band * TILE_ROWS,
                row_end: ((band + 1) * TILE_ROWS).min(self.rows),
                column_start: (first + s.hits[0]) * TILE_COLUMNS,
                column_end: ((first + s.hits[1]) * TILE_COLUMNS).min(self.columns),
            };
            self.bounding_box = Some(self.bounding_box.map_or(here, |b| b.union(here)));
        }
    }
}

impl FrameStatistics {
    /// The strips give extremes on their own side of zero only; where every difference is on one side, computes them anew.
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
