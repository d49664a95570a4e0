//! Scales from 1e-9 to 1e9, offsets of 1e6 diameters, nearly flat and nearly equal points, λ up to
//! 1e12, single precision and singular systems: every error in units of what rounding the inputs
//! alone does to the exact spline.
#![allow(clippy::print_stdout)]

use test_support as worst;

use crate::common::{Uniform, bend, options};
use nalgebra::{Point, SVector};
use serde_json::Value;
use tactile_tps::{
    FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, Spline, ThinPlateSpline, TpsError,
};
use worst::{Worst, cases, numbers, rows};

fn points<const D: usize>(value: &Value) -> Vec<Point<f64, D>> {
    rows(value)
        .iter()
        .map(|row| Point::from_slice(row))
        .collect()
}

/// `condition` counts every rounding of an input once. A fit does some n = 8 operations per entry
/// of a system of 12 rows, and an algorithm that is backward stable is within that many units: 100.
const ALLOWED: f64 = 100.0;

fn check<const D: usize, K: Kernel>(table: &mut Worst, case: &Value, kernel: K) {
    let lambda = case["lambda"].as_f64().unwrap();
    let smoothing = if lambda > 0.0 {
        Smoothing::Lambda(lambda)
    } else {
        Smoothing::None
    };
    let sources = points::<D>(&case["points"]);
    let values = numbers(&case["values"]);
    let targets: Vec<Point<f64, 1>> = values.iter().map(|&v| Point::from([v])).collect();
    let spline: Spline<f64, D, 1, K> =
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
    single_precision(&mut table);
    table.finish();
}

/// f32 against f64 on the same numbers, in units of f32's rounding times the condition number that
/// the fit itself reports.
fn single_precision(table: &mut Worst) {
    let sources: Vec<Point<f32, 3>> = Uniform(9)
        .points::<3>(40)
        .iter()
        .map(|p| p.map(|x| x as f32))
        .collect();
    let targets: Vec<Point<f32, 3>> = sources
        .iter()
        .map(|p| bend(&p.map(f64::from)).map(|x| x as f32))
        .collect();
    let wide =
        |points: &[Point<f32, 3>]| points.iter().map(|p| p.map(f64::from)).collect::<Vec<_>>();
    for scale in [1e-9_f32, 1.0, 1e9] {
        let scaled: Vec<_> = sources.iter().map(|p| p * scale).collect();
        let short = ThinPlateSpline::fit(&scaled, &targets, &FitOptions::new(NegR)).unwrap();
        let long =
            ThinPlateSpline::fit(&wide(&scaled), &wide(&targets), &FitOptions::new(NegR)).unwrap();
        for query in Uniform(10).points::<3>(50) {
            let query = query.map(|x| x as f32) * scale;
            let error = short.apply(&query).map(f64::from) - long.apply(&query.map(f64::from));
            let units = error.norm() / (f64::from(f32::EPSILON) * long.report.condition);
            table.enter("3-D negr: f32 against f64", units, 10.0);
        }
    }
}

/// λ = 1e12 leaves the affine fit, λ = 0 the interpolant; nothing in between is out of order.
#[test]
fn lambda_reaches_both_ends() {
    let sources = Uniform(3).points::<2>(30);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let residual = |lambda: f64| {
        let options = options(R2LogR, Smoothing::Lambda(lambda), None);
        let spline = ThinPlateSpline::fit(&sources, &targets, &options).unwrap();
        sources
            .iter()
            .zip(&targets)
            .map(|(x, y)| (spline.apply(x) - y).norm_squared())
            .sum::<f64>()
            .sqrt()
    };
    let residuals: Vec<f64> = [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9, 1e12]
        .map(residual)
        .to_vec();
    // It rises with λ until both are the affine fit's, to rounding.
    assert!(
        residuals.windows(2).all(|r| r[0] <= r[1] + 1e-13),
        "{residuals:?}"
    );
    assert!(residuals[0] < 1e-12 && residuals[9] > 0.1, "{residuals:?}");
}

/// Systems without a solution of full rank are named or reduced, never noise.
#[test]
fn singular_systems_are_said_to_be() {
    let line: Vec<Point<f64, 3>> = (0..9)
        .map(|i| Point::from(SVector::repeat(f64::from(i))))
        .collect();
    let one = vec![line[4]; 5];
    let targets: Vec<_> = line.iter().map(bend).collect();
    for scale in [1e-9, 1.0, 1e9] {
        let scaled: Vec<_> = line.iter().map(|p| p * scale).collect();
        let spline = ThinPlateSpline::fit(&scaled, &targets, &FitOptions::new(NegR)).unwrap();
        assert_eq!(
            spline.report.rank, 2,
            "a line spans one direction at scale {scale}"
        );
    }
    let spline = ThinPlateSpline::fit(&one, &[targets[4]; 5], &FitOptions::new(NegR)).unwrap();
    assert_eq!((spline.report.rank, spline.report.merged), (1, 4));
    let clash = ThinPlateSpline::fit(&one, &targets[..5], &FitOptions::new(NegR));
    assert!(matches!(clash, Err(TpsError::Conflict { .. })));
}
