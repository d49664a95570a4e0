//! The pass over a frame, which reads every pixel once.

use std::ops::Range;

use ndarray::{ArrayView2, Zip};

use super::statistics::{BoundingBox, FrameStatistics};
use super::strip::{Beside, OfTiles, Rows, STRIP_TILES, Strip, compare};
use super::tiles::{TILE_COLUMNS, TILE_ROWS, Tiles};

/// What a frame without a reference, or a band below the image, is compared with.
const ZEROS: [u8; STRIP_TILES * TILE_COLUMNS] = [0; STRIP_TILES * TILE_COLUMNS];
/// The extremes of its tiles.
const BLACK: [[u8; 2]; STRIP_TILES] = [[0; 2]; STRIP_TILES];

/// The sum of the frame itself, extremes and the box of |frame − reference| > threshold. Both images are in standard layout
/// and have the same, nonzero size; without a reference it counts as black. With the reference come the darkest and the brightest pixels of its
/// tiles.
pub(super) fn scan(
    frame: &[u8],
    reference: Option<(&[u8], &Tiles)>,
    size: (usize, usize),
    threshold: u8,
    tiles: &mut Tiles,
) -> FrameStatistics {
    tiles.reset(size);
    let mut s = FrameStatistics::empty(size);
    let pass = Pass {
        frame,
        reference: reference.map(|(image, tiles)| (image, &tiles.extremes[..])),
        size,
        threshold,
    };
    for band in 0..tiles.rows {
        let here = band * tiles.columns..(band + 1) * tiles.columns;
        let extremes = &mut tiles.extremes[here.clone()];
        pass.band(band, &mut tiles.sums[here], extremes, &mut s);
        if extremes.iter().any(|[_, brightest]| *brightest == u8::MAX) {
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
    /// The reference, and the extremes of its tiles.
    reference: Option<(&'a [u8], &'a [[u8; 2]])>,
    size: (usize, usize),
    threshold: u8,
}

impl Pass<'_> {
    /// Adds a band of eight rows.
    #[inline]
    fn band(
        &self,
        band: usize,
        sums: &mut [i32],
        extremes: &mut [[u8; 2]],
        s: &mut FrameStatistics,
    ) {
        let whole = self.size.1 / TILE_COLUMNS;
        let mut first = 0;
        while first < sums.len() {
            // Whole tiles, and at last the columns beyond them.
            let last = match first < whole {
                true => (first + STRIP_TILES).min(whole),
                false => sums.len(),
            };
            let tiles = OfTiles {
                sums: &mut sums[first..last],
                extremes: &mut extremes[first..last],
            };
            let seen = [s.greatest, -s.least].map(|extreme| extreme as u8);
            let strip = if first < whole {
                self.strip(band, first, seen, tiles)
            } else {
                self.margin(band, first, seen, tiles)
            };
            s.add(&strip, band, first);
            first = last;
        }
    }

    /// A strip of whole tiles.
    #[inline]
    fn strip(&self, band: usize, first: usize, seen: [u8; 2], tiles: OfTiles<'_>) -> Strip {
        let last = first + tiles.sums.len();
        let columns = first * TILE_COLUMNS..last * TILE_COLUMNS;
        let f = rows(self.frame, self.size, band, columns.clone());
        let r = match self.reference {
            Some((r, _)) => rows(r, self.size, band, columns),
            None => [&ZEROS[..columns.len()]; TILE_ROWS],
        };
        let reference = Beside {
            rows: &r,
            extremes: self.extremes(band, first..last),
        };
        compare(&f, reference, self.threshold, seen, tiles)
    }

    /// The columns beyond the last whole tile, filled up to one.
    #[inline]
    fn margin(&self, band: usize, whole: usize, seen: [u8; 2], tiles: OfTiles<'_>) -> Strip {
        let columns = whole * TILE_COLUMNS..self.size.1;
        let f = padded(rows(self.frame, self.size, band, columns.clone()));
        let r = padded(
            self.reference
                .map_or([&[]; TILE_ROWS], |(r, _)| rows(r, self.size, band, columns)),
        );
        let (f, r) = (f.each_ref().map(|p| &p[..]), r.each_ref().map(|p| &p[..]));
        let reference = Beside {
            rows: &r,
            extremes: self.extremes(band, whole..whole + 1),
        };
        compare(&f, reference, self.threshold, seen, tiles)
    }

    /// The extremes of some of the reference's tiles of a band.
    #[inline]
    fn extremes(&self, band: usize, tiles: Range<usize>) -> &[[u8; 2]] {
        let columns = self.size.1.div_ceil(TILE_COLUMNS);
        match self.reference {
            Some((_, extremes)) => &extremes[band * columns..][tiles],
            None => &BLACK[..tiles.len()],
        }
    }
}

/// The pixels of a band of eight rows.
fn pixels_of(band: usize, image: &[u8], columns: usize) -> &[u8] {
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
