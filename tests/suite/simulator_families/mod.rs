//! Calibration series, loading cycles, uniaxial compression, hostile scenes and scenes on disk.

mod uniaxial;

use proptest::prelude::*;
use tactile_imaging::force::Branch;
use tactile_simulate::{
    CalibrationRun, Camera, Elastic, ElasticSphere, LoadCycle, PressOptions, PressScene, Response,
    SimulateError, write_folder,
};

fn camera(rows: usize, cols: usize) -> Camera {
    Camera {
        shape: [rows, cols],
        pixel_size_m: [30e-3 / cols as f64; 2],
        ..Camera::default()
    }
}

fn press(rows: usize, cols: usize) -> PressOptions {
    PressOptions {
        camera: camera(rows, cols),
        ..PressOptions::default()
    }
}

fn relative(found: f64, expected: f64) -> f64 {
    (found / expected - 1.0).abs()
}

#[test]
fn the_calibration_is_linear_and_holds_for_the_object_as_well() {
    let mut options = press(261, 348);
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
    // 90 828 pixels of about 0.8 grey levels of noise, twice; five standard errors.
    let noise = 5.0 * (2.0 * 90828.0_f64).sqrt() * 1.2 * series.newton_per_grey;
    for (pair, force_n) in series.pairs.iter().zip(&series.true_forces_n) {
        let found = pair.integrated_pixel_value * series.newton_per_grey;
        assert!((found - force_n).abs() < noise, "{found} N of {force_n}");
    }
    let made = scene.simulate();
    let sum = |k: usize| {
        let difference = |(a, b): (&u8, &u8)| f64::from(*a) - f64::from(*b);
        made.frames[k]
            .iter()
            .zip(&made.reference)
            .map(difference)
            .sum::<f64>()
    };
    assert!((sum(0) * series.newton_per_grey - 0.7).abs() < noise);
    assert!((sum(1) * series.newton_per_grey - 1.2).abs() < noise);
}

#[test]
fn gauge_noise_and_hysteresis_are_as_asked() {
    let scene = PressScene::new(press(66, 87)).unwrap();
    let options = CalibrationRun {
        steps: 100,
        gauge_noise_n: 0.02,
        hysteresis: 0.1,
        ..CalibrationRun::default()
    };
    let series = scene.calibrate(&options).unwrap();
    let both = series.pairs.iter().zip(&series.true_forces_n);
    let errors: Vec<f64> = both.map(|(pair, force)| pair.force_n - force).collect();
    let n = errors.len() as f64;
    let sd = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
    // Five standard errors of a standard deviation from 201 readings.
    assert!(relative(sd, 0.02) < 5.0 / (2.0 * n).sqrt(), "{sd}");
    // At half load the branches differ by the stated tenth of the range.
    let (up, down) = (&series.pairs[50], &series.pairs[150]);
    let forces = [series.true_forces_n[50], series.true_forces_n[150]];
    assert_eq!(forces, [1.0, 1.0]);
    let gap = (down.integrated_pixel_value - up.integrated_pixel_value) * series.newton_per_grey;
    assert!((gap - 0.2).abs() < 0.01, "{gap}");
}

#[test]
fn a_bent_response_bends_the_calibration_below_the_line() {
    let options = PressOptions {
        response: Response::Quadratic { droop: 0.3 },
        ..press(130, 174)
    };
    let scene = PressScene::new(options).unwrap();
    let quiet = CalibrationRun {
        gauge_noise_n: 0.0,
        ..CalibrationRun::default()
    };
    let series = scene.calibrate(&quiet).unwrap();
    let value = |k: usize| series.pairs[k].integrated_pixel_value;
    assert!(value(20) < 2.0 * value(10) * 0.99);
    assert!(
        series.pairs[..21]
            .windows(2)
            .all(|w| w[1].integrated_pixel_value > w[0].integrated_pixel_value)
    );
}

#[test]
fn a_stream_rests_rises_and_falls_at_the_frame_rate() {
    let scene = PressScene::new(press(66, 87)).unwrap();
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
    let forces: Vec<f64> = frames.iter().map(|f| f.truth.contact.force_n).collect();
    assert!(forces[..8].iter().all(|&f| f == 0.0));
    // Frames fall on the middle of the cycles: rest 8 frames, period 80.
    assert!(relative(forces[48], 1.2) < 1e-12 && relative(forces[128], 1.2) < 1e-12);
    assert!(forces[88].abs() < 1e-12);
    assert!(relative(frames[16].truth.load.illumination.level, 1.1) < 1e-12);
    assert_eq!(frames[16].time_s, 0.2);
    let moved_px = frames[48].truth.centre_px[0] - frames[0].truth.centre_px[0];
    let moved = moved_px * frames[0].truth.pixel_size_m[0];
    assert!(relative(moved, 0.1 / scene.options().shear_stiffness_n_per_m[0]) < 1e-9);
    let again: Vec<_> = scene.stream(cycle).unwrap().map(|f| f.frame).collect();
    assert!(frames.iter().zip(&again).all(|(a, b)| a.frame == *b));
    assert_ne!(frames[0].frame, frames[1].frame);
    let bad = LoadCycle {
        frame_rate_hz: f64::NAN,
        ..cycle
    };
    assert!(matches!(
        scene.stream(bad),
        Err(SimulateError::OutOfRange {
            field: "frame_rate_hz",
            ..
        })
    ));
}

#[test]
fn a_scene_on_disk_has_the_files_its_description_names() {
    let folder = tempfile::tempdir().unwrap();
    let scene = PressScene::new(press(66, 87)).unwrap();
    let calibration = scene.calibrate(&CalibrationRun::default()).unwrap();
    let path = write_folder(&scene, &calibration, &folder.path().join("scene")).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let table: toml::Table = text.parse().unwrap();
    let home = path.parent().unwrap();
    let made = scene.simulate();
    let image = |name: &str| image::open(home.join(name)).unwrap().to_luma8().into_raw();
    assert_eq!(
        image(table["reference"].as_str().unwrap()),
        made.reference.as_slice().unwrap()
    );
    for (entry, frame) in table["frames"].as_array().unwrap().iter().zip(&made.frames) {
        assert_eq!(
            image(entry["image"].as_str().unwrap()),
            frame.as_slice().unwrap()
        );
    }
    let pairs = std::fs::read_to_string(home.join(table["calibration"]["pairs"].as_str().unwrap()))
        .unwrap();
    assert!(pairs.starts_with("integrated_pixel_value,force_N\n"));
    assert_eq!(pairs.lines().count(), 42);
    assert_eq!(table["waveguide"]["layers"].as_array().unwrap().len(), 3);
    assert_eq!(table["object"]["shape"].as_str(), Some("sphere"));
    let blocked = home.join("reference.png").join("below_a_file");
    assert!(write_folder(&scene, &calibration, &blocked).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Any scene, however odd its frame, makes frames of the right size whose visible force lies
    /// between zero and the force and, where nothing is clipped, whose light is that force.
    #[test]
    fn any_scene_keeps_its_books(
        shape in (1_usize..60, 1_usize..60),
        pixel in (1e-5_f64..1e-3, 1e-5_f64..1e-3),
        centre in (-80.0_f64..140.0, -80.0_f64..140.0),
        force in 0.0_f64..3.0,
        radius in 1e-4_f64..2e-2,
        modulus in 1e3_f64..1e9,
        blur in 0.0_f64..3.0,
        seed in any::<u64>(),
    ) {
        let camera = Camera {
            shape: [shape.0, shape.1],
            pixel_size_m: [pixel.0, pixel.1],
            blur_sigma_px: blur,
            vignetting: 0.0,
            ..Camera::default()
        };
        let material = Elastic { youngs_modulus_pa: modulus, poisson_ratio: 0.4 };
        let scene = PressScene::new(PressOptions {
            object: ElasticSphere { radius_m: radius, material },
            loads: vec![tactile_simulate::PressLoad::normal(force)],
            centre_px: Some([centre.0, centre.1]),
            camera,
            seed,
            ..PressOptions::default()
        }).unwrap();
        let made = scene.simulate();
        prop_assert_eq!(made.frames[0].dim(), shape);
        let truth = &made.truth[0];
        prop_assert!(truth.visible_force_n >= 0.0 && truth.visible_force_n <= force * (1.0 + 1e-9));
        let light: f64 = scene.expected_frame(0).iter().map(|v| v - camera.background_grey).sum();
        let carried = light * camera.pixel_size_m.iter().product::<f64>();
        // Blur moves light over the edge, but makes none.
        let most = force * scene.truth(0).grey_per_pascal;
        prop_assert!(carried >= -1e-9 * most.max(1e-12) && carried <= most * (1.0 + 1e-9) + 1e-12);
        if blur == 0.0 {
            prop_assert!((carried - truth.visible_force_n * scene.truth(0).grey_per_pascal).abs() <= 1e-9 * most);
        }
    }

}
