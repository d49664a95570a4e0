//! Agreement with splines computed in 110-digit arithmetic, case by case, within the tolerance
//! stated by the reference.
//!
//! The numbers are outside the repository, in the folder named by `TACTILE_DATA`.
#![allow(clippy::print_stdout)]

use crate::common::largest;
use nalgebra::Point;
use serde_json::Value;
use tactile_tps::{FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, Spline, TpsError};
use test_support::{Worst, numbers};

/// Functions with four outputs, padded with zeros: a map of space would keep the identity across
/// degenerate points, whereas the reference does not.
const OUTPUTS: usize = 4;

type Fitted<const D: usize, K> = Result<Spline<D, OUTPUTS, K>, TpsError>;

/// Enters an error relative to its tolerance.
fn enter(table: &mut Worst, case: &Value, quantity: &str, error: f64, tolerance: f64) {
    let ratio = error / tolerance;
    if ratio.is_nan() || ratio > 1.0 {
        println!("{}: {quantity} {ratio:e}", text(case, "id"));
    }
    let row = format!("{} {quantity}", text(case, "category"));
    table.enter(&row, ratio, 1.0);
}

fn text(case: &Value, key: &str) -> String {
    case[key].as_str().unwrap_or_default().to_owned()
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// Rows of numbers as points, with short rows padded with zeros.
fn points<const D: usize>(value: &Value) -> Vec<Point<f64, D>> {
    let point = |row: &Value| {
        let row = numbers(row);
        Point::from(nalgebra::SVector::from_fn(|k, _| {
            row.get(k).copied().unwrap_or(0.0)
        }))
    };
    value.as_array().expect("rows").iter().map(point).collect()
}

fn options<K: Kernel>(case: &Value, kernel: K) -> FitOptions<K> {
    let smoothing = Smoothing::Lambda(number(&case["lambda"]));
    let weights = (!case["weights"].is_null()).then(|| numbers(&case["weights"]));
    crate::common::options(kernel, smoothing, weights.as_deref())
}

/// The tolerance stated by the reference: at least 1e-13, and increasing with conditioning and
/// cancellation.
fn tolerance(n: usize, sensitivity: f64, summation: f64) -> f64 {
    f64::max(
        1e-13,
        0.5f64.powi(53) * 50.0 * n as f64 * (1.0 + sensitivity) * (1.0 + summation),
    )
}

fn optional(case: &Value, group: &str, quantity: &str, query: usize) -> f64 {
    case[group][quantity][query].as_f64().unwrap_or(0.0)
}

fn check<const D: usize, K: Kernel>(table: &mut Worst, case: &Value, kernel: K) {
    let (sources, targets) = (
        points::<D>(&case["points"]),
        points::<OUTPUTS>(&case["values"]),
    );
    let fitted: Fitted<D, K> = Spline::fit(&sources, &targets, &options(case, kernel));
    if text(case, "status") == "singular" {
        return singular(case, &sources, &targets, fitted);
    }
    let spline = fitted.unwrap_or_else(|error| panic!("{}: {error}", text(case, "id")));
    let rank = case["affine_rank"].as_u64().expect("a rank") as usize;
    assert_eq!(spline.report.rank, rank, "{}", text(case, "id"));
    queries(table, case, &spline, &sources, &targets);
    coefficients(table, case, &spline, &targets);
}

/// Two points at one position: an error if their values differ, and the spline of the others if
/// they agree.
fn singular<const D: usize, K: Kernel>(
    case: &Value,
    sources: &[Point<f64, D>],
    targets: &[Point<f64, OUTPUTS>],
    fitted: Fitted<D, K>,
) {
    let mut pairs = (0..sources.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
    let (i, j) = pairs
        .find(|&(i, j)| sources[i] == sources[j])
        .expect("a pair");
    match fitted {
        Err(TpsError::Conflict { first, second }) => {
            assert_eq!((first, second, true), (i, j, targets[i] != targets[j]))
        }
        Err(error) => panic!("{}: {error}", text(case, "id")),
        Ok(spline) => {
            assert_eq!((spline.report.merged, targets[i]), (1, targets[j]));
            for (x, y) in sources.iter().zip(targets) {
                // Interpolation of values of order one, well conditioned: 1e-10 is generous.
                assert!((spline.apply(x) - y).norm() < 1e-10, "{}", text(case, "id"));
            }
        }
    }
}

fn queries<const D: usize, K: Kernel>(
    table: &mut Worst,
    case: &Value,
    spline: &Spline<D, OUTPUTS, K>,
    sources: &[Point<f64, D>],
    targets: &[Point<f64, OUTPUTS>],
) {
    let (n, outputs) = (
        sources.len(),
        case["outputs"].as_u64().expect("outputs") as usize,
    );
    let scale = largest(targets.iter().flat_map(|p| p.iter().copied()));
    let side = |k: usize| {
        let axis = || sources.iter().map(|p| p[k]);
        axis().fold(f64::MIN, f64::max) - axis().fold(f64::MAX, f64::min)
    };
    let diameter = (0..D).map(|k| side(k).powi(2)).sum::<f64>().sqrt();
    for (i, query) in points::<D>(&case["queries"]).iter().enumerate() {
        let group = |name, what| optional(case, name, what, i);
        let expected = numbers(&case["expected"]["values"][i]);
        let size = f64::max(largest(expected.iter().copied()), scale);
        let value = spline.apply(query);
        let error = largest((0..outputs).map(|k| value[k] - expected[k]));
        let bound = size
            * tolerance(
                n,
                group("sensitivity", "values"),
                group("summation", "values"),
            );
        enter(
            table,
            case,
            if i < 8 { "value near" } else { "value far" },
            error,
            bound,
        );

        let rows = case["expected"]["jacobian"][i].as_array().expect("rows");
        let rows: Vec<Vec<f64>> = rows.iter().map(numbers).collect();
        let slope = if diameter > 0.0 {
            scale / diameter
        } else {
            0.0
        };
        let size = f64::max(largest(rows.iter().flatten().copied()), slope);
        let jacobian = spline.jacobian(query);
        let entries = (0..outputs).flat_map(|k| (0..D).map(move |l| (k, l)));
        let error = largest(entries.map(|(k, l)| jacobian[(k, l)] - rows[k][l]));
        let bound = size
            * tolerance(
                n,
                group("sensitivity", "jacobian"),
                group("summation", "jacobian"),
            );
        enter(
            table,
            case,
            if i < 8 {
                "jacobian near"
            } else {
                "jacobian far"
            },
            error,
            f64::max(bound, 1e-300),
        );
    }
}

fn coefficients<const D: usize, K: Kernel>(
    table: &mut Worst,
    case: &Value,
    spline: &Spline<D, OUTPUTS, K>,
    targets: &[Point<f64, OUTPUTS>],
) {
    let sensitivity = &case["sensitivity"]["w"];
    if sensitivity.is_null() || spline.report.merged > 0 {
        return;
    }
    let rows: Vec<Vec<f64>> = case["expected"]["w"]
        .as_array()
        .expect("rows")
        .iter()
        .map(numbers)
        .collect();
    let errors = spline
        .terms()
        .zip(&rows)
        .flat_map(|((_, w), row)| (0..row.len()).map(move |k| w[k] - row[k]));
    let (error, size) = (largest(errors), largest(rows.iter().flatten().copied()));
    // For points that nearly coincide, only the sum of the weights is well determined. The error of
    // each weight is rounding times the condition number.
    let condition = spline.report.condition;
    let coincidence = if condition > 1e10 {
        0.5f64.powi(53) * condition
    } else {
        0.0
    };
    if size > 0.0 {
        enter(
            table,
            case,
            "weights",
            error,
            size * f64::max(
                tolerance(targets.len(), number(sensitivity), 0.0),
                coincidence,
            ),
        );
    }
}

fn run<const D: usize>(table: &mut Worst) {
    let Some(file) = test_support::reference(&format!("tps{D}.json")) else {
        return;
    };
    for case in file["cases"].as_array().expect("cases") {
        match text(case, "kernel").as_str() {
            "r2logr" => check::<D, _>(table, case, R2LogR),
            "minus_r" => check::<D, _>(table, case, NegR),
            "r3" => check::<D, _>(table, case, R3),
            other => panic!("unknown kernel {other}"),
        }
    }
}

#[test]
fn every_case_is_within_its_stated_tolerance() {
    let mut table = Worst::new("splines of 110 digits");
    run::<2>(&mut table);
    run::<3>(&mut table);
    table.finish();
}
