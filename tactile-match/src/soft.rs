//! Soft matches: the rows of the match matrix M, kept sparse.

/// The match matrix `M` without its slack row and column, in compressed rows: for every model point the target
/// points that keep some probability, and how much. What a row lacks to one is its probability of having no partner.
///
/// ```
/// use tactile_match::SoftMatches;
/// let mut soft = SoftMatches::new();
/// soft.push_row([(3, 0.5), (1, 0.25)]); // model point 0: target 3 or 1, or with probability 0.25 none
/// soft.push_row([]);
/// assert_eq!((soft.rows(), soft.entries()), (2, 2));
/// assert_eq!(1.0 - soft.row(0).map(|(_, p)| p).sum::<f64>(), 0.25);
/// soft.clear();
/// assert_eq!(soft.rows(), 0);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct SoftMatches<T> {
    starts: Vec<usize>,
    columns: Vec<usize>,
    weights: Vec<T>,
}

impl<T> Default for SoftMatches<T> {
    fn default() -> Self {
        Self {
            starts: vec![0],
            columns: Vec::new(),
            weights: Vec::new(),
        }
    }
}

impl<T: Copy> SoftMatches<T> {
    /// A matrix without rows.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Forgets all rows; keeps the memory.
    pub fn clear(&mut self) {
        self.starts.truncate(1);
        self.columns.clear();
        self.weights.clear();
    }

    /// Appends the row of the next model point.
    pub fn push_row(&mut self, row: impl IntoIterator<Item = (usize, T)>) {
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

    /// Number of stored entries.
    #[must_use]
    pub fn entries(&self) -> usize {
        self.columns.len()
    }

    /// The target rows and weights of model point `row`; nothing for a row that does not exist.
    pub fn row(&self, row: usize) -> impl Iterator<Item = (usize, T)> + '_ {
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
        let mut soft = SoftMatches::new();
        soft.push_row([(3, 0.5), (1, 0.25)]);
        soft.push_row([]);
        soft.push_row([(0, 1.0)]);
        assert_eq!((soft.rows(), soft.entries()), (3, 3));
        assert_eq!(soft.row(0).collect::<Vec<_>>(), [(3, 0.5), (1, 0.25)]);
        assert_eq!(soft.row(1).count(), 0);
        assert_eq!(soft.row(2).collect::<Vec<_>>(), [(0, 1.0)]);
        assert_eq!(soft.row(3).count(), 0);
        soft.clear();
        assert_eq!((soft.rows(), soft.entries()), (0, 0));
    }
}
