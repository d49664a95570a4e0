//! The errors of matched displacements carried through the spline to the mean strain, against
//! drawing the displacements anew.

use nalgebra::{Matrix3, Point3, SVector, Vector3};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_imaging::elasticity::field::{StrainField, mean_strain_covariance};
use tactile_imaging::elasticity::strain::GreenLagrange;
use tactile_imaging::tps::{Factorization, FitOptions, Smoothing, SplineWorkspace};

type Points = Vec<Point3<f64>>;

/// 2500 draws know a standard deviation to 1.4 %.
#[test]
fn propagation_and_redrawing_agree() {
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let mut point = |size: f64| Point3::from([(); 3].map(|()| size * (rng.random::<f64>() - 0.5)));
    let before: Points = (0..70).map(|_| point(4e-3)).collect();
    let samples: Points = (0..25).map(|_| point(3e-3)).collect();
    // L of the covariance LLᵀ of every displacement.
    let mut entry = |i, j| 2e-6 * if i == j { 1.0 } else { point(1.0)[j] };
    let spread: Vec<_> = (0..70).map(|_| Matrix3::from_fn(&mut entry)).collect();
    // A squeeze that bends: the gradient differs from place to place.
    let bend = |p: &Point3<f64>| {
        let across = 0.02 * p.y + 4.0 * p.x * p.z;
        p + Vector3::new(0.02 * p.x, across, p.z * (-0.04 + 5.0 * p.x))
    };
    let after: Points = before.iter().map(bend).collect();
    // λ is held: the spline is then linear in its targets.
    let options = FitOptions::default().with_smoothing(Smoothing::Lambda(1e-4));
    let spline = Factorization::new(&before, &options.unwrap()).unwrap();
    let gradients = |after: &[Point3<f64>]| -> Vec<_> {
        let spline = spline.fit(after).unwrap();
        let gradient = |p| spline.jacobian(p) - Matrix3::identity();
        samples.iter().map(gradient).collect()
    };

    let mut influence = vec![SVector::zeros(); samples.len() * before.len()];
    let mut workspace = SplineWorkspace::default();
    spline
        .jacobian_influence_into(&mut workspace, &samples, &mut influence)
        .unwrap();
    let influence = |i: usize, j: usize| influence[i * before.len() + j];
    let displacement: Vec<_> = spread.iter().map(|l| l * l.transpose()).collect();
    let weights = vec![1.0; samples.len()];
    let covariance =
        mean_strain_covariance(&gradients(&after), &weights, influence, &displacement).unwrap();

    const DRAWS: usize = 2500;
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut draw = || {
        let moved = |(p, l): (&Point3<f64>, &Matrix3<f64>)| {
            p + l * Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal))
        };
        let drawn: Points = after.iter().zip(&spread).map(moved).collect();
        let field = StrainField::from_gradients(&gradients(&drawn), None, &GreenLagrange);
        field.unwrap().summary().mean.diagonal()
    };
    let draws: Vec<Vector3<f64>> = (0..DRAWS).map(|_| draw()).collect();
    let mean = draws.iter().sum::<Vector3<f64>>() / DRAWS as f64;
    for k in 0..3 {
        let squares: f64 = draws.iter().map(|e| (e[k] - mean[k]).powi(2)).sum();
        let redrawn = squares / (DRAWS - 1) as f64;
        let ratio = (covariance[(k, k)] / redrawn).sqrt();
        assert!((ratio - 1.0).abs() < 0.06, "e_{k}{k}: {ratio}");
    }
}
