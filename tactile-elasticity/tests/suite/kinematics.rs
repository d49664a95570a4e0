//! Rotation, principal strains, change of size and equivalent strain, compared with constructed
//! deformations. Their errors are compared with random draws of the gradient.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_elasticity::kinematics::StrainQuantities;
use tactile_elasticity::strain::{GreenLagrange, Hencky, Infinitesimal};

const NONE: Matrix3<f64> = Matrix3::from_array_storage(nalgebra::ArrayStorage([[0.0; 3]; 3]));

/// F = R U with a known rotation and known stretches along known directions.
#[test]
fn a_constructed_deformation_is_taken_apart() {
    let axes = Rotation3::from_euler_angles(0.3, -0.5, 1.1);
    let stretches: Vector3<f64> = Vector3::new(1.2, 1.05, 0.9);
    let u = axes.matrix() * Matrix3::from_diagonal(&stretches) * axes.matrix().transpose();
    let about = nalgebra::Unit::new_normalize(Vector3::new(1.0, -2.0, 0.5));
    for angle in [0.0, 1e-9, 0.7, 3.0] {
        let turn = Rotation3::from_axis_angle(&about, angle);
        let h = turn.matrix() * u - Matrix3::identity();
        let found = StrainQuantities::of(&h, &NONE, 3, &Hencky).unwrap();
        assert!((found.rotation_rad - angle).abs() < 1e-14, "{angle}");
        assert!((found.size_ratio - 1.2 * 1.05 * 0.9).abs() < 1e-14);
        for k in 0..3 {
            assert!((found.principal[k] - stretches[k].ln()).abs() < 1e-14);
            let along = found.directions.column(k).dot(&axes.matrix().column(k));
            assert!((along.abs() - 1.0).abs() < 1e-14);
        }
        let logs = stretches.map(f64::ln);
        let deviator = logs.map(|x| x - logs.sum() / 3.0);
        let equivalent = (2.0 / 3.0 * deviator.norm_squared()).sqrt();
        assert!((found.equivalent - equivalent).abs() < 1e-14);
        assert_eq!(
            (found.rotation_error_rad, found.equivalent_error),
            (0.0, 0.0)
        );
    }
}

/// In the plane the sign of a rotation is determined, and z has no effect.
#[test]
fn the_plane_turns_either_way() {
    for angle in [-1.0_f64, 0.2, 2.5] {
        let (s, c) = angle.sin_cos();
        let u = Matrix3::new(1.1, 0.03, 0.0, 0.03, 0.95, 0.0, 0.0, 0.0, 1.0);
        let turn = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
        let h = turn * u - Matrix3::identity();
        let found = StrainQuantities::of(&h, &NONE, 2, &Infinitesimal).unwrap();
        assert!((found.rotation_rad - angle).abs() < 1e-14);
        assert!((found.size_ratio - (1.1 * 0.95 - 9e-4)).abs() < 1e-14);
        assert_eq!(found.principal[2], 0.0);
    }
}

/// The equivalent strain of incompressible tension along one axis is the strain of the tension.
#[test]
fn equivalent_strain_of_incompressible_tension_is_the_tension() {
    let h = Matrix3::from_diagonal(&Vector3::new(0.02, -0.01, -0.01));
    let found = StrainQuantities::of(&h, &NONE, 3, &Infinitesimal).unwrap();
    assert!((found.equivalent - 0.02).abs() < 1e-16);
}

/// 4000 draws determine a standard deviation to 1.1 %. Errors are a hundredth of the strain, for
/// which the first order is accurate to a few per cent.
#[test]
fn errors_are_those_of_gradients_drawn_anew() {
    let h = Matrix3::new(0.05, 0.02, 0.01, -0.03, -0.04, 0.02, 0.0, 0.01, 0.01);
    let root = Matrix3::new(3e-4, 0.0, 0.0, 1e-4, 2e-4, 0.0, -1e-4, 1e-4, 4e-4);
    let covariance = root * root.transpose();
    let found = StrainQuantities::of(&h, &covariance, 3, &GreenLagrange).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let draws: Vec<StrainQuantities> = (0..4000)
        .map(|_| {
            let mut drawn = h;
            for row in 0..3 {
                let noise = root * Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
                (0..3).for_each(|axis| drawn[(row, axis)] += noise[axis]);
            }
            StrainQuantities::of(&drawn, &NONE, 3, &GreenLagrange).unwrap()
        })
        .collect();
    let deviation = |of: &dyn Fn(&StrainQuantities) -> f64| {
        let squares = draws.iter().map(|draw| (of(draw) - of(&found)).powi(2));
        (squares.sum::<f64>() / draws.len() as f64).sqrt()
    };
    let turned = |draw: &StrainQuantities| {
        let (a, b) = (draw.directions.column(1), found.directions.column(1));
        a.cross(&b).norm()
    };
    let turned = draws.iter().map(|draw| turned(draw).powi(2)).sum::<f64>();
    for (stated, drawn) in [
        (
            found.gradient_error[(1, 2)],
            deviation(&|k| k.gradient[(1, 2)]),
        ),
        (found.rotation_error_rad, deviation(&|k| k.rotation_rad)),
        (found.principal_error[0], deviation(&|k| k.principal[0])),
        (found.principal_error[2], deviation(&|k| k.principal[2])),
        (found.size_ratio_error, deviation(&|k| k.size_ratio)),
        (found.equivalent_error, deviation(&|k| k.equivalent)),
        (
            found.direction_error_rad[1],
            (turned / draws.len() as f64).sqrt(),
        ),
    ] {
        assert!(
            (stated / drawn - 1.0).abs() < 0.06,
            "{stated:e} for {drawn:e}"
        );
    }
}

/// A flat sheet in space: results that depend on ∂u/∂z are unknown, and the others are not.
#[test]
fn what_follows_an_unknown_derivative_is_unknown() {
    let h = Matrix3::from_diagonal(&Vector3::new(0.02, 0.01, 0.0));
    let mut covariance = Matrix3::from_diagonal(&Vector3::new(1e-8, 1e-8, f64::INFINITY));
    covariance[(0, 2)] = f64::NAN;
    let found = StrainQuantities::of(&h, &covariance, 3, &GreenLagrange).unwrap();
    assert_eq!(found.gradient_error[(1, 1)], 1e-4);
    assert!(found.gradient_error[(2, 2)].is_infinite());
    assert!(found.size_ratio_error.is_infinite() && found.equivalent_error.is_infinite());
    assert!(found.principal_error[0] > 0.0);
    let none = StrainQuantities::undefined();
    assert!(none.rotation_rad.is_nan() && none.directions[(2, 2)].is_nan());
}
