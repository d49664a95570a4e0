//! Marginal posteriors of an inclusion's parameters, which are not Gaussian.
//!
//! A stiff inclusion hardly changes the pressure when it gets stiffer still, and a small stiff one is hardly told from a
//! large one that is little stiffer than the tissue: along such a ridge the posterior's density falls neither fast nor
//! evenly, and the curvature at its top says little of its length. With u = ln E₁, θ all other coordinates, F the fit's objective
//! (−2 ln of the posterior), θ(u) its minimum at given u and M(u) its curvature there in θ,
//!
//! $$ p(u) \propto |M(u)|^{-1/2} \exp(-F(u, \theta(u)) / 2) $$
//!
//! and at a given u the others are Gaussian about θ(u) with covariance M(u)⁻¹ (Laplace's approximation, nested: H. Rue, S. Martino & N.
//! Chopin, J. R. Stat. Soc. B 71 (2009) 319), which gives evidence, covariance and quantiles.

use super::ridge::{Node, Ridge};
use nalgebra::{DMatrix, DVector};
use statrs::function::erf::erfc;

/// Largest rise of ln p between nodes: parabolas through uneven ones overshoot.
const RISE: f64 = 0.3;
/// Points of the quadrature over u.
const POINTS: usize = 200;
/// Fall of ln p beyond the last node up to which its slope is followed.
const TAIL: f64 = 4.0;

/// Marginal posteriors of all coordinates: a mixture of Gaussians.
#[derive(Debug, Clone)]
pub(super) struct Marginal {
    weights: Vec<f64>,
    points: Vec<Node>,
    /// Logarithm of the evidence over that by the curvature at the optimum.
    pub(super) gain: f64,
}

/// A function of the nodes at `x` in the interval after node `k`: the mean of the parabolas through the nodes around it.
fn between(xs: &[f64], ys: &[f64], k: usize, x: f64) -> f64 {
    let parabola = |first: usize| -> f64 {
        let [a, b, c] = [xs[first], xs[first + 1], xs[first + 2]];
        ys[first] * (x - b) * (x - c) / ((a - b) * (a - c))
            + ys[first + 1] * (x - a) * (x - c) / ((b - a) * (b - c))
            + ys[first + 2] * (x - a) * (x - b) / ((c - a) * (c - b))
    };
    match (k > 0, k + 2 < xs.len()) {
        (true, true) => 0.5 * (parabola(k - 1) + parabola(k)),
        (true, false) => parabola(k - 1),
        (false, _) => parabola(k),
    }
}

/// The ridge between its nodes and beyond the outermost.
struct Curve<'a> {
    nodes: &'a [Node],
    /// ln E₁ of the nodes, ascending.
    xs: Vec<f64>,
}

impl Curve<'_> {
    /// Fall of ln p by ln E₁ beyond the first node, or the last: the parabola's through three there, not below the last
    /// interval's and not negative.
    fn slope(&self, is_first: bool) -> f64 {
        let last = self.xs.len() - 1;
        let [a, b, c] = if is_first {
            [0, 1, 2]
        } else {
            [last, last - 1, last - 2]
        };
        let step = |from: usize, to: usize| (self.xs[to] - self.xs[from]).abs();
        let mean = |outer: usize, inner: usize| {
            (self.nodes[inner].density - self.nodes[outer].density) / step(outer, inner)
        };
        let (near, far) = (mean(a, b), mean(b, c));
        (near + ((near - far) * step(a, b) / step(a, c)).max(0.0)).max(0.0)
    }

    /// How far that slope is followed.
    fn tail(&self, is_first: bool) -> f64 {
        let last = self.xs.len() - 1;
        let [outer, inner] = if is_first { [0, 1] } else { [last, last - 1] };
        let step = (self.xs[outer] - self.xs[inner]).abs();
        // A side that ended before p fell is followed as far as its last step.
        (TAIL / self.slope(is_first).max(1e-9)).clamp(step, 4.0 * step)
    }

    /// The ridge at ln E₁.
    fn at(&self, x: f64) -> Node {
        let last = self.xs.len() - 1;
        let k = self.xs.partition_point(|node| *node < x).clamp(1, last) - 1;
        let (a, b) = (&self.nodes[k], &self.nodes[k + 1]);
        let part = (x - self.xs[k]) / (self.xs[k + 1] - self.xs[k]);
        if !(0.0..=1.0).contains(&part) {
            let (end, other, beyond) = if part < 0.0 {
                (a, b, -part)
            } else {
                (b, a, part - 1.0)
            };
            let away = beyond * (self.xs[k + 1] - self.xs[k]);
            return Node {
                density: end.density - away * self.slope(part < 0.0),
                at: &end.at + beyond * (&end.at - &other.at),
                covariance: end.covariance.clone(),
            };
        }
        let value = |of: &dyn Fn(&Node) -> f64| {
            let ys: Vec<f64> = self.nodes.iter().map(of).collect();
            between(&self.xs, &ys, k, x)
        };
        let (low, high) = (a.density.min(b.density), a.density.max(b.density));
        Node {
            density: value(&|node| node.density).clamp(low, high + RISE),
            at: DVector::from_fn(a.at.len(), |c, _| value(&|node| node.at[c])),
            covariance: &a.covariance * (1.0 - part) + &b.covariance * part,
        }
    }
}

impl Marginal {
    /// Of a ridge; `None` where neither side could be followed.
    pub(super) fn new(ridge: &Ridge) -> Option<Self> {
        let (nodes, index) = (&ridge.nodes, ridge.index);
        let xs: Vec<f64> = nodes.iter().map(|node| node.at[index]).collect();
        if xs.len() < 3 || xs.windows(2).any(|pair| pair[1] <= pair[0]) {
            return None;
        }
        let last = xs.len() - 1;
        let curve = Curve { nodes, xs };
        let from = curve.xs[0] - curve.tail(true);
        let to = curve.xs[last] + curve.tail(false);
        let step = (to - from) / POINTS as f64;
        let mut points: Vec<Node> = (0..POINTS)
            .map(|point| curve.at(from + (point as f64 + 0.5) * step))
            .collect();
        for point in &mut points {
            // The point's own width.
            point.covariance[(index, index)] = step * step / 12.0;
        }
        let largest = (points.iter())
            .map(|point| point.density)
            .fold(f64::NEG_INFINITY, f64::max);
        let weight = |point: &Node| (point.density - largest).exp();
        let sum: f64 = points.iter().map(weight).sum();
        Some(Self {
            weights: points.iter().map(|point| weight(point) / sum).collect(),
            points,
            gain: largest + (sum * step).ln() - ridge.laplace,
        })
    }

    /// The value that a coordinate is as probably above as below: the optimum of a skewed posterior lies at an end of its interval.
    pub(super) fn median(&self, coordinate: usize) -> f64 {
        self.quantile(coordinate, 0.5)
    }

    /// The 95 % interval of a coordinate, with equal tails: it holds 96, 98 and 97 % of 161 inclusions' D, d and E₁ by CalculiX, the likelihood
    /// ratio's 96, 98 and 98 (`inclusion_study`).
    pub(super) fn interval(&self, coordinate: usize) -> [f64; 2] {
        [0.025, 0.975].map(|probability| self.quantile(coordinate, probability))
    }

    /// The value that a coordinate is below with this probability.
    fn quantile(&self, coordinate: usize, probability: f64) -> f64 {
        let each = || {
            (self.points.iter()).map(|point| {
                let error = point.covariance[(coordinate, coordinate)].sqrt();
                (point.at[coordinate], error)
            })
        };
        let mut low = f64::INFINITY;
        let mut high = f64::NEG_INFINITY;
        for (at, error) in each() {
            low = low.min(at - 6.0 * error);
            high = high.max(at + 6.0 * error);
        }
        // Bisection to a millionth of the range.
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            let below: f64 = (each().zip(&self.weights))
                .map(|((at, error), weight)| weight * normal_below((middle - at) / error))
                .sum();
            if below < probability {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }

    /// Covariance of the coordinates.
    pub(super) fn covariance(&self) -> DMatrix<f64> {
        let count = self.points[0].at.len();
        let mut mean = DVector::zeros(count);
        for (weight, point) in self.weights.iter().zip(&self.points) {
            mean.axpy(*weight, &point.at, 1.0);
        }
        let mut covariance = DMatrix::zeros(count, count);
        for (weight, point) in self.weights.iter().zip(&self.points) {
            let off = &point.at - &mean;
            covariance += *weight * (&point.covariance + &off * off.transpose());
        }
        covariance
    }
}

/// Probability that a standard normal deviate is below `x`.
fn normal_below(x: f64) -> f64 {
    0.5 * erfc(-x * core::f64::consts::FRAC_1_SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::{DMatrix, DVector, Marginal, Node, Ridge};

    /// Nodes at these deviations of ln E₁, on which another coordinate depends linearly.
    fn ridge(at: &[f64], density: impl Fn(f64) -> f64, laplace: f64) -> Ridge {
        let node = |x: &f64| Node {
            density: density(*x),
            at: DVector::from_vec(vec![-0.5 * x, *x]),
            covariance: DMatrix::from_diagonal(&DVector::from_vec(vec![0.04, 0.0])),
        };
        Ridge {
            nodes: at.iter().map(node).collect(),
            index: 1,
            laplace,
        }
    }

    #[test]
    fn a_gaussian_has_its_own_interval_and_evidence() {
        let (error, top) = (0.3, -7.0);
        let at: Vec<f64> = (-2..=2).map(|k| 0.36 * f64::from(k)).collect();
        let laplace = top + 0.5 * core::f64::consts::TAU.ln() + f64::ln(error);
        let ridge = ridge(&at, |x| top - 0.5 * (x / error).powi(2), laplace);
        let marginal = Marginal::new(&ridge).unwrap();
        let own = 1.96 * error;
        let other = 1.96 * f64::hypot(0.5 * error, 0.2);
        for (coordinate, reach) in [(1, own), (0, other)] {
            let [low, high] = marginal.interval(coordinate);
            assert!(
                (high / reach - 1.0).abs() < 0.03,
                "{coordinate}: {high} {reach}"
            );
            assert!(
                (low / reach + 1.0).abs() < 0.03,
                "{coordinate}: {low} {reach}"
            );
        }
        assert!(marginal.gain.abs() < 0.03, "{}", marginal.gain);
        let correlation = marginal.covariance()[(0, 1)] / (0.3 * f64::hypot(0.15, 0.2));
        assert!((correlation + 0.6).abs() < 0.05, "{correlation}");
    }

    #[test]
    fn a_ridge_that_is_open_upwards_reaches_further_there() {
        // Falls as a Gaussian of 0.2 below and of three times that above: a quarter and three quarters of the probability.
        let fall = |x: f64| {
            if x < 0.0 {
                12.5 * x * x
            } else {
                12.5 / 9.0 * x * x
            }
        };
        let nodes = [-0.5, -0.25, 0.0, 0.6, 1.2, 1.8];
        let marginal = Marginal::new(&ridge(&nodes, |x| -fall(x), 0.0)).unwrap();
        let [low, high] = marginal.interval(1);
        // Where the half Gaussians leave a tenth of a quarter, and a thirtieth of three quarters.
        assert!((low + 0.2 * 1.645).abs() < 0.03, "{low}");
        assert!((high - 0.6 * 2.128).abs() < 0.06, "{high}");
        assert!((marginal.median(1) - 0.6 * 0.431).abs() < 0.03);
    }

    #[test]
    fn two_nodes_are_no_ridge() {
        assert!(Marginal::new(&ridge(&[0.0, 1.0], |_| 0.0, 0.0)).is_none());
    }
}
