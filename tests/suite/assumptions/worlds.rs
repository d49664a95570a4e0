//! A sensor and a press: the true values, and the values stated by the user.
use crate::finite_element_presses::recorded_balls;
use ndarray::Array2;
use tactile_imaging::elasticity::contact::{Layer, Waveguide};
use tactile_imaging::fem::{self, Guide, Interface, Material, ObjectPress};
use tactile_imaging::force::{Estimate, ReferenceFrame, Source};
use tactile_imaging::pipeline::{
    CheckPress, CheckedObject, EstimatorChoice, KnownBall, Measurement, Object, Pipeline,
    PipelineError, ReferenceLight, StagesConfig,
};
use tactile_simulate::{
    CalibrationRun, Camera, ContactModel, ContactState, PressLoad, PressOptions, PressScene,
    Response, Trial,
};

pub(super) const RADIUS_M: f64 = 3e-3;
pub(super) const MODULUS_PA: f64 = 103e3;

/// The object: always solved by finite elements at finite strain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Sample {
    /// The paper's ball of 103 kPa on its guide, ν = ½.
    #[default]
    Ball,
    /// The same ball with this Poisson's ratio.
    Compressible(f64),
    /// The same ball, sticking to its guide.
    Sticking,
    /// The flat face of a cylinder between plates, sliding or sticking.
    Face(Interface),
    /// The same ball with this work of adhesion, in J/m².
    Adhering(f64),
}

/// How the light of the frames is distorted before it is stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Distortion {
    /// 255 (g/255)^(1/γ), also for the reference.
    Gamma(f64),
    /// Light times 1 + s x/a, as for a press whose force is not along the axis.
    Skew(f64),
    /// This fraction of the light is distributed evenly over a square whose side is the height of
    /// the frame.
    Halo(f64),
}

impl Distortion {
    fn apply(self, trial: &mut Trial) {
        let made = &mut trial.simulation;
        let plain = made.reference.mapv(f64::from);
        if let Self::Gamma(gamma) = self {
            let curve = |grey: u8| (255.0 * (f64::from(grey) / 255.0).powf(1.0 / gamma)) as u8;
            made.reference.mapv_inplace(curve);
            made.frames.iter_mut().for_each(|f| f.mapv_inplace(curve));
            return;
        }
        let pixel_m = made.pixel_size_m[0];
        for (frame, truth) in made.frames.iter_mut().zip(&made.truth) {
            let light = frame.mapv(f64::from) - &plain;
            let (rows, columns) = frame.dim();
            let spread = light.sum() / (rows * rows) as f64;
            let around = columns.abs_diff(rows) / 2;
            for ((row, column), grey) in frame.indexed_iter_mut() {
                let here = light[(row, column)];
                let x = (column as f64 - truth.centre_px[0]) * pixel_m;
                let seen = match self {
                    Self::Skew(skew) => here * (1.0 + skew * x / truth.contact.contact_radius_m),
                    Self::Halo(share) => {
                        let inside = (around..columns - around).contains(&column);
                        (1.0 - share) * here + if inside { share * spread } else { 0.0 }
                    }
                    Self::Gamma(_) => here,
                };
                *grey = (plain[(row, column)] + seen).round() as u8;
            }
        }
    }
}

/// The true values.
#[derive(Clone, Copy, Debug)]
pub(super) struct World {
    pub(super) sample: Sample,
    /// The light is proportional to this power of the pressure.
    pub(super) exponent: f64,
    pub(super) camera: Camera,
    /// Brightness of the lamps in the two frames.
    pub(super) levels: [f64; 2],
    /// Largest difference between loading and unloading in the calibration, relative to the range.
    pub(super) hysteresis: f64,
    /// Reading of the gauge relative to the force.
    pub(super) gauge: f64,
    /// Light of the object relative to that of the calibration object at the same pressure.
    pub(super) reflectance: f64,
    /// Brightness of the lamps relative to that during the calibration. The reference is taken
    /// anew.
    pub(super) lamps: f64,
    pub(super) loads_n: [f64; 2],
    pub(super) check: Option<Check>,
    pub(super) distortion: Option<Distortion>,
}

/// A press of known force in addition to the frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Check {
    /// The sample.
    Sample,
    /// A ball of 180 kPa and 3 mm, with a force (N) for which it was solved.
    KnownBall(f64),
}

impl Check {
    /// Its frame in addition to those of the trial, its force, and the stated object.
    fn press(self, trial: &Trial, stated: &Stated) -> (Array2<u8>, f64, CheckedObject) {
        let mut options = trial.scene.options().clone();
        options.seed += 1 << 32;
        let mut object = CheckedObject::Sample;
        if let Self::KnownBall(force_n) = self {
            let mut balls = recorded_balls().into_iter();
            let ball = balls.find(|ball| ball.youngs_modulus_pa == 180e3).unwrap();
            let [radius_m, modulus_pa] = [ball.radius_m, ball.youngs_modulus_pa];
            options.object.radius_m = radius_m;
            options.object.material.youngs_modulus_pa = modulus_pa;
            options.law = ContactModel::Tabulated(ball.states);
            options.loads = vec![PressLoad::normal(force_n)];
            object = CheckedObject::Ball(KnownBall::elastic(
                KnownBall::radius(stated.known_ball[0] * radius_m, None),
                KnownBall::modulus(stated.known_ball[1] * modulus_pa, None),
            ));
        }
        // The last load of the trial is simulated again, because the camera gain depends on all of
        // them.
        let made = PressScene::new(options).unwrap().simulate();
        let force_n = made.truth.last().unwrap().contact.force_n;
        let frame = made.frames.into_iter().next_back().unwrap();
        (frame, force_n, object)
    }
}

/// The values stated by the user: relative to the true values, with relative standard errors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stated {
    pub(super) object: Object,
    pub(super) estimator: EstimatorChoice,
    pub(super) layer_moduli: f64,
    pub(super) layer_error: Option<f64>,
    pub(super) force_error: Option<f64>,
    pub(super) coupling_error: Option<f64>,
    pub(super) pixel_size: f64,
    pub(super) length_error: Option<f64>,
    pub(super) radius_error: Option<f64>,
    pub(super) poisson_error: Option<f64>,
    /// Whether the light of the calibration reference was kept.
    pub(super) keeps_light: bool,
    /// The weight of a check; radius and modulus of a known ball.
    pub(super) weight: f64,
    pub(super) known_ball: [f64; 2],
}

impl Default for World {
    fn default() -> Self {
        Self {
            sample: Sample::Ball,
            exponent: 1.0,
            // Pixels four times as wide as the paper's over the same 30 mm.
            camera: Camera::default().coarser(4),
            levels: [1.0; 2],
            hysteresis: 0.0,
            gauge: 1.0,
            reflectance: 1.0,
            lamps: 1.0,
            loads_n: [0.7, 1.2],
            check: None,
            distortion: None,
        }
    }
}

impl Default for Stated {
    /// All values are correct, the guide is under a skin, and no errors are stated.
    fn default() -> Self {
        Self {
            object: Object::sphere(RADIUS_M),
            estimator: EstimatorChoice::default(),
            layer_moduli: 1.0,
            layer_error: None,
            force_error: None,
            coupling_error: Some(0.0),
            pixel_size: 1.0,
            length_error: None,
            radius_error: None,
            poisson_error: None,
            keeps_light: true,
            weight: 1.0,
            known_ball: [1.0; 2],
        }
    }
}

impl Sample {
    /// The contacts at both loads. `None` if the simulator computes them itself.
    fn states(self, options: &PressOptions) -> Option<Vec<ContactState>> {
        let material = options.object.material;
        let forces_n: Vec<f64> = options.loads.iter().map(|load| load.force_n).collect();
        match self {
            Self::Ball => None,
            Self::Compressible(nu) => Some(on_the_guide(nu, Interface::Frictionless, options)),
            Self::Adhering(work) => Some(adhering(work, options)),
            Self::Sticking => Some(on_the_guide(NEARLY_HALF, Interface::Bonded, options)),
            Self::Face(faces) => {
                let solve = ContactState::of_squeezed_cylinder;
                Some(solve(6e-3, 8e-3, &material, faces, &forces_n).unwrap())
            }
        }
    }
}

/// Poisson's ratio ½ for the elements.
const NEARLY_HALF: f64 = 0.4999;

fn on_the_guide(
    poisson_ratio: f64,
    interface: Interface,
    options: &PressOptions,
) -> Vec<ContactState> {
    let material = Material::new(MODULUS_PA, poisson_ratio).unwrap();
    let layers = options.waveguide.layers.iter();
    let layers = layers.map(|layer| fem::GuideLayer {
        thickness_m: layer.thickness_m,
        material: Material::new(layer.material.youngs_modulus_pa, NEARLY_HALF).unwrap(),
    });
    let ball = fem::ObjectShape::Ball { radius_m: RADIUS_M };
    let press = ObjectPress::new(ball, material).unwrap();
    let press = press.on_guide(Guide::new(layers.collect(), 28e-3).unwrap());
    let press = press.unwrap().with_interface(interface);
    let scene = press.scene().unwrap();
    let forces = options.loads.iter().map(|load| load.force_n);
    let loads: Vec<_> = forces.map(fem::AppliedLoad::Force).collect();
    let states = scene.solve(&loads).states;
    let contact = |state| ContactState::from_solved(state).expect("a contact");
    states.iter().map(contact).collect()
}

/// Johnson, Kendall and Roberts (1971, Proc. R. Soc. A 324, 301): a contact under the force F has
/// the radius of a contact without adhesion under P₁ = F + Q, Q² = 6π w R P₁, and the pressure of
/// that contact minus Q/(2πa²)/√(1 − r²/a²). Where this is below zero there is no pressure and no
/// light.
fn adhering(work: f64, options: &PressOptions) -> Vec<ContactState> {
    let attraction_n = 3.0 * std::f64::consts::PI * work * RADIUS_M;
    let mut hertz = options.clone();
    for load in &mut hertz.loads {
        let force_n = load.force_n;
        load.force_n += attraction_n + (attraction_n * (2.0 * force_n + attraction_n)).sqrt();
    }
    let states = on_the_guide(NEARLY_HALF, Interface::Frictionless, &hertz);
    let loads = options.loads.iter();
    states
        .into_iter()
        .zip(loads)
        .map(|(mut state, load)| {
            let (a, pull_n) = (state.contact_radius_m, state.force_n - load.force_n);
            for (p, r) in state.pressure_pa.iter_mut().zip(&state.radius_m) {
                let edge = (1.0 - (r / a).powi(2)).max(1e-9).sqrt();
                *p = (*p - pull_n / (2.0 * std::f64::consts::PI * a * a * edge)).max(0.0);
            }
            state.force_n = load.force_n;
            state
        })
        .collect()
}

impl World {
    /// Calibrates, presses and measures with the values stated by the user.
    ///
    /// # Errors
    /// A check that is refused.
    pub(super) fn measure(&self, stated: &Stated, seed: u64) -> Result<Measurement, PipelineError> {
        let load = |(force_n, level): (f64, f64)| {
            let mut load = PressLoad::normal(force_n);
            load.illumination.level = level;
            load
        };
        let loads = self.loads_n.into_iter().zip(self.levels);
        let mut options = PressOptions {
            camera: self.camera,
            response: match self.exponent {
                1.0 => Response::Linear,
                exponent => Response::Power { exponent },
            },
            loads: loads.map(load).collect(),
            seed,
            law: ContactModel::FiniteElements,
            ..PressOptions::default()
        };
        assert_eq!(options.object.material.youngs_modulus_pa, MODULUS_PA);
        if let Some(states) = self.sample.states(&options) {
            options.law = ContactModel::Tabulated(states);
        }
        let calibration = CalibrationRun {
            hysteresis: self.hysteresis,
            ..CalibrationRun::default()
        };
        let mut trial = Trial::new(options, &calibration).unwrap();
        for pair in &mut trial.pairs {
            pair.force_n *= self.gauge;
            pair.integrated_pixel_value /= self.reflectance * self.lamps;
        }
        if let Some(distortion) = self.distortion {
            distortion.apply(&mut trial);
        }
        let mut pipeline = stated.pipeline(&trial, self.lamps);
        if let Some(check) = self.check {
            let (frame, force_n, object) = check.press(&trial, stated);
            let known_n = Estimate::new(stated.weight * force_n, 2e-3 * force_n);
            let check = CheckPress::new(frame.view(), known_n, object);
            let reference = trial.simulation.reference.view();
            pipeline = pipeline.with_checks(reference, &[check])?;
        }
        Ok(trial.press(&pipeline)?.measure())
    }
}

impl Stated {
    fn pipeline(&self, trial: &Trial, lamps: f64) -> Pipeline {
        let layers = &trial.scene.options().waveguide.layers;
        let layer = |l: &tactile_simulate::WaveguideLayer| Layer {
            thickness_m: l.thickness_m,
            youngs_modulus_pa: self.layer_moduli * l.material.youngs_modulus_pa,
            poisson_ratio: l.material.poisson_ratio,
        };
        let guide = Waveguide::new(layers.iter().map(layer).collect()).unwrap();
        let reference = ReferenceFrame::new(trial.simulation.reference.view()).unwrap();
        let mut light = ReferenceLight::of(&reference);
        light.grey.iter_mut().for_each(|grey| *grey /= lamps);
        let stages = StagesConfig {
            estimator: self.estimator,
            ..StagesConfig::default()
        };
        let size = trial.simulation.pixel_size_m.map(|p| self.pixel_size * p);
        let pipeline = Pipeline::from_pairs(&trial.pairs, size, self.object).unwrap();
        // The modulus of a ball does not need control points and has none of their cautions.
        let points = match self.object {
            Object::Sphere { .. } => 8,
            _ => 200,
        };
        pipeline
            .with_control_points(points)
            .with_settings(|settings| {
                settings.waveguide = Some(guide);
                for (source, stated) in [
                    (Source::Guide, self.layer_error),
                    (Source::Gain, self.force_error),
                    (Source::Coupling, self.coupling_error),
                    (Source::PixelSize, self.length_error),
                    (Source::ObjectSize, self.radius_error),
                    (Source::PoissonRatio, self.poisson_error),
                ] {
                    if let Some(error) = stated {
                        settings.assumptions.state(source, error);
                    }
                }
                settings.calibrated_light = self.keeps_light.then_some(light);
            })
            .unwrap()
            .with_stages(&stages)
            .unwrap()
    }
}
