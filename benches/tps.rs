//! Thin-plate splines: fit, refit, evaluate, differentiate; the error stands beside the time.
//!
//! The problem is that of common RBF packages' own comparisons: `n` uniform points in the cube [−1,
//! 1]³ moved by five Gaussian bumps, 10,000 queries. Every answer is checked against the map before
//! it is timed.
#![allow(clippy::print_stdout, missing_docs)]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Matrix3, Point3, Vector3};
use rand::{RngExt, SeedableRng, rngs::SmallRng};
use tactile_imaging::tps::{
    Factorization, FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, Spline, SplineWorkspace,
    ThinPlateSpline,
};

const SIZES: [usize; 3] = [105, 200, 1000];
const QUERIES: usize = 10_000;

/// Points, where they go, and the map in between.
struct Problem {
    bumps: Vec<(Point3<f64>, Vector3<f64>)>,
    sources: Vec<Point3<f64>>,
    targets: Vec<Point3<f64>>,
    queries: Vec<Point3<f64>>,
}

impl Problem {
    fn new(n: usize) -> Self {
        let mut random = SmallRng::seed_from_u64(n as u64);
        let mut point =
            |size: f64| Point3::from(Vector3::from_fn(|_, _| random.random_range(-size..size)));
        let bumps: Vec<_> = (0..5).map(|_| (point(1.0), point(0.17).coords)).collect();
        let sources: Vec<_> = (0..n).map(|_| point(1.0)).collect();
        let queries = (0..QUERIES).map(|_| point(0.95)).collect();
        let mut problem = Self {
            bumps,
            sources,
            targets: Vec::new(),
            queries,
        };
        problem.targets = problem.sources.iter().map(|p| problem.map(p)).collect();
        problem
    }

    fn map(&self, p: &Point3<f64>) -> Point3<f64> {
        self.bumps.iter().fold(*p, |q, (c, a)| {
            q + a * (-(p - c).norm_squared() / 0.72).exp()
        })
    }

    /// Root mean square error at the queries.
    fn error<K: Kernel + Default>(&self, spline: &ThinPlateSpline<f64, 3, K>) -> f64 {
        let mut values = vec![Point3::origin(); QUERIES];
        spline
            .apply_into(&self.queries, &mut values)
            .expect("equal lengths");
        let squares = self
            .queries
            .iter()
            .zip(&values)
            .map(|(q, v)| (self.map(q) - v).norm_squared());
        (squares.sum::<f64>() / QUERIES as f64).sqrt()
    }
}

fn kernels(c: &mut Criterion, name: &str, bench: impl Bench) {
    let mut group = c.benchmark_group(format!("tps/{name}"));
    for n in SIZES {
        let problem = Problem::new(n);
        bench.run(&mut group, &problem, "r2logr", R2LogR);
        bench.run(&mut group, &problem, "r", NegR);
        bench.run(&mut group, &problem, "r3", R3);
    }
    group.finish();
}

type Group<'a> = criterion::BenchmarkGroup<'a, criterion::measurement::WallTime>;

trait Bench {
    fn run<K: Kernel + Default>(
        &self,
        group: &mut Group<'_>,
        problem: &Problem,
        kernel_name: &str,
        kernel: K,
    );
}

fn solved<K: Kernel + Default>(
    problem: &Problem,
    kernel: K,
    label: &str,
) -> ThinPlateSpline<f64, 3, K> {
    let spline = ThinPlateSpline::fit(&problem.sources, &problem.targets, &FitOptions::new(kernel))
        .expect("a spline");
    let error = problem.error(&spline);
    let report = &spline.report;
    println!(
        "{label}/{}: rms error {error:.3e}, residual {:.1e}, condition {:.1e}, {} steps",
        report.points,
        report.residual.unwrap_or(f64::NAN),
        report.condition,
        report.iterations
    );
    // 105 points resolve bumps of width 0.6 to about a hundredth.
    assert!(error < 0.02, "{error}");
    spline
}

struct Fit;

impl Bench for Fit {
    fn run<K: Kernel + Default>(
        &self,
        group: &mut Group<'_>,
        problem: &Problem,
        name: &str,
        kernel: K,
    ) {
        solved(problem, kernel.clone(), name);
        let options = FitOptions::new(kernel);
        group.bench_function(BenchmarkId::new(name, problem.sources.len()), |b| {
            b.iter(|| {
                ThinPlateSpline::fit(black_box(&problem.sources), &problem.targets, &options)
            });
        });
    }
}

struct Refit;

impl Bench for Refit {
    fn run<K: Kernel + Default>(
        &self,
        group: &mut Group<'_>,
        problem: &Problem,
        name: &str,
        kernel: K,
    ) {
        let n = problem.sources.len();
        let expected = solved(problem, kernel.clone(), name);
        let factorization = Factorization::new(&problem.sources, &FitOptions::new(kernel.clone()))
            .expect("a factor");
        let (mut workspace, mut spline) = (SplineWorkspace::default(), Spline::default());
        factorization
            .refit_with(&mut workspace, &problem.targets, None, None, &mut spline)
            .expect("a fit");
        assert!((problem.error(&spline) / problem.error(&expected) - 1.0).abs() < 1e-3);
        group.bench_function(BenchmarkId::new(format!("{name}/targets"), n), |b| {
            b.iter(|| {
                factorization.refit_with(
                    &mut workspace,
                    black_box(&problem.targets),
                    None,
                    None,
                    &mut spline,
                )
            });
        });
        if n > 256 {
            return;
        }
        let weights: Vec<f64> = (0..n).map(|i| 0.5 + (i % 7) as f64 / 7.0).collect();
        let smoothing = Smoothing::Lambda(0.01);
        for (what, weights) in [("lambda", None), ("weights", Some(&weights[..]))] {
            group.bench_function(BenchmarkId::new(format!("{name}/{what}"), n), |b| {
                b.iter(|| {
                    factorization.refit_with(
                        &mut workspace,
                        &problem.targets,
                        weights,
                        Some(smoothing),
                        &mut spline,
                    )
                });
            });
        }
    }
}

struct Evaluate;

impl Bench for Evaluate {
    fn run<K: Kernel + Default>(
        &self,
        group: &mut Group<'_>,
        problem: &Problem,
        name: &str,
        kernel: K,
    ) {
        let spline = solved(problem, kernel, name);
        let mut values = vec![Point3::origin(); QUERIES];
        group.throughput(Throughput::Elements(QUERIES as u64));
        group.bench_function(BenchmarkId::new(name, problem.sources.len()), |b| {
            b.iter(|| spline.apply_into(black_box(&problem.queries), &mut values));
        });
    }
}

struct Jacobian;

impl Bench for Jacobian {
    fn run<K: Kernel + Default>(
        &self,
        group: &mut Group<'_>,
        problem: &Problem,
        name: &str,
        kernel: K,
    ) {
        let spline = solved(problem, kernel, name);
        let (mut values, mut jacobians) = (
            vec![Point3::origin(); QUERIES],
            vec![Matrix3::zeros(); QUERIES],
        );
        group.throughput(Throughput::Elements(QUERIES as u64));
        group.bench_function(BenchmarkId::new(name, problem.sources.len()), |b| {
            b.iter(|| {
                spline.apply_and_jacobian_into(
                    black_box(&problem.queries),
                    &mut values,
                    &mut jacobians,
                )
            });
        });
    }
}

/// A fit of ten thousand points takes seconds: not for a quick look.
fn many(c: &mut Criterion) {
    if std::env::args().any(|argument| argument == "--test" || argument == "--quick") {
        return;
    }
    let mut group = c.benchmark_group("tps/fit");
    group.sample_size(10);
    let problem = Problem::new(10_000);
    Fit.run(&mut group, &problem, "r2logr", R2LogR);
    Fit.run(&mut group, &problem, "r", NegR);
    group.finish();
}

fn all(c: &mut Criterion) {
    kernels(c, "fit", Fit);
    many(c);
    kernels(c, "refit", Refit);
    kernels(c, "evaluate", Evaluate);
    kernels(c, "jacobian", Jacobian);
}

criterion_group!(benches, all);
criterion_main!(benches);
