//! Natural logarithms without branches or tables, so that loops over them vectorise.
//!
//! x = 2ᵏ m with m in [√½, √2), f = m − 1, t = f/(2 + f) and ln m = 2 artanh t = f − f²/2 + t (f²/2 + R(t²)), R a
//! minimax polynomial (coefficients of fdlibm, Sun Microsystems 1993; its error is below 2⁻⁵⁸, in f32 below 2⁻³⁴).

/// ln x for positive normal `x`; finite nonsense, but no trap, for the rest.
#[inline(always)]
pub(crate) fn ln_f64(x: f64, fma: impl Fn(f64, f64, f64) -> f64) -> f64 {
    const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    const MANTISSA: u64 = 0x000f_ffff_ffff_ffff;
    const TWO_52: u64 = 0x4330_0000_0000_0000;
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let shifted = x.to_bits().wrapping_add(ONE - ROOT_HALF);
    let k = f64::from_bits(TWO_52 | (shifted >> 52)) - (4_503_599_627_370_496.0 + 1023.0);
    let f = f64::from_bits((shifted & MANTISSA).wrapping_add(ROOT_HALF)) - 1.0;
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
    let tail = fma(t, half_square + (odd + even), k * LN2_LOW);
    fma(k, LN2_HIGH, f - (half_square - tail))
}

/// The same in single precision.
#[inline(always)]
pub(crate) fn ln_f32(x: f32, fma: impl Fn(f32, f32, f32) -> f32) -> f32 {
    const ROOT_HALF: u32 = 0x3f35_04f3;
    const ONE: u32 = 0x3f80_0000;
    const MANTISSA: u32 = 0x007f_ffff;
    const TWO_23: u32 = 0x4b00_0000;
    const LN2_HIGH: f32 = 6.931_381e-1;
    const LN2_LOW: f32 = 9.058_001e-6;
    let shifted = x.to_bits().wrapping_add(ONE - ROOT_HALF);
    let k = f32::from_bits(TWO_23 | (shifted >> 23)) - (8_388_608.0 + 127.0);
    let f = f32::from_bits((shifted & MANTISSA).wrapping_add(ROOT_HALF)) - 1.0;
    let t = f / (2.0 + f);
    let z = t * t;
    let w = z * z;
    let even = fma(w, 0.242_790_79, 0.400_009_72) * w;
    let odd = fma(w, 0.284_987_87, 0.666_666_6) * z;
    let half_square = 0.5 * f * f;
    let tail = fma(t, half_square + (odd + even), k * LN2_LOW);
    fma(k, LN2_HIGH, f - (half_square - tail))
}

#[cfg(test)]
mod tests {
    use super::{ln_f32, ln_f64};

    /// Arguments over all exponents and close to one, by a fixed multiplicative sequence.
    fn arguments() -> impl Iterator<Item = f64> {
        let wide = (0..200_000u64).map(|i| {
            let bits = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            f64::from_bits((bits >> 2) % 0x7fe0_0000_0000_0000 + 0x0010_0000_0000_0000)
        });
        wide.chain((0..200_000).map(|i| 0.5 + f64::from(i) * 1e-5))
    }

    fn ulps(found: f64, expected: f64, epsilon: f64) -> f64 {
        (found - expected).abs() / (expected.abs().max(f64::MIN_POSITIVE) * epsilon)
    }

    /// fdlibm states less than one unit in the last place; the library's own logarithm may be half a unit off, and
    /// an ulp is up to twice epsilon relative.
    #[test]
    fn agrees_with_the_library_to_an_ulp() {
        for x in arguments().filter(|&x| x != 1.0) {
            assert!(
                ulps(ln_f64(x, f64::mul_add), x.ln(), f64::EPSILON) <= 1.5,
                "{x:e}"
            );
            assert!(
                ulps(ln_f64(x, |a, b, c| a * b + c), x.ln(), f64::EPSILON) <= 1.5,
                "{x:e}"
            );
        }
        for x in arguments()
            .map(|x| x as f32)
            .filter(|x| x.is_normal() && *x != 1.0)
        {
            let expected = f64::from(x).ln();
            assert!(
                ulps(
                    f64::from(ln_f32(x, f32::mul_add)),
                    expected,
                    f64::from(f32::EPSILON)
                ) <= 1.5,
                "{x:e}"
            );
            let plain = f64::from(ln_f32(x, |a, b, c| a * b + c));
            assert!(
                ulps(plain, expected, f64::from(f32::EPSILON)) <= 1.5,
                "{x:e}"
            );
        }
    }

    #[test]
    fn is_exact_at_one() {
        assert_eq!(
            (ln_f64(1.0, f64::mul_add), ln_f32(1.0, f32::mul_add)),
            (0.0, 0.0)
        );
    }
}
