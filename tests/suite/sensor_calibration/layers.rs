//! Layers found from two rigid balls whose contacts are solved by finite elements, and moduli of soft
//! balls measured with them.
use crate::common::{Study, press_of};
use crate::finite_element_presses::solved;
use ndarray::Array2;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};
use tactile_files::scene::SceneLayer;
use tactile_files::sensor::{Indenter, LayerInput, SensorCalibration, SensorPress};
use tactile_imaging::fem::AppliedLoad;
use tactile_imaging::force::{Branch, Source};
use tactile_imaging::pipeline::Object;
use tactile_simulate::{
    Camera, ContactModel, ContactState, Elastic, ElasticSphere, Gain, PressLoad, PressOptions,
    PressScene,
};

/// Poisson's ratio of the elements for ½.
const POISSON_RATIO: f64 = 0.4999;
/// A ball this much stiffer than the stiffest layer is rigid.
const STIFF: f64 = 300.0;
/// Relative standard errors that are stated and used for the draws.
const GAUGE_ERROR: f64 = 1e-3;
const PIXEL_ERROR: f64 = 1e-3;
const RADIUS_ERROR: f64 = 5e-4;
const THICKNESS_ERROR: f64 = 5e-3;
const MODULUS_ERROR: f64 = 0.1;
/// Of the largest force of all three balls.
const GAUGE_NOISE: f64 = 5e-4;
const LARGEST_RATIO: f64 = 0.8;
const PEAK_GREY: f64 = 200.0;
const ROWS: usize = 260;

/// Contacts of one ball.
struct Pressed {
    radius_m: f64,
    states: Vec<ContactState>,
}

/// A guide of one to three layers (thickness, modulus), two rigid balls and a soft one on it.
struct Solved {
    layers: Vec<(f64, f64)>,
    rigid: [Pressed; 2],
    soft: Pressed,
    soft_pa: f64,
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn between(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low * (high / low).powf(rng.random::<f64>())
}

fn pressed(
    radius_m: f64,
    modulus: f64,
    layers: &[(f64, f64)],
    ratios: &[f64],
    fineness: usize,
) -> Pressed {
    let approach = |x: &f64| AppliedLoad::Approach(0.9 * x * x * radius_m);
    let loads: Vec<AppliedLoad> = ratios.iter().map(approach).collect();
    let scene = solved::press(radius_m, layers, modulus, POISSON_RATIO, fineness);
    let states = scene.solve(&loads).states;
    let states = states.iter().filter_map(ContactState::from_solved);
    let within = |s: &ContactState| s.contact_radius_m <= LARGEST_RATIO * radius_m;
    Pressed {
        radius_m,
        states: states.filter(within).collect(),
    }
}

impl Solved {
    fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(900 + seed);
        let count = 1 + seed as usize % 3;
        let height = between(&mut rng, 5e-3, 12e-3);
        let shares: Vec<f64> = (0..count).map(|_| between(&mut rng, 1.0, 2.5)).collect();
        let total: f64 = shares.iter().sum();
        let layer = |share: &f64| (height * share / total, between(&mut rng, 35e3, 140e3));
        let layers: Vec<(f64, f64)> = shares.iter().map(layer).collect();
        let stiffest = layers
            .iter()
            .fold(0.0, |most: f64, layer| most.max(layer.1));
        let fineness = if rng.random::<bool>() { 5 } else { 7 };
        let rigid = [(3e-3, 5e-3), (7e-3, 11e-3)].map(|(low, high)| {
            let largest = between(&mut rng, 0.4, LARGEST_RATIO);
            let ratios = [0.2, 0.4, 0.55, 0.7, 0.85, 1.0].map(|part| part * largest);
            let radius_m = between(&mut rng, low, high);
            pressed(radius_m, STIFF * stiffest, &layers, &ratios, fineness)
        });
        let soft_pa = between(&mut rng, 40e3, 200e3);
        let largest = between(&mut rng, 0.3, 0.7);
        let ratios = [0.6, 1.0].map(|part| part * largest);
        let radius_m = between(&mut rng, 3e-3, 8e-3);
        let soft = pressed(radius_m, soft_pa, &layers, &ratios, fineness);
        Self {
            layers,
            rigid,
            soft,
            soft_pa,
        }
    }

    /// Frames of all contacts of a ball.
    fn frames(&self, ball: &Pressed, camera: Camera, gain: f64, seed: u64) -> Vec<Array2<u8>> {
        let scene = PressScene::new(PressOptions {
            object: ElasticSphere {
                radius_m: ball.radius_m,
                material: Elastic::RIGID,
            },
            law: ContactModel::Tabulated(ball.states.clone()),
            loads: ball
                .states
                .iter()
                .map(|s| PressLoad::normal(s.force_n))
                .collect(),
            gain: Gain::GreyPerPascal(gain),
            camera,
            seed,
            ..PressOptions::default()
        });
        scene.unwrap().simulate().frames
    }

    /// Deviations of ln E of the layers in standard errors, and whether each is identified; the
    /// modulus of the soft ball with the calibrated sensor is added to the study.
    fn calibrated(&self, seed: u64, study: &mut Study) -> Vec<(f64, bool)> {
        let mut rng = ChaCha8Rng::seed_from_u64(7000 + seed);
        let balls = [&self.rigid[0], &self.rigid[1], &self.soft];
        let states = || balls.iter().flat_map(|ball| &ball.states);
        let widest = states().fold(0.0, |most: f64, s| most.max(s.contact_radius_m));
        let pressure = states().fold(0.0, |most: f64, s| {
            s.pressure_pa.iter().copied().fold(most, f64::max)
        });
        let largest_n = states().fold(0.0, |most: f64, s| most.max(s.force_n));
        let noise_n = GAUGE_NOISE * largest_n;
        let camera = Camera {
            shape: [ROWS, 4 * ROWS / 3],
            pixel_size_m: [2.4 * widest / ROWS as f64; 2],
            ..Camera::default()
        };
        let gain = PEAK_GREY / pressure;
        let pixel_m = camera
            .pixel_size_m
            .map(|m| m * (1.0 + PIXEL_ERROR * normal(&mut rng)));
        let gauge = 1.0 + GAUGE_ERROR * normal(&mut rng);
        let mut presses = Vec::new();
        for (k, ball) in self.rigid.iter().enumerate() {
            let radius_m = ball.radius_m * (1.0 + RADIUS_ERROR * normal(&mut rng));
            let frames = self.frames(ball, camera, gain, 10 * seed + k as u64);
            for (frame, state) in frames.into_iter().zip(&ball.states) {
                let noise = noise_n * normal(&mut rng);
                presses.push(SensorPress {
                    frame,
                    force_n: (gauge * state.force_n + noise).max(0.0),
                    branch: Branch::Loading,
                    indenter: Indenter::Ball {
                        radius_m,
                        radius_error_m: RADIUS_ERROR * ball.radius_m,
                    },
                });
            }
        }
        let layer = |&(thickness_m, modulus): &(f64, f64)| LayerInput {
            layer: SceneLayer {
                refractive_index: 1.4,
                thickness_m: thickness_m * (1.0 + THICKNESS_ERROR * normal(&mut rng)),
                youngs_modulus_pa: modulus * (MODULUS_ERROR * normal(&mut rng)).exp(),
                poisson_ratio: 0.5,
            },
            thickness_error_m: THICKNESS_ERROR * thickness_m,
            youngs_modulus_error_pa: MODULUS_ERROR * modulus,
            poisson_ratio_error: 0.0,
        };
        let layers = self.layers.iter().map(layer).collect();
        let reference = PressScene::new(PressOptions {
            camera,
            ..PressOptions::default()
        });
        let reference = reference.unwrap().reference(seed as u32);
        let calibration = SensorCalibration {
            date: "2026-11-29".into(),
            temperature_c: None,
            references: vec![reference.clone()],
            presses,
            target: None,
            pixel_size_m: (pixel_m, PIXEL_ERROR),
            layers,
            flat_field: true,
            gauge_error: GAUGE_ERROR,
            coupling_error: Some(0.0),
            gauge_noise_n: noise_n,
            shear: None,
            covers_n: None,
        };
        let found = calibration.run().unwrap();
        let object = Object::Sphere {
            radius_m: self.soft.radius_m,
            poisson_ratio: 0.5,
        };
        let pipeline = found.sensor.pipeline(object).unwrap();
        let pipeline = pipeline.with_settings(|settings| {
            for source in [Source::ObjectSize, Source::PoissonRatio, Source::Adhesion] {
                settings.assumptions.state(source, 0.0);
            }
        });
        let frames = self.frames(&self.soft, camera, gain, 10 * seed + 5);
        let press = press_of(&pipeline.unwrap(), reference.view(), frames);
        let modulus = press.modulus().unwrap();
        study.add(&modulus, self.soft_pa);
        let half = 1.96 * modulus.standard_error_pa / modulus.youngs_modulus_pa;
        println!(
            "  soft ball: {:+.2} % ± {:.2} %",
            100.0 * (modulus.youngs_modulus_pa / self.soft_pa - 1.0),
            100.0 * half
        );
        let moduli = found
            .layers
            .iter()
            .filter(|l| l.parameter == "youngs_modulus_pa");
        let found = moduli.zip(&self.layers).map(|(layer, truth)| {
            let fitted = layer.fitted;
            let off = (fitted.value / truth.1).ln();
            let error = fitted.standard_error / fitted.value;
            println!("  layer: {:+.2} % ± {:.2} %", 100.0 * off, 196.0 * error);
            (off / error, layer.identified)
        });
        found.collect()
    }
}

/// `GUIDES=13 cargo test --release --test suite study_of_layers -- --nocapture`: two calibrations on
/// each of 13 guides, some minutes.
#[test]
fn study_of_layers_from_balls() {
    let guides = test_support::draws("GUIDES", 0);
    if guides == 0 {
        return; // a study, not a test
    }
    let mut study = Study::default();
    let mut layers = Vec::new();
    for k in 0..guides {
        let solved = Solved::new(k);
        println!("guide {k}: {:?}", solved.layers);
        for draw in 0..2 {
            layers.extend(solved.calibrated(2 * k + draw, &mut study));
        }
    }
    for identified in [true, false] {
        let chosen = || layers.iter().filter(|l| l.1 == identified).map(|l| l.0);
        let count = chosen().count().max(1) as f64;
        let inside = chosen().filter(|z| z.abs() <= 1.96).count();
        let squares: f64 = chosen().map(|z| z * z).sum();
        println!(
            "layers, identified {identified}: {inside} of {count} inside, root mean square {:.2}",
            (squares / count).sqrt()
        );
    }
    study.print("moduli of soft balls");
    study.check_coverage();
    let inside = layers.iter().filter(|l| l.0.abs() <= 1.96).count() as f64;
    let count = layers.len() as f64;
    // 92 % less two binomial standard deviations.
    assert!(inside / count > 0.92 - 2.0 * (0.05 * 0.95 / count).sqrt());
}
