//! Soft matches: the rows of the match matrix M, kept sparse.

/// The match matrix `M` without its slack row and column, in compressed rows: for every model point the target
/// points that keep some probability, and how much. What a row lacks to one is its probability of having no partner.
///
/// ```
/// use tactile_match::SoftMatches;
/// // Model point 0: target 3 or 1, or with probability 0.25 none; model point 1: none.
/// let soft: SoftMatches = [vec![(3, 0.5), (1, 0.25)], vec![]].into_iter().collect();
/// assert_eq!(soft.rows(), 2);
/// assert_eq!(1.0 - soft.row(0).map(|(_, p)| p).sum::<f64>(), 0.25);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct SoftMatches {
    starts: Vec<usize>,
    columns: Vec<usize>,
    weights: Vec<f64>,
}

impl Default for SoftMatches {
    fn default() -> Self {
        Self {
            starts: vec![0],
            columns: Vec::new(),
            weights: Vec::new(),
        }
    }
}

impl<R: IntoIterator<Item = (usize, f64)>> FromIterator<R> for SoftMatches {
    /// The matrix of these rows, each the target points of one model point with their weights.
    fn from_iter<I: IntoIterator<Item = R>>(rows: I) -> Self {
        let mut soft = Self::default();
        rows.into_iter().for_each(|row| soft.push_row(row));
        soft
    }
}

impl SoftMatches {
    /// Appends the row of the next model point.
    pub(crate) fn push_row(&mut self, row: impl IntoIterator<Item = (usize, f64)>) {
        for (column, weight) in row {
            self.columns.push(column);
            self.weights.push(weight);
        }
        self.starts.push(self.columns.len());
    }

    /// Number of rows (model points).
    #[must_use]
    pub fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// The target rows and weights of model point `row`; nothing for a row that does not exist.
    pub fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = match (self.starts.get(row), self.starts.get(row + 1)) {
            (Some(&start), Some(&end)) => start..end,
            _ => 0..0,
        };
        self.columns[range.clone()]
            .iter()
            .copied()
            .zip(self.weights[range].iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_as_pushed() {
        let rows = [vec![(3, 0.5), (1, 0.25)], vec![], vec![(0, 1.0)]];
        let soft: SoftMatches = rows.into_iter().collect();
        assert_eq!(soft.rows(), 3);
        assert_eq!(soft.row(0).collect::<Vec<_>>(), [(3, 0.5), (1, 0.25)]);
        assert_eq!(soft.row(1).count(), 0);
        assert_eq!(soft.row(2).collect::<Vec<_>>(), [(0, 1.0)]);
        assert_eq!(soft.row(3).count(), 0);
    }
}
