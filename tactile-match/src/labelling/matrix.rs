//! The match matrix over candidate pairs: support (19), update (20) and normalisation.

use super::graph::{Edge, NeighbourGraph};
use crate::Watch;
use std::ops::{ControlFlow, Range};

/// The match matrix `M` of the paper, `(I + 1) × (J + 1)`: entry `(i, j)` is the probability that
/// model point `i` corresponds to target point `j`. Row `I` and column `J` are the slack for points
/// without a partner.
///
/// Only the candidate pairs and the slack are stored. All other pairs are zero, which (20)
/// preserves. A "pair" below is the position of a candidate pair in the storage.
#[derive(Clone, Debug, Default)]
pub(crate) struct MatchMatrix {
    /// First pair of each model point, and the end of the last.
    starts: Vec<usize>,
    targets: Vec<usize>,
    entries: Vec<f64>,
    row_slack: Vec<f64>,
    column_slack: Vec<f64>,
    sums: Vec<f64>,
}

impl MatchMatrix {
    /// All entries zero.
    pub(super) fn without_candidates(rows: usize, columns: usize) -> Self {
        let mut matrix = Self::default();
        matrix.reset(vec![0.0; columns]);
        (0..rows).for_each(|_| matrix.push_row([], 0.0));
        matrix
    }

    /// Removes all model points, in the memory of the last matrix, and sets the slack of the target
    /// points.
    pub(crate) fn reset(&mut self, column_slack: impl IntoIterator<Item = f64>) {
        self.starts.clear();
        self.starts.push(0);
        self.targets.clear();
        self.entries.clear();
        self.row_slack.clear();
        self.column_slack.clear();
        self.column_slack.extend(column_slack);
    }

    /// Appends a model point with its candidates and their probabilities, and its slack.
    pub(crate) fn push_row(&mut self, row: impl IntoIterator<Item = (usize, f64)>, slack: f64) {
        for (target, probability) in row {
            self.targets.push(target);
            self.entries.push(probability);
        }
        self.starts.push(self.targets.len());
        self.row_slack.push(slack);
    }

    /// Number of model points.
    pub(crate) fn rows(&self) -> usize {
        self.row_slack.len()
    }

    /// Candidates of model point `i` with their probabilities.
    pub(crate) fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        self.pairs(i).map(|e| (self.targets[e], self.entries[e]))
    }

    /// Probability that model point `i` has no partner.
    pub(crate) fn slack(&self, i: usize) -> f64 {
        self.row_slack[i]
    }

    /// Probability of a pair.
    pub(super) fn probability(&self, pair: usize) -> f64 {
        self.entries[pair]
    }

    fn pairs(&self, i: usize) -> Range<usize> {
        self.starts[i]..self.starts[i + 1]
    }

    /// Keeps the `count` likeliest candidates of each model point. Among equal ones the lower rows
    /// are kept.
    pub(super) fn keep_likeliest(&mut self, count: usize) {
        let whole = std::mem::take(self);
        self.reset(whole.column_slack.iter().copied());
        for i in 0..whole.rows() {
            let mut row: Vec<_> = whole.row(i).collect();
            row.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            row.truncate(count);
            row.sort_unstable_by_key(|candidate| candidate.0);
            self.push_row(row, whole.slack(i));
        }
    }

    /// The support (19) of all pairs, from that of single ones, `of(i, pair)`.
    ///
    /// Once a candidate has the whole row and no other can recover (all others are below a hundred
    /// roundings), the support of the others is zero.
    pub(crate) fn support(
        &self,
        support: &mut Vec<f64>,
        mut of: impl FnMut(usize, usize) -> f64,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        support.clear();
        for i in 0..self.rows() {
            watch()?;
            let row = &self.entries[self.pairs(i)];
            let enough = (row.iter().sum::<f64>() + self.slack(i)) * (1.0 - 50.0 * f64::EPSILON);
            let settled = row.iter().position(|&p| p > 0.0 && p >= enough);
            support.extend(self.pairs(i).enumerate().map(|(k, pair)| match settled {
                Some(on) if on != k => 0.0,
                _ => of(i, pair),
            }));
        }
        ControlFlow::Continue(())
    }

    /// Update (20): each model row becomes `[M_ij S_ij, M_i,slack · slack_gain]` divided by its
    /// sum. A row without support is not changed.
    ///
    /// Entries and support are divided by their largest in the row first, so that their products
    /// neither underflow nor overflow.
    pub(crate) fn update(&mut self, support: &[f64], slack_gain: f64) {
        assert_eq!(support.len(), self.entries.len(), "size of the support");
        for i in 0..self.rows() {
            let pairs = self.pairs(i);
            let (row, support) = (&mut self.entries[pairs.clone()], &support[pairs]);
            let largest = |values: &[f64], last: f64| values.iter().fold(last, |m, &v| m.max(v));
            let (most, gain) = (
                largest(row, self.row_slack[i]),
                largest(support, slack_gain),
            );
            let product = |p: f64, s: f64| (p / most) * (s / gain);
            let products = row.iter().zip(support).map(|(&p, &s)| product(p, s));
            let slack = product(self.row_slack[i], slack_gain);
            let sum = products.sum::<f64>() + slack;
            // NaN if the row has no entry or no support.
            if sum > 0.0 {
                for (p, &s) in row.iter_mut().zip(support) {
                    *p = product(*p, s) / sum;
                }
                self.row_slack[i] = slack / sum;
            }
        }
    }

    /// One sweep of Sinkhorn's alternating normalisation: divides the rows `0..I` by their sums over
    /// `J + 1` entries, then the columns `0..J` by their sums over `I + 1` entries. The slack row
    /// and column are not normalised, and sums of zero are skipped.
    pub(crate) fn normalise(&mut self) {
        let or_one = |sum: f64| if sum > 0.0 { sum } else { 1.0 };
        self.sums.clone_from(&self.column_slack);
        for i in 0..self.rows() {
            let pairs = self.pairs(i);
            let sum = or_one(self.entries[pairs.clone()].iter().sum::<f64>() + self.row_slack[i]);
            for e in pairs {
                self.entries[e] /= sum;
                self.sums[self.targets[e]] += self.entries[e];
            }
            self.row_slack[i] /= sum;
        }
        self.sums.iter_mut().for_each(|sum| *sum = or_one(*sum));
        for (p, &j) in self.entries.iter_mut().zip(&self.targets) {
            *p /= self.sums[j];
        }
        for (slack, sum) in self.column_slack.iter_mut().zip(&self.sums) {
            *slack /= sum;
        }
    }

    /// Whether every model point is decided: one candidate, or the slack, has a probability of at
    /// least `certainty`.
    pub(crate) fn is_settled(&self, certainty: f64) -> bool {
        let surest = |i| self.row(i).fold(self.slack(i), |m, (_, p)| m.max(p));
        (0..self.rows()).all(|i| surest(i) >= certainty)
    }

    /// All entries: those of the pairs, of the slack column and of the slack row.
    pub(super) fn all_entries(&self) -> impl Iterator<Item = f64> + '_ {
        let slack = self.row_slack.iter().chain(&self.column_slack);
        self.entries.iter().chain(slack).copied()
    }

    /// The largest change of an entry, `max |M − M'|`, between matrices of the same candidates.
    pub(super) fn largest_change(&self, other: &Self) -> f64 {
        let (ours, others) = (self.all_entries(), other.all_entries());
        let changes = ours.zip(others).map(|(a, b)| (a - b).abs());
        changes.fold(0.0, f64::max)
    }

    /// The support (19) of one pair, `S_ij = Σ_{a∈N(i)} Σ_{b∈N(j)} M_ab r(ia, jb)`.
    pub(super) fn support_of<const D: usize>(
        &self,
        neighbours: &[Edge<D>],
        pair: usize,
        compatibility: &impl Fn(&Edge<D>, usize, usize) -> f64,
    ) -> f64 {
        let mut sum = 0.0;
        self.supporters(neighbours, self.targets[pair], compatibility, |from, r| {
            sum += self.entries[from] * r;
        });
        sum
    }

    /// Calls `take(pair, compatibility)` with the pairs `(a, b)` that support pair `(i, j)`: those
    /// of its `neighbours` a with a compatibility above zero.
    pub(super) fn supporters<const D: usize>(
        &self,
        neighbours: &[Edge<D>],
        j: usize,
        compatibility: &impl Fn(&Edge<D>, usize, usize) -> f64,
        mut take: impl FnMut(usize, f64),
    ) {
        for edge in neighbours {
            for pair in self.pairs(edge.to) {
                let weight = compatibility(edge, j, self.targets[pair]);
                if weight > 0.0 {
                    take(pair, weight);
                }
            }
        }
    }
}

/// The terms of the support (19). The contribution of pair `(a, b)` to pair `(i, j)` does not
/// depend on M: these links are computed once, and a sweep costs one multiplication per link
/// instead of `O(I J A B)`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Links {
    /// First link of each pair, and the end of the last.
    starts: Vec<usize>,
    from: Vec<u32>,
    weights: Vec<f64>,
}

impl Links {
    /// Computes the links of all pairs of `m`, in the memory of the last ones, from
    /// `compatibility(edge of the model, j, b)`.
    pub(crate) fn build<const D: usize>(
        &mut self,
        m: &MatchMatrix,
        model: &NeighbourGraph<D>,
        compatibility: impl Fn(&Edge<D>, usize, usize) -> f64,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        self.starts.clear();
        self.from.clear();
        self.weights.clear();
        self.starts.push(0);
        for i in 0..m.rows() {
            watch()?;
            for (j, _) in m.row(i) {
                m.supporters(model.of(i), j, &compatibility, |pair, weight| {
                    self.from.push(pair as u32);
                    self.weights.push(weight);
                });
                self.starts.push(self.from.len());
            }
        }
        ControlFlow::Continue(())
    }

    /// The support of `pair`.
    pub(crate) fn support(&self, m: &MatchMatrix, pair: usize) -> f64 {
        let range = self.starts[pair]..self.starts[pair + 1];
        let terms = self.from[range.clone()].iter().zip(&self.weights[range]);
        terms.map(|(&from, w)| w * m.entries[from as usize]).sum()
    }
}

#[cfg(test)]
mod tests;
