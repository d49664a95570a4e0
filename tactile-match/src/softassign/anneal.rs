//! The alternation: soft assignment at a falling temperature, then the warp that it asks for.

use super::axes::Axes;
use super::extrapolate::Extrapolation;
use super::known::Known;
use super::prior::Prior;
use super::regression::Regression;
use super::rigid::RigidFit;
use super::schedule::{Schedule, Slack, State};
use super::soft_assign::{Gaussian, SoftAssignment};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// A point whose own match decides its position is not left out altogether.
const MAX_LEVERAGE: f64 = 0.95;
/// Soft partners spread less than this, relative to the temperature, are as good as decided: no need to go slowly.
const DECIDED: f64 = 0.01;
/// Fall of σ an iteration once the matches are decided.
const DECIDED_RATE: f64 = 0.3;
/// Nearly decided: where such residuals stay above the temperature, noise holds them. Of 324 noisy scenes none then ended in a worse answer; at 0.1
/// three did (`--example peer_cases`).
const NEARLY_DECIDED: f64 = 0.05;
/// A cold run that matches this share of the points that can have a partner, but for what the slack takes, has found them all, single points that
/// noise has moved far left out. At 0.97 without regard to the slack, two of 324 noisy scenes kept a part one point aside (`--example peer_cases`).
const FULL: f64 = 0.99;
/// Share of residuals in the [tail](Annealer::tail) that noise explains: twice what it has.
const NOISE_TAIL: f64 = 2e-3;
/// Residuals and temperature, as variances, differ by less than this share: the noise is known well enough for the averages that follow.
const NOISE_KNOWN: f64 = 1e-2;
/// Affinities so much fainter than the slack's are left out.
const FAINTER: f64 = 1e-3;
/// Least share of outliers an estimate may come to.
const LEAST_SHARE: f64 = 0.02;
/// Temperatures (variances) below this are cold: a tenth of the model's radius.
const COLD: f64 = 0.01;
/// Fixed-point rounds for the share of outliers.
const SHARE_ROUNDS: usize = 8;

/// Displacements that the model points should have, and how much each counts; both padded with zeros.
#[derive(Clone, Copy)]
pub(crate) struct Request<'a, const D: usize> {
    pub(crate) weights: &'a [f64],
    pub(crate) displacements: &'a Axes<D>,
}

/// Shared machinery of the runs: targets, prior, scratch.
#[derive(Clone, Debug, Default)]
pub(crate) struct Annealer<const D: usize> {
    pub(crate) soft: SoftAssignment<D>,
    pub(crate) prior: Prior,
    pub(crate) regression: Regression<D>,
    /// Takes the regression's place where the warp may not bend.
    pub(crate) rigid: RigidFit<D>,
    /// What the caller knows of some model points.
    pub(super) known: Vec<Known<D>>,
    /// Volume of the targets' bounding box.
    pub(crate) volume: f64,
    pub(super) weights: Vec<f64>,
    pub(super) residuals: Axes<D>,
    predicted: Vec<[f64; D]>,
    pub(super) sums: Vec<f64>,
    /// Spread of the soft partners within a row, relative to the temperature: 1 undecided, 0 decided.
    ambiguity: f64,
}

impl<const D: usize> Annealer<D> {
    /// What the soft matches of the last fit ask of the warp.
    pub(crate) fn request(&self) -> Request<'_, D> {
        Request {
            weights: &self.weights,
            displacements: &self.residuals,
        }
    }

    /// Soft matches of `warped` at this temperature, with their moments.
    ///
    /// The slack weighs `(2πσ²)^{D/2}` times the density of outliers, beside Gaussian affinities. All weights are raised to the power
    /// `sharpness`.
    pub(crate) fn assign(
        &mut self,
        warped: &[[f64; D]],
        variance: f64,
        slack: Slack,
        sweeps: usize,
        sharpness: f64,
    ) {
        let weight = self.slack_weight(warped.len(), variance, slack.share);
        let [rows, columns] = [slack.model, slack.target]
            .map(|side| (side * weight).powf(sharpness).max(1e-30) as f32);
        let gaussian = Gaussian {
            variance,
            sharpness,
        };
        let least = FAINTER * f64::from(rows.min(columns));
        self.soft.affinities(warped, gaussian, least);
        self.soft.normalise(sweeps, rows, columns);
        self.soft.sum_moments(warped);
    }

    /// `(2πσ²)^{D/2}` times the density of outliers.
    fn slack_weight(&self, points: usize, variance: f64, share: f64) -> f64 {
        let density = share / (1.0 - share) * points as f64 / self.volume;
        (TAU * variance).powf(0.5 * D as f64) * density
    }

    /// Share of a point's weight that its slack takes where the residual is noise as warm as the temperature: a pair with the residual r
    /// keeps about `1 − w exp(r²/4σ²)` beside slack of weight w on both sides, and the mean of the exponential is `2^{D/2}`.
    fn lost_to_slack(&self, points: usize, variance: f64, slack: Slack) -> f64 {
        let weight = self.slack_weight(points, 2.0 * variance, slack.share);
        slack.model.max(slack.target) * weight
    }

    /// Alternates until the temperature stands still; `observe` is told every iteration and may stop the run.
    pub(crate) fn run(
        &mut self,
        state: &mut State<D>,
        schedule: &Schedule,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let mut variance = schedule.sigma * schedule.sigma;
        let (mut standing, mut extrapolation) = (0, Extrapolation::default());
        let mut noise_found = false;
        state.settled = false;
        self.predicted.clone_from(&state.warped);
        for iteration in 0..schedule.limit {
            let residual = self.step(state, schedule, variance);
            state.iterations += 1;
            state.trace.push(self.free_energy(state, variance));
            observe(state.iterations, *state.trace.last().unwrap_or(&0.0))?;
            let floor = self.floor(schedule).powi(2);
            if variance < COLD && state.matched < schedule.collapse {
                break; // the temperature fell below the noise: points lose their partners, and none comes back
            }
            let decided = self.ambiguity < DECIDED;
            let fall = |rate: f64| variance * rate * rate;
            let lowest = fall(if decided { DECIDED_RATE } else { schedule.rate }).max(floor);
            let aim = if schedule.extrapolates && !decided {
                extrapolation.next(variance, residual)
            } else {
                residual
            };
            let lost = self.lost_to_slack(state.warped.len(), variance, schedule.slack);
            noise_found |= schedule.least < 1.0
                && residual > variance
                && state.matched >= schedule.partners * (FULL - lost)
                && self.ambiguity < NEARLY_DECIDED
                && self.tail(0.0) <= NOISE_TAIL;
            // Below the noise points would lose their partners: the temperature stays with the residuals.
            let next = if noise_found {
                residual.max(lowest)
            } else {
                aim.min(fall(schedule.least)).max(lowest).min(variance)
            };
            let still = match () {
                () if noise_found => NOISE_KNOWN,
                () if decided => 1e-3,
                () => schedule.still,
            };
            standing = if next < variance { 0 } else { standing + 1 };
            let patience = if state.iterations > standing {
                schedule.patience
            } else {
                schedule.stuck // never colder than at the start
            };
            state.settled = variance <= floor
                || standing > patience
                || (iteration > 5 && (residual - variance).abs() < still * variance);
            if state.settled {
                break;
            }
            variance = next;
        }
        (state.sigma, state.ambiguity) = (variance.sqrt(), self.ambiguity);
        ControlFlow::Continue(())
    }

    /// One step from `state` in `scratch`: sets soft matches and regression to those of `state`; how undecided they are,
    /// see [`ambiguity`](Self::ambiguity).
    pub(crate) fn restore(
        &mut self,
        state: &State<D>,
        scratch: &mut State<D>,
        schedule: &Schedule,
    ) -> f64 {
        scratch.copy_from(state);
        self.predicted.clone_from(&state.warped);
        self.step(scratch, schedule, state.sigma * state.sigma);
        self.ambiguity
    }

    /// Expectation and maximisation in turn with the noise level free: `rounds` of them, from where `state` stands.
    pub(crate) fn settle(&mut self, state: &mut State<D>, schedule: &Schedule, rounds: usize) {
        self.predicted.clone_from(&state.warped);
        for _ in 0..rounds {
            let residual = self.step(state, schedule, state.sigma * state.sigma);
            let moments = &self.soft.moments;
            let weights = &moments.by_squared_precision().weight;
            let spread = weights
                .iter()
                .zip(&self.regression.variance)
                .map(|(w, v)| w * v)
                .sum::<f64>();
            let total: f64 = moments.by_precision().weight.iter().sum();
            let open = spread / total.max(1e-9);
            state.sigma = (residual + open).sqrt().max(self.floor(schedule));
            self.predicted.clone_from(&state.warped);
        }
    }

    /// The lowest temperature: the schedule's, or the least error of the targets where that is known.
    fn floor(&self, schedule: &Schedule) -> f64 {
        schedule.floor.max(self.soft.errors.floor())
    }

    /// One soft assignment and one fit; the residual variance that is left.
    ///
    /// Distances are taken from where the *other* points' matches put a point: a wrong match does not confirm itself.
    fn step(&mut self, state: &mut State<D>, schedule: &Schedule, variance: f64) -> f64 {
        let predicted = std::mem::take(&mut self.predicted);
        self.assign(&predicted, variance, schedule.slack, schedule.sweeps, 1.0);
        self.predicted = predicted;
        self.fit(state, variance);
        let moments = &self.soft.moments;
        let (fitted, noise) = (moments.by_precision(), moments.by_squared_precision());
        let (mut total, mut squares, mut within) = (0.0, 0.0, 0.0);
        for i in 0..state.warped.len() {
            let w = fitted.weight[i];
            let shifts = noise.shift[i].iter().map(|s| s * s);
            within += noise.spread[i] - noise.weight[i] * shifts.sum::<f64>();
            let leverage = (w * self.regression.variance[i] / variance).min(MAX_LEVERAGE);
            let mut square = noise.spread[i];
            for k in 0..D {
                let (u, z) = (self.regression.displacement.0[k][i], self.residuals.0[k][i]);
                let moved = state.base[i][k] + u;
                let step = moved - self.predicted[i][k];
                square += noise.weight[i] * step * (step - 2.0 * noise.shift[i][k]);
                state.warped[i][k] = moved;
                self.predicted[i][k] = state.base[i][k] + (u - leverage * z) / (1.0 - leverage);
            }
            total += w;
            squares += square.max(0.0);
        }
        state.matched = moments.plain().weight.iter().sum();
        self.ambiguity = within / (D as f64 * total.max(1e-9) * variance);
        if total > 0.0 {
            squares / (D as f64 * total)
        } else {
            variance
        }
    }

    /// Fits the warp to the moments of the soft assignment about the predicted positions.
    fn fit(&mut self, state: &State<D>, variance: f64) {
        let stride = self.prior.stride;
        let rows = self
            .predicted
            .iter()
            .zip(&state.base)
            .zip(&self.soft.moments.by_precision().shift);
        let target = |((p, b), s): ((&[f64; D], &[f64; D]), &[f64; D])| {
            std::array::from_fn(|k| p[k] + s[k] - b[k])
        };
        self.residuals.fill(stride, rows.map(target));
        let soft = self.soft.moments.by_precision();
        self.weights.clone_from(&soft.weight);
        self.weights.resize(stride, 0.0);
        self.add_landmarks(&state.base, variance);
        if self.rigid.is_active() {
            let (weights, residuals) = (&self.weights, &self.residuals);
            self.rigid.fit(
                weights,
                &state.base,
                residuals,
                variance,
                &mut self.regression,
            );
            return;
        }
        self.regression
            .fit(&self.prior, &self.weights, &self.residuals, variance);
        self.regression.variances(&self.prior);
    }

    /// The annealed energy: distances under M, over the temperature, plus the warp's penalty, a model point.
    fn free_energy(&self, state: &State<D>, variance: f64) -> f64 {
        let spread = &self.soft.moments.by_precision().spread;
        let data = spread.iter().sum::<f64>() / (2.0 * variance);
        (data + 0.5 * self.regression.penalty()) / state.warped.len() as f64
    }

    /// What runs are compared by: `−ln p(targets | warp) − ln p(warp)`, with the warp's posterior volume (Laplace).
    ///
    /// The targets are a mixture of Gaussians about the warped points and of uniform outliers, whose share is
    /// estimated; residuals under `resolution` count as that, so that an exact fit does not win by an infinite margin.
    pub(crate) fn evaluate(&mut self, state: &mut State<D>, share: f64, resolution: f64) {
        let variance = state.sigma.max(resolution).powi(2);
        let (n, m) = (state.warped.len(), self.soft.targets());
        let gaussian = n as f64 * (TAU * variance).powf(0.5 * D as f64);
        let kernel = Gaussian {
            variance,
            sharpness: 1.0,
        };
        let least = FAINTER * LEAST_SHARE * gaussian / self.volume;
        self.soft.affinities(&state.warped, kernel, least);
        self.soft.column_totals(&mut self.sums);
        let sums = &self.sums[..m];
        let density = 1.0 / gaussian;
        let mut share = share;
        for _ in 0..SHARE_ROUNDS {
            let outlier = share / self.volume;
            let outliers = sums
                .iter()
                .map(|s| outlier / ((1.0 - share) * density * s + outlier));
            share = (outliers.sum::<f64>() / m as f64).clamp(LEAST_SHARE, 0.95);
        }
        let (gauss, outlier) = ((1.0 - share) * density, share / self.volume);
        let mut data: f64 = sums.iter().map(|s| -(gauss * s + outlier).ln()).sum();
        let known = self.known.iter();
        data += known
            .map(|known| known.energy(&state.warped[known.row]))
            .sum::<f64>();
        if self.rigid.is_active() {
            // All motions are equally likely, and as precisely known from one start as from another.
            state.energy = data;
            return;
        }
        self.sums
            .iter_mut()
            .for_each(|s| *s = gauss / (gauss * *s + outlier));
        self.soft.errors.weigh(&mut self.sums);
        self.soft.row_totals(&self.sums, &mut self.weights);
        self.weights.resize(self.prior.stride, 0.0);
        let rows = state.warped.iter().zip(&state.base);
        self.residuals.fill(
            self.prior.stride,
            rows.map(|(w, b)| std::array::from_fn(|k| w[k] - b[k])),
        );
        self.regression
            .fit(&self.prior, &self.weights, &self.residuals, variance);
        state.energy =
            data + 0.5 * (self.regression.penalty() + D as f64 * self.regression.log_det);
    }
}
