//! Follows the posterior along ln E₁.

use super::fit::{Fit, Normal, Problem, Step};
use super::forward::Solved;
use super::parameters::{Coordinate, Parameters};
use nalgebra::{DMatrix, DVector};

/// Step along ln E₁ in its local standard error, and the largest: mesh and tangent follow the ridge that far.
const STEP: f64 = 1.2;
const LARGEST_STEP: f64 = 1.0;
/// Fall of ln p at which a side ends: that of 2.4 standard errors. Beyond, its slope goes on.
const FALL: f64 = 2.9;
/// Fall of ln p in one step beyond which it was too long, and is halved: a Gaussian falls by 2.2 in the second.
const CLIFF: f64 = 3.0;
/// Distance from the ridge in standard errors above which one step to it does not do, and steps there.
const LONG: f64 = 1.0;
const MAX_STEPS: usize = 4;
/// Steps along a side, halved ones too; reached where E₁ is open and the prior alone ends it.
const MAX_NODES: usize = 8;

/// The ridge at one E₁.
#[derive(Debug, Clone)]
pub(super) struct Node {
    /// Logarithm of p(u), up to a constant.
    pub(super) density: f64,
    /// Values of all coordinates.
    pub(super) at: DVector<f64>,
    /// Their covariance at this E₁, whose own row is zero.
    pub(super) covariance: DMatrix<f64>,
}

/// The posterior along ln E₁.
#[derive(Debug, Clone)]
pub(super) struct Ridge {
    /// By ascending E₁.
    pub(super) nodes: Vec<Node>,
    /// Of ln E₁ among the coordinates.
    pub(super) index: usize,
    /// Logarithm of p's integral by the curvature at the optimum.
    pub(super) laplace: f64,
}

/// A point from which the ridge is followed.
struct Place {
    parameters: Parameters,
    /// Change of all coordinates by one of ln E₁, along the ridge.
    tangent: DVector<f64>,
    /// Standard error of ln E₁.
    error: f64,
    /// How far the parameters were from the ridge, in standard errors.
    away: f64,
    solved: Solved,
}

impl Problem {
    /// The posterior along ln E₁ through an optimum with an inclusion; `None` where it has no curvature there.
    pub(super) fn ridge(&self, fit: &Fit, mut go_on: impl FnMut() -> bool) -> Option<Ridge> {
        let index = (self.coordinates().iter()).position(|c| *c == Coordinate::LumpModulus)?;
        let normal = self.normal(&fit.parameters, Some(&fit.solved))?;
        let (node, start) = self.node(&fit.parameters, normal, index)?;
        let top = node.density;
        let mut nodes = vec![node];
        for sign in [-1.0, 1.0] {
            let mut place = Place {
                solved: fit.solved.clone(),
                tangent: start.tangent.clone(),
                ..start
            };
            let mut part = 1.0;
            let mut before = top;
            for _ in 0..MAX_NODES {
                let step = part * (STEP * place.error).min(LARGEST_STEP);
                let at = self.stepped(&place.parameters, &(sign * step * &place.tangent));
                let near = &place.solved;
                let Some((node, next)) = self.settled_node(&at, near, index, &mut go_on) else {
                    break;
                };
                let density = node.density;
                if density < before - CLIFF {
                    // The ridge bends or ends on the way: an inclusion as soft as the tissue is none.
                    part *= 0.5;
                    continue;
                }
                before = density;
                part = (2.0 * part).min(1.0);
                if sign < 0.0 {
                    nodes.insert(0, node);
                } else {
                    nodes.push(node);
                }
                place = next;
                if density < top - FALL {
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

    /// The ridge at the E₁ of some parameters nearby, solved anew where the first step to it was long.
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

    /// The ridge at the E₁ of some parameters nearby.
    fn node(&self, at: &Parameters, normal: Normal, index: usize) -> Option<(Node, Place)> {
        let Step { by, size } = self.step(at, &normal, 0.0, Some(index))?;
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
