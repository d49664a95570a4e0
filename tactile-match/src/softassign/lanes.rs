//! What the soft assignment does with one block of targets: Gaussians and moments, lane by lane in single precision.

use super::blocks::LANES;

/// `exp(scale · |t − y|²)` for a block of targets `t`.
#[inline(always)]
pub(super) fn gaussians<const D: usize>(
    row: &mut [f32; LANES],
    targets: [&[f32; LANES]; D],
    y: &[f32; D],
    scale: f32,
) {
    *row = [0.0; LANES];
    for (t, c) in targets.iter().zip(y) {
        (0..LANES).for_each(|l| row[l] += (t[l] - c) * (t[l] - c));
    }
    (0..LANES).for_each(|l| row[l] = exp(row[l] * scale));
}

/// The same for targets of different precision, times their heights.
#[inline(always)]
pub(super) fn gaussians_of<const D: usize>(
    row: &mut [f32; LANES],
    targets: [&[f32; LANES]; D],
    y: &[f32; D],
    scale: f32,
    (precision, height): (&[f32; LANES], &[f32; LANES]),
) {
    *row = [0.0; LANES];
    for (t, c) in targets.iter().zip(y) {
        (0..LANES).for_each(|l| row[l] += (t[l] - c) * (t[l] - c));
    }
    (0..LANES).for_each(|l| row[l] = height[l] * exp(row[l] * scale * precision[l]));
}

/// Running sums of a row, lane by lane.
pub(super) struct Moments<const D: usize> {
    pub(super) weight: [f32; LANES],
    pub(super) shift: [[f32; LANES]; D],
    pub(super) spread: [f32; LANES],
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
    pub(super) fn add(
        &mut self,
        k: &[f32; LANES],
        b: &[f32; LANES],
        targets: [&[f32; LANES]; D],
        y: &[f32; D],
    ) {
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
