//! Sessions: the modulus refined, shear followed, drift watched, memory and answer kept.
#![allow(clippy::print_stdout)]
use super::trial;
use tactile_imaging::force::{Estimate, ShearCalibration};
use tactile_imaging::pipeline::Session;
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, Camera, Gain, LoadCycle, PressLoad, PressOptions};

#[test]
fn a_session_refines_the_modulus_and_agrees_with_a_press() {
    let trial = trial(&[0.7, 1.2], 6);
    let pipeline = trial.pipeline().unwrap();
    let expected = trial.press(&pipeline).unwrap().modulus().unwrap();
    let mut session = Session::new(&pipeline, &[trial.simulation.reference.view()]).unwrap();
    assert!(session.modulus().is_err(), "no load yet");
    for frame in &trial.simulation.frames {
        session.push(frame.view()).unwrap();
    }
    let modulus = session.modulus().unwrap();
    // The same two loads; only the calibration's share of the error is averaged in another order.
    assert!((modulus.youngs_modulus_pa / expected.youngs_modulus_pa - 1.0).abs() < 1e-9);
    session.push(trial.simulation.frames[1].view()).unwrap();
    assert_eq!(session.loads(), 2, "an equal frame is no further load");
}

#[test]
fn shear_is_the_way_of_the_centroid_since_contact_began() {
    let mut options = trial(&[0.7], 9).scene.options().clone();
    let shear_n = [0.05, -0.08];
    options.loads = vec![
        PressLoad::normal(0.9),
        PressLoad {
            shear_n,
            ..PressLoad::normal(1.1)
        },
    ];
    let stiffness = options.shear_stiffness_n_per_m;
    let trial = Trial::new(options, &CalibrationRun::default()).unwrap();
    let calibration = ShearCalibration {
        stiffness_n_per_m: stiffness.map(|value| Estimate::new(value, 0.0)),
        residual_sd_n: [0.0; 2],
    };
    let pipeline = trial.pipeline().unwrap();
    let session = Session::new(&pipeline, &[trial.simulation.reference.view()]).unwrap();
    let mut session = session.with_shear(calibration);
    let [first, second] = [0, 1].map(|k| trial.simulation.frames[k].view());
    assert_eq!(
        session
            .push(first)
            .unwrap()
            .shear
            .unwrap()
            .force_n
            .map(|f| f.value),
        [0.0; 2]
    );
    let shear = session.push(second).unwrap().shear.unwrap();
    for (found, truth) in shear.force_n.iter().zip(shear_n) {
        // Six standard errors, and a hundredth of a pixel for what rounding and vignetting do to
        // the centroid.
        let tolerance = 6.0 * found.standard_error + 0.01 * 86.2e-6 * stiffness[0];
        assert!(
            (found.value - truth).abs() < tolerance,
            "{found} N, true {truth} N"
        );
    }
    assert_eq!(
        session.push(second).unwrap().shear.unwrap().displacement_m,
        shear.displacement_m
    );
    assert!(
        session
            .push(trial.scene.reference(3).view())
            .unwrap()
            .shear
            .is_none()
    );
    let anew = session.push(second).unwrap().shear.unwrap();
    assert_eq!(
        anew.force_n.map(|f| f.value),
        [0.0; 2],
        "a new contact starts anew"
    );
}

#[test]
fn drift_of_the_light_is_seen_in_frames_without_contact() {
    let trial = trial(&[0.7], 10);
    let pipeline = trial.pipeline().unwrap();
    let mut session = Session::new(&pipeline, &[trial.simulation.reference.view()]).unwrap();
    session.push(trial.scene.reference(4).view()).unwrap();
    assert_eq!(session.drift().frames, 1);
    assert!(session.drift().caution.is_none(), "{:?}", session.drift());
    let darker = trial.scene.reference(5).mapv(|v| v - 2);
    session.push(darker.view()).unwrap();
    // The means of two exposures of 90 000 pixels with a noise of one level differ by 0.005.
    assert!(
        (session.drift().last_grey + 2.0).abs() < 0.05,
        "{:?}",
        session.drift()
    );
    assert!(session.drift().caution.is_some());
}

/// The answer after 4 000 frames is that after the first cycles, and the truth: the loads kept
/// apart are full after a few hundred.
#[test]
fn four_thousand_frames_leave_memory_and_answer_alone() {
    let camera = Camera::default().coarser(16);
    let (loads, gain) = (vec![PressLoad::normal(1.5)], Gain::PeakGrey(180.0));
    let options = PressOptions {
        camera,
        loads,
        gain,
        seed: 3,
        ..PressOptions::default()
    };
    let trial = Trial::new(options, &CalibrationRun::default()).unwrap();
    let references: Vec<_> = (1..5).map(|k| trial.scene.reference(k)).collect();
    let views: Vec<_> = references.iter().map(|r| r.view()).collect();
    let mut session = Session::new(&trial.pipeline().unwrap(), &views).unwrap();
    let cycle = LoadCycle {
        largest_force_n: 1.5,
        cycles: 49,
        rest_s: 1.0,
        ..LoadCycle::default()
    };
    let mut early = None;
    for (k, streamed) in trial.scene.stream(cycle).unwrap().enumerate() {
        let count = allocation_counter::measure(|| {
            session.push(streamed.frame.view()).unwrap();
        });
        assert!(k < 1_000 || count.count_total == 0, "frame {k}: {count:?}");
        assert!(
            session.loads() <= Session::MOST_LOADS && session.report().skips.len() <= 3,
            "memory is flat"
        );
        if k == 1_000 {
            early = Some(session.modulus().unwrap());
        }
    }
    assert_eq!(session.frames(), 4_000);
    let (early, late) = (early.unwrap(), session.modulus().unwrap());
    let drift = late.youngs_modulus_pa / early.youngs_modulus_pa - 1.0;
    let error = late.youngs_modulus_pa / trial.simulation.youngs_modulus_pa - 1.0;
    println!("drift {drift:+.5}, error {error:+.5}");
    // Two and a half of the early estimate's standard errors, most of which (the calibration's)
    // both have in common.
    assert!(drift.abs() < 0.01, "drift {drift}");
    assert!(error.abs() < 0.03, "error {error}");
    assert!(session.drift().caution.is_none(), "{:?}", session.drift());
}
