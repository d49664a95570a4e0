//! The dense reference against numbers computed at 80 digits (`reference/matching.json`): α, β, γ, edges, support,
//! update (20), Sinkhorn and energy (14), with a table of the worst error of each.
//!
//! Tolerances: every quantity is a sum or quotient of few positive terms, so its relative error is a small multiple of the
//! rounding unit (1e-12 leaves room for 50 Sinkhorn sweeps). Two things have no relative accuracy in double and
//! are compared on the scale they are computed on: β near zero (an angle close to π), `alpha_global` and γ near zero (nearly
//! equal lengths) relative to one, their upper bound; and what contains them relative to the same sum without them, that is to
//! the support with α alone (α itself has all its digits, over any ratio of lengths).
#![allow(clippy::print_stdout)] // the table of errors

use super::super::compatibility::{Compatibility, CompatibilityRule, alpha, alpha_global, beta};
use super::super::match_matrix::MatchMatrix;
use super::super::neighbourhood::{NeighbourGraph, Neighbourhood, median_pairwise_distance};
use super::super::support::{energy, support};
use super::super::update::{sinkhorn, update};
use nalgebra::Point;
use serde_json::Value;
use std::collections::BTreeMap;

const TOLERANCE: f64 = 1e-12;

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
            error <= TOLERANCE,
            "{case}: {quantity} is {found:e}, expected {expected:e} (error {error:e})"
        );
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .expect("array")
        .iter()
        .map(|v| v.as_f64().expect("number"))
        .collect()
}

fn rows(value: &Value) -> Vec<Vec<f64>> {
    value
        .as_array()
        .expect("array")
        .iter()
        .map(numbers)
        .collect()
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
    let folder = std::env::var("TACTILE_DATA")
        .unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data").to_owned());
    let Ok(text) = std::fs::read_to_string(format!("{folder}/reference/matching.json")) else {
        println!("skipped: no reference/matching.json in {folder}");
        return;
    };
    let file: Value = serde_json::from_str(&text).expect("matching.json is JSON");
    for check in file["header"]["parse_check"]
        .as_array()
        .expect("parse_check")
    {
        let bits = format!(
            "0x{:016x}",
            check["value"].as_f64().expect("value").to_bits()
        );
        assert_eq!(
            check["bits"].as_str(),
            Some(bits.as_str()),
            "the parser must round correctly"
        );
    }
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
        let lost = |i: usize, j: usize| match (m.columns(), i * m.columns() + j) {
            (columns, at) if i < m.rows() && j < columns && exact[at] > 0.0 => {
                alone[at] / exact[at]
            }
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
            .edges()
            .iter()
            .map(|e| vec![e.from as f64, e.to as f64])
            .collect();
        assert_eq!(
            edges,
            rows(&expected[format!("edges_{set}")]),
            "{id}: edges of {set}"
        );
        for (edge, expected) in graph
            .edges()
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
        for (x, expected) in model.edges().iter().zip(rows(expected)) {
            for (y, expected) in target.edges().iter().zip(expected) {
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

/// `lost` is by how much the support of an entry is smaller than with α alone: the digits it cannot have.
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
