//! Intervals of an inclusion's parameters, which are not Gaussian.
//!
//! A stiff inclusion hardly changes the pressure when it gets stiffer still: the posterior of ln E₁ falls
//! slowly to higher moduli and steeply to lower ones, and D and d go along. With F the fit's objective
//! (−2 ln of the posterior), minimised over all other coordinates at a given change u of ln E₁, the signed root
//!
//! $$ g(u) = \mathrm{sign}(u) \sqrt{F(u) - F(0)} $$
//!
//! is a standard normal deviate but for terms of higher order, and an interval ends where |g| is that of
//! its probability (O. E. Barndorff-Nielsen & D. R. Cox, *Inference and Asymptotics*, 1994). F is evaluated on both
//! sides, the other coordinates minimised by one step of Gauss and Newton; in between, all coordinates are
//! parabolas in g.

use super::fit::{Fit, Problem};
use super::parameters::Coordinate;
use nalgebra::{DMatrix, DVector};

/// Distance from the optimum, in standard errors, at which the objective is evaluated.
const DISTANCE: f64 = 1.5;
/// Largest change of ln E₁ to get there.
const LARGEST_CHANGE: f64 = 1.2;
/// Slope of a coordinate beyond an evaluated side, at least this part of the mean slope up to there.
const LEAST_SLOPE: f64 = 0.3;

/// The posterior along ln E₁.
#[derive(Debug, Clone)]
pub(super) struct Profile {
    /// Of each side, lower first: g, and the changes of all coordinates.
    sides: [(f64, DVector<f64>); 2],
    /// Standard errors of the coordinates at a given E₁.
    conditional: Vec<f64>,
}

impl Problem {
    /// The profile at an optimum with an inclusion; `None` where a side cannot be solved or is no worse than
    /// the optimum.
    pub(super) fn profile(&self, fit: &Fit) -> Option<Profile> {
        let coordinates = self.coordinates();
        let index = (coordinates.iter()).position(|c| *c == Coordinate::LumpModulus)?;
        let variance = fit.covariance[(index, index)];
        let change = (DISTANCE * variance.sqrt()).min(LARGEST_CHANGE);
        let along = fit.covariance.column(index) / variance;
        let side = |sign: f64| self.side(fit, index, sign * change * &along, sign);
        let sides = [side(-1.0)?, side(1.0)?];
        let conditional = (0..coordinates.len())
            .map(|k| {
                let rest = fit.covariance[(k, k)] - fit.covariance[(k, index)].powi(2) / variance;
                rest.max(0.0).sqrt()
            })
            .collect();
        Some(Profile { sides, conditional })
    }

    fn side(
        &self,
        fit: &Fit,
        index: usize,
        step: DVector<f64>,
        sign: f64,
    ) -> Option<(f64, DVector<f64>)> {
        let at = self.stepped(&fit.parameters, &step);
        let normal = self.normal(&at, Some(&fit.solved))?;
        // All coordinates but E₁ go on to their own optimum.
        let mut matrix: DMatrix<f64> = normal.matrix.clone();
        let mut gradient = normal.gradient.clone();
        matrix.row_mut(index).fill(0.0);
        matrix.column_mut(index).fill(0.0);
        matrix[(index, index)] = 1.0;
        gradient[index] = 0.0;
        let rest = matrix.cholesky()?.solve(&gradient);
        let objective = normal.misfit + normal.penalty - gradient.dot(&rest);
        let rise = objective - fit.misfit - fit.penalty;
        (rise > 0.0).then(|| (sign * rise.sqrt(), step + rest))
    }
}

impl Profile {
    /// Change of a coordinate along the profile at a deviate g: the parabola in g through the optimum and both sides, and
    /// beyond a side its tangent there.
    fn change_at(&self, coordinate: usize, deviate: f64) -> f64 {
        let [(a, low), (b, high)] = &self.sides;
        // Mean slopes of both sides; the parabola's divided difference.
        let (left, right) = (low[coordinate] / a, high[coordinate] / b);
        let bend = (right - left) / (b - a);
        let slope = left - bend * a;
        let (end, mean) = if deviate < 0.0 {
            (*a, left)
        } else {
            (*b, right)
        };
        if deviate.abs() <= end.abs() || mean == 0.0 {
            return (slope + bend * deviate) * deviate;
        }
        // A parabola that turns back says nothing beyond its end.
        let tangent = (slope + 2.0 * bend * end) / mean;
        mean * (end + tangent.max(LEAST_SLOPE) * (deviate - end))
    }

    /// How far a coordinate's interval at ± `deviate` reaches down and up from the optimum, both positive.
    pub(super) fn reach(&self, coordinate: usize, deviate: f64) -> [f64; 2] {
        let ends = [-deviate, deviate].map(|deviate| self.change_at(coordinate, deviate));
        let rest = deviate * self.conditional[coordinate];
        let lowest = ends[0].min(ends[1]).min(0.0);
        let highest = ends[0].max(ends[1]).max(0.0);
        [lowest.hypot(rest), highest.hypot(rest)]
    }
}
