//! The single pass over a frame: sums and extremes of its tiles.

use tactile_core::BoundingBox;

/// Number of rows in a tile.
pub(crate) const TILE_ROWS: usize = 8;
/// Number of columns in a tile.
pub(crate) const TILE_COLUMNS: usize = 32;

/// The sums of all tiles of a frame, and their darkest and brightest pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tiles {
    pub rows: usize,
    pub columns: usize,
    pub sums: Vec<i32>,
    pub(crate) darkest: Vec<u8>,
    pub(crate) brightest: Vec<u8>,
}

impl Tiles {
    pub(crate) fn reset(&mut self, (rows, columns): (usize, usize)) {
        self.rows = rows.div_ceil(TILE_ROWS);
        self.columns = columns.div_ceil(TILE_COLUMNS);
        self.sums.clear();
        self.sums.resize(self.rows * self.columns, 0);
        // Overwritten by each pass.
        for extremes in [&mut self.darkest, &mut self.brightest] {
            extremes.resize(self.rows * self.columns, 0);
        }
    }

    /// Sum of all tiles.
    pub(crate) fn total(&self) -> i64 {
        self.sums.iter().map(|&sum| i64::from(sum)).sum()
    }

    /// Largest sum in a band, each multiplied by `sign`.
    pub(crate) fn greatest(&self, band: usize, sign: i32) -> i32 {
        let sums = &self.sums[band * self.columns..(band + 1) * self.columns];
        sums.iter().map(|s| sign * s).max().unwrap_or(0)
    }

    /// A tile of a reference, for a frame equal to it.
    pub(crate) fn blank(&self, tile: usize, size: (usize, usize)) -> TileSum {
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

/// One tile: its centre, number of pixels, sum of the reference and summed difference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileSum {
    pub x: f64,
    pub y: f64,
    pub pixels: f64,
    pub reference: f64,
    pub difference: f64,
}

/// Summarises the tiles of a non-empty row-major image. Returns the number of its pixels with the
/// value 255. `band` is working memory.
pub(crate) fn scan(
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
        // Reading pixels in memory order takes half the time of reading tiles from eight rows in
        // turn.
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

/// Summarises the tiles of up to eight rows.
pub(crate) fn summarise_band(rows: &[u8], width: usize, mut tiles: OfTiles<'_>) {
    let is_whole = rows.len() == TILE_ROWS * width;
    let whole = if is_whole { width / TILE_COLUMNS } else { 0 };
    if is_whole {
        let row = |k: usize| rows[k * width..(k + 1) * width].as_chunks().0;
        summarise(std::array::from_fn(row), tiles.first(whole));
    }
    // At the edges of the image some tiles have fewer rows or columns.
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

/// A row of a tile.
pub(crate) type Row = [u8; TILE_COLUMNS];

/// Eight rows of equal length, in whole tiles.
pub(crate) type Rows<'a> = [&'a [Row]; TILE_ROWS];

/// Output of a strip: Σ f for each tile, and its darkest and brightest pixel.
pub(crate) struct OfTiles<'a> {
    sums: &'a mut [i32],
    darkest: &'a mut [u8],
    brightest: &'a mut [u8],
}

impl OfTiles<'_> {
    /// The first `number` tiles.
    pub(crate) fn first(&mut self, number: usize) -> OfTiles<'_> {
        OfTiles {
            sums: &mut self.sums[..number],
            darkest: &mut self.darkest[..number],
            brightest: &mut self.brightest[..number],
        }
    }
}

/// Summarises the tiles of a strip with the widest available SIMD instructions. They work on
/// integers, so the result does not depend on the choice.
pub(crate) fn summarise(rows: Rows<'_>, tiles: OfTiles<'_>) {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return simd.vectorize(avx2::Strip { simd, rows, tiles });
    }
    each(&Plain, rows, tiles);
}

/// Tile by tile, so that only the sums leave the registers. Row by row, in memory order, it would
/// take several times as long.
#[inline(always)]
pub(crate) fn each(instructions: &impl Summarise, rows: Rows<'_>, tiles: OfTiles<'_>) {
    let number = tiles.sums.len();
    let rows = rows.map(|row| &row[..number]);
    let (darkest, brightest) = (&mut tiles.darkest[..number], &mut tiles.brightest[..number]);
    for tile in 0..number {
        let (sum, extremes) = instructions.summary(&rows, tile);
        tiles.sums[tile] = sum;
        [darkest[tile], brightest[tile]] = extremes;
    }
}

/// SIMD instructions that summarise a tile.
pub(crate) trait Summarise {
    /// Sum, darkest and brightest pixel of a tile with eight rows.
    fn summary(&self, rows: &Rows<'_>, tile: usize) -> (i32, [u8; 2]);
}

/// Plain loops, which the compiler vectorises with the baseline instructions.
pub(crate) struct Plain;

impl Summarise for Plain {
    #[inline(always)]
    fn summary(&self, rows: &Rows<'_>, tile: usize) -> (i32, [u8; 2]) {
        let (mut low, mut high) = ([u8::MAX; TILE_COLUMNS], [0_u8; TILE_COLUMNS]);
        let mut columns = [0_u16; TILE_COLUMNS];
        for row in rows {
            let f = &row[tile];
            // A separate loop for each integer width: if they were mixed, the bytes would fill only
            // half a register.
            for j in 0..TILE_COLUMNS {
                low[j] = low[j].min(f[j]);
                high[j] = high[j].max(f[j]);
            }
            for j in 0..TILE_COLUMNS {
                // Eight times 255 fits. Checked addition would not be vectorised.
                columns[j] = columns[j].wrapping_add(u16::from(f[j]));
            }
        }
        let (mut sum, mut darkest, mut brightest) = (0, u8::MAX, 0);
        for j in 0..TILE_COLUMNS {
            sum = i32::wrapping_add(sum, i32::from(columns[j]));
            darkest = low[j].min(darkest);
            brightest = high[j].max(brightest);
        }
        (sum, [darkest, brightest])
    }
}

/// AVX2. Its sum of absolute differences adds eight bytes at once, which the compiler does not
/// generate from plain loops: it takes a quarter of their time.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{__m128i, __m256i};

    use pulp::x86::V3;

    use super::{OfTiles, Rows, Summarise, each};

    pub(super) struct Strip<'a> {
        pub simd: V3,
        pub rows: Rows<'a>,
        pub tiles: OfTiles<'a>,
    }

    impl pulp::NullaryFnOnce for Strip<'_> {
        type Output = ();

        #[inline(always)]
        fn call(self) {
            each(&self.simd, self.rows, self.tiles);
        }
    }

    impl Summarise for V3 {
        #[inline(always)]
        fn summary(&self, rows: &Rows<'_>, tile: usize) -> (i32, [u8; 2]) {
            let (avx, avx2, sse2) = (self.avx, self.avx2, self.sse2);
            let (zero, ones) = (avx._mm256_setzero_si256(), avx._mm256_set1_epi8(-1));
            let (mut low, mut high, mut sums) = (ones, zero, zero);
            for row in rows {
                let pixels: __m256i = pulp::cast(row[tile]);
                low = avx2._mm256_min_epu8(low, pixels);
                high = avx2._mm256_max_epu8(high, pixels);
                sums = avx2._mm256_add_epi64(sums, avx2._mm256_sad_epu8(pixels, zero));
            }
            let [left, right]: [__m128i; 2] = pulp::cast(sums);
            let [even, odd]: [u64; 2] = pulp::cast(sse2._mm_add_epi64(left, right));
            let brightest = !least(*self, avx2._mm256_xor_si256(high, ones));
            ((even + odd) as i32, [least(*self, low), brightest])
        }
    }

    /// The minimum of 32 bytes.
    #[inline(always)]
    fn least(simd: V3, bytes: __m256i) -> u8 {
        let (sse2, sse4) = (simd.sse2, simd.sse4_1);
        let [left, right]: [__m128i; 2] = pulp::cast(bytes);
        let pairs = sse2._mm_min_epu8(left, right);
        let least_of_pairs = sse2._mm_min_epu8(pairs, sse2._mm_srli_epi16::<8>(pairs));
        sse2._mm_cvtsi128_si32(sse4._mm_minpos_epu16(least_of_pairs)) as u8
    }
}

#[cfg(test)]
#[path = "tiles_tests.rs"]
mod tests;
