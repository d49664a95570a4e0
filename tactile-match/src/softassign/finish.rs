//! From the last soft assignment to the answer: hard matches, confidences, positions, covariances.

use super::anneal::Annealer;
use super::confidence::{Fitted, PairOdds};
use super::locality::Locality;
use super::schedule::{Slack, State};
use super::soft_assign::SoftAssignment;
use crate::Doubt;

/// Residuals below this (radii of the model) are what the prior's factor leaves out: the data are clean.
pub(crate) const CLEAN: f64 = 3e-3;
/// The lowest temperature of a run.
pub(crate) const FLOOR: f64 = 1e-3;
/// The answer is read at no lower temperature.
const READ: f64 = 1.4e-3;
/// An answer with fewer pairs, relative to the smaller set, may be one of chance: wrong basins of sets that were stretched or turned matched up
/// to two fifths.
const ENOUGH: f64 = 0.55;
/// The same where the caller expects most points to have no partner.
const FEWEST: f64 = 0.1;
/// Least logarithm, a point, of how much more likely an answer makes the targets than chance does: wrong basins come to less than nothing.
pub(crate) const TELLING: f64 = 0.2;
/// Least mean confidence of pairs: of a hundred pairs the share that is right varies by two points about its mean, and scenes with less than nine
/// in ten are to be doubted.
const DECIDED: f64 = 0.95;
/// Soft matches are read with weights raised to this power. Scaling rows and columns tells two points that may be swapped apart by half the
/// logarithm of the odds that the whole permutations have; the power makes up for it. The confidences of pairs are told by [`PairOdds`].
const SHARPNESS: f64 = 1.55;
/// Soft matches below this are not reported.
const FAINT: f64 = 1e-3;

/// The answer in the frame's units.
#[derive(Clone, Debug, Default)]
pub(crate) struct Answer<const D: usize> {
    pub(crate) warped: Vec<[f64; D]>,
    pub(crate) assignment: Vec<Option<usize>>,
    pub(crate) confidence: Vec<f64>,
    /// Posterior variance of the positions, along one axis.
    pub(crate) variance: Vec<f64>,
    pub(crate) residual: f64,
    column_best: Vec<(f64, usize)>,
    odds: PairOdds,
    locality: Locality<D>,
    /// See [`Locality::contrast`]; 1 where it was not needed.
    contrast: f64,
}

/// Where the smaller set has less than this share of the larger one's points, parts are out of sight or strewn about: its edges draw what lies
/// behind them a point aside, and an answer leaves no doubt only where it makes the targets so much likelier than chance. Less misses more of
/// such shifts, more costs noisy scenes further starts (`--example confidence`).
const UNEQUAL: f64 = 0.95;

/// Whether parts of one set are out of sight or strewn about.
pub(super) fn are_unequal(model: usize, target: usize) -> bool {
    (model.min(target) as f64) < UNEQUAL * model.max(target) as f64
}

impl<const D: usize> Answer<D> {
    /// Why the pairs are not to be relied on: `smaller` points could have a partner, `share` of them are expected to have none.
    pub(crate) fn doubt(&self, smaller: usize, share: f64) -> Option<Doubt> {
        let pairs = self.assignment.iter().flatten().count() as f64;
        let enough = ENOUGH.min(1.0 - 1.5 * share).max(FEWEST);
        match () {
            () if pairs < enough * smaller as f64 => Some(Doubt::FewPairs),
            () if self.sureness() < DECIDED => Some(Doubt::Undecided),
            () => None,
        }
    }

    /// Mean confidence of the pairs; 1 where there are none.
    pub(crate) fn sureness(&self) -> f64 {
        let paired = self.assignment.iter().zip(&self.confidence);
        let (mut pairs, mut sure) = (0.0, 0.0);
        for (_, confidence) in paired.filter(|(partner, _)| partner.is_some()) {
            pairs += 1.0;
            sure += confidence;
        }
        if pairs > 0.0 { sure / pairs } else { 1.0 }
    }

    /// How much worse the worst surrounding fits than most.
    pub(crate) fn contrast(&self) -> f64 {
        self.contrast
    }

    /// Reads the answer from the run's final state; `spread` is the variance of the positions between the scales of the prior, empty where
    /// there is one scale; `gain` is that of the answer over chance, see [`SoftassignWorkspace::gain`](super::SoftassignWorkspace).
    pub(crate) fn read(
        &mut self,
        annealer: &mut Annealer<D>,
        state: &State<D>,
        targets: &[[f64; D]],
        slack: Slack,
        spread: &[f64],
        gain: f64,
    ) {
        let n = state.warped.len();
        let noisy = state.sigma > CLEAN || annealer.soft.errors.differ();
        // What the prior's factor leaves out must not cost a clean pair its match.
        let variance = state.sigma.max(READ).powi(2);
        let (sweeps, sharpness) = if noisy { (8, SHARPNESS) } else { (3, 1.0) };
        annealer.assign(&state.warped, variance, slack, sweeps, sharpness);
        annealer.soft.cap_rows();
        self.assign(&annealer.soft, n, targets.len());
        // A rigid motion leaves residuals, however small.
        let snaps = !noisy && !annealer.rigid.is_active();
        let fit = self.place(state, targets, snaps);
        if !annealer.rigid.is_active() {
            annealer.regression.variances(&annealer.prior);
        }
        self.contrast = 1.0;
        if noisy && are_unequal(n, targets.len()) {
            self.contrast =
                self.locality
                    .contrast((&state.warped, targets), annealer.volume, &self.assignment);
        }
        if noisy {
            let fitted = Fitted {
                annealer,
                warped: &state.warped,
                targets,
                variance,
            };
            self.odds
                .weigh(fitted, &mut self.assignment, &mut self.confidence);
            self.locality.weigh(
                (&state.warped, targets),
                (variance, annealer.volume),
                gain,
                &self.assignment,
                &mut self.confidence,
            );
        }
        self.variance.clear();
        for i in 0..n {
            let of_warp = annealer.regression.variance[i] + spread.get(i).copied().unwrap_or(0.0);
            // A point that was put onto its target shares the target's error.
            let on_target = snaps && self.assignment[i].is_some();
            self.variance.push(if on_target { fit } else { of_warp });
        }
    }

    /// Pairs that prefer each other to every rival and to having no partner.
    fn assign(&mut self, soft: &SoftAssignment<D>, n: usize, m: usize) {
        self.column_best.clear();
        self.column_best.resize(m, (0.0, usize::MAX));
        self.assignment.clear();
        self.confidence.clear();
        for i in 0..n {
            let mut best = (0.0, usize::MAX);
            for (j, p) in soft.entries(i) {
                best = if p > best.0 { (p, j) } else { best };
                if p > self.column_best[j].0 {
                    self.column_best[j] = (p, i);
                }
            }
            let free = (1.0 - soft.moments.plain().weight[i]).max(0.0);
            let matched = best.1 != usize::MAX && soft.moments.plain().weight[i] > 0.5;
            self.assignment.push(matched.then_some(best.1));
            self.confidence
                .push(if matched { best.0.min(1.0) } else { free });
        }
        for i in 0..n {
            if self.assignment[i].is_some_and(|j| self.column_best[j].1 != i) {
                self.assignment[i] = None;
            }
        }
    }

    /// The positions, on their targets where it `snaps`; the variance, along one axis, of what the warp alone leaves to the targets.
    fn place(&mut self, state: &State<D>, targets: &[[f64; D]], snaps: bool) -> f64 {
        let square =
            |a: &[f64; D], b: &[f64; D]| (0..D).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
        self.warped.clone_from(&state.warped);
        let (mut left, mut squares, mut pairs) = (0.0, 0.0, 0);
        for (i, partner) in self.assignment.iter().enumerate() {
            let &Some(j) = partner else { continue };
            left += square(&self.warped[i], &targets[j]);
            if snaps {
                self.warped[i] = targets[j];
            }
            squares += square(&self.warped[i], &targets[j]);
            pairs += 1;
        }
        let count = f64::from(pairs.max(1));
        self.residual = (squares / count).sqrt();
        left / (D as f64 * count)
    }
}

/// Soft matches of row i worth reporting.
pub(crate) fn soft_row<const D: usize>(
    soft: &SoftAssignment<D>,
    i: usize,
) -> impl Iterator<Item = (usize, f64)> + '_ {
    soft.entries(i).filter(|&(_, p)| p > FAINT)
}
