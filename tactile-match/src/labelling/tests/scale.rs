//! Support and Sinkhorn at every scale, far from the origin and with entries over 120 decades; the fast matcher under units and offsets.
#![allow(clippy::print_stdout)]

use test_support as worst;

use super::super::compatibility::{Compatibility, CompatibilityRule};
use super::super::match_matrix::MatchMatrix;
use super::super::neighbourhood::{NeighbourGraph, Neighbourhood};
use super::super::support::support;
use super::super::update::sinkhorn;
use crate::common::{bend, scattered};
use crate::{AnnealedSoftassign, PointMatcher};
use nalgebra::{Point, SVector};
use serde_json::Value;
use worst::{Worst, cases, rows};

fn points(value: &Value) -> Vec<Point<f64, 2>> {
    rows(value)
        .iter()
        .map(|row| Point::from_slice(row))
        .collect()
}

#[test]
fn relaxation_has_all_its_digits() {
    let mut table = Worst::new("matching");
    for case in cases(include_str!("../../../tests/reference/relaxation.json")) {
        let name = case["name"].as_str().unwrap();
        let entries = rows(&case["m"]);
        let mut m = MatchMatrix::from_fn(4, 5, |i, j| entries[i][j]);
        let graph = |key: &str| NeighbourGraph::new(&points(&case[key]), Neighbourhood::Nearest(9));
        let rule = CompatibilityRule {
            factors: Compatibility::LengthDirection,
            longest: None,
        };
        let found = support(&m, &graph("model"), &graph("target"), &rule);
        for (found, expected) in found.iter().zip(rows(&case["support"]).concat()) {
            // A sum of positive terms, each of some ten roundings; β loses no more than one part in its own size.
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

/// The partners do not depend on the unit, nor on where the origin is: an offset of 1e6 diameters leaves ten digits.
#[test]
fn the_fast_matcher_has_no_unit_and_no_origin() {
    let model = scattered::<3>(60, 5);
    let target = bend(&model, 0.05);
    let matcher = AnnealedSoftassign::default();
    let at = |scale: f64, offset: f64| {
        let place = |points: &[Point<f64, 3>]| -> Vec<_> {
            points
                .iter()
                .map(|p| Point::from((p.coords + SVector::repeat(offset)) * scale))
                .collect()
        };
        matcher
            .match_points(&place(&model), &place(&target))
            .unwrap()
            .assignment
    };
    let expected: Vec<_> = (0..60).map(Some).collect();
    for (scale, offset) in [
        (1.0, 0.0),
        (1e-9, 0.0),
        (1e9, 0.0),
        (1.0, 1e6),
        (1e-9, 1e6),
        (1e9, -1e6),
    ] {
        assert_eq!(
            at(scale, offset),
            expected,
            "scale {scale}, offset {offset}"
        );
    }
}
