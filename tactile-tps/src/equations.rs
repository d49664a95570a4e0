//! A spline's equations, the buffers of a solve, and its result.

use crate::{centres::Centres, iterative::Vectors, null_space::MAX, system::System};

/// A spline's equations: everything but the targets.
pub(crate) struct Equations<'a, K, const D: usize> {
    pub(crate) kernel: &'a K,
    pub(crate) centres: &'a Centres<D>,
    pub(crate) system: &'a System<D>,
    /// λ in the frame's units.
    pub(crate) lambda: f64,
}

/// Memory of a solve.
#[derive(Clone, Debug, Default)]
pub(crate) struct Buffers {
    /// Targets at the centres, output by output; the caller fills it.
    pub(crate) targets: Vec<f64>,
    /// Weights at the centres, output by output: the answer.
    pub(crate) weights: Vec<f64>,
    pub(crate) residuals: Vec<f64>,
    /// λW⁻¹ − λ̄I at the centres, for a refit with other weights.
    pub(crate) excess: Vec<f64>,
    pub(crate) work: Vec<f64>,
    pub(crate) spare: Vec<f64>,
    /// Memory of an iterative solve.
    pub(crate) vectors: Vectors,
}

/// The result of a solve besides the weights.
pub(crate) struct Solution<const M: usize> {
    pub(crate) affine: [[f64; MAX]; M],
    /// Largest residual relative to the largest target, where it was measured.
    pub(crate) residual: Option<f64>,
    pub(crate) refinements: usize,
    /// Steps of conjugate gradients.
    pub(crate) iterations: usize,
    /// Condition number of the matrix, or a bound.
    pub(crate) condition: f64,
    pub(crate) precise: bool,
    /// Whether the iteration reached its tolerance.
    pub(crate) converged: bool,
}

impl<const M: usize> Solution<M> {
    /// The report of a direct solve.
    pub(crate) fn new(affine: [[f64; MAX]; M], condition: f64) -> Self {
        Self {
            affine,
            residual: None,
            refinements: 0,
            iterations: 0,
            condition,
            precise: false,
            converged: true,
        }
    }
}
