//! The strip with 256-bit instructions, some five for every eight pixels.
//!
//! Bytes of two rows are interleaved, so that one multiply-add of bytes (`maddubs`) weighs both rows of a column: the
//! weights 1, k and k² give Σ f, Σ k f and Σ k² f of every column in 16 bits. At a tile's end a multiply-add of words
//! with 1, j and j² takes them along the columns into 32 bits. Sums weighted with the tile's number t come from running sums of
//! running sums: with P the sum over T tiles and Q the sum of the partial sums, Σ t v_t = T P − Q.

use core::arch::x86_64::__m256i;

use pulp::{cast, x86::V3};

use super::{Rows, Strip};
use crate::frame::{TILE_COLUMNS, TILE_ROWS};

/// Column numbers in the order in which interleaving leaves them.
const LOW: [i16; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 21, 22, 23];
const HIGH: [i16; 16] = [8, 9, 10, 11, 12, 13, 14, 15, 24, 25, 26, 27, 28, 29, 30, 31];

pub(super) fn strip(
    simd: V3,
    frame: &Rows<'_>,
    reference: &Rows<'_>,
    threshold: u8,
    tile_sums: &mut [i32],
) -> Strip {
    simd.vectorize(Work {
        simd,
        frame,
        reference,
        threshold,
        tile_sums,
    })
}

struct Work<'a, 'b> {
    simd: V3,
    frame: &'a Rows<'b>,
    reference: &'a Rows<'b>,
    threshold: u8,
    tile_sums: &'a mut [i32],
}

impl pulp::NullaryFnOnce for Work<'_, '_> {
    type Output = Strip;

    #[inline(always)]
    fn call(self) -> Strip {
        sum(
            self.simd,
            self.frame,
            self.reference,
            self.threshold,
            self.tile_sums,
        )
    }
}

/// Columns of a tile summed over its rows, in two registers each, and the extremes.
struct Columns {
    plain: [__m256i; 2],
    by_k: [__m256i; 2],
    by_kk: [__m256i; 2],
    above: __m256i,
    below: __m256i,
}

#[inline(always)]
fn columns(
    simd: V3,
    frame: [&[u8; TILE_COLUMNS]; TILE_ROWS],
    reference: [&[u8; TILE_COLUMNS]; TILE_ROWS],
) -> Columns {
    let (avx, v) = (simd.avx, simd.avx2);
    let zero = avx._mm256_setzero_si256();
    let mut c = Columns {
        plain: [zero; 2],
        by_k: [zero; 2],
        by_kk: [zero; 2],
        above: zero,
        below: zero,
    };
    let ones = v_set8(simd, 1, 1);
    for pair in 0..TILE_ROWS / 2 {
        let k = 2 * pair as i8 - 4;
        let (wk, wkk) = (
            v_set8(simd, k, k + 1),
            v_set8(simd, k * k, (k + 1) * (k + 1)),
        );
        let rows: [__m256i; 2] = std::array::from_fn(|i| cast(*frame[2 * pair + i]));
        for (i, f) in rows.iter().enumerate() {
            let r: __m256i = cast(*reference[2 * pair + i]);
            c.above = v._mm256_max_epu8(c.above, v._mm256_subs_epu8(*f, r));
            c.below = v._mm256_max_epu8(c.below, v._mm256_subs_epu8(r, *f));
        }
        let mixed = [
            v._mm256_unpacklo_epi8(rows[0], rows[1]),
            v._mm256_unpackhi_epi8(rows[0], rows[1]),
        ];
        for (half, bytes) in mixed.into_iter().enumerate() {
            c.plain[half] = v._mm256_add_epi16(c.plain[half], v._mm256_maddubs_epi16(bytes, ones));
            c.by_k[half] = v._mm256_add_epi16(c.by_k[half], v._mm256_maddubs_epi16(bytes, wk));
            c.by_kk[half] = v._mm256_add_epi16(c.by_kk[half], v._mm256_maddubs_epi16(bytes, wkk));
        }
    }
    c
}

#[inline(always)]
fn v_set8(simd: V3, even: i8, odd: i8) -> __m256i {
    simd.avx
        ._mm256_set1_epi16(i16::from_le_bytes([even as u8, odd as u8]))
}

#[inline(always)]
fn sum(
    simd: V3,
    frame: &Rows<'_>,
    reference: &Rows<'_>,
    threshold: u8,
    tile_sums: &mut [i32],
) -> Strip {
    let (avx, v) = (simd.avx, simd.avx2);
    let tiles = tile_sums.len();
    let f: [&[[u8; TILE_COLUMNS]]; TILE_ROWS] =
        std::array::from_fn(|k| &frame[k].as_chunks().0[..tiles]);
    let r: [&[[u8; TILE_COLUMNS]]; TILE_ROWS] =
        std::array::from_fn(|k| &reference[k].as_chunks().0[..tiles]);
    let (zero, one) = (avx._mm256_setzero_si256(), avx._mm256_set1_epi16(1));
    let limit = avx._mm256_set1_epi8(threshold as i8);
    let j: [__m256i; 2] = [cast(LOW), cast(HIGH)];
    let jj: [__m256i; 2] = [cast(LOW.map(|j| j * j)), cast(HIGH.map(|j| j * j))];
    let along = |c: [__m256i; 2], w: [__m256i; 2]| {
        v._mm256_add_epi32(
            v._mm256_madd_epi16(c[0], w[0]),
            v._mm256_madd_epi16(c[1], w[1]),
        )
    };
    let total = |c: [__m256i; 2]| v._mm256_madd_epi16(v._mm256_add_epi16(c[0], c[1]), one);
    let (mut above, mut below) = (zero, zero);
    let mut s = Strip::default();
    let (mut t1, mut t2) = (0_i64, 0_i64);
    let (mut ja, mut ja_t, mut jja) = (zero, zero, zero);
    let (mut b, mut b_t, mut jb, mut c) = (zero, zero, zero, zero);
    for (t, tile_sum) in tile_sums.iter_mut().enumerate() {
        let tile = columns(
            simd,
            std::array::from_fn(|k| &f[k][t]),
            std::array::from_fn(|k| &r[k][t]),
        );
        *tile_sum = horizontal(simd, total(tile.plain));
        let (number, wide) = (t as i64, i64::from(*tile_sum));
        (s.sum, t1, t2) = (
            s.sum + wide,
            t1 + number * wide,
            t2 + number * number * wide,
        );
        ja = v._mm256_add_epi32(ja, along(tile.plain, j));
        ja_t = v._mm256_add_epi32(ja_t, ja);
        jja = v._mm256_add_epi32(jja, along(tile.plain, jj));
        b = v._mm256_add_epi32(b, total(tile.by_k));
        b_t = v._mm256_add_epi32(b_t, b);
        jb = v._mm256_add_epi32(jb, along(tile.by_k, j));
        c = v._mm256_add_epi32(c, total(tile.by_kk));
        above = v._mm256_max_epu8(above, tile.above);
        below = v._mm256_max_epu8(below, tile.below);
        let over = v._mm256_subs_epu8(v._mm256_max_epu8(tile.above, tile.below), limit);
        if avx._mm256_testz_si256(over, over) == 0 {
            s.hit(t);
        }
    }
    let [ja, ja_t, jja, b, b_t, jb, c] = [ja, ja_t, jja, b, b_t, jb, c].map(wide);
    let n = tiles as i64;
    let width = TILE_COLUMNS as i64;
    s.x = width * t1 + ja;
    s.xx = width * width * t2 + 2 * width * (n * ja - ja_t) + jja;
    s.k = b;
    s.xk = width * (n * b - b_t) + jb;
    s.kk = c;
    s.above = greatest(above);
    s.below = greatest(below);
    s
}

#[inline(always)]
fn horizontal(simd: V3, lanes: __m256i) -> i32 {
    let (sse2, v) = (simd.sse2, simd.avx2);
    let four = sse2._mm_add_epi32(
        simd.avx._mm256_castsi256_si128(lanes),
        v._mm256_extracti128_si256::<1>(lanes),
    );
    let two = sse2._mm_add_epi32(four, sse2._mm_shuffle_epi32::<0b00_00_11_10>(four));
    let one = sse2._mm_add_epi32(two, sse2._mm_shuffle_epi32::<0b00_00_00_01>(two));
    sse2._mm_cvtsi128_si32(one)
}

fn wide(lanes: __m256i) -> i64 {
    cast::<__m256i, [i32; 8]>(lanes)
        .iter()
        .map(|&v| i64::from(v))
        .sum()
}

fn greatest(lanes: __m256i) -> u8 {
    cast::<__m256i, [u8; 32]>(lanes)
        .into_iter()
        .max()
        .unwrap_or(0)
}
