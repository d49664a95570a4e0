use super::*;

#[test]
fn nothing_changes_without_a_change_of_volume() {
    // A sum of 160 terms of order one.
    assert!(NoSlipLaw::sphere(1.0, 0.5).unwrap().at_indentation.abs() < 1e-14);
    assert_eq!(NoSlipLaw::punch(1.0, 0.5).unwrap().at_indentation, 0.0);
    assert_eq!(NoSlipLaw::cone(1.0, 0.5).unwrap().at_indentation, 0.0);
}

/// ∫ tanh x cos(2θx)/cosh² x dx = ½ − θ ∫ sin(2θx)/cosh² x dx, the last by e⁻²ˣ's series: 4 Σ
/// (−1)ᵏ⁺¹ k 2θ/(4k² + 4θ²).
#[test]
fn the_parabolas_integral_is_its_series() {
    for theta in [0.01, 0.1, 0.31] {
        // Alternating terms: the mean of two sums that follow each other is within the last
        // difference's change, 10⁻¹¹ here.
        let term = |k: f64| 2.0 * theta * k / (k * k + theta * theta);
        let sign = |k: u32| if k % 2 == 1 { 1.0 } else { -1.0 };
        let sum: f64 = (1..400_000).map(|k| sign(k) * term(f64::from(k))).sum();
        let sum = sum + 0.5 * term(400_000.0) * sign(400_000);
        let found = parabola_integral(theta);
        assert!(
            (found - (0.5 - theta * sum)).abs() < 1e-11,
            "{theta}: {found}"
        );
    }
}
