//! One annealing run: soft assignment at a falling temperature, alternating with a fit of the warp.

use super::assign::{Gaussian, SoftAssignment};
use super::difference;
use super::options::Slack;
use super::rigid::RigidFit;
use crate::Watch;
use crate::gaussian_process::{Axes, Prior, PriorScales, Regression, Request};
use crate::judgement::median_of_chi_squared;
use std::f64::consts::TAU;
use std::ops::ControlFlow;
use tactile_core::statistics::median;

/// Scales of the prior in the search.
pub(super) const SCALES: PriorScales = PriorScales {
    length: 1.2,
    bending: 0.35,
    affine: 0.5,
};

/// Cooling schedule of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cooling {
    /// First temperature, as a standard deviation in radii of the model.
    pub sigma: f64,
    /// Largest fall of σ per iteration, as a factor.
    pub rate: f64,
    /// Smallest fall of σ per iteration, as a factor. With 1 the residuals set the temperature.
    pub least: f64,
    /// The run ends after this many iterations without a fall of the temperature.
    pub patience: usize,
    /// Corresponding limit for the first temperature, in case the start is colder than the noise.
    pub stuck: usize,
    /// Sinkhorn sweeps per iteration.
    pub sweeps: usize,
    /// The run is stationary if the variances of residuals and temperature differ by less than this
    /// fraction, although matches are undecided.
    pub still: f64,
    /// Whether residuals include the posterior variance of the warp. Without it, the warp of a few
    /// points fits their noise and the temperature falls below it.
    pub open: bool,
}

/// Schedule of one annealing run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Schedule {
    pub cooling: Cooling,
    /// Lowest temperature.
    pub floor: f64,
    /// Maximum number of iterations.
    pub limit: usize,
    /// A cold run that matches fewer points than this has collapsed and ends.
    pub collapse: f64,
    /// Number of points that can have a partner. If nearly all of them are matched, residuals that
    /// no longer fall are noise.
    pub partners: f64,
    /// Expectation for points without a partner.
    pub slack: Slack,
}

/// A run: where it is, and how well it fits.
#[derive(Clone, Debug, Default)]
pub(super) struct Run<const D: usize> {
    /// Prior positions of the model points.
    pub base: Vec<[f64; D]>,
    /// Warped positions of the model points.
    pub warped: Vec<[f64; D]>,
    /// Standard deviation of the residuals along one axis.
    pub sigma: f64,
    /// Total weight of matched model points.
    pub matched: f64,
    /// Iterations done.
    pub iterations: usize,
    /// Energy per model point after each iteration.
    pub trace: Vec<f64>,
    /// Energy by which runs are compared. Lower is better.
    pub energy: f64,
    /// Whether the temperature stopped falling before the limit.
    pub settled: bool,
    /// Whether the residuals are noise, even if they are small.
    pub noisy: bool,
    /// Whether many points move farther than allowed.
    pub far: bool,
    /// Fraction of the matched points whose residual exceeds the noise of the others, see
    /// [`Annealer::tail`].
    pub tail: f64,
    /// Spread of the soft partners within a row, relative to the temperature: 1 for undecided, 0
    /// for decided.
    pub ambiguity: f64,
}

impl<const D: usize> Run<D> {
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.base.clone_from(&other.base);
        self.warped.clone_from(&other.warped);
        self.trace.clone_from(&other.trace);
        (self.sigma, self.iterations) = (other.sigma, other.iterations);
        (self.energy, self.settled, self.matched) = (other.energy, other.settled, other.matched);
        (self.tail, self.ambiguity) = (other.tail, other.ambiguity);
        (self.noisy, self.far) = (other.noisy, other.far);
    }
}

/// Shared machinery of the runs: targets, prior and working memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Annealer<const D: usize> {
    pub soft: SoftAssignment<D>,
    pub prior: Prior,
    pub regression: Regression<D>,
    /// Replaces the regression if the warp must not bend.
    pub rigid: RigidFit<D>,
    pub weights: Vec<f64>,
    pub residuals: Axes<D>,
    pub predicted: Vec<[f64; D]>,
    pub sums: Vec<f64>,
    /// Spread of the soft partners within a row, relative to the temperature: 1 for undecided, 0
    /// for decided.
    pub ambiguity: f64,
}

// The alternation: soft assignment at a falling temperature, then the fit of the warp.

/// Affinities below this fraction of the slack are dropped.
const FAINTER: f64 = 1e-3;
/// Lower limit of an estimated fraction of outliers.
const LEAST_SHARE: f64 = 0.02;

impl<const D: usize> Annealer<D> {
    /// The regression problem posed by the soft matches of the last fit.
    pub(super) fn request(&self) -> Request<'_, D> {
        Request {
            weights: &self.weights,
            displacements: &self.residuals,
        }
    }

    /// Computes the soft matches of `warped` at this temperature, with their moments.
    ///
    /// The slack has a weight of `(2πσ²)^{D/2}` times the density of outliers, relative to Gaussian
    /// affinities.
    /// All weights are raised to the power `sharpness`.
    pub(super) fn assign(
        &mut self,
        warped: &[[f64; D]],
        variance: f64,
        slack: Slack,
        sweeps: usize,
        sharpness: f64,
    ) {
        let weight = slack_weight::<D>(warped.len(), variance, slack);
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

    /// Alternates until the temperature no longer falls. `watch` is called after each iteration
    /// and may stop the run.
    pub(super) fn run(
        &mut self,
        state: &mut Run<D>,
        schedule: &Schedule,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        let mut variance = schedule.cooling.sigma * schedule.cooling.sigma;
        let (mut standing, mut noise_found) = (0, false);
        state.settled = false;
        self.predicted.clone_from(&state.warped);
        for iteration in 0..schedule.limit {
            let mut residual = self.step(state, schedule, variance);
            if schedule.cooling.open {
                residual += self.open();
            }
            state.iterations += 1;
            state.trace.push(self.free_energy(state, variance));
            if watch().is_break() {
                (state.sigma, state.ambiguity) = (variance.sqrt(), self.ambiguity);
                return ControlFlow::Break(());
            }
            let floor = schedule.floor.powi(2);
            // Temperatures (variances) below this are cold: a tenth of the model's radius.
            if variance < 0.01 && state.matched < schedule.collapse {
                // The temperature fell below the noise: points lose their partners and do not
                // recover them.
                break;
            }
            // Soft partners that spread less than this, relative to the temperature, are as good as
            // decided, so the cooling can be fast.
            let decided = self.ambiguity < 0.01;
            let fall = |rate: f64| variance * rate * rate;
            let rate = if decided { 0.3 } else { schedule.cooling.rate };
            let lowest = fall(rate).max(floor);
            // If nearly all points are matched and decided, and no part is displaced, residuals
            // above the temperature are noise. At lower temperatures points would lose their
            // partners.
            let lost = lost_to_slack::<D>(state.warped.len(), variance, schedule.slack);
            noise_found |= schedule.cooling.least < 1.0
                && residual > variance
                && state.matched >= schedule.partners * (0.99 - lost)
                && self.ambiguity < 0.05
                && self.tail(0.0) <= 2e-3;
            let next = if noise_found {
                residual.max(lowest)
            } else {
                let forced = residual.min(fall(schedule.cooling.least));
                forced.max(lowest).min(variance)
            };
            let still = match () {
                () if noise_found => 1e-2,
                () if decided => 1e-3,
                () => schedule.cooling.still,
            };
            standing = if next < variance { 0 } else { standing + 1 };
            let patience = if state.iterations > standing {
                schedule.cooling.patience
            } else {
                schedule.cooling.stuck // never colder than at the start
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

    /// Makes one step from `state` in working memory: sets soft matches and regression to those of
    /// `state`. Returns how undecided they are, see [`ambiguity`](Self::ambiguity).
    pub(super) fn restore(
        &mut self,
        state: &Run<D>,
        scratch: &mut Run<D>,
        schedule: &Schedule,
    ) -> f64 {
        scratch.copy_from(state);
        self.predicted.clone_from(&state.warped);
        self.step(scratch, schedule, state.sigma * state.sigma);
        self.ambiguity
    }

    /// Alternates `rounds` of expectation and maximisation with a free noise level, starting from
    /// `state`.
    pub(super) fn settle(&mut self, state: &mut Run<D>, schedule: &Schedule, rounds: usize) {
        self.predicted.clone_from(&state.warped);
        for _ in 0..rounds {
            let residual = self.step(state, schedule, state.sigma * state.sigma);
            state.sigma = (residual + self.open()).sqrt().max(schedule.floor);
            self.predicted.clone_from(&state.warped);
        }
    }

    /// Mean posterior variance, along an axis, of the matched points in the last fit.
    fn open(&self) -> f64 {
        let weights = &self.soft.moments.weight;
        let variances = weights.iter().zip(&self.regression.variance);
        let total: f64 = weights.iter().sum();
        variances.map(|(w, v)| w * v).sum::<f64>() / total.max(1e-9)
    }

    /// One soft assignment and one fit. Returns the residual variance.
    ///
    /// Distances are computed from the prediction by the matches of the *other* points, so that a
    /// wrong match does not confirm itself.
    fn step(&mut self, state: &mut Run<D>, schedule: &Schedule, variance: f64) -> f64 {
        let predicted = std::mem::take(&mut self.predicted);
        self.assign(
            &predicted,
            variance,
            schedule.slack,
            schedule.cooling.sweeps,
            1.0,
        );
        self.predicted = predicted;
        self.fit(state, variance);
        let moments = &self.soft.moments;
        let (mut total, mut squares, mut within) = (0.0, 0.0, 0.0);
        for i in 0..state.warped.len() {
            let w = moments.weight[i];
            let shifts = moments.shift[i].iter().map(|s| s * s);
            within += moments.spread[i] - moments.weight[i] * shifts.sum::<f64>();
            // The leverage is limited: a point that determines its own position is not excluded
            // completely.
            let leverage = (w * self.regression.variance[i] / variance).min(0.95);
            let mut square = moments.spread[i];
            for k in 0..D {
                let (u, z) = (self.regression.displacement.0[k][i], self.residuals.0[k][i]);
                let moved = state.base[i][k] + u;
                let step = moved - self.predicted[i][k];
                square += moments.weight[i] * step * (step - 2.0 * moments.shift[i][k]);
                state.warped[i][k] = moved;
                self.predicted[i][k] = state.base[i][k] + (u - leverage * z) / (1.0 - leverage);
            }
            total += w;
            squares += square.max(0.0);
        }
        state.matched = moments.weight.iter().sum();
        self.ambiguity = within / (D as f64 * total.max(1e-9) * variance);
        if total > 0.0 {
            squares / (D as f64 * total)
        } else {
            variance
        }
    }

    /// Fits the warp to the moments of the soft assignment about the predicted positions.
    fn fit(&mut self, state: &Run<D>, variance: f64) {
        let stride = self.prior.stride;
        let rows = self
            .predicted
            .iter()
            .zip(&state.base)
            .zip(&self.soft.moments.shift);
        let target = |((p, b), s): ((&[f64; D], &[f64; D]), &[f64; D])| {
            std::array::from_fn(|k| p[k] + s[k] - b[k])
        };
        self.residuals.fill(stride, rows.map(target));
        let soft = &self.soft.moments;
        self.weights.clone_from(&soft.weight);
        self.weights.resize(stride, 0.0);
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
        self.regression.variances(&self.prior, false);
    }

    /// The annealed energy per model point: distances under M, over the temperature, plus the
    /// penalty of the warp.
    fn free_energy(&self, state: &Run<D>, variance: f64) -> f64 {
        let spread = &self.soft.moments.spread;
        let data = spread.iter().sum::<f64>() / (2.0 * variance);
        (data + 0.5 * self.regression.penalty()) / state.warped.len() as f64
    }

    /// Computes the energy by which runs are compared: `−ln p(targets | warp) − ln p(warp)`, with
    /// the posterior volume of the warp (Laplace).
    ///
    /// The targets are a mixture of Gaussians about the warped points and of uniform outliers,
    /// whose fraction is estimated. Residuals below `resolution` are raised to it, so that an exact
    /// fit does not win by an infinite margin.
    pub(super) fn evaluate(&mut self, state: &mut Run<D>, slack: Slack, resolution: f64) {
        let Slack {
            mut share, volume, ..
        } = slack;
        let variance = state.sigma.max(resolution).powi(2);
        let (n, m) = (state.warped.len(), self.soft.targets());
        let gaussian = n as f64 * (TAU * variance).powf(0.5 * D as f64);
        let kernel = Gaussian {
            variance,
            sharpness: 1.0,
        };
        let least = FAINTER * LEAST_SHARE * gaussian / volume;
        self.soft.affinities(&state.warped, kernel, least);
        self.soft.column_totals(&mut self.sums);
        let sums = &self.sums[..m];
        let density = 1.0 / gaussian;
        // Fixed-point iterations for the fraction of outliers.
        for _ in 0..8 {
            let outlier = share / volume;
            let outliers = sums
                .iter()
                .map(|s| outlier / ((1.0 - share) * density * s + outlier));
            share = (outliers.sum::<f64>() / m as f64).clamp(LEAST_SHARE, 0.95);
        }
        let (gauss, outlier) = ((1.0 - share) * density, share / volume);
        let data: f64 = sums.iter().map(|s| -(gauss * s + outlier).ln()).sum();
        if self.rigid.is_active() {
            // All motions are equally likely a priori, and equally well determined from any start.
            state.energy = data;
            return;
        }
        self.sums
            .iter_mut()
            .for_each(|s| *s = gauss / (gauss * *s + outlier));
        self.soft.row_totals(&self.sums, &mut self.weights);
        self.weights.resize(self.prior.stride, 0.0);
        let rows = state.warped.iter().zip(&state.base);
        self.residuals
            .fill(self.prior.stride, rows.map(|(w, b)| difference(w, b)));
        self.regression
            .fit(&self.prior, &self.weights, &self.residuals, variance);
        state.energy =
            data + 0.5 * (self.regression.penalty() + D as f64 * self.regression.log_det);
    }
}

/// `(2πσ²)^{D/2}` times the density of outliers.
fn slack_weight<const D: usize>(points: usize, variance: f64, slack: Slack) -> f64 {
    let density = slack.share / (1.0 - slack.share) * points as f64 / slack.volume;
    (TAU * variance).powf(0.5 * D as f64) * density
}

/// Fraction of a point's weight that the slack takes if the residual is noise at the current
/// temperature.
///
/// A pair with the residual r keeps about `1 − w exp(r²/4σ²)` if the slack has the weight w on both
/// sides, and the mean of the exponential is `2^{D/2}`.
fn lost_to_slack<const D: usize>(points: usize, variance: f64, slack: Slack) -> f64 {
    slack.model.max(slack.target) * slack_weight::<D>(points, 2.0 * variance, slack)
}

// Signs that part of a set is shifted by one point: residuals that exceed the noise of the others,
// and soft partners that spread farther than the noise.

impl<const D: usize> Annealer<D> {
    /// Fraction of the matched points of the last step whose distance from the leave-one-out
    /// prediction exceeds `least` and Gaussian noise. The variance of this noise follows from the
    /// median of all squared distances. If part of a set is shifted by one point, its points have
    /// such residuals, although the root mean square of all is small.
    pub(super) fn tail(&mut self, least: f64) -> f64 {
        self.sums.clear();
        let moments = &self.soft.moments;
        let spread = &moments.spread;
        let rows = moments.weight.iter().zip(spread);
        let matched = rows.filter(|&(&weight, _)| weight > 0.5);
        self.sums
            .extend(matched.map(|(weight, spread)| spread / weight));
        if self.sums.is_empty() {
            return 0.0;
        }
        let median = median(&mut self.sums);
        // Squared residuals beyond this number of variances are not noise. By chance one Gaussian
        // residual in a thousand is, in the plane and in space.
        let limit = (16.0 * median / median_of_chi_squared(D)).max(least * least);
        let beyond = self.sums.iter().filter(|&&square| square > limit);
        beyond.count() as f64 / self.sums.len() as f64
    }
}
