//! A sensor calibrated from frames, and moduli measured with it.
#![allow(clippy::print_stdout)]
mod layers;
mod sensors;
mod uncalibrated;

use crate::common::{Study, press_of};
use sensors::{
    BALL_ERROR, Effects, POISSON_ERROR, SAMPLE_PA, SAMPLE_POISSON, SAMPLE_RADIUS_M, Simulated,
    estimator,
};
use tactile_files::sensor::{Indenter, Sensor, SensorCalibration, SensorError};
use tactile_imaging::force::Source;
use tactile_imaging::force::{ContactOptions, DriftCorrection, ForceOptions};
use tactile_imaging::pipeline::{Assumptions, Object, Pipeline};
use tactile_simulate::Camera;

/// Changes of the illumination are divided out if they can be determined, as in the pipeline of a
/// calibrated sensor.
fn drift_corrected() -> ForceOptions {
    let contact = ContactOptions::default().with_drift(DriftCorrection::Automatic);
    ForceOptions::default().with_contact(contact)
}

const SAMPLE: Object = Object::Sphere {
    radius_m: SAMPLE_RADIUS_M,
    poisson_ratio: SAMPLE_POISSON,
};

fn state_sample(errors: &mut Assumptions) {
    errors.state(Source::ObjectSize, BALL_ERROR);
    errors.state(Source::PoissonRatio, POISSON_ERROR);
    errors.state(Source::Adhesion, 0.0);
}

/// The pipeline of the study: the estimator is the linear law that generated the contacts.
fn pipeline(sensor: &Sensor) -> Pipeline {
    let guide = sensor.waveguide().unwrap();
    sensor
        .pipeline(SAMPLE)
        .unwrap()
        .with_settings(|settings| {
            state_sample(&mut settings.assumptions);
        })
        .unwrap()
        .with_estimator(estimator(SAMPLE_RADIUS_M, SAMPLE_POISSON, &guide))
}

fn study(exponents: &[f64], camera: Camera, sensors: u64, presses: u32) -> Study {
    let mut study = Study::default();
    for seed in 0..sensors {
        let effects = Effects {
            exponent: exponents[seed as usize % exponents.len()],
            ..Effects::ALL
        };
        let mut simulated = Simulated::new(effects, camera, 1000 + seed);
        let calibrated = simulated.calibration().run().unwrap();
        let scatter = calibrated.sensor.curve.report.residual_sd;
        println!(
            "sensor {seed}, p^{}: scatter {scatter:.2}",
            effects.exponent
        );
        let pipeline = pipeline(&calibrated.sensor);
        let reference = simulated.reference();
        for repeat in 0..presses {
            let press = press_of(&pipeline, reference.view(), simulated.press(repeat));
            let modulus = press.modulus().unwrap();
            if repeat == 0 {
                println!("  {:?}", press.measure().error_budget);
            }
            study.add(&modulus, SAMPLE_PA);
        }
    }
    study.print("every effect at once");
    study
}

/// The paper's camera with pixels twice as wide over the same 30 mm: small enough for a test. The
/// averaging over a pixel is so small that the nonlinear local curve gives the same pressure from
/// the mean light of a pixel as from its parts.
fn half() -> Camera {
    Camera::default().coarser(2)
}

#[test]
fn a_sensor_with_every_effect_is_calibrated() {
    let study = study(&[0.8, 1.2], half(), 2, 4);
    let [median, worst] = study.median_and_worst();
    // The bounds of the full study. Eight draws hardly allow tighter ones.
    assert!(median < 0.02 && worst < 0.06, "{:?}", study.errors);
    assert!(study.held() >= 0.5);
}

/// Every mistake gives one sentence that names it, before any file is written.
#[test]
fn mistakes_of_a_calibration_are_named() {
    let effects = Effects {
        exponent: 1.0,
        ..Effects::ALL
    };
    let good = Simulated::new(effects, Camera::default().coarser(4), 77).calibration();
    let sentence = |change: &dyn Fn(&mut SensorCalibration)| {
        let mut broken = good.clone();
        change(&mut broken);
        broken.run().unwrap_err()
    };
    let few = sentence(&|c| c.presses.truncate(3));
    assert!(
        matches!(few, SensorError::TooFewPresses { found: 3, .. }),
        "{few}"
    );
    let uncovered = sentence(&|c| c.covers_n = Some([0.1, 2.0]));
    assert!(
        matches!(uncovered, SensorError::NotCovered { .. }),
        "{uncovered}"
    );
    // All balls are twice as large as stated: the layers are twice as soft, which is seven times
    // their stated error.
    let balls = sentence(&|c| {
        for press in &mut c.presses {
            if let Indenter::Ball { radius_m, .. } = &mut press.indenter {
                *radius_m *= 2.0;
            }
        }
    });
    assert!(matches!(balls, SensorError::Radius { .. }), "{balls}");
    // The largest force of the largest ball. The other balls reach its pressures too, so that the
    // curve cannot adapt to it.
    let force = sentence(&|c| c.presses[37].force_n *= 1.3);
    assert!(
        matches!(force, SensorError::Scatter { worst: 37, .. }),
        "{force}"
    );
    let target = sentence(&|c| c.target = Some((c.references[0].clone(), 1e-3, 0.0)));
    assert!(matches!(target, SensorError::Target { .. }), "{target}");
    for error in [few, uncovered, balls, force, target] {
        let text = error.to_string();
        assert!(!text.contains('\n') && text.len() < 200, "{text}");
    }
}

/// A sensor file that is read gives the written sensor, and the error of an invalid file names the
/// cause.
#[test]
fn a_sensor_file_is_read_as_it_was_written() {
    let calibrated = Simulated::new(Effects::ALL, Camera::default().coarser(4), 78)
        .calibration()
        .run()
        .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sensor.toml");
    calibrated.sensor.write(&path).unwrap();
    assert_eq!(Sensor::read(&path).unwrap(), calibrated.sensor);
    let text = std::fs::read_to_string(&path).unwrap();
    let broken = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        Sensor::read(&path).unwrap_err().to_string()
    };
    for (from, to, field) in [
        ("flat_field = true", "flat_field = 3", "flat_field"),
        ("gauge_error = ", "gauge_error = -", "gauge_error"),
        ("target_error", "target_eror", "target_eror"),
        ("thickness_m = ", "thickness_m = -", "layers"),
        ("radius_px = ", "radius_px = -", "radius_px"),
    ] {
        let error = broken(from, to);
        let named = error.contains("sensor.toml: ") && error.contains(field);
        assert!(named && !error.contains('\n'), "{error}");
    }
}

/// The whole study: the paper's camera, twenty sensors and ten presses on each.
#[test]
#[ignore = "minutes: run by the step `studies` of the checks"]
fn study_moduli_with_every_effect_at_once() {
    let study = study(&[0.8, 0.9, 1.0, 1.1, 1.2], Camera::default(), 20, 10);
    let [median, worst] = study.median_and_worst();
    assert!(median < 0.02 && worst < 0.06, "{median} {worst}");
    assert!((0.92..=0.98).contains(&study.held()), "{study:?}");
}
