//! The frames of the simulator, bit for bit: a change of its code that is not meant to change
//! frames must reproduce the frames recorded here.
//!
//! The frames are integers, so that the last digit of a platform's `exp` or `sin` almost never
//! matters. For a change that is meant to change frames, record the new checksums (each failing
//! line prints them) and mention it in the commit.
use ndarray::Array2;
use tactile_simulate::{
    CalibrationRun, Camera, ContactModel, Gain, Illumination, LoadCycle, PressLoad, PressOptions,
    PressScene, Response, UniaxialOptions, UniaxialScene,
};

fn camera() -> Camera {
    Camera {
        shape: [130, 174],
        pixel_size_m: [30e-3 / 174.0; 2],
        ..Camera::default()
    }
}

fn press() -> PressOptions {
    PressOptions {
        camera: camera(),
        ..PressOptions::default()
    }
}

/// FNV-1a of 64 bits over the bytes of all frames.
fn checksum<'a>(frames: impl IntoIterator<Item = &'a Array2<u8>>) -> u64 {
    let bytes = frames.into_iter().flatten();
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[test]
fn presses_keep_their_frames() {
    let sheared = PressLoad {
        shear_n: [0.3, -0.2],
        illumination: Illumination {
            level: 1.03,
            tilt: [0.04, -0.02],
        },
        ..PressLoad::normal(0.7)
    };
    let mut failures = Vec::new();
    let mut check = |name: &str, expected: u64, change: &dyn Fn(&mut PressOptions)| {
        let mut options = press();
        change(&mut options);
        let made = PressScene::new(options).unwrap().simulate();
        let found = checksum(made.frames.iter().chain([&made.reference]));
        if found != expected {
            failures.push(format!("{name}: {found:#018x}"));
        }
    };
    check("default", 0xa136_0fa6_f6de_78fd, &|_| {});
    check(
        "another response, law and seed",
        0xb501_90d7_4f15_4445,
        &|o| {
            o.response = Response::Quadratic { droop: 0.2 };
            o.law = ContactModel::Tatara;
            o.seed = 99;
        },
    );
    check(
        "sheared, lamps, over the edge",
        0x30da_a0f7_5979_0abe,
        &|o| {
            o.loads = vec![sheared, PressLoad::normal(0.0)];
            o.centre_px = Some([4.3, 60.9]);
            o.gain = Gain::GreyPerPascal(0.004);
        },
    );
    check("ideal, oblong pixels", 0x957b_e415_7c0a_be91, &|o| {
        o.camera = o.camera.ideal();
        o.camera.pixel_size_m = [180e-6, 150e-6];
    });
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn blocks_keep_their_frames() {
    let scene = UniaxialScene::new(UniaxialOptions {
        camera: camera(),
        ..UniaxialOptions::default()
    })
    .unwrap();
    let frames = [scene.reference(0), scene.frame(0, 0), scene.frame(2, 1)];
    let found = checksum(&frames);
    assert_eq!(found, 0xdcaa_2df2_5c1e_2b89, "{found:#018x}");
}

#[test]
fn calibrations_and_streams_keep_their_frames() {
    let scene = PressScene::new(press()).unwrap();
    let options = CalibrationRun {
        steps: 5,
        hysteresis: 0.02,
        ..CalibrationRun::default()
    };
    let pairs = scene.calibrate(&options).unwrap().pairs;
    let light: Vec<f64> = pairs.iter().map(|p| p.integrated_pixel_value).collect();
    let recorded = [
        -78.0, 72238.0, 143850.0, 215607.0, 287714.0, 359440.0, 292283.0, 222584.0, 150727.0,
        76458.0, 55.0,
    ];
    assert_eq!(light, recorded, "{light:?}");
    let cycle = LoadCycle {
        frame_rate_hz: 10.0,
        light_drift_per_s: 0.01,
        largest_shear_n: [0.1, 0.0],
        ..LoadCycle::default()
    };
    let frames: Vec<_> = scene.stream(cycle).unwrap().map(|f| f.frame).collect();
    let found = checksum(&frames);
    assert_eq!(found, 0x45c7_c5b5_d519_c266, "{found:#018x}");
}
