//! Samples of large sets, and fields that are extended from one to the next.

use super::anneal::Annealer;
use super::axes::Axes;
use super::blocks::Blocks;
use super::prior::Prior;
use super::schedule::State;

/// Points of a level for one of the next coarser level.
pub(super) const STEP: usize = 8;
/// Variance of a coarse field's values when it is extended: what its factor left out.
const EXTENDED: f64 = 1e-6;

/// Samples of both sets, and where the coarser level put its points.
#[derive(Clone, Debug, Default)]
pub(super) struct Levels<const D: usize> {
    pub(super) model_order: Blocks<D>,
    pub(super) target_order: Blocks<D>,
    pub(super) model: Vec<[f64; D]>,
    pub(super) target: Vec<[f64; D]>,
    /// Standard deviations of the targets; empty where the caller did not tell them.
    pub(super) deviations: Vec<f64>,
    /// Where the start puts all model points.
    pub(super) base: Vec<[f64; D]>,
    pub(super) coarse: State<D>,
    weights: Vec<f64>,
    wanted: Axes<D>,
    /// The prior at the points whose patterns are compared.
    pub(super) sampled: Prior,
}

impl<const D: usize> Levels<D> {
    /// The sample of every `stride`-th point; all points in their own order for 1. Also sets the sample's base in `state`.
    pub(super) fn sample(
        &mut self,
        model: &[[f64; D]],
        (target, deviations): (&[[f64; D]], &[f64]),
        stride: usize,
        state: &mut State<D>,
    ) {
        state.base.clear();
        self.model.clear();
        self.target.clear();
        self.deviations.clear();
        if stride == 1 {
            state.base.extend_from_slice(&self.base);
            self.model.extend_from_slice(model);
            self.target.extend_from_slice(target);
            self.deviations.extend_from_slice(deviations);
            return;
        }
        let rows = self.model_order.order.iter().step_by(stride);
        state.base.extend(rows.clone().map(|&i| self.base[i]));
        self.model.extend(rows.map(|&i| model[i]));
        let rows = self.target_order.order.iter().step_by(stride);
        self.target.extend(rows.clone().map(|&j| target[j]));
        if !deviations.is_empty() {
            self.deviations.extend(rows.map(|&j| deviations[j]));
        }
    }

    /// The field of `coarse`, every `step`-th point of the level of this stride, at all points of that level, in `state.warped`.
    pub(super) fn extend(
        &mut self,
        annealer: &mut Annealer<D>,
        stride: usize,
        step: usize,
        state: &mut State<D>,
    ) {
        let padded = annealer.prior.stride;
        let order = &self.model_order.order;
        let row_of = |coarse: usize| match stride {
            1 => order[coarse * step],
            _ => coarse * step,
        };
        self.weights.clear();
        self.weights.resize(padded, 0.0);
        self.wanted
            .fill(padded, state.base.iter().map(|_| [0.0; D]));
        for (k, (warped, base)) in self.coarse.warped.iter().zip(&self.coarse.base).enumerate() {
            let row = row_of(k);
            self.weights[row] = 1.0;
            for d in 0..D {
                self.wanted.0[d][row] = warped[d] - base[d];
            }
        }
        annealer
            .regression
            .fit(&annealer.prior, &self.weights, &self.wanted, EXTENDED);
        let field = &annealer.regression.displacement;
        state.warped.clear();
        let rows = state.base.iter().enumerate();
        state
            .warped
            .extend(rows.map(|(i, b)| std::array::from_fn(|d| b[d] + field.0[d][i])));
    }
}
