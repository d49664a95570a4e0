//! Rising functions through the origin: integrals of piecewise linear slopes.

use nalgebra::SVector;

/// Number of knots. Twelve intervals follow powers from 0.8 to 1.2 to 10⁻³ of the force; more cost nothing but are all prior.
pub(super) const KNOTS: usize = 13;

/// One number a knot: slopes, or the integrals they are multiplied with.
pub(super) type Knots = SVector<f64, KNOTS>;

/// f(d) = ∫₀ᵈ s with s linear between its values at the knots; slopes that are not negative make f rise.
///
/// Knots lie at t_j = top (j/12)²: light that goes as a power of the pressure bends most near zero. Below zero f goes on with the
/// slope at zero, so that noise about zero adds nothing; beyond the top it goes on with the last slope.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Basis {
    pub(super) top: f64,
}

impl Basis {
    pub(super) fn knot(&self, j: usize) -> f64 {
        let share = j as f64 / (KNOTS - 1) as f64;
        self.top * share * share
    }

    /// The interval that holds `d`, and its share from the interval's start.
    fn place(&self, d: f64) -> (usize, f64) {
        let intervals = (KNOTS - 1) as f64;
        let at = (intervals * (d / self.top).max(0.0).sqrt()).min(intervals - 1.0) as usize;
        let (from, to) = (self.knot(at), self.knot(at + 1));
        (at, ((d - from) / (to - from)).clamp(0.0, 1.0))
    }

    /// The integral over each knot's slope: f(d) is the scalar product with the slopes.
    pub(super) fn integrals(&self, d: f64) -> Knots {
        let mut row = Knots::zeros();
        if d <= 0.0 {
            row[0] = d;
            return row;
        }
        let (at, x) = self.place(d);
        for j in 0..=at {
            let width = self.knot(j + 1) - self.knot(j);
            let share = if j == at { x } else { 1.0 };
            row[j] += width * share * (1.0 - 0.5 * share);
            row[j + 1] += 0.5 * width * share * share;
        }
        row[KNOTS - 1] += (d - self.top).max(0.0);
        row
    }

    /// The slope at `d` is the scalar product with the slopes at the knots.
    pub(super) fn weights(&self, d: f64) -> Knots {
        let (at, x) = self.place(d);
        let mut row = Knots::zeros();
        row[at] = 1.0 - x;
        row[at + 1] = x;
        row
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
                // Midpoints are exact but at the knots, where a step holds a corner.
                assert!((found - sum).abs() < 1e-5, "{d}: {found} {sum}");
            }
        }
        assert_eq!(basis.integrals(-2.0).dot(&slopes), -2.0 * slopes[0]);
        assert_eq!(basis.integrals(0.0), Knots::zeros());
    }
}
