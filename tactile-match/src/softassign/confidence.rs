//! From the last soft assignment to the answer: hard matches, confidences, positions and
//! covariances.

use super::Mechanism;
use super::assign::SoftAssignment;
use super::options::Slack;
use super::run::{Annealer, State};
use super::{difference, dot, squared, squared_distance};
use crate::{Doubt, Outliers, linear_assignment};
use std::f64::consts::TAU;

/// The answer in the frame's units.
#[derive(Clone, Debug, Default)]
pub(super) struct Answer<const D: usize> {
    pub warped: Vec<[f64; D]>,
    pub assignment: Vec<Option<usize>>,
    pub confidence: Vec<f64>,
    /// Posterior variance of the positions, along one axis.
    pub variance: Vec<f64>,
    pub residual: f64,
    pub column_best: Vec<(f64, usize)>,
    pub odds: PairOdds,
}

/// Residuals below this, in radii of the model and in spacings, are what the prior's factor leaves
/// out: the data are clean.
const CLEAN_SIGMA: [f64; 2] = [3e-3, 0.05];
/// The same for the lowest temperature of a run: partners a twentieth of a spacing apart are told.
const MIN_SIGMA: [f64; 2] = [1e-3, 1.0 / 60.0];
/// Residuals are compared no finer than this. By the radius alone, a set of 20,000 points would be
/// compared no finer than its spacing, at which no answer is likelier than chance.
const ENERGY_RESOLUTION: [f64; 2] = [0.01, 0.2];
/// An answer is read at so many times the lowest temperature at least: what the prior's factor
/// leaves out must not cost a clean pair its match.
const READ: f64 = 1.4;
/// Least logarithm, a point, of how much more likely an answer makes the targets than chance does:
/// wrong basins come to less than nothing.
pub(super) const MIN_TELLING_GAIN: f64 = 0.2;

impl<const D: usize> Annealer<D> {
    /// Sets what noise is told from what the prior leaves out, for points this far apart.
    pub(super) fn set_resolution(&mut self, spacing: f64) {
        let least = |[radii, spacings]: [f64; 2]| radii.min(spacings * spacing);
        self.clean_sigma = least(CLEAN_SIGMA);
        self.least_sigma = least(MIN_SIGMA);
        self.resolution = least(ENERGY_RESOLUTION);
    }
}

/// Spread of the soft partners, relative to the temperature, from which on the pairs are not decided,
/// however sure each is beside the others. At 0.45 nineteen of twenty are right, at 0.55 a surface of
/// 5,000 points has slipped along itself (`--example large_sets -- 5000 surface 0.002 0.1`).
const MOST_AMBIGUOUS: f64 = 0.5;

/// Whether parts of one set are out of sight or strewn about.
pub(super) fn are_unequal(model: usize, target: usize) -> bool {
    // Where the smaller set has less than this share of the larger one's points, parts are out of
    // sight or strewn about: its edges draw what lies behind them a point aside, and an answer
    // leaves no doubt only where it makes the targets so much likelier than chance. Less misses
    // more of such shifts, more costs noisy scenes further starts (`--example confidence`).
    (model.min(target) as f64) < 0.95 * model.max(target) as f64
}

/// Most costs of a completion: 8 MB, and a tenth of a second.
const MAX_COMPLETED: usize = 1_000_000;

impl<const D: usize> Answer<D> {
    /// Why the pairs are not to be relied on. `smaller` points could have a partner, `share` of
    /// them are expected to have none. `gain` is the logarithm, a point, of how much more likely
    /// the answer makes the targets than chance does.
    pub(super) fn doubt(
        &self,
        smaller: usize,
        share: f64,
        gain: f64,
        state: &State<D>,
    ) -> Option<Doubt> {
        let tail = state.tail;
        let pairs = self.assignment.iter().flatten().count() as f64;
        // An answer with fewer pairs, relative to the smaller set, may be one of chance: wrong
        // basins of sets that were stretched or turned matched up to two fifths. The same where the
        // caller expects most points to have no partner.
        let enough = 0.55_f64.min(1.0 - 1.5 * share).max(0.1);
        if pairs < enough * smaller as f64 {
            return Some(Doubt::FewPairs);
        }
        // Trades false alarms for silence: of 912 held-out answers (`--example confidence -- 100
        // 6`) 39 right ones are doubted and 10 of 235 wrong ones are not. When it was chosen it
        // was 37 and 10, and 22 and 13 at 0.4.
        if self.risk(smaller, gain, tail) < 0.25 && state.ambiguity < MOST_AMBIGUOUS {
            return None;
        }
        // That large a tail is of a part of the set that lies aside.
        let misfit = gain < MIN_TELLING_GAIN || tail > 0.08;
        Some(if misfit {
            Doubt::LargeResiduals
        } else {
            Doubt::Undecided
        })
    }

    /// Probability that fewer than nine in ten pairs are right. Logistic in the share of wrong
    /// pairs and of missed ones by their confidences, in the gain, and in the tail. Fitted to the
    /// scenes of `--example confidence`, seeds 0 to 5, and every second one of Chui and
    /// Rangarajan's published sets.
    fn risk(&self, smaller: usize, gain: f64, tail: f64) -> f64 {
        let rows = self.assignment.iter().zip(&self.confidence);
        let without = rows.filter(|(partner, _)| partner.is_none());
        let missed: f64 = without.map(|(_, free)| 1.0 - free).sum::<f64>() / smaller as f64;
        let wrong = (1.01 - self.sureness()).ln();
        let logit = 6.94 + 2.76 * wrong + 30.8 * missed.min(1.0) - 1.5 * gain.clamp(-1.0, 1.0)
            + 66.6 * tail.min(0.2);
        1.0 / (1.0 + (-logit).exp())
    }

    /// Mean confidence of the pairs. 1 where there are none.
    pub(super) fn sureness(&self) -> f64 {
        let paired = self.assignment.iter().zip(&self.confidence);
        let (mut pairs, mut sure) = (0.0, 0.0);
        for (_, confidence) in paired.filter(|(partner, _)| partner.is_some()) {
            pairs += 1.0;
            sure += confidence;
        }
        if pairs > 0.0 { sure / pairs } else { 1.0 }
    }

    /// Lowers the confidences of an answer with a doubt. Each is the probability that the pair is
    /// right, were all others; this one is that it is right. `gain` is the logarithm, a point, of
    /// how much more likely the answer makes the targets than chance does.
    pub(super) fn lower_confidences(&mut self, doubt: Doubt, gain: f64) {
        // The probability that the answer as a whole is right is logistic in the gain and in the
        // mean confidence. A power stands for noise that is larger than estimated. Fitted to every
        // second of some 570 answers with a doubt: of the scenes of `--example confidence`, seeds 0
        // to 7, which shows what they are worth, and of Chui and Rangarajan's published sets.
        let few = f64::from(u8::from(doubt == Doubt::FewPairs));
        let logit = -0.61 + 7.1 * gain.min(1.0) + 4.1 * self.sureness() - 1.4 * few;
        let logistic = 0.96 / (1.0 + (-logit).exp());
        let (whole, power) = match doubt {
            // The answer that explains the targets better is another one. One pair in fifty is
            // right all the same.
            Doubt::Turned | Doubt::Mirrored => (0.02, 1.0),
            // Two answers or more are as good.
            Doubt::Symmetric | Doubt::Repeats { .. } => (0.5, 1.0),
            Doubt::FewPairs | Doubt::Undecided | Doubt::LargeResiduals => (logistic, 1.42),
        };
        for confidence in &mut self.confidence {
            *confidence = whole * confidence.powf(power);
        }
    }

    /// Reads the answer from the run's final state. `spread` is the variance of the positions
    /// between the scales of the prior, empty where there is one scale. `gain` is that of the
    /// answer over chance, see [`SoftassignWorkspace::gain`](super::SoftassignWorkspace).
    pub(super) fn read(
        &mut self,
        annealer: &mut Annealer<D>,
        state: &State<D>,
        targets: &[[f64; D]],
        slack: Slack,
        spread: &[f64],
        without: Option<Mechanism>,
    ) {
        let n = state.warped.len();
        let clean = annealer.clean_sigma;
        let noisy = state.noisy || state.sigma > clean;
        let least = if state.noisy {
            0.0
        } else {
            READ * annealer.least_sigma
        };
        let variance = state.sigma.max(least).powi(2);
        // Soft matches are read with weights raised to this power. Scaling rows and columns tells
        // two points that may be swapped apart by half the logarithm of the odds that the whole
        // permutations have. The power makes up for it. The confidences of pairs are told by
        // [`PairOdds`].
        let (sweeps, sharpness) = if noisy { (8, 1.55) } else { (3, 1.0) };
        annealer.assign(&state.warped, variance, slack, sweeps, sharpness);
        annealer.soft.cap_rows();
        self.assign(&annealer.soft, n, targets.len());
        // A rigid motion leaves residuals, however small.
        let snaps = !noisy && !annealer.rigid.is_active();
        let fit = self.place(state, targets, snaps);
        if !annealer.rigid.is_active() {
            annealer.regression.variances(&annealer.prior, noisy);
        }
        if noisy && without != Some(Mechanism::PairOdds) {
            let fitted = Fitted {
                annealer,
                warped: &state.warped,
                targets,
                variance,
            };
            self.odds
                .weigh(fitted, &mut self.assignment, &mut self.confidence);
        }
        self.variance.clear();
        for i in 0..n {
            let of_warp = annealer.regression.variance[i] + spread.get(i).copied().unwrap_or(0.0);
            // A point that was put onto its target shares the target's error.
            let on_target = snaps && self.assignment[i].is_some();
            self.variance.push(if on_target { fit } else { of_warp });
        }
    }

    /// Takes out pairs that moved farther than is allowed, and completes the pairs where every point
    /// of the smaller set, or of one side, has a partner.
    pub(super) fn finish(
        &mut self,
        outliers: Outliers,
        targets: &[[f64; D]],
        model: &[[f64; D]],
        (still, farthest): ([f64; D], f64),
    ) {
        if farthest.is_finite() {
            for (i, partner) in self.assignment.iter_mut().enumerate() {
                let place = std::array::from_fn(|k| model[i][k] + still[k]);
                let near =
                    |&j: &usize| squared_distance(&targets[j], &place) <= farthest * farthest;
                if partner.is_some() && partner.filter(near).is_none() {
                    (*partner, self.confidence[i]) = (None, 0.5);
                }
            }
        }
        if outliers == Outliers::Both {
            return;
        }
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
        let cost = |&i: &usize| {
            let warped = self.warped[i];
            open.iter()
                .map(move |&j| squared_distance(&warped, &targets[j]))
        };
        let costs: Vec<f64> = left.iter().flat_map(cost).collect();
        let Ok(pairs) = linear_assignment(&costs, left.len(), open.len()) else {
            return;
        };
        for (&i, column) in left.iter().zip(pairs) {
            if let Some(column) = column {
                // The likeliest of what is left, which the soft matches do not prefer.
                (self.assignment[i], self.confidence[i]) = (Some(open[column]), 0.5);
            }
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

    /// The positions, on their targets where it `snaps`. The variance, along one axis, of what the
    /// warp alone leaves to the targets.
    fn place(&mut self, state: &State<D>, targets: &[[f64; D]], snaps: bool) -> f64 {
        self.warped.clone_from(&state.warped);
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
        self.residual = (squares / count).sqrt();
        left / (D as f64 * count)
    }
}

// How sure a pair is: the odds of the assignments that take it apart.
//
// Among noisy points a pair can be wrong in a few ways: two pairs have each other's targets, a
// point belongs to a target that is left over, a point that is left over belongs to the pair's
// target, or the pair has met by chance. With `rᵢ = tⱼ − ŷᵢ` about where the *other* points put
// point i, with the variance `σ²(1 + oᵢ)`, the evidence changes in closed form. Where i goes to a
// target that is δ away from its own,
//
// `ΔEᵢ(δ) = [δ·rᵢ + ½ |δ|²]/σ²(1 + oᵢ)`;
//
// where i and k exchange targets that are δ apart, `ΔE = ΔEᵢ(δ) + ΔE_k(−δ) + |δ|² c_ik/σ⁴` with the
// posterior covariance `c_ik` of their positions. The changes exclude each other, and
// what they share with changes elsewhere cancels to first order: the pair is right with the
// probability `1/(1 + Σ exp(−ΔE))`. Unlike the entries of the doubly stochastic matrix, which tell
// two points that may be exchanged apart by half their odds, these are shares of right pairs
// (`--example confidence`).

/// A point whose own target decides its position is not free of it altogether.
const MAX_OWN_LEVERAGE: f64 = 0.95;
/// The variance of what the other points say of it is at most so many times the noise's.
const MOST_OTHERS: f64 = MAX_OWN_LEVERAGE / (1.0 - MAX_OWN_LEVERAGE);
/// Squared residuals beyond so many variances are no partner's: one in a thousand Gaussian ones is,
/// in the plane and in space.
const MAX_SQUARED_RESIDUAL: f64 = 16.0;

/// Memory of the odds.
#[derive(Clone, Debug, Default)]
pub(super) struct PairOdds {
    /// Target of each model row.
    partners: Vec<Option<usize>>,
    /// Rows whose partner cannot be told, see 0.02.
    hopeless: Vec<bool>,
    /// Model row of each target.
    owners: Vec<Option<usize>>,
    /// Pairs of points that are left over on both sides: squared distance, rows.
    open: Vec<(f64, usize, usize)>,
    leverages: Vec<Leverage>,
    /// Sum of the odds against each pair.
    against: Vec<f64>,
}

/// What a fit with soft weights says of a point that is matched for certain.
#[derive(Clone, Copy, Debug)]
struct Leverage {
    /// Residual of the prediction by the other points over that of the fit.
    stretch: f64,
    /// Variance of where the other points put this one, over that of the noise.
    others: f64,
}

/// What pairs are judged by.
#[derive(Clone, Copy)]
struct Fitted<'a, const D: usize> {
    annealer: &'a Annealer<D>,
    warped: &'a [[f64; D]],
    targets: &'a [[f64; D]],
    /// Variance of the noise along an axis.
    variance: f64,
}

impl PairOdds {
    /// Replaces `assignment` by the likeliest one in its neighbourhood, and sets the `confidence`
    /// of every pair. That of points without a partner stays.
    fn weigh<const D: usize>(
        &mut self,
        fitted: Fitted<'_, D>,
        assignment: &mut [Option<usize>],
        confidence: &mut [f64],
    ) {
        self.take(fitted, assignment);
        self.complete(fitted);
        // Rounds of exchanges until none makes the pairs likelier: one or two are needed.
        for _ in 0..4 {
            if !self.exchange(fitted) {
                break;
            }
        }
        self.add_odds(fitted);
        for (i, partner) in assignment.iter_mut().enumerate() {
            let sure = 1.0 / (1.0 + self.against[i]);
            let wanted = if partner.is_some() {
                0.3
            } else {
                // Points that the soft matches leave without a partner get the likeliest one where
                // it is surer than this, and others keep theirs where it is surer than that.
                0.5
            };
            if self.partners[i].is_some() && sure > wanted {
                *partner = self.partners[i];
                confidence[i] = sure;
            } else if partner.take().is_some() {
                confidence[i] = 0.5; // undecided whether it has one
            }
        }
    }

    fn take<const D: usize>(&mut self, fitted: Fitted<'_, D>, assignment: &[Option<usize>]) {
        self.partners.clear();
        self.partners.extend_from_slice(assignment);
        self.hopeless.clear();
        self.hopeless
            .extend((0..self.partners.len()).map(|i| fitted.is_hopeless(i)));
        for (partner, &hopeless) in self.partners.iter_mut().zip(&self.hopeless) {
            *partner = partner.filter(|_| !hopeless);
        }
        self.owners.clear();
        self.owners.resize(fitted.targets.len(), None);
        for (i, partner) in assignment.iter().enumerate() {
            if let &Some(j) = partner {
                self.owners[j] = Some(i);
            }
        }
        let soft = &fitted.annealer.soft.moments.weight;
        let variances = &fitted.annealer.regression.variance;
        self.leverages.clear();
        self.leverages
            .extend(soft.iter().zip(variances).map(|(weight, variance)| {
                let variance = variance / fitted.variance;
                let own = (weight * variance).min(MAX_OWN_LEVERAGE);
                Leverage {
                    stretch: 1.0 / (1.0 - own),
                    others: variance / (1.0 - own),
                }
            }));
    }

    /// Pairs what is left over on both sides, nearest first: what the soft matches leave undecided
    /// mostly has a partner.
    fn complete<const D: usize>(&mut self, fitted: Fitted<'_, D>) {
        self.open.clear();
        for (i, partner) in self.partners.iter().enumerate() {
            if partner.is_some() || self.hopeless[i] {
                continue;
            }
            let others = self.leverages[i].others;
            for j in fitted.candidates(i) {
                let limit = MAX_SQUARED_RESIDUAL * fitted.variance * (1.0 + others);
                let square = squared(&fitted.offset(i, j));
                if self.owners[j].is_none() && square < limit {
                    self.open.push((square, i, j));
                }
            }
        }
        let rows = |open: &(f64, usize, usize)| (open.1, open.2);
        self.open
            .sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(rows(a).cmp(&rows(b))));
        for &(_, i, j) in &self.open {
            if self.partners[i].is_none() && self.owners[j].is_none() {
                self.partners[i] = Some(j);
                self.owners[j] = Some(i);
            }
        }
    }

    /// Makes for every point the change that makes the pairs likeliest. Whether there was any.
    fn exchange<const D: usize>(&mut self, fitted: Fitted<'_, D>) -> bool {
        let mut changed = false;
        for i in (0..self.partners.len()).filter(|&i| !self.hopeless[i]) {
            // A change counts as one for the better from this on: rounding is less.
            let mut best = (-1e-9, None);
            for j in fitted.candidates(i) {
                let change = match (self.partners[i], self.owners[j]) {
                    (Some(own), _) if own == j => continue,
                    (Some(own), None) => self.of_move(fitted, (i, own), j),
                    (Some(own), Some(k)) => self.of_exchange(fitted, (i, own), (k, j)),
                    (None, Some(k)) => self.of_takeover(fitted, i, (k, j)),
                    (None, None) => continue,
                };
                if change < best.0 {
                    best = (change, Some(j));
                }
            }
            let Some(j) = best.1 else { continue };
            changed = true;
            let (own, other) = (self.partners[i], self.owners[j]);
            (self.partners[i], self.owners[j]) = (Some(j), Some(i));
            if let Some(own) = own {
                self.owners[own] = other;
            }
            if let Some(other) = other {
                self.partners[other] = own;
            }
        }
        changed
    }

    /// Sums the odds of the changes that take each pair apart.
    fn add_odds<const D: usize>(&mut self, fitted: Fitted<'_, D>) {
        let pairs = self.partners.iter().flatten().count() as f64;
        // Half a point more on either side: none left over of a few does not exclude that one is.
        let left_model = (self.partners.len() as f64 - pairs + 0.5) / (pairs + 0.5);
        let left_target = (fitted.targets.len() as f64 - pairs + 0.5) / fitted.annealer.volume;
        let scale = left_model * left_target * (TAU * fitted.variance).powf(0.5 * D as f64);
        self.against.clear();
        self.against.resize(self.partners.len(), 0.0);
        for i in (0..self.partners.len()).filter(|&i| !self.hopeless[i]) {
            let Some(own) = self.partners[i] else {
                for j in fitted.candidates(i) {
                    if let Some(k) = self.owners[j] {
                        self.against[k] += (-self.of_takeover(fitted, i, (k, j))).exp();
                    }
                }
                continue;
            };
            let by_chance = scale * self.misfit(fitted, (i, own)).exp();
            let mut against = by_chance;
            for j in fitted.candidates(i) {
                if j == own {
                    continue;
                }
                let alone = (-self.of_move(fitted, (i, own), j)).exp();
                let Some(k) = self.owners[j] else {
                    against += alone;
                    continue;
                };
                // Either point may take the other's target and leave that one without.
                let theirs = scale * self.misfit(fitted, (k, j)).exp();
                let taken = (-self.of_move(fitted, (k, j), own)).exp();
                against += (-self.of_exchange(fitted, (i, own), (k, j))).exp()
                    + alone * theirs
                    + taken * by_chance;
            }
            self.against[i] += against;
        }
    }

    /// From where the other points put the point of a pair to its target.
    fn residual<const D: usize>(&self, fitted: Fitted<'_, D>, (i, j): (usize, usize)) -> [f64; D] {
        let stretch = self.leverages[i].stretch;
        fitted.offset(i, j).map(|c| stretch * c)
    }

    /// Variance of that, over the noise's.
    fn variance(&self, i: usize) -> f64 {
        1.0 + self.leverages[i].others.min(MOST_OTHERS)
    }

    /// Minus the logarithm of a target's density about where the others put its point, beside that
    /// of a point without noise.
    fn misfit<const D: usize>(&self, fitted: Fitted<'_, D>, pair: (usize, usize)) -> f64 {
        let variance = self.variance(pair.0);
        let square = squared(&self.residual(fitted, pair)) / (fitted.variance * variance);
        0.5 * (square.min(MAX_SQUARED_RESIDUAL) + D as f64 * variance.ln())
    }

    /// Change of the energy where point i of a pair goes to the target j.
    fn of_move<const D: usize>(
        &self,
        fitted: Fitted<'_, D>,
        (i, own): (usize, usize),
        j: usize,
    ) -> f64 {
        let step = fitted.step(own, j);
        let residual = self.residual(fitted, (i, own));
        let variance = self.variance(i) * fitted.variance;
        (dot(&step, &residual) + 0.5 * squared(&step)) / variance
    }

    /// Change of the energy where two pairs exchange their targets.
    fn of_exchange<const D: usize>(
        &self,
        fitted: Fitted<'_, D>,
        (i, own): (usize, usize),
        (k, theirs): (usize, usize),
    ) -> f64 {
        let least = self.of_move(fitted, (i, own), theirs) + self.of_move(fitted, (k, theirs), own);
        // Odds fainter than this do not count.
        if least > -1e-4_f64.ln() {
            return least; // neighbours move together, so that there is more to come
        }
        let together = fitted.annealer.regression.covariance(i, k) / fitted.variance;
        least + squared(&fitted.step(own, theirs)) * together / fitted.variance
    }

    /// Change of the energy where point i, which is left over, takes the target of a pair.
    fn of_takeover<const D: usize>(
        &self,
        fitted: Fitted<'_, D>,
        i: usize,
        (k, j): (usize, usize),
    ) -> f64 {
        let others = 1.0 + self.leverages[i].others;
        let square = squared(&fitted.offset(i, j)) / (fitted.variance * others);
        0.5 * (square + D as f64 * others.ln()) - self.misfit(fitted, (k, j))
    }
}

impl<const D: usize> Fitted<'_, D> {
    /// From where the warp puts point i to target j.
    fn offset(&self, i: usize, j: usize) -> [f64; D] {
        difference(&self.targets[j], &self.warped[i])
    }

    /// Whether point i has a partner that nothing tells from others.
    fn is_hopeless(&self, i: usize) -> bool {
        let soft = &self.annealer.soft;
        // A point whose likeliest target has less than one chance in fifty has no partner that
        // could be told: its confidence would be far below 0.3. Of large sets whose noise exceeds
        // their spacing these are nearly all points, with hundreds of candidates each.
        soft.moments.weight[i] > 0.5 && soft.entries(i).all(|(_, p)| p < 0.02)
    }

    /// Targets that point i could belong to.
    fn candidates(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        let entries = self.annealer.soft.entries(i);
        // Targets with fainter soft matches, some five standard deviations of the noise away, are
        // not looked at.
        entries.filter(|&(_, p)| p > 1e-9).map(|(j, _)| j)
    }

    /// From one target to another.
    fn step(&self, from: usize, to: usize) -> [f64; D] {
        difference(&self.targets[to], &self.targets[from])
    }
}
