//! The matchers beside the fast one on its standard case, 105 points to 105.
//!
//! `match/105x105/{dense, dense_8_neighbours, cpd, cpd_rank_30, assignment, nearest}`. Each match
//! is checked against its truth, and its mean error in percent of the diameter is printed beside
//! the time.
#![allow(clippy::print_stdout)] // the error beside the time

use criterion::{Criterion, SamplingMode, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Duration;
use tactile_imaging::matching::labelling::Neighbourhood;
use tactile_imaging::matching::{
    CoherentPointDrift, LinearAssignment, Motion, NearestNeighbour, PointMatcher,
    RelaxationLabelling,
};

type Point3 = nalgebra::Point3<f64>;

/// A sunflower head of `n` points on a shallow bell, the same after a smooth deformation of `size`
/// diameters, and where each went.
struct Scene {
    model: Vec<Point3>,
    target: Vec<Point3>,
    order: Vec<usize>,
}

fn scene(n: usize, size: f64) -> Scene {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let model: Vec<Point3> = (0..n)
        .map(|k| {
            let (radius, angle) = (
                0.5 * ((k as f64 + 0.5) / n as f64).sqrt(),
                golden * k as f64,
            );
            Point3::new(
                radius * angle.cos(),
                radius * angle.sin(),
                0.25 * (-8.0 * radius * radius).exp(),
            )
        })
        .collect();
    let bend = |p: &Point3| {
        let wave = |x: f64, phase: f64| size * (4.0 * x + phase).sin();
        Point3::new(
            p.x + wave(p.y, 0.3),
            p.y + wave(p.x, 1.1),
            p.z + 0.5 * wave(p.x + p.y, 2.0),
        )
    };
    // A step prime to n visits every row once.
    let step = (1..)
        .map(|k| 37 + k)
        .find(|&step| gcd(step, n) == 1)
        .unwrap_or(1);
    let order: Vec<usize> = (0..n).map(|k| k * step % n).collect();
    let target = order.iter().map(|&k| bend(&model[k])).collect();
    Scene {
        model,
        target,
        order,
    }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Matches once: at least `share` of the pairs must be right, the mean error (percent of the
/// diameter) below `bound`; prints both.
fn check(name: &str, matcher: &dyn PointMatcher<3>, scene: &Scene, share: f64, bound: f64) {
    let matching = matcher
        .match_points(&scene.model, &scene.target)
        .expect("good points");
    let n = scene.model.len();
    let truth = |k: usize| {
        scene.target[scene
            .order
            .iter()
            .position(|&i| i == k)
            .expect("a permutation")]
    };
    let error = 100.0
        * (0..n)
            .map(|k| (matching.warped[k] - truth(k)).norm())
            .sum::<f64>()
        / n as f64;
    let right = (0..n)
        .filter(|&k| matching.assignment[k].is_some_and(|j| scene.order[j] == k))
        .count() as f64
        / n as f64;
    println!(
        "{name}: error {error:.4} %, right {:.1} %, {} iterations",
        100.0 * right,
        matching.report.iterations
    );
    assert!(right >= share && error <= bound, "{name}");
}

/// Name, matcher, least share of right pairs, largest error in % of the diameter.
type Row<'a> = (&'a str, Box<dyn PointMatcher<3>>, f64, f64);

fn standard_case(criterion: &mut Criterion) {
    let scene = scene(105, 0.05);
    let drift = |rank| {
        let motion = Motion::NonRigid {
            beta: 2.0,
            lambda: 3.0,
            rank,
        };
        let options = CoherentPointDrift::default().with_motion(motion);
        options.expect("a valid motion")
    };
    let mut group = criterion.benchmark_group("match/105x105");
    let quick: [Row<'_>; 4] = [
        ("cpd", Box::new(drift(None)), 0.99, 0.5),
        ("cpd_rank_30", Box::new(drift(Some(30))), 0.99, 0.5),
        (
            "assignment",
            Box::new(LinearAssignment::default()),
            0.5,
            6.0,
        ),
        ("nearest", Box::new(NearestNeighbour::default()), 0.2, 1e3),
    ];
    for (name, matcher, share, bound) in quick {
        check(name, &*matcher, &scene, share, bound);
        group.bench_function(name, |b| {
            b.iter(|| matcher.match_points(black_box(&scene.model), &scene.target))
        });
    }
    // The paper's method takes seconds: one match a sample, and as few samples as there may be.
    group
        .sampling_mode(SamplingMode::Flat)
        .sample_size(10)
        .warm_up_time(Duration::from_millis(1));
    group.measurement_time(Duration::from_millis(1));
    let eight = RelaxationLabelling::default()
        .with_neighbourhood(Neighbourhood::Nearest(8))
        .expect("neighbours");
    let labelling = [
        ("labelling_8_neighbours", eight),
        ("labelling", RelaxationLabelling::default()),
    ];
    for (name, options) in labelling {
        let matcher = options;
        check(name, &matcher, &scene, 0.99, 0.5);
        group.bench_function(name, |b| {
            b.iter(|| matcher.match_points(black_box(&scene.model), &scene.target))
        });
    }
}

criterion_group!(benches, standard_case);
criterion_main!(benches);
