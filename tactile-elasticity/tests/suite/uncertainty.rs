//! Covariance of displacements and forces carried to the modulus, against redrawing the whole
//! experiment.

use nalgebra::{DMatrix, Matrix3, Point3, Vector3};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_elasticity::contact::{Body, HertzContact, reduced_modulus_pa};
use tactile_elasticity::field::{StrainField, mean_strain_covariance};
use tactile_elasticity::modulus::{
    Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator, PaperRatio, SharedErrors,
};
use tactile_elasticity::strain::GreenLagrange;

/// Spread and quantiles of 4000 repetitions of an experiment, which draws its normal errors from
/// what it is given.
struct Redrawn {
    standard_error: f64,
    interval_95: [f64; 2],
}

impl Redrawn {
    fn new(seed: u64, mut experiment: impl FnMut(&mut dyn FnMut() -> f64) -> f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let mut all: Vec<f64> = (0..4000).map(|_| experiment(&mut normal)).collect();
        all.sort_by(f64::total_cmp);
        let mean = all.iter().sum::<f64>() / 4000.0;
        let squares: f64 = all.iter().map(|x| (x - mean).powi(2)).sum();
        Self {
            standard_error: (squares / 3999.0).sqrt(),
            interval_95: [all[100], all[3899]],
        }
    }
}

/// A cloud of points and the gradient of its least-squares affine map: u ↦ Σⱼ uⱼ aⱼᵀ.
fn cloud() -> (Vec<Point3<f64>>, Vec<Vector3<f64>>) {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let points: Vec<Point3<f64>> = (0..60)
        .map(|_| Point3::from([(); 3].map(|()| rng.random::<f64>() * 2e-3)))
        .collect();
    let design = DMatrix::from_fn(60, 4, |i, k| if k == 0 { 1.0 } else { points[i][k - 1] });
    let solve = (design.transpose() * &design).try_inverse().unwrap() * design.transpose();
    let influence = (0..60)
        .map(|j| Vector3::from_fn(|k, _| solve[(k + 1, j)]))
        .collect();
    (points, influence)
}

/// Force and mean strain to the modulus, by propagation and by 4000 redrawn experiments: the
/// standard deviation of these is itself known to 1.1 %, so that 5 % is four and a half of its
/// standard deviations.
#[test]
fn displacements_through_strain_to_the_modulus() {
    let (points, influence) = cloud();
    let squeeze = Matrix3::from_diagonal(&Vector3::new(0.02, 0.02, -0.04));
    let noise = Vector3::new(2e-6, 2e-6, 5e-6);
    let (force, force_error, area) = (0.03, 2e-4, 1e-5);
    let modulus_of = |force: Estimate, strain: Estimate| {
        let load = LoadState {
            contact_area_m2: Some(Estimate::exact(area)),
            mean_strain: Some(strain),
            ..LoadState::new(force)
        };
        PaperRatio::default().estimate(&LoadSeries::new([load]))
    };
    let gradient = |u: &dyn Fn(usize) -> Vector3<f64>| {
        (0..60).fold(Matrix3::zeros(), |h, j| h + u(j) * influence[j].transpose())
    };
    let strain_of = |h: Matrix3<f64>| {
        -StrainField::from_gradients(&[h; 60], None, &GreenLagrange)
            .unwrap()
            .summary()
            .mean[(2, 2)]
    };
    let exact = gradient(&|j| squeeze * points[j].coords);
    assert!((exact - squeeze).amax() < 1e-12);
    let covariance = Matrix3::from_diagonal(&noise.component_mul(&noise));
    let strain_covariance = mean_strain_covariance(
        &[exact; 60],
        &[1.0; 60],
        |_, j| influence[j],
        &[covariance; 60],
    )
    .unwrap();
    let strain = Estimate::new(strain_of(exact), strain_covariance[(2, 2)].sqrt());
    let propagated = modulus_of(Estimate::new(force, force_error), strain).unwrap();
    let redrawn = Redrawn::new(11, |normal| {
        let f = Estimate::exact(force + force_error * normal());
        let shifts: Vec<Vector3<f64>> = (0..60).map(|_| noise.map(|s| s * normal())).collect();
        let h = gradient(&|j| squeeze * points[j].coords + shifts[j]);
        let modulus = modulus_of(f, Estimate::exact(strain_of(h))).unwrap();
        modulus.youngs_modulus_pa
    });
    let ratio = propagated.standard_error_pa / redrawn.standard_error;
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    let interval = [
        propagated.interval_95.lower,
        propagated.interval_95.upper.unwrap(),
    ];
    for (one, other) in interval.iter().zip(redrawn.interval_95) {
        // Quantiles of 4000 draws near 2.5 % wander by 7 % of a standard deviation; four of these.
        assert!((one - other).abs() < 0.3 * redrawn.standard_error);
    }
}

#[test]
fn a_calibrations_error_does_not_average_out() {
    let reduced = reduced_modulus_pa(Body::rigid(), Body::elastic(50e3, 0.5).unwrap()).unwrap();
    let loads: Vec<_> = (1..9)
        .map(|k| {
            let f = 1e-3 * f64::from(k);
            let a = HertzContact::from_force(f, 4e-3, reduced)
                .unwrap()
                .contact_radius_m;
            LoadState {
                contact_radius_m: Some(Estimate::new(a, 0.002 * a)),
                ..LoadState::new(Estimate::new(f, 0.004 * f))
            }
        })
        .collect();
    let estimator = HertzSphere::new(4e-3, 0.5).unwrap();
    let shared = SharedErrors {
        force_scale: 0.01,
        ..SharedErrors::default()
    };
    let series = LoadSeries::new(loads).with_shared_errors(shared).unwrap();
    let propagated = estimator.estimate(&series).unwrap();
    let redrawn = Redrawn::new(2, |normal| {
        let scale = 1.0 + shared.force_scale * normal();
        let loads = series.loads().iter().map(|load| {
            let mut draw = |e: Estimate, scale: f64| {
                Estimate::new(
                    (e.value + e.standard_error * normal()) * scale,
                    e.standard_error,
                )
            };
            LoadState {
                contact_radius_m: load.contact_radius_m.map(|a| draw(a, 1.0)),
                ..LoadState::new(draw(load.force_n, scale))
            }
        });
        let loads = LoadSeries::new(loads.collect::<Vec<_>>());
        estimator.estimate(&loads).unwrap().youngs_modulus_pa
    });
    let ratio = propagated.standard_error_pa / redrawn.standard_error;
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    assert!(propagated.standard_error_pa / propagated.youngs_modulus_pa > 0.01);
}
