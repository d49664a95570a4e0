//! Point matching: time beside error, on generated scenes with known partners.
//!
//! `match/105x105` and `match/200x200` are jittered discs bent into a bell under a smooth warp
//! (clean, with outliers, with noise), `match/scaling` the plane's disc from 105 points up. Every
//! answer is checked before it is timed.
#![allow(clippy::print_stdout, missing_docs)]

use std::hint::black_box;
use std::ops::ControlFlow;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use nalgebra::{Point, SVector};
use rand::{RngExt, SeedableRng, rngs::SmallRng};
use tactile_imaging::matching::{
    AnnealedSoftassign, PointMatcher, RelaxationLabelling, SoftassignWorkspace,
};

/// A model, a target, and where each model point truly goes.
struct Scene<const D: usize> {
    model: Vec<Point<f64, D>>,
    target: Vec<Point<f64, D>>,
    truth: Vec<Point<f64, D>>,
}

impl<const D: usize> Scene<D> {
    /// `n` points of a jittered sunflower disc of radius 1 (a bell in space), warped by six broad
    /// Gaussians.
    fn new(n: usize, outliers: usize, noise: f64) -> Self {
        let mut random = SmallRng::seed_from_u64((n + 7 * outliers) as u64);
        let mut uniform = |size: f64| random.random_range(-size..size);
        let model: Vec<Point<f64, D>> = (0..n)
            .map(|i| {
                let (r, angle) = (((i as f64 + 0.5) / n as f64).sqrt(), 2.399_963 * i as f64);
                let jitter = 0.25 / (n as f64).sqrt();
                let plane = [
                    r * angle.cos() + uniform(jitter),
                    r * angle.sin() + uniform(jitter),
                ];
                let bell = 0.6 * (-(plane[0] * plane[0] + plane[1] * plane[1]) / 0.4).exp();
                Point::from(std::array::from_fn(|k| if k < 2 { plane[k] } else { bell }))
            })
            .collect();
        let bumps: Vec<(SVector<f64, D>, SVector<f64, D>)> = (0..6)
            .map(|_| {
                (
                    SVector::from_fn(|_, _| uniform(1.2)),
                    SVector::from_fn(|_, _| uniform(0.2)),
                )
            })
            .collect();
        let warp = |p: &Point<f64, D>| {
            bumps.iter().fold(*p, |q, (c, a)| {
                q + a * (-(p.coords - c).norm_squared() / 1.28).exp()
            })
        };
        let truth: Vec<_> = model.iter().map(warp).collect();
        let mut target: Vec<_> = truth
            .iter()
            .map(|p| p + SVector::from_fn(|_, _| uniform(noise.max(1e-300))))
            .collect();
        target.reverse();
        target.extend((0..outliers).map(|_| Point::from(SVector::from_fn(|_, _| uniform(1.3)))));
        Self {
            model,
            target,
            truth,
        }
    }

    /// Mean distance of the warped points from the truth.
    fn error(&self, warped: impl Iterator<Item = Point<f64, D>>) -> f64 {
        warped
            .zip(&self.truth)
            .map(|(w, t)| (w - t).norm())
            .sum::<f64>()
            / self.truth.len() as f64
    }
}

/// Checks and times the default matcher on one scene; a match through a warm workspace, without the
/// spline of the result.
fn fast<const D: usize>(
    criterion: &mut Criterion,
    group: &str,
    name: &str,
    scene: &Scene<D>,
    bound: f64,
) {
    let matcher = AnnealedSoftassign::default();
    let error = scene.error(
        matcher
            .match_points(&scene.model, &scene.target)
            .unwrap()
            .warped
            .into_iter(),
    );
    assert!(error < bound, "{group}/{name}: error {error}");
    println!("{group}/{name}: mean error {error:.2e}");
    let mut group = criterion.benchmark_group(group);
    group.sample_size(20);
    group.bench_function(BenchmarkId::new("softassign", name), |b| {
        b.iter(|| {
            matcher
                .match_points(black_box(&scene.model), black_box(&scene.target))
                .unwrap()
        });
    });
    let mut workspace = SoftassignWorkspace::default();
    group.bench_function(BenchmarkId::new("softassign_with", name), |b| {
        b.iter(|| {
            let go = |_, _| ControlFlow::Continue(());
            let found = matcher
                .match_points_with(&mut workspace, black_box(&scene.model), &scene.target, go)
                .unwrap();
            black_box(found.assignment.len())
        });
    });
    group.finish();
}

fn sizes(criterion: &mut Criterion) {
    for n in [105, 200] {
        let group = format!("match/{n}x{n}");
        // Clean scenes are solved to rounding; noise of ±0.05 (sd 0.029 an axis) leaves less than
        // half of it.
        fast(
            criterion,
            &group,
            "clean",
            &Scene::<3>::new(n, 0, 0.0),
            1e-9,
        );
        fast(
            criterion,
            &group,
            "outliers",
            &Scene::<3>::new(n, n / 5, 0.0),
            1e-9,
        );
        fast(
            criterion,
            &group,
            "noise",
            &Scene::<3>::new(n, 0, 0.05),
            0.025,
        );
    }
}

/// The paper's relaxation labelling on the same 105 points.
fn labelling(criterion: &mut Criterion) {
    let scene = Scene::<3>::new(105, 0, 0.0);
    let matcher = RelaxationLabelling::default();
    let mut group = criterion.benchmark_group("match/105x105");
    group.sample_size(10);
    group.bench_function(BenchmarkId::new("labelling", "clean"), |b| {
        let mut error = f64::NAN;
        b.iter(|| {
            error = scene.error(
                matcher
                    .match_points(&scene.model, &scene.target)
                    .unwrap()
                    .warped
                    .into_iter(),
            )
        });
        println!("match/105x105/labelling: mean error {error:.2e}");
        // It measured 1.6e-3 of the disc's radius on this scene; three times that would be another
        // answer.
        assert!(error < 5e-3, "labelling: error {error}");
    });
    group.finish();
}

/// The plane's disc, 105 points to sixteen times as many, all of them matched right.
fn scaling(criterion: &mut Criterion) {
    for n in [105, 210, 420, 840, 1680] {
        fast(
            criterion,
            "match/scaling",
            &n.to_string(),
            &Scene::<2>::new(n, 0, 0.0),
            1e-9,
        );
    }
}

criterion_group!(benches, sizes, labelling, scaling);
criterion_main!(benches);
