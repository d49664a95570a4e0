//! Tests the building blocks against numbers computed with 80 digits (`reference/matching.json`),
//! and their properties.
//!
//! Each quantity is a sum or quotient of few positive terms, so its relative error is a small
//! multiple of the rounding unit (1e-12 covers 50 Sinkhorn sweeps). β, `alpha_global` and γ near
//! zero have no relative accuracy: they are compared relative to one, and quantities that contain
//! them relative to the support with α alone.

use super::*;
use crate::MatchError;
use crate::common::{Stream, rotation, scattered};
use nalgebra::{Point2, Point3, Vector3};
use proptest::prelude::*;
use serde_json::Value;
use test_support::{numbers, rows};

fn go_on() -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn whole<T>(found: ControlFlow<(), T>) -> T {
    found.continue_value().expect("nothing stops it")
}

fn energy_of<const D: usize>(
    m: &MatchMatrix,
    model: &NeighbourGraph<D>,
    target: &NeighbourGraph<D>,
) -> f64 {
    whole(energy(m, model, target, &mut go_on))
}

/// Equation (19) as printed, row-major: the reference for the stored links.
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

/// Checks that each number is within 1e-12 of the expected one, relative to the expected value or
/// to its floor.
fn check(
    what: &str,
    found: impl IntoIterator<Item = f64>,
    expected: impl IntoIterator<Item = f64>,
    floor: impl Fn(usize) -> f64,
) {
    let [found, expected]: [Vec<f64>; 2] =
        [found.into_iter().collect(), expected.into_iter().collect()];
    assert_eq!(found.len(), expected.len(), "{what}");
    for (k, (found, expected)) in found.into_iter().zip(expected).enumerate() {
        let allowed = 1e-12 * expected.abs().max(floor(k));
        assert!(
            found == expected || (found - expected).abs() <= allowed,
            "{what}, number {k}: {found:e}, expected {expected:e}"
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
    let cases = file["cases"].as_array().expect("cases");
    for case in cases {
        match case["dim"].as_u64() {
            Some(2) => run_case::<2>(case),
            Some(3) => run_case::<3>(case),
            dim => panic!("dimension {dim:?}"),
        }
    }
    assert_eq!(
        Some(cases.len() as u64),
        file["header"]["case_count"].as_u64()
    );
}

fn run_case<const D: usize>(case: &Value) {
    let id = case["id"].as_str().expect("id");
    let expected = &case["expected"];
    let sets = ["X", "Y"].map(|key| points::<D>(&case[key]));
    let graphs = sets
        .each_ref()
        .map(|points| NeighbourGraph::new(points, Neighbourhood::MedianRadius));
    for (set, (points, graph)) in ["x", "y"].into_iter().zip(sets.iter().zip(&graphs)) {
        let radius = expected[format!("radius_{set}")].as_f64();
        let found = median_pairwise_distance(points);
        check(&format!("{id}: radius (13)"), found, radius, |_| 0.0);
        let edges = graph.edges.iter();
        let ends: Vec<_> = edges.map(|e| vec![e.from as f64, e.to as f64]).collect();
        assert_eq!(ends, rows(&expected[format!("edges_{set}")]), "{id}: {set}");
        let gammas = graph.edges.iter().map(|edge| edge.gamma);
        let exact = numbers(&expected[format!("gamma_{set}")]);
        check(&format!("{id}: gamma (17)"), gammas, exact, |_| 1.0);
    }
    let longest = graphs[0].longest().max(graphs[1].longest());
    if let Some(exact) = expected["d_max"].as_f64() {
        check(&format!("{id}: longest edge"), [longest], [exact], |_| 0.0);
    }
    type Factor<'a, const D: usize> = &'a dyn Fn(&Edge<D>, &Edge<D>) -> f64;
    let factors: [(_, _, Factor<'_, D>); 3] = [
        ("alpha", 0.0, &|x, y| alpha(x.length, y.length)),
        ("alpha_global", 1.0, &|x, y| {
            alpha_global(x.length, y.length, longest)
        }),
        ("beta", 1.0, &|x, y| beta(&x.vector, &y.vector)),
    ];
    for (name, floor, factor) in factors {
        let Some(exact) = expected.get(name) else {
            continue;
        };
        let pairs = graphs[0].edges.iter();
        let found = pairs.flat_map(|x| graphs[1].edges.iter().map(move |y| factor(x, y)));
        let exact = rows(exact).concat();
        check(&format!("{id}: {name} (15)-(16)"), found, exact, |_| floor);
    }
    let m = matrix(&case["M"]);
    let (found, exact) = (energy_of(&m, &graphs[0], &graphs[1]), &expected["energy"]);
    check(
        &format!("{id}: energy (14)"),
        [found],
        exact.as_f64(),
        |_| 0.0,
    );
    let exact = |name: &str| rows(&expected["support"][name]).concat();
    let [count, alone] = ["count", "alpha"].map(exact);
    for (name, factors, longest, scale) in [
        ("count", Compatibility::Count, None, &count),
        ("alpha", Compatibility::Length, None, &alone),
        ("alpha_global", Compatibility::Length, Some(longest), &count),
        ("alpha_beta", Compatibility::LengthDirection, None, &alone),
        ("full", Compatibility::Full, None, &alone),
    ] {
        let rule = CompatibilityRule { factors, longest };
        let found = support(&m, &graphs[0], &graphs[1], &rule);
        let floor = |k: usize| scale[k].max(f64::MIN_POSITIVE);
        let what = format!("{id}: support (19), {name}");
        check(&what, found.iter().copied(), exact(name), floor);
        if let Some(relaxed) = expected["update"].get(name) {
            let gain = case["slack_gain"].as_f64().expect("gain");
            // The ratio by which an entry's support is smaller than with α alone gives the digits
            // lost to cancellation.
            let lost: Vec<f64> = exact(name).iter().zip(scale).map(|(s, a)| a / s).collect();
            let what = format!("{id}, {name}");
            check_relaxation(&what, relaxed, (m.clone(), &found, gain), &lost, &graphs);
        }
    }
}

fn check_relaxation<const D: usize>(
    id: &str,
    expected: &Value,
    (mut m, support, slack_gain): (MatchMatrix, &[f64], f64),
    lost: &[f64],
    graphs: &[NeighbourGraph<D>; 2],
) {
    let compare = |what: &str, m: &MatchMatrix, expected: &Value| {
        let expected = rows(expected).concat();
        let floor = |k: usize| {
            let (i, j) = (k / (m.columns + 1), k % (m.columns + 1));
            let is_pair = i < m.rows && j < m.columns;
            let lost = if is_pair {
                lost[i * m.columns + j]
            } else {
                1.0
            };
            let lost = if lost.is_finite() { lost } else { 1.0 };
            (expected[k] * lost).max(f64::MIN_POSITIVE)
        };
        let found = m.entries.iter().copied();
        check(&format!("{id}: {what}"), found, expected.clone(), floor);
    };
    let zero_rows = update(&mut m, support, slack_gain);
    let zero_rows: Vec<f64> = zero_rows.into_iter().map(|row| row as f64).collect();
    assert_eq!(
        zero_rows,
        numbers(&expected["zero_rows"]),
        "{id}: no support"
    );
    compare("update (20)", &m, &expected["after_row_normalisation"]);
    for expected in expected["sinkhorn"].as_array().expect("sinkhorn") {
        let sweeps = expected["sweeps"].as_u64().expect("sweeps") as usize;
        let mut m = m.clone();
        let defect = sinkhorn(&mut m, sweeps, 0.0);
        compare("Sinkhorn", &m, &expected["M"]);
        let exact = expected["max_row_defect"].as_f64();
        check(&format!("{id}: row defect"), [defect], exact, |_| 1.0);
        let (found, exact) = (energy_of(&m, &graphs[0], &graphs[1]), &expected["energy"]);
        let what = format!("{id}: energy after Sinkhorn");
        check(&what, [found], exact.as_f64(), |_| f64::MIN_POSITIVE);
    }
}

fn random_matches(rows: usize, columns: usize, seed: u64) -> MatchMatrix {
    let mut stream = Stream::new(seed);
    MatchMatrix::from_fn(rows, columns, |_, _| 0.05 + stream.next())
}

/// Runs `sweeps` sweeps from random matches, without the first probabilities.
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

    /// If the match of a point is settled, only the settled pair has a support. No point is settled
    /// here.
    #[test]
    fn links_give_the_printed_support_of_the_candidates(
        seed in 0..1000_u64, rows in 3..14_usize, columns in 3..14_usize, k in 0..5_usize, kept in 1..14_usize,
    ) {
        let sets = [scattered::<2>(rows, seed), scattered::<2>(columns, seed + 1)];
        let graphs = sets.each_ref().map(|points| NeighbourGraph::new(points, neighbourhood(k)));
        let mut m = random_matches(rows, columns, seed);
        keep_likeliest(&mut m, kept);
        let rule = CompatibilityRule { factors: Compatibility::Full, longest: None };
        let stored = whole(Links::new(&m, &graphs, rule, &mut go_on));
        let anew = Links { graphs: &graphs, rule, candidates: stored.candidates.clone(), starts: vec![], stored: vec![] };
        let printed = support(&m, &graphs[0], &graphs[1], &rule);
        let found = whole(stored.support(&m, &mut go_on));
        for (at, expected) in printed.into_iter().enumerate() {
            let candidate = m[(at / columns, at % columns)] > 0.0;
            // The same positive terms, summed in another order.
            let wanted = if candidate { expected } else { 0.0 };
            prop_assert!((found[at] - wanted).abs() <= 1e-13 * expected);
        }
        prop_assert_eq!(found, whole(anew.support(&m, &mut go_on)));
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
        // Lengths keep 14 digits, and three sweeps of sums and quotients slightly fewer.
        prop_assert!(plain.largest_change(&other) <= 1e-9);
    }

    #[test]
    fn sinkhorn_makes_rows_and_columns_sum_to_one(rows in 1..12_usize, columns in 1..12_usize, seed in 0..1000_u64) {
        let mut m = random_matches(rows, columns, seed);
        let defect = sinkhorn(&mut m, 10_000, 1e-12);
        // Positive entries with slack on both sides are always feasible, and convergence is linear.
        prop_assert!(defect <= 1e-12, "{}", defect);
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
        prop_assert_eq!(energy_of(&identity, &graph, &graph), graph.edges.len() as f64);
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
    assert_eq!(rate(Compatibility::Count), 1.0);
    assert_eq!(rate(Compatibility::Length), alpha(x.length, y.length));
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
            // A sum of positive terms with about ten roundings each. β loses no more than one part
            // of its own size.
            table.enter(
                &format!("support, {name}"),
                (found / expected - 1.0).abs() / f64::EPSILON,
                64.0,
            );
        }
        sinkhorn(&mut m, case["sweeps"].as_u64().unwrap() as usize, 0.0);
        for (i, row) in rows(&case["sinkhorn"]).iter().enumerate() {
            for (j, &expected) in row.iter().enumerate().filter(|(_, x)| **x > 0.0) {
                // Seven sweeps of a sum of six and a quotient, done twice: 14 × 7 roundings.
                let units = (m[(i, j)] / expected - 1.0).abs() / f64::EPSILON;
                table.enter(&format!("Sinkhorn, {name}"), units, 98.0);
            }
        }
    }
    table.finish();
}
