//! Sums over tiles of 8 rows by 32 columns: signals fainter than the noise of one pixel show in them.

use tactile_core::BoundingBox;

/// Rows of a tile.
pub(crate) const TILE_ROWS: usize = 8;
/// Columns of a tile.
pub(crate) const TILE_COLUMNS: usize = 32;

/// The sums of all tiles of a frame, and their darkest and brightest pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tiles {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) sums: Vec<i32>,
    pub(super) darkest: Vec<u8>,
    pub(super) brightest: Vec<u8>,
}

impl Tiles {
    pub(super) fn reset(&mut self, (rows, columns): (usize, usize)) {
        self.rows = rows.div_ceil(TILE_ROWS);
        self.columns = columns.div_ceil(TILE_COLUMNS);
        self.sums.clear();
        self.sums.resize(self.rows * self.columns, 0);
        // Written by every pass.
        for extremes in [&mut self.darkest, &mut self.brightest] {
            extremes.resize(self.rows * self.columns, 0);
        }
    }

    /// Sum of all tiles.
    pub(super) fn total(&self) -> i64 {
        self.sums.iter().map(|&sum| i64::from(sum)).sum()
    }

    /// Greatest sum of a band, each times `sign`.
    pub(crate) fn greatest(&self, band: usize, sign: i32) -> i32 {
        let sums = &self.sums[band * self.columns..(band + 1) * self.columns];
        sums.iter().map(|s| sign * s).max().unwrap_or(0)
    }

    /// A tile of a reference, and of a frame that does not differ from it.
    pub(super) fn blank(&self, tile: usize, size: (usize, usize)) -> TileSum {
        let at = self.pixels(tile, size);
        TileSum {
            x: 0.5 * (at.column_start + at.column_end - 1) as f64,
            y: 0.5 * (at.row_start + at.row_end - 1) as f64,
            pixels: (at.rows() * at.columns()) as f64,
            reference: f64::from(self.sums[tile]),
            difference: 0.0,
        }
    }

    /// The pixels of a tile.
    pub(crate) fn pixels(&self, tile: usize, (rows, columns): (usize, usize)) -> BoundingBox {
        let (row, column) = (tile / self.columns, tile % self.columns);
        BoundingBox {
            row_start: row * TILE_ROWS,
            row_end: ((row + 1) * TILE_ROWS).min(rows),
            column_start: column * TILE_COLUMNS,
            column_end: ((column + 1) * TILE_COLUMNS).min(columns),
        }
    }
}

/// One tile: its centre, its number of pixels, the reference's sum and the summed difference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileSum {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) pixels: f64,
    pub(crate) reference: f64,
    pub(crate) difference: f64,
}
