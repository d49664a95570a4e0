//! Linear assignment: which column for which row, at the least total cost.
//!
//! Given costs `c_ij` of `n` rows and `m` columns, choose distinct columns `j(i)` with `Σ c_i,j(i)` least; of a matrix that is
//! not square, `min(n, m)` rows get a column. The method is Jonker and Volgenant's (Computing 38, 325–340, 1987) in its
//! rectangular form: augmenting row reduction assigns most rows, shortest augmenting paths (Dijkstra's, on the
//! reduced costs `c_ij − u_i − v_j ≥ 0`) the rest. `O(min(n, m)² max(n, m))` at worst, on point sets close to `O(n m)`.
//!
//! The prices `u`, `v` prove the answer: `u_i + v_j ≤ c_ij`, equal on the chosen pairs; they are zero for rows and columns
//! left over. To maximise, negate the costs; to forbid a pair, let it cost `+∞`.

mod augment;

use crate::MatchError;
use augment::{NONE, Search};

/// Columns for the rows of a cost matrix (`rows × columns`, row-major) at the least total cost.
///
/// `None` for the rows left over where there are more rows than columns, or that only forbidden pairs (`+∞`) could serve; the number
/// of pairs is the largest possible. The same input gives the same answer, also among ties.
///
/// # Errors
/// [`MatchError::Shape`] if `costs` has not `rows · columns` entries, [`MatchError::Cost`] for NaN and `−∞`.
///
/// ```
/// use tactile_match::linear_assignment;
/// let costs = [
///     4.0, 1.0, 3.0, //
///     2.0, 0.0, 5.0,
/// ];
/// assert_eq!(linear_assignment(&costs, 2, 3)?, [Some(1), Some(0)]); // 1 + 2; the greedy 0 + 3 costs as much
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
pub fn linear_assignment(
    costs: &[f64],
    rows: usize,
    columns: usize,
) -> Result<Vec<Option<usize>>, MatchError> {
    let mut workspace = AssignmentWorkspace::default();
    workspace.solve(costs, rows, columns)?;
    Ok(workspace.assignment)
}

/// [`linear_assignment`] with its memory kept: no allocation once it has seen the largest matrix.
///
/// ```
/// use tactile_match::AssignmentWorkspace;
/// let mut workspace = AssignmentWorkspace::default();
/// assert_eq!(workspace.solve(&[2.0, 1.0, 1.0, 5.0], 2, 2)?, [Some(1), Some(0)]);
/// assert_eq!(workspace.row_prices.iter().chain(&workspace.column_prices).sum::<f64>(), 2.0);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Debug)]
pub struct AssignmentWorkspace {
    assignment: Vec<Option<usize>>,
    /// `u` of the last solution.
    pub row_prices: Vec<f64>,
    /// `v` of the last solution.
    pub column_prices: Vec<f64>,
    /// The matrix turned so that it is not taller than wide.
    turned: Vec<f64>,
    search: Search,
}

impl Default for AssignmentWorkspace {
    /// Without memory yet.
    fn default() -> Self {
        Self {
            assignment: Vec::new(),
            row_prices: Vec::new(),
            column_prices: Vec::new(),
            turned: Vec::new(),
            search: Search::new(),
        }
    }
}

impl AssignmentWorkspace {
    /// As [`linear_assignment`].
    ///
    /// # Errors
    /// As [`linear_assignment`].
    pub fn solve(
        &mut self,
        costs: &[f64],
        rows: usize,
        columns: usize,
    ) -> Result<&[Option<usize>], MatchError> {
        check(costs, rows, columns)?;
        self.assignment.clear();
        self.row_prices.clear();
        self.column_prices.clear();
        if rows <= columns {
            self.search.run(costs, rows, columns);
            self.assignment.extend(
                self.search
                    .column_of
                    .iter()
                    .map(|&j| (j != NONE).then_some(j)),
            );
            self.row_prices
                .extend((0..rows).map(|i| self.search.row_price(costs, i)));
            self.column_prices.extend_from_slice(&self.search.prices);
        } else {
            self.turned.clear();
            self.turned
                .extend((0..columns).flat_map(|j| (0..rows).map(move |i| costs[i * columns + j])));
            self.search.run(&self.turned, columns, rows);
            self.assignment
                .extend(self.search.row_of.iter().map(|&j| (j != NONE).then_some(j)));
            self.row_prices.extend_from_slice(&self.search.prices);
            self.column_prices
                .extend((0..columns).map(|j| self.search.row_price(&self.turned, j)));
        }
        Ok(&self.assignment)
    }
}

fn check(costs: &[f64], rows: usize, columns: usize) -> Result<(), MatchError> {
    let expected = rows.saturating_mul(columns);
    if costs.len() != expected {
        return Err(MatchError::Shape {
            what: "costs",
            expected,
            found: costs.len(),
        });
    }
    match costs.iter().position(|&c| !(c.is_finite() || c > 0.0)) {
        Some(at) => Err(MatchError::Cost {
            row: at / columns,
            column: at % columns,
        }),
        None => Ok(()),
    }
}
