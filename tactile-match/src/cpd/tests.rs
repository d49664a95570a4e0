//! Tests of the building blocks.

use super::*;
use crate::common::{bend, scattered};

#[test]
fn a_used_workspace_forgets_the_last_match_and_registers_without_allocating() {
    let options = CoherentPointDrift::default();
    let mut workspace = DriftWorkspace::default();
    let sets: Vec<_> = [(40, 5), (20, 6), (40, 7)]
        .into_iter()
        .map(|(n, seed)| scattered::<3>(n, seed))
        .map(|model| (bend(&model, 0.05), model))
        .collect();
    for (target, model) in &sets {
        let again = options.match_with(&mut workspace, model, target).unwrap();
        let anew = options.match_points(model, target).unwrap();
        assert_eq!(again.warped, anew.warped);
    }
    let counted = allocation_counter::measure(|| {
        for (target, model) in &sets {
            workspace.register(&options, model, target);
        }
    });
    assert_eq!(counted.count_total, 0);
}

/// Two units in the last place: the polynomial's own rounding and that of the product with the
/// power of two's reduction.
#[test]
fn agrees_with_the_standard_library() {
    for k in 0..200_000 {
        let x = -f64::from(k) * 0.003_541;
        let (found, expected) = (exp_of_negative(x), x.exp());
        if x > -708.0 {
            assert!(
                (found - expected).abs() <= 2.0 * f64::EPSILON * expected,
                "exp({x}) = {found:e}"
            );
        }
    }
}

#[test]
fn ends_are_exact() {
    assert_eq!(exp_of_negative(0.0), 1.0);
    assert_eq!(exp_of_negative(-0.0), 1.0);
    for low in [-708.0, -1e3, -1e300, f64::NEG_INFINITY] {
        assert_eq!(exp_of_negative(low), 0.0);
    }
}
