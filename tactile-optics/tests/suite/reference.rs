//! Agreement with reference numbers computed to 80 digits. If they are absent, the test is skipped
//! and prints a line.
#![allow(clippy::print_stdout, clippy::print_stderr)]
use serde_json::Value;
use tactile_optics::{
    Angle, Fresnel, acceptance_angle, critical_angle, fresnel, normal_incidence, propagation,
};
use test_support::numbers;

const EPS: f64 = f64::EPSILON;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Relative error, or the absolute error if zero is expected.
fn error(found: f64, expected: f64) -> f64 {
    if expected == 0.0 {
        found.abs()
    } else {
        ((found - expected) / expected).abs()
    }
}

/// Largest error and number of compared values.
#[derive(Default)]
struct Score {
    worst: f64,
    values: usize,
}

impl Score {
    fn check(&mut self, found: f64, expected: f64, tolerance: f64, what: &str) {
        let error = error(found, expected);
        assert!(
            error <= tolerance,
            "{what}: {found} against {expected}, error {error:e} > {tolerance:e}"
        );
        self.values += 1;
        self.worst = self.worst.max(error / tolerance);
    }

    fn angle(&mut self, found: &Angle, expected: &Value, name: &str, what: &str) {
        let at = |suffix: &str| number(&expected[format!("{name}_{suffix}")]);
        self.check(found.radians, at("rad"), 1e-13, what);
        self.check(found.radians.to_degrees(), at("deg"), 1e-13, what);
        self.check(found.complement, at("complement_rad"), 1e-13, what);
    }
}

fn check_stack(case: &Value, score: &mut Score) {
    let (n0, indices) = (number(&case["n0"]), numbers(&case["indices"]));
    let what = case["id"].as_str().unwrap();
    for (&n, layer) in indices.iter().zip(case["layers"].as_array().unwrap()) {
        match (
            critical_angle(n, n0).unwrap(),
            layer["critical_status"].as_str().unwrap(),
        ) {
            (Some(angle), "ok") => score.angle(&angle, layer, "critical", what),
            (None, "undefined") => {}
            other => panic!("{what}: {other:?}"),
        }
        let acceptance = acceptance_angle(n, n0).unwrap();
        match layer["acceptance_status"].as_str().unwrap() {
            "ok" => score.angle(&acceptance, layer, "acceptance", what),
            "unlimited" => assert_eq!(acceptance.complement, 0.0, "{what}"),
            "undefined" => assert_eq!(acceptance.radians, 0.0, "{what}"),
            other => panic!("{what}: {other:?}"),
        }
    }
    let normal = normal_incidence(&indices, n0).unwrap();
    score.check(
        normal.single_pass,
        number(&case["normal_T_single_pass"]),
        1e-13,
        what,
    );
    score.check(
        normal.transmittance,
        number(&case["normal_T_incoherent"]),
        1e-13,
        what,
    );
    score.check(
        normal.reflectance,
        number(&case["normal_R_incoherent"]),
        1e-13,
        what,
    );
}

fn check_snell(case: &Value, score: &mut Score) {
    let (n0, indices) = (number(&case["n0"]), numbers(&case["indices"]));
    let (invariant, what) = (number(&case["invariant"]), case["id"].as_str().unwrap());
    let expected = case["layers"]
        .as_array()
        .unwrap()
        .iter()
        .chain(std::iter::once(&case["ambient"]));
    for (&n, expected) in indices.iter().chain(std::iter::once(&n0)).zip(expected) {
        let found = propagation(n, invariant).unwrap();
        match (found, expected["status"].as_str().unwrap()) {
            (Some(angle), "ok") => {
                score.check(angle.radians, number(&expected["theta_rad"]), 1e-13, what);
                let cosine = angle.complement.sin();
                score.check(cosine, number(&expected["cos"]), 1e-13, what);
            }
            (None, "evanescent") => {}
            other => panic!("{what}: {other:?}"),
        }
    }
}

fn check_fresnel(case: &Value, score: &mut Score) {
    let at = |name: &str| number(&case[name]);
    let (n1, n2, theta, what) = (
        at("n1"),
        at("n2"),
        at("theta_rad"),
        case["id"].as_str().unwrap(),
    );
    let found = fresnel(n1, n2, theta).unwrap();
    let total = case["expected"]["status"].as_str() == Some("total");
    if found.refraction.is_none() != total {
        // One ulp of the angle on either side of the critical angle is decisive; the sine itself
        // has half an ulp.
        assert!(
            (n1 * theta.sin() - n2).abs() < 2.0 * EPS * n2,
            "{what}: total {} against {total}",
            found.refraction.is_none()
        );
        assert!(found.transmittance < 1e-6, "{what}");
        score.values += 1;
    } else if total {
        assert_eq!(
            (found.reflectance_s, found.reflectance_p),
            (1.0, 1.0),
            "{what}"
        );
        assert_eq!(
            (found.transmittance_s, found.transmittance_p),
            (0.0, 0.0),
            "{what}"
        );
        score.values += 1;
    } else {
        check_partial(case, &found, score);
    }
}

/// Relative condition with respect to the angle.
struct Condition {
    /// n₂ cos θ₂, squared.
    refracted: f64,
    /// Of n₂ cos θ₂, near the critical angle.
    grazing: f64,
    /// Of n₂ c₁ − n₁ s₁, near Brewster's angle.
    brewster: f64,
}

impl Condition {
    fn of(n1: f64, n2: f64, theta: f64) -> Self {
        let (sine, cosine) = theta.sin_cos();
        let refracted = ((n2 - n1 * sine) * (n2 + n1 * sine)).max(n2 * n2 * EPS);
        let grazing = theta * n1 * n1 * sine * cosine / refracted;
        let brewster = theta * (n2 * sine + n1 * cosine) / (n2 * cosine - n1 * sine).abs().max(EPS);
        Self {
            refracted,
            grazing,
            brewster,
        }
    }
}

fn tolerance(condition: f64) -> f64 {
    f64::max(1e-13, 10.0 * EPS * condition)
}

/// A part of the light is transmitted: angle, transmittances and reflectances.
fn check_partial(case: &Value, found: &Fresnel, score: &mut Score) {
    let (n1, n2, what) = (
        number(&case["n1"]),
        number(&case["n2"]),
        case["id"].as_str().unwrap(),
    );
    let value = |name: &str| number(&case["expected"][name]);
    let condition = Condition::of(n1, n2, number(&case["theta_rad"]));
    let (grazing, angle) = (condition.grazing, found.refraction.unwrap().radians);
    score.check(
        angle,
        value("theta_t"),
        tolerance(grazing * condition.refracted.sqrt()),
        what,
    );
    score.check(found.transmittance_s, value("Ts"), tolerance(grazing), what);
    score.check(found.transmittance_p, value("Tp"), tolerance(grazing), what);
    if n1 == n2 {
        // Without an interface the reference has the rounding of its 80 digits.
        assert_eq!(
            (found.reflectance_s, found.reflectance_p),
            (0.0, 0.0),
            "{what}"
        );
        return;
    }
    // R = 1 − T: if T is small, its error is an absolute error of R.
    let of_reflectance = |t: f64| tolerance(2.0 * grazing * t.min(1.0));
    score.check(
        found.reflectance_s,
        value("Rs"),
        of_reflectance(value("Ts")),
        what,
    );
    score.check(
        found.reflectance,
        value("R"),
        of_reflectance(value("Tp")),
        what,
    );
    if condition.brewster < 1e6 {
        let cond = tolerance(2.0 * condition.brewster).max(of_reflectance(value("Tp")));
        score.check(found.reflectance_p, value("Rp"), cond, what);
    } else {
        assert!(
            (found.reflectance_p - value("Rp")).abs() < 1e-15,
            "{what}: Rp at Brewster's angle"
        );
        score.values += 1;
    }
}

#[test]
fn every_reference_case_agrees() {
    let Some(data) = test_support::reference("optics.json") else {
        return;
    };
    let (mut score, mut cases) = (Score::default(), 0);
    for case in data["cases"].as_array().unwrap() {
        match case["kind"].as_str().unwrap() {
            "stack" => check_stack(case, &mut score),
            "snell" => check_snell(case, &mut score),
            "fresnel" => check_fresnel(case, &mut score),
            other => panic!("unknown kind {other}"),
        }
        cases += 1;
    }
    println!(
        "{cases} cases, {} values, worst error {:.3} of its tolerance",
        score.values, score.worst
    );
    assert_eq!(cases, data["header"]["case_count"].as_u64().unwrap());
}
