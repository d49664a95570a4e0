//! Contacts of shapes that fit no object: a refusal that names the missing input, or an interval
//! that contains the true value.
use crate::common::press_of;
use ndarray::Array2;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use std::f64::consts::TAU;
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::pipeline::PipelineError;
use tactile_imaging::{Object, Pipeline};
use tactile_simulate::Camera;

const SIDE: usize = 280;
const PIXEL_M: f64 = 60e-6;
const FORCES_N: [f64; 3] = [0.2, 0.5, 0.8];
const MODULUS_PA: f64 = 103e3;
/// Unloaded area of the specimens.
const AREA_M2: f64 = 100e-6;
/// Grey levels per pascal: the middle of round contacts stays below saturation.
const GREY_PER_PA: f64 = 8e-3;
const DARK_GREY: f64 = 15.0;

#[derive(Clone, Copy, Debug)]
enum Outline {
    Star,
    Ring,
    Two,
    Cut,
}

/// Pressure distribution inside the outline, and growth of the contact.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Contact {
    /// As under round bodies: the pressure is zero at the outline, and lengths are proportional to
    /// the cube root of the force.
    Round,
    /// A specimen of that outline under uniaxial load: the pressure is uniform, and the area grows
    /// with the strain.
    Specimen,
}

/// Distance to the outline, positive inside, in units of the size of the contact. `at` is in the
/// same units, from the middle.
fn depth(outline: Outline, [x, y]: [f64; 2], turn: f64) -> f64 {
    let r = x.hypot(y);
    match outline {
        Outline::Star => 0.75 + 0.25 * (5.0 * (y.atan2(x) + turn)).cos() - r,
        Outline::Ring => 0.3 - (r - 0.7).abs(),
        Outline::Two => {
            let (sin, cos) = turn.sin_cos();
            let disc = |side: f64| 0.42 - (x - 0.58 * side * cos).hypot(y - 0.58 * side * sin);
            disc(1.0).max(disc(-1.0))
        }
        Outline::Cut => 1.0 - r,
    }
}

/// Area of the outline of size one.
fn unit_area(outline: Outline, turn: f64) -> f64 {
    const STEPS: usize = 800;
    let at = |k: usize| 2.2 * ((k as f64 + 0.5) / STEPS as f64 - 0.5);
    let cells = ndarray::indices((STEPS, STEPS)).into_iter();
    let inside = cells.filter(|&(i, j)| depth(outline, [at(j), at(i)], turn) > 0.0);
    inside.count() as f64 * (2.2 / STEPS as f64).powi(2)
}

/// Green–Lagrange compression of the specimen: F = E A₀ e λ with λ = √(1 − 2e).
fn squeeze(force_n: f64) -> f64 {
    let engineering = force_n / (MODULUS_PA * AREA_M2);
    (0..100).fold(0.0, |e: f64, _| engineering / (1.0 - 2.0 * e).sqrt())
}

fn camera() -> Camera {
    Camera {
        shape: [SIDE; 2],
        pixel_size_m: [PIXEL_M; 2],
        ..Camera::default()
    }
}

/// The frame under a force, with light proportional to the pressure.
fn frame(
    outline: Outline,
    contact: Contact,
    force_n: f64,
    turn: f64,
    noise: (u64, u64),
) -> Array2<u8> {
    // With ν = ½, A = A₀ (1 + e).
    let area_m2 = match contact {
        Contact::Round => AREA_M2 * (force_n / FORCES_N[2]).powf(2.0 / 3.0),
        Contact::Specimen => AREA_M2 * (1.0 + squeeze(force_n)),
    };
    let size_m = (area_m2 / unit_area(outline, turn)).sqrt();
    let size_px = size_m / PIXEL_M;
    let middle = match outline {
        Outline::Cut => [0.25 * size_px, 0.5 * SIDE as f64],
        _ => [0.5 * SIDE as f64; 2],
    };
    const STEPS: usize = 4;
    let pressure = |row: usize, column: usize| {
        let mut sum = 0.0;
        for (i, j) in ndarray::indices((STEPS, STEPS)) {
            let sub = |k: usize, i: usize| k as f64 + (i as f64 + 0.5) / STEPS as f64 - 0.5;
            let at = [
                (sub(column, j) - middle[0]) / size_px,
                (sub(row, i) - middle[1]) / size_px,
            ];
            let inside = depth(outline, at, turn);
            sum += match contact {
                _ if inside <= 0.0 => 0.0,
                Contact::Round => inside.sqrt(),
                Contact::Specimen => 1.0,
            };
        }
        sum / (STEPS * STEPS) as f64
    };
    let mut light = Array2::from_shape_fn((SIDE, SIDE), |(row, column)| pressure(row, column));
    let total_n = light.sum() * PIXEL_M * PIXEL_M;
    light.mapv_inplace(|p| DARK_GREY + p * force_n / total_n * GREY_PER_PA);
    camera().expose(light.view(), noise.0, noise.1)
}

/// Two rotations of every outline. `SEEDS=5` tests five.
#[test]
fn shapes_that_fit_nothing_are_refused_or_their_interval_holds_the_truth() {
    let seeds = test_support::draws("SEEDS", 2);
    let per_grey = PIXEL_M * PIXEL_M / GREY_PER_PA;
    let pairs = [0.0, 1e5, 2e5, 4e5, 8e5].map(|v| CalibrationPair::loading(v, per_grey * v));
    let (mut scenes, mut refused) = (0_u64, 0_u64);
    for seed in 0..seeds {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let turn = TAU * rng.random::<f64>();
        for outline in [Outline::Star, Outline::Ring, Outline::Two, Outline::Cut] {
            for contact in [Contact::Round, Contact::Specimen] {
                let object = Object::Unknown { poisson_ratio: 0.5 };
                let pipeline = Pipeline::from_pairs(&pairs, [PIXEL_M; 2], object).unwrap();
                let dark = Array2::from_elem((SIDE, SIDE), DARK_GREY);
                let reference = camera().expose(dark.view(), seed, 9);
                let frame = |k| frame(outline, contact, FORCES_N[k], turn, (seed, k as u64));
                let press = press_of(&pipeline, reference.view(), (0..3).map(frame));
                scenes += 1;
                let scene = format!("{seed} {outline:?} {contact:?}");
                match press.modulus() {
                    Err(PipelineError::NotUniaxial { problem, .. }) => {
                        refused += 1;
                        println!("{scene}: {problem}");
                    }
                    Err(error) => panic!("{scene}: {error}"),
                    Ok(found) => {
                        println!("{scene}: {} Pa", found.youngs_modulus_pa);
                        assert_eq!(contact, Contact::Specimen, "{scene}");
                        assert!(found.interval_95.contains(MODULUS_PA), "{scene}: {found:?}");
                    }
                }
            }
        }
    }
    println!("{scenes} scenes, {refused} refused");
    assert_eq!(scenes, 8 * seeds);
    // All objects except stars and rings that are specimens.
    assert!(refused >= 6 * seeds, "{refused}");
}
