//! The strip in plain Rust, for every machine.

use super::{Rows, Strip};
use crate::frame::{TILE_COLUMNS, TILE_ROWS};

pub(super) fn strip(
    frame: &Rows<'_>,
    reference: &Rows<'_>,
    threshold: u8,
    tile_sums: &mut [i32],
) -> Strip {
    let mut s = Strip::default();
    for (t, sum) in tile_sums.iter_mut().enumerate() {
        let tile = columns(frame, reference, t * TILE_COLUMNS);
        *sum = tile.plain.iter().sum();
        s.sum += i64::from(*sum);
        s.k += i64::from(tile.by_k.iter().sum::<i32>());
        s.kk += i64::from(tile.by_kk.iter().sum::<i32>());
        for (j, (&plain, &by_k)) in tile.plain.iter().zip(&tile.by_k).enumerate() {
            let x = (t * TILE_COLUMNS + j) as i64;
            s.x += x * i64::from(plain);
            s.xx += x * x * i64::from(plain);
            s.xk += x * i64::from(by_k);
        }
        s.above = s.above.max(tile.above);
        s.below = s.below.max(tile.below);
        if tile.above.max(tile.below) > threshold {
            s.hit(t);
        }
    }
    s
}

/// Columns of a tile summed over its rows, and the extremes.
struct Columns {
    plain: [i32; TILE_COLUMNS],
    by_k: [i32; TILE_COLUMNS],
    by_kk: [i32; TILE_COLUMNS],
    above: u8,
    below: u8,
}

#[inline]
fn columns(frame: &Rows<'_>, reference: &Rows<'_>, first: usize) -> Columns {
    let zero = [0; TILE_COLUMNS];
    let mut c = Columns {
        plain: zero,
        by_k: zero,
        by_kk: zero,
        above: 0,
        below: 0,
    };
    for row in 0..TILE_ROWS {
        let k = row as i32 - 4;
        let (f, r) = (
            &frame[row][first..first + TILE_COLUMNS],
            &reference[row][first..first + TILE_COLUMNS],
        );
        for (j, (&f, &r)) in f.iter().zip(r).enumerate() {
            let wide = i32::from(f);
            c.plain[j] += wide;
            c.by_k[j] += k * wide;
            c.by_kk[j] += k * k * wide;
            c.above = c.above.max(f.saturating_sub(r));
            c.below = c.below.max(r.saturating_sub(f));
        }
    }
    c
}
