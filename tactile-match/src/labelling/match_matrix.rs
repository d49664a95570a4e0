//! The match matrix `M` with its slack row and column.

/// The match matrix `M` of the paper, `(I + 1) × (J + 1)`, row-major: entry `(i, j)` is the probability that model
/// point `i` is target point `j`; row `I` and column `J` are the slack for points without a partner, and the corner
/// `(I, J)` is not used.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MatchMatrix {
    rows: usize,
    columns: usize,
    entries: Vec<f64>,
}

impl MatchMatrix {
    /// All entries zero.
    #[must_use]
    pub(crate) fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            entries: vec![0.0; (rows + 1) * (columns + 1)],
        }
    }

    /// Entry by entry, `i` in `0..=rows` and `j` in `0..=columns`; the corner is set to zero.
    #[must_use]
    pub(crate) fn from_fn(
        rows: usize,
        columns: usize,
        mut entry: impl FnMut(usize, usize) -> f64,
    ) -> Self {
        let mut m = Self::zeros(rows, columns);
        for i in 0..=rows {
            for j in 0..=columns {
                if (i, j) != (rows, columns) {
                    m[(i, j)] = entry(i, j);
                }
            }
        }
        m
    }

    /// Number of model points `I`, the slack row not counted.
    #[must_use]
    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    /// Number of target points `J`, the slack column not counted.
    #[must_use]
    pub(crate) fn columns(&self) -> usize {
        self.columns
    }

    /// Row `i` with its slack entry last; `i = I` is the slack row.
    ///
    /// # Panics
    /// If `i` exceeds the number of rows.
    #[must_use]
    pub(crate) fn row(&self, i: usize) -> &[f64] {
        &self.entries[i * (self.columns + 1)..][..=self.columns]
    }

    pub(super) fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.entries[i * (self.columns + 1)..][..=self.columns]
    }

    /// Probability that model point `i` has no partner.
    ///
    /// # Panics
    /// If `i` exceeds the number of rows.
    #[must_use]
    pub(crate) fn slack_of_row(&self, i: usize) -> f64 {
        self[(i, self.columns)]
    }

    /// The largest change of an entry, `max |M − M'|`; the matrices must have the same size.
    #[must_use]
    pub(crate) fn largest_change(&self, other: &Self) -> f64 {
        self.entries
            .iter()
            .zip(&other.entries)
            .fold(0.0, |worst, (&a, &b)| worst.max((a - b).abs()))
    }
}

impl std::ops::Index<(usize, usize)> for MatchMatrix {
    type Output = f64;
    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        debug_assert!(j <= self.columns);
        &self.entries[i * (self.columns + 1) + j]
    }
}

impl std::ops::IndexMut<(usize, usize)> for MatchMatrix {
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        debug_assert!(j <= self.columns);
        &mut self.entries[i * (self.columns + 1) + j]
    }
}
