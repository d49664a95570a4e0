//! Linear assignment compared with brute force, and checked by the conditions of optimality.

use proptest::prelude::*;

use super::{NONE, Search, linear_assignment};
use crate::MatchError;
use std::ops::ControlFlow;

fn assigned(costs: &[f64], rows: usize, columns: usize) -> Result<Vec<Option<usize>>, MatchError> {
    linear_assignment([rows, columns], |i, j| costs[i * columns + j])
}

fn total(costs: &[f64], columns: usize, assignment: &[Option<usize>]) -> f64 {
    assignment
        .iter()
        .enumerate()
        .filter_map(|(i, j)| j.map(|j| costs[i * columns + j]))
        .sum()
}

/// Tries every row with every remaining column, recursively. Returns (pairs, cost) with the most
/// pairs and, among these, the least cost.
fn brute_force(
    costs: &[f64],
    rows: usize,
    columns: usize,
    row: usize,
    taken: &mut Vec<bool>,
) -> (usize, f64) {
    if row == rows {
        return (0, 0.0);
    }
    let mut best = brute_force(costs, rows, columns, row + 1, taken);
    for j in 0..columns {
        let cost = costs[row * columns + j];
        if !taken[j] && cost.is_finite() {
            taken[j] = true;
            let rest = brute_force(costs, rows, columns, row + 1, taken);
            taken[j] = false;
            let found = (rest.0 + 1, rest.1 + cost);
            if found.0 > best.0 || (found.0 == best.0 && found.1 < best.1) {
                best = found;
            }
        }
    }
    best
}

fn assert_distinct(assignment: &[Option<usize>], columns: usize) {
    let mut taken = vec![false; columns];
    for &j in assignment.iter().flatten() {
        assert!(!std::mem::replace(&mut taken[j], true), "column {j} twice");
    }
}

/// The conditions are sufficient for optimality: `u_i + v_j <= c_ij` with equality for the chosen
/// pairs, no positive price on the longer side, and no price on a remaining column. Rounding: a
/// price is a sum of up to `rows + columns` costs.
fn assert_optimal(search: &Search, costs: &[f64]) {
    let (rows, columns) = (search.column_of.len(), search.row_of.len());
    let scale = costs.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let tolerance = f64::EPSILON * scale * (8 * (rows + columns)) as f64;
    let v = &search.prices;
    for (row, &column) in costs.chunks(columns).zip(&search.column_of) {
        let u = row[column] - v[column];
        for (j, cost) in row.iter().enumerate() {
            let reduced = cost - u - v[j];
            assert!(
                reduced >= -tolerance,
                "column {j} is cheaper by {reduced:e}"
            );
        }
    }
    for (j, _) in search
        .row_of
        .iter()
        .enumerate()
        .filter(|(_, i)| **i == NONE)
    {
        assert_eq!(v[j], 0.0, "a column left over has no price");
    }
    assert!(rows == columns || v.iter().all(|&p| p <= 0.0));
}

fn matrix(
    side: std::ops::RangeInclusive<usize>,
) -> impl Strategy<Value = (usize, usize, Vec<f64>)> {
    // Few distinct values produce ties, many do not.
    let entry = prop_oneof![(0..4_i32).prop_map(f64::from), -1e3..1e3_f64];
    (side.clone(), side).prop_flat_map(move |(n, m)| {
        (
            Just(n),
            Just(m),
            prop::collection::vec(entry.clone(), n * m),
        )
    })
}

proptest! {
    #[test]
    fn prices_prove_the_least_cost((rows, columns, costs) in matrix(1..=40)) {
        let found = assigned(&costs, rows, columns).unwrap();
        assert_distinct(&found, columns);
        prop_assert_eq!(found.iter().flatten().count(), rows.min(columns));
        let (search, costs) = Search::solved([rows, columns], |i, j| costs[i * columns + j], &mut || ControlFlow::Continue(())).unwrap();
        assert_optimal(&search, &costs);
    }

    #[test]
    fn forbidden_pairs_are_never_chosen_and_the_most_pairs_are_found(
        (rows, columns, costs) in matrix(1..=6), forbidden in prop::collection::vec(any::<bool>(), 36)
    ) {
        let costs: Vec<f64> = costs.iter().zip(forbidden).map(|(&c, no)| if no { f64::INFINITY } else { c }).collect();
        let found = assigned(&costs, rows, columns).unwrap();
        assert_distinct(&found, columns);
        prop_assert!(total(&costs, columns, &found).is_finite());
        let (pairs, _) = brute_force(&costs, rows, columns, 0, &mut vec![false; columns]);
        prop_assert_eq!(found.iter().flatten().count(), pairs);
    }

    #[test]
    fn forbidden_pairs_leave_the_least_cost((n, costs, forbidden) in (1..=6_usize).prop_flat_map(|n| (
        Just(n), prop::collection::vec(0.0..1.0_f64, n * n), prop::collection::vec(prop::bool::weighted(0.4), n * n)))
    ) {
        // The diagonal stays allowed, so that every row can be assigned and the minimum cost is
        // defined.
        let costs: Vec<f64> = (0..n * n).map(|k| if forbidden[k] && k % (n + 1) != 0 { f64::INFINITY } else { costs[k] }).collect();
        let found = assigned(&costs, n, n).unwrap();
        let (pairs, cost) = brute_force(&costs, n, n, 0, &mut vec![false; n]);
        prop_assert_eq!(pairs, n);
        prop_assert!((total(&costs, n, &found) - cost).abs() <= 1e-12);
    }

    #[test]
    fn shifting_rows_and_columns_of_a_square_keeps_the_answer((n, costs) in (1..=12_usize).prop_flat_map(|n|
        (Just(n), prop::collection::vec(0.0..1.0_f64, n * n)))
    ) {
        let shifted: Vec<f64> = (0..n * n).map(|k| costs[k] + (k / n) as f64 - 3.0 * (k % n) as f64).collect();
        prop_assert_eq!(assigned(&costs, n, n).unwrap(), assigned(&shifted, n, n).unwrap());
    }

}

#[test]
fn nothing_to_assign_is_an_answer() {
    assert_eq!(assigned(&[], 0, 0), Ok(vec![]));
    assert_eq!(assigned(&[], 3, 0), Ok(vec![None; 3]));
    assert_eq!(assigned(&[], 0, 3), Ok(vec![]));
    assert_eq!(assigned(&[f64::INFINITY], 1, 1), Ok(vec![None]));
}

#[test]
fn extreme_costs_are_answered() {
    assert_eq!(
        assigned(&[1e300, 1.0, 1.0, 1e300], 2, 2),
        Ok(vec![Some(1), Some(0)])
    );
    assert_eq!(
        assigned(&[-1e300, 1e-300, 1e-300, 0.0], 2, 2),
        Ok(vec![Some(0), Some(1)])
    );
    assert_eq!(
        assigned(&[5.0; 16], 4, 4).unwrap().iter().flatten().count(),
        4
    );
}

#[test]
fn unusable_costs_are_typed_errors() {
    for bad in [f64::NAN, f64::NEG_INFINITY] {
        let costs = [0.0, 1.0, 2.0, 3.0, bad, 5.0];
        assert_eq!(
            assigned(&costs, 2, 3),
            Err(MatchError::Cost { row: 1, column: 1 })
        );
    }
}
