//! A warp from doubtful pairs: a robust fit keeps the pairs that agree.

use super::difference;
use super::problem::Problem;
use super::run::{Annealer, Run, SCALES};
use crate::gaussian_process::{Axes, Prior, PriorScales};
use std::f64::consts::TAU;

/// Rounds of the fit. The first half uses a nearly affine warp.
const FIT_ROUNDS: usize = 12;

/// Working memory of the fit.
#[derive(Clone, Debug, Default)]
pub(super) struct Consensus<const D: usize> {
    prior: Prior,
    weights: Vec<f64>,
    trust: Vec<f64>,
    wanted: Axes<D>,
}

impl<const D: usize> Consensus<D> {
    /// Robust regression of the likeliest pairs, a target and probability for each model point. The
    /// result is in `run.warped`. Pairs far from the common warp lose weight from round to round.
    pub(super) fn fit(
        &mut self,
        annealer: &mut Annealer<D>,
        problem: &Problem<D>,
        model: &[[f64; D]],
        pairs: &[(usize, f64)],
        run: &mut Run<D>,
    ) {
        self.prior.build(
            model,
            PriorScales {
                bending: 0.05,
                ..SCALES
            },
        );
        self.take(&problem.target, pairs, &run.base);
        let mut variance = 1.0;
        for round in 0..FIT_ROUNDS {
            let prior = if round < FIT_ROUNDS / 2 {
                &self.prior
            } else {
                &annealer.prior
            };
            annealer
                .regression
                .fit(prior, &self.weights, &self.wanted, f64::max(variance, 1e-4));
            variance = self.reweigh(&annealer.regression.displacement, variance, problem.volume);
        }
        for (i, warped) in run.warped.iter_mut().enumerate() {
            *warped =
                std::array::from_fn(|k| run.base[i][k] + annealer.regression.displacement.0[k][i]);
        }
    }

    /// Stores the displacements of the pairs and their weights.
    fn take(&mut self, target: &[[f64; D]], pairs: &[(usize, f64)], base: &[[f64; D]]) {
        let stride = self.prior.stride;
        let rows = pairs.iter().zip(base);
        self.wanted
            .fill(stride, rows.map(|((j, _), b)| difference(&target[*j], b)));
        self.trust.clear();
        self.trust
            .extend(pairs.iter().map(|(_, trust)| trust.clamp(0.05, 0.95)));
        self.weights.clone_from(&self.trust);
        self.weights.resize(stride, 0.0);
    }

    /// Computes new weights from the residuals. Returns the residual variance of the pairs that
    /// agree, at least half of the last one.
    fn reweigh(&mut self, displacement: &Axes<D>, last: f64, volume: f64) -> f64 {
        let square = |i: usize| {
            (0..D)
                .map(|k| (displacement.0[k][i] - self.wanted.0[k][i]).powi(2))
                .sum::<f64>()
        };
        let weight: f64 = self.weights.iter().sum();
        let sum: f64 = (0..self.trust.len())
            .map(|i| self.weights[i] * square(i))
            .sum();
        let variance = (sum / (D as f64 * weight.max(1e-9)))
            .max(0.5 * last)
            .clamp(1e-6, last);
        let outlier = (TAU * variance).powf(0.5 * D as f64) / volume;
        for (i, &trust) in self.trust.iter().enumerate() {
            let agree = (-0.5 * square(i) / variance).exp() * trust;
            self.weights[i] = agree / (agree + (1.0 - trust) * outlier).max(f64::MIN_POSITIVE);
        }
        variance
    }
}
