//! The pipeline pulls: what is not asked for is not computed, what is skipped changes no answer, stages can be swapped.
mod blocks;
mod hostile;
mod on_demand;
mod own_contact_stage;
mod repeated;
mod results;
mod sources;
mod strain_of_sizes;
mod strain_stream;
mod streams;
mod time;

use nalgebra::Point3;
use ndarray::ArrayView2;
use tactile_imaging::Pipeline;
use tactile_imaging::elasticity::strain::Hencky;
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::pipeline::{Object, PipelineError, Press, SkipReason, Skips, Stage};
use tactile_imaging::sfs::{ControlPointSampler, Domain, EquallySpaced, SfsError};
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, Camera, Elastic, PressLoad, PressOptions, PressScene};

/// A press seen by a camera of 348 × 260 pixels: a sixteenth of the default's, to be quick.
fn trial(forces: &[f64], seed: u64) -> Trial {
    let camera = Camera::default().coarser(4);
    let loads = forces.iter().map(|&f| PressLoad::normal(f)).collect();
    Trial::new(
        PressOptions {
            camera,
            loads,
            seed,
            ..PressOptions::default()
        },
        &CalibrationRun::default(),
    )
    .unwrap()
}

fn runs(press: &Press<'_>) -> [usize; 6] {
    Stage::ALL.map(|stage| press.report().work(stage).runs)
}

#[test]
fn nothing_runs_before_it_is_asked_for() {
    let trial = trial(&[0.7, 1.2], 1);
    let pipeline = trial.pipeline().unwrap();
    let mut press = trial.press(&pipeline).unwrap();
    assert_eq!(runs(&press), [0; 6]);
    press.contact(0).unwrap();
    assert_eq!(
        runs(&press),
        [1, 0, 0, 0, 0, 0],
        "force alone never touches a surface"
    );
    press.modulus().unwrap();
    assert_eq!(
        runs(&press),
        [2, 0, 0, 0, 0, 1],
        "a ball's modulus takes the contacts alone"
    );
    press.surface(1).unwrap();
    assert_eq!(runs(&press), [2, 1, 0, 0, 0, 1]);
    press.strain(1).unwrap();
    press.strain(1).unwrap();
    assert_eq!(
        runs(&press),
        [2, 2, 2, 1, 1, 1],
        "what is known is not computed again"
    );
}

#[test]
fn both_polymers_come_out_within_the_papers_error() {
    for material in [Elastic::CL2000X, Elastic::CL2003X] {
        for seed in 0..4 {
            let mut options = trial(&[0.7, 1.2], seed).scene.options().clone();
            options.object.material = material;
            let trial = Trial::new(options, &CalibrationRun::default()).unwrap();
            let pipeline = trial.pipeline().unwrap();
            let modulus = trial.press(&pipeline).unwrap().modulus().unwrap();
            let error = modulus.youngs_modulus_pa / material.youngs_modulus_pa - 1.0;
            assert!(
                error.abs() < 0.0538,
                "{material:?}, seed {seed}: error {error}"
            );
        }
    }
}

#[test]
fn a_frame_without_contact_stops_there() {
    let trial = trial(&[0.7], 1);
    let pipeline = trial.pipeline().unwrap();
    let empty = trial.scene.reference(7);
    let mut press = pipeline.press(trial.simulation.reference.view()).unwrap();
    press.add_frame(empty.view());
    assert!(press.contact(0).unwrap().is_none());
    assert_eq!(
        press.surface(0).unwrap_err(),
        PipelineError::NoContact { frame: 0 }
    );
    assert_eq!(
        press.modulus().unwrap_err(),
        PipelineError::NoContact { frame: 0 }
    );
    assert_eq!(runs(&press), [1, 0, 0, 0, 0, 0]);
    assert!(
        press
            .report()
            .skips
            .iter()
            .any(|s| s.reason == SkipReason::NoContact)
    );
    assert!(matches!(
        press.contact(1).unwrap_err(),
        PipelineError::NoSuchFrame {
            frame: 1,
            frames: 1
        }
    ));
}

/// All answers of a press that must not depend on what is skipped.
fn answers(trial: &Trial, pipeline: &Pipeline, twice: bool) -> (Vec<u64>, [usize; 6]) {
    let mut press = pipeline.press(trial.simulation.reference.view()).unwrap();
    for frame in &trial.simulation.frames {
        press.add_frame(frame.view());
        if twice {
            press.add_frame(frame.view());
        }
    }
    let last = press.frames() - 1;
    let mut bits = Vec::new();
    for frame in 0..=last {
        bits.push(
            press
                .contact(frame)
                .unwrap()
                .unwrap()
                .contact_radius_m
                .value
                .to_bits(),
        );
        bits.extend(
            press
                .control_points(frame)
                .unwrap()
                .iter()
                .flat_map(|p| [p.x, p.y, p.z].map(f64::to_bits)),
        );
    }
    bits.extend(
        press
            .strain(last)
            .unwrap()
            .summary
            .mean
            .iter()
            .map(|v| v.to_bits()),
    );
    bits.push(press.modulus().unwrap().youngs_modulus_pa.to_bits());
    let work = runs(&press);
    (bits, work)
}

#[test]
fn equal_frames_are_measured_once_with_the_same_bits() {
    let trial = trial(&[0.7, 1.2], 2);
    let with = trial.pipeline().unwrap();
    let skips = Skips {
        equal_frames: false,
        ..Skips::default()
    };
    let without = trial
        .pipeline()
        .unwrap()
        .with_settings(|settings| settings.skips = skips)
        .unwrap();
    let (a, few) = answers(&trial, &with, true);
    let (b, many) = answers(&trial, &without, true);
    assert_eq!(a, b);
    assert_eq!((few[0], many[0]), (2, 4));
    assert_eq!((few[1], many[1]), (2, 4));
}

#[test]
fn surfaces_of_the_box_alone_equal_those_of_the_whole_frame() {
    let trial = trial(&[0.7, 1.2], 3);
    let inside = trial.pipeline().unwrap();
    let skips = Skips {
        outside_contact: false,
        ..Skips::default()
    };
    let whole = trial
        .pipeline()
        .unwrap()
        .with_settings(|settings| settings.skips = skips)
        .unwrap();
    let (mut a, mut b) = (trial.press(&inside).unwrap(), trial.press(&whole).unwrap());
    let (a, b) = (a.surface(0).unwrap(), b.surface(0).unwrap());
    assert!(
        a.surface.heights.len() < b.surface.heights.len() / 2,
        "the box is smaller"
    );
    for ((row, column), h) in a.surface.heights.indexed_iter() {
        if a.surface.mask[[row, column]] {
            let other =
                b.surface.heights[[a.region.row_start + row, a.region.column_start + column]];
            // Sweeps run in another order over another box: rounding alone may differ.
            assert!((h - other).abs() < 1e-9, "{h} against {other}");
        }
    }
}

/// A user's sampler: half as many points.
struct Half;

impl ControlPointSampler<f64> for Half {
    fn sample(
        &self,
        heights: ArrayView2<'_, f64>,
        domain: &Domain<'_, f64>,
        count: usize,
    ) -> Result<Vec<Point3<f64>>, SfsError> {
        EquallySpaced.sample(heights, domain, count / 2)
    }
}

#[test]
fn every_stage_can_be_swapped_in_one_line() {
    let trial = trial(&[0.7, 1.2], 4);
    let pipeline = trial
        .pipeline()
        .unwrap()
        .with_sampler(Half)
        .with_strain(Hencky);
    let mut press = trial.press(&pipeline).unwrap();
    assert_eq!(press.control_points(0).unwrap().len(), 100);
    assert!(press.strain(1).unwrap().measure.contains("Hencky"));
}

#[test]
fn swapped_loads_give_the_same_modulus() {
    let (up, down) = (trial(&[0.7, 1.2], 5), trial(&[1.2, 0.7], 5));
    let modulus = |t: &Trial| {
        let pipeline = t.pipeline().unwrap();
        t.press(&pipeline).unwrap().modulus().unwrap()
    };
    let (a, b) = (modulus(&up), modulus(&down));
    // Other noise in each frame: six standard errors.
    let apart = (a.youngs_modulus_pa - b.youngs_modulus_pa).abs();
    assert!(
        apart < 6.0 * a.standard_error_pa.hypot(b.standard_error_pa),
        "{apart}"
    );
}

#[test]
fn a_flat_field_makes_the_force_the_same_in_a_corner() {
    let mut options = trial(&[0.5], 11).scene.options().clone();
    options.centre_px = Some([50.0, 45.0]);
    options.camera.vignetting = 0.15;
    let corner = Trial::new(options.clone(), &CalibrationRun::default()).unwrap();
    let scene = PressScene::new(PressOptions {
        centre_px: None,
        ..options
    })
    .unwrap();
    // The sensor is calibrated in the frame's middle.
    let series = scene.calibrate(&CalibrationRun::default()).unwrap();
    let pairs: Vec<_> = series
        .pairs
        .iter()
        .map(|p| CalibrationPair::loading(p.integrated_pixel_value, p.force_n))
        .collect();
    let error = |flat: bool| {
        let pipeline =
            Pipeline::from_pairs(&pairs, corner.simulation.pixel_size_m, Object::sphere(3e-3));
        let pipeline = pipeline
            .unwrap()
            .with_settings(|settings| settings.flat_field = flat)
            .unwrap();
        let mut press = corner.press(&pipeline).unwrap();
        press.contact(0).unwrap().unwrap().force_n.unwrap().value / 0.5 - 1.0
    };
    // The corner loses a tenth; what is left is noise (0.3 %) and the calibration (0.3 %).
    assert!(error(false) < -0.05, "{}", error(false));
    assert!(error(true).abs() < 0.02, "{}", error(true));
}
