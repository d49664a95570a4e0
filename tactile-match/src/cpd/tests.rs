//! Tests of the building blocks.

use super::*;

/// Two units in the last place: one for the rounding of the polynomial, one for the argument
/// reduction.
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
