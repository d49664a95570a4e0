//! Every case of the strain reference (90-digit arithmetic), to 10⁻¹² if cond F ≤ 10² and to 100 ε
//! cond F otherwise.

use crate::common::{number, reference};
use nalgebra::Matrix3;
use serde_json::Value;
use tactile_elasticity::strain::{
    Biot, Deformation, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, StrainMeasure,
};

fn matrix(v: &Value) -> Option<Matrix3<f64>> {
    v.as_array()
        .map(|rows| Matrix3::from_fn(|i, j| number(&rows[i][j])))
}

fn deformation(case: &Value) -> Deformation {
    match matrix(&case["H"]) {
        Some(h) => Deformation::from_displacement_gradient(h),
        None => Deformation::from_deformation_gradient(matrix(&case["F"]).expect("F or H")),
    }
}

fn tolerance(case: &Value) -> f64 {
    let cond = case["cond_F"].as_f64().unwrap_or(1.0);
    if cond <= 100.0 {
        1e-12
    } else {
        100.0 * f64::EPSILON * cond
    }
}

/// Largest error relative to the largest entry.
fn error(found: &Matrix3<f64>, expected: &Matrix3<f64>) -> f64 {
    let size = expected.amax();
    let gap = (found - expected).amax();
    if size > 0.0 { gap / size } else { gap }
}

#[test]
fn every_measure_and_scalar_of_every_case() {
    let measures: [(&str, &dyn StrainMeasure); 5] = [
        ("green_lagrange", &GreenLagrange),
        ("almansi", &EulerAlmansi),
        ("hencky", &Hencky),
        ("biot", &Biot),
        ("infinitesimal", &Infinitesimal),
    ];
    for case in reference("strain.json").unwrap_or_default() {
        let (d, tol, id) = (deformation(&case), tolerance(&case), &case["id"]);
        let expected = &case["expected"];
        for (key, measure) in measures {
            let found = measure.of(&d);
            match matrix(&expected[key]) {
                Some(expected) => {
                    let error = error(&found.expect("exists"), &expected);
                    assert!(error <= tol, "{id} {key}: {error:.2e}");
                }
                None => assert!(found.is_err(), "{id} {key} does not exist"),
            }
        }
        let [first, second, third] = d.stretches();
        let stretches = &expected["principal_stretches"];
        for (found, expected) in [
            (d.jacobian(), &expected["J"]),
            (d.volume_change(), &expected["J_minus_1"]),
            (first, &stretches[0]),
            (second, &stretches[1]),
            (third, &stretches[2]),
        ] {
            let Some(e) = expected.as_f64() else { continue };
            // A zero of the reference is an exact zero. Rounding may leave one unit in the last
            // place.
            let gap = (found - e).abs() / if e == 0.0 { 1.0 } else { e.abs() };
            assert!(gap <= tol, "{id}: {found:e} for {e:e}");
        }
    }
}
