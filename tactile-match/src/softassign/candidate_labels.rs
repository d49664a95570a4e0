//! Relaxation labelling over candidates: the paper's update (19)–(20) as a sparse matrix–vector product.
//!
//! Only some pairs `(i, j)` are candidates; the match matrix is kept for those and for the slack. What pair `(a, b)`
//! says for pair `(i, j)` does not depend on M: these links are computed once, and a sweep costs one multiplication a link
//! instead of `O(I J A B)`. With all pairs as candidates the numbers are those of [`labelling`](crate::labelling).

/// The match matrix over candidate pairs, with the links between them.
#[derive(Clone, Debug, Default)]
pub(crate) struct CandidateLabels {
    starts: Vec<usize>,
    columns: Vec<usize>,
    entries: Vec<f64>,
    row_slack: Vec<f64>,
    column_slack: Vec<f64>,
    link_starts: Vec<usize>,
    link_from: Vec<u32>,
    link_weight: Vec<f64>,
    support: Vec<f64>,
    sums: Vec<f64>,
}

impl CandidateLabels {
    /// Uniform probabilities over the candidates of each model point and its slack, whose share is `slack`; the slack of
    /// every target point is the same. Target rows run to `targets`.
    ///
    /// # Panics
    /// If a candidate is not below `targets`.
    #[cfg(test)]
    pub(crate) fn new(
        targets: usize,
        candidates: impl IntoIterator<Item = Vec<usize>>,
        slack: f64,
    ) -> Self {
        let mut this = Self {
            starts: vec![0],
            column_slack: vec![slack; targets],
            ..Self::default()
        };
        for row in candidates {
            let share = (1.0 - slack) / row.len().max(1) as f64;
            this.push_row(row.into_iter().map(|j| (j, share)), slack);
        }
        this
    }

    /// Forgets everything but the memory.
    pub(crate) fn reset(&mut self, targets: usize, slack: f64) {
        self.starts.clear();
        self.starts.push(0);
        self.columns.clear();
        self.entries.clear();
        self.row_slack.clear();
        self.column_slack.clear();
        self.column_slack.resize(targets, slack);
    }

    /// Appends a model point with its candidates.
    pub(crate) fn push_row(&mut self, row: impl Iterator<Item = (usize, f64)>, slack: f64) {
        for (column, probability) in row {
            assert!(
                column < self.column_slack.len(),
                "candidate beyond the targets"
            );
            self.columns.push(column);
            self.entries.push(probability);
        }
        self.starts.push(self.columns.len());
        self.row_slack.push(slack);
    }

    /// Computes the links: `weight((i, j), (a, b))` for the points `a` of `neighbours(i)` and their candidates; zeros
    /// are left out.
    pub(crate) fn link<N: AsRef<[usize]>>(
        &mut self,
        mut weight: impl FnMut((usize, usize), (usize, usize)) -> f64,
        mut neighbours: impl FnMut(usize) -> N,
    ) {
        self.link_starts.clear();
        self.link_from.clear();
        self.link_weight.clear();
        self.link_starts.push(0);
        for i in 0..self.rows() {
            let near = neighbours(i);
            for e in self.starts[i]..self.starts[i + 1] {
                for &a in near.as_ref() {
                    for f in self.starts[a]..self.starts[a + 1] {
                        let w = weight((i, self.columns[e]), (a, self.columns[f]));
                        if w > 0.0 {
                            self.link_from.push(f as u32);
                            self.link_weight.push(w);
                        }
                    }
                }
                self.link_starts.push(self.link_from.len());
            }
        }
    }

    /// Number of model points.
    #[must_use]
    pub(crate) fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// Candidates of model point `i` with their probabilities.
    pub(crate) fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[i]..self.starts[i + 1];
        self.columns[range.clone()]
            .iter()
            .copied()
            .zip(self.entries[range].iter().copied())
    }

    /// `M_ij`; zero for a pair that is no candidate.
    #[cfg(test)]
    pub(crate) fn probability(&self, i: usize, j: usize) -> f64 {
        self.row(i)
            .find(|&(column, _)| column == j)
            .map_or(0.0, |(_, p)| p)
    }

    /// Probability that model point `i` has no partner.
    #[cfg(test)]
    pub(crate) fn slack_of_row(&self, i: usize) -> f64 {
        self.row_slack[i]
    }

    /// One sweep: support (19), update (20) with the constant `slack_gain` for the slack, and `normalisations` of rows and
    /// columns in turn.
    pub(crate) fn sweep(&mut self, slack_gain: f64, normalisations: usize) {
        self.support.clear();
        for links in self.link_starts.windows(2) {
            let range = links[0]..links[1];
            let pairs = self.link_from[range.clone()]
                .iter()
                .zip(&self.link_weight[range]);
            self.support
                .push(pairs.map(|(&f, w)| w * self.entries[f as usize]).sum());
        }
        for i in 0..self.rows() {
            let range = self.starts[i]..self.starts[i + 1];
            let gains = self.entries[range.clone()]
                .iter()
                .zip(&self.support[range.clone()]);
            let total = gains.map(|(p, s)| p * s).sum::<f64>() + self.row_slack[i] * slack_gain;
            if total > 0.0 {
                for e in range {
                    self.entries[e] *= self.support[e] / total;
                }
                self.row_slack[i] *= slack_gain / total;
            }
        }
        (0..normalisations).for_each(|_| self.normalise());
    }

    /// Whether every model point is decided: one candidate, or the slack, has at least `certainty`.
    #[must_use]
    pub(crate) fn is_settled(&self, certainty: f64) -> bool {
        (0..self.rows()).all(|i| {
            self.row(i)
                .map(|(_, p)| p)
                .fold(self.row_slack[i], f64::max)
                >= certainty
        })
    }

    fn normalise(&mut self) {
        self.sums.clear();
        self.sums.extend_from_slice(&self.column_slack);
        for i in 0..self.rows() {
            let range = self.starts[i]..self.starts[i + 1];
            let sum = self.entries[range.clone()].iter().sum::<f64>() + self.row_slack[i];
            for e in range {
                self.entries[e] /= if sum > 0.0 { sum } else { 1.0 };
                self.sums[self.columns[e]] += self.entries[e];
            }
            self.row_slack[i] /= if sum > 0.0 { sum } else { 1.0 };
        }
        self.entries
            .iter_mut()
            .zip(&self.columns)
            .for_each(|(p, &j)| {
                *p /= if self.sums[j] > 0.0 {
                    self.sums[j]
                } else {
                    1.0
                };
            });
        self.column_slack
            .iter_mut()
            .zip(&self.sums)
            .for_each(|(s, &sum)| *s /= if sum > 0.0 { sum } else { 1.0 });
    }
}

#[cfg(test)]
#[path = "candidate_labels_tests.rs"]
mod tests;
