//! Confidence of a pair: the odds of the assignments that break it.
//!
//! Among noisy points a pair can be wrong in a few ways: two pairs have swapped targets, the point
//! belongs to an unpaired target, an unpaired point belongs to the pair's target, or the pair is a
//! coincidence. Let `rᵢ = tⱼ − ŷᵢ` be the residual from the prediction of point i by the *other*
//! points, with the variance `σ²(1 + oᵢ)`. Then the evidence changes in closed form. If i moves to a
//! target at the offset δ from its own,
//!
//! `ΔEᵢ(δ) = [δ·rᵢ + ½ |δ|²]/σ²(1 + oᵢ)`;
//!
//! if i and k exchange targets at the offset δ, `ΔE = ΔEᵢ(δ) + ΔE_k(−δ) + |δ|² c_ik/σ⁴` with the
//! posterior covariance `c_ik` of their positions. The changes exclude each other, and their
//! correlation with changes elsewhere cancels to first order. The pair is therefore correct with the
//! probability `1/(1 + Σ exp(−ΔE))`. In the doubly stochastic matrix, the log-odds of two points
//! that may be exchanged are only half as large; these probabilities are calibrated fractions of
//! correct pairs (`--example confidence`).

use super::problem::Problem;
use super::run::Annealer;
use super::{difference, dot, squared};
use std::f64::consts::TAU;

/// Upper limit of the leverage: even a point that determines its own position keeps some freedom.
const MAX_OWN_LEVERAGE: f64 = 0.95;
/// Maximum variance of the prediction by the other points, relative to the noise variance.
const MOST_OTHERS: f64 = MAX_OWN_LEVERAGE / (1.0 - MAX_OWN_LEVERAGE);
/// A pair is rejected if its squared residual exceeds this number of variances. By chance one
/// Gaussian residual in a thousand does, in the plane and in space.
const MAX_SQUARED_RESIDUAL: f64 = 16.0;

/// Working memory of the odds.
#[derive(Clone, Debug, Default)]
pub(super) struct PairOdds {
    /// Target of each model row.
    partners: Vec<Option<usize>>,
    /// Rows whose partner cannot be determined, see [`Self::is_hopeless`].
    hopeless: Vec<bool>,
    /// Model row of each target.
    owners: Vec<Option<usize>>,
    /// Pairs of points unpaired on both sides: squared distance and rows.
    open: Vec<(f64, usize, usize)>,
    leverages: Vec<Leverage>,
    /// Sum of the odds against each pair.
    against: Vec<f64>,
}

/// Leverage of a point with a certain match, derived from a fit with soft weights.
#[derive(Clone, Copy, Debug)]
struct Leverage {
    /// Residual of the prediction by the other points, over the residual of the fit.
    stretch: f64,
    /// Variance of the prediction by the other points, over the noise variance.
    others: f64,
}

/// The fit by which pairs are judged.
#[derive(Clone, Copy)]
pub(super) struct Fitted<'a, const D: usize> {
    pub problem: &'a Problem<D>,
    pub annealer: &'a Annealer<D>,
    pub warped: &'a [[f64; D]],
    /// Variance of the noise along an axis.
    pub variance: f64,
}

impl PairOdds {
    /// Replaces `assignment` by the likeliest one in its neighbourhood, and sets the `confidence`
    /// of each pair. The confidence of points without a partner is not changed.
    pub(super) fn weigh<const D: usize>(
        &mut self,
        fitted: Fitted<'_, D>,
        assignment: &mut [Option<usize>],
        confidence: &mut [f64],
    ) {
        self.take(fitted, assignment);
        self.complete(fitted);
        // Repeat the exchanges until none increases the likelihood: one or two rounds are enough.
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
                // Points without a partner in the soft matches get the likeliest one if its
                // probability is above this; the others keep theirs if it is above this.
                0.5
            };
            if self.partners[i].is_some() && sure > wanted {
                *partner = self.partners[i];
                confidence[i] = sure;
            } else if partner.take().is_some() {
                confidence[i] = 0.5; // it is undecided whether the point has a partner
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
        self.owners.resize(fitted.problem.target.len(), None);
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

    /// Pairs the points unpaired on both sides, nearest first: most points that the soft matches
    /// leave undecided have a partner.
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

    /// Makes for each point the change that raises the likelihood most. Returns whether any change
    /// was made.
    fn exchange<const D: usize>(&mut self, fitted: Fitted<'_, D>) -> bool {
        let mut changed = false;
        for i in (0..self.partners.len()).filter(|&i| !self.hopeless[i]) {
            // A change must improve the energy by more than this, which is above rounding.
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

    /// Sums the odds of the changes that break each pair.
    fn add_odds<const D: usize>(&mut self, fitted: Fitted<'_, D>) {
        let pairs = self.partners.iter().flatten().count() as f64;
        // Half a point is added to both counts. If none of a few points is unpaired, an unpaired
        // point is still possible.
        let left_model = (self.partners.len() as f64 - pairs + 0.5) / (pairs + 0.5);
        let left_target =
            (fitted.problem.target.len() as f64 - pairs + 0.5) / fitted.problem.volume;
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
                // Either point may take the other's target and leave the other without one.
                let theirs = scale * self.misfit(fitted, (k, j)).exp();
                let taken = (-self.of_move(fitted, (k, j), own)).exp();
                against += (-self.of_exchange(fitted, (i, own), (k, j))).exp()
                    + alone * theirs
                    + taken * by_chance;
            }
            self.against[i] += against;
        }
    }

    /// Offset of a pair's target from the prediction of its point by the other points.
    fn residual<const D: usize>(&self, fitted: Fitted<'_, D>, (i, j): (usize, usize)) -> [f64; D] {
        let stretch = self.leverages[i].stretch;
        fitted.offset(i, j).map(|c| stretch * c)
    }

    /// Variance of [`residual`](Self::residual), over the noise variance.
    fn variance(&self, i: usize) -> f64 {
        1.0 + self.leverages[i].others.min(MOST_OTHERS)
    }

    /// Negative log-density of a target about the prediction of its point by the others, relative
    /// to that of a point without noise.
    fn misfit<const D: usize>(&self, fitted: Fitted<'_, D>, pair: (usize, usize)) -> f64 {
        let variance = self.variance(pair.0);
        let square = squared(&self.residual(fitted, pair)) / (fitted.variance * variance);
        0.5 * (square.min(MAX_SQUARED_RESIDUAL) + D as f64 * variance.ln())
    }

    /// Change of the energy if point i of a pair moves to target j.
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

    /// Change of the energy if two pairs exchange their targets.
    fn of_exchange<const D: usize>(
        &self,
        fitted: Fitted<'_, D>,
        (i, own): (usize, usize),
        (k, theirs): (usize, usize),
    ) -> f64 {
        let least = self.of_move(fitted, (i, own), theirs) + self.of_move(fitted, (k, theirs), own);
        // Odds below this are negligible.
        if least > -1e-4_f64.ln() {
            return least; // neighbours move together, which can only add to the change
        }
        let together = fitted.annealer.regression.covariance(i, k) / fitted.variance;
        least + squared(&fitted.step(own, theirs)) * together / fitted.variance
    }

    /// Change of the energy if the unpaired point i takes the target of a pair.
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
    /// Offset of target j from the warped position of point i.
    fn offset(&self, i: usize, j: usize) -> [f64; D] {
        difference(&self.problem.target[j], &self.warped[i])
    }

    /// Whether no candidate of point i stands out from the others.
    fn is_hopeless(&self, i: usize) -> bool {
        let soft = &self.annealer.soft;
        // If the likeliest target of a point has a probability below 0.02, its partner cannot be
        // determined: the confidence would be far below 0.3. In large sets whose noise exceeds
        // their spacing, this holds for nearly all points, with hundreds of candidates each.
        soft.moments.weight[i] > 0.5 && soft.entries(i).all(|(_, p)| p < 0.02)
    }

    /// Candidate targets of point i.
    fn candidates(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        let entries = self.annealer.soft.entries(i);
        // Targets with smaller soft matches, about five standard deviations of the noise away, are
        // skipped.
        entries.filter(|&(_, p)| p > 1e-9).map(|(j, _)| j)
    }

    /// Offset from one target to another.
    fn step(&self, from: usize, to: usize) -> [f64; D] {
        difference(&self.problem.target[to], &self.problem.target[from])
    }
}
