//! Matchers on 105 points in space: options of the fast one, and the others.

use crate::study::Study;
use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng, rngs::SmallRng};
use tactile_imaging::matching::labelling::Neighbourhood;
use tactile_imaging::matching::{
    AnnealedSoftassign, CoherentPointDrift, LinearAssignment, NearestNeighbour, Outliers,
    PointMatcher, RelaxationLabelling, Rotation,
};

struct Scene {
    model: Vec<Point3<f64>>,
    target: Vec<Point3<f64>>,
    truth: Vec<Point3<f64>>,
}

impl Scene {
    /// A jittered disc of radius 1 bent into a bell, moved by six broad Gaussians.
    fn new(seed: u64, outliers: usize, noise: f64) -> Self {
        const N: usize = 105;
        let mut random = SmallRng::seed_from_u64(seed);
        let mut uniform = |size: f64| random.random_range(-size..size);
        let model: Vec<Point3<f64>> = (0..N)
            .map(|i| {
                let (r, angle) = (((i as f64 + 0.5) / N as f64).sqrt(), 2.399_963 * i as f64);
                let (x, y) = (
                    r * angle.cos() + uniform(0.025),
                    r * angle.sin() + uniform(0.025),
                );
                Point3::new(x, y, 0.6 * (-(x * x + y * y) / 0.4).exp())
            })
            .collect();
        let bumps: Vec<(Vector3<f64>, Vector3<f64>)> = (0..6)
            .map(|_| {
                (
                    Vector3::from_fn(|_, _| uniform(1.2)),
                    Vector3::from_fn(|_, _| uniform(0.2)),
                )
            })
            .collect();
        let warp = |p: &Point3<f64>| {
            bumps.iter().fold(*p, |q, (c, a)| {
                q + a * (-(p.coords - c).norm_squared() / 1.28).exp()
            })
        };
        let truth: Vec<_> = model.iter().map(warp).collect();
        let mut target: Vec<_> = truth
            .iter()
            .map(|p| p + Vector3::from_fn(|_, _| uniform(noise)))
            .collect();
        target.reverse();
        target.extend((0..outliers).map(|_| Point3::from(Vector3::from_fn(|_, _| uniform(1.3)))));
        Self {
            model,
            target,
            truth,
        }
    }
}

/// The mean over several scenes: time and error of one match.
fn run(
    study: &mut Study,
    scenes: &[Scene],
    knob: &'static str,
    setting: &str,
    is_default: bool,
    matcher: &dyn PointMatcher<3>,
) {
    let job = || {
        let warped = |s: &Scene| {
            matcher
                .match_points(&s.model, &s.target)
                .expect("a match")
                .warped
        };
        scenes.iter().map(warped).collect::<Vec<_>>()
    };
    study.run(knob, setting, is_default, job, |all| {
        let of = |(warped, scene): (&Vec<Point3<f64>>, &Scene)| {
            warped
                .iter()
                .zip(&scene.truth)
                .map(|(w, t)| (w - t).norm())
                .sum::<f64>()
                / scene.truth.len() as f64
        };
        all.iter().zip(scenes).map(of).sum::<f64>() / scenes.len() as f64
    });
    let last = study.entries.last_mut().expect("an entry");
    last.seconds /= scenes.len() as f64;
}

pub(crate) fn noisy(study: &mut Study) {
    study.error_label = "mean error, radius 1, noise ±0.03";
    let scenes: Vec<_> = (0..study.choose(4, 16))
        .map(|seed| Scene::new(seed, 0, 0.03))
        .collect();
    every(study, &scenes);
}

pub(crate) fn outliers(study: &mut Study) {
    study.error_label = "mean error, radius 1, 21 outliers";
    let scenes: Vec<_> = (0..study.choose(4, 16))
        .map(|seed| Scene::new(seed, 21, 0.01))
        .collect();
    every(study, &scenes);
}

fn every(study: &mut Study, scenes: &[Scene]) {
    let options = AnnealedSoftassign::default();
    run(
        study,
        scenes,
        "annealed softassign",
        "default",
        true,
        &options,
    );
    for limit in [1, 3, 10, 30] {
        let options = options.with_max_iterations(limit).expect("valid");
        run(
            study,
            scenes,
            "iterations",
            &format!("at most {limit}"),
            false,
            &options,
        );
    }
    for share in [0.01, 0.3] {
        let options = options.with_outlier_ratio(share).expect("valid");
        run(
            study,
            scenes,
            "outlier ratio",
            &format!("{share}"),
            false,
            &options,
        );
    }
    for side in [Outliers::None, Outliers::Target] {
        let matcher = options.with_outliers(side);
        run(
            study,
            scenes,
            "outliers",
            &format!("{side:?}"),
            false,
            &matcher,
        );
    }
    run(
        study,
        scenes,
        "rotation",
        "any",
        false,
        &options.with_rotation(Rotation::Any),
    );
    others(study, scenes);
}

fn others(study: &mut Study, scenes: &[Scene]) {
    run(
        study,
        scenes,
        "baselines",
        "nearest neighbour",
        false,
        &NearestNeighbour::default(),
    );
    run(
        study,
        scenes,
        "baselines",
        "linear assignment",
        false,
        &LinearAssignment::default(),
    );
    for tolerance in [1e-2, 1e-5, 1e-8] {
        let options = CoherentPointDrift::default().with_tolerance(tolerance);
        let drift = options.expect("valid");
        run(
            study,
            scenes,
            "point drift",
            &format!("tolerance {tolerance}"),
            false,
            &drift,
        );
    }
    for k in study.choose(vec![5], vec![5, 8, 12, 20]) {
        let options = RelaxationLabelling::default().with_neighbourhood(Neighbourhood::Nearest(k));
        let labelling = options.expect("valid");
        run(
            study,
            scenes,
            "relaxation labelling",
            &format!("{k} neighbours"),
            false,
            &labelling,
        );
    }
}
