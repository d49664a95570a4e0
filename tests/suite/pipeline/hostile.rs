//! Hostile presses: a typed error or a flagged answer, never a panic, never a silent NaN.
//!
//! 500 presses are some three of every pair of troubles; `HOSTILE=10000` takes more, as `.ci/run
//! studies` does in an optimised build.
use crate::hostile::Hostile;
use ndarray::{Array2, s};
use proptest::prelude::*;
use std::sync::OnceLock;
use tactile_imaging::Pipeline;
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::pipeline::{Flag, Measurement, Object, Session};
use tactile_simulate::{Camera, PressOptions};

const SHAPE: [usize; 2] = [36, 44];
const SEEDS: usize = 24;

/// Reference and frame of every kind of trouble and every seed, made once; the kind after the last
/// is a sound press.
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

/// What is done to a frame on its way.
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

/// Whether a contact's numbers that are no numbers are owned up to: by a flag that says what is
/// wrong with that contact. A flag about the law (a/R beyond Hertz's range stands on most of these
/// scenes) or about another frame excuses nothing.
fn excuses_contact(flag: &Flag, in_frame: usize) -> bool {
    matches!(flag,
        Flag::Saturated { frame, .. }
        | Flag::OutOfCalibration { frame }
        | Flag::TouchesEdge { frame }
        | Flag::ProfileNotConverged { frame } if *frame == in_frame)
}

fn assert_sound(m: &Measurement) {
    for (k, f) in m.frames.iter().enumerate() {
        let Ok(f) = f else { continue };
        let radius = f.contact_radius_m;
        let mut numbers = vec![radius.value, radius.standard_error];
        if let Ok(force) = &f.force_n {
            numbers.extend([force.value, force.standard_error]);
        }
        let centroid = f.centroid_px.map(|c| [c.value, c.standard_error]);
        numbers.extend(centroid.concat());
        numbers.extend(f.surface_height_m.iter().map(|height| height.value));
        let sound = numbers.iter().all(|v| v.is_finite());
        let excused = m.flags.iter().any(|flag| excuses_contact(flag, k));
        assert!(sound || excused, "frame {k} has a silent NaN: {m:?}");
    }
    if let Ok(strain) = &m.strain {
        let numbers = strain.mean.iter().chain(&strain.standard_error).flatten();
        let sound = numbers.into_iter().all(|v| v.is_finite());
        let excused = m
            .flags
            .iter()
            .any(|f| matches!(f, Flag::Folded { .. } | Flag::Unmatched { .. }));
        assert!(sound || excused, "the strain has a silent NaN: {m:?}");
    }
    let Ok(modulus) = &m.youngs_modulus_pa else {
        return;
    };
    let numbers = [modulus.value, modulus.standard_error, modulus.interval_95.0];
    // Without a number there is nothing that a broken assumption could be a caution about.
    assert!(
        numbers.iter().all(|v| v.is_finite()),
        "the modulus has a NaN: {m:?}"
    );
}

/// Every frame through a session, in which no error may stick.
fn stream(pipeline: &Pipeline, reference: &Array2<u8>, frames: [&Array2<u8>; 2]) {
    let mut session = Session::new(pipeline, &[reference.view()]).unwrap();
    for frame in frames.into_iter().chain(frames) {
        if let Ok(update) = session.push(frame.view())
            && let Some(contact) = update.contact
        {
            let force = contact.force_n.unwrap();
            let finite = [
                force.value,
                force.standard_error,
                contact.contact_radius_m.value,
            ];
            assert!(
                finite.iter().all(|v| v.is_finite())
                    || contact.flags(0).any(|flag| excuses_contact(&flag, 0)),
                "{contact:?}"
            );
            if let Ok(Some(found)) = session.strain() {
                assert!(
                    found.strain.summary.mean.iter().all(|v| v.is_finite()),
                    "{found:?}"
                );
            }
        }
    }
    if let Ok(modulus) = session.modulus() {
        assert!(modulus.youngs_modulus_pa.is_finite(), "{modulus:?}");
    }
}

fn check(kinds: [usize; 2], seed: usize, spoilt: [u8; 2], object: u8) {
    let [reference, first] = frames(kinds[0], seed);
    let [_, second] = frames(kinds[1], SEEDS - 1 - seed);
    let (first, second) = (
        spoil(first, spoilt[0], seed as u64),
        spoil(second, spoilt[1], !(seed as u64)),
    );
    let pipeline = pipeline(object);
    stream(&pipeline, reference, [&first, &second]);
    let mut press = pipeline.press(reference.view()).unwrap();
    press.add_frame(first.view());
    press.add_frame(second.view());
    // Two thirds go without surfaces where they can, to be quick.
    if !(seed + usize::from(object)).is_multiple_of(3) {
        if let Ok(modulus) = press.modulus() {
            let sound =
                modulus.youngs_modulus_pa.is_finite() && modulus.standard_error_pa.is_finite();
            assert!(sound, "a NaN: {modulus:?}");
        }
        return;
    }
    let measured = press.measure();
    assert_sound(&measured);
    let flagged = |wanted: fn(&Flag) -> bool| measured.flags.iter().any(wanted);
    let whole = spoilt[0] > 3;
    match Hostile::ALL.get(kinds[0]) {
        Some(Hostile::CutByEdge | Hostile::InCorner | Hostile::FillsFrame) if whole => {
            assert!(
                flagged(|f| matches!(f, Flag::TouchesEdge { frame: 0 })),
                "{kinds:?}"
            );
        }
        Some(Hostile::SeveralContacts) if whole => {
            assert!(
                flagged(|f| matches!(f, Flag::SeveralContacts { frame: 0, .. })),
                "{kinds:?}"
            );
        }
        _ => {}
    }
}

fn cases() -> u32 {
    let given = std::env::var("HOSTILE").ok().and_then(|n| n.parse().ok());
    given.unwrap_or(500)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), max_shrink_iters: 200, ..ProptestConfig::default() })]

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
