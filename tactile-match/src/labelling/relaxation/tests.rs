//! The building blocks against numbers computed at 80 digits (`reference/matching.json`), and their
//! properties.
//!
//! Every quantity is a sum or quotient of few positive terms, so that its relative error is a small
//! multiple of the rounding unit (1e-12 leaves room for 50 Sinkhorn sweeps). β, `alpha_global` and
//! γ near zero have no relative accuracy. They are compared relative to one, and what contains them
//! relative to the support with α alone.
#![allow(clippy::print_stdout)] // the table of errors

use super::*;
use crate::common::{Stream, bend, reordered, rotation, scattered};
use crate::{MatchError, PointMatcher};
use nalgebra::{Point2, Point3, Vector3};
use proptest::prelude::*;
use serde_json::Value;
use std::collections::BTreeMap;
use test_support::{numbers, rows};

/// (19) as printed, row-major: the reference of the stored links.
fn support<const D: usize>(
    m: &MatchMatrix,
    model: &NeighbourGraph<D>,
    target: &NeighbourGraph<D>,
    rule: &CompatibilityRule,
) -> Vec<f64> {
    let pairs = (0..m.rows).flat_map(|i| (0..m.columns).map(move |j| (i, j)));
    let term = |(i, j)| {
        let edges = model.of(i).iter();
        let terms = edges.flat_map(|x| {
            let others = target.of(j).iter();
            others.map(|y| m[(x.to, y.to)] * rule.of(x, y))
        });
        terms.sum()
    };
    pairs.map(term).collect()
}

fn sweep(m: &mut MatchMatrix, support: &[f64], slack_gain: f64, sinkhorn_sweeps: usize) {
    update(m, support, slack_gain);
    sinkhorn(m, sinkhorn_sweeps, 0.0);
}

/// Worst error of every quantity over all cases: (error, case).
#[derive(Default)]
struct Table(BTreeMap<String, (f64, String)>);

impl Table {
    /// Compares with error relative to `max(|expected|, floor)`.
    fn check(&mut self, quantity: &str, case: &str, found: f64, expected: f64, floor: f64) {
        assert!(found.is_finite(), "{case}: {quantity} is {found}");
        let error = if found == expected {
            0.0
        } else {
            (found - expected).abs() / expected.abs().max(floor)
        };
        let worst = self.0.entry(quantity.to_owned()).or_default();
        if error >= worst.0 {
            *worst = (error, case.to_owned());
        }
        assert!(
            error <= 1e-12,
            "{case}: {quantity} is {found:e}, expected {expected:e} (error {error:e})"
        );
    }
}

fn matrix(value: &Value) -> MatchMatrix {
    let entries = rows(value);
    MatchMatrix::from_fn(entries.len() - 1, entries[0].len() - 1, |i, j| {
        entries[i][j]
    })
}

fn points<const D: usize>(value: &Value) -> Vec<Point<f64, D>> {
    rows(value).iter().map(|p| Point::from_slice(p)).collect()
}

#[test]
fn agrees_with_the_reference_numbers() {
    let Some(file) = test_support::reference("matching.json") else {
        return;
    };
    let mut table = Table::default();
    let cases = file["cases"].as_array().expect("cases");
    for case in cases {
        match case["dim"].as_u64() {
            Some(2) => run_case::<2>(case, &mut table),
            Some(3) => run_case::<3>(case, &mut table),
            dim => panic!("dimension {dim:?}"),
        }
    }
    println!("{} cases; worst error of each quantity:", cases.len());
    for (quantity, (error, case)) in &table.0 {
        println!("  {quantity:<42} {error:9.2e}  {case}");
    }
    assert_eq!(
        Some(cases.len() as u64),
        file["header"]["case_count"].as_u64()
    );
}

fn run_case<const D: usize>(case: &Value, table: &mut Table) {
    let id = case["id"].as_str().expect("id");
    let expected = &case["expected"];
    let sets = ["X", "Y"].map(|key| points::<D>(&case[key]));
    let [model, target] = sets
        .each_ref()
        .map(|points| NeighbourGraph::new(points, Neighbourhood::MedianRadius));
    for (set, points) in ["radius_x", "radius_y"].iter().zip(&sets) {
        let radius = median_pairwise_distance(points);
        let exact = expected[*set].as_f64();
        assert_eq!(radius.is_some(), exact.is_some(), "{id}: {set}");
        if let (Some(radius), Some(exact)) = (radius, exact) {
            table.check("radius (13)", id, radius, exact, 0.0);
        }
    }
    let m = matrix(&case["M"]);
    check_graphs(id, expected, [("x", &model), ("y", &target)], table);
    check_edge_pairs(id, expected, &model, &target, table);
    table.check(
        "energy (14)",
        id,
        energy(&m, &model, &target),
        number(&expected["energy"]),
        0.0,
    );
    check_support(id, expected, &m, &model, &target, table);
    for (name, factors) in [
        ("count", Compatibility::Count),
        ("full", Compatibility::Full),
    ] {
        let rule = CompatibilityRule {
            factors,
            longest: None,
        };
        let gain = number(&case["slack_gain"]);
        let s = support(&m, &model, &target, &rule);
        let exact = rows(&expected["support"][name]).concat();
        let alone = if name == "count" {
            exact.clone()
        } else {
            rows(&expected["support"]["alpha"]).concat()
        };
        let lost = |i: usize, j: usize| match (m.columns, i * m.columns + j) {
            (columns, at) if i < m.rows && j < columns && exact[at] > 0.0 => alone[at] / exact[at],
            _ => 1.0,
        };
        let relaxed = &expected["update"][name];
        check_relaxation(
            id,
            name,
            relaxed,
            (m.clone(), &s, gain),
            lost,
            (&model, &target),
            table,
        );
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("number")
}

fn check_graphs<const D: usize>(
    id: &str,
    expected: &Value,
    graphs: [(&str, &NeighbourGraph<D>); 2],
    table: &mut Table,
) {
    for (set, graph) in graphs {
        let edges: Vec<_> = graph
            .edges
            .iter()
            .map(|e| vec![e.from as f64, e.to as f64])
            .collect();
        assert_eq!(
            edges,
            rows(&expected[format!("edges_{set}")]),
            "{id}: edges of {set}"
        );
        for (edge, expected) in graph
            .edges
            .iter()
            .zip(numbers(&expected[format!("gamma_{set}")]))
        {
            table.check("gamma (17)", id, edge.gamma, expected, 1.0);
        }
    }
}

fn check_edge_pairs<const D: usize>(
    id: &str,
    expected: &Value,
    model: &NeighbourGraph<D>,
    target: &NeighbourGraph<D>,
    table: &mut Table,
) {
    let longest = model.longest().max(target.longest());
    if let Some(d_max) = expected["d_max"].as_f64() {
        table.check("longest edge", id, longest, d_max, 0.0);
    }
    for (name, floor) in [("alpha", 0.0), ("alpha_global", 1.0), ("beta", 1.0)] {
        let Some(expected) = expected.get(name) else {
            continue;
        };
        for (x, expected) in model.edges.iter().zip(rows(expected)) {
            for (y, expected) in target.edges.iter().zip(expected) {
                let found = match name {
                    "alpha" => alpha(x.length, y.length),
                    "alpha_global" => alpha_global(x.length, y.length, longest),
                    _ => beta(&x.vector, &y.vector),
                };
                table.check(&format!("{name} (15)-(16)"), id, found, expected, floor);
            }
        }
    }
}

fn check_support<const D: usize>(
    id: &str,
    expected: &Value,
    m: &MatchMatrix,
    model: &NeighbourGraph<D>,
    target: &NeighbourGraph<D>,
    table: &mut Table,
) {
    let longest = Some(model.longest().max(target.longest()));
    let [count, alone] = ["count", "alpha"].map(|name| rows(&expected["support"][name]).concat());
    for (name, factors, longest) in [
        ("count", Compatibility::Count, None),
        ("alpha", Compatibility::Length, None),
        ("alpha_global", Compatibility::Length, longest),
        ("alpha_beta", Compatibility::LengthDirection, None),
        ("full", Compatibility::Full, None),
    ] {
        let found = support(m, model, target, &CompatibilityRule { factors, longest });
        let expected = rows(&expected["support"][name]).concat();
        assert_eq!(found.len(), expected.len(), "{id}: support {name}");
        let scale = match name {
            "alpha_beta" | "full" => &alone,
            "alpha_global" => &count,
            _ => &expected,
        };
        for ((found, expected), scale) in found.iter().zip(&expected).zip(scale) {
            table.check(
                &format!("support (19), {name}"),
                id,
                *found,
                *expected,
                scale.max(f64::MIN_POSITIVE),
            );
        }
    }
}

fn check_relaxation<const D: usize>(
    id: &str,
    name: &str,
    expected: &Value,
    (mut m, s, slack_gain): (MatchMatrix, &[f64], f64),
    lost: impl Fn(usize, usize) -> f64,
    (model, target): (&NeighbourGraph<D>, &NeighbourGraph<D>),
    table: &mut Table,
) {
    let zero_rows = update(&mut m, s, slack_gain);
    let expected_zero: Vec<_> = numbers(&expected["zero_rows"])
        .iter()
        .map(|&r| r as usize)
        .collect();
    assert_eq!(zero_rows, expected_zero, "{id}: rows without support");
    compare(
        &format!("update (20), {name}"),
        id,
        &m,
        &expected["after_row_normalisation"],
        &lost,
        table,
    );
    for expected in expected["sinkhorn"].as_array().expect("sinkhorn") {
        let sweeps = expected["sweeps"].as_u64().expect("sweeps") as usize;
        let mut m = m.clone();
        let report = sinkhorn(&mut m, sweeps, 0.0);
        compare(
            &format!("Sinkhorn, {name}"),
            id,
            &m,
            &expected["M"],
            &lost,
            table,
        );
        table.check(
            "row defect",
            id,
            report.row_defect,
            number(&expected["max_row_defect"]),
            1.0,
        );
        table.check(
            "energy after Sinkhorn",
            id,
            energy(&m, model, target),
            number(&expected["energy"]),
            f64::MIN_POSITIVE,
        );
    }
}

/// `lost` is by how much the support of an entry is smaller than with α alone: the digits it cannot
/// have.
fn compare(
    quantity: &str,
    id: &str,
    m: &MatchMatrix,
    expected: &Value,
    lost: &impl Fn(usize, usize) -> f64,
    table: &mut Table,
) {
    for (i, row) in rows(expected).iter().enumerate() {
        for (j, (&found, &expected)) in m.row(i).iter().zip(row).enumerate() {
            table.check(
                quantity,
                id,
                found,
                expected,
                (expected * lost(i, j)).max(f64::MIN_POSITIVE),
            );
        }
    }
}

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

    /// Of points whose match is settled only the pair they settled on has a support. None is
    /// settled here.
    #[test]
    fn links_give_the_printed_support_of_the_candidates(
        seed in 0..1000_u64, rows in 3..14_usize, columns in 3..14_usize, k in 0..5_usize, kept in 1..14_usize,
    ) {
        let sets = [scattered::<2>(rows, seed), scattered::<2>(columns, seed + 1)];
        let graphs = sets.each_ref().map(|points| NeighbourGraph::new(points, neighbourhood(k)));
        let mut m = random_matches(rows, columns, seed);
        keep_likeliest(&mut m, kept);
        let rule = CompatibilityRule { factors: Compatibility::Full, longest: None };
        let stored = Links::new(&m, &graphs, rule);
        let anew = Links { graphs: &graphs, rule, candidates: stored.candidates.clone(), starts: vec![], stored: vec![] };
        let printed = support(&m, &graphs[0], &graphs[1], &rule);
        let found = stored.support(&m);
        for (at, expected) in printed.into_iter().enumerate() {
            let candidate = m[(at / columns, at % columns)] > 0.0;
            // The same positive terms in another order.
            let wanted = if candidate { expected } else { 0.0 };
            prop_assert!((found[at] - wanted).abs() <= 1e-13 * expected);
        }
        prop_assert_eq!(found, anew.support(&m));
    }

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
    fn the_energy_of_a_permutation_counts_the_edges_it_keeps(seed in 0..1000_u64, n in 2..16_usize, k in 0..5_usize) {
        let points = scattered::<2>(n, seed);
        let graph = NeighbourGraph::new(&points, neighbourhood(k));
        let identity = MatchMatrix::from_fn(n, n, |i, j| if i == j && i < n { 1.0 } else { 0.0 });
        prop_assert_eq!(energy(&identity, &graph, &graph), graph.edges.len() as f64);
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
            .edges
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
    let [x, y] = [0, 5].map(|k| &graph.edges[k]);
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

#[test]
fn relaxation_has_all_its_digits() {
    let mut table = test_support::Worst::new("matching");
    for case in test_support::cases(include_str!("../../../tests/reference/relaxation.json")) {
        let name = case["name"].as_str().unwrap();
        let entries = rows(&case["m"]);
        let mut m = MatchMatrix::from_fn(4, 5, |i, j| entries[i][j]);
        let graph =
            |key: &str| NeighbourGraph::new(&points::<2>(&case[key]), Neighbourhood::Nearest(9));
        let rule = CompatibilityRule {
            factors: Compatibility::LengthDirection,
            longest: None,
        };
        let found = support(&m, &graph("model"), &graph("target"), &rule);
        for (found, expected) in found.iter().zip(rows(&case["support"]).concat()) {
            // A sum of positive terms, each of some ten roundings; β loses no more than one part in
            // its own size.
            table.enter(
                &format!("support, {name}"),
                (found / expected - 1.0).abs() / f64::EPSILON,
                64.0,
            );
        }
        sinkhorn(&mut m, case["sweeps"].as_u64().unwrap() as usize, 0.0);
        for (i, row) in rows(&case["sinkhorn"]).iter().enumerate() {
            for (j, &expected) in row.iter().enumerate().filter(|(_, x)| **x > 0.0) {
                // Seven sweeps of a sum of six and a quotient, twice: 14 × 7 roundings.
                let units = (m[(i, j)] / expected - 1.0).abs() / f64::EPSILON;
                table.enter(&format!("Sinkhorn, {name}"), units, 98.0);
            }
        }
    }
    table.finish();
}
