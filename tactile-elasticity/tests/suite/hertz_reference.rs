//! Every case of the Hertz reference (70-digit arithmetic).

use crate::common::{number, optional, reference};
use serde_json::Value;
use tactile_elasticity::ElasticityError;
use tactile_elasticity::contact::*;

fn of_kind(kind: &str) -> Vec<Value> {
    reference("hertz.json")
        .unwrap_or_default()
        .into_iter()
        .filter(|c| c["kind"] == kind)
        .collect()
}

fn close(case: &Value, what: &str, found: f64, expected: f64, tolerance: f64) {
    let gap = (found - expected).abs() / if expected == 0.0 { 1.0 } else { expected.abs() };
    assert!(
        gap <= tolerance,
        "{} {what}: {found:e} for {expected:e}, off by {gap:.1e}",
        case["id"]
    );
}

fn body(modulus: &Value, nu: &Value) -> Body {
    modulus
        .as_f64()
        .map_or_else(Body::rigid, |e| Body::elastic(e, number(nu)).unwrap())
}

#[test]
fn contacts() {
    for case in of_kind("hertz") {
        let radius = relative_radius_m(optional(&case["R1"]), optional(&case["R2"]));
        if case["status"] == "conforming" {
            assert!(
                matches!(radius, Err(ElasticityError::Conforming { .. })),
                "{}",
                case["id"]
            );
            continue;
        }
        let (one, other) = (
            body(&case["E1"], &case["nu1"]),
            body(&case["E2"], &case["nu2"]),
        );
        let contact = HertzContact::from_force(
            number(&case["F"]),
            radius.unwrap(),
            reduced_modulus_pa(one, other).unwrap(),
        )
        .unwrap();
        for (key, found) in [
            ("R", contact.radius_m),
            ("E_star", contact.reduced_modulus_pa),
            ("a", contact.contact_radius_m),
            ("delta", contact.indentation_m),
            ("p0", contact.peak_pressure_pa),
            ("p_mean", contact.mean_pressure_pa),
            ("stiffness", contact.stiffness_n_per_m),
        ] {
            close(&case, key, found, number(&case["expected"][key]), 1e-12);
        }
    }
}

#[test]
fn inverses() {
    for case in of_kind("inverse") {
        let (force, radius, nu) = (number(&case["F"]), number(&case["R"]), number(&case["nu2"]));
        let other = body(&case["E1"], &case["nu1"]);
        let from_a = |a| reduced_modulus_from_contact_radius(force, radius, a);
        let from_delta = |d| reduced_modulus_from_indentation(force, radius, d);
        for (key, input) in [("from_a", "a"), ("from_delta", "delta")] {
            let expected = &case["expected"][key];
            let Some(x) = case[input].as_f64().filter(|_| !expected.is_null()) else {
                continue;
            };
            let reduced = if key == "from_a" {
                from_a(x)
            } else {
                from_delta(x)
            }
            .unwrap();
            close(&case, "E*", reduced, number(&expected["E_star"]), 1e-12);
            match sample_modulus_pa(reduced, nu, other) {
                Ok(e2) => {
                    // 1/E* − C cancels: the answer's condition is 1/(1 − C E*).
                    let cond = 1.0 / (1.0 - other.compliance_per_pa() * reduced);
                    let tolerance = 1e-12f64.max(100.0 * f64::EPSILON * cond);
                    close(&case, "E2", e2, number(&expected["E2"]), tolerance);
                }
                Err(ElasticityError::StifferThanResolvable { .. }) => {
                    assert_eq!(
                        expected["status"], "stiffer_than_indenter",
                        "{}",
                        case["id"]
                    );
                }
                Err(e) => panic!("{}: {e}", case["id"]),
            }
        }
    }
}

#[test]
fn surfaces() {
    for case in of_kind("surface") {
        let (a, p0, e) = (
            number(&case["a"]),
            number(&case["p0"]),
            number(&case["E_star"]),
        );
        for (i, r) in case["r"].as_array().unwrap().iter().enumerate() {
            let found = hertz_surface_displacement_m(number(r), a, p0, e);
            close(&case, "u", found, number(&case["expected"]["u"][i]), 1e-12);
        }
    }
}

#[test]
fn stacks() {
    for case in of_kind("stack") {
        let at = |key: &str, i: usize| number(&case[key][i]);
        let layers = (0..case["h"].as_array().unwrap().len())
            .map(|i| Layer {
                thickness_m: at("h", i),
                youngs_modulus_pa: at("E", i),
                poisson_ratio: at("nu", i),
            })
            .collect();
        let stack = Waveguide::new(layers).unwrap();
        close(
            &case,
            "series",
            stack.series_modulus_pa(),
            number(&case["expected"]["series_E"]),
            1e-12,
        );
        match case["expected"]["confined_M"].as_f64() {
            Some(m) => close(&case, "confined", stack.confined_modulus_pa(), m, 1e-12),
            None => assert!(stack.confined_modulus_pa().is_infinite()),
        }
    }
}

#[test]
fn punches_and_cones() {
    for case in of_kind("punch") {
        let (e, d, a) = (
            number(&case["E_star"]),
            number(&case["delta"]),
            number(&case["a"]),
        );
        let expected = |key: &str| number(&case["expected"][key]);
        let flat = flat_punch(e, a, d).unwrap();
        close(&case, "flat F", flat.force_n, expected("flat_F"), 1e-12);
        close(
            &case,
            "flat p",
            flat.mean_pressure_pa,
            expected("flat_p_mean"),
            1e-12,
        );
        let cone = cone(
            e,
            tangent_of_degrees(number(&case["half_angle_deg"])).unwrap(),
            d,
        )
        .unwrap();
        close(&case, "cone F", cone.force_n, expected("cone_F"), 1e-12);
        close(
            &case,
            "cone a",
            cone.contact_radius_m,
            expected("cone_a"),
            1e-12,
        );
        close(
            &case,
            "cone p",
            cone.mean_pressure_pa,
            expected("cone_p_mean"),
            1e-12,
        );
    }
}

#[test]
fn layers() {
    for case in of_kind("layer") {
        let (e, nu, r, h) = (
            number(&case["E"]),
            number(&case["nu"]),
            number(&case["R"]),
            number(&case["h"]),
        );
        let bond = if case["bonded"].as_bool().unwrap() {
            Bond::Bonded
        } else {
            Bond::Free
        };
        let published = LayerSeries::published(bond, nu).unwrap();
        for (k, c) in published.coefficients.iter().enumerate() {
            close(
                &case,
                "coefficient",
                *c,
                number(&case["expected"]["coefficients"][k]),
                1e-12,
            );
        }
        for row in case["expected"]["rows"].as_array().unwrap() {
            let d = number(&row["delta"]);
            let chi = (r * d).sqrt() / h;
            close(&case, "chi", chi, number(&row["chi"]), 1e-12);
            close(
                &case,
                "correction",
                published.force_ratio(chi),
                number(&row["correction"]),
                1e-12,
            );
            let hertz = 4.0 / 3.0 * e / (1.0 - nu * nu) * r.sqrt() * d.powf(1.5);
            close(&case, "F_hertz", hertz, number(&row["F_hertz"]), 1e-12);
            close(
                &case,
                "F",
                hertz * published.force_ratio(chi),
                number(&row["F"]),
                1e-12,
            );
            if let Some(modulus) = row["E_from_F_of_1N"].as_f64() {
                let reduced = reduced_modulus_from_indentation(1.0, r, d).unwrap();
                let found = sample_modulus_pa(reduced, nu, Body::rigid()).unwrap()
                    / published.force_ratio(chi);
                close(&case, "E", found, modulus, 1e-12);
            }
        }
    }
}

/// The reference of the integral equation is itself good to about 10⁻⁹, its samples are printed
/// with ten digits.
#[test]
fn layers_solved() {
    for case in of_kind("layer") {
        let bond = if case["bonded"].as_bool().unwrap() {
            Bond::Bonded
        } else {
            Bond::Free
        };
        let nu = number(&case["nu"]);
        let expected = &case["integral_equation"];
        let series = LayerSeries::corrected(bond, nu, 1.0).unwrap();
        for (k, c) in series.coefficients.iter().enumerate() {
            close(
                &case,
                "series",
                *c,
                number(&expected["series_exact"][k]),
                1e-9,
            );
        }
        for sample in expected["samples"].as_array().unwrap() {
            let contact = LayerEquation::new(bond, nu)
                .unwrap()
                .solve(number(&sample["a_over_h"]))
                .unwrap();
            close(&case, "chi", contact.chi, number(&sample["chi"]), 1e-9);
            close(
                &case,
                "F ratio",
                contact.force_ratio,
                number(&sample["F_ratio"]),
                1e-9,
            );
            close(
                &case,
                "series ratio",
                series.force_ratio(contact.chi),
                number(&sample["series_exact_ratio"]),
                1e-8,
            );
        }
    }
}
