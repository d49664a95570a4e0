//! Scales from 1e-9 to 1e9, offsets of 1e6 diameters, nearly flat and nearly equal points, λ up to
//! 1e12 and singular systems. Every error is measured in units of the effect that rounding of the
//! inputs alone has on the exact spline.
#![allow(clippy::print_stdout)]

use crate::common::options;
use nalgebra::Point;
use serde_json::Value;
use tactile_tps::{Kernel, NegR, R2LogR, R3, Smoothing, Spline};
use test_support::{Worst, cases, numbers, rows};

fn points<const D: usize>(value: &Value) -> Vec<Point<f64, D>> {
    rows(value)
        .iter()
        .map(|row| Point::from_slice(row))
        .collect()
}

/// `condition` counts every rounding of an input once. A fit performs about n = 8 operations per
/// entry of a system of 12 rows, and a backward stable algorithm is within this number of units:
/// 100.
const ALLOWED: f64 = 100.0;

fn check<const D: usize, K: Kernel>(table: &mut Worst, case: &Value, kernel: K) {
    let smoothing = Smoothing::Lambda(case["lambda"].as_f64().unwrap());
    let sources = points::<D>(&case["points"]);
    let values = numbers(&case["values"]);
    let targets: Vec<Point<f64, 1>> = values.iter().map(|&v| Point::from([v])).collect();
    let spline: Spline<D, 1, K> =
        Spline::fit(&sources, &targets, &options(kernel, smoothing, None)).expect("a spline");
    let scale = values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let condition = case["condition"].as_f64().unwrap();
    for (query, expected) in points::<D>(&case["queries"])
        .iter()
        .zip(numbers(&case["expected"]))
    {
        let error = (spline.apply(query)[0] - expected).abs() / scale.max(expected.abs());
        let name = format!(
            "{}-D {}: {}",
            D,
            case["kernel"].as_str().unwrap(),
            case["name"].as_str().unwrap()
        );
        table.enter(&name, error / (f64::EPSILON * condition), ALLOWED);
    }
}

#[test]
fn splines_of_hard_points_are_as_good_as_their_inputs() {
    let mut table = Worst::new("thin-plate splines");
    for case in cases(include_str!("../reference/splines.json")) {
        match (case["dimension"].as_u64(), case["kernel"].as_str().unwrap()) {
            (Some(2), "r2logr") => check::<2, _>(&mut table, &case, R2LogR),
            (Some(3), "negr") => check::<3, _>(&mut table, &case, NegR),
            (Some(3), "r3") => check::<3, _>(&mut table, &case, R3),
            other => panic!("{other:?}"),
        }
    }
    table.finish();
}
