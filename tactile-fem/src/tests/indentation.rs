//! Moduli from curves of a neo-Hookean sample at finite strain: the interval holds the truth.

use super::*;
use tactile_elasticity::contact::Bond;
use tactile_elasticity::curve::{
    Baseline, ContactPoint, CurveOptions, IndentationCurve, Indenter, fit_curve,
};
use tactile_elasticity::modulus::EstimatorKind;

const MODULUS: f64 = 20e3;

/// A curve of eight loads up to an approach, its sample `depth` deep. Contacts reach about
/// `contact`.
fn curve(
    shape: RigidShape,
    [depth, contact, approach]: [f64; 3],
    poisson_ratio: f64,
    sticks: bool,
) -> IndentationCurve {
    let inner = 1.1 * contact;
    let outer = contact_lines(0.1 * contact, 1, 1.4, 1e9, depth.max(10.0 * contact));
    let lines = continued(contact_lines(0.2 * contact, 5, 1.1, 1e9, inner), &outer);
    let mesh = Mesh::layered_disc(&[depth], &lines, 0.05 * contact, 1.4);
    let mut model = ElementModel::new(Kinematics::Finite);
    let material = Material::new(MODULUS, poisson_ratio).unwrap();
    let sample = model.add(&mesh, &[material]).unwrap();
    model.drive(sample, Boundary::Base, Support::Bonded);
    model.contact_rigid(sample, shape, 1.0);
    if sticks {
        model.forbid_slip();
    }
    let approaches: Vec<f64> = (1..=8).map(|k| approach * f64::from(k) / 8.0).collect();
    let loads: Vec<AppliedLoad> = approaches
        .iter()
        .map(|&d| AppliedLoad::Approach(d))
        .collect();
    let solution = model.solve(&loads);
    assert_eq!(solution.report.outcome, Outcome::Solved);
    let forces: Vec<f64> = solution.states.iter().map(State::force_n).collect();
    IndentationCurve::new(&approaches, &forces).unwrap()
}

/// Whether the contact point is known or fitted, which takes up part of the law's error.
fn check(curve: &IndentationCurve, indenter: &Indenter, nu: f64, kind: EstimatorKind) {
    for contact_point in [ContactPoint::At(0.0), ContactPoint::Search] {
        let options = CurveOptions {
            baseline: Baseline::Zero,
            contact_point,
        };
        let fit = fit_curve(curve, indenter, nu, kind, &options).unwrap();
        let interval = fit.interval_95;
        assert!(interval.contains(MODULUS), "{kind} {nu}: {interval:?}");
    }
}

#[test]
fn a_rigid_sphere_on_a_deep_sample() {
    for (nu, sticks) in [(0.1, false), (0.495, true)] {
        let shape = RigidShape::Sphere { radius_m: 5e-3 };
        let curve = curve(shape, [0.15, 2.5e-3, 1.2e-3], nu, sticks);
        let sphere = Indenter::Sphere {
            radius_m: 5e-3,
            thickness_m: None,
            bond: Bond::Bonded,
        };
        let kinds = [EstimatorKind::HertzSphere, EstimatorKind::SphereWithoutSlip];
        check(&curve, &sphere, nu, kinds[usize::from(sticks)]);
    }
}

#[test]
fn a_rigid_sphere_on_a_layer() {
    for (nu, thickness) in [(0.3, 2e-3), (0.48, 5e-3)] {
        let shape = RigidShape::Sphere { radius_m: 5e-3 };
        let curve = curve(shape, [thickness, 2e-3, 0.5e-3], nu, false);
        let layer = Indenter::Sphere {
            radius_m: 5e-3,
            thickness_m: Some(thickness),
            bond: Bond::Bonded,
        };
        check(&curve, &layer, nu, EstimatorKind::LayerIntegralEquation);
    }
}

#[test]
fn a_cone_without_slip() {
    let half_angle_rad = 70.3_f64.to_radians();
    let curve = curve(
        RigidShape::Cone { half_angle_rad },
        [0.2, 2e-3, 1e-3],
        0.2,
        true,
    );
    let cone = Indenter::Cone {
        half_angle_tangent: half_angle_rad.tan(),
    };
    check(&curve, &cone, 0.2, EstimatorKind::ConeWithoutSlip);
}
