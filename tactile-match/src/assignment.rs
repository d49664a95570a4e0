//! Linear assignment: pairs rows with columns at the least total cost.
//!
//! Given costs `c_ij` of `n` rows and `m` columns, choose distinct columns `j(i)` that minimise
//! `Σ c_i,j(i)`. If the matrix is not square, `min(n, m)` rows get a column. This is the method of
//! Jonker and Volgenant (Computing 38, 325–340, 1987) in its rectangular form. Augmenting row
//! reduction assigns most rows, and shortest augmenting paths (Dijkstra's algorithm on the reduced
//! costs `c_ij − u_i − v_j ≥ 0`) assign the rest. The worst case is `O(min(n, m)² max(n, m))`;
//! point sets take close to `O(n m)`.
//!
//! The prices `u`, `v` prove that the answer is optimal: `u_i + v_j ≤ c_ij`, with equality on the
//! chosen pairs. Unassigned rows and columns have price zero. To maximise, negate the costs. To
//! forbid a pair, set its cost to `+∞`.

use crate::error::all_pairs;
use crate::{MatchError, Watch};
use std::ops::ControlFlow;

/// Returns the column of each row of a cost matrix of shape `[rows, columns]` at the least total
/// cost.
///
/// `cost(i, j)` is called once for each pair, so the caller may store the matrix in any order, or
/// not at all. A row gets `None` if there are more rows than columns and it is left over, or if
/// only forbidden pairs (`+∞`) are left for it. The number of pairs is the largest possible. The
/// answer is deterministic, also among ties.
///
/// # Errors
/// [`MatchError::Cost`] for NaN and `−∞`, [`MatchError::TooManyPairs`] if the costs would take
/// more than 2 GiB.
///
/// ```
/// use tactile_match::linear_assignment;
/// let costs = [[4.0, 1.0, 3.0], [2.0, 0.0, 5.0]];
/// // 1 + 2; the greedy 0 + 3 costs as much.
/// assert_eq!(linear_assignment([2, 3], |i, j| costs[i][j])?, [Some(1), Some(0)]);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
pub fn linear_assignment(
    sizes: [usize; 2],
    cost: impl FnMut(usize, usize) -> f64,
) -> Result<Vec<Option<usize>>, MatchError> {
    assigned(sizes, cost, &mut || ControlFlow::Continue(()))
}

/// Like [`linear_assignment`]. If `watch` returns `Break`, the rows that have no column yet get
/// `None`.
pub(crate) fn assigned(
    [rows, columns]: [usize; 2],
    cost: impl FnMut(usize, usize) -> f64,
    watch: Watch<'_>,
) -> Result<Vec<Option<usize>>, MatchError> {
    let (search, _) = Search::solved([rows, columns], cost, watch)?;
    let column_of = match rows <= columns {
        true => search.column_of,
        false => search.row_of,
    };
    let assigned = column_of.iter().map(|&j| (j != NONE).then_some(j));
    Ok(assigned.collect())
}

// The search: augmenting row reduction, then shortest augmenting paths on the reduced costs.

/// Stands for "no row" or "no column".
const NONE: usize = usize::MAX;

/// State of the algorithm, for a matrix that is not taller than wide.
#[derive(Default)]
struct Search {
    column_of: Vec<usize>,
    row_of: Vec<usize>,
    /// Column prices `v`. The row prices `u` follow from them.
    prices: Vec<f64>,
    free: Vec<usize>,
    waiting: Vec<usize>,
    /// Length of the shortest path to each column, and the row before it.
    distance: Vec<f64>,
    before: Vec<usize>,
    /// Columns that the search has not settled yet, in any order, then the settled ones.
    order: Vec<usize>,
}

impl Search {
    /// The solved search and its costs by rows, transposed if there are more rows than columns.
    fn solved(
        [rows, columns]: [usize; 2],
        mut cost: impl FnMut(usize, usize) -> f64,
        watch: Watch<'_>,
    ) -> Result<(Self, Vec<f64>), MatchError> {
        all_pairs(rows, columns)?;
        let mut checked = |row, column| match cost(row, column) {
            c if c.is_finite() || c > 0.0 => Ok(c),
            _ => Err(MatchError::Cost { row, column }),
        };
        let [short, long] = [rows.min(columns), rows.max(columns)];
        let turned = rows > columns;
        let mut costs = Vec::with_capacity(short * long);
        let mut search = Self::default();
        search.start(short, long);
        for i in 0..short {
            if watch().is_break() {
                return Ok((search, costs));
            }
            for j in 0..long {
                costs.push(if turned { checked(j, i) } else { checked(i, j) }?);
            }
        }
        // A search that stops early has fewer pairs.
        let _ = search.run(&costs, long, watch);
        Ok((search, costs))
    }

    fn start(&mut self, rows: usize, columns: usize) {
        reset(&mut self.column_of, rows, NONE);
        reset(&mut self.row_of, columns, NONE);
        reset(&mut self.prices, columns, 0.0);
        reset(&mut self.distance, columns, 0.0);
        reset(&mut self.before, columns, NONE);
        self.free.clear();
        self.free.extend(0..rows);
        self.order.clear();
        self.order.extend(0..columns);
    }

    fn run(&mut self, costs: &[f64], columns: usize, watch: Watch<'_>) -> ControlFlow<()> {
        // Two passes, as published: rows that the first pass displaces often settle in the second.
        self.reduce_rows(costs, columns, watch)?;
        self.reduce_rows(costs, columns, watch)?;
        for row in std::mem::take(&mut self.free) {
            self.augment(costs, columns, row, watch)?;
        }
        ControlFlow::Continue(())
    }

    /// Augmenting row reduction: each free row takes its cheapest column and raises the bid until
    /// the second-best column costs the same.
    ///
    /// Only columns that become assigned, and stay assigned, change their price. Unassigned columns
    /// keep `v = 0`, as the rectangular problem requires.
    fn reduce_rows(&mut self, costs: &[f64], columns: usize, watch: Watch<'_>) -> ControlFlow<()> {
        self.waiting.clear();
        self.free.reverse();
        let mut bids = 8 * self.free.len(); // a price war of many steps is cheaper by augmentation
        while let Some(row) = self.free.pop() {
            watch()?;
            let (mut best, second) = two_cheapest(&costs[row * columns..][..columns], &self.prices);
            let lowered = self.prices[best.0] - (second.1 - best.1);
            let lowers = lowered.is_finite() && lowered < self.prices[best.0];
            if !best.1.is_finite() || bids == 0 {
                self.waiting.push(row);
                continue;
            }
            bids -= 1;
            if lowers {
                self.prices[best.0] = lowered;
            } else if self.row_of[best.0] != NONE {
                if !second.1.is_finite() || second.1 > best.1 {
                    self.waiting.push(row); // no other column, or none as cheap to rounding
                    continue;
                }
                best = second;
            }
            let displaced = std::mem::replace(&mut self.row_of[best.0], row);
            self.column_of[row] = best.0;
            if displaced != NONE {
                self.column_of[displaced] = NONE;
                if lowers {
                    self.free.push(displaced)
                } else {
                    self.waiting.push(displaced)
                }
            }
        }
        std::mem::swap(&mut self.free, &mut self.waiting);
        ControlFlow::Continue(())
    }

    /// Follows the shortest augmenting path from a free row. The row stays free if only forbidden
    /// pairs lead on.
    fn augment(
        &mut self,
        costs: &[f64],
        columns: usize,
        free_row: usize,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        for (j, &c) in costs[free_row * columns..][..columns].iter().enumerate() {
            self.distance[j] = c - self.prices[j];
            self.before[j] = free_row;
        }
        let mut open = columns;
        let (sink, reach) = loop {
            watch()?;
            if open == 0 {
                return ControlFlow::Continue(());
            }
            let at = self.nearest(open);
            let column = self.order[at];
            let reach = self.distance[column];
            if !reach.is_finite() {
                return ControlFlow::Continue(());
            }
            open -= 1;
            self.order.swap(at, open);
            if self.row_of[column] == NONE {
                break (column, reach);
            }
            self.relax(costs, columns, (column, reach), open);
        };
        for &column in &self.order[open..] {
            self.prices[column] += self.distance[column] - reach;
        }
        self.flip(sink, free_row);
        ControlFlow::Continue(())
    }

    /// Position in the order of the open column with the shortest path. An unassigned column wins a
    /// tie.
    fn nearest(&self, open: usize) -> usize {
        let mut best = 0;
        for at in 1..open {
            let (column, holder) = (self.order[at], self.order[best]);
            let (found, least) = (self.distance[column], self.distance[holder]);
            if found < least
                || (found == least && self.row_of[column] == NONE && self.row_of[holder] != NONE)
            {
                best = at;
            }
        }
        best
    }

    /// Updates the paths through a column that was just settled at distance `reach`, and through
    /// its row.
    fn relax(&mut self, costs: &[f64], columns: usize, (column, reach): (usize, f64), open: usize) {
        let row = self.row_of[column];
        let costs = &costs[row * columns..][..columns];
        let through = reach - (costs[column] - self.prices[column]);
        for &j in &self.order[..open] {
            let path = through + (costs[j] - self.prices[j]);
            if path < self.distance[j] {
                self.distance[j] = path;
                self.before[j] = row;
            }
        }
    }

    /// Swaps assigned and free pairs along the path that ends in `column`.
    fn flip(&mut self, mut column: usize, free_row: usize) {
        loop {
            let row = self.before[column];
            self.row_of[column] = row;
            column = std::mem::replace(&mut self.column_of[row], column);
            if row == free_row {
                return;
            }
        }
    }
}

/// The columns with the smallest and second smallest reduced cost `c − v`, and these costs. The
/// second cost is `+∞` if there is only one column.
fn two_cheapest(costs: &[f64], prices: &[f64]) -> ((usize, f64), (usize, f64)) {
    let (mut best, mut second) = ((0, f64::INFINITY), (0, f64::INFINITY));
    for (j, (&c, &v)) in costs.iter().zip(prices).enumerate() {
        let reduced = c - v;
        if reduced < second.1 {
            second = (j, reduced);
            if reduced < best.1 {
                std::mem::swap(&mut best, &mut second);
            }
        }
    }
    (best, second)
}

fn reset<V: Clone>(vector: &mut Vec<V>, len: usize, value: V) {
    vector.clear();
    vector.resize(len, value);
}

#[cfg(test)]
mod tests;
