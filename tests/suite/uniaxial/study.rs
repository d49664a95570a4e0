//! Errors and coverage for many specimens.
use super::scenes::{Face, plain, speckled};
use crate::common::Study;
use ndarray::Array2;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_imaging::force::{Estimate, ForceOptions};
use tactile_imaging::pipeline::LightContact;
use tactile_imaging::{Object, Pipeline};
use tactile_simulate::FaceOutline;

/// Relative error common to all readings of a gauge: the default of a pipeline (`Source::Gain`).
const GAUGE_SCALE: f64 = 1e-3;
/// Error of each reading, relative to the range.
const GAUGE_NOISE: f64 = 2e-3;

/// One specimen: cylinder or block, plain or speckled, 30 to 250 kPa, four to eight loads up to 4
/// to 10 %, measured with a gauge.
fn measure(seed: u64, study: &mut Study) {
    let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
    let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let most = uniform(0.04, 0.10);
    let loads = uniform(4.0, 9.0) as usize;
    let side = uniform(9e-3, 13e-3);
    let is_block = seed.is_multiple_of(2);
    let poisson_ratio = 0.5;
    let (outline, object) = match is_block {
        true => (FaceOutline::Rectangle, Object::Block { poisson_ratio }),
        false => (FaceOutline::Ellipse, Object::Cylinder { poisson_ratio }),
    };
    let is_plain = (seed / 2).is_multiple_of(2);
    let step = most / loads as f64;
    let face = Face {
        outline,
        pattern: if is_plain { plain() } else { speckled() },
        modulus_pa: 30e3 * (250.0_f64 / 30.0).powf(uniform(0.0, 1.0)),
        face_m: [side, if is_block { uniform(9e-3, 13e-3) } else { side }],
        squeezes: (1..=loads).map(|k| step * k as f64).collect(),
        ..Face::default()
    };
    let scene = face.scene(seed);
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
    study.add(&found, face.modulus_pa);
    for load in 1..loads {
        let strain = press.strain(load).unwrap().summary.mean;
        let spread = strain[(0, 0)] > 0.0 && strain[(1, 1)] > 0.0;
        assert!(spread && strain[(2, 2)] < 0.0, "specimen {seed}: {strain}");
    }
}

/// A dozen specimens by default, and `SCENES=100` for the study (`.ci/run studies`).
#[test]
fn moduli_of_blocks_and_cylinders_are_right_and_their_intervals_hold() {
    let count = test_support::draws("SCENES", 12);
    let mut study = Study::default();
    (0..count).for_each(|seed| measure(seed, &mut study));
    study.print("blocks and cylinders");
    let [median, worst] = study.median_and_worst();
    assert!(median < 0.02 && worst < 0.0538, "{median} {worst}");
    study.check_coverage();
}
