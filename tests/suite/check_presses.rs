//! Presses of known force, which replace the assumptions on the reflectance of the object and on
//! the lamps.
use crate::common::{press_of, trial};
use ndarray::Array2;
use tactile_imaging::force::{Estimate, Source};
use tactile_imaging::pipeline::{CheckPress, CheckedObject, Measurement};
use tactile_simulate::{Camera, Trial};

/// A press with 0.7 and 1.2 N and, for the check, 1 N. Its light is multiplied by a factor.
fn press(seed: u64, light: f64) -> (Trial, Vec<Array2<u8>>) {
    let trial = trial(Camera::default().coarser(4), &[0.7, 1.2, 1.0], seed);
    let reference = &trial.simulation.reference;
    let dimmed = |frame: &Array2<u8>| {
        let dim = |frame: u8, reference: u8| {
            let reference = f64::from(reference);
            (reference + light * (f64::from(frame) - reference)).round() as u8
        };
        let both = ndarray::Zip::from(frame).and(reference);
        both.map_collect(|&frame, &reference| dim(frame, reference))
    };
    let frames = trial.simulation.frames.iter().map(dimmed).collect();
    (trial, frames)
}

/// Measures the first two frames. The third is the check, with a weight known to 0.2 %.
fn measured(trial: &Trial, frames: &[Array2<u8>], object: Option<CheckedObject>) -> Measurement {
    let mut pipeline = trial.pipeline().unwrap();
    pipeline = pipeline
        .with_settings(|settings| settings.assumptions.forget(Source::Coupling))
        .unwrap();
    let reference = trial.simulation.reference.view();
    if let Some(object) = object {
        let known_n = Estimate::new(1.0, 2e-3);
        let check = CheckPress::new(frames[2].view(), known_n, object);
        pipeline = pipeline.with_checks(reference, &[check]).unwrap();
    }
    press_of(&pipeline, reference, frames[..2].to_vec()).measure()
}

#[test]
fn a_press_of_the_sample_under_a_weight_makes_its_modulus_right() {
    for (seed, light) in [(1, 0.7), (2, 0.8), (3, 0.95), (4, 1.0), (5, 1.1)] {
        let (trial, frames) = press(seed, light);
        let truth = trial.simulation.youngs_modulus_pa;
        let found = measured(&trial, &frames, Some(CheckedObject::Sample));
        for (frame, known_n) in found.frames.iter().zip([0.7, 1.2]) {
            let force = frame.as_ref().unwrap().force_n.clone().unwrap();
            let z = (force.value - known_n) / force.standard_error;
            assert!(z.abs() < 3.0, "light {light}: {force:?} for {known_n}");
            assert!(force.relative_error() < 0.01, "light {light}: {force:?}");
        }
        let modulus = found.youngs_modulus_pa.unwrap();
        let (low, high) = (modulus.interval_95.0, modulus.interval_95.1.unwrap());
        assert!(low < truth && truth < high, "light {light}: {modulus}");
        // Without the check the coupling alone has an error of 6 %.
        assert!(
            (high - low) / 2.0 < 0.06 * truth,
            "light {light}: {modulus}"
        );
    }
}

/// The lamps are then known, but not the coupling of the object.
#[test]
fn a_press_of_the_calibrator_leaves_the_coupling_open() {
    let (trial, frames) = press(6, 0.8);
    let [none, calibrator] = [None, Some(CheckedObject::Calibrator)].map(|object| {
        let frames = measured(&trial, &frames, object).frames;
        frames[0].as_ref().unwrap().force_n.clone().unwrap()
    });
    assert!((none.value / 0.56 - 1.0).abs() < 0.01, "a fifth is missing");
    assert!((calibrator.value / 0.7 - 1.0).abs() < 0.01);
    assert!((calibrator.relative_error() / none.relative_error() - 1.0).abs() < 0.01);
}
