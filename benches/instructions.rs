//! The four jobs whose instructions are counted: the 105 × 105 match, the frame pass, the spline fit at 200 points, the pipeline.
//!
//! `evidence/counts.py` runs each under `valgrind --tool=callgrind --toggle-collect`, which counts what happens inside
//! [`counted`] alone. Without arguments, or with `--test`, every job runs once and its answer is asserted.
#![allow(missing_docs, clippy::print_stdout)]

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng, rngs::SmallRng};
use tactile_imaging::force::ReferenceFrame;
use tactile_imaging::matching::{AnnealedSoftassign, PointMatcher};
use tactile_imaging::pipeline::Trial;
use tactile_imaging::simulate::{CalibrationOptions, Camera, PressOptions};
use tactile_imaging::tps::{FitOptions, NegR, ThinPlateSpline};

/// The job; its name is what callgrind looks for.
#[inline(never)]
fn counted<T>(job: impl FnOnce() -> T) -> T {
    std::hint::black_box(job())
}

type Points = Vec<Point3<f64>>;

/// `n` points of a jittered disc bent into a bell, and where a smooth map takes them.
fn cloud(n: usize) -> (Points, Points) {
    let mut random = SmallRng::seed_from_u64(n as u64);
    let mut uniform = |size: f64| random.random_range(-size..size);
    let bumps: Vec<(Vector3<f64>, Vector3<f64>)> = (0..6)
        .map(|_| {
            (
                Vector3::from_fn(|_, _| uniform(1.2)),
                Vector3::from_fn(|_, _| uniform(0.2)),
            )
        })
        .collect();
    let model: Points = (0..n)
        .map(|i| {
            let (r, angle) = (((i as f64 + 0.5) / n as f64).sqrt(), 2.399_963 * i as f64);
            let jitter = 0.25 / (n as f64).sqrt();
            let (x, y) = (
                r * angle.cos() + uniform(jitter),
                r * angle.sin() + uniform(jitter),
            );
            Point3::new(x, y, 0.6 * (-(x * x + y * y) / 0.4).exp())
        })
        .collect();
    let map = |p: &Point3<f64>| {
        bumps.iter().fold(*p, |q, (c, a)| {
            q + a * (-(p.coords - c).norm_squared() / 1.28).exp()
        })
    };
    let moved = model.iter().map(map).collect();
    (model, moved)
}

fn distance(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).norm())
        .fold(0.0, f64::max)
}

fn match_105() {
    let (model, moved) = cloud(105);
    let mut target = moved.clone();
    target.reverse();
    let matching =
        counted(|| AnnealedSoftassign::default().match_points(&model, &target)).expect("a match");
    // A clean scene is solved to rounding.
    assert!(distance(&matching.warped, &moved) < 1e-9);
}

fn spline_fit_200() {
    let (model, moved) = cloud(200);
    let spline =
        counted(|| ThinPlateSpline::fit(&model, &moved, &FitOptions::new(NegR))).expect("a spline");
    // Interpolation: rounding times the condition number, about 1e3.
    assert!(spline.report.residual.expect("measured") < 1e-11);
}

fn frame_pass() {
    let image = |step: usize| {
        ndarray::Array2::from_shape_fn((1042, 1392), |(y, x)| {
            ((y * 7919 + x * 104_729 + step) % 251) as u8
        })
    };
    let (before, after) = (image(0), image(31));
    let reference = ReferenceFrame::new(before.view()).expect("a frame");
    let statistics = counted(|| reference.compare(after.view(), 10)).expect("the same size");
    let sum = |a: &ndarray::Array2<u8>| a.iter().map(|&v| i64::from(v)).sum::<i64>();
    assert_eq!(statistics.sum, sum(&after) - sum(&before));
}

/// The whole pipeline on frames of 348 × 260 pixels, a quarter of the paper's each way: callgrind slows it fiftyfold.
fn pipeline() {
    let camera = Camera::default().coarser(4);
    let options = PressOptions {
        camera,
        ..PressOptions::default()
    };
    let trial = Trial::new(options, &CalibrationOptions::default()).expect("default options");
    let stages = trial.pipeline().expect("a calibrated sensor");
    let measured =
        counted(|| trial.press(&stages).map(|mut press| press.measure())).expect("a press");
    let modulus = measured.youngs_modulus_pa.expect("a modulus").value;
    let error = modulus / trial.simulation.youngs_modulus_pa - 1.0;
    // The paper's own error.
    assert!(error.abs() < 0.0538, "{error}");
}

const JOBS: [(&str, fn()); 4] = [
    ("match_105", match_105),
    ("frame_pass", frame_pass),
    ("spline_fit_200", spline_fit_200),
    ("pipeline", pipeline),
];

fn main() {
    let wanted: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    for (name, job) in JOBS {
        if wanted.is_empty() || wanted.iter().any(|w| w == name) {
            job();
            println!("instructions/{name}: the answer is right");
        }
    }
}
