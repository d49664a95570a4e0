//! One sphere: its loads, its frames, and the modulus from force and contact radius.

use super::{
    GAUGE, NU, calibrate, force, force_covariance, log_uniform, reference, unit_calibration,
    verbose,
};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_imaging::elasticity::contact::{Layer, Waveguide};
use tactile_imaging::elasticity::modulus::{
    Evidence, HertzSphere, LoadSeries, LoadState, ModulusEstimate, ModulusEstimator,
};
use tactile_imaging::force::{ForceMeasurement, ForceMeter, ForceOptions, ForceWorkspace};
use tactile_simulate::{Camera, Elastic, ElasticSphere, Gain, PressLoad, PressOptions, PressScene};

/// Loads of the sphere, and of the ball that calibrates.
const LOADS: u32 = 12;
const GAUGE_LOADS: u32 = 20;

fn waveguide() -> Waveguide {
    let layer = |l: &tactile_simulate::WaveguideLayer| Layer {
        thickness_m: l.thickness_m,
        youngs_modulus_pa: l.material.youngs_modulus_pa,
        poisson_ratio: l.material.poisson_ratio,
    };
    let layers = tactile_simulate::LightGuide::default()
        .layers
        .iter()
        .map(layer)
        .collect();
    Waveguide::new(layers).unwrap()
}

/// A sphere, and the rigid ball that calibrates: chosen, from the sphere's largest contact as
/// measured and the gauge's force there, to make contacts of the same size and brightness at the
/// same forces. The sphere's modulus has no part in the choice.
struct Presses {
    modulus: f64,
    radius: f64,
    sphere: PressScene,
    ball: PressScene,
}

impl Presses {
    fn draw(seed: u64, rng: &mut ChaCha8Rng) -> Self {
        let modulus = log_uniform(rng, 10e3, 500e3);
        let radius = log_uniform(rng, 1e-3, 10e-3);
        let soft = Elastic {
            youngs_modulus_pa: modulus,
            poisson_ratio: NU,
        };
        let compliance = waveguide().as_body().compliance_per_pa();
        let reduced = 1.0 / (compliance + (1.0 - NU) * (1.0 + NU) / modulus);
        let force_at = |ratio: f64| 4.0 / 3.0 * reduced * radius * radius * ratio.powi(3);
        let ratio = |k: u32| 0.1 + 0.2 * f64::from(k) / 11.0;
        let pixel_size_m = [0.3 * radius / 96.0; 2];
        let options = PressOptions {
            object: ElasticSphere {
                radius_m: radius,
                material: soft,
            },
            loads: (0..LOADS)
                .map(|k| PressLoad::normal(force_at(ratio(k))))
                .collect(),
            camera: Camera {
                shape: [384, 384],
                pixel_size_m,
                vignetting: 0.0,
                ..Camera::default()
            },
            seed,
            ..PressOptions::default()
        };
        let sphere = PressScene::new(options.clone()).unwrap();
        let noise: f64 = rng.sample(StandardNormal);
        let last = LOADS as usize - 1;
        let largest_force = sphere.options().loads[last].force_n * (1.0 + GAUGE * noise);
        let seen_radius = contact_radius(&sphere, last);
        // Hertz for a rigid ball: a³ = 3FR·c/4 with c the waveguide's compliance (1 − ν²)/E.
        let rigid = ElasticSphere {
            radius_m: seen_radius.powi(3) / (0.75 * largest_force * compliance),
            material: Elastic::RIGID,
        };
        let ball = PressScene::new(PressOptions {
            object: rigid,
            loads: (1..=GAUGE_LOADS)
                .map(|k| PressLoad::normal(largest_force * f64::from(k) / f64::from(GAUGE_LOADS)))
                .collect(),
            gain: Gain::GreyPerPascal(sphere.truth(0).grey_per_pascal),
            seed: seed + 1_000_000,
            ..options
        });
        Self {
            modulus,
            radius,
            sphere,
            ball: ball.unwrap(),
        }
    }

    fn report(&self, measured: &ForceMeasurement, load: &LoadState, found: &ModulusEstimate) {
        let (modulus, truth) = (self.modulus, self.sphere.truth(LOADS as usize - 1).contact);
        let radius = load.contact_radius_m.unwrap();
        println!(
            "E {modulus:.0} R {:.4}: force {:+.1e} +- {:.1e}, radius {:+.1e} +- {:.1e}, E {:+.2e} \
             +- {:.1e} chi2 {:.1}",
            self.radius,
            measured.force_n.value / truth.force_n - 1.0,
            measured.force_n.standard_error / truth.force_n,
            radius.value / truth.contact_radius_m - 1.0,
            radius.standard_error / truth.contact_radius_m,
            found.youngs_modulus_pa / modulus - 1.0,
            found.standard_error_pa / modulus,
            found.fit.chi_squared
        );
    }
}

/// The contact's radius as a frame shows it; that needs no calibration.
fn contact_radius(scene: &PressScene, load: usize) -> f64 {
    let pixel_size_m = scene.options().camera.pixel_size_m;
    let meter = ForceMeter::new(pixel_size_m, &ForceOptions::default()).unwrap();
    let (dark, frame) = (reference(&[scene.reference(20)]), scene.frame(load, 21));
    let mut workspace = ForceWorkspace::default();
    let measured = meter.measure_with(&mut workspace, frame.view(), &dark, &unit_calibration());
    measured.unwrap().contact_radius_m.unwrap().value
}

/// Truth and estimate.
pub(super) fn trial(seed: u64) -> (f64, ModulusEstimate) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let presses = Presses::draw(seed, &mut rng);
    let (sphere, ball) = (&presses.sphere, &presses.ball);
    let meter = ForceMeter::new(
        sphere.options().camera.pixel_size_m,
        &ForceOptions::default(),
    )
    .unwrap();
    let reference = reference(&(0..8).map(|k| sphere.reference(k)).collect::<Vec<_>>());
    let frames = ball
        .options()
        .loads
        .iter()
        .enumerate()
        .map(|(k, load)| (load.force_n, ball.frame(k, 0)));
    let calibration = calibrate(&meter, &reference, frames, &mut rng);
    let mut workspace = ForceWorkspace::default();
    let measured: Vec<_> = (0..LOADS as usize)
        .map(|k| {
            let frame = sphere.frame(k, 1);
            meter
                .measure_with(&mut workspace, frame.view(), &reference, &calibration)
                .unwrap()
        })
        .collect();
    let loads: Vec<_> = (measured.iter())
        .map(|m| LoadState {
            contact_radius_m: m.contact_radius_m,
            ..LoadState::new(force(m))
        })
        .collect();
    let estimator = HertzSphere::new(presses.radius, NU)
        .unwrap()
        .with_waveguide(&waveguide())
        .with_evidence(Evidence::ContactRadius);
    let series = LoadSeries::new(loads.as_slice())
        .with_force_covariance(&force_covariance(&calibration, &measured))
        .unwrap();
    let found = estimator.estimate(&series).unwrap();
    if verbose() {
        presses.report(
            &measured[measured.len() - 1],
            &loads[loads.len() - 1],
            &found,
        );
    }
    (presses.modulus, found)
}
