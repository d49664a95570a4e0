//! Samples of large sets, and the extension of fields from one sample to the next.

use super::blocks::Blocks;
use super::problem::{Problem, SAMPLE};
use super::run::{Annealer, Run};
use crate::frame::typical_spacing;
use crate::gaussian_process::{Axes, Prior};

/// Number of points of a level per point of the next coarser level.
pub(super) const STEP: usize = 8;

/// Samples of both sets, and the positions found by the coarser level.
#[derive(Clone, Debug, Default)]
pub(super) struct Levels<const D: usize> {
    pub model_order: Blocks<D>,
    pub target_order: Blocks<D>,
    pub model: Vec<[f64; D]>,
    pub target: Vec<[f64; D]>,
    /// Positions of all model points under the start.
    pub base: Vec<[f64; D]>,
    pub coarse: Run<D>,
    weights: Vec<f64>,
    wanted: Axes<D>,
    /// The prior at the points whose patterns are compared.
    pub sampled: Prior,
    /// Spacing of the targets of the current level.
    pub spacing: f64,
    distances: Vec<f64>,
}

impl<const D: usize> Levels<D> {
    /// Takes the sample of every `stride`-th point (all points in their own order for a stride of
    /// 1). Also sets the base positions of the sample in `run`.
    pub(super) fn sample(&mut self, problem: &Problem<D>, stride: usize, run: &mut Run<D>) {
        let (model, target) = (&problem.model, &problem.target);
        run.base.clear();
        self.model.clear();
        self.target.clear();
        if stride == 1 {
            run.base.extend_from_slice(&self.base);
            self.model.extend_from_slice(model);
            self.target.extend_from_slice(target);
        } else {
            let rows = self.model_order.order.iter().step_by(stride);
            run.base.extend(rows.clone().map(|&i| self.base[i]));
            self.model.extend(rows.map(|&i| model[i]));
            let rows = self.target_order.order.iter().step_by(stride);
            self.target.extend(rows.map(|&j| target[j]));
        }
        self.spacing = typical_spacing(&self.target, SAMPLE, &mut self.distances);
    }

    /// Extends the field of `coarse`, every `step`-th point of the level of this stride, to all
    /// points of that level. The result is in `run.warped`.
    pub(super) fn extend(
        &mut self,
        annealer: &mut Annealer<D>,
        stride: usize,
        step: usize,
        run: &mut Run<D>,
    ) {
        let padded = annealer.prior.stride;
        let order = &self.model_order.order;
        let row_of = |coarse: usize| match stride {
            1 => order[coarse * step],
            _ => coarse * step,
        };
        self.weights.clear();
        self.weights.resize(padded, 0.0);
        self.wanted.fill(padded, run.base.iter().map(|_| [0.0; D]));
        for (k, (warped, base)) in self.coarse.warped.iter().zip(&self.coarse.base).enumerate() {
            let row = row_of(k);
            self.weights[row] = 1.0;
            for d in 0..D {
                self.wanted.0[d][row] = warped[d] - base[d];
            }
        }
        // Variance of the coarse field's values during the extension: the truncation error of its
        // factor.
        annealer
            .regression
            .fit(&annealer.prior, &self.weights, &self.wanted, 1e-6);
        let field = &annealer.regression.displacement;
        run.warped.clear();
        let rows = run.base.iter().enumerate();
        run.warped
            .extend(rows.map(|(i, b)| std::array::from_fn(|d| b[d] + field.0[d][i])));
    }
}
