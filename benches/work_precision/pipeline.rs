//! The whole pipeline: strain between two loads, depending on control points, smoothing, camera and
//! matcher.

use crate::study::Study;
use tactile_imaging::Pipeline;
use tactile_imaging::matching::CoherentPointDrift;
use tactile_imaging::pipeline::Binning;
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, Camera, PressLoad, PressOptions};

/// Presses on one sensor with different forces and noise. A single press would depend on its noise.
fn trials(shape: [usize; 2], count: u64) -> Vec<Trial> {
    let camera = Camera {
        shape,
        pixel_size_m: [30e-3 / shape[1] as f64; 2],
        ..Camera::default()
    };
    let trial = |seed: u64| {
        let low = 0.6 + 0.2 * seed as f64 / count as f64;
        let loads = [low, low / 0.7 * 1.2].map(PressLoad::normal).to_vec();
        let options = PressOptions {
            camera,
            loads,
            seed,
            ..PressOptions::default()
        };
        Trial::new(options, &CalibrationRun::default()).expect("valid options")
    };
    (0..count).map(trial).collect()
}

/// Root mean square over the presses of the largest error of a normal strain, and the time of all
/// presses.
fn run(
    study: &mut Study,
    trials: &[Trial],
    knob: &'static str,
    setting: &str,
    is_default: bool,
    change: &dyn Fn(Pipeline) -> Pipeline,
) {
    let pipeline = |trial: &Trial| change(trial.pipeline().expect("a calibrated sensor"));
    let pipelines: Vec<_> = trials.iter().map(pipeline).collect();
    let strain = |(trial, pipeline): (&Trial, &Pipeline)| {
        let measured = trial.press(pipeline).map(|press| press.measure());
        measured.expect("a press").strain.expect("a strain").mean
    };
    let job = || -> Vec<_> { trials.iter().zip(&pipelines).map(strain).collect() };
    study.run(knob, setting, is_default, job, |found| {
        let worst = |(mean, trial): (&[[f64; 3]; 3], &Trial)| {
            let frames = &trial.simulation.truth;
            let truth = frames[0].scaling_to(&frames[1]).green_lagrange_strain();
            (0..3)
                .map(|k| (mean[k][k] / truth[(k, k)] - 1.0).abs())
                .fold(0.0, f64::max)
        };
        let squares: f64 = found.iter().zip(trials).map(worst).map(|e| e * e).sum();
        (squares / trials.len() as f64).sqrt()
    });
}

pub(crate) fn strain(study: &mut Study) {
    study.error_label = "largest error of a normal strain, relative";
    let count = study.choose(4, 12);
    let usual = trials(Camera::default().shape, count);
    let sides = study.choose(vec![3, 6], vec![2, 3, 5, 6, 8]);
    let shapes = study.choose(vec![[260, 348]], vec![[130, 174], [260, 348], [521, 696]]);
    let mut with = |knob, setting: &str, change: &dyn Fn(Pipeline) -> Pipeline| {
        run(study, &usual, knob, setting, setting == "default", change);
    };
    with("pipeline", "default", &|pipeline| pipeline);
    for points in [50, 100, 400] {
        with("control points", &points.to_string(), &|pipeline| {
            pipeline.with_control_points(points)
        });
    }
    for width in [1, 3, 11] {
        with("smoothing", &format!("{width} px"), &|pipeline| {
            let set = pipeline.with_settings(|settings| settings.smoothing_px = width);
            set.expect("odd")
        });
    }
    for side in sides {
        with("binning", &format!("{side} px"), &|pipeline| {
            let binning = Binning::Blocks(side);
            let set = pipeline.with_settings(|settings| settings.binning = binning);
            set.expect("a block")
        });
    }
    with("matcher", "point drift", &|pipeline| {
        pipeline.with_matcher(CoherentPointDrift::default())
    });
    for shape in shapes {
        let name = format!("{} × {}", shape[1], shape[0]);
        let trials = trials(shape, count);
        run(study, &trials, "camera", &name, false, &|pipeline| pipeline);
    }
}
