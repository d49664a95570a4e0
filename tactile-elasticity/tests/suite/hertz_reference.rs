//! Every case of the Hertz reference (70-digit arithmetic).

use crate::common::{number, optional, reference};
use serde_json::Value;
use tactile_elasticity::ElasticityError;
use tactile_elasticity::contact::*;
use tactile_elasticity::modulus::{
    Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator, Uncertain,
};

fn of_kind(kind: &str) -> Vec<Value> {
    reference("hertz.json")
        .unwrap_or_default()
        .into_iter()
        .filter(|c| c["kind"] == kind)
        .collect()
}

fn close(case: &Value, what: &str, found: f64, expected: f64, tolerance: f64) {
    let gap = (found - expected).abs() / if expected == 0.0 { 1.0 } else { expected.abs() };
    let id = &case["id"];
    assert!(gap <= tolerance, "{id} {what}: {found:e} for {expected:e}");
}

/// Compares each number with the expected number of the same name.
fn all_close(case: &Value, expected: &Value, tolerance: f64, found: &[(&str, f64)]) {
    for (key, found) in found {
        close(case, key, *found, number(&expected[key]), tolerance);
    }
}

fn bond(case: &Value) -> Bond {
    match case["bonded"].as_bool().unwrap() {
        true => Bond::Bonded,
        false => Bond::Free,
    }
}

fn body(modulus: &Value, nu: &Value) -> Body {
    modulus
        .as_f64()
        .map_or_else(Body::rigid, |e| Body::elastic(e, number(nu)).unwrap())
}

#[test]
fn contacts() {
    for case in of_kind("hertz") {
        if case["status"] == "conforming" {
            continue;
        }
        // 1/R = 1/R₁ + 1/R₂. The sum of the radii is exact if they nearly cancel.
        let radius = match (optional(&case["R1"]), optional(&case["R2"])) {
            (Some(one), Some(other)) => one / (one + other) * other,
            (one, other) => one.or(other).unwrap(),
        };
        let one = body(&case["E1"], &case["nu1"]);
        let other = body(&case["E2"], &case["nu2"]);
        let reduced = one.reduced_modulus_pa(other).unwrap();
        let contact = HertzContact::from_force(number(&case["F"]), radius, reduced);
        let contact = contact.unwrap();
        let found = [
            ("R", contact.radius_m),
            ("E_star", contact.reduced_modulus_pa),
            ("a", contact.contact_radius_m),
            ("delta", contact.indentation_m),
            ("p0", contact.peak_pressure_pa),
            ("p_mean", contact.mean_pressure_pa),
            ("stiffness", contact.stiffness_n_per_m),
        ];
        all_close(&case, &case["expected"], 1e-12, &found);
    }
}

#[test]
fn inverses() {
    for case in of_kind("inverse") {
        let (force, radius, nu) = (number(&case["F"]), number(&case["R"]), number(&case["nu2"]));
        let other = body(&case["E1"], &case["nu1"]);
        let estimator = HertzSphere::new(radius, nu).unwrap().with_other_body(other);
        let exact = |key: &str| case[key].as_f64().map(Uncertain::exact);
        let bare = LoadState::new(Estimate::exact(force));
        let [mut by_radius, mut by_indentation] = [bare; 2];
        by_radius.contact_radius_m = exact("a");
        by_indentation.indentation_m = exact("delta");
        for (key, load) in [("from_a", by_radius), ("from_delta", by_indentation)] {
            let expected = &case["expected"][key];
            if load == bare || expected.is_null() {
                continue;
            }
            match estimator.estimate(&LoadSeries::new([load])) {
                Ok(found) => {
                    // 1/E* − C cancels: the condition of the result is 1/(1 − C E*).
                    let reduced = number(&expected["E_star"]);
                    let cond = 1.0 / (1.0 - other.compliance_per_pa() * reduced);
                    let tolerance = 1e-12f64.max(100.0 * f64::EPSILON * cond);
                    let modulus = found.youngs_modulus_pa;
                    close(&case, "E2", modulus, number(&expected["E2"]), tolerance);
                }
                Err(ElasticityError::StifferThanResolvable { .. }) => {
                    let id = &case["id"];
                    assert_eq!(expected["status"], "stiffer_than_indenter", "{id}");
                }
                Err(e) => panic!("{}: {e}", case["id"]),
            }
        }
    }
}

#[test]
fn surfaces() {
    for case in of_kind("surface") {
        let [a, p0, e] = ["a", "p0", "E_star"].map(|key| number(&case[key]));
        for (i, r) in case["r"].as_array().unwrap().iter().enumerate() {
            let found = HertzContact::surface_displacement_m(number(r), a, p0, e);
            close(&case, "u", found, number(&case["expected"]["u"][i]), 1e-12);
        }
    }
}

/// The reference of the integral equation is itself accurate to about 10⁻⁹, and its samples have
/// ten printed digits.
#[test]
fn layers_solved() {
    for case in of_kind("layer") {
        let (bond, nu) = (bond(&case), number(&case["nu"]));
        let expected = &case["integral_equation"];
        let equation = LayerEquation::new(bond, nu).unwrap();
        for sample in expected["samples"].as_array().unwrap() {
            let contact = equation.solve(number(&sample["a_over_h"])).unwrap();
            let found = [("chi", contact.chi), ("F_ratio", contact.force_ratio)];
            all_close(&case, sample, 1e-9, &found);
        }
    }
}
