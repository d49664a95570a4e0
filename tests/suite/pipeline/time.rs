//! Frames with their times: a sample that relaxes, a sensor whose gain drifts, and neither.
#![allow(clippy::print_stdout)]
use super::trial;
use ndarray::Array2;
use tactile_imaging::elasticity::relaxation::{StandardLinearSolid, TimeDependence};
use tactile_imaging::force::Estimate;
use tactile_imaging::pipeline::{Flag, Measurement, PipelineError};
use tactile_simulate::Trial;
use tactile_simulate::{
    ContactModel, Elastic, ElasticSphere, Gain, PressLoad, PressOptions, PressScene,
};

const TIMES_S: [f64; 8] = [0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0];

/// E(t) of a sample that relaxes by a third with 2 s.
fn relaxing(time_s: f64) -> f64 {
    80e3 + 40e3 * (-time_s / 2.0).exp()
}

/// A frame of a ball of this modulus at this force, by a sensor whose gain has changed by this
/// factor since its calibration.
fn frame(trial: &Trial, modulus_pa: f64, force_n: f64, gain: f64, repeat: u32) -> Array2<u8> {
    let options = trial.scene.options();
    let material = Elastic {
        youngs_modulus_pa: modulus_pa,
        ..options.object.material
    };
    let object = ElasticSphere {
        material,
        ..options.object
    };
    let scene = PressScene::new(PressOptions {
        object,
        law: ContactModel::Hertz,
        loads: vec![PressLoad::normal(force_n)],
        gain: Gain::GreyPerPascal(gain * trial.scene.truth(0).grey_per_pascal),
        ..options.clone()
    });
    scene.unwrap().frame(0, repeat)
}

/// What is measured of frames at [`TIMES_S`], with the gauge's forces or without.
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
        let frames: Vec<_> = (TIMES_S.iter().zip(1..))
            .map(|(&t, k)| frame(&trial, relaxing(t), 0.3 * relaxing(t) / 120e3, 1.0, k))
            .collect();
        let measurement = measured(&trial, &frames, None);
        let solid = solid(&measurement);
        println!("{}", measurement.time.unwrap());
        assert!(
            (solid.instantaneous_pa / 120e3 - 1.0).abs() < 0.05,
            "{solid:?}"
        );
        assert!(
            (solid.equilibrium_pa / 80e3 - 1.0).abs() < 0.05,
            "{solid:?}"
        );
        assert!((solid.time_constant_s / 2.0 - 1.0).abs() < 0.2, "{solid:?}");
        let holds = [
            solid.instantaneous_95_pa.contains(120e3),
            solid.equilibrium_95_pa.contains(80e3),
            solid.time_constant_95_s.contains(2.0),
        ];
        for (count, holds) in held.iter_mut().zip(holds) {
            *count += u64::from(holds);
        }
        let told = |flag: &Flag| matches!(flag, Flag::SampleRelaxes { .. });
        assert!(
            measurement.flags.iter().any(told),
            "{:?}",
            measurement.flags
        );
    }
    // Of six, four or fewer are held with a probability of 3 %.
    assert!(held.iter().all(|held| *held >= SEEDS - 1), "{held:?}");
}

#[test]
fn a_sample_that_does_not_relax_is_steady_at_growing_loads() {
    for seed in 0..4 {
        let trial = trial(&[0.6], seed);
        let frames: Vec<_> = (TIMES_S.iter().zip(1..))
            .map(|(&t, k)| frame(&trial, 100e3, 0.1 + 0.06 * t, 1.0, k))
            .collect();
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
    let falling: Vec<_> = (TIMES_S.iter().zip(1..))
        .map(|(&t, k)| frame(&trial, 100e3, 0.3, 1.0 - 0.02 * t, k))
        .collect();
    let drift = |flag: &&Flag| matches!(flag, Flag::SensorDrifts { change } if (change + 0.15).abs() < 0.02);
    // Without a gauge it looks like a sample that relaxes over minutes.
    let alone = measured(&trial, &falling, None);
    let undecided =
        |flag: &&Flag| matches!(flag, Flag::ChangesWithTime { change } if *change < -0.1);
    assert_eq!(
        alone.flags.iter().filter(undecided).count(),
        1,
        "{:?}",
        alone.flags
    );
    // With one the gain is known to fall, and the moduli with the gauge's forces do not change.
    let gauged = measured(&trial, &falling, Some(0.3));
    assert_eq!(
        gauged.flags.iter().filter(drift).count(),
        1,
        "{:?}",
        gauged.flags
    );
    assert_eq!(gauged.time.unwrap().change, TimeDependence::Steady);
    // A rising gain needs none: no sample stiffens.
    let rising: Vec<_> = (TIMES_S.iter().zip(1..))
        .map(|(&t, k)| frame(&trial, 100e3, 0.3, 1.0 + 0.02 * t, k))
        .collect();
    let told = measured(&trial, &rising, None).time.unwrap();
    assert!(
        matches!(told.change, TimeDependence::Drifts { .. }),
        "{told}"
    );
}

#[test]
fn few_frames_or_no_times_claim_nothing() {
    let trial = trial(&[0.4], 5);
    let frames: Vec<_> = (TIMES_S.iter().zip(1..))
        .map(|(&t, k)| frame(&trial, relaxing(t), 0.3, 1.0, k))
        .collect();
    let few = measured(&trial, &frames[..4], None);
    assert!(
        matches!(few.time.unwrap().change, TimeDependence::Undecided { change } if change < -0.05)
    );
    let confounded = |flag: &Flag| matches!(flag, Flag::ChangesWithTime { .. });
    assert!(few.flags.iter().any(confounded));
    let pipeline = trial.pipeline().unwrap().with_control_points(60);
    let mut press = pipeline.press(trial.simulation.reference.view()).unwrap();
    for frame in &frames {
        press.add_frame(frame.view());
    }
    let measurement = press.measure();
    assert_eq!(measurement.time, None);
    assert!(!measurement.flags.iter().any(confounded));
}

#[test]
fn times_that_cannot_be_are_refused() {
    let trial = trial(&[0.4, 0.5], 1);
    let pipeline = trial.pipeline().unwrap();
    let mut press = trial.press(&pipeline).unwrap();
    let error = press.set_time_s(2, 0.0).unwrap_err();
    assert_eq!(
        error,
        PipelineError::NoSuchFrame {
            frame: 2,
            frames: 2
        }
    );
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
