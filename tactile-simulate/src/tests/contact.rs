//! Contacts by closed forms, by tables and by finite elements.

use crate::contact::SimulatedContact;
use crate::contact::{ContactModel, ContactState, finite_element_states};
use crate::{Elastic, ElasticSphere, LightGuide, SimulateError};
use std::f64::consts::PI;

const BALL: ElasticSphere = ElasticSphere {
    radius_m: 3e-3,
    material: Elastic::CL2000X,
};

fn contact(law: ContactModel, force_n: f64) -> SimulatedContact {
    SimulatedContact::new(&BALL, &LightGuide::default(), &law, force_n).unwrap()
}

#[test]
fn hertz_relations_hold_among_themselves() {
    let c = contact(ContactModel::Hertz, 0.7);
    let close = |x: f64, y: f64| assert!((x / y - 1.0).abs() < 1e-14, "{x} {y}");
    let (a, e) = (c.contact_radius_m, c.effective_modulus_pa);
    close(
        1.0 / e,
        0.75 / 103e3 + 0.75 * (2e-3 / 1.36e5 + 3e-3 / 8e4 + 5e-3 / 3.4e4) / 10e-3,
    );
    close(a.powi(3), 0.75 * 0.7 * 3e-3 / e);
    close(c.indentation_m, a * a / 3e-3);
    close(
        c.force_n,
        4.0 / 3.0 * e * 3e-3_f64.sqrt() * c.indentation_m.powf(1.5),
    );
    close(c.peak_pressure_pa, 2.0 * a * e / (PI * 3e-3));
    // The displacement of both surfaces at the centre is the approach.
    close(
        -c.waveguide_height_m(0.0),
        c.waveguide_share * c.indentation_m,
    );
}

#[test]
fn displacement_is_continuous_at_the_rim_and_where_the_series_takes_over() {
    let c = contact(ContactModel::Hertz, 0.7);
    for (r, step) in [
        (c.contact_radius_m, 1e-9),
        (50.0 * c.contact_radius_m, 1e-9),
    ] {
        let at = |q: f64| c.waveguide_height_m(q);
        // One-sided values differ by slope × step plus the cancellation of the closed form, (r/a)³
        // ulps.
        assert!((at(r * (1.0 - step)) / at(r * (1.0 + step)) - 1.0).abs() < 1e-8);
    }
    // Far away the contact acts as a point force on a half space: F/(π E* r) for both bodies.
    let r = 1e3 * c.contact_radius_m;
    let point = c.waveguide_share * c.force_n / (PI * c.effective_modulus_pa * r);
    assert!((-c.waveguide_height_m(r) / point - 1.0).abs() < 1e-6);
}

#[test]
fn tatara_keeps_the_radius_and_lessens_the_approach() {
    let [h, t] = [ContactModel::Hertz, ContactModel::Tatara].map(|law| contact(law, 0.7));
    assert_eq!(h.contact_radius_m, t.contact_radius_m);
    assert!(t.indentation_m < h.indentation_m && t.indentation_m > 0.0);
    // At small load the correction vanishes relative to Hertz's approach, like F relative to
    // F^(2/3).
    let ratio = |f| {
        contact(ContactModel::Tatara, f).indentation_m
            / contact(ContactModel::Hertz, f).indentation_m
    };
    let fall = (1.0 - ratio(1e-6)) / (1.0 - ratio(1e-9));
    assert!((fall - 10.0).abs() < 0.01, "{fall}");
}

/// Hertz's contact as a table of `samples` distances out to 1.5 a.
fn hertz(force_n: f64, samples: usize) -> (SimulatedContact, ContactState) {
    let contact = contact(ContactModel::Hertz, force_n);
    let a = contact.contact_radius_m;
    let radius_m: Vec<f64> = (0..samples)
        .map(|k| 1.5 * a * k as f64 / (samples - 1) as f64)
        .collect();
    let state = ContactState {
        force_n,
        contact_radius_m: a,
        indentation_m: contact.indentation_m,
        pressure_pa: radius_m.iter().map(|&r| contact.pressure_pa(r)).collect(),
        height_m: (radius_m.iter())
            .map(|&r| contact.waveguide_height_m(r))
            .collect(),
        radius_m,
    };
    (contact, state)
}

#[test]
fn states_between_and_below_hertz_are_hertz() {
    let states = [hertz(0.2, 301).1, hertz(1.2, 301).1];
    for force_n in [0.01, 0.2, 0.6, 1.2] {
        let found = ContactState::at_force(&states, force_n).unwrap();
        let (expected, _) = hertz(force_n, 2);
        let close = |x: f64, y: f64| (x / y - 1.0).abs() < 1e-9;
        assert!(
            close(found.contact_radius_m, expected.contact_radius_m),
            "{force_n}"
        );
        assert!(close(found.carried_force_n(), force_n));
        let r = 0.4 * expected.contact_radius_m;
        assert!(close(found.pressure_at_pa(r), expected.pressure_pa(r)));
        // Heights are linear between the samples: a chord of a/200 has a relative error of about
        // 1e-5.
        let height = found.height_at_m(r) / expected.waveguide_height_m(r);
        assert!((height - 1.0).abs() < 1e-4, "{force_n} {height}");
    }
    assert_eq!(ContactState::at_force(&states, 1.3), None);
}

#[test]
fn a_table_without_meaning_is_refused() {
    let (_, good) = hertz(0.7, 16);
    let refused = |change: &dyn Fn(&mut ContactState)| {
        let mut state = good.clone();
        change(&mut state);
        state.validate().unwrap_err()
    };
    type Change = fn(&mut ContactState);
    let cases: [(Change, &str); 8] = [
        (|s| s.force_n = 1.0, "the force in N"),
        (|s| s.force_n = f64::NAN, "the force in N"),
        (|s| s.radius_m[0] = 1e-6, "radius_m"),
        (|s| s.radius_m.swap(3, 4), "radius_m"),
        (|s| s.pressure_pa[2] = -1.0, "pressure_pa"),
        (|s| s.height_m[2] = f64::INFINITY, "height_m"),
        (|s| s.contact_radius_m *= 1.6, "contact_radius_m"),
        (|s| s.indentation_m = f64::NAN, "indentation_m"),
    ];
    for (change, expected) in cases {
        let error = refused(&change);
        assert!(
            matches!(error, SimulateError::OutOfRange { field, .. } if field == expected),
            "{error}"
        );
    }
    let long = refused(&|s| s.height_m.push(0.0));
    assert_eq!(
        long,
        SimulateError::LengthMismatch {
            field: "height_m",
            expected: 16,
            found: 17
        }
    );
}

#[test]
fn every_state_is_a_contact_that_carries_its_force() {
    for material in [Elastic::CL2000X, Elastic::CL2003X] {
        let ball = ElasticSphere { material, ..BALL };
        let states = finite_element_states(&ball, &LightGuide::default()).unwrap();
        assert_eq!(states.len(), 11);
        for pair in states.windows(2) {
            assert!(pair[0].force_n < pair[1].force_n);
            assert!(pair[0].contact_radius_m < pair[1].contact_radius_m);
        }
        for state in &states {
            state.validate().unwrap();
            // The recovered nodal pressures carry the force within the uncertainty of the contact
            // radius.
            let carried = state.carried_force_n() / state.force_n;
            assert!(
                (carried - 1.0).abs() < 5e-3,
                "{} N: {carried}",
                state.force_n
            );
        }
        let other = ElasticSphere {
            radius_m: 4e-3,
            ..ball
        };
        assert!(finite_element_states(&other, &LightGuide::default()).is_none());
    }
}
