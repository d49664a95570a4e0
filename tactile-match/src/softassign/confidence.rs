//! From the last soft assignment to the answer: hard matches, confidences, positions and
//! covariances.

use super::assign::SoftAssignment;
use super::odds::{Fitted, PairOdds};
use super::problem::{MIN_TELLING_GAIN, Problem};
use super::race::{Outcome, Runner};
use super::run::Run;
use super::{Mechanism, squared_distance};
use crate::{Doubt, Judgement, MatchReport, Outliers, StopReason, linear_assignment};

/// The answer in the units of the frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Answer<const D: usize> {
    pub warped: Vec<[f64; D]>,
    pub assignment: Vec<Option<usize>>,
    pub confidence: Vec<f64>,
    /// Posterior variance of the positions, along one axis.
    pub variance: Vec<f64>,
    /// The report, in the units of the points.
    pub report: MatchReport,
    column_best: Vec<(f64, usize)>,
    odds: PairOdds,
}

/// An answer is read at this multiple of the lowest temperature or above: the truncation of the
/// prior's factor must not cost a clean pair its match.
const READ: f64 = 1.4;
/// Spread of the soft partners, relative to the temperature, above which the pairs are undecided,
/// however high their individual confidences. At 0.45 nineteen of twenty pairs are correct; at 0.55
/// a surface of 5,000 points has slipped along itself
/// (`--example large_sets -- 5000 surface 0.002 0.1`).
const MOST_AMBIGUOUS: f64 = 0.5;

/// Maximum number of costs in a completion: 8 MB and a tenth of a second.
const MAX_COMPLETED: usize = 1_000_000;

impl<const D: usize> Answer<D> {
    /// The answer of a search whose soft matches and regression are those of `best`.
    pub(super) fn conclude(
        &mut self,
        problem: &Problem<D>,
        runner: &mut Runner<D>,
        best: &Run<D>,
        outcome: Outcome,
    ) {
        let residual = self.read(problem, runner, best);
        self.keep_within_reach(problem);
        if problem.options.outliers != Outliers::Both {
            self.complete(problem);
        }
        // An exact answer fits the targets perfectly.
        let gain = problem.gain(best).unwrap_or(f64::INFINITY);
        let symmetric = outcome.symmetric.then_some(Doubt::Symmetric);
        let own = self.doubt(problem, gain, best);
        let doubt = outcome.rivals.doubt.or(own).or(symmetric);
        if let Some(doubt) = doubt {
            self.lower_confidences(doubt, gain);
        }
        // The lowest temperature is reached, to rounding.
        let coldest = best.sigma <= 1.000_001 * problem.limits.least;
        self.report = MatchReport {
            stop: match () {
                () if outcome.stopped => StopReason::Cancelled,
                () if coldest && !runner.fine.found && doubt.is_none() => StopReason::Exact,
                () if best.settled => StopReason::Converged,
                () => StopReason::IterationLimit,
            },
            iterations: best.iterations,
            starts: outcome.starts,
            residual: residual * problem.frame.scale,
            sigma: runner.fine.sigma.unwrap_or(best.sigma) * problem.frame.scale,
            judgement: doubt.map_or(Judgement::Sure, Judgement::Doubtful),
            period: outcome.rivals.period,
        };
    }

    /// Why the pairs are not reliable. `gain` is the log-likelihood gain per point over a uniform
    /// target distribution.
    fn doubt(&self, problem: &Problem<D>, gain: f64, run: &Run<D>) -> Option<Doubt> {
        let (tail, smaller, share) = (run.tail, problem.smaller(), problem.options.share);
        let pairs = self.assignment.iter().flatten().count() as f64;
        // An answer with fewer pairs, relative to the smaller set, may be a chance result: wrong
        // basins of stretched or rotated sets matched up to two fifths. The limit falls if the
        // caller expects most points to have no partner.
        let enough = 0.55_f64.min(1.0 - 1.5 * share).max(0.1);
        if pairs < enough * smaller as f64 {
            return Some(Doubt::FewPairs);
        }
        // This limit trades false alarms for missed ones: of 912 held-out answers
        // (`--example confidence -- 100 6`), 39 correct ones are doubted and 10 of 235 wrong ones
        // are not. When the limit was chosen, the numbers were 37 and 10, and 22 and 13 at 0.4.
        if self.risk(smaller, gain, tail) < 0.25 && run.ambiguity < MOST_AMBIGUOUS {
            return None;
        }
        // Such a large tail is caused by a displaced part of the set.
        let misfit = gain < MIN_TELLING_GAIN || tail > 0.08;
        Some(if misfit {
            Doubt::LargeResiduals
        } else {
            Doubt::Undecided
        })
    }

    /// Probability that fewer than nine in ten pairs are correct. It is logistic in the fractions
    /// of wrong and of missed pairs by their confidences, in the gain, and in the tail. It was
    /// fitted to the scenes of `--example confidence`, seeds 0 to 5, and to every second one of
    /// Chui and Rangarajan's published sets.
    fn risk(&self, smaller: usize, gain: f64, tail: f64) -> f64 {
        let rows = self.assignment.iter().zip(&self.confidence);
        let without = rows.filter(|(partner, _)| partner.is_none());
        let missed: f64 = without.map(|(_, free)| 1.0 - free).sum::<f64>() / smaller as f64;
        let wrong = (1.01 - self.sureness()).ln();
        let logit = 6.94 + 2.76 * wrong + 30.8 * missed.min(1.0) - 1.5 * gain.clamp(-1.0, 1.0)
            + 66.6 * tail.min(0.2);
        1.0 / (1.0 + (-logit).exp())
    }

    /// Mean confidence of the pairs. 1 if there are none.
    fn sureness(&self) -> f64 {
        let paired = self.assignment.iter().zip(&self.confidence);
        let (mut pairs, mut sure) = (0.0, 0.0);
        for (_, confidence) in paired.filter(|(partner, _)| partner.is_some()) {
            pairs += 1.0;
            sure += confidence;
        }
        if pairs > 0.0 { sure / pairs } else { 1.0 }
    }

    /// Lowers the confidences of a doubtful answer. Before, each is the probability that the pair
    /// is correct if all others are; afterwards it is unconditional. `gain` is the log-likelihood
    /// gain per point over a uniform target distribution.
    fn lower_confidences(&mut self, doubt: Doubt, gain: f64) {
        // The probability that the answer as a whole is correct is logistic in the gain and in the
        // mean confidence. The power accounts for noise that is larger than estimated. Both were
        // fitted to every second of about 570 doubtful answers: from the scenes of
        // `--example confidence`, seeds 0 to 7, which reports their calibration, and from Chui and
        // Rangarajan's published sets.
        let few = f64::from(u8::from(doubt == Doubt::FewPairs));
        let logit = -0.61 + 7.1 * gain.min(1.0) + 4.1 * self.sureness() - 1.4 * few;
        let logistic = 0.96 / (1.0 + (-logit).exp());
        let (whole, power) = match doubt {
            // Another answer fits the targets better. Even so, one pair in fifty is correct.
            Doubt::Turned | Doubt::Mirrored => (0.02, 1.0),
            // Two or more answers fit equally well.
            Doubt::Symmetric | Doubt::Repeats { .. } => (0.5, 1.0),
            Doubt::FewPairs | Doubt::Undecided | Doubt::LargeResiduals => (logistic, 1.42),
        };
        for confidence in &mut self.confidence {
            *confidence = whole * confidence.powf(power);
        }
    }

    /// Reads pairs and positions. Returns the root mean square residual of the pairs.
    fn read(&mut self, problem: &Problem<D>, runner: &mut Runner<D>, best: &Run<D>) -> f64 {
        let Runner {
            annealer,
            scales,
            fine,
            ..
        } = runner;
        let (targets, n) = (&problem.target, best.warped.len());
        let noisy = best.noisy || best.sigma > problem.limits.clean;
        let least = if best.noisy {
            0.0
        } else {
            READ * problem.limits.least
        };
        let variance = best.sigma.max(least).powi(2);
        // Soft matches are read with weights raised to this power. After scaling of rows and
        // columns, the log-odds of two points that may be swapped are half of those of the whole
        // permutations; the power compensates for this. The confidences of pairs come from
        // [`PairOdds`].
        let (sweeps, sharpness) = if noisy { (8, 1.55) } else { (3, 1.0) };
        annealer.assign(&best.warped, variance, problem.slack(), sweeps, sharpness);
        annealer.soft.cap_rows();
        self.assign(&annealer.soft, n, targets.len());
        // A rigid motion always leaves residuals, so its points are not moved onto their targets.
        let snaps = !noisy && problem.bends();
        let (residual, fit) = self.place(best, targets, snaps);
        if problem.bends() {
            annealer.regression.variances(&annealer.prior, noisy);
        }
        if noisy && problem.options.has(Mechanism::PairOdds) {
            let fitted = Fitted {
                problem,
                annealer,
                warped: &best.warped,
                variance,
            };
            self.odds
                .weigh(fitted, &mut self.assignment, &mut self.confidence);
        }
        self.variance.clear();
        if best.noisy {
            self.variance.extend_from_slice(&fine.variance);
            return residual;
        }
        for i in 0..n {
            // Empty if there is one scale of the prior.
            let between = scales.spread.get(i).copied().unwrap_or(0.0);
            // A point that was moved onto its target has the target's error.
            let on_target = snaps && self.assignment[i].is_some();
            self.variance.push(match on_target {
                true => fit,
                false => annealer.regression.variance[i] + between,
            });
        }
        residual
    }

    /// Removes pairs that moved farther than allowed.
    fn keep_within_reach(&mut self, problem: &Problem<D>) {
        let (still, farthest) = (problem.frame.still(), problem.farthest);
        if farthest.is_infinite() {
            return;
        }
        for (i, partner) in self.assignment.iter_mut().enumerate() {
            let place = std::array::from_fn(|k| problem.model[i][k] + still[k]);
            let near =
                |&j: &usize| squared_distance(&problem.target[j], &place) <= farthest * farthest;
            if partner.is_some() && partner.filter(near).is_none() {
                (*partner, self.confidence[i]) = (None, 0.5);
            }
        }
    }

    /// Completes the pairs if every point of the smaller set, or of one side, has a partner.
    fn complete(&mut self, problem: &Problem<D>) {
        let (model, targets) = (&problem.model, &problem.target);
        let left: Vec<usize> = (0..model.len())
            .filter(|&i| self.assignment[i].is_none())
            .collect();
        let mut taken = vec![false; targets.len()];
        self.assignment
            .iter()
            .flatten()
            .for_each(|&j| taken[j] = true);
        let open: Vec<usize> = (0..targets.len()).filter(|&j| !taken[j]).collect();
        if left.len().min(open.len()) == 0 || left.len() * open.len() > MAX_COMPLETED {
            return;
        }
        let cost = |i: usize, j: usize| squared_distance(&self.warped[left[i]], &targets[open[j]]);
        let Ok(pairs) = linear_assignment([left.len(), open.len()], cost) else {
            return;
        };
        for (&i, column) in left.iter().zip(pairs) {
            if let Some(column) = column {
                // The likeliest of the remaining targets, which the soft matches do not prefer.
                (self.assignment[i], self.confidence[i]) = (Some(open[column]), 0.5);
            }
        }
    }

    /// Pairs points that prefer each other to every rival and to having no partner.
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
            let free = (1.0 - soft.moments.weight[i]).max(0.0);
            let matched = best.1 != usize::MAX && soft.moments.weight[i] > 0.5;
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

    /// Sets the positions, on their targets if `snaps`. Returns their root mean square distance from
    /// the targets, and the variance, along one axis, of the residuals of the warp alone.
    fn place(&mut self, run: &Run<D>, targets: &[[f64; D]], snaps: bool) -> (f64, f64) {
        self.warped.clone_from(&run.warped);
        let (mut left, mut squares, mut pairs) = (0.0, 0.0, 0);
        for (i, partner) in self.assignment.iter().enumerate() {
            let &Some(j) = partner else { continue };
            left += squared_distance(&self.warped[i], &targets[j]);
            if snaps {
                self.warped[i] = targets[j];
            }
            squares += squared_distance(&self.warped[i], &targets[j]);
            pairs += 1;
        }
        let count = f64::from(pairs.max(1));
        ((squares / count).sqrt(), left / (D as f64 * count))
    }
}
