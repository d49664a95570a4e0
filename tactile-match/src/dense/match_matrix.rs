//! The match matrix `M` with its slack row and column.

use nalgebra::RealField;

/// The match matrix `M` of the paper, `(I + 1) × (J + 1)`, row-major: entry `(i, j)` is the probability that model
/// point `i` is target point `j`; row `I` and column `J` are the slack for points without a partner, and the corner
/// `(I, J)` is not used.
///
/// ```
/// use tactile_match::dense::MatchMatrix;
/// let mut m = MatchMatrix::uniform(2, 3);
/// m[(0, 1)] = 0.5;
/// assert_eq!(m.slack_of_row(0), 0.25);
/// assert_eq!((m.rows(), m.columns()), (2, 3));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MatchMatrix<T> {
    rows: usize,
    columns: usize,
    entries: Vec<T>,
}

impl<T: RealField + Copy> MatchMatrix<T> {
    /// All entries nought.
    #[must_use]
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            entries: vec![T::zero(); (rows + 1) * (columns + 1)],
        }
    }

    /// Every row uniform over the targets and the slack, `1/(J + 1)`; the slack row `1/(I + 1)`.
    #[must_use]
    pub fn uniform(rows: usize, columns: usize) -> Self {
        let share = |n: usize| T::one() / nalgebra::convert((n + 1) as f64);
        Self::from_fn(rows, columns, |i, _| {
            if i < rows {
                share(columns)
            } else {
                share(rows)
            }
        })
    }

    /// Entry by entry, `i` in `0..=rows` and `j` in `0..=columns`; the corner is set to nought.
    #[must_use]
    pub fn from_fn(rows: usize, columns: usize, mut entry: impl FnMut(usize, usize) -> T) -> Self {
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
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of target points `J`, the slack column not counted.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Row `i` with its slack entry last; `i = I` is the slack row.
    ///
    /// # Panics
    /// If `i` exceeds the number of rows.
    #[must_use]
    pub fn row(&self, i: usize) -> &[T] {
        &self.entries[i * (self.columns + 1)..][..=self.columns]
    }

    pub(super) fn row_mut(&mut self, i: usize) -> &mut [T] {
        &mut self.entries[i * (self.columns + 1)..][..=self.columns]
    }

    /// Probability that model point `i` has no partner.
    ///
    /// # Panics
    /// If `i` exceeds the number of rows.
    #[must_use]
    pub fn slack_of_row(&self, i: usize) -> T {
        self[(i, self.columns)]
    }

    /// Probability that target point `j` has no partner.
    ///
    /// # Panics
    /// If `j` exceeds the number of columns.
    #[must_use]
    pub fn slack_of_column(&self, j: usize) -> T {
        self[(self.rows, j)]
    }

    /// The largest change of an entry, `max |M − M'|`; the matrices must have the same size.
    ///
    /// ```
    /// use tactile_match::dense::MatchMatrix;
    /// let m = MatchMatrix::from_fn(2, 2, |i, j| if i == j { 0.75 } else { 0.125 });
    /// assert_eq!(m.row(0), [0.75, 0.125, 0.125]); // the slack last
    /// assert_eq!((m.slack_of_column(1), m[(2, 2)]), (0.125, 0.0)); // the corner is not used
    /// assert_eq!(m.largest_change(&MatchMatrix::zeros(2, 2)), 0.75);
    /// ```
    #[must_use]
    pub fn largest_change(&self, other: &Self) -> T {
        self.entries
            .iter()
            .zip(&other.entries)
            .fold(T::zero(), |worst, (&a, &b)| worst.max((a - b).abs()))
    }
}

impl<T> std::ops::Index<(usize, usize)> for MatchMatrix<T> {
    type Output = T;
    fn index(&self, (i, j): (usize, usize)) -> &T {
        debug_assert!(j <= self.columns);
        &self.entries[i * (self.columns + 1) + j]
    }
}

impl<T> std::ops::IndexMut<(usize, usize)> for MatchMatrix<T> {
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut T {
        debug_assert!(j <= self.columns);
        &mut self.entries[i * (self.columns + 1) + j]
    }
}
