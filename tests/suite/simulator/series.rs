//! Calibration series and loading cycles.
use super::{coarser, light, relative};
use tactile_imaging::force::Branch;
use tactile_simulate::{CalibrationRun, LoadCycle, PressScene, SimulateError};

#[test]
fn the_calibration_is_linear_and_holds_for_the_object_as_well() {
    let mut options = coarser(4);
    options.camera.vignetting = 0.0;
    let scene = PressScene::new(options).unwrap();
    let quiet = CalibrationRun {
        gauge_noise_n: 0.0,
        ..CalibrationRun::default()
    };
    let series = scene.calibrate(&quiet).unwrap();
    assert_eq!((series.pairs.len(), series.true_forces_n.len()), (41, 41));
    assert_eq!(series.true_forces_n[20], 2.0);
    assert_eq!(series.pairs[21].branch, Branch::Unloading);
    // 90 828 pixels with a noise of about 0.8 grey levels, twice; five standard errors.
    let noise = 5.0 * (2.0 * 90828.0_f64).sqrt() * 1.2 * series.newton_per_grey;
    for (pair, force_n) in series.pairs.iter().zip(&series.true_forces_n) {
        let found = pair.integrated_pixel_value * series.newton_per_grey;
        assert!((found - force_n).abs() < noise, "{found} N of {force_n}");
    }
    for (load, force_n) in [0.7, 1.2].into_iter().enumerate() {
        let found = light(&scene, load) * series.newton_per_grey;
        assert!((found - force_n).abs() < noise, "{found} N of {force_n}");
    }
}

#[test]
fn gauge_noise_and_hysteresis_are_as_asked() {
    let scene = PressScene::new(coarser(16)).unwrap();
    let options = CalibrationRun {
        steps: 100,
        gauge_noise_n: 0.02,
        hysteresis: 0.1,
        ..CalibrationRun::default()
    };
    let series = scene.calibrate(&options).unwrap();
    let both = series.pairs.iter().zip(&series.true_forces_n);
    let squares = both.map(|(pair, force)| (pair.force_n - force).powi(2));
    let sd = (squares.sum::<f64>() / 201.0).sqrt();
    // Five standard errors of a standard deviation from 201 readings.
    assert!(relative(sd, 0.02) < 5.0 / 402_f64.sqrt(), "{sd}");
    // At half load the branches differ by the stated tenth of the range.
    let [up, down] = [50, 150].map(|k| (series.pairs[k], series.true_forces_n[k]));
    assert_eq!([up.1, down.1], [1.0, 1.0]);
    let gap = down.0.integrated_pixel_value - up.0.integrated_pixel_value;
    assert!((gap * series.newton_per_grey - 0.2).abs() < 0.01, "{gap}");
}

#[test]
fn a_stream_rests_rises_and_falls_at_the_frame_rate() {
    let scene = PressScene::new(coarser(16)).unwrap();
    let cycle = LoadCycle {
        light_drift_per_s: 0.5,
        largest_shear_n: [0.1, 0.0],
        cycles: 2,
        ..LoadCycle::default()
    };
    let stream = scene.stream(cycle).unwrap();
    assert_eq!(stream.len(), 168);
    let frames: Vec<_> = stream.collect();
    assert_eq!(frames.len(), 168);
    let force = |frame: usize| frames[frame].truth.contact.force_n;
    assert!((0..8).all(|k| force(k) == 0.0));
    // Frames coincide with the middle of the cycles: rest 8 frames, period 80.
    assert!(relative(force(48), 1.2) < 1e-12 && relative(force(128), 1.2) < 1e-12);
    assert!(force(88).abs() < 1e-12);
    assert!(relative(frames[16].truth.load.illumination.level, 1.1) < 1e-12);
    assert_eq!(frames[16].time_s, 0.2);
    let moved_px = frames[48].truth.centre_px[0] - frames[0].truth.centre_px[0];
    let moved = moved_px * frames[0].truth.pixel_size_m[0];
    assert!(relative(moved, 0.1 / scene.options().shear_stiffness_n_per_m[0]) < 1e-9);
    let again = scene.stream(cycle).unwrap();
    assert!(frames.iter().zip(again).all(|(a, b)| a.frame == b.frame));
    assert_ne!(frames[0].frame, frames[1].frame);
    let frame_rate_hz = f64::NAN;
    let bad = scene.stream(LoadCycle {
        frame_rate_hz,
        ..cycle
    });
    let named = |field| field == "frame_rate_hz";
    assert!(matches!(bad, Err(SimulateError::OutOfRange { field, .. }) if named(field)));
}
