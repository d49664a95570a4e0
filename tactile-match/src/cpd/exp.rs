//! eˣ in loops that vectorise.

/// `e^x` for `x <= 0`, to about one unit in the last place; exactly zero below −708, where a product with anything of size one
/// would be lost anyway. No branch and no table, so that a loop over it vectorises; plain products and sums, so that every
/// machine gives the same bits.
#[inline(always)]
pub(super) fn exp_of_negative(x: f64) -> f64 {
    const LOWEST: f64 = -708.0;
    // Adding 1.5·2⁵² rounds to an integer and leaves it, offset by the exponent's bias, in the lowest bits.
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let clamped = if x > LOWEST { x } else { LOWEST };
    let shifted = clamped * std::f64::consts::LOG2_E + SHIFT;
    let k = shifted - SHIFT;
    let r = clamped - k * LN2_HIGH - k * LN2_LOW;
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    let value = taylor(r) * power;
    if x > LOWEST { value } else { 0.0 }
}

/// Σ rⁿ/n! to n = 13: below 2⁻⁵³ of eʳ for |r| ≤ ½ ln 2.
#[inline(always)]
fn taylor(r: f64) -> f64 {
    const INVERSE_FACTORIAL: [f64; 12] = [
        1.0 / 6_227_020_800.0,
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
    ];
    let mut sum = INVERSE_FACTORIAL[0];
    for &c in &INVERSE_FACTORIAL[1..] {
        sum = sum * r + c;
    }
    1.0 + (r + r * r * sum)
}

#[cfg(test)]
mod tests {
    use super::exp_of_negative;

    /// Two units in the last place: the polynomial's own rounding and that of the product with the power of two's reduction.
    #[test]
    fn agrees_with_the_standard_library() {
        for k in 0..200_000 {
            let x = -f64::from(k) * 0.003_541;
            let (found, expected) = (exp_of_negative(x), x.exp());
            if x > -708.0 {
                assert!(
                    (found - expected).abs() <= 2.0 * f64::EPSILON * expected,
                    "exp({x}) = {found:e}"
                );
            }
        }
    }

    #[test]
    fn ends_are_exact() {
        assert_eq!(exp_of_negative(0.0), 1.0);
        assert_eq!(exp_of_negative(-0.0), 1.0);
        for low in [-708.0, -1e3, -1e300, f64::NEG_INFINITY] {
            assert_eq!(exp_of_negative(low), 0.0);
        }
    }
}
