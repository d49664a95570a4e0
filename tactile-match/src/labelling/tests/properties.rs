//! The paper's relaxation: what it must not depend on, and what normalisation must bring about.

use super::super::compatibility::{
    Compatibility, CompatibilityRule, LengthMaximum, alpha, beta, gamma,
};
use super::super::match_matrix::MatchMatrix;
use super::super::neighbourhood::{NeighbourGraph, Neighbourhood};
use super::super::shape_context::first_matches;
use super::super::support::{energy, support};
use super::super::update::{sinkhorn, sweep, update};
use crate::common::{Stream, bend, reordered, rotation, scattered};
use crate::{MatchError, PointMatcher, RelaxationLabelling};
use nalgebra::{Point, Point2, Point3, Vector3};
use proptest::prelude::*;

fn random_matches(rows: usize, columns: usize, seed: u64) -> MatchMatrix {
    let mut stream = Stream::new(seed);
    MatchMatrix::from_fn(rows, columns, |_, _| 0.05 + stream.next())
}

/// `sweeps` sweeps from random matches: everything but the first probabilities.
fn relaxed<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    mut m: MatchMatrix,
    neighbourhood: Neighbourhood,
) -> MatchMatrix {
    let graphs = [model, target].map(|points| NeighbourGraph::new(points, neighbourhood));
    let rule = CompatibilityRule {
        factors: Compatibility::Full,
        longest: None,
    };
    for _ in 0..3 {
        let s = support(&m, &graphs[0], &graphs[1], &rule);
        sweep(&mut m, &s, 0.5, 20);
    }
    m
}

fn neighbourhood(k: usize) -> Neighbourhood {
    if k == 0 {
        Neighbourhood::MedianRadius
    } else {
        Neighbourhood::Nearest(k)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn relaxation_does_not_depend_on_units_origin_or_a_common_rotation(
        seed in 0..1000_u64, rows in 3..14_usize, columns in 3..14_usize, k in 0..5_usize,
        angle in -3.0..3.0_f64, exponent in -6..=6_i32, offset in -10.0..10.0_f64,
    ) {
        let (model, target) = (scattered::<3>(rows, seed), scattered::<3>(columns, seed + 1));
        let (turn, scale) = (rotation::<3>(angle), 10_f64.powi(exponent));
        let moved = |points: &[Point3<f64>]| points.iter().map(|p| (turn * p + Vector3::repeat(offset)) * scale).collect::<Vec<_>>();
        let m = random_matches(rows, columns, seed);
        let plain = relaxed(&model, &target, m.clone(), neighbourhood(k));
        let other = relaxed(&moved(&model), &moved(&target), m, neighbourhood(k));
        // Lengths keep 14 digits, three sweeps of sums and quotients a few less.
        prop_assert!(plain.largest_change(&other) <= 1e-9);
    }

    #[test]
    fn relaxation_follows_the_order_of_the_points(seed in 0..1000_u64, rows in 3..14_usize, columns in 3..14_usize, k in 0..5_usize) {
        let (model, target) = (scattered::<2>(rows, seed), scattered::<2>(columns, seed + 1));
        let mut stream = Stream::new(seed);
        let (x, y) = (stream.permutation(rows), stream.permutation(columns));
        let m = random_matches(rows, columns, seed);
        let at = |order: &[usize], i: usize| order.get(i).copied().unwrap_or(order.len());
        let shuffled = MatchMatrix::from_fn(rows, columns, |i, j| m[(at(&x, i), at(&y, j))]);
        let plain = relaxed(&model, &target, m, neighbourhood(k));
        let other = relaxed(&reordered(&model, &x), &reordered(&target, &y), shuffled, neighbourhood(k));
        let expected = MatchMatrix::from_fn(rows, columns, |i, j| plain[(at(&x, i), at(&y, j))]);
        prop_assert!(other.largest_change(&expected) <= 1e-10, "sums in another order");
    }

    #[test]
    fn sinkhorn_makes_rows_and_columns_sum_to_one(rows in 1..12_usize, columns in 1..12_usize, seed in 0..1000_u64) {
        let mut m = random_matches(rows, columns, seed);
        let report = sinkhorn(&mut m, 10_000, 1e-12);
        // Positive entries with slack on both sides: always feasible, linear convergence.
        prop_assert!(report.row_defect <= 1e-12, "{:?}", report);
        for j in 0..columns {
            let sum: f64 = (0..=rows).map(|i| m[(i, j)]).sum();
            prop_assert!((sum - 1.0).abs() <= 1e-12);
        }
        prop_assert!((0..rows).all(|i| m.row(i).iter().all(|&p| (0.0..=1.0).contains(&p))));
    }

    #[test]
    fn sinkhorn_does_not_depend_on_the_scale_of_rows_and_columns(rows in 1..8_usize, columns in 1..8_usize, seed in 0..1000_u64) {
        let mut m = random_matches(rows, columns, seed);
        let mut stream = Stream::new(seed + 1);
        let (r, c): (Vec<f64>, Vec<f64>) = ((0..rows).map(|_| 0.1 + stream.next()).collect(), (0..columns).map(|_| 0.1 + stream.next()).collect());
        // Slack row and column are not normalised, so that only the factors of whole rows and columns are free.
        let mut scaled = MatchMatrix::from_fn(rows, columns, |i, j| m[(i, j)] * r.get(i).unwrap_or(&1.0) * c.get(j).unwrap_or(&1.0));
        sinkhorn(&mut m, 10_000, 1e-13);
        sinkhorn(&mut scaled, 10_000, 1e-13);
        prop_assert!(m.largest_change(&scaled) <= 1e-9);
    }

    #[test]
    fn the_energy_of_a_permutation_counts_the_edges_it_keeps(seed in 0..1000_u64, n in 2..16_usize, k in 0..5_usize) {
        let points = scattered::<2>(n, seed);
        let graph = NeighbourGraph::new(&points, neighbourhood(k));
        let identity = MatchMatrix::from_fn(n, n, |i, j| if i == j && i < n { 1.0 } else { 0.0 });
        prop_assert_eq!(energy(&identity, &graph, &graph), graph.edges().len() as f64);
    }

    #[test]
    fn compatibilities_lie_between_zero_and_one_and_are_symmetric(
        u in prop::array::uniform3(-5.0..5.0_f64), v in prop::array::uniform3(-5.0..5.0_f64), s in 0.01..100.0_f64,
    ) {
        let (u, v) = (Vector3::from(u), Vector3::from(v));
        let (a, b) = (alpha(u.norm(), v.norm()), beta(&u, &v));
        prop_assert!((0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b));
        prop_assert_eq!((a, b), (alpha(v.norm(), u.norm()), beta(&v, &u)));
        prop_assert!((beta(&(u * s), &v) - b).abs() <= 1e-14);
        prop_assert!((beta(&-u, &v) - (1.0 - b)).abs() <= 1e-14 || u.norm() * v.norm() == 0.0);
        let longest = u.norm().max(v.norm());
        prop_assert!((0.0..=1.0).contains(&gamma(u.norm(), longest)));
    }

    #[test]
    fn first_matches_prefer_the_same_surroundings(seed in 0..1000_u64) {
        let points = scattered::<2>(25, seed);
        let m = first_matches(&points, &points, 0.1, 0.2);
        prop_assert!((0..25).all(|i| (0..25).all(|j| m[(i, i)] >= m[(i, j)] * (1.0 - 1e-12))));
    }
}

#[test]
fn the_ties_of_a_grid_do_not_depend_on_where_it_lies() {
    let grid = crate::common::grid::<2>(5);
    let count = |shift: f64, step: f64| {
        let moved: Vec<_> = grid
            .iter()
            .map(|p| Point2::new(p.x * step + shift, p.y * step - shift))
            .collect();
        NeighbourGraph::new(&moved, Neighbourhood::MedianRadius)
            .edges()
            .len()
    };
    for (shift, step) in [(0.1, 0.1), (1.0 / 3.0, 0.7), (1e5, 0.1), (-7e3, 1e-2)] {
        assert_eq!(
            count(shift, step),
            count(0.0, 1.0),
            "grid of step {step} at {shift}"
        );
    }
}

#[test]
fn a_row_without_support_stays_as_it_was() {
    let mut m: MatchMatrix = MatchMatrix::from_fn(2, 2, |_, j| if j < 2 { 0.5 } else { 0.0 });
    assert_eq!(update(&mut m, &[0.0, 0.0, 1.0, 3.0], 0.5), [0]);
    assert_eq!(m.row(0), [0.5, 0.5, 0.0]);
    assert_eq!(m.row(1), [0.25, 0.75, 0.0]);
}

#[test]
fn products_that_overflow_or_underflow_are_taken_relative_to_their_row() {
    let mut m: MatchMatrix = MatchMatrix::from_fn(1, 2, |i, j| {
        if i == 0 && j < 2 {
            [1e-200, 1e-300][j]
        } else {
            0.0
        }
    });
    update(&mut m, &[1e-200, 1e-100], 0.5);
    assert!(
        (m[(0, 0)] - 0.5).abs() < 1e-15 && (m[(0, 1)] - 0.5).abs() < 1e-15,
        "{m:?}"
    );
}

/// The whole method with every combination of its options, on a case it must solve.
#[test]
fn every_option_solves_a_smooth_deformation() {
    let model = scattered::<2>(30, 5);
    let order = Stream::new(6).permutation(30);
    let target = reordered(&bend(&model, 0.08), &order);
    for neighbourhood in [Neighbourhood::MedianRadius, Neighbourhood::Nearest(6)] {
        for maximum in [LengthMaximum::PerPair, LengthMaximum::Global] {
            for compatibility in [
                Compatibility::Length,
                Compatibility::LengthDirection,
                Compatibility::Printed,
                Compatibility::Full,
            ] {
                let options = RelaxationLabelling::default()
                    .with_neighbourhood(neighbourhood)
                    .unwrap()
                    .with_length_maximum(maximum)
                    .with_compatibility(compatibility);
                let found = options.match_points(&model, &target).unwrap();
                let right = (0..30)
                    .filter(|&i| found.assignment[i].is_some_and(|j| order[j] == i))
                    .count();
                assert!(right >= 27, "{options:?}: {right} of 30");
            }
        }
    }
}

#[test]
fn gamma_is_that_of_the_model_or_of_both_edges() {
    let points = scattered::<2>(9, 8);
    let graph = NeighbourGraph::new(&points, Neighbourhood::Nearest(3));
    let [x, y] = [0, 5].map(|k| &graph.edges()[k]);
    let rate = |factors| {
        CompatibilityRule {
            factors,
            longest: None,
        }
        .of(x, y)
    };
    let alpha_beta = alpha(x.length, y.length) * beta(&x.vector, &y.vector);
    assert_eq!(rate(Compatibility::LengthDirection), alpha_beta);
    assert_eq!(rate(Compatibility::Printed), alpha_beta * x.gamma);
    assert_eq!(rate(Compatibility::Full), alpha_beta * x.gamma * y.gamma);
}

#[test]
fn one_energy_is_kept_for_every_iteration() {
    let model = scattered::<2>(12, 7);
    let options = RelaxationLabelling::default()
        .with_max_iterations(2)
        .unwrap();
    let found = options.match_points(&model, &bend(&model, 0.1)).unwrap();
    assert!(found.report.iterations <= 2 && found.energy.len() == found.report.iterations);
}

#[test]
fn options_out_of_range_are_typed_errors() {
    let good = RelaxationLabelling::default();
    let refused = |set: Result<RelaxationLabelling, MatchError>, name| {
        let error = set.unwrap_err();
        assert!(
            matches!(error, MatchError::InvalidOption { option, .. } if option == name),
            "{error}"
        );
    };
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        refused(good.with_temperature(bad), "temperature");
        refused(good.with_slack(bad), "slack");
        refused(good.with_smoothing(bad), "smoothing");
    }
    refused(good.with_temperature(0.0), "temperature");
    refused(good.with_max_iterations(0), "max_iterations");
    refused(
        good.with_neighbourhood(Neighbourhood::Nearest(0)),
        "neighbourhood",
    );
}
