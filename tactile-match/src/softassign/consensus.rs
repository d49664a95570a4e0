//! A warp from doubtful pairs: a robust fit keeps those that agree.

use super::anneal::Annealer;
use super::axes::Axes;
use super::prior::{Prior, PriorScales};
use super::schedule::State;
use std::f64::consts::TAU;

/// Rounds of the fit; the first half with a nearly affine warp.
const ROUNDS: usize = 12;
const STIFF: f64 = 0.05;

/// Memory of the fit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Consensus<const D: usize> {
    prior: Prior,
    weights: Vec<f64>,
    trust: Vec<f64>,
    wanted: Axes<D>,
}

impl<const D: usize> Consensus<D> {
    /// Robust regression of the likeliest pairs, target and probability for every model point, into `state.warped`: those
    /// far from the common warp lose their say, round by round.
    pub(crate) fn fit(
        &mut self,
        annealer: &mut Annealer<D>,
        scales: PriorScales,
        (model, target): (&[[f64; D]], &[[f64; D]]),
        pairs: &[(usize, f64)],
        state: &mut State<D>,
    ) {
        self.prior.build(
            model,
            PriorScales {
                bending: STIFF,
                ..scales
            },
        );
        self.take(target, pairs, &state.base);
        let mut variance = 1.0;
        for round in 0..ROUNDS {
            let prior = if round < ROUNDS / 2 {
                &self.prior
            } else {
                &annealer.prior
            };
            annealer
                .regression
                .fit(prior, &self.weights, &self.wanted, f64::max(variance, 1e-4));
            variance = self.reweigh(&annealer.regression.displacement, variance, annealer.volume);
        }
        for (i, warped) in state.warped.iter_mut().enumerate() {
            *warped = std::array::from_fn(|k| {
                state.base[i][k] + annealer.regression.displacement.0[k][i]
            });
        }
    }

    /// The displacements that the pairs ask for, and how far each is trusted.
    fn take(&mut self, target: &[[f64; D]], pairs: &[(usize, f64)], base: &[[f64; D]]) {
        let stride = self.prior.stride;
        let rows = pairs.iter().zip(base);
        self.wanted.fill(
            stride,
            rows.map(|((j, _), b)| std::array::from_fn(|k| target[*j][k] - b[k])),
        );
        self.trust.clear();
        self.trust
            .extend(pairs.iter().map(|(_, trust)| trust.clamp(0.05, 0.95)));
        self.weights.clone_from(&self.trust);
        self.weights.resize(stride, 0.0);
    }

    /// New weights from the residuals; the residual variance of those that agree, at most halved a round.
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
