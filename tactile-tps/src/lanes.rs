//! Arithmetic of vectorised loops, and their dispatch to the instruction set of the processor.
//!
//! The loops are plain Rust over slices of one scalar type. If they are inlined into a function
//! with wider vectors enabled, the compiler vectorises them. Sums are written out (fused or not),
//! so that the result depends only on this choice.

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::KernelScalar;

/// Unit roundoff, half the distance from one to the next number.
pub(crate) const UNIT_ROUNDOFF: f64 = 0.5 * f64::EPSILON;

/// A [`KernelScalar`] that represents an `f64` in a vectorised loop.
pub(crate) trait Lane: KernelScalar {
    /// The represented number.
    fn get(self) -> f64;
}

impl Lane for f64 {
    #[inline(always)]
    fn get(self) -> f64 {
        self
    }
}

impl KernelScalar for f64 {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        ln(self, |a, b, c| a * b + c)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        f64::exp(self)
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }
}

/// `f64` with `mul_add` as one hardware instruction.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Fused(f64);

impl Lane for Fused {
    #[inline(always)]
    fn get(self) -> f64 {
        self.0
    }
}

impl KernelScalar for Fused {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Self(x)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    #[inline(always)]
    fn ln(self) -> Self {
        Self(ln(self.0, f64::mul_add))
    }
    #[inline(always)]
    fn exp(self) -> Self {
        Self(self.0.exp())
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self(self.0.mul_add(a.0, b.0))
    }
}

macro_rules! operator {
    ($($trait:ident $method:ident),*) => {$(
        impl $trait for Fused {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    )*};
}
operator!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Fused {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

/// Work on lanes. Mark `run` and the functions that it calls `#[inline(always)]`.
pub(crate) trait Job {
    type Output;
    fn run<L: Lane>(self) -> Self::Output;
}

struct Dispatched<J>(J);

impl<J: Job> pulp::WithSimd for Dispatched<J> {
    type Output = J::Output;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> J::Output {
        // Without a fused instruction, `mul_add` is a slow library call.
        if S::IS_SCALAR || cfg!(target_arch = "wasm32") {
            self.0.run::<f64>()
        } else {
            self.0.run::<Fused>()
        }
    }
}

/// Runs the job.
pub(crate) fn dispatch<J: Job>(job: J) -> J::Output {
    pulp::Arch::new().dispatch(Dispatched(job))
}

/// Inner product in eight partial sums, which the compiler combines into vectors.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (lanes, others) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = lanes
        .remainder()
        .iter()
        .zip(others.remainder())
        .map(|(a, b)| a * b)
        .sum();
    for (a, b) in lanes.zip(others) {
        for l in 0..8 {
            sums[l] += a[l] * b[l];
        }
    }
    sums.iter().sum::<f64>() + tail
}

/// Largest magnitude.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, x| f64::max(m, x.abs()))
}

/// `size` relative to the largest target.
pub(crate) fn relative(size: f64, targets: &[f64]) -> f64 {
    let target = largest(targets);
    if target > 0.0 { size / target } else { size }
}

/// The squared distance of point `i` from a position. Coordinates are given by axes.
#[inline(always)]
pub(crate) fn squared_distance<L: Lane, const D: usize>(
    axes: [&[f64]; D],
    i: usize,
    place: [L; D],
) -> L {
    let mut s = L::from_f64(0.0);
    for k in 0..D {
        let d = L::from_f64(axes[k][i]) - place[k];
        s = d.mul_add(d, s);
    }
    s
}

/// ln x for positive normal `x`, without branches or tables, so that loops vectorise. For other
/// values the result is finite but meaningless.
///
/// x = 2ᵏ m with m in [√½, √2), f = m − 1, t = f/(2 + f) and ln m = 2 artanh t = f − f²/2 + t
/// (f²/2 + R(t²)). R is a minimax polynomial (coefficients of fdlibm, Sun Microsystems 1993). Its
/// error is below 2⁻⁵⁸.
#[inline(always)]
fn ln(x: f64, fma: impl Fn(f64, f64, f64) -> f64) -> f64 {
    let root_half: u64 = 0x3fe6_a09e_667f_3bcd;
    let one: u64 = 0x3ff0_0000_0000_0000;
    let mantissa: u64 = 0x000f_ffff_ffff_ffff;
    let two_52: u64 = 0x4330_0000_0000_0000;
    let ln2_high: f64 = 6.931_471_803_691_238e-1;
    let ln2_low: f64 = 1.908_214_929_270_587_7e-10;
    let shifted = x.to_bits().wrapping_add(one - root_half);
    // The exponent as the low bits of 2⁵²: a conversion to floating point that vectorises on every
    // processor.
    let k = f64::from_bits(two_52 | (shifted >> 52)) - (4_503_599_627_370_496.0 + 1023.0);
    let f = f64::from_bits((shifted & mantissa).wrapping_add(root_half)) - 1.0;
    let t = f / (2.0 + f);
    let z = t * t;
    let w = z * z;
    let even = fma(
        w,
        fma(w, 0.153_138_376_992_093_73, 0.222_221_984_321_497_84),
        0.399_999_999_994_094_2,
    ) * w;
    let odd = fma(w, 0.147_981_986_051_165_86, 0.181_835_721_616_180_5);
    let odd = fma(
        w,
        fma(w, odd, 0.285_714_287_436_623_9),
        0.666_666_666_666_673_5,
    ) * z;
    let half_square = 0.5 * f * f;
    // ln 2 is split into two parts, so that k times the upper part is exact.
    let tail = fma(t, half_square + (odd + even), k * ln2_low);
    fma(k, ln2_high, f - (half_square - tail))
}

#[cfg(test)]
mod tests {
    use super::ln;

    /// Arguments over all exponents and close to one, from a fixed multiplicative sequence.
    fn arguments() -> impl Iterator<Item = f64> {
        let wide = (0..200_000u64).map(|i| {
            let bits = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            f64::from_bits((bits >> 2) % 0x7fe0_0000_0000_0000 + 0x0010_0000_0000_0000)
        });
        wide.chain((0..200_000).map(|i| 0.5 + f64::from(i) * 1e-5))
    }

    /// fdlibm states less than one unit in the last place. The library's own logarithm may be off
    /// by half a unit, and an ulp is up to twice epsilon in relative terms.
    #[test]
    fn logarithm_agrees_with_the_library_to_an_ulp() {
        assert_eq!(ln(1.0, f64::mul_add), 0.0);
        for x in arguments().filter(|&x| x != 1.0) {
            for found in [ln(x, f64::mul_add), ln(x, |a, b, c| a * b + c)] {
                let size = x.ln().abs().max(f64::MIN_POSITIVE);
                assert!((found - x.ln()).abs() <= 1.5 * f64::EPSILON * size, "{x:e}");
            }
        }
    }
}
