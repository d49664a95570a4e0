//! Simulated sensors with every effect that a calibration must determine, and presses on them.
//!
//! Contacts are those of the laws that calibration and estimator use, with Hertz's pressure.
//! The closed form of the simulator uses layers in series.
use ndarray::Array2;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::PI;
use tactile_files::scene::SceneLayer;
use tactile_files::sensor::{Indenter, LayerInput, SensorCalibration, SensorPress};
use tactile_imaging::elasticity::contact::{Bond, Layer, Waveguide};
use tactile_imaging::elasticity::laws::RigidBallLaw;
use tactile_imaging::elasticity::modulus::{
    Estimate, LoadSeries, LoadState, ModulusEstimator, SphereOnWaveguide,
};
use tactile_imaging::force::Branch;
use tactile_simulate::{
    Camera, ContactModel, ContactState, Elastic, ElasticSphere, PressLoad, PressOptions,
    PressScene, Response,
};

/// Deviations from the assumptions of the short form of a calibration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effects {
    /// The light is proportional to this power of the pressure.
    pub(super) exponent: f64,
    pub(super) vignetting: f64,
    pub(super) barrel: f64,
    /// Height of pixels divided by their width.
    pub(super) aspect: f64,
    /// Lamps change from frame to frame by up to this fraction.
    pub(super) lamps: f64,
    /// Relative standard deviation of the moduli of the layers about the stated values.
    pub(super) moduli: f64,
}

impl Effects {
    pub(super) const NONE: Self = Self {
        exponent: 1.0,
        vignetting: 0.0,
        barrel: 0.0,
        aspect: 1.0,
        lamps: 0.0,
        moduli: 0.0,
    };
    pub(super) const ALL: Self = Self {
        exponent: 1.2,
        vignetting: 0.1,
        barrel: 0.03,
        aspect: 1.02,
        lamps: 0.05,
        moduli: 0.1,
    };
}

/// Relative standard errors that are stated and used for the draws.
const GAUGE_ERROR: f64 = 2e-3;
const TARGET_ERROR: f64 = 5e-4;
const THICKNESS_ERROR: f64 = 5e-3;
const CALIBRATION_BALL_ERROR: f64 = 1e-3;
pub(super) const BALL_ERROR: f64 = 3e-3;
/// Standard error of the Poisson's ratio of the sample.
pub(super) const POISSON_ERROR: f64 = 2e-3;
/// In newtons.
const GAUGE_NOISE_N: f64 = 1e-3;

/// Balls of the calibration and the largest force of each.
const BALLS: [(f64, f64); 3] = [(4e-3, 0.3), (10e-3, 0.5), (30e-3, 0.6)];
/// Loads per ball, up and down again.
const STEPS: usize = 8;
const PITCH_M: f64 = 1.5e-3;

pub(super) const SAMPLE_RADIUS_M: f64 = 5e-3;
pub(super) const SAMPLE_PA: f64 = 62e3;
pub(super) const SAMPLE_POISSON: f64 = 0.49;
pub(super) const LOADS_N: [f64; 3] = [0.05, 0.12, 0.25];

/// A sensor with its true values and those stated by its user.
pub(super) struct Simulated {
    effects: Effects,
    truth: Vec<Layer>,
    stated: Vec<LayerInput>,
    gauge: f64,
    target: f64,
    balls: [f64; 3],
    /// The gain of the light is that of this scene, which has the largest pressure.
    scene: PressScene,
    rng: ChaCha8Rng,
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Hertz's pressure over a disc of radius a.
fn state(force_n: f64, a: f64, radius_m: f64) -> ContactState {
    ContactState {
        force_n,
        contact_radius_m: a,
        indentation_m: a * a / radius_m,
        radius_m: vec![0.0, a],
        pressure_pa: vec![1.5 * force_n / (PI * a * a), 0.0],
        height_m: vec![-a * a / radius_m, 0.0],
    }
}

/// The root of a decreasing function of ln x, by bisection.
fn root(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..40 {
        let middle = (low * high).sqrt();
        if f(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low * high).sqrt()
}

/// States of a rigid ball on the layers.
fn rigid_states(layers: &[Layer], radius_m: f64, forces: &[f64]) -> Vec<ContactState> {
    let guide = Waveguide::new(layers.to_vec()).unwrap();
    let law = RigidBallLaw::new(&guide, [1e-4, 8e-3]).unwrap();
    let force = |a: f64| law.log_force(radius_m, a).value().exp();
    let radius = |f: f64| root(1e-4, 8e-3, |a| f - force(a));
    forces
        .iter()
        .map(|f| state(*f, radius(*f), radius_m))
        .collect()
}

/// States of a soft ball on the layers: those at which the estimator gives the modulus of the ball.
fn soft_states(layers: &[Layer], radius_m: f64, poisson: f64, forces: &[f64]) -> Vec<ContactState> {
    let guide = Waveguide::new(layers.to_vec()).unwrap();
    let estimator = estimator(radius_m, poisson, &guide);
    let above = |force: f64, a: f64| {
        let load = LoadState::new(Estimate::new(force, 1e-9 * force))
            .with_radius(Estimate::new(a, 1e-9 * a));
        match estimator.estimate(&LoadSeries::new([load])) {
            Ok(found) => found.youngs_modulus_pa / SAMPLE_PA - 1.0,
            Err(_) => 1.0,
        }
    };
    let radius = |f: f64| root(2e-4, 8e-3, |a| above(f, a));
    forces
        .iter()
        .map(|f| state(*f, radius(*f), radius_m))
        .collect()
}

pub(super) fn estimator(radius_m: f64, poisson: f64, guide: &Waveguide) -> SphereOnWaveguide {
    SphereOnWaveguide::new(radius_m, poisson, guide, Bond::Bonded).unwrap()
}

impl Simulated {
    pub(super) fn new(effects: Effects, camera: Camera, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (mut truth, mut stated) = (Vec::new(), Vec::new());
        for (refractive_index, thickness_m, youngs_modulus_pa) in [
            (1.41, 2e-3, 1.36e5),
            (1.40, 3e-3, 8.0e4),
            (1.39, 5e-3, 3.4e4),
        ] {
            let layer = SceneLayer {
                refractive_index,
                thickness_m,
                youngs_modulus_pa,
                poisson_ratio: 0.495,
            };
            truth.push(Layer {
                thickness_m: thickness_m * (1.0 + THICKNESS_ERROR * normal(&mut rng)),
                youngs_modulus_pa: youngs_modulus_pa * (effects.moduli * normal(&mut rng)).exp(),
                poisson_ratio: layer.poisson_ratio,
            });
            stated.push(LayerInput {
                layer,
                thickness_error_m: THICKNESS_ERROR * thickness_m,
                youngs_modulus_error_pa: 0.1 * youngs_modulus_pa,
                poisson_ratio_error: 0.0,
            });
        }
        let mut camera = Camera {
            vignetting: effects.vignetting,
            barrel: effects.barrel,
            ..camera
        };
        camera.pixel_size_m[1] *= effects.aspect;
        let balls = BALLS.map(|b| b.0 * (1.0 + CALIBRATION_BALL_ERROR * normal(&mut rng)));
        let states = rigid_states(&truth, balls[0], &[BALLS[0].1]);
        let scene = PressScene::new(PressOptions {
            object: rigid(balls[0]),
            law: ContactModel::Tabulated(states),
            loads: vec![PressLoad::normal(BALLS[0].1)],
            camera,
            response: Response::Power {
                exponent: effects.exponent,
            },
            seed,
            ..PressOptions::default()
        })
        .unwrap();
        let (gauge, target) = (
            1.0 + GAUGE_ERROR * normal(&mut rng),
            1.0 + TARGET_ERROR * normal(&mut rng),
        );
        Self {
            effects,
            truth,
            stated,
            gauge,
            target,
            balls,
            scene,
            rng,
        }
    }

    fn load(&mut self, force_n: f64) -> PressLoad {
        let level = 1.0 + self.effects.lamps * (2.0 * self.rng.random::<f64>() - 1.0);
        let mut load = PressLoad::normal(force_n);
        load.illumination.level = level;
        load
    }

    /// A random position at which a contact of about 4 mm fits.
    fn place(&mut self) -> [f64; 2] {
        let camera = self.scene.options().camera;
        let size = [camera.shape[1] as f64, camera.shape[0] as f64];
        std::array::from_fn(|k| {
            let margin = 4.5e-3 / camera.pixel_size_m[k];
            margin + (size[k] - 2.0 * margin).max(0.0) * self.rng.random::<f64>()
        })
    }

    pub(super) fn reference(&self) -> Array2<u8> {
        self.scene.reference(0)
    }

    /// The frames of a calibration, with the forces of a gauge.
    pub(super) fn calibration(&mut self) -> SensorCalibration {
        let mut presses = Vec::new();
        for (ball, (stated_m, largest_n)) in BALLS.into_iter().enumerate() {
            let forces: Vec<f64> = (1..=STEPS)
                .map(|k| largest_n * 32_f64.powf(k as f64 / STEPS as f64 - 1.0))
                .collect();
            let states = rigid_states(&self.truth, self.balls[ball], &forces);
            let down = forces.iter().rev().skip(1).map(|f| (*f, Branch::Unloading));
            let up = forces.iter().map(|f| (*f, Branch::Loading));
            for (k, (force, branch)) in up.chain(down).enumerate() {
                let (load, place) = (self.load(force), self.place());
                let law = ContactModel::Tabulated(states.clone());
                let scene = centred(&self.scene, place);
                let scene = scene.with_object(rigid(self.balls[ball]), law, vec![load]);
                let scene = scene.unwrap();
                let noise = GAUGE_NOISE_N * normal(&mut self.rng);
                presses.push(SensorPress {
                    frame: scene.frame(0, (100 * (ball + 1) + k) as u32),
                    force_n: force * self.gauge + noise,
                    branch,
                    indenter: Indenter::Ball {
                        radius_m: stated_m,
                        radius_error_m: CALIBRATION_BALL_ERROR * stated_m,
                    },
                });
            }
        }
        let camera = self.scene.options().camera;
        let target = camera.dot_target(PITCH_M * self.target, 5);
        SensorCalibration {
            date: "2026-11-22".into(),
            temperature_c: None,
            references: vec![self.reference()],
            presses,
            target: Some((target, PITCH_M, TARGET_ERROR)),
            pixel_size_m: (camera.pixel_size_m, 0.0),
            layers: self.stated.clone(),
            flat_field: true,
            gauge_error: GAUGE_ERROR,
            // Sample and calibration object scatter alike.
            coupling_error: Some(0.0),
            gauge_noise_n: GAUGE_NOISE_N,
            shear: None,
            covers_n: None,
        }
    }

    /// Frames of a soft ball with the stated radius and a random error of the stated size.
    pub(super) fn press(&mut self, repeat: u32) -> Vec<Array2<u8>> {
        let radius_m = SAMPLE_RADIUS_M * (1.0 + BALL_ERROR * normal(&mut self.rng));
        let poisson = (SAMPLE_POISSON + POISSON_ERROR * normal(&mut self.rng)).min(0.5);
        let states = soft_states(&self.truth, radius_m, poisson, &LOADS_N);
        let material = Elastic {
            youngs_modulus_pa: SAMPLE_PA,
            poisson_ratio: poisson,
        };
        let loads: Vec<PressLoad> = LOADS_N.into_iter().map(|f| self.load(f)).collect();
        let place = self.place();
        let law = ContactModel::Tabulated(states);
        let object = ElasticSphere { radius_m, material };
        let scene = centred(&self.scene, place);
        let scene = scene.with_object(object, law, loads).unwrap();
        (0..LOADS_N.len()).map(|k| scene.frame(k, repeat)).collect()
    }
}

fn rigid(radius_m: f64) -> ElasticSphere {
    ElasticSphere {
        radius_m,
        material: Elastic::RIGID,
    }
}

/// The same scene with its contact centred elsewhere, in pixels: its light does not depend on the
/// position.
fn centred(scene: &PressScene, place: [f64; 2]) -> PressScene {
    PressScene::new(PressOptions {
        centre_px: Some(place),
        ..scene.options().clone()
    })
    .unwrap()
}
