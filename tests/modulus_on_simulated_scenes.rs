//! Young's modulus of simulated spheres and blocks, from frames with camera noise through a calibration made with a noisy gauge.
//!
//! The experimenter of these tests sets the loads so that a/R stays between 0.1 and 0.3, inside Hertz's range, and the lens so
//! that the largest contact spans half of the frame's height; calibrates with a rigid ball that makes contacts of the same size and
//! brightness; and knows the ball's radius, the waveguide and Poisson's ratio.
#![allow(clippy::print_stdout)]

#[path = "../examples/strain_between/measure.rs"]
#[allow(unreachable_pub, dead_code)]
mod measure;
#[path = "../examples/strain_between/robust_spline.rs"]
#[allow(unreachable_pub, dead_code)]
mod robust_spline;
#[path = "modulus_on_simulated_scenes/uncertainty.rs"]
mod uncertainty;

use nalgebra::{DMatrix, Point2};
use ndarray::Array2;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_imaging::elasticity::contact::{Layer, Waveguide};
use tactile_imaging::elasticity::modulus::{
    Estimate, Evidence, HertzSphere, LoadState, ModulusEstimate, ModulusEstimator, PaperRatio,
    StrainReference,
};
use tactile_imaging::elasticity::strain::GreenLagrange;
use tactile_imaging::force::{
    CalibrationOptions, CalibrationPair, ForceMeasurement, ForceMeter, ForceOptions, ForceWorkspace,
    LinearCalibration, ReferenceFrame, StressCalibration,
};
use tactile_imaging::matching::RelaxationMatcher;
use tactile_imaging::simulate::{
    Camera, Elastic, Gain, Load, PressOptions, PressScene, Sphere, UniaxialOptions, UniaxialScene,
};

const NU: f64 = 0.5;
/// Error of the force gauge, as a share of its range.
const GAUGE: f64 = 1e-3;

/// Scenes per study; coverage needs more than the thirty of the error bars. `SCENES` overrides.
fn scenes(default: u64) -> u64 {
    std::env::var("SCENES").ok().and_then(|s| s.parse().ok()).unwrap_or(default)
}

struct Study {
    errors: Vec<f64>,
    covered: usize,
}

impl Study {
    fn run(count: u64, name: &str, trial: impl Fn(u64) -> (f64, ModulusEstimate<f64>)) -> Self {
        let mut study = Self { errors: Vec::new(), covered: 0 };
        for seed in 0..count {
            let (truth, found) = trial(seed);
            study.errors.push((found.youngs_modulus_pa / truth - 1.0).abs());
            study.covered += usize::from(found.interval_95.contains(truth));
        }
        let first: Vec<f64> = study.errors.iter().take(30).copied().collect();
        println!(
            "{name}: 30 seeds: median {:.3} %, worst {:.3} %; {count} seeds: worst {:.3} %, covered {:.1} %",
            100.0 * median(&first),
            100.0 * worst(&first),
            100.0 * worst(&study.errors),
            100.0 * study.covered as f64 / count as f64
        );
        study
    }

    fn check(&self) {
        let first = &self.errors[..self.errors.len().min(30)];
        assert!(median(first) < 0.01 && worst(first) < 0.03, "{} {}", median(first), worst(first));
        // 92 to 98 %, widened by two binomial standard deviations of so many scenes.
        let n = self.errors.len() as f64;
        let (share, slack) = (self.covered as f64 / n, 2.0 * (0.05 * 0.95 / n).sqrt());
        assert!((0.92 - slack..=0.98 + slack).contains(&share), "{share}");
    }
}

fn median(v: &[f64]) -> f64 {
    let mut v = v.to_vec();
    v.sort_by(f64::total_cmp);
    v[v.len() / 2]
}

fn worst(v: &[f64]) -> f64 {
    v.iter().copied().fold(0.0, f64::max)
}

fn log_uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low * (high / low).powf(rng.random::<f64>())
}

fn waveguide() -> Waveguide<f64> {
    let layer = |l: &tactile_imaging::simulate::WaveguideLayer| Layer {
        thickness_m: l.thickness_m,
        youngs_modulus_pa: l.material.youngs_modulus_pa,
        poisson_ratio: l.material.poisson_ratio,
    };
    let layers = tactile_imaging::simulate::Waveguide::default().layers.iter().map(layer).collect();
    Waveguide::new(layers).unwrap()
}

/// Integrated pixel value as if it were newtons: a calibration of slope one.
fn unit_calibration() -> LinearCalibration<f64> {
    let pairs: Vec<_> = (0..5).map(|k| f64::from(k) * 1e6).map(|v| CalibrationPair::loading(v, v)).collect();
    LinearCalibration::fit(&pairs, &Default::default()).unwrap()
}

/// Fits the calibration to frames of known loads and a noisy gauge.
fn calibrate(
    meter: &ForceMeter<f64>,
    reference: &ReferenceFrame,
    frames: impl Iterator<Item = (f64, Array2<u8>)>,
    rng: &mut ChaCha8Rng,
) -> LinearCalibration<f64> {
    let (unit, mut workspace) = (unit_calibration(), ForceWorkspace::default());
    let measured: Vec<(f64, f64)> = frames
        .map(|(force, frame)| {
            let m = meter.measure_with(&mut workspace, frame.view(), reference, &unit).unwrap();
            (force, m.force_n.value)
        })
        .collect();
    let range = measured.iter().map(|m| m.0).fold(0.0, f64::max);
    let mut gauge = |force: f64| force + GAUGE * range * rng.sample::<f64, _>(StandardNormal);
    let pairs: Vec<_> = measured.iter().map(|&(f, v)| CalibrationPair::loading(v, gauge(f))).collect();
    // No light, no force: the error of the slope is then all that the forces share.
    let options = CalibrationOptions { through_origin: true, ..CalibrationOptions::default() };
    LinearCalibration::fit(&pairs, &options).unwrap()
}

fn estimate(e: tactile_imaging::force::Estimate<f64>) -> Estimate<f64> {
    Estimate::new(e.value, e.standard_error)
}

/// The force with the calibration's degrees of freedom.
fn force(measured: &ForceMeasurement<f64>) -> Estimate<f64> {
    let degrees_of_freedom = measured.reading.and_then(|r| r.degrees_of_freedom);
    Estimate { degrees_of_freedom, ..estimate(measured.force_n) }
}

/// Covariance of forces that share one calibration.
fn force_covariance(
    calibration: &LinearCalibration<f64>,
    measured: &[ForceMeasurement<f64>],
) -> DMatrix<f64> {
    let values: Vec<_> = measured.iter().map(|m| m.contact.unwrap().integrated_pixel_value).collect();
    let covariance = calibration.force_covariance_n2(&values);
    DMatrix::from_fn(values.len(), values.len(), |i, j| covariance[[i, j]])
}

/// One sphere: truth and estimate.
fn sphere(seed: u64) -> (f64, ModulusEstimate<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let modulus = log_uniform(&mut rng, 10e3, 500e3);
    let radius = log_uniform(&mut rng, 1e-3, 10e-3);
    let object = |radius_m, material| Sphere { radius_m, material };
    let soft = Elastic { youngs_modulus_pa: modulus, poisson_ratio: NU };
    let compliance = waveguide().compliance_per_pa();
    let reduced = 1.0 / (compliance + soft.plane_strain_compliance());
    let force_at = |ratio: f64| 4.0 / 3.0 * reduced * radius * radius * ratio.powi(3);
    let ratios: Vec<f64> = (0..12).map(|k| 0.1 + 0.2 * f64::from(k) / 11.0).collect();
    let camera = Camera {
        shape: [384, 384],
        pixel_size_m: [0.3 * radius / 96.0; 2],
        vignetting: 0.0,
        ..Camera::default()
    };
    let options = PressOptions {
        object: object(radius, soft),
        loads: ratios.iter().map(|&r| Load::normal(force_at(r))).collect(),
        camera,
        seed,
        ..PressOptions::default()
    };
    let scene = PressScene::new(options.clone()).unwrap();
    // The rigid ball that makes contacts of the same size and brightness at the same forces.
    let ball = PressScene::new(PressOptions {
        object: object(radius / (reduced * compliance), Elastic::RIGID),
        loads: (1..=20).map(|k| Load::normal(force_at(0.3) * f64::from(k) / 20.0)).collect(),
        gain: Gain::GreyPerPascal(scene.grey_per_pascal()),
        seed: seed + 1_000_000,
        ..options
    })
    .unwrap();
    let meter = ForceMeter::new(camera.pixel_size_m, &ForceOptions::default()).unwrap();
    let dark: Vec<_> = (0..8).map(|k| scene.reference(k)).collect();
    let reference = ReferenceFrame::from_frames(&dark.iter().map(|d| d.view()).collect::<Vec<_>>()).unwrap();
    let frames = (0..20).map(|k| (ball.options().loads[k].force_n, ball.frame(k, 0)));
    let calibration = calibrate(&meter, &reference, frames, &mut rng);
    let mut workspace = ForceWorkspace::default();
    let measured: Vec<_> = (0..ratios.len())
        .map(|k| {
            meter.measure_with(&mut workspace, scene.frame(k, 1).view(), &reference, &calibration).unwrap()
        })
        .collect();
    let loads: Vec<_> = (measured.iter())
        .map(|m| LoadState::new(force(m)).with_contact_radius(estimate(m.contact_radius_m.unwrap())))
        .collect();
    let estimator = HertzSphere::new(radius, NU)
        .unwrap()
        .with_waveguide(&waveguide())
        .with_evidence(Evidence::ContactRadius)
        .with_force_covariance(&force_covariance(&calibration, &measured))
        .unwrap();
    if std::env::var_os("VERBOSE").is_some() {
        let last = ratios.len() - 1;
        let truth = scene.truth(last).contact;
        let found = estimator.estimate(&loads).unwrap();
        println!(
            "E {modulus:.0} R {radius:.4}: force {:+.1e} +- {:.1e}, radius {:+.1e} +- {:.1e}, E {:+.2e} +- {:.1e} chi2 {:.1}",
            measured[last].force_n.value / truth.force_n - 1.0,
            measured[last].force_n.standard_error / truth.force_n,
            loads[last].contact_radius_m.unwrap().value / truth.contact_radius_m - 1.0,
            loads[last].contact_radius_m.unwrap().standard_error / truth.contact_radius_m,
            found.youngs_modulus_pa / modulus - 1.0,
            found.standard_error_pa / modulus,
            found.fit.chi_squared
        );
    }
    (modulus, estimator.estimate(&loads).unwrap())
}

#[test]
fn spheres_of_10_to_500_kilopascal() {
    Study::run(scenes(40), "spheres", sphere).check();
}

/// Mean of several exposures.
fn mean_frame(frames: &[Array2<u8>]) -> Array2<f64> {
    let sum = frames.iter().fold(Array2::zeros(frames[0].dim()), |sum, f| sum + f.mapv(f64::from));
    sum / frames.len() as f64
}

/// Centroids of the bumps of a frame, in metres: whatever stands a quarter above the face.
fn bumps(light: &Array2<f64>, pixel_m: f64) -> Vec<Point2<f64>> {
    let smooth = |r: usize, c: usize| {
        let window = light.slice(ndarray::s![r.saturating_sub(1)..r + 2, c.saturating_sub(1)..c + 2]);
        window.sum() / window.len() as f64
    };
    let (rows, columns) = light.dim();
    let brightest = light.iter().copied().fold(0.0, f64::max);
    let mut lit: Vec<f64> = light.iter().copied().filter(|&v| v > 0.2 * brightest).collect();
    lit.sort_by(f64::total_cmp);
    let threshold = 1.25 * lit[lit.len() / 4];
    let above = Array2::from_shape_fn((rows - 2, columns - 2), |(r, c)| smooth(r + 1, c + 1) > threshold);
    let mut seen = Array2::from_elem(above.dim(), false);
    let mut found = Vec::new();
    for start in above.indexed_iter().filter(|(_, a)| **a).map(|(i, _)| i) {
        let (mut stack, mut sums, mut area) = (vec![start], [0.0; 3], 0);
        while let Some((r, c)) = stack.pop() {
            if !above[[r, c]] || std::mem::replace(&mut seen[[r, c]], true) {
                continue;
            }
            let weight = (light[[r + 1, c + 1]] - threshold).max(0.0);
            sums = [sums[0] + weight, sums[1] + weight * c as f64, sums[2] + weight * r as f64];
            area += 1;
            stack.extend([(r.saturating_sub(1), c), (r, c.saturating_sub(1))]);
            stack.extend(
                [(r + 1, c), (r, c + 1)].into_iter().filter(|&(r, c)| r < above.nrows() && c < above.ncols()),
            );
        }
        if area > 50 {
            found.push(Point2::new(sums[1] / sums[0] * pixel_m, sums[2] / sums[0] * pixel_m));
        }
    }
    found
}

/// One block: truth and estimate.
fn block(seed: u64) -> (f64, ModulusEstimate<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 77);
    let modulus = log_uniform(&mut rng, 10e3, 500e3);
    let face = 12e-3;
    // F = E A₀ λ(1 − λ²)/2 at 1 % and 8 % of squeeze.
    let force_at =
        |squeeze: f64| modulus * face * face * 0.5 * (1.0 - squeeze) * (1.0 - (1.0 - squeeze).powi(2));
    let camera = Camera { shape: [400, 400], pixel_size_m: [14e-3 / 400.0; 2], ..Camera::default() };
    let scene = UniaxialScene::new(UniaxialOptions {
        material: Elastic { youngs_modulus_pa: modulus, poisson_ratio: NU },
        face_m: [face; 2],
        forces_n: (1..=8).map(|k| force_at(0.01 * f64::from(k))).collect(),
        camera,
        seed,
        ..UniaxialOptions::default()
    })
    .unwrap();
    let options = ForceOptions { skip_profile: true, ..ForceOptions::default() };
    let meter = ForceMeter::new(camera.pixel_size_m, &options).unwrap();
    let dark: Vec<_> = (0..8).map(|k| scene.reference(k)).collect();
    let reference = ReferenceFrame::from_frames(&dark.iter().map(|d| d.view()).collect::<Vec<_>>()).unwrap();
    let frames =
        (0..8).flat_map(|k| [1, 2].map(|repeat| (scene.options().forces_n[k], scene.frame(k, repeat))));
    let calibration = calibrate(&meter, &reference, frames, &mut rng);
    let mut workspace = ForceWorkspace::default();
    let pressed = [1, 7].map(|k| (3..7).map(|repeat| scene.frame(k, repeat)).collect::<Vec<_>>());
    let measured = [0, 1].map(|i| {
        let one = pressed[i][0].view();
        meter.measure_with(&mut workspace, one, &reference, &calibration).unwrap()
    });
    let forces = measured.each_ref().map(force);
    let unlit = mean_frame(&dark);
    let [before, after] = [0, 1].map(|i| bumps(&(mean_frame(&pressed[i]) - &unlit), camera.pixel_size_m[0]));
    let found = measure::strain_between(&before, &after, &RelaxationMatcher::default(), &GreenLagrange)
        .expect("strain");
    let (mean, error) = (found.summary.mean, found.standard_error);
    // e_xx = e_yy = −ν e_zz, each counted from the first load and hence over its λ_t² = 1 − 2ν e_zz. Two errors of much the same size
    // have twice the degrees of freedom of one.
    let lateral =
        Estimate::new(0.5 * (mean[(0, 0)] + mean[(1, 1)]), 0.5 * error[(0, 0)].hypot(error[(1, 1)]))
            .with_degrees_of_freedom(2.0 * found.degrees_of_freedom as f64);
    let solve = |first: f64| {
        let squeeze = |e: f64| e * (1.0 + 2.0 * NU * first) / NU;
        let strains = [first, first + squeeze(lateral.value)];
        // Second Piola–Kirchhoff: force over λ_z A₀.
        let load = |i: usize| {
            let area = (1.0 - 2.0 * strains[i]).sqrt() * face * face;
            LoadState::new(forces[i]).with_contact_area(Estimate::exact(area))
        };
        let (value, standard_error) = (squeeze(lateral.value), squeeze(lateral.standard_error));
        let strain = Estimate { value, standard_error, ..lateral };
        [load(0), load(1).with_mean_strain(strain)]
    };
    let ratio = PaperRatio::new()
        .with_reference(StrainReference::FirstLoad)
        .with_force_covariance(&force_covariance(&calibration, &measured))
        .unwrap();
    let mut answer = ratio.estimate(&solve(0.0)).unwrap();
    for _ in 0..5 {
        // The first load's own strain, by the modulus found so far.
        let first = forces[0].value / (face * face) / answer.youngs_modulus_pa;
        answer = ratio.estimate(&solve(first)).unwrap();
    }
    if std::env::var_os("VERBOSE").is_some() {
        let truth = scene.states();
        println!(
            "E {modulus:.0}: {} bumps, {} matched, noise {:.4} px, xx {:+.1e} yy {:+.1e}, force {:+.1e}, strain {:+.1e} +- {:.1e}, E {:+.2e} +- {:.1e}",
            before.len(),
            found.pairs.len(),
            found.sigma / camera.pixel_size_m[0],
            mean[(0, 0)] / (0.5 * ((truth[7].stretch_lateral / truth[1].stretch_lateral).powi(2) - 1.0))
                - 1.0,
            mean[(1, 1)] / (0.5 * ((truth[7].stretch_lateral / truth[1].stretch_lateral).powi(2) - 1.0))
                - 1.0,
            forces[1].value / truth[7].force_n - 1.0,
            lateral.value / (0.5 * ((truth[7].stretch_lateral / truth[1].stretch_lateral).powi(2) - 1.0))
                - 1.0,
            lateral.standard_error / lateral.value,
            answer.youngs_modulus_pa / modulus - 1.0,
            answer.standard_error_pa / modulus
        );
    }
    (modulus, answer)
}

#[test]
fn blocks_by_the_papers_ratio() {
    Study::run(scenes(120), "blocks", block).check();
}
