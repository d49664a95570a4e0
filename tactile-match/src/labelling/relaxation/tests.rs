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
use crate::labelling::Neighbourhood;
use crate::labelling::graph::median_pairwise_distance;
use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use serde_json::Value;
use test_support::{numbers, rows};

fn go_on() -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn whole<T>(found: ControlFlow<(), T>) -> T {
    found.continue_value().expect("nothing stops it")
}

fn graph_of<const D: usize>(
    points: &[Point<f64, D>],
    neighbourhood: Neighbourhood,
) -> NeighbourGraph<D> {
    let points: Vec<[f64; D]> = points.iter().map(|p| p.coords.into()).collect();
    NeighbourGraph::new(&points, neighbourhood)
}

fn edges<const D: usize>(graph: &NeighbourGraph<D>) -> impl Iterator<Item = &Edge<D>> {
    (0..graph.points()).flat_map(|i| graph.of(i))
}

fn energy_of<const D: usize>(
    m: &MatchMatrix,
    model: &NeighbourGraph<D>,
    target: &NeighbourGraph<D>,
) -> f64 {
    whole(energy(m, model, &EdgeTable::new(target), &mut go_on))
}

/// All pairs as candidates, from `(I + 1) × (J + 1)` numbers.
fn matrix_of(
    rows: usize,
    columns: usize,
    mut entry: impl FnMut(usize, usize) -> f64,
) -> MatchMatrix {
    let mut m = MatchMatrix::default();
    let slack: Vec<f64> = (0..columns).map(|j| entry(rows, j)).collect();
    m.reset(slack);
    for i in 0..rows {
        let row: Vec<_> = (0..columns).map(|j| (j, entry(i, j))).collect();
        m.push_row(row, entry(i, columns));
    }
    m
}

/// `(I + 1) × (J + 1)` numbers in the order of [`MatchMatrix::all_entries`].
fn in_order(entries: &[Vec<f64>]) -> Vec<f64> {
    let (last, rows) = entries.split_last().expect("slack row");
    let pairs = rows.iter().flat_map(|row| &row[..row.len() - 1]);
    let slack = rows.iter().map(|row| &row[row.len() - 1]);
    let slack_row = &last[..last.len() - 1];
    pairs.chain(slack).chain(slack_row).copied().collect()
}

/// The entry of all pairs, row-major, and zero for those that are no candidates.
fn dense(m: &MatchMatrix, columns: usize) -> Vec<f64> {
    let mut entries = vec![0.0; m.rows() * columns];
    for i in 0..m.rows() {
        m.row(i).for_each(|(j, p)| entries[i * columns + j] = p);
    }
    entries
}

/// Equation (19) as printed, row-major: the reference for the links.
fn support<const D: usize>(
    m: &MatchMatrix,
    model: &NeighbourGraph<D>,
    target: &NeighbourGraph<D>,
    rule: &CompatibilityRule,
) -> Vec<f64> {
    let columns = target.points();
    let entries = dense(m, columns);
    let pairs = (0..m.rows()).flat_map(|i| (0..columns).map(move |j| (i, j)));
    let term = |(i, j)| {
        let terms = model.of(i).iter().flat_map(|x| {
            let others = target.of(j).iter();
            others.map(|y| entries[x.to * columns + y.to] * rule.of(x, y))
        });
        terms.sum()
    };
    pairs.map(term).collect()
}

fn normalise(m: &mut MatchMatrix, sweeps: usize) {
    (0..sweeps).for_each(|_| m.normalise());
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
    matrix_of(entries.len() - 1, entries[0].len() - 1, |i, j| {
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
        .map(|points| graph_of(points, Neighbourhood::MedianRadius));
    for (set, (points, graph)) in ["x", "y"].into_iter().zip(sets.iter().zip(&graphs)) {
        let plain: Vec<[f64; D]> = points.iter().map(|p| p.coords.into()).collect();
        let radius = expected[format!("radius_{set}")].as_f64();
        let found = median_pairwise_distance(&plain);
        check(&format!("{id}: radius (13)"), found, radius, |_| 0.0);
        let ends: Vec<_> = (0..points.len())
            .flat_map(|i| graph.of(i).iter().map(move |e| vec![i as f64, e.to as f64]))
            .collect();
        assert_eq!(ends, rows(&expected[format!("edges_{set}")]), "{id}: {set}");
        let gammas = edges(graph).map(|edge| edge.gamma);
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
        let found = edges(&graphs[0]).flat_map(|x| edges(&graphs[1]).map(move |y| factor(x, y)));
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
        let ordered = in_order(&rows(expected));
        let floor = |k: usize| {
            let lost = lost.get(k).copied().filter(|lost| lost.is_finite());
            (ordered[k] * lost.unwrap_or(1.0)).max(f64::MIN_POSITIVE)
        };
        check(
            &format!("{id}: {what}"),
            m.all_entries(),
            ordered.clone(),
            floor,
        );
    };
    m.update(support, slack_gain);
    compare("update (20)", &m, &expected["after_row_normalisation"]);
    for expected in expected["sinkhorn"].as_array().expect("sinkhorn") {
        let mut m = m.clone();
        normalise(
            &mut m,
            expected["sweeps"].as_u64().expect("sweeps") as usize,
        );
        compare("Sinkhorn", &m, &expected["M"]);
        let sum = |i| m.row(i).map(|pair| pair.1).sum::<f64>() + m.slack(i);
        let defect = (0..m.rows()).fold(0.0_f64, |worst, i| worst.max((1.0 - sum(i)).abs()));
        let exact = expected["max_row_defect"].as_f64();
        check(&format!("{id}: row defect"), [defect], exact, |_| 1.0);
        let (found, exact) = (energy_of(&m, &graphs[0], &graphs[1]), &expected["energy"]);
        let what = format!("{id}: energy after Sinkhorn");
        check(&what, [found], exact.as_f64(), |_| f64::MIN_POSITIVE);
    }
}

fn random_matches(rows: usize, columns: usize, seed: u64) -> MatchMatrix {
    let mut stream = Stream::new(seed);
    matrix_of(rows, columns, |_, _| 0.05 + stream.next())
}

/// Runs `sweeps` sweeps from random matches, without the first probabilities.
fn relaxed<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    mut m: MatchMatrix,
    neighbourhood: Neighbourhood,
) -> MatchMatrix {
    let graphs = [model, target].map(|points| graph_of(points, neighbourhood));
    let rule = CompatibilityRule {
        factors: Compatibility::Full,
        longest: None,
    };
    for _ in 0..3 {
        let s = support(&m, &graphs[0], &graphs[1], &rule);
        m.update(&s, 0.5);
        normalise(&mut m, 20);
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

    /// No point is settled here.
    #[test]
    fn links_give_the_printed_support_of_the_candidates(
        seed in 0..1000_u64, rows in 3..14_usize, columns in 3..14_usize, k in 0..5_usize, kept in 1..14_usize,
    ) {
        let sets = [scattered::<2>(rows, seed), scattered::<2>(columns, seed + 1)];
        let [model, target] = sets.each_ref().map(|points| graph_of(points, neighbourhood(k)));
        let mut m = random_matches(rows, columns, seed);
        m.keep_likeliest(kept);
        let rule = CompatibilityRule { factors: Compatibility::Full, longest: None };
        let table = EdgeTable::new(&target);
        let compatibility = |x: &Edge<2>, j, b| table.between(j, b).map_or(0.0, |y| rule.of(x, y));
        let mut links = Links::default();
        whole(links.build(&m, &model, compatibility, &mut go_on));
        let (mut stored, mut anew) = (vec![], vec![]);
        whole(m.support(&mut stored, |_, pair| links.support(&m, pair), &mut go_on));
        whole(m.support(&mut anew, |i, pair| m.support_of(model.of(i), pair, &compatibility), &mut go_on));
        let printed = support(&m, &model, &target, &rule);
        let candidates = (0..rows).flat_map(|i| m.row(i).map(move |(j, _)| i * columns + j));
        for (found, at) in stored.iter().zip(candidates) {
            // The same positive terms, summed in another order.
            prop_assert!((found - printed[at]).abs() <= 1e-13 * printed[at]);
        }
        prop_assert_eq!(stored, anew);
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
    fn the_energy_of_a_permutation_counts_the_edges_it_keeps(seed in 0..1000_u64, n in 2..16_usize, k in 0..5_usize) {
        let points = scattered::<2>(n, seed);
        let graph = graph_of(&points, neighbourhood(k));
        let identity = matrix_of(n, n, |i, j| if i == j && i < n { 1.0 } else { 0.0 });
        prop_assert_eq!(energy_of(&identity, &graph, &graph), edges(&graph).count() as f64);
    }

    #[test]
    fn first_matches_prefer_the_same_surroundings(seed in 0..1000_u64) {
        let points = scattered::<2>(25, seed);
        let m = first_matches(&points, &points, 0.1, 0.2);
        let entries = dense(&m, 25);
        prop_assert!((0..25).all(|i| (0..25).all(|j| entries[26 * i] >= entries[25 * i + j] * (1.0 - 1e-12))));
    }
}

#[test]
fn gamma_is_that_of_the_model_or_of_both_edges() {
    let points = scattered::<2>(9, 8);
    let graph = graph_of(&points, Neighbourhood::Nearest(3));
    let (x, y) = (&graph.of(0)[0], &graph.of(1)[2]);
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
        let mut m = matrix_of(4, 5, |i, j| entries[i][j]);
        let graph = |key: &str| graph_of(&points::<2>(&case[key]), Neighbourhood::Nearest(9));
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
        normalise(&mut m, case["sweeps"].as_u64().unwrap() as usize);
        let expected = in_order(&rows(&case["sinkhorn"]));
        for (found, expected) in m.all_entries().zip(expected).filter(|(_, x)| *x > 0.0) {
            // Seven sweeps of a sum of six and a quotient, done twice: 14 × 7 roundings.
            let units = (found / expected - 1.0).abs() / f64::EPSILON;
            table.enter(&format!("Sinkhorn, {name}"), units, 98.0);
        }
    }
    table.finish();
}
