//! The inner loop of the pass: the sums and extremes of the tiles of a band of eight rows.
//!
//! The sums are linear, so they are taken over the frame alone; those of the reference are known beforehand and are subtracted at the end. What the
//! extremes say of the differences is in [`extent`](super::extent).

use super::tiles::{TILE_COLUMNS, TILE_ROWS};

/// A row of a tile.
type Row = [u8; TILE_COLUMNS];

/// Eight rows of equal length, in whole tiles.
type Rows<'a> = [&'a [Row]; TILE_ROWS];

/// What a strip receives: Σ f of every tile, and its darkest and brightest pixel.
pub(super) struct OfTiles<'a> {
    pub(super) sums: &'a mut [i32],
    pub(super) darkest: &'a mut [u8],
    pub(super) brightest: &'a mut [u8],
}

impl OfTiles<'_> {
    /// The first so many tiles.
    pub(super) fn first(&mut self, number: usize) -> OfTiles<'_> {
        OfTiles {
            sums: &mut self.sums[..number],
            darkest: &mut self.darkest[..number],
            brightest: &mut self.brightest[..number],
        }
    }
}

/// Summarises the tiles of a strip by the widest instructions that the processor has: integers, so that no result depends on
/// which.
pub(super) fn summarise(rows: Rows<'_>, tiles: OfTiles<'_>) {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return simd.vectorize(avx2::Strip { simd, rows, tiles });
    }
    each(&Plain, rows, tiles);
}

/// Tile after tile, so that nothing but its sums leaves the registers: row after row, as memory has the pixels, takes several times as long.
#[inline(always)]
fn each(instructions: &impl Summarise, rows: Rows<'_>, tiles: OfTiles<'_>) {
    let number = tiles.sums.len();
    let rows = rows.map(|row| &row[..number]);
    let (darkest, brightest) = (&mut tiles.darkest[..number], &mut tiles.brightest[..number]);
    for tile in 0..number {
        let (sum, extremes) = instructions.summary(&rows, tile);
        tiles.sums[tile] = sum;
        [darkest[tile], brightest[tile]] = extremes;
    }
}

/// Instructions that summarise a tile.
trait Summarise {
    /// Sum, darkest and brightest pixel of a tile of eight rows.
    fn summary(&self, rows: &Rows<'_>, tile: usize) -> (i32, [u8; 2]);
}

/// Plain loops, which the compiler turns into the instructions that every processor has.
struct Plain;

impl Summarise for Plain {
    #[inline(always)]
    fn summary(&self, rows: &Rows<'_>, tile: usize) -> (i32, [u8; 2]) {
        let (mut low, mut high) = ([u8::MAX; TILE_COLUMNS], [0_u8; TILE_COLUMNS]);
        let mut columns = [0_u16; TILE_COLUMNS];
        for row in rows {
            let f = &row[tile];
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
        (sum, [darkest, brightest])
    }
}

/// AVX2, whose sum of absolute differences adds eight bytes at once, which no plain loop becomes: a quarter of the plain loops' time.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{__m128i, __m256i};

    use pulp::x86::V3;

    use super::{OfTiles, Rows, Summarise, each};

    pub(super) struct Strip<'a> {
        pub(super) simd: V3,
        pub(super) rows: Rows<'a>,
        pub(super) tiles: OfTiles<'a>,
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

    /// The least of 32 bytes.
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
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// By plain loops and by whatever instructions this machine has: those of the pixels one by one.
        #[test]
        fn a_tile_is_its_pixels(
            pixels in proptest::collection::vec(any::<u8>(), TILE_ROWS * TILE_COLUMNS), low in 0_u8..255, span in 0_u8..=255
        ) {
            // Anywhere within any range of grey levels.
            let grey = |p: u8| (u32::from(low) + u32::from(p) * u32::from(span) / 255).min(255) as u8;
            let tile: [Row; TILE_ROWS] = std::array::from_fn(|k| std::array::from_fn(|j| grey(pixels[TILE_COLUMNS * k + j])));
            let all = tile.as_flattened();
            let sum: i32 = all.iter().map(|p| i32::from(*p)).sum();
            let expected = (sum, [*all.iter().min().unwrap(), *all.iter().max().unwrap()]);
            let rows = tile.each_ref().map(std::slice::from_ref);
            prop_assert_eq!(Plain.summary(&rows, 0), expected);
            let (mut sum, mut darkest, mut brightest) = ([0], [0], [0]);
            let tiles = OfTiles { sums: &mut sum, darkest: &mut darkest, brightest: &mut brightest };
            summarise(rows, tiles);
            prop_assert_eq!((sum[0], [darkest[0], brightest[0]]), expected);
        }
    }
}
