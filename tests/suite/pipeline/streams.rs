//! Sessions: shear is followed, drift is monitored, and memory and results stay constant.
#![allow(clippy::print_stdout)]
use super::trial;
use tactile_imaging::force::{Estimate, ShearCalibration, ShearMeasurement};
use tactile_imaging::pipeline::Session;
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, Camera, Gain, LoadCycle, PressLoad, PressOptions};

#[test]
fn shear_is_the_way_of_the_centroid_since_contact_began() {
    let mut options = trial(&[0.7], 9).scene.options().clone();
    let shear_n = [0.05, -0.08];
    options.loads = [0.9, 1.1].map(PressLoad::normal).to_vec();
    options.loads[1].shear_n = shear_n;
    let stiffness = options.shear_stiffness_n_per_m;
    let trial = Trial::new(options, &CalibrationRun::default()).unwrap();
    let calibration = ShearCalibration::new(stiffness.map(|value| Estimate::new(value, 0.0)));
    let pipeline = trial.pipeline().unwrap();
    let session = Session::new(&pipeline, &[trial.simulation.reference.view()]).unwrap();
    let mut session = session.with_shear(calibration);
    let [first, second] = [0, 1].map(|k| trial.simulation.frames[k].view());
    let empty = trial.scene.reference(3);
    let mut shear = |frame| session.push(frame).unwrap().shear;
    let forces = |shear: &ShearMeasurement| shear.force_n.map(|f| f.value);
    assert_eq!(forces(&shear(first).unwrap()), [0.0; 2]);
    let found = shear(second).unwrap();
    for (force, truth) in found.force_n.iter().zip(shear_n) {
        // Six standard errors, plus a hundredth of a pixel for the effect of rounding and
        // vignetting on the centroid.
        let tolerance = 6.0 * force.standard_error + 0.01 * 86.2e-6 * stiffness[0];
        let miss = (force.value - truth).abs();
        assert!(miss < tolerance, "{force} N, true {truth} N");
    }
    assert_eq!(shear(second).unwrap().displacement_m, found.displacement_m);
    assert!(shear(empty.view()).is_none());
    // A new contact starts from zero.
    assert_eq!(forces(&shear(second).unwrap()), [0.0; 2]);
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

/// The result after 4 000 frames equals that after the first cycles and the truth: the list of
/// separate loads is full after a few hundred frames.
#[test]
fn four_thousand_frames_leave_memory_and_answer_alone() {
    let options = PressOptions {
        camera: Camera::default().coarser(16),
        loads: vec![PressLoad::normal(1.5)],
        gain: Gain::PeakGrey(180.0),
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
    // Two and a half standard errors of the early estimate. Most of them (from the calibration) are
    // common to both estimates.
    assert!(drift.abs() < 0.01, "drift {drift}");
    assert!(error.abs() < 0.03, "error {error}");
    assert!(session.drift().caution.is_none(), "{:?}", session.drift());
}

/// Surface, control points, match, spline and strain of a frame reuse the memory of the previous
/// frames.
#[test]
fn following_strain_allocates_nothing_after_warm_up() {
    let trial = trial(&[0.7, 0.8, 0.95, 1.1, 1.2], 1);
    let pipeline = trial.pipeline().unwrap();
    let mut session = Session::new(&pipeline, &[trial.simulation.reference.view()]).unwrap();
    let mut cycle = trial.simulation.frames.iter().cycle();
    let mut follow = |session: &mut Session, frames: usize| {
        for frame in cycle.by_ref().take(frames) {
            session.push(frame.view()).unwrap();
            if let Some(found) = session.strain().unwrap() {
                assert!(found.matched > 190 && found.strain.field.strains.len() == 200);
            }
        }
    };
    follow(&mut session, 4 * Session::MOST_LOADS);
    let count = allocation_counter::measure(|| follow(&mut session, 20));
    assert_eq!(count.count_total, 0, "{count:?}");
}
