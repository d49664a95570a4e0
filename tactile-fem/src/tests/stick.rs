//! Compares contact without slip with theory, symmetry and finer steps.

use super::contact::{half_space, punch_lines};
use super::*;

/// Stiffness of a flat punch without slip relative to that without friction (Spence 1968).
fn spence(poisson_ratio: f64) -> f64 {
    (1.0 - poisson_ratio) * (3.0 - 4.0 * poisson_ratio).ln() / (1.0 - 2.0 * poisson_ratio)
}

#[test]
fn a_flat_punch_without_slip_follows_spence() {
    for poisson_ratio in [0.0, 0.3, 0.45] {
        let shape = RigidShape::Punch { radius_m: 0.1 };
        let mut model = half_space(poisson_ratio, &punch_lines(0.1, 1e-3), 2e-3, shape);
        let force =
            |model: &ElementModel| model.solve(&[AppliedLoad::Approach(1e-3)]).states[0].force_n();
        let slides = force(&model);
        model.forbid_slip();
        let ratio = force(&model) / slides / spence(poisson_ratio);
        // The end of the half space and the elements at the rim change both forces equally.
        assert!((ratio - 1.0).abs() < 1e-3, "{poisson_ratio}: {ratio}");
    }
}

/// Without slip, each contact radius adds the load of a flat punch without slip (Mossakovskii 1963,
/// Spence 1968), on a profile that these punches have raised (Borodich and Keer 2004). With c of
/// [`spence`], θ = ln(3 − 4ν)/2π and I(d) = ∫₀¹ sᵈ⁻¹ cos(θ ln((1 + s)/(1 − s))) ds, the force at an
/// approach is c √(2 I(2)) times Hertz's for a sphere and c I(1) times Sneddon's for a cone.
#[test]
fn growing_contacts_without_slip_follow_their_closed_forms() {
    // Friction has its largest effect here.
    let poisson_ratio = 0.0;
    const SPHERE_AT_ZERO: f64 = 1.052_891_476_5;
    const CONE_AT_ZERO: f64 = 1.045_248_461_1;
    let tangent = 1.3_f64.tan();
    let cone = RigidShape::Cone {
        half_angle_rad: 1.3,
    };
    let sphere = RigidShape::Paraboloid { radius_m: 1.0 };
    // Contact radius 2 δ tan α / π = 0.1.
    let approach = 0.05 * core::f64::consts::PI / tangent;
    let hertz = |d: f64| 4.0 / 3.0 * d.powf(1.5);
    let sneddon = |d: f64| core::f64::consts::FRAC_2_PI * tangent * d * d;
    let cases = [
        (sphere, 0.01, SPHERE_AT_ZERO * hertz(0.01)),
        (cone, approach, CONE_AT_ZERO * sneddon(approach)),
    ];
    for (shape, approach, expected) in cases {
        let lines = contact_lines(0.03, 4, 1.05, 1e9, 0.14);
        let mut model = half_space(poisson_ratio, &lines, 0.01, shape);
        model.forbid_slip();
        let force = model.solve(&[AppliedLoad::Approach(approach)]).states[0].force_n();
        // E/(1 − ν²) is one. Elements, load steps and the end of the half space contribute at most
        // 0.2 %.
        let ratio = force / expected;
        assert!((ratio - 1.0).abs() < 3e-3, "{shape:?}: {ratio}");
    }
}

/// A ball of 3 mm on a layer of 6 mm or on a rigid flat.
fn ball(material: Material, guide: Option<Material>, interface: Interface) -> FemScene {
    let mut press = ObjectPress::new(ObjectShape::Ball { radius_m: 3e-3 }, material).unwrap();
    if let Some(guide) = guide {
        press = press.on_guide(layer(6e-3, guide, 18e-3)).unwrap();
    }
    press.with_interface(interface).scene().unwrap()
}

fn solved(scene: &FemScene, loads: &[AppliedLoad]) -> Vec<State> {
    let solution = scene.solve(loads);
    assert_eq!(solution.report.outcome, Outcome::Solved);
    solution.states
}

/// A deformable and a rigid opposite surface hold a node equally.
#[test]
fn a_stiff_guide_holds_as_a_rigid_flat_does() {
    let material = Material::new(103e3, 0.3).unwrap();
    let stiffening = |guide: Option<Material>| {
        let [sticks, slides] = [Interface::Bonded, Interface::Frictionless].map(|interface| {
            let load = [AppliedLoad::Approach(0.3e-3)];
            solved(&ball(material, guide, interface), &load)[0].force_n()
        });
        sticks / slides
    };
    let stiff = Material::new(10e6, 0.495).unwrap();
    let [rigid, stiff] = [None, Some(stiff)].map(stiffening);
    // The effect of friction on the force is proportional to the square of the contrast of the
    // bodies, which is two per cent smaller on a layer a hundred times as stiff.
    assert!(rigid > 1.01, "{rigid}");
    assert!((stiff / rigid - 1.0).abs() < 3e-3, "{stiff} {rigid}");
}

/// The time of touching within a step is a guess, which changes forces by less than a thousandth
/// and contact radii by less than two thousandths.
#[test]
fn more_loads_on_the_way_change_little() {
    let gel = |modulus, poisson_ratio| Material::new(modulus, poisson_ratio).unwrap();
    let scene = ball(gel(103e3, 0.3), Some(gel(40e3, 0.495)), Interface::Bonded);
    let at_the_end = |loads: u32| {
        let part = |k| AppliedLoad::Approach(1.2e-3 * f64::from(k) / f64::from(loads));
        let loads: Vec<AppliedLoad> = (1..=loads).map(part).collect();
        let state = solved(&scene, &loads).pop().unwrap();
        [state.force_n(), state.contact_radius().unwrap().radius_m]
    };
    let [few, many] = [1, 12].map(at_the_end);
    assert!((few[0] / many[0] - 1.0).abs() < 1e-3, "{few:?} {many:?}");
    assert!((few[1] / many[1] - 1.0).abs() < 2e-3, "{few:?} {many:?}");
}

/// Two incompressible bodies do not tend to slip at small strain.
#[test]
fn incompressible_bodies_do_not_feel_friction() {
    let gel = |modulus| Material::new(modulus, 0.4999).unwrap();
    let load = [AppliedLoad::Approach(0.1e-3)];
    let force = |interface| {
        let scene = ball(gel(103e3), Some(gel(60e3)), interface);
        solved(&scene, &load)[0].force_n()
    };
    let ratio = force(Interface::Bonded) / force(Interface::Frictionless);
    assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
}
