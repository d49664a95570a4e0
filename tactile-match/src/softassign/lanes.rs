//! What the soft assignment does with one block of targets: Gaussians and moments, lane by lane in single precision.
//!
//! Plain loops over arrays of one length: closures and iterators in their place are functions of their own, which the compiler does not
//! give the wider registers of their [caller](crate::simd).

use super::blocks::LANES;

/// One value a target of a block.
pub(super) type Lanes = [f32; LANES];

/// `exp(scale · |t − y|²)` for a block of targets `t`.
#[inline(always)]
pub(super) fn gaussians<const D: usize>(
    row: &mut Lanes,
    targets: [&Lanes; D],
    y: &[f32; D],
    scale: f32,
) {
    *row = squared_distances(targets, y);
    for value in row {
        *value = exp(*value * scale);
    }
}

/// The same for targets of different precision, times their heights.
#[inline(always)]
pub(super) fn gaussians_of<const D: usize>(
    row: &mut Lanes,
    targets: [&Lanes; D],
    y: &[f32; D],
    scale: f32,
    (precision, height): (&Lanes, &Lanes),
) {
    *row = squared_distances(targets, y);
    for l in 0..LANES {
        row[l] = height[l] * exp(row[l] * scale * precision[l]);
    }
}

#[inline(always)]
fn squared_distances<const D: usize>(targets: [&Lanes; D], y: &[f32; D]) -> Lanes {
    let mut squares = [0.0; LANES];
    for d in 0..D {
        for l in 0..LANES {
            let apart = targets[d][l] - y[d];
            squares[l] += apart * apart;
        }
    }
    squares
}

/// `sums += a · b`.
#[inline(always)]
pub(super) fn add_product(sums: &mut Lanes, a: &Lanes, b: &Lanes) {
    for l in 0..LANES {
        sums[l] += a[l] * b[l];
    }
}

/// `sums += factor · values`.
#[inline(always)]
pub(super) fn add_scaled(sums: &mut Lanes, factor: f32, values: &Lanes) {
    let mut sum = *sums; // a copy cannot overlap with the values
    for l in 0..LANES {
        sum[l] += factor * values[l];
    }
    *sums = sum;
}

/// Sum of all lanes, half and half. Not inlined: the compiler would else arrange the running sums for these few additions rather than for the
/// loop before.
#[inline(never)]
pub(super) fn sum(mut values: Lanes) -> f32 {
    let mut half = LANES / 2;
    while half > 0 {
        for l in 0..half {
            values[l] += values[l + half];
        }
        half /= 2;
    }
    values[0]
}

/// Running sums of a row, lane by lane.
pub(super) struct Moments<const D: usize> {
    pub(super) weight: Lanes,
    pub(super) shift: [Lanes; D],
    pub(super) spread: Lanes,
}

impl<const D: usize> Moments<D> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self {
            weight: [0.0; LANES],
            shift: [[0.0; LANES]; D],
            spread: [0.0; LANES],
        }
    }

    #[inline(always)]
    pub(super) fn add(&mut self, k: &Lanes, b: &Lanes, targets: [&Lanes; D], y: &[f32; D]) {
        let mut m = [0.0_f32; LANES];
        for l in 0..LANES {
            m[l] = k[l] * b[l];
            self.weight[l] += m[l];
        }
        for d in 0..D {
            for l in 0..LANES {
                let e = targets[d][l] - y[d];
                self.shift[d][l] += m[l] * e;
                self.spread[l] += m[l] * e * e;
            }
        }
    }
}

/// eˣ for x ≤ 0 to two units of single precision; 0 below −87.
#[inline(always)]
fn exp(x: f32) -> f32 {
    const MAGIC: f32 = 12_582_912.0; // 1.5 · 2²³: adding it rounds to the nearest integer
    let x = x.max(-88.0);
    let n = (x * std::f32::consts::LOG2_E + MAGIC) - MAGIC;
    let f = (x - n * 0.693_359_4) - n * -2.121_944_4e-4;
    let p = 1.0
        + f * (1.0
            + f * (0.5
                + f * (0.166_666_57 + f * (0.041_665_795 + f * (8.334_52e-3 + f * 1.388_89e-3)))));
    let power =
        f32::from_bits((((n + MAGIC).to_bits() << 23) as i32).wrapping_add(0x3f80_0000) as u32);
    if x > -87.0 { p * power } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_is_single_precision() {
        for i in 0..2000 {
            let x = -0.043 * i as f32;
            let (found, expected) = (f64::from(exp(x)), f64::from(x).exp());
            // Two units of single precision; below the normal range zero is right.
            assert!(
                (found - expected).abs() <= 2.4e-7 * expected + 1e-37,
                "{x}: {found} {expected}"
            );
        }
        assert_eq!(exp(f32::MIN), 0.0);
    }
}
