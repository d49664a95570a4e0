//! Every case of the strain reference (90-digit arithmetic), 10⁻¹² where cond F ≤ 10², else 100 ε
//! cond F.

#![allow(clippy::print_stdout)]

use crate::common::{number, reference};
use nalgebra::Matrix3;
use serde_json::Value;
use tactile_elasticity::strain::{
    Biot, Deformation, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, PrincipalStretches,
    StrainMeasure,
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
fn every_measure_of_every_case() {
    let Some(cases) = reference("strain.json") else {
        return;
    };
    let measures: [(&str, &dyn StrainMeasure); 5] = [
        ("green_lagrange", &GreenLagrange),
        ("almansi", &EulerAlmansi),
        ("hencky", &Hencky),
        ("biot", &Biot),
        ("infinitesimal", &Infinitesimal),
    ];
    let mut worst = 0.0f64;
    for case in &cases {
        let d = deformation(case);
        for (key, measure) in measures {
            match matrix(&case["expected"][key]) {
                Some(expected) => {
                    let e = error(&measure.of(&d).expect("exists"), &expected) / tolerance(case);
                    assert!(e <= 1.0, "{} {key}: {e:.2e} of the tolerance", case["id"]);
                    worst = worst.max(e);
                }
                None => assert!(
                    measure.of(&d).is_err(),
                    "{} {key} does not exist",
                    case["id"]
                ),
            }
        }
    }
    println!(
        "{} cases, worst error {worst:.2e} of the tolerance",
        cases.len()
    );
}

#[test]
fn every_scalar_of_every_case() {
    let Some(cases) = reference("strain.json") else {
        return;
    };
    for case in &cases {
        let (d, expected, tol) = (deformation(case), &case["expected"], tolerance(case));
        let check = |key: &str, found: f64, index: Option<usize>| {
            let v = index.map_or(&expected[key], |i| &expected[key][i]);
            let Some(e) = v.as_f64() else { return };
            // A zero of the reference is a zero of the mathematics; rounding may leave an ulp of
            // one.
            let gap = (found - e).abs() / if e == 0.0 { 1.0 } else { e.abs() };
            assert!(
                gap <= tol,
                "{} {key} {index:?}: {found:e} for {e:e}",
                case["id"]
            );
        };
        check("J", d.jacobian(), None);
        check("J_minus_1", d.volume_change(), None);
        let principal = PrincipalStretches::from(&d);
        (0..3).for_each(|i| check("principal_stretches", principal.stretches[i], Some(i)));
    }
}

#[test]
fn cauchy_stress_of_every_case() {
    use tactile_elasticity::stress::{
        StressMeasure::{self, Cauchy, SecondPiolaKirchhoff},
        convert_stress,
    };
    let Some(cases) = reference("strain.json") else {
        return;
    };
    for case in &cases {
        let d = deformation(case);
        let second = matrix(&case["S"]).expect("S");
        let cauchy = convert_stress(&second, SecondPiolaKirchhoff, Cauchy, &d);
        match (matrix(&case["expected"]["cauchy"]), cauchy) {
            (Some(expected), Ok(found)) => {
                let e = error(&found, &expected);
                assert!(e <= tolerance(case), "{}: {e:.2e}", case["id"]);
                if tolerance(case) < 1e-9 {
                    // There and back by every measure: rounding times the deformation's condition.
                    for through in [
                        SecondPiolaKirchhoff,
                        StressMeasure::FirstPiolaKirchhoff,
                        StressMeasure::Biot,
                        StressMeasure::Kirchhoff,
                    ] {
                        let there = convert_stress(&found, Cauchy, through, &d).expect("upright");
                        let back = convert_stress(&there, through, Cauchy, &d).expect("upright");
                        assert!(error(&back, &found) < 1e-9, "{} {through:?}", case["id"]);
                    }
                }
            }
            (expected, found) => assert!(expected.is_none() && found.is_err(), "{}", case["id"]),
        }
    }
}
