//! Coherent point drift compared with a slow implementation of its equations, and its invariances.

use crate::common::{Stream, bend, largest_step, reordered, rotation, scattered};
use nalgebra::{DMatrix, Point, Point2, Point3, SVector, Vector3};
use proptest::prelude::*;
use tactile_match::{
    CoherentPointDrift, MatchError, Matching, Normalization, PointMatcher, StopReason,
};

fn drift<const D: usize>(
    options: CoherentPointDrift,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
) -> Matching<D> {
    options.match_points(model, target).expect("valid points")
}

/// Eq. 22–23 and figure 4 of Myronenko and Song with full matrices and an LU factorisation in every
/// iteration. Ends early if σ² has decreased to a ten-thousandth, because the collapse onto the
/// targets is dominated by rounding. Also returns the number of iterations.
fn slow_non_rigid<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    (beta, lambda, w): (f64, f64, f64),
    iterations: usize,
) -> (Vec<Point<f64, D>>, usize) {
    let (m, n) = (model.len(), target.len());
    let columns = |points: &[Point<f64, D>]| DMatrix::from_fn(points.len(), D, |i, d| points[i][d]);
    let (y, x) = (columns(model), columns(target));
    let squared = |a: &DMatrix<f64>, i: usize, b: &DMatrix<f64>, j: usize| {
        (a.row(i) - b.row(j)).norm_squared()
    };
    let g = DMatrix::from_fn(m, m, |i, j| {
        (-squared(&y, i, &y, j) / (2.0 * beta * beta)).exp()
    });
    let mut moved = y.clone();
    let mut sigma2 = (0..m)
        .flat_map(|i| (0..n).map(move |j| (i, j)))
        .map(|(i, j)| squared(&y, i, &x, j))
        .sum::<f64>()
        / (D * m * n) as f64;
    let (first, mut done) = (sigma2, 0);
    while done < iterations && sigma2 > 1e-4 * first {
        done += 1;
        let c = (2.0 * std::f64::consts::PI * sigma2).powf(D as f64 / 2.0) * w / (1.0 - w)
            * m as f64
            / n as f64;
        let mut p = DMatrix::from_fn(m, n, |i, j| {
            (-squared(&moved, i, &x, j) / (2.0 * sigma2)).exp()
        });
        for mut column in p.column_iter_mut() {
            let sum = column.sum() + c;
            column /= sum;
        }
        let p1 = DMatrix::from_diagonal(&p.column_sum());
        let a = &p1 * &g + DMatrix::identity(m, m) * (lambda * sigma2);
        let b = &p * &x - &p1 * &y;
        moved = &y + &g * a.lu().solve(&b).expect("regular");
        sigma2 = (0..m)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| p[(i, j)] * squared(&moved, i, &x, j))
            .sum::<f64>()
            / (D as f64 * p.sum());
    }
    (
        (0..m)
            .map(|i| Point::from(SVector::from_fn(|d, _| moved[(i, d)])))
            .collect(),
        done,
    )
}

/// The tolerance is that of the factorisation of the kernel, 1e-12, divided by the ridge λσ² ≥ 1e-4
/// of the first iterations.
fn check_against_slow<const D: usize>(
    seed: u64,
    rows: usize,
    columns: usize,
    beta: f64,
    lambda: f64,
    w: f64,
) {
    let model = scattered::<D>(rows, seed);
    let target = reordered(
        &bend(&scattered::<D>(columns, seed), 0.1),
        &Stream::new(seed).permutation(columns),
    );
    let options = CoherentPointDrift::default()
        .with_field(beta, lambda)
        .and_then(|options| options.with_outlier_weight(w))
        .and_then(|options| options.with_tolerance(0.0))
        .expect("valid options")
        .with_normalization(Normalization::Off);
    let (expected, iterations) = slow_non_rigid(&model, &target, (beta, lambda, w), 8);
    let options = options.with_max_iterations(iterations).expect("a limit");
    let found = drift(options, &model, &target);
    assert!(
        largest_step(&found.warped, &expected) <= 1e-7,
        "{}",
        largest_step(&found.warped, &expected)
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn non_rigid_motion_solves_its_equations(
        seed in 0..1000_u64, rows in 2..40_usize, columns in 2..40_usize,
        beta in 0.3..3.0_f64, lambda in 0.5..30.0_f64, w in 0.01..0.5_f64,
    ) {
        check_against_slow::<2>(seed, rows, columns, beta, lambda, w);
        check_against_slow::<3>(seed, rows, columns, beta, lambda, w);
    }

    #[test]
    fn units_and_origin_do_not_matter(
        seed in 0..1000_u64, exponent in -9..=9_i32, offset in -1e3..1e3_f64, each in any::<bool>(),
    ) {
        let normalization = if each { Normalization::Each } else { Normalization::Model };
        let options = CoherentPointDrift::default().with_normalization(normalization);
        let model = scattered::<3>(30, seed);
        let target = bend(&model, 0.05);
        let scale = 10_f64.powi(exponent);
        let moved = |points: &[Point3<f64>]| points.iter().map(|p| (p + Vector3::repeat(offset)) * scale).collect::<Vec<_>>();
        let plain = drift(options, &model, &target);
        let other = drift(options, &moved(&model), &moved(&target));
        prop_assert_eq!(&other.assignment, &plain.assignment);
        prop_assert_eq!(other.report.iterations, plain.report.iterations);
        // Points 1e3 from the origin lose three digits, which the iterations may amplify.
        prop_assert!(largest_step(&other.warped, &moved(&plain.warped)) <= 1e-8 * scale);
    }

    #[test]
    fn a_common_rotation_turns_the_answer(seed in 0..1000_u64, angle in -3.0..3.0_f64) {
        let options = CoherentPointDrift::default();
        let model = scattered::<2>(30, seed);
        let target = bend(&model, 0.05);
        let turn = rotation::<2>(angle);
        let turned = |points: &[Point2<f64>]| points.iter().map(|p| turn * p).collect::<Vec<_>>();
        let (plain, other) = (drift(options, &model, &target), drift(options, &turned(&model), &turned(&target)));
        prop_assert_eq!(&other.assignment, &plain.assignment);
        prop_assert!(largest_step(&other.warped, &turned(&plain.warped)) <= 1e-8);
    }
}

#[test]
fn a_low_rank_kernel_is_close() {
    let model = scattered::<2>(100, 2);
    let target = bend(&model, 0.05);
    let options = CoherentPointDrift::default();
    let whole = drift(options, &model, &target);
    let thirty = drift(options.with_rank(30).unwrap(), &model, &target);
    assert_eq!(whole.assignment, thirty.assignment);
    assert!(
        largest_step(&whole.warped, &thirty.warped) < 1e-4,
        "{}",
        largest_step(&whole.warped, &thirty.warped)
    );
}

#[test]
fn outliers_are_left_without_a_partner() {
    let model = scattered::<2>(60, 3);
    let mut target = bend(&model, 0.03);
    let mut stream = Stream::new(4);
    target.extend((0..15).map(|_| Point2::new(1.5 + stream.next(), 3.0 * stream.next())));
    let options = CoherentPointDrift::default()
        .with_outlier_weight(0.2)
        .unwrap()
        .with_normalization(Normalization::Model);
    let found = drift(options, &model, &target);
    assert!(
        (0..60).all(|i| found.assignment[i] == Some(i)),
        "{:?}",
        found.assignment
    );
    assert_eq!(found.unmatched_target, (60..75).collect::<Vec<_>>());
}

#[test]
fn the_warp_takes_the_model_along_and_its_jacobian_is_its_derivative() {
    let model = scattered::<3>(40, 9);
    let target = bend(&model, 0.05);
    let found = drift(CoherentPointDrift::default(), &model, &target);
    let warp = &found.warp;
    let images: Vec<_> = model.iter().map(|p| warp.apply(p)).collect();
    // The triangular system of the pivots has about the square root of the condition of the kernel,
    // 1e6.
    assert!(
        largest_step(&images, &found.warped) < 1e-9,
        "{}",
        largest_step(&images, &found.warped)
    );
    let (at, h) = (Point3::new(0.4, 0.3, 0.6), 1e-5);
    let jacobian = warp.jacobian(&at);
    for axis in 0..3 {
        let step = Vector3::ith(axis, h);
        let slope = (warp.apply(&(at + step)) - warp.apply(&(at - step))) / (2.0 * h);
        assert!(
            (slope - jacobian.column(axis)).norm() < 1e-7,
            "central difference of order h², rounding 1e-16/h"
        );
    }
}

#[test]
fn options_out_of_range_are_typed_errors() {
    let good = CoherentPointDrift::default();
    let refused = |set: Result<CoherentPointDrift, MatchError>, name| {
        let error = set.unwrap_err();
        assert!(
            matches!(error, MatchError::InvalidOption { option, .. } if option == name),
            "{error}"
        );
    };
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        refused(good.with_outlier_weight(bad), "outlier_weight");
        refused(good.with_tolerance(bad), "tolerance");
        refused(good.with_field(bad, 1.0), "beta");
        refused(good.with_field(1.0, bad), "lambda");
    }
    refused(good.with_outlier_weight(1.0), "outlier_weight");
    refused(good.with_max_iterations(0), "max_iterations");
    refused(good.with_rank(0), "rank");
    refused(good.with_field(0.0, 1.0), "beta");
    refused(good.with_field(1.0, 0.0), "lambda");
}

#[test]
fn the_report_says_why_it_stopped() {
    let model = scattered::<2>(20, 8);
    let target = bend(&model, 0.05);
    let few = CoherentPointDrift::default()
        .with_max_iterations(2)
        .unwrap();
    assert_eq!(
        drift(few, &model, &target).report.stop,
        StopReason::IterationLimit
    );
    assert_eq!(
        drift(CoherentPointDrift::default(), &model, &target)
            .report
            .stop,
        StopReason::Converged
    );
    assert_eq!(
        drift(CoherentPointDrift::default(), &model[..1], &target[..1])
            .report
            .stop,
        StopReason::Exact
    );
}
