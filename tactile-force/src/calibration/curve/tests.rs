use super::*;
use proptest::prelude::*;

#[test]
fn integrals_are_those_of_the_slope() {
    let basis = Basis { top: 150.0 };
    let slopes = Knots::from_fn(|j, _| 1.0 + (j as f64 * 0.7).sin());
    let mut sum = 0.0;
    let step = 1e-3;
    for k in 0..170_000 {
        let d = step * (f64::from(k) + 0.5);
        sum += step * basis.weights(d).dot(&slopes);
        if k % 10_000 == 9_999 {
            let found = basis.integrals(d + 0.5 * step).dot(&slopes);
            // The midpoint rule is exact except at the knots, where a step contains a corner.
            assert!((found - sum).abs() < 1e-5, "{d}: {found} {sum}");
        }
    }
    assert_eq!(basis.integrals(-2.0).dot(&slopes), -2.0 * slopes[0]);
    assert_eq!(basis.integrals(0.0), Knots::zeros());
}

proptest! {
    /// The Karush–Kuhn–Tucker conditions: no coefficient is negative, and no change of a
    /// coefficient is an improvement.
    #[test]
    fn solutions_satisfy_the_conditions_of_a_minimum(
        numbers in proptest::collection::vec(-1.0_f64..1.0, KNOTS * (KNOTS + 1))
    ) {
        let factor = Normal::from_fn(|i, j| numbers[KNOTS * i + j]);
        let normal = factor * factor.transpose() + Normal::identity() * 0.1;
        let right = Knots::from_fn(|j, _| numbers[KNOTS * KNOTS + j]);
        let (x, free) = nonnegative(&normal, &right);
        let gradient = right - normal * x;
        for j in 0..KNOTS {
            prop_assert!(x[j] >= 0.0);
            // Rounding error of thirteen products of order one.
            prop_assert!(gradient[j] < 1e-9);
            let complementary = if free[j] { gradient[j].abs() < 1e-9 } else { x[j] == 0.0 };
            prop_assert!(complementary);
        }
    }
}
