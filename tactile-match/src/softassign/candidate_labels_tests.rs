//! The sparse relaxation with all candidates is the paper's dense one.
use super::CandidateLabels;
use crate::labelling::testing::{
    Compatibility, CompatibilityRule, MatchMatrix, NeighbourGraph, Neighbourhood, support, sweep,
};
use crate::linear_assignment;
use nalgebra::Point;
use proptest::prelude::*;

fn points<const D: usize>(flat: &[f64]) -> Vec<Point<f64, D>> {
    flat.chunks_exact(D)
        .map(|c| Point::from(std::array::from_fn(|k| c[k])))
        .collect()
}

fn agrees<const D: usize>(x: &[Point<f64, D>], y: &[Point<f64, D>]) -> Result<(), TestCaseError> {
    let (graph_x, graph_y) = (
        NeighbourGraph::new(x, Neighbourhood::MedianRadius),
        NeighbourGraph::new(y, Neighbourhood::MedianRadius),
    );
    let slack = 1.0 / (y.len() + 1) as f64;
    let mut dense = MatchMatrix::from_fn(x.len(), y.len(), |_, _| slack);
    let mut sparse = CandidateLabels::new(
        y.len(),
        x.iter().map(|_| (0..y.len()).collect::<Vec<_>>()),
        slack,
    );
    let rule = CompatibilityRule {
        factors: Compatibility::Full,
        longest: None,
    };
    let weight = |(i, j): (usize, usize), (a, b): (usize, usize)| {
        let edge = |graph: &NeighbourGraph<D>, from: usize, to: usize| {
            graph.of(from).iter().find(|edge| edge.to == to).copied()
        };
        match (edge(&graph_x, i, a), edge(&graph_y, j, b)) {
            (Some(u), Some(v)) => rule.of(&u, &v),
            _ => 0.0,
        }
    };
    sparse.link(weight, |i| {
        graph_x.of(i).iter().map(|edge| edge.to).collect::<Vec<_>>()
    });
    for _ in 0..4 {
        let gains = support(&dense, &graph_x, &graph_y, &rule);
        sweep(&mut dense, &gains, 0.05, 6);
        sparse.sweep(0.05, 6);
    }
    for i in 0..x.len() {
        for j in 0..y.len() {
            // Sums of at most 200 positive terms in another order, four sweeps: far below 1e-10.
            prop_assert!((dense[(i, j)] - sparse.probability(i, j)).abs() < 1e-10);
        }
        prop_assert!((dense.slack_of_row(i) - sparse.slack_of_row(i)).abs() < 1e-10);
    }
    same_partners(
        x.len(),
        y.len(),
        |i, j| dense[(i, j)],
        |i, j| sparse.probability(i, j),
    )
}

/// The partners read from the sparse matrix are the best ones of the dense matrix as well: the same, or tied with them.
fn same_partners(
    rows: usize,
    columns: usize,
    dense: impl Fn(usize, usize) -> f64,
    sparse: impl Fn(usize, usize) -> f64,
) -> Result<(), TestCaseError> {
    let partners = |m: &dyn Fn(usize, usize) -> f64| {
        let costs: Vec<f64> = (0..rows * columns)
            .map(|e| -m(e / columns, e % columns))
            .collect();
        linear_assignment(&costs, rows, columns).expect("probabilities")
    };
    let total = |assignment: Vec<Option<usize>>| -> f64 {
        assignment
            .iter()
            .enumerate()
            .filter_map(|(i, j)| j.map(|j| dense(i, j)))
            .sum()
    };
    let (best, found) = (total(partners(&dense)), total(partners(&sparse)));
    // Entries agree to 1e-10, and either choice may gain that much on every row.
    prop_assert!((best - found).abs() <= 2e-10 * rows as f64);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn in_the_plane(x in prop::collection::vec(-1.0..1.0_f64, 8..26), y in prop::collection::vec(-1.0..1.0_f64, 8..26)) {
        agrees::<2>(&points(&x), &points(&y))?;
    }

    #[test]
    fn in_space(x in prop::collection::vec(-1.0..1.0_f64, 12..36), y in prop::collection::vec(-1.0..1.0_f64, 12..36)) {
        agrees::<3>(&points(&x), &points(&y))?;
    }
}
