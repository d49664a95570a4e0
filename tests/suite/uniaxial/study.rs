//! Errors and coverage over many specimens.
use super::scenes::{Face, plain, speckled};
use ndarray::Array2;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_imaging::force::{Estimate, ForceOptions};
use tactile_imaging::pipeline::LightContact;
use tactile_imaging::{Object, Pipeline};
use tactile_simulate::{Camera, FaceOutline};

/// Relative error that all readings of a gauge share: what a pipeline assumes unless told otherwise
/// (`Settings::force_scale_error`).
const GAUGE_SCALE: f64 = 1e-3;
/// Error of each reading, of its range.
const GAUGE_NOISE: f64 = 2e-3;

struct Outcome {
    relative_error: f64,
    relative_standard_error: f64,
    covered: bool,
    signs_right: bool,
}

/// One specimen: cylinder or block, plain or speckled, 30 to 250 kPa, four to eight loads up to 4
/// to 10 %, read with a gauge.
fn trial(seed: u64) -> Outcome {
    let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
    let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let most = uniform(0.04, 0.10);
    let loads = uniform(4.0, 9.0) as usize;
    let shape = [400, 400];
    let side = uniform(9e-3, 13e-3);
    let face = Face {
        outline: if seed.is_multiple_of(2) {
            FaceOutline::Rectangle
        } else {
            FaceOutline::Ellipse
        },
        pattern: if (seed / 2).is_multiple_of(2) {
            plain()
        } else {
            speckled()
        },
        modulus_pa: 30e3 * (250.0_f64 / 30.0).powf(uniform(0.0, 1.0)),
        poisson_ratio: 0.5,
        face_m: [
            side,
            if seed.is_multiple_of(2) {
                uniform(9e-3, 13e-3)
            } else {
                side
            },
        ],
        squeezes: (1..=loads)
            .map(|k| most * k as f64 / loads as f64)
            .collect(),
        camera: Camera {
            shape,
            pixel_size_m: [16e-3 / 400.0; 2],
            ..Camera::default()
        },
    };
    let scene = face.scene(seed);
    let object = match face.outline {
        FaceOutline::Rectangle => Object::Block { poisson_ratio: 0.5 },
        FaceOutline::Ellipse => Object::Cylinder { poisson_ratio: 0.5 },
    };
    let contact = LightContact::gauged(face.camera.pixel_size_m, &ForceOptions::default()).unwrap();
    let pipeline = Pipeline::new(contact, object).unwrap();
    let reference = scene.reference(0);
    let frames: Vec<Array2<u8>> = (0..loads).map(|load| scene.frame(load, 0)).collect();
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let scale = 1.0 + GAUGE_SCALE * normal();
    let noise_n = GAUGE_NOISE * scene.options().forces_n[loads - 1];
    let mut press = pipeline.press(reference.view()).unwrap();
    for (frame, force) in frames.iter().zip(&scene.options().forces_n) {
        let value = scale * force + noise_n * normal();
        press.add_gauged_frame(frame.view(), Some(Estimate::new(value, noise_n)));
    }
    let found = press.modulus().unwrap();
    let signs_right = (1..loads).all(|load| {
        let strain = press.strain(load).unwrap().summary.mean;
        strain[(2, 2)] < 0.0 && strain[(0, 0)] > 0.0 && strain[(1, 1)] > 0.0
    });
    Outcome {
        relative_error: found.youngs_modulus_pa / face.modulus_pa - 1.0,
        relative_standard_error: found.standard_error_pa / face.modulus_pa,
        covered: found.interval_95.contains(face.modulus_pa),
        signs_right,
    }
}

/// A dozen specimens by default; `SCENES=100` for the study (`.ci/run studies`).
#[test]
fn moduli_of_blocks_and_cylinders_are_right_and_their_intervals_hold() {
    let count = test_support::draws("SCENES", 12);
    let outcomes: Vec<Outcome> = (0..count).map(trial).collect();
    let mut errors: Vec<f64> = outcomes.iter().map(|o| o.relative_error.abs()).collect();
    errors.sort_by(f64::total_cmp);
    let (median, worst) = (errors[errors.len() / 2], errors[errors.len() - 1]);
    let covered = outcomes.iter().filter(|o| o.covered).count() as f64 / count as f64;
    let mean = outcomes.iter().map(|o| o.relative_error).sum::<f64>() / count as f64;
    let z = outcomes
        .iter()
        .map(|o| (o.relative_error / o.relative_standard_error).powi(2))
        .sum::<f64>()
        / count as f64;
    println!(
        "{count} specimens: median {:.3} %, worst {:.3} %, mean {:+.3} %, covered {:.1} %, mean \
         squared deviation {z:.2} standard errors",
        100.0 * median,
        100.0 * worst,
        100.0 * mean,
        100.0 * covered
    );
    if std::env::var_os("VERBOSE").is_some() {
        for (seed, o) in outcomes.iter().enumerate() {
            println!(
                "{seed}: {:+.3} ± {:.3} %",
                100.0 * o.relative_error,
                100.0 * o.relative_standard_error
            );
        }
    }
    assert!(outcomes.iter().all(|o| o.signs_right));
    assert!(median < 0.02 && worst < 0.0538, "{median} {worst}");
    // 92 to 98 %, widened by two binomial standard deviations of so many specimens.
    let slack = 2.0 * (0.05 * 0.95 / count as f64).sqrt();
    assert!(
        (0.92 - slack..=0.98 + slack).contains(&covered),
        "{covered}"
    );
}
