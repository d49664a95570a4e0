//! The whole pipeline: strain between two loads against control points, smoothing, camera and matcher.

use crate::study::Study;
use tactile_imaging::matching::CoherentPointDrift;
use tactile_imaging::pipeline::{Stages, Trial};
use tactile_imaging::simulate::{CalibrationOptions, Camera, PressOptions};

fn trial(shape: [usize; 2]) -> Trial {
    let pixel = 30e-3 / shape[1] as f64;
    let camera = Camera { shape, pixel_size_m: [pixel; 2], ..Camera::default() };
    Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())
        .expect("valid options")
}

fn run(
    study: &mut Study,
    trial: &Trial,
    knob: &'static str,
    setting: &str,
    is_default: bool,
    stages: &dyn Stages,
) {
    let truth = trial.truth();
    let expected = truth.strain.expect("two loads");
    let job = || trial.press(stages).and_then(|mut press| press.measure()).expect("a measurement");
    study.run(knob, setting, is_default, job, |measured| {
        let mean = measured.strain.as_ref().expect("a strain").mean;
        (0..3).map(|k| (mean[k][k] / expected[k][k] - 1.0).abs()).fold(0.0, f64::max)
    });
}

pub(crate) fn strain(study: &mut Study) {
    study.error_label = "largest error of a normal strain, relative";
    let usual = trial(study.choose([260, 348], [521, 696]));
    let stages = || usual.pipeline().expect("a calibrated sensor");
    run(study, &usual, "pipeline", "default", true, &stages());
    for count in [50, 100, 400] {
        run(study, &usual, "control points", &count.to_string(), false, &stages().with_control_points(count));
    }
    for width in [1, 3, 7, 11] {
        run(study, &usual, "smoothing", &format!("{width} px"), false, &stages().with_smoothing(width));
    }
    run(
        study,
        &usual,
        "matcher",
        "point drift",
        false,
        &stages().with_matcher(CoherentPointDrift::default()),
    );
    for shape in study.choose(vec![[130, 174]], vec![[130, 174], [260, 348], [1042, 1392]]) {
        let trial = trial(shape);
        let stages = trial.pipeline().expect("a calibrated sensor");
        run(study, &trial, "camera", &format!("{} × {}", shape[1], shape[0]), false, &stages);
    }
}
