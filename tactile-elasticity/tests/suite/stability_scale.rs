//! Small strain under large rotation, nearly singular deformations and contacts of every size,
//! compared with 80-digit numbers.
#![allow(clippy::print_stdout)]

use test_support as worst;

use nalgebra::Matrix3;
use serde_json::Value;
use tactile_elasticity::contact::HertzContact;
use tactile_elasticity::strain::{
    Biot, Deformation, EulerAlmansi, GreenLagrange, Hencky, StrainMeasure,
};
use worst::{Worst, cases, rows};

fn matrix(value: &Value) -> Matrix3<f64> {
    let rows = rows(value);
    Matrix3::from_fn(|i, j| rows[i][j])
}

/// Relative to the largest entry of the strain, however small: a dozen roundings of twofold
/// arithmetic or of single products.
const ALLOWED: f64 = 50.0;

#[test]
fn strains_have_all_their_digits() {
    let mut table = Worst::new("strain");
    let measures: [(&str, &dyn StrainMeasure); 4] = [
        ("green_lagrange", &GreenLagrange),
        ("almansi", &EulerAlmansi),
        ("biot", &Biot),
        ("hencky", &Hencky),
    ];
    for case in cases(include_str!("../reference/strain.json")) {
        let (name, condition) = (
            case["name"].as_str().unwrap(),
            case["condition"].as_f64().unwrap(),
        );
        let deformation = Deformation::from_deformation_gradient(matrix(&case["f"]));
        for (key, measure) in measures {
            let expected = matrix(&case[key]);
            let error = (measure.of(&deformation).unwrap() - expected).amax() / expected.amax();
            table.enter(
                &format!("{key}, {name}"),
                error / (f64::EPSILON * condition),
                ALLOWED,
            );
        }
        let jacobian = case["jacobian"].as_f64().unwrap();
        let error = (deformation.jacobian() / jacobian - 1.0).abs();
        table.enter(
            &format!("J, {name}"),
            error / (f64::EPSILON * condition),
            ALLOWED,
        );
    }
    hertz(&mut table);
    table.finish();
}

/// Products and roots: each result depends on its inputs with exponents below one.
fn hertz(table: &mut Worst) {
    for case in cases(include_str!("../reference/hertz.json")) {
        let at = |key: &str| case[key].as_f64().unwrap();
        let contact = HertzContact::from_force(at("force"), at("radius"), at("modulus")).unwrap();
        for (key, found) in [
            ("contact_radius", contact.contact_radius_m),
            ("indentation", contact.indentation_m),
            ("peak_pressure", contact.peak_pressure_pa),
        ] {
            let units = (found / at(key) - 1.0).abs() / f64::EPSILON;
            table.enter(
                &format!("Hertz {key}, {}", case["name"].as_str().unwrap()),
                units,
                8.0,
            );
        }
    }
}
