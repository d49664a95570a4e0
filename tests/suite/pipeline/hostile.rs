//! Hostile presses: each must give a typed error or a flagged result, never a panic and never a
//! silent NaN.
//!
//! 500 presses contain about three of every pair of defects. `HOSTILE=10000` runs more, as does
//! `.ci/run studies` in an optimised build.
use crate::hostile::Hostile;
use crate::sound;
use ndarray::{Array2, s};
use proptest::prelude::*;
use std::sync::OnceLock;
use tactile_imaging::Pipeline;
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::pipeline::{Flag, Object};
use tactile_simulate::{Camera, PressOptions};

const SHAPE: [usize; 2] = [36, 44];
const SEEDS: usize = 24;

/// Reference and frame of every kind of defect and every seed, simulated once. The kind after the
/// last is a valid press.
fn frames(kind: usize, seed: usize) -> &'static [Array2<u8>; 2] {
    static FRAMES: OnceLock<Vec<[Array2<u8>; 2]>> = OnceLock::new();
    let all = || {
        (0..(Hostile::ALL.len() + 1) * SEEDS)
            .map(|i| simulate(i / SEEDS, (i % SEEDS) as u64))
            .collect()
    };
    &FRAMES.get_or_init(all)[kind * SEEDS + seed]
}

fn simulate(kind: usize, seed: u64) -> [Array2<u8>; 2] {
    let camera = Camera {
        shape: SHAPE,
        pixel_size_m: [0.4e-3; 2],
        ..Camera::default()
    };
    let base = PressOptions {
        camera,
        seed,
        ..PressOptions::default()
    };
    let made = match Hostile::ALL.get(kind) {
        Some(hostile) => hostile.simulate(&base).unwrap(),
        None => tactile_simulate::PressScene::new(base).unwrap().simulate(),
    };
    [made.reference, made.frames[0].clone()]
}

/// Damages a frame.
fn spoil(frame: &Array2<u8>, how: u8, noise: u64) -> Array2<u8> {
    let (rows, columns) = frame.dim();
    match how {
        0 => frame.slice(s![..rows - 1, ..]).to_owned(),
        1 => frame.t().to_owned(),
        2 => Array2::zeros((0, 0)),
        3 => Array2::from_shape_fn((rows, columns), |(r, c)| {
            let x = (noise | 1)
                .wrapping_mul(0x9E37_79B9_7F4A_7C15)
                .wrapping_add((r * columns + c) as u64);
            (x.wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 56) as u8
        }),
        _ => frame.clone(),
    }
}

fn pipeline(object: u8) -> Pipeline {
    let pairs: Vec<_> = (0..8)
        .map(|k| CalibrationPair::loading(2e4 * k as f64, 0.3 * k as f64))
        .collect();
    let object = match object {
        0 => Object::sphere(3e-3),
        1 => Object::FlatPunch {
            radius_m: 2e-3,
            poisson_ratio: 0.5,
        },
        _ => Object::Unknown {
            poisson_ratio: 0.45,
        },
    };
    Pipeline::from_pairs(&pairs, [0.4e-3; 2], object)
        .unwrap()
        .with_control_points(16)
}

fn check(kinds: [usize; 2], seed: usize, spoilt: [u8; 2], object: u8) {
    let case = format!("{kinds:?}, seed {seed}, spoilt {spoilt:?}, object {object}");
    let [reference, first] = frames(kinds[0], seed);
    let [_, second] = frames(kinds[1], SEEDS - 1 - seed);
    let (first, second) = (
        spoil(first, spoilt[0], seed as u64),
        spoil(second, spoilt[1], !(seed as u64)),
    );
    let pipeline = pipeline(object);
    sound::stream(&case, &pipeline, reference, [&first, &second]);
    let mut press = pipeline.press(reference.view()).unwrap();
    press.add_frame(first.view());
    press.add_frame(second.view());
    // Two thirds are measured without surfaces, if possible, to save time.
    if !(seed + usize::from(object)).is_multiple_of(3) {
        return sound::modulus_alone(&case, &press);
    }
    let flags = sound::press(&case, &press).flags;
    let edge = matches!(
        Hostile::ALL.get(kinds[0]),
        Some(Hostile::CutByEdge | Hostile::InCorner | Hostile::FillsFrame)
    );
    let several = Hostile::ALL.get(kinds[0]) == Some(&Hostile::SeveralContacts);
    // The first frame remains as simulated.
    if spoilt[0] > 3 {
        let at_edge = |f: &Flag| matches!(f, Flag::TouchesEdge { frame: 0 });
        let of_several = |f: &Flag| matches!(f, Flag::SeveralContacts { frame: 0, .. });
        assert!(!edge || flags.iter().any(at_edge), "{case}");
        assert!(!several || flags.iter().any(of_several), "{case}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: test_support::draws("HOSTILE", 500) as u32,
        max_shrink_iters: 200,
        ..ProptestConfig::default()
    })]

    #[test]
    fn hostile_presses_end_civilly(
        kinds in [0..=Hostile::ALL.len(), 0..=Hostile::ALL.len()],
        seed in 0..SEEDS,
        spoilt in [0_u8..40, 0_u8..40],
        object in 0_u8..3,
    ) {
        check(kinds, seed, spoilt, object);
    }
}
