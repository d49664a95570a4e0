//! The alternation: soft assignment at a falling temperature, then the warp that it asks for.

use super::prior::Prior;
use super::regression::Regression;
use super::soft_assign::SoftAssignment;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// One annealing run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Schedule {
    /// First temperature, as a standard deviation in radii of the model.
    pub(crate) sigma: f64,
    /// Lowest temperature.
    pub(crate) floor: f64,
    /// Largest fall of σ an iteration, as a factor.
    pub(crate) rate: f64,
    /// Most iterations.
    pub(crate) limit: usize,
    /// Sinkhorn sweeps an iteration.
    pub(crate) sweeps: usize,
    /// Expected share of points without partner.
    pub(crate) slack: f64,
}

/// Where a run stands.
#[derive(Clone, Debug, Default)]
pub(crate) struct State<const D: usize> {
    /// Where the run's prior puts the model points.
    pub(crate) base: Vec<[f64; D]>,
    /// Where the warp puts them.
    pub(crate) warped: Vec<[f64; D]>,
    /// Standard deviation of the residuals along one axis.
    pub(crate) sigma: f64,
    /// Iterations made.
    pub(crate) iterations: usize,
    /// Energy per model point after every iteration.
    pub(crate) trace: Vec<f64>,
    /// What the run is judged by; less is better.
    pub(crate) energy: f64,
    /// Whether the temperature stopped falling before the limit.
    pub(crate) settled: bool,
}

impl<const D: usize> State<D> {
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.base.clone_from(&other.base);
        self.warped.clone_from(&other.warped);
        self.trace.clone_from(&other.trace);
        (self.sigma, self.iterations) = (other.sigma, other.iterations);
        (self.energy, self.settled) = (other.energy, other.settled);
    }
}

/// Shared machinery of the runs: targets, prior, scratch.
#[derive(Clone, Debug, Default)]
pub(crate) struct Annealer<const D: usize> {
    pub(crate) soft: SoftAssignment<D>,
    pub(crate) prior: Prior,
    pub(crate) regression: Regression<D>,
    /// Volume of the targets' bounding box.
    pub(crate) volume: f64,
    weights: Vec<f64>,
    residuals: Vec<[f64; D]>,
}

impl<const D: usize> Annealer<D> {
    /// Weight of the slack beside a Gaussian affinity: `(2πσ²)^{D/2}` times the density of stray points.
    pub(crate) fn slack(&self, share: f64, points: usize, variance: f64) -> f64 {
        (TAU * variance).powf(0.5 * D as f64) * share / (1.0 - share) * points as f64 / self.volume
    }

    /// Alternates until the temperature stands still; `observe` is told every iteration and may stop the run.
    pub(crate) fn run(
        &mut self,
        state: &mut State<D>,
        schedule: &Schedule,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let mut variance = schedule.sigma * schedule.sigma;
        state.settled = false;
        for iteration in 0..schedule.limit {
            let next = self.step(state, schedule, variance);
            state.iterations += 1;
            state.trace.push(self.free_energy(state, variance));
            observe(state.iterations, *state.trace.last().unwrap_or(&0.0))?;
            let floor = schedule.floor * schedule.floor;
            let next = next.max(variance * schedule.rate * schedule.rate).max(floor).min(variance);
            state.settled = variance <= floor || (iteration > 5 && variance - next < 1e-4 * variance);
            if state.settled {
                break;
            }
            variance = next;
        }
        state.sigma = variance.sqrt();
        ControlFlow::Continue(())
    }

    /// One soft assignment and one fit; the residual variance that is left.
    fn step(&mut self, state: &mut State<D>, schedule: &Schedule, variance: f64) -> f64 {
        let slack = self.slack(schedule.slack, state.warped.len(), variance).max(1e-30) as f32;
        self.soft.affinities(&state.warped, variance);
        self.soft.normalise(schedule.sweeps, slack, slack);
        self.soft.moments(&state.warped);
        self.fit(state, variance);
        let (mut total, mut squares) = (0.0, 0.0);
        for i in 0..state.warped.len() {
            let u = self.regression.displacement(&self.prior, i);
            let (w, shift) = (self.soft.weight[i], self.soft.shift[i]);
            let mut square = self.soft.spread[i];
            for k in 0..D {
                let moved = state.base[i][k] + u[k];
                let step = moved - state.warped[i][k];
                square += w * step * (step - 2.0 * shift[k]);
                state.warped[i][k] = moved;
            }
            total += w;
            squares += square.max(0.0);
        }
        if total > 0.0 { squares / (D as f64 * total) } else { variance }
    }

    /// Fits the warp to the moments of the soft assignment about `state.warped`.
    fn fit(&mut self, state: &State<D>, variance: f64) {
        self.residuals.clear();
        for ((warped, base), shift) in state.warped.iter().zip(&state.base).zip(&self.soft.shift) {
            self.residuals.push(std::array::from_fn(|k| warped[k] + shift[k] - base[k]));
        }
        self.regression.fit(&self.prior, &self.soft.weight, &self.residuals, variance);
    }

    /// The annealed energy: distances under M, over the temperature, plus the warp's penalty, a model point.
    fn free_energy(&self, state: &State<D>, variance: f64) -> f64 {
        let data: f64 = self.soft.spread.iter().sum::<f64>() / (2.0 * variance);
        (data + 0.5 * self.regression.penalty()) / state.warped.len() as f64
    }

    /// What runs are compared by: `−ln p(targets | warp) − ln p(warp)`, with the warp's posterior volume (Laplace).
    ///
    /// The targets are a mixture of Gaussians about the warped points and of uniform stray points; residuals under
    /// `resolution` count as that, so that an exact fit does not win by an infinite margin.
    pub(crate) fn judge(&mut self, state: &mut State<D>, share: f64, resolution: f64) {
        let variance = state.sigma.max(resolution).powi(2);
        let (n, m) = (state.warped.len(), self.soft.targets());
        self.soft.affinities(&state.warped, variance);
        let gauss = (1.0 - share) / n as f64 / (TAU * variance).powf(0.5 * D as f64);
        let stray = share / self.volume;
        let sums = &mut self.residuals_by_target(m);
        let mut energy: f64 = sums.iter().map(|s| -(gauss * s + stray).ln()).sum();
        self.weights.clear();
        for i in 0..n {
            let row = self.soft.affinity_row(i).iter().zip(&*sums);
            self.weights.push(row.map(|(k, s)| gauss * f64::from(*k) / (gauss * s + stray)).sum());
        }
        self.residuals.clear();
        let pairs = state.warped.iter().zip(&state.base);
        self.residuals.extend(pairs.map(|(w, b)| std::array::from_fn::<f64, D, _>(|k| w[k] - b[k])));
        self.regression.fit(&self.prior, &self.weights, &self.residuals, variance);
        energy += 0.5 * (self.regression.penalty() + D as f64 * self.regression.log_det);
        state.energy = energy;
    }

    fn residuals_by_target(&self, targets: usize) -> Vec<f64> {
        let mut sums = vec![0.0; targets];
        let rows = self.soft.kernel.len() / targets.next_multiple_of(super::soft_assign::LANES);
        for i in 0..rows {
            sums.iter_mut().zip(self.soft.affinity_row(i)).for_each(|(s, k)| *s += f64::from(*k));
        }
        sums
    }
}
