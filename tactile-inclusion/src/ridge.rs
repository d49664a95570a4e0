//! Marginal posteriors of an inclusion's parameters, which are not Gaussian: the posterior is
//! followed along ln E₁.
//!
//! A stiff inclusion hardly changes the pressure if it becomes stiffer, and a small stiff one is
//! hardly different from a large one that is slightly stiffer than the tissue. Along such a ridge
//! the posterior density falls neither fast nor evenly, and its length cannot be derived from the
//! curvature at the maximum. With u = ln E₁, θ all other coordinates, F the objective of the fit
//! (−2 ln of the posterior), θ(u) its minimum at given u and M(u) its curvature there in θ,
//!
//! $$ p(u) \propto |M(u)|^{-1/2} \exp(-F(u, \theta(u)) / 2) $$
//!
//! and at a given u the other coordinates are Gaussian about θ(u) with covariance M(u)⁻¹ (nested
//! Laplace approximation: H. Rue, S. Martino & N. Chopin, J. R. Stat. Soc. B 71 (2009) 319). This
//! gives evidence, covariance and quantiles.

use crate::fit::{Fit, FitStep, Normal, Problem};
use crate::forward::Solved;
use crate::parameters::{Coordinate, Parameters};
use nalgebra::{DMatrix, DVector};
use statrs::function::erf::erfc;

/// Maximum number of steps on each side, halved ones included. It is reached if E₁ is open and only
/// the prior limits it.
const MAX_NODES: usize = 8;

/// Fall of ln p in one step above which the step was too long and is halved. For a Gaussian the
/// second step falls by 2.2.
const CLIFF: f64 = 4.0;

/// Fall of ln p for which the length of a step is chosen.
const STEP_FALL: f64 = 2.2;

/// Fall of ln p at which a side ends: that of 2.4 standard errors. The slope is extrapolated from
/// there.
const SIDE_FALL: f64 = 2.9;

/// Maximum step along ln E₁: mesh and tangent can follow the ridge this far.
const LARGEST_RIDGE_STEP: f64 = 1.0;

/// Step along ln E₁, in units of its local standard error.
const RIDGE_STEP: f64 = 1.2;

/// Maximum number of steps to the ridge at one E₁.
const MAX_STEPS: usize = 4;

/// Distance from the ridge, in standard errors, above which one step to it is not enough. A step of
/// this length leaves an error of ln p of 0.2.
const LONG: f64 = 3.0;

/// Fall of ln p after the last node up to which its slope is extrapolated.
const TAIL: f64 = 4.0;

/// Maximum rise of ln p between nodes: parabolas through uneven nodes overshoot.
const RISE: f64 = 0.3;

/// Maximum number of quadrature points over u.
const POINTS_LIMIT: usize = 200;

/// The ridge at one E₁.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// Logarithm of p(u), up to a constant.
    pub density: f64,
    /// Values of all coordinates.
    pub at: DVector<f64>,
    /// Covariance of the coordinates at this E₁. Its own row is zero.
    pub covariance: DMatrix<f64>,
}

/// The posterior along ln E₁.
#[derive(Debug, Clone)]
pub(crate) struct Ridge {
    /// Nodes in ascending order of E₁.
    pub nodes: Vec<Node>,
    /// Index of ln E₁ among the coordinates.
    pub index: usize,
    /// Logarithm of the integral of p by the curvature at the optimum.
    pub laplace: f64,
}

/// A point from which the ridge is followed.
struct Place {
    parameters: Parameters,
    /// Change of all coordinates per unit of ln E₁, along the ridge.
    tangent: DVector<f64>,
    /// Standard error of ln E₁.
    error: f64,
    /// Distance of the parameters from the ridge, in standard errors.
    away: f64,
    solved: Solved,
}

impl Problem {
    /// The posterior along ln E₁ through an optimum with an inclusion. `None` if it has no
    /// curvature there.
    pub(crate) fn ridge(&self, fit: &Fit, mut go_on: impl FnMut() -> bool) -> Option<Ridge> {
        let index = self.index(Coordinate::LumpModulus)?;
        let (node, start) = self.node(&fit.parameters, fit.normal.clone(), index)?;
        let top = node.density;
        let mut first_bend = DVector::zeros(start.tangent.len());
        let mut nodes = vec![node];
        for sign in [-1.0, 1.0] {
            let mut place = Place {
                solved: fit.normal.solved.clone(),
                tangent: start.tangent.clone(),
                parameters: start.parameters.clone(),
                ..start
            };
            let (mut part, mut before, mut bend) = (1.0, top, first_bend.clone());
            // Slope of −ln p away from the optimum.
            let mut slope = 0.0;
            for _ in 0..MAX_NODES {
                let root = f64::hypot(slope, (2.0 * STEP_FALL).sqrt() / place.error);
                let long = (2.0 * STEP_FALL / (slope + root)).min(RIDGE_STEP * place.error);
                let step = sign * part * long.min(LARGEST_RIDGE_STEP);
                let by = step * (&place.tangent + 0.5 * step * &bend);
                let at = self.stepped(&place.parameters, &by);
                let near = &place.solved;
                let Some((node, next)) = self.settled_node(&at, near, index, &mut go_on) else {
                    break;
                };
                let density = node.density;
                if density < before - CLIFF {
                    // The ridge bends or ends on the way, since an inclusion as soft as the tissue
                    // does not exist.
                    part *= 0.5;
                    continue;
                }
                slope = (2.0 * (before - density) / step.abs() - slope).max(0.0);
                before = density;
                bend = (&next.tangent - &place.tangent) / step;
                if nodes.len() == 1 {
                    first_bend.clone_from(&bend);
                }
                part = (2.0 * part).min(1.0);
                if sign < 0.0 {
                    nodes.insert(0, node);
                } else {
                    nodes.push(node);
                }
                place = next;
                if density < top - SIDE_FALL {
                    break;
                }
            }
        }
        let volume = 0.5 * core::f64::consts::TAU.ln() + start.error.ln();
        Some(Ridge {
            nodes,
            index,
            laplace: top + volume,
        })
    }

    /// The ridge at the E₁ of nearby parameters, solved again if the first step to it was long.
    fn settled_node(
        &self,
        at: &Parameters,
        near: &Solved,
        index: usize,
        go_on: &mut impl FnMut() -> bool,
    ) -> Option<(Node, Place)> {
        let mut solve =
            |at: &Parameters, near: &Solved| go_on().then(|| self.normal(at, Some(near))).flatten();
        let mut found = self.node(at, solve(at, near)?, index)?;
        for _ in 1..MAX_STEPS {
            let place = &found.1;
            if place.away < LONG {
                break;
            }
            let normal = solve(&place.parameters, &place.solved)?;
            found = self.node(&place.parameters, normal, index)?;
        }
        Some(found)
    }

    /// The ridge at the E₁ of nearby parameters.
    fn node(&self, at: &Parameters, normal: Normal, index: usize) -> Option<(Node, Place)> {
        let FitStep { by, size } = self.step(at, &normal, 0.0, Some(index))?;
        let fall = 2.0 * by.dot(&normal.gradient) - by.dot(&(&normal.matrix * &by));
        let objective = normal.misfit + normal.penalty - fall;
        let mut matrix = normal.matrix.clone();
        let mut along = -normal.matrix.column(index);
        matrix.row_mut(index).fill(0.0);
        matrix.column_mut(index).fill(0.0);
        matrix[(index, index)] = 1.0;
        along[index] = 1.0;
        let factor = matrix.cholesky()?;
        let logarithm: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        let tangent = factor.solve(&along);
        let mut covariance = factor.inverse();
        covariance[(index, index)] = 0.0;
        let curvature = tangent.dot(&(&normal.matrix * &tangent));
        let parameters = self.stepped(at, &by);
        let values = self
            .priors
            .iter()
            .map(|prior| parameters.get(prior.coordinate));
        let node = Node {
            density: -0.5 * objective - logarithm,
            at: DVector::from_iterator(self.priors.len(), values),
            covariance,
        };
        let place = Place {
            parameters,
            tangent,
            error: curvature.sqrt().recip(),
            away: size,
            solved: normal.solved,
        };
        Some((node, place))
    }
}

/// Marginal posteriors of all coordinates: a mixture of Gaussians.
#[derive(Debug, Clone)]
pub(crate) struct Marginal {
    weights: Vec<f64>,
    points: Vec<Node>,
    /// Log-evidence relative to that by the curvature at the optimum.
    pub gain: f64,
    /// Probability that the inclusion is a ball, with a prior probability of one half.
    pub ball: f64,
}

impl Node {
    /// This point of the ridge if the inclusion is a ball: the logarithm of its height over its
    /// width, the coordinate with the index `shape`, is then zero. `density` is that at zero.
    fn of_ball(&self, shape: usize) -> Self {
        let gains = self.covariance.column(shape) / self.covariance[(shape, shape)];
        let away = self.at[shape];
        let variance = self.covariance[(shape, shape)];
        let mut covariance = &self.covariance - variance * &gains * gains.transpose();
        // The shape of a ball is exact, but a quantile divides by its error.
        covariance[(shape, shape)] = f64::MIN_POSITIVE;
        Self {
            density: -0.5 * (away * away / variance + variance.ln()),
            at: &self.at - away * gains,
            covariance,
        }
    }
}

/// A function of the nodes at `x` in the interval after node `k`: the mean of the parabolas through
/// the surrounding nodes.
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

/// The ridge between its nodes and outside the outermost ones.
struct Curve<'a> {
    nodes: &'a [Node],
    /// ln E₁ of the nodes, ascending.
    xs: Vec<f64>,
}

impl Curve<'_> {
    /// Slope of ln p over ln E₁ outside the first or last node: that of the parabola through the
    /// three nodes there, at least that of the last interval and not negative.
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

    /// Distance up to which that slope is extrapolated.
    fn tail(&self, is_first: bool) -> f64 {
        let last = self.xs.len() - 1;
        let [outer, inner] = if is_first { [0, 1] } else { [last, last - 1] };
        let step = (self.xs[outer] - self.xs[inner]).abs();
        // A side that ended before p fell is extrapolated by its last step.
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
    /// Computes the posteriors of a ridge. `None` if neither side could be followed.
    ///
    /// `shape` holds the index of the logarithm of an inclusion's height over its width and its
    /// prior standard error. A ball and a spheroid have equal prior probabilities, and the
    /// posterior is the mixture of both. With κ that logarithm, the odds of a ball are p(κ = 0 | y)
    /// / p(κ = 0) (J. M. Dickey, Ann. Math. Stat. 42 (1971) 204).
    pub(crate) fn new(ridge: &Ridge, shape: Option<(usize, f64)>) -> Option<Self> {
        let (nodes, index) = (&ridge.nodes, ridge.index);
        let xs: Vec<f64> = nodes.iter().map(|node| node.at[index]).collect();
        if xs.len() < 3 || xs.windows(2).any(|pair| pair[1] <= pair[0]) {
            return None;
        }
        let last = xs.len() - 1;
        let curve = Curve { nodes, xs };
        let from = curve.xs[0] - curve.tail(true);
        let to = curve.xs[last] + curve.tail(false);
        let step = (to - from) / POINTS_LIMIT as f64;
        let mut points: Vec<Node> = (0..POINTS_LIMIT)
            .map(|point| curve.at(from + (point as f64 + 0.5) * step))
            .collect();
        for point in &mut points {
            // Variance of the quadrature interval itself.
            point.covariance[(index, index)] += step * step / 12.0;
        }
        let largest = (points.iter())
            .map(|point| point.density)
            .fold(f64::NEG_INFINITY, f64::max);
        let weight = |point: &Node| (point.density - largest).exp();
        let sum: f64 = points.iter().map(weight).sum();
        let marginal = Self {
            weights: points.iter().map(|point| weight(point) / sum).collect(),
            points,
            gain: largest + (sum * step).ln() - ridge.laplace,
            ball: if shape.is_some() { 0.0 } else { 1.0 },
        };
        Some(match shape {
            Some((index, known)) => marginal.with_balls(index, known),
            None => marginal,
        })
    }

    /// This posterior of a spheroid, mixed with that of a ball.
    fn with_balls(mut self, shape: usize, known: f64) -> Self {
        let balls: Vec<Node> = (self.points.iter())
            .map(|point| point.of_ball(shape))
            .collect();
        let odds: Vec<f64> = (balls.iter().zip(&self.weights))
            .map(|(ball, weight)| weight * ball.density.exp() * known)
            .collect();
        let sum: f64 = odds.iter().sum();
        self.ball = sum / (1.0 + sum);
        self.gain += (0.5 * (1.0 + sum)).ln();
        let spheroids = self.weights.iter().map(|weight| weight / (1.0 + sum));
        let balls_weights = odds.iter().map(|odds| odds / (1.0 + sum));
        self.weights = spheroids.chain(balls_weights).collect();
        self.points.extend(balls);
        self
    }

    /// The median of a coordinate. The optimum of a skewed posterior lies at one end of its
    /// interval.
    pub(crate) fn median(&self, coordinate: usize) -> f64 {
        self.quantile(coordinate, 0.5)
    }

    /// The 95 % interval of a coordinate, with equal tails. It contains 96, 98 and 97 % of the true
    /// D, d and E₁ of 161 inclusions by CalculiX; the likelihood-ratio interval contains 96, 98 and
    /// 98 % (`inclusion_study`).
    pub(crate) fn interval(&self, coordinate: usize) -> [f64; 2] {
        [0.025, 0.975].map(|probability| self.quantile(coordinate, probability))
    }

    /// The quantile of a coordinate for a probability.
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
    pub(crate) fn covariance(&self) -> DMatrix<f64> {
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
