//! Compares contact with Hertz's theory, and its derivatives with differences.

use super::*;
use tactile_elasticity::contact::{Bond, LayerEquation};

/// A half space of four hundred contact radii of 0.1, with modulus 1. `lines` resolve the contact.
/// The displacement at its end, 2e-3 of the approach, is missing from the approach.
pub(super) fn half_space(
    poisson_ratio: f64,
    lines: &[f64],
    first: f64,
    shape: RigidShape,
) -> ElementModel {
    let outer = contact_lines(0.01, 1, 1.4, 1e9, 40.0 - lines[lines.len() - 1]);
    let lines = continued(lines.to_vec(), &outer);
    let mesh = Mesh::layered_disc(&[40.0], &lines, first, 1.4);
    let mut model = ElementModel::new(Kinematics::Linear);
    let material = Material::new(1.0, poisson_ratio).unwrap();
    let half_space = model.add(&mesh, &[material]).unwrap();
    model.drive(half_space, Boundary::Base, Support::Bonded);
    model.contact_rigid(half_space, shape, 1.0);
    model
}

/// Poisson's ratio of a frictionless half space, and its E/(1 − ν²).
const POISSON_RATIO: f64 = 0.45;
const MODULUS: f64 = 1.0 / (1.0 - POISSON_RATIO * POISSON_RATIO);

#[test]
fn a_rigid_paraboloid_on_a_half_space_follows_hertz() {
    let radius = 1.0;
    let lines = contact_lines(0.03, 8, 1.05, 1e9, 0.14);
    let shape = RigidShape::Paraboloid { radius_m: radius };
    let model = half_space(POISSON_RATIO, &lines, 0.005, shape);
    let loads = [0.05_f64, 0.07, 0.1].map(|a| AppliedLoad::Approach(a * a / radius));
    let solution = model.solve(&loads);
    assert_eq!(solution.report.outcome, Outcome::Solved);
    for state in &solution.states {
        let a = state.contact_radius().unwrap();
        let hertz = 4.0 / 3.0 * MODULUS * state.approach_m().powf(1.5);
        let by_radius = a.radius_m / (state.approach_m() * radius).sqrt();
        let by_force = state.force_n() / hertz;
        // Error of about fifteen elements across the contact, and of the end of the half space.
        assert!((by_force - 1.0).abs() < 3e-3, "{by_force}");
        assert!((by_radius - 1.0).abs() < 3e-3, "{by_radius} {a:?}");
    }
}

/// Lines densest at the rim of a punch, where the pressure is singular.
pub(super) fn punch_lines(radius: f64, first: f64) -> Vec<f64> {
    let mut lines: Vec<f64> = graded(radius, 0.0, first, 1.3);
    lines.reverse();
    lines.extend(graded(radius, 0.15, first, 1.3).iter().skip(1));
    lines
}

#[test]
fn a_flat_punch_on_a_half_space_follows_sneddon() {
    let radius = 0.1;
    let lines = punch_lines(radius, 1e-4);
    let shape = RigidShape::Punch { radius_m: radius };
    let model = half_space(POISSON_RATIO, &lines, 2e-4, shape);
    let state = &model.solve(&[AppliedLoad::Approach(1e-3)]).states[0];
    let sneddon = 2.0 * radius * MODULUS * 1e-3;
    // The end of the half space contributes 0.15 % of the approach, the elements at the rim the
    // rest.
    let ratio = state.force_n() / sneddon;
    assert!((ratio - 1.0).abs() < 5e-3, "{ratio}");
}

#[test]
fn a_ball_on_a_bonded_layer_follows_the_linear_theory() {
    const NU: f64 = 0.4999;
    let (radius, modulus) = (10.0, 1.0);
    let equation = LayerEquation::new(Bond::Bonded, NU).unwrap();
    // Contact radii up to 0.5 layer thicknesses.
    let lines = contact_lines(0.15, 8, 1.06, 0.05, 0.8);
    let lines = continued(lines, &contact_lines(0.05, 1, 1.3, 0.7, 9.2));
    let mesh = Mesh::layered_disc(&[1.0], &lines, 0.02, 1.25);
    let mut model = ElementModel::new(Kinematics::Linear);
    let layer = model
        .add(&mesh, &[Material::new(modulus, NU).unwrap()])
        .unwrap();
    model.drive(layer, Boundary::Base, Support::Bonded);
    model.contact_rigid(layer, RigidShape::Paraboloid { radius_m: radius }, 1.0);
    let ratios = [0.2_f64, 0.35, 0.5];
    let solution = model.solve(&ratios.map(|x| AppliedLoad::Approach(x * x / radius)));
    assert_eq!(solution.report.outcome, Outcome::Solved);
    for (state, x) in solution.states.iter().zip(ratios) {
        // The exact linear contact at the Poisson ratio of the elements, by its integral equation,
        // at the contact radius of this approach.
        let radius_of = |a: f64| {
            let layer = equation.solve(a).unwrap();
            (layer.indentation_ratio * a * a / radius, layer)
        };
        let (mut low, mut high) = (0.5 * x, 2.0 * x);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if radius_of(middle).0 < state.approach_m() {
                low = middle;
            } else {
                high = middle;
            }
        }
        let (_, layer) = radius_of(low);
        let hertz = 4.0 / 3.0 * modulus / (1.0 - NU * NU) * low.powi(3) / radius;
        let ratio = state.force_n() / (hertz * layer.force_ratio_same_radius);
        // Error of the force with ten to twenty elements across the contact.
        assert!((ratio - 1.0).abs() < 3e-3, "{x} {ratio}");
        let by_radius = state.contact_radius().unwrap().radius_m / low;
        assert!((by_radius - 1.0).abs() < 3e-3, "{x} {by_radius}");
    }
}

#[test]
fn gaps_and_their_derivatives_agree_with_differences() {
    use crate::surface::DRIVER;
    let material = Material::new(1.0, 0.45).unwrap();
    let scene = ball_on_guide(1.0, material, &layer(1.0, material, 4.0));
    let model = &scene.model;
    let mut fields = crate::model::ModelFields::zero(model);
    for (k, u) in fields.displacement.iter_mut().enumerate() {
        let [r, z] = model.nodes[k / 2];
        // Smooth, curved, and zero on the axis.
        *u = if k % 2 == 0 {
            0.05 * r * (1.0 + z)
        } else {
            0.1 * (2.0 * r + z).sin() - 0.02
        };
    }
    let mut checked = 0;
    for point in model.contact_points(&fields).iter().step_by(7) {
        let opposite = &model.opposites[point.pair];
        let Some(gap) = model.placement(&fields).gap(point, opposite) else {
            continue;
        };
        let count = gap.dofs.len();
        for (i, &dof) in gap.dofs.iter().enumerate() {
            assert_ne!(dof, DRIVER);
            let step = 1e-6;
            let mut shifted = |sign: f64| {
                let kept = fields.displacement[dof];
                fields.displacement[dof] = kept + sign * step;
                let found = model.placement(&fields).gap(point, opposite).unwrap();
                fields.displacement[dof] = kept;
                found
            };
            let (plus, minus) = (shifted(1.0), shifted(-1.0));
            let first = (plus.value - minus.value) / (2.0 * step);
            // Differences with step 1e-6: rounding 1e-10, curvature several hundred times 1e-12.
            assert!(
                (first - gap.first[i]).abs() < 1e-7,
                "{first} {}",
                gap.first[i]
            );
            if plus.dofs != gap.dofs || minus.dofs != gap.dofs {
                // The closest point moved to another segment.
                continue;
            }
            for j in 0..count {
                let second = (plus.first[j] - minus.first[j]) / (2.0 * step);
                let exact = gap.second[count * i + j];
                // Second derivatives are proportional to the inverse length of an element, here up
                // to 1e2.
                assert!((second - exact).abs() < 1e-4, "{second} {exact}");
            }
        }
        checked += 1;
    }
    assert!(checked > 10);
}
