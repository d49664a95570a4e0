//! Thin-plate splines: times of fit, refit, evaluation and differentiation, with errors.
//!
//! The problem is that of common benchmarks of RBF packages: `n` uniform points in the cube [−1,
//! 1]³ displaced by five Gaussian bumps, and 10,000 queries. Every result is compared with the map
//! before it is timed.
#![allow(clippy::print_stdout, missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix3, Point3};
use tactile_benches::Problem;
use tactile_imaging::tps::{
    Factorization, FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, Spline, SplineWorkspace,
    ThinPlateSpline,
};

const SIZES: [usize; 3] = [105, 200, 1000];
const QUERIES: usize = 10_000;

fn problem(n: usize) -> Problem {
    Problem::new(n as u64, n, 0.0, QUERIES)
}

/// Fits once, prints and checks the error, and prints the report of the fit.
fn solved<K: Kernel + Default>(
    problem: &Problem,
    options: &FitOptions<K>,
    name: &str,
) -> ThinPlateSpline<3, K> {
    let spline =
        ThinPlateSpline::fit(&problem.sources, &problem.targets, options).expect("a spline");
    let error = problem.error(&spline);
    let report = &spline.report;
    println!(
        "{name}/{}: rms error {error:.3e}, residual {:.1e}, condition {:.1e}, {} steps",
        report.points,
        report.residual.unwrap_or(f64::NAN),
        report.condition,
        report.iterations
    );
    // 105 points resolve bumps of width 0.6 to about a hundredth.
    assert!(error < 0.02, "{error}");
    spline
}

fn fit<K: Kernel + Default>(c: &mut Criterion, problem: &Problem, name: &str, kernel: K) {
    let options = FitOptions::new(kernel);
    solved(problem, &options, name);
    let n = problem.sources.len();
    c.bench_function(&format!("tps/fit/{name}/{n}"), |b| {
        b.iter(|| ThinPlateSpline::fit(black_box(&problem.sources), &problem.targets, &options));
    });
}

/// New targets with the stored factors.
fn refit<K: Kernel + Default>(c: &mut Criterion, problem: &Problem, name: &str, kernel: K) {
    let n = problem.sources.len();
    let factorization =
        Factorization::new(&problem.sources, &FitOptions::new(kernel)).expect("a factor");
    let (mut workspace, mut spline) = (SplineWorkspace::default(), Spline::default());
    let smoothing = Smoothing::Lambda(0.01);
    for (what, smoothing) in [("targets", None), ("lambda", Some(smoothing))] {
        c.bench_function(&format!("tps/refit/{name}/{what}/{n}"), |b| {
            b.iter(|| {
                let targets = black_box(&problem.targets);
                factorization.refit_with(&mut workspace, targets, None, smoothing, &mut spline)
            });
        });
    }
}

fn evaluate<K: Kernel + Default>(c: &mut Criterion, problem: &Problem, name: &str, kernel: K) {
    let spline = solved(problem, &FitOptions::new(kernel), name);
    let n = problem.sources.len();
    let queries = || black_box(&problem.queries);
    let (mut values, mut jacobians) = (
        vec![Point3::origin(); QUERIES],
        vec![Matrix3::zeros(); QUERIES],
    );
    c.bench_function(&format!("tps/evaluate/{name}/{n}"), |b| {
        b.iter(|| spline.apply_into(queries(), &mut values));
    });
    c.bench_function(&format!("tps/jacobian/{name}/{n}"), |b| {
        b.iter(|| spline.apply_and_jacobian_into(queries(), &mut values, &mut jacobians));
    });
}

fn kernel<K: Kernel + Default>(c: &mut Criterion, name: &str, kernel: K) {
    for n in SIZES {
        let problem = problem(n);
        fit(c, &problem, name, kernel.clone());
        refit(c, &problem, name, kernel.clone());
        evaluate(c, &problem, name, kernel.clone());
    }
}

/// A fit of ten thousand points takes seconds and is omitted in a quick run.
fn many(c: &mut Criterion) {
    if std::env::args().any(|argument| argument == "--test" || argument == "--quick") {
        return;
    }
    let problem = problem(10_000);
    fit(c, &problem, "r2logr", R2LogR);
    fit(c, &problem, "r", NegR);
}

fn all(c: &mut Criterion) {
    kernel(c, "r2logr", R2LogR);
    kernel(c, "r", NegR);
    kernel(c, "r3", R3);
    many(c);
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = all
}
criterion_main!(benches);
