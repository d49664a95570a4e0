//! Errors of the calibration, of the light and of every matched displacement carried through the
//! spline and the strain to the modulus, against redrawing the whole experiment.

use nalgebra::{DMatrix, Matrix3, Point3, SVector, Vector3};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::elasticity::field::{StrainField, mean_strain_covariance};
use tactile_imaging::elasticity::modulus::{
    Estimate, LoadSeries, LoadState, ModulusEstimate, ModulusEstimator, PaperRatio, StrainReference,
};
use tactile_imaging::elasticity::strain::GreenLagrange;
use tactile_imaging::force::{
    self, CalibrationOptions, CalibrationPair, LinearCalibration, StressCalibration,
};
use tactile_imaging::tps::{Factorization, FitOptions, Smoothing, SplineWorkspace};

const AREA_M2: f64 = 4e-5;
/// Integrated pixel values of the two loads, with the noise of the light.
const LIGHT: [(f64, f64); 2] = [(2.0e5, 900.0), (8.0e5, 2.5e3)];

/// How large the errors of calibration, light and displacements are: 1, or 0 to leave one out.
type Shares = [f64; 3];

/// What stands still over the repetitions.
struct Experiment {
    before: Vec<Point3<f64>>,
    after: Vec<Point3<f64>>,
    /// L of the covariance LLᵀ of every displacement.
    spread: Vec<Matrix3<f64>>,
    spline: Factorization<f64, 3>,
    samples: Vec<Point3<f64>>,
    pairs: Vec<CalibrationPair>,
}

impl Experiment {
    fn new() -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(21);
        let mut point =
            |size: f64| Point3::from([(); 3].map(|()| size * (rng.random::<f64>() - 0.5)));
        let before: Vec<_> = (0..70).map(|_| point(4e-3)).collect();
        let samples = (0..25).map(|_| point(3e-3)).collect();
        let spread = (0..70)
            .map(|_| Matrix3::from_fn(|i, j| 2e-6 * if i == j { 1.0 } else { point(1.0)[j] }))
            .collect();
        // A squeeze that bends: the gradient differs from place to place.
        let after = before
            .iter()
            .map(|p| {
                p + Vector3::new(
                    0.02 * p.x,
                    0.02 * p.y + 4.0 * p.x * p.z,
                    p.z * (-0.04 + 5.0 * p.x),
                )
            })
            .collect();
        let gauge = [1.2, -0.7, 0.4, -1.5, 0.9, 1.1, -0.8, -0.6, 0.3];
        let pairs = (0..9).zip(gauge).map(|(k, e)| {
            CalibrationPair::loading(1e5 * f64::from(k), 0.05 * f64::from(k) + 2e-3 * e)
        });
        // λ is held: the spline is then linear in its targets.
        let options = FitOptions::default().with_smoothing(Smoothing::Lambda(1e-4));
        let spline = Factorization::new(&before, &options.unwrap()).unwrap();
        Self {
            pairs: pairs.collect(),
            before,
            after,
            spread,
            spline,
            samples,
        }
    }

    fn gradients(&self, after: &[Point3<f64>]) -> Vec<Matrix3<f64>> {
        let spline = self.spline.fit(after).unwrap();
        self.samples
            .iter()
            .map(|p| spline.jacobian(p) - Matrix3::identity())
            .collect()
    }

    fn squeeze(gradients: &[Matrix3<f64>]) -> f64 {
        -StrainField::from_gradients(gradients, None, &GreenLagrange)
            .unwrap()
            .summary()
            .mean[(2, 2)]
    }

    fn calibrate(&self, pairs: &[CalibrationPair]) -> LinearCalibration {
        // The draws have the same noise at all forces.
        let options = CalibrationOptions::default().with_constant_noise();
        LinearCalibration::fit(pairs, &options).unwrap()
    }

    /// Everything by propagation.
    fn propagate(&self, share: Shares) -> Result<ModulusEstimate, ElasticityError> {
        let calibration = self.calibrate(&self.pairs);
        let light = LIGHT.map(|(value, noise)| force::Estimate::new(value, noise * share[1]));
        let all = calibration.force_covariance_n2(&light);
        let quiet = calibration
            .force_covariance_n2(&LIGHT.map(|(value, _)| force::Estimate::new(value, 0.0)));
        let covariance = DMatrix::from_fn(2, 2, |i, j| {
            share[0].powi(2) * quiet[[i, j]] + all[[i, j]] - quiet[[i, j]]
        });
        let gradients = self.gradients(&self.after);
        let mut influence = vec![SVector::zeros(); self.samples.len() * self.before.len()];
        self.spline
            .jacobian_influence_into(
                &mut SplineWorkspace::default(),
                &self.samples,
                &mut influence,
            )
            .unwrap();
        let influence: Vec<_> = influence.chunks(self.before.len()).collect();
        let displacement: Vec<_> = self
            .spread
            .iter()
            .map(|l| l * l.transpose() * share[2].powi(2))
            .collect();
        let weights = vec![1.0; self.samples.len()];
        let strain =
            mean_strain_covariance(&gradients, &weights, |i, j| influence[i][j], &displacement)?;
        let squeeze = Estimate::new(Self::squeeze(&gradients), strain[(2, 2)].sqrt());
        let forces = LIGHT.map(|(v, _)| calibration.force_n(v));
        ratio().estimate(&loads(forces, squeeze).with_force_covariance(&covariance)?)
    }

    /// Everything drawn anew: pairs and their fit, light, displacements and their spline.
    fn redraw(&self, share: Shares, replicates: usize) -> Redrawn {
        let centre = self.calibrate(&self.pairs);
        let gauge = centre.report().residual_sd_n * share[0];
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let experiment = |_| {
            let pairs: Vec<_> = (self.pairs.iter())
                .map(|p| CalibrationPair {
                    force_n: centre.force_n(p.integrated_pixel_value) + gauge * normal(),
                    ..*p
                })
                .collect();
            let calibration = self.calibrate(&pairs);
            let forces =
                LIGHT.map(|(v, noise)| calibration.force_n(v + noise * share[1] * normal()));
            let after: Vec<_> = (self.after.iter().zip(&self.spread))
                .map(|(p, l)| p + l * Vector3::from_fn(|_, _| share[2] * normal()))
                .collect();
            let squeeze = Estimate::exact(Self::squeeze(&self.gradients(&after)));
            let modulus = ratio().estimate(&loads(forces, squeeze)).unwrap();
            modulus.youngs_modulus_pa
        };
        Redrawn::new((0..replicates).map(experiment).collect())
    }
}

/// Moduli of repeated experiments.
struct Redrawn {
    standard_error: f64,
    interval_95: [f64; 2],
}

impl Redrawn {
    fn new(mut moduli: Vec<f64>) -> Self {
        moduli.sort_by(f64::total_cmp);
        let n = moduli.len() as f64;
        let mean = moduli.iter().sum::<f64>() / n;
        let squares: f64 = moduli.iter().map(|x| (x - mean).powi(2)).sum();
        let quantile = |p: f64| moduli[((n - 1.0) * p).round() as usize];
        Self {
            standard_error: (squares / (n - 1.0)).sqrt(),
            interval_95: [quantile(0.025), quantile(0.975)],
        }
    }
}

fn ratio() -> PaperRatio {
    PaperRatio::default().with_reference(StrainReference::FirstLoad)
}

fn loads(forces: [f64; 2], squeeze: Estimate) -> LoadSeries {
    let load = |f| LoadState {
        contact_area_m2: Some(Estimate::exact(AREA_M2)),
        ..LoadState::new(Estimate::exact(f))
    };
    let last = LoadState {
        mean_strain: Some(squeeze),
        ..load(forces[1])
    };
    LoadSeries::new([load(forces[0]), last])
}

/// The standard deviation of 4000 redrawn moduli is itself known to 1.1 %; 5 % is four and a half
/// of its standard deviations.
#[test]
fn propagation_and_redrawing_agree() {
    let experiment = Experiment::new();
    assert_eq!(experiment.before.len(), 70);
    let propagated = experiment.propagate([1.0; 3]).unwrap();
    let redrawn = experiment.redraw([1.0; 3], 4000);
    let ratio = propagated.standard_error_pa / redrawn.standard_error;
    println!(
        "E {:.0} Pa, standard error {:.1} Pa by propagation, {:.1} Pa by redrawing",
        propagated.youngs_modulus_pa, propagated.standard_error_pa, redrawn.standard_error
    );
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    let ends = [
        propagated.interval_95.lower,
        propagated.interval_95.upper.unwrap(),
    ];
    for (one, other) in ends.iter().zip(redrawn.interval_95) {
        // Quantiles of 4000 draws near 2.5 % wander by 4 % of a standard deviation, and the modulus
        // bends a little.
        assert!(
            (one - other).abs() < 0.25 * redrawn.standard_error,
            "{one} {other}"
        );
    }
}

/// Each source alone, so that a wrong one cannot hide behind the others; their variances add up to
/// the whole.
#[test]
fn every_source_is_carried_rightly() {
    let experiment = Experiment::new();
    let whole = experiment
        .propagate([1.0; 3])
        .unwrap()
        .standard_error_pa
        .powi(2);
    let mut sum = 0.0;
    for (k, name) in ["calibration", "light", "displacements"]
        .into_iter()
        .enumerate()
    {
        let share: Shares = std::array::from_fn(|j| f64::from(u8::from(j == k)));
        let propagated = experiment.propagate(share).unwrap().standard_error_pa;
        let redrawn = experiment.redraw(share, 2500).standard_error;
        println!(
            "{name}: {propagated:.1} Pa by propagation, {redrawn:.1} Pa by redrawing, {:.0} % of \
             the variance",
            100.0 * propagated.powi(2) / whole
        );
        // 2500 draws know a standard deviation to 1.4 %.
        assert!(
            (propagated / redrawn - 1.0).abs() < 0.06,
            "{name}: {propagated} {redrawn}"
        );
        assert!(propagated.powi(2) > 0.15 * whole, "{name} says nothing");
        sum += propagated.powi(2);
    }
    // To rounding.
    assert!((sum / whole - 1.0).abs() < 1e-9);
}
