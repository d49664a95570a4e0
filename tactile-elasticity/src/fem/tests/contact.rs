//! Contact against Hertz's theory, and its derivatives against differences.

use crate::fem::bodies::contact_lines;
use crate::fem::*;

#[test]
fn a_rigid_paraboloid_on_a_half_space_follows_hertz() {
    // A half space of four hundred contact radii: the displacement at its end is 2e-3 of the
    // approach, and so is what the approach lacks.
    let radius = 1.0;
    let mut lines = contact_lines(0.03, 8, 1.05, 1e9, 0.14);
    lines.extend(
        contact_lines(0.01, 1, 1.4, 1e9, 39.86)
            .iter()
            .skip(1)
            .map(|r| 0.14 + r),
    );
    let mesh = Mesh::layered_disc(&[40.0], &lines, 0.005, 1.4);
    let mut model = Model::new(Kinematics::Linear);
    let material = Material::new(1.0, 0.45).unwrap();
    let half_space = model.add(&mesh, &[material]).unwrap();
    model.drive(half_space, Boundary::Base, Support::Bonded);
    model.contact_rigid_above(half_space, RigidShape::Paraboloid { radius_m: radius }, 0.0);
    let loads = [0.05_f64, 0.07, 0.1].map(|a| Load::Approach(a * a / radius));
    let solution = model.solve(&loads);
    assert_eq!(solution.report.outcome, Outcome::Solved);
    for state in &solution.states {
        let a = state.contact_radius().unwrap();
        let hertz = 4.0 / 3.0 * material.plane_strain_modulus() * state.approach_m().powf(1.5);
        let by_radius = a.radius_m / (state.approach_m() * radius).sqrt();
        let by_force = state.force_n() / hertz;
        // What some fifteen elements across the contact resolve; the radius, extrapolated from the
        // pressures within, somewhat less well.
        assert!((by_force - 1.0).abs() < 3e-3, "{by_force}");
        assert!((by_radius - 1.0).abs() < 4e-3, "{by_radius} {a:?}");
    }
}

#[test]
fn gaps_and_their_derivatives_agree_with_differences() {
    use crate::fem::contact::DRIVER;
    let scene = Scene::ball_on_guide(
        1.0,
        Material::new(1.0, 0.45).unwrap(),
        &Guide::new(
            vec![Layer {
                thickness_m: 1.0,
                material: Material::new(1.0, 0.45).unwrap(),
            }],
            4.0,
        )
        .unwrap(),
    )
    .unwrap();
    let model = scene.model();
    let mut fields = crate::fem::system::Fields::zero(model);
    for (k, u) in fields.displacement.iter_mut().enumerate() {
        let [r, z] = model.nodes[k / 2];
        // Smooth, curved and zero on the axis.
        *u = if k % 2 == 0 {
            0.05 * r * (1.0 + z)
        } else {
            0.1 * (2.0 * r + z).sin() - 0.02
        };
    }
    let mut checked = 0;
    for point in model.points.iter().step_by(7) {
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
            // Differences of step 1e-6: rounding 1e-10, curvature some hundreds times 1e-12.
            assert!(
                (first - gap.first[i]).abs() < 1e-7,
                "{first} {}",
                gap.first[i]
            );
            if plus.dofs != gap.dofs || minus.dofs != gap.dofs {
                // The closest point went to another segment.
                continue;
            }
            for j in 0..count {
                let second = (plus.first[j] - minus.first[j]) / (2.0 * step);
                let exact = gap.second[count * i + j];
                // Second derivatives go with the inverse of an element's length, here up to 1e2.
                assert!((second - exact).abs() < 1e-4, "{second} {exact}");
            }
        }
        checked += 1;
    }
    assert!(checked > 10);
}
