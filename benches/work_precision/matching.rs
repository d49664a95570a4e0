//! Matchers on 105 points in space: options of the default matcher, and the other matchers.

use crate::study::Study;
use tactile_imaging::matching::labelling::Neighbourhood;
use tactile_imaging::matching::{
    AnnealedSoftassign, CoherentPointDrift, LinearAssignment, NearestNeighbour, Outliers,
    PointMatcher, RelaxationLabelling, Rotation,
};

type Scene = tactile_benches::Scene<3>;

/// A scene of 105 points.
fn scene(seed: u64, outliers: usize, noise: f64) -> Scene {
    Scene::new(seed, 105, 0.025, outliers, noise)
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
        let errors = scenes
            .iter()
            .zip(all)
            .map(|(scene, warped)| scene.error(warped));
        errors.sum::<f64>() / scenes.len() as f64
    });
    let last = study.entries.last_mut().expect("an entry");
    last.seconds /= scenes.len() as f64;
}

pub(crate) fn noisy(study: &mut Study) {
    study.error_label = "mean error, radius 1, noise ±0.03";
    let seeds = 0..study.choose(4, 16);
    every(
        study,
        &seeds.map(|seed| scene(seed, 0, 0.03)).collect::<Vec<_>>(),
    );
}

pub(crate) fn outliers(study: &mut Study) {
    study.error_label = "mean error, radius 1, 21 outliers";
    let seeds = 0..study.choose(4, 16);
    every(
        study,
        &seeds.map(|seed| scene(seed, 21, 0.01)).collect::<Vec<_>>(),
    );
}

fn every(study: &mut Study, scenes: &[Scene]) {
    let neighbours = study.choose(vec![5], vec![5, 8, 12, 20]);
    let mut run = |knob, setting: &str, matcher: &dyn PointMatcher<3>| {
        let is_default = setting == "default";
        run(study, scenes, knob, setting, is_default, matcher);
    };
    let options = AnnealedSoftassign::default();
    run("annealed softassign", "default", &options);
    for limit in [1, 3, 10, 30] {
        let options = options.with_max_iterations(limit).expect("valid");
        run("iterations", &format!("at most {limit}"), &options);
    }
    for share in [0.01, 0.3] {
        let options = options.with_outlier_ratio(share).expect("valid");
        run("outlier ratio", &share.to_string(), &options);
    }
    for side in [Outliers::None, Outliers::Target] {
        run(
            "outliers",
            &format!("{side:?}"),
            &options.with_outliers(side),
        );
    }
    run("rotation", "any", &options.with_rotation(Rotation::Any));
    run(
        "baselines",
        "nearest neighbour",
        &NearestNeighbour::default(),
    );
    run(
        "baselines",
        "linear assignment",
        &LinearAssignment::default(),
    );
    for tolerance in [1e-2, 1e-5, 1e-8] {
        let options = CoherentPointDrift::default().with_tolerance(tolerance);
        let setting = format!("tolerance {tolerance}");
        run("point drift", &setting, &options.expect("valid"));
    }
    for k in neighbours {
        let options = RelaxationLabelling::default().with_neighbourhood(Neighbourhood::Nearest(k));
        let setting = format!("{k} neighbours");
        run("relaxation labelling", &setting, &options.expect("valid"));
    }
}
