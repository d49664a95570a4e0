//! The strip in plain Rust, for every machine.

use super::{Rows, Strip, TILE_COLUMNS, TILE_ROWS};

pub(super) fn strip(frame: &Rows<'_>, reference: &Rows<'_>, threshold: u8, tile_sums: &mut [i32]) -> Strip {
    let mut s = Strip::default();
    for (t, sum) in tile_sums.iter_mut().enumerate() {
        let columns = t * TILE_COLUMNS..(t + 1) * TILE_COLUMNS;
        let (mut a, mut b, mut c) = ([0_i32; TILE_COLUMNS], [0_i32; TILE_COLUMNS], [0_i32; TILE_COLUMNS]);
        let (mut above, mut below) = (0, 0);
        for row in 0..TILE_ROWS {
            let k = row as i32 - 4;
            let (f, r) = (&frame[row][columns.clone()], &reference[row][columns.clone()]);
            for (j, (&f, &r)) in f.iter().zip(r).enumerate() {
                let wide = i32::from(f);
                a[j] += wide;
                b[j] += k * wide;
                c[j] += k * k * wide;
                above = above.max(f.saturating_sub(r));
                below = below.max(r.saturating_sub(f));
            }
        }
        *sum = a.iter().sum();
        s.sum += i64::from(*sum);
        s.k += i64::from(b.iter().sum::<i32>());
        s.kk += i64::from(c.iter().sum::<i32>());
        for (j, (&a, &b)) in a.iter().zip(&b).enumerate() {
            let x = (t * TILE_COLUMNS + j) as i64;
            s.x += x * i64::from(a);
            s.xx += x * x * i64::from(a);
            s.xk += x * i64::from(b);
        }
        s.above = s.above.max(above);
        s.below = s.below.max(below);
        if above.max(below) > threshold {
            s.hit(t);
        }
    }
    s
}
