//! Frames with times: a relaxing sample, a sensor with drifting gain, and neither.
#![allow(clippy::print_stdout)]
use super::trial;
use crate::common::press_of;
use ndarray::Array2;
use tactile_imaging::elasticity::relaxation::{StandardLinearSolid, TimeDependence};
use tactile_imaging::force::Estimate;
use tactile_imaging::pipeline::{Flag, Measurement, PipelineError};
use tactile_simulate::{Gain, PressLoad, PressScene, Trial};

const TIMES_S: [f64; 8] = [0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0];

/// E(t) of a sample that relaxes by a third with a time constant of 2 s.
fn relaxing(time_s: f64) -> f64 {
    80e3 + 40e3 * (-time_s / 2.0).exp()
}

/// Frames of a ball at [`TIMES_S`]: modulus, force, and the gain of the sensor relative to that of
/// its calibration.
fn frames(trial: &Trial, at: impl Fn(f64) -> [f64; 3]) -> Vec<Array2<u8>> {
    let frame = |(&time_s, repeat): (&f64, u32)| {
        let [modulus_pa, force_n, gain] = at(time_s);
        let mut options = trial.scene.options().clone();
        options.object.material.youngs_modulus_pa = modulus_pa;
        options.loads = vec![PressLoad::normal(force_n)];
        options.gain = Gain::GreyPerPascal(gain * trial.scene.truth(0).grey_per_pascal);
        PressScene::new(options).unwrap().frame(0, repeat)
    };
    TIMES_S.iter().zip(1..).map(frame).collect()
}

/// Measurement of frames at [`TIMES_S`], with or without the forces of the gauge.
fn measured(trial: &Trial, frames: &[Array2<u8>], gauge_n: Option<f64>) -> Measurement {
    let pipeline = trial.pipeline().unwrap().with_control_points(60);
    let mut press = pipeline.press(trial.simulation.reference.view()).unwrap();
    for (frame, time_s) in frames.iter().zip(TIMES_S) {
        let gauge = gauge_n.map(|value| Estimate::new(value, 1e-3 * value));
        let added = press.add_gauged_frame(frame.view(), gauge);
        press.set_time_s(added, time_s).unwrap();
    }
    press.measure()
}

fn solid(measurement: &Measurement) -> StandardLinearSolid {
    match measurement.time.unwrap().change {
        TimeDependence::Relaxes(solid) => solid,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_held_approach_gives_the_relaxation() {
    let mut held = [0; 3];
    const SEEDS: u64 = 6;
    for seed in 0..SEEDS {
        let trial = trial(&[0.4], seed);
        let frames = frames(&trial, |t| [relaxing(t), 0.3 * relaxing(t) / 120e3, 1.0]);
        let measurement = measured(&trial, &frames, None);
        let solid = solid(&measurement);
        println!("{}", measurement.time.unwrap());
        for (found, truth, allowed) in [
            (solid.instantaneous_pa, 120e3, 0.05),
            (solid.equilibrium_pa, 80e3, 0.05),
            (solid.time_constant_s, 2.0, 0.2),
        ] {
            assert!((found / truth - 1.0).abs() < allowed, "{solid:?}");
        }
        let holds = [
            solid.instantaneous_95_pa.contains(120e3),
            solid.equilibrium_95_pa.contains(80e3),
            solid.time_constant_95_s.contains(2.0),
        ];
        for (count, holds) in held.iter_mut().zip(holds) {
            *count += u64::from(holds);
        }
        let told = |flag: &Flag| matches!(flag, Flag::SampleRelaxes { .. });
        assert!(measurement.flags.iter().any(told), "{measurement}");
    }
    // Four or fewer of six have a probability of 3 %.
    assert!(held.iter().all(|held| *held >= SEEDS - 1), "{held:?}");
}

#[test]
fn a_sample_that_does_not_relax_is_steady_at_growing_loads() {
    for seed in 0..4 {
        let trial = trial(&[0.6], seed);
        let frames = frames(&trial, |t| [100e3, 0.1 + 0.06 * t, 1.0]);
        let measurement = measured(&trial, &frames, None);
        let time = measurement.time.unwrap();
        assert_eq!(time.change, TimeDependence::Steady, "seed {seed}: {time}");
        assert_eq!((time.from_s, time.to_s, time.loads), (0.5, 8.0, 8));
        let text = measurement.to_string();
        assert!(
            text.contains("\nover time        0.5 to 8 s: no change"),
            "{text}"
        );
    }
}

#[test]
fn a_gauge_tells_a_falling_gain_from_a_relaxing_sample() {
    let trial = trial(&[0.4], 3);
    let [falling, rising] =
        [-0.02, 0.02].map(|slope| frames(&trial, |t| [100e3, 0.3, 1.0 + slope * t]));
    let flags = |found: &Measurement, is: fn(&&Flag) -> bool| {
        let count = found.flags.iter().filter(is).count();
        assert_eq!(count, 1, "{found}");
    };
    // Without a gauge it resembles a sample that relaxes over minutes.
    flags(
        &measured(&trial, &falling, None),
        |flag| matches!(flag, Flag::ChangesWithTime { change } if *change < -0.1),
    );
    // With a gauge the falling gain is recognised, and the moduli do not change.
    let gauged = measured(&trial, &falling, Some(0.3));
    flags(
        &gauged,
        |flag| matches!(flag, Flag::SensorDrifts { change } if (change + 0.15).abs() < 0.02),
    );
    assert_eq!(gauged.time.unwrap().change, TimeDependence::Steady);
    // A rising gain needs no gauge: samples do not become stiffer.
    let told = measured(&trial, &rising, None).time.unwrap();
    assert!(
        matches!(told.change, TimeDependence::Drifts { .. }),
        "{told}"
    );
}

#[test]
fn few_frames_or_no_times_claim_nothing() {
    let trial = trial(&[0.4], 5);
    let frames = frames(&trial, |t| [relaxing(t), 0.3, 1.0]);
    let few = measured(&trial, &frames[..4], None);
    assert!(
        matches!(few.time.unwrap().change, TimeDependence::Undecided { change } if change < -0.05)
    );
    let confounded = |flag: &Flag| matches!(flag, Flag::ChangesWithTime { .. });
    assert!(few.flags.iter().any(confounded));
    let pipeline = trial.pipeline().unwrap().with_control_points(60);
    let measurement = press_of(&pipeline, trial.simulation.reference.view(), frames).measure();
    assert_eq!(measurement.time, None);
    assert!(!measurement.flags.iter().any(confounded));
}

#[test]
fn times_that_cannot_be_are_refused() {
    let trial = trial(&[0.4, 0.5], 1);
    let pipeline = trial.pipeline().unwrap();
    let mut press = trial.press(&pipeline).unwrap();
    let no_such = PipelineError::NoSuchFrame {
        frame: 2,
        frames: 2,
    };
    assert_eq!(press.set_time_s(2, 0.0).unwrap_err(), no_such);
    for found_s in [-1.0, f64::NAN, f64::INFINITY] {
        let error = press.set_time_s(0, found_s).unwrap_err();
        assert!(matches!(error, PipelineError::Time { frame: 0, .. }));
    }
    press.set_time_s(1, 2.0).unwrap();
    let error = press.set_time_s(0, 3.0).unwrap_err();
    let before = PipelineError::TimeDecreases {
        frame: 1,
        before_s: 3.0,
        found_s: 2.0,
    };
    assert_eq!(error, before);
    press.set_time_s(0, 2.0).unwrap();
    assert_eq!(press.measure().time.unwrap().to_s, 2.0);
}
