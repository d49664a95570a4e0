//! Least squares with coefficients that must not be negative.

use nalgebra::SMatrix;

use super::basis::{KNOTS, Knots};

pub(super) type Normal = SMatrix<f64, KNOTS, KNOTS>;

/// The minimiser of ½ xᵀHx − gᵀx over x ≥ 0, and which coefficients are free (C. Lawson and R. Hanson, *Solving Least Squares
/// Problems*, 1974, chapter 23). H is positive definite.
pub(super) fn solve(normal: &Normal, right: &Knots) -> (Knots, [bool; KNOTS]) {
    let mut free = [false; KNOTS];
    let mut x = Knots::zeros();
    // Rounding of a gradient.
    let tolerance = 1e-12 * right.amax();
    // Each round frees one coefficient; in practice few are bound again.
    for _ in 0..10 * KNOTS {
        let gradient = right - normal * x;
        let most = (0..KNOTS)
            .filter(|&j| !free[j] && gradient[j] > tolerance)
            .max_by(|&a, &b| gradient[a].total_cmp(&gradient[b]));
        let Some(most) = most else {
            break;
        };
        free[most] = true;
        loop {
            let target = unconstrained(normal, right, &free);
            let leaving = (0..KNOTS).filter(|&j| free[j] && target[j] <= 0.0);
            // The largest step towards the target that keeps every coefficient.
            let step = leaving
                .map(|j| x[j] / (x[j] - target[j]))
                .fold(f64::INFINITY, f64::min);
            if step == f64::INFINITY {
                x = target;
                break;
            }
            x += (target - x) * step;
            for j in 0..KNOTS {
                if free[j] && target[j] <= 0.0 && x[j] <= 1e-14 * x.amax() {
                    free[j] = false;
                    x[j] = 0.0;
                }
            }
        }
    }
    (x, free)
}

/// The minimiser over the free coefficients, zero elsewhere.
fn unconstrained(normal: &Normal, right: &Knots, free: &[bool; KNOTS]) -> Knots {
    let (normal, right) = (
        bound(normal, free),
        Knots::from_fn(|j, _| if free[j] { right[j] } else { 0.0 }),
    );
    normal
        .cholesky()
        .map_or(Knots::zeros(), |c| c.solve(&right))
}

/// H with the rows and columns of bound coefficients replaced by those of the identity.
pub(super) fn bound(normal: &Normal, free: &[bool; KNOTS]) -> Normal {
    Normal::from_fn(|i, j| match (free[i] && free[j], i == j) {
        (true, _) => normal[(i, j)],
        (false, true) => 1.0,
        (false, false) => 0.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The Karush–Kuhn–Tucker conditions: nothing negative, no gain from any coefficient.
        #[test]
        fn solutions_satisfy_the_conditions_of_a_minimum(
            numbers in proptest::collection::vec(-1.0_f64..1.0, KNOTS * (KNOTS + 1))
        ) {
            let factor = Normal::from_fn(|i, j| numbers[KNOTS * i + j]);
            let normal = factor * factor.transpose() + Normal::identity() * 0.1;
            let right = Knots::from_fn(|j, _| numbers[KNOTS * KNOTS + j]);
            let (x, free) = solve(&normal, &right);
            let gradient = right - normal * x;
            for j in 0..KNOTS {
                prop_assert!(x[j] >= 0.0);
                // Rounding of thirteen products of order one.
                prop_assert!(gradient[j] < 1e-9);
                let complementary = if free[j] { gradient[j].abs() < 1e-9 } else { x[j] == 0.0 };
                prop_assert!(complementary);
            }
        }
    }
}
