//! Angles at every scale and within a few units in the last place of the limits, compared with
//! 80-digit numbers.
#![allow(clippy::print_stdout)]

use test_support as worst;

use tactile_optics::{Angle, acceptance_angle, critical_angle};
use worst::{Worst, cases};

/// A dozen roundings, each of which affects the result at most once: differences of indices are
/// computed before any rounding.
const ALLOWED: f64 = 4.0;

#[test]
fn angles_have_all_their_digits() {
    let mut table = Worst::new("optics");
    for case in cases(include_str!("../reference/angles.json")) {
        let at = |key: &str| case[key].as_f64().unwrap_or(f64::NAN);
        let name = case["name"].as_str().unwrap();
        let mut enter = |angle: Angle, which: &str| {
            for (found, key) in [(angle.radians, "rad"), (angle.complement, "complement_rad")] {
                let expected = at(&format!("{which}_{key}"));
                let units = (found / expected - 1.0).abs() / f64::EPSILON;
                table.enter(&format!("{which} angle, {name}"), units, ALLOWED);
            }
        };
        let critical = critical_angle(at("n"), at("n0")).unwrap();
        enter(critical.expect("n is above n0"), "critical");
        let acceptance = acceptance_angle(at("n"), at("n0")).unwrap();
        if acceptance.complement > 0.0 {
            enter(acceptance, "acceptance");
        } else {
            assert!(case["acceptance_rad"].is_null(), "{name}");
        }
    }
    table.finish();
}
