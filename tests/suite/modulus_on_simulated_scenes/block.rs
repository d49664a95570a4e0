//! One patterned block between plates: its frames, and the modulus as stress over strain.

use super::bumps::{bumps, mean_frame};
use super::{NU, calibrate, force, force_covariance, log_uniform, reference, verbose};
use nalgebra::DMatrix;
use ndarray::Array2;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use tactile_imaging::elasticity::modulus::{
    Estimate, LoadSeries, LoadState, ModulusEstimate, ModulusEstimator, PaperRatio, StrainReference,
};
use tactile_imaging::force::{ForceMeter, ForceOptions, ForceWorkspace};
use tactile_imaging::{StrainBetween, StrainBetweenOptions, strain_between};
use tactile_simulate::{Camera, Elastic, UniaxialOptions, UniaxialScene};

/// Side of the undeformed face.
const FACE_M: f64 = 12e-3;
/// The two states between which the strain is measured, at 2 % and 8 % of squeeze.
const STATES: [usize; 2] = [1, 7];

/// A block of that modulus, squeezed by 1 % to 8 %.
fn squeezed(modulus: f64, seed: u64) -> UniaxialScene {
    // F = E A₀ λ(1 − λ²)/2.
    let force_at = |squeeze: f64| {
        modulus * FACE_M * FACE_M * 0.5 * (1.0 - squeeze) * (1.0 - (1.0 - squeeze).powi(2))
    };
    UniaxialScene::new(UniaxialOptions {
        material: Elastic {
            youngs_modulus_pa: modulus,
            poisson_ratio: NU,
        },
        face_m: [FACE_M; 2],
        forces_n: (1..=8).map(|k| force_at(0.01 * f64::from(k))).collect(),
        camera: Camera {
            shape: [400, 400],
            pixel_size_m: [14e-3 / 400.0; 2],
            ..Camera::default()
        },
        seed,
        ..UniaxialOptions::default()
    })
    .unwrap()
}

/// The two states' forces and their covariance.
fn forces(
    scene: &UniaxialScene,
    dark: &[Array2<u8>],
    pressed: &[Vec<Array2<u8>>; 2],
    rng: &mut ChaCha8Rng,
) -> ([Estimate; 2], DMatrix<f64>) {
    let options = ForceOptions::default().without_profile();
    let meter = ForceMeter::new(scene.options().camera.pixel_size_m, &options).unwrap();
    let reference = reference(dark);
    let frames = (0..8)
        .flat_map(|k| [1, 2].map(|repeat| (scene.options().forces_n[k], scene.frame(k, repeat))));
    let calibration = calibrate(&meter, &reference, frames, rng);
    let mut workspace = ForceWorkspace::default();
    let measured = pressed.each_ref().map(|frames| {
        meter
            .measure_with(&mut workspace, frames[0].view(), &reference, &calibration)
            .unwrap()
    });
    (
        measured.each_ref().map(force),
        force_covariance(&calibration, &measured),
    )
}

/// e_xx = e_yy = −ν e_zz, each counted from the first load and hence over its λ_t² = 1 − 2ν e_zz.
/// Two errors of much the same size have twice the degrees of freedom of one.
fn lateral(found: &StrainBetween<2>) -> Estimate {
    let (mean, error) = (found.summary.mean, found.standard_error);
    Estimate::new(
        0.5 * (mean[(0, 0)] + mean[(1, 1)]),
        0.5 * error[(0, 0)].hypot(error[(1, 1)]),
    )
    .with_degrees_of_freedom(2.0 * found.degrees_of_freedom as f64)
}

/// The two loads, the first squeezed by `first`.
fn loads(first: f64, forces: &[Estimate; 2], lateral: Estimate) -> [LoadState; 2] {
    let squeeze = |e: f64| e * (1.0 + 2.0 * NU * first) / NU;
    let strains = [first, first + squeeze(lateral.value)];
    // Second Piola–Kirchhoff: force over λ_z A₀.
    let load = |i: usize| {
        let area = (1.0 - 2.0 * strains[i]).sqrt() * FACE_M * FACE_M;
        LoadState {
            contact_area_m2: Some(Estimate::exact(area)),
            ..LoadState::new(forces[i])
        }
    };
    let (value, standard_error) = (squeeze(lateral.value), squeeze(lateral.standard_error));
    let mut strain = Estimate::new(value, standard_error);
    strain.degrees_of_freedom = lateral.degrees_of_freedom;
    [
        load(0),
        LoadState {
            mean_strain: Some(strain),
            ..load(1)
        },
    ]
}

/// Stress over strain; the first load's own strain follows from the modulus found so far.
fn ratio(forces: &[Estimate; 2], covariance: &DMatrix<f64>, lateral: Estimate) -> ModulusEstimate {
    let ratio = PaperRatio::default().with_reference(StrainReference::FirstLoad);
    let from_first_strain = |strain: f64| {
        let series = LoadSeries::new(loads(strain, forces, lateral));
        let series = series.with_force_covariance(covariance).unwrap();
        ratio.estimate(&series).unwrap()
    };
    let mut answer = from_first_strain(0.0);
    for _ in 0..5 {
        let first = forces[0].value / (FACE_M * FACE_M) / answer.youngs_modulus_pa;
        answer = from_first_strain(first);
    }
    answer
}

fn report(
    scene: &UniaxialScene,
    bumps: usize,
    found: &StrainBetween<2>,
    last_force: Estimate,
    answer: &ModulusEstimate,
) {
    let (options, [before, after]) = (scene.options(), STATES.map(|k| scene.states()[k]));
    let modulus = options.material.youngs_modulus_pa;
    let truth = 0.5 * ((after.stretch_lateral / before.stretch_lateral).powi(2) - 1.0);
    let (mean, lateral) = (found.summary.mean, lateral(found));
    println!(
        "E {modulus:.0}: {bumps} bumps, {} matched, noise {:.4} px, xx {:+.1e} yy {:+.1e}, force \
         {:+.1e}, strain {:+.1e} +- {:.1e}, E {:+.2e} +- {:.1e}",
        found.pairs.len(),
        found.sigma / options.camera.pixel_size_m[0],
        mean[(0, 0)] / truth - 1.0,
        mean[(1, 1)] / truth - 1.0,
        last_force.value / after.force_n - 1.0,
        lateral.value / truth - 1.0,
        lateral.standard_error / lateral.value,
        answer.youngs_modulus_pa / modulus - 1.0,
        answer.standard_error_pa / modulus
    );
}

/// Truth and estimate.
pub(super) fn trial(seed: u64) -> (f64, ModulusEstimate) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 77);
    let modulus = log_uniform(&mut rng, 10e3, 500e3);
    let scene = squeezed(modulus, seed);
    let dark: Vec<_> = (0..8).map(|k| scene.reference(k)).collect();
    let pressed = STATES.map(|k| {
        (3..7)
            .map(|repeat| scene.frame(k, repeat))
            .collect::<Vec<_>>()
    });
    let (forces, covariance) = forces(&scene, &dark, &pressed, &mut rng);
    let unlit = mean_frame(&dark);
    let pixel_m = scene.options().camera.pixel_size_m[0];
    let [before, after] = pressed
        .each_ref()
        .map(|frames| bumps(&(mean_frame(frames) - &unlit), pixel_m));
    let found = strain_between(&before, &after, &StrainBetweenOptions::default()).expect("strain");
    let answer = ratio(&forces, &covariance, lateral(&found));
    if verbose() {
        report(&scene, before.len(), &found, forces[1], &answer);
    }
    (modulus, answer)
}
