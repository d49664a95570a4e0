//! Contact against Hertz's theory, and its derivatives against differences.

use crate::ElasticityError;
use crate::fem::bodies::contact_lines;
use crate::fem::mesh::graded;
use crate::fem::*;

/// A half space of four hundred contact radii of 0.1, of modulus 1 and ν = 0.45: the displacement at its
/// end is 2e-3 of the approach, and so is what the approach lacks. `lines` resolve the contact.
fn half_space(lines: &[f64], first: f64, shape: RigidShape) -> (Model, f64) {
    let inner = lines[lines.len() - 1];
    let mut lines = lines.to_vec();
    lines.extend(
        contact_lines(0.01, 1, 1.4, 1e9, 40.0 - inner)
            .iter()
            .skip(1)
            .map(|r| inner + r),
    );
    let mesh = Mesh::layered_disc(&[40.0], &lines, first, 1.4);
    let mut model = Model::new(Kinematics::Linear);
    let material = Material::new(1.0, 0.45).unwrap();
    let half_space = model.add(&mesh, &[material]).unwrap();
    model.drive(half_space, Boundary::Base, Support::Bonded);
    model.contact_rigid_above(half_space, shape, 0.0);
    (model, 1.0 / (1.0 - 0.45 * 0.45))
}

#[test]
fn a_rigid_paraboloid_on_a_half_space_follows_hertz() {
    let radius = 1.0;
    let lines = contact_lines(0.03, 8, 1.05, 1e9, 0.14);
    let shape = RigidShape::Paraboloid { radius_m: radius };
    let (model, modulus) = half_space(&lines, 0.005, shape);
    let loads = [0.05_f64, 0.07, 0.1].map(|a| Load::Approach(a * a / radius));
    let solution = model.solve(&loads);
    assert_eq!(solution.report.outcome, Outcome::Solved);
    for state in &solution.states {
        let a = state.contact_radius().unwrap();
        let hertz = 4.0 / 3.0 * modulus * state.approach_m().powf(1.5);
        let by_radius = a.radius_m / (state.approach_m() * radius).sqrt();
        let by_force = state.force_n() / hertz;
        // What some fifteen elements across the contact resolve, and the half space's end.
        assert!((by_force - 1.0).abs() < 3e-3, "{by_force}");
        assert!((by_radius - 1.0).abs() < 3e-3, "{by_radius} {a:?}");
    }
}

#[test]
fn a_flat_punch_on_a_half_space_follows_sneddon() {
    let radius = 0.1;
    // Lines densest at the rim, where the pressure is singular.
    let mut lines: Vec<f64> = graded(radius, 0.0, 1e-4, 1.3);
    lines.reverse();
    lines.extend(graded(radius, 0.15, 1e-4, 1.3).iter().skip(1));
    let (model, modulus) = half_space(&lines, 2e-4, RigidShape::Punch { radius_m: radius });
    let state = &model.solve(&[Load::Approach(1e-3)]).states[0];
    let sneddon = 2.0 * radius * modulus * 1e-3;
    // The end of the half space takes 0.15 % of the approach, the rim's elements the rest.
    let ratio = state.force_n() / sneddon;
    assert!((ratio - 1.0).abs() < 5e-3, "{ratio}");
}

#[test]
fn a_cone_on_a_half_space_follows_sneddon() {
    let half_angle_rad = 1.3_f64;
    let lines = contact_lines(0.03, 12, 1.05, 1e9, 0.14);
    let (model, modulus) = half_space(&lines, 2e-3, RigidShape::Cone { half_angle_rad });
    // Contact radius 2 δ tan α / π = 0.1.
    let approach = 0.05 * core::f64::consts::PI / half_angle_rad.tan();
    let state = &model.solve(&[Load::Approach(approach)]).states[0];
    let sneddon = 2.0 / core::f64::consts::PI * modulus * approach.powi(2) * half_angle_rad.tan();
    let ratio = state.force_n() / sneddon;
    assert!((ratio - 1.0).abs() < 5e-3, "{ratio}");
}

#[test]
fn a_ball_on_a_bonded_layer_follows_the_linear_theory() {
    const NU: f64 = 0.4999;
    let (radius, modulus) = (10.0, 1.0);
    let equation = crate::contact::LayerEquation::new(crate::contact::Bond::Bonded, NU).unwrap();
    let lines = {
        // Contact radii up to 0.5 layer thicknesses.
        let mut lines = contact_lines(0.15, 8, 1.06, 0.05, 0.8);
        lines.extend(
            contact_lines(0.05, 1, 1.3, 0.7, 9.2)
                .iter()
                .skip(1)
                .map(|r| 0.8 + r),
        );
        lines
    };
    let mesh = Mesh::layered_disc(&[1.0], &lines, 0.02, 1.25);
    let mut model = Model::new(Kinematics::Linear);
    let layer = model
        .add(&mesh, &[Material::new(modulus, NU).unwrap()])
        .unwrap();
    model.drive(layer, Boundary::Base, Support::Bonded);
    model.contact_rigid_above(layer, RigidShape::Paraboloid { radius_m: radius }, 0.0);
    let ratios = [0.2_f64, 0.35, 0.5];
    let solution = model.solve(&ratios.map(|x| Load::Approach(x * x / radius)));
    assert_eq!(solution.report.outcome, Outcome::Solved);
    for (state, x) in solution.states.iter().zip(ratios) {
        // The exact linear contact at the elements' own Poisson ratio, by its integral equation, at the contact radius of this approach.
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
        // What ten to twenty elements across the contact leave of the force.
        assert!((ratio - 1.0).abs() < 3e-3, "{x} {ratio}");
        let by_radius = state.contact_radius().unwrap().radius_m / low;
        assert!((by_radius - 1.0).abs() < 3e-3, "{x} {by_radius}");
        // Dimitriadis et al., Biophys. J. 82 (2002) 2798, with the corrected coefficients at ν = 1/2; a series in x, short of 1.2 % at its
        // end, and ν = 0.4999 takes its part.
        let series = 1.0 + 1.127 * x + 1.482 * x.powi(2) + 1.470 * x.powi(3) + 1.005 * x.powi(4);
        let half_space = 16.0 / 9.0 * modulus * radius.sqrt() * state.approach_m().powf(1.5);
        let ratio = state.force_n() / (half_space * series);
        assert!(
            (ratio - 1.0).abs() < if x < 0.5 { 1e-2 } else { 1.5e-2 },
            "{x} {ratio}"
        );
    }
}

#[test]
fn gaps_and_their_derivatives_agree_with_differences() {
    use crate::fem::gap::DRIVER;
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
    let mut fields = crate::fem::fields::Fields::zero(model);
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

#[test]
fn a_ball_on_a_layered_guide_agrees_with_another_program_at_large_contact_radii() {
    let material = |modulus| Material::new(modulus, 0.495).unwrap();
    let layer = |thickness_m, modulus| Layer {
        thickness_m,
        material: material(modulus),
    };
    let layers = vec![layer(2e-3, 136e3), layer(3e-3, 80e3), layer(5e-3, 34e3)];
    let guide = Guide::new(layers, 25e-3).unwrap();
    let scene = Scene::ball_on_guide(3e-3, material(103e3), &guide).unwrap();
    // Force, contact radius and approach by an independent program: axisymmetric elements at finite
    // strain, neo-Hookean, without friction, extrapolated over its meshes.
    let reference = [
        (0.2, 1.818000e-3, 1.067087e-3),
        (0.7, 2.747523e-3, 2.247527e-3),
        (1.2, 3.214206e-3, 3.004672e-3),
    ];
    let solution = scene.solve(&reference.map(|(force, ..)| Load::Force(force)));
    assert_eq!(solution.report.outcome, Outcome::Solved);
    for (state, (force, radius, approach)) in solution.states.iter().zip(reference) {
        assert!((state.force_n() / force - 1.0).abs() < 1e-7);
        let by_radius = state.contact_radius().unwrap().radius_m / radius;
        let by_approach = state.approach_m() / approach;
        // F grows as a^3.4 at most here: 0.3 % in the radius is 1 % in the force at a given radius.
        assert!((by_radius - 1.0).abs() < 3e-3, "{by_radius}");
        assert!((by_approach - 1.0).abs() < 4e-3, "{by_approach}");
    }
}

#[test]
fn balls_on_guides_solve_to_contact_radii_beyond_their_own() {
    let material = |modulus| Material::new(modulus, 0.495).unwrap();
    let layer = |thickness_m, modulus| Layer {
        thickness_m,
        material: material(modulus),
    };
    let layers = vec![layer(2e-3, 136e3), layer(3e-3, 80e3), layer(5e-3, 34e3)];
    for (radius, modulus, approach) in [(3e-3, 250e3, 1.2), (12e-3, 30e3, 0.7)] {
        let guide = Guide::new(layers.clone(), 5.0 * radius).unwrap();
        let scene = Scene::ball_on_guide(radius, material(modulus), &guide).unwrap();
        let loads = [0.4, 0.7, 1.0].map(|part| Load::Approach(part * approach * radius));
        let solution = scene.solve(&loads);
        assert_eq!(solution.report.outcome, Outcome::Solved);
        let ratios: Vec<f64> = (solution.states.iter())
            .map(|state| state.contact_radius().unwrap().radius_m / radius)
            .collect();
        assert!(ratios.windows(2).all(|pair| pair[1] > pair[0]));
        assert!(ratios[2] > 0.95, "{ratios:?}");
        for state in &solution.states {
            // The pressure carries the force, p² linear in r² between the points and to zero at the contact's edge.
            let edge = state.contact_radius().unwrap().radius_m;
            let mut nodes: Vec<[f64; 2]> = (state.pressure().iter())
                .map(|point| [point.r_m, point.pressure_pa])
                .collect();
            nodes.push([edge, 0.0]);
            let carried: f64 = (nodes.windows(2))
                .map(|pair| {
                    let [[r, p], [s, q]] = [pair[0], pair[1]];
                    let ring = core::f64::consts::PI * (s * s - r * r);
                    2.0 / 3.0 * ring * (p * p + p * q + q * q) / (p + q)
                })
                .sum();
            // The means that the points come from carry it exactly; a parabola's arc over a chord is what is left.
            assert!((carried / state.force_n() - 1.0).abs() < 3e-3, "{carried}");
            // It falls from the axis to the edge, point by point.
            assert!(
                nodes.windows(2).all(|pair| pair[1][1] < pair[0][1]),
                "{nodes:?}"
            );
        }
    }
}

#[test]
fn objects_of_every_shape_are_pressed_on_a_flat_and_on_a_guide() {
    let gel = Material::new(80e3, 0.495).unwrap();
    let layer = Layer {
        thickness_m: 6e-3,
        material: gel,
    };
    let guide = Guide::new(vec![layer], 12e-3).unwrap();
    let objects = [
        Object::Ball { radius_m: 3e-3 },
        Object::HalfBall { radius_m: 3e-3 },
        Object::Cylinder {
            radius_m: 2e-3,
            height_m: 3e-3,
        },
        Object::Cylinder {
            radius_m: 20e-3,
            height_m: 3e-3,
        },
        Object::Cone {
            half_angle_rad: 1.2,
            height_m: 2e-3,
        },
    ];
    for object in objects {
        let force = |press: &Press| {
            let solution = press.scene().unwrap().solve(&[Load::Approach(0.3e-3)]);
            assert_eq!(solution.report.outcome, Outcome::Solved, "{object:?}");
            solution.states[0].force_n()
        };
        let on_flat = Press::new(object, Material::new(60e3, 0.495).unwrap()).unwrap();
        let on_guide = on_flat.clone().on_guide(guide.clone()).unwrap();
        let [flat, soft] = [force(&on_flat), force(&on_guide)];
        assert!(0.0 < soft && soft < flat, "{object:?}: {soft} {flat}");
        for (press, expected) in [(on_flat, flat), (on_guide, soft)] {
            let finer = force(&press.with_fineness(8).unwrap());
            // A cone's tip and a cylinder's rim are singular: some tenths of a percent more than a ball.
            assert!(
                (finer / expected - 1.0).abs() < 1e-2,
                "{object:?}: {finer} {expected}"
            );
        }
    }
}

#[test]
fn presses_of_other_proportions_are_refused() {
    let gel = Material::new(80e3, 0.495).unwrap();
    let refused = |object| Press::new(object, gel).unwrap_err();
    assert!(matches!(
        refused(Object::Ball { radius_m: f64::NAN }),
        ElasticityError::NotPositive { .. }
    ));
    assert!(matches!(
        refused(Object::Cone {
            half_angle_rad: 1.6,
            height_m: 1e-3
        }),
        ElasticityError::OutOfRange { .. }
    ));
    let ball = Press::new(Object::Ball { radius_m: 3e-3 }, gel).unwrap();
    assert!(ball.clone().with_fineness(1).is_err());
    let layer = Layer {
        thickness_m: 6e-3,
        material: gel,
    };
    assert!(
        ball.on_guide(Guide::new(vec![layer], 3e-3).unwrap())
            .is_err()
    );
}

/// The ball's shells stay clear of its core whatever the number of elements.
#[test]
fn a_ball_can_be_meshed_at_any_fineness() {
    let ball = Object::Ball { radius_m: 3e-3 };
    let press = Press::new(ball, Material::new(103e3, 0.495).unwrap()).unwrap();
    for fineness in 2..=24 {
        let scene = press.clone().with_fineness(fineness).unwrap().scene();
        assert!(scene.is_ok(), "{fineness}: {:?}", scene.err());
    }
}

#[test]
fn a_soft_cylinder_on_a_flat_is_stiffer_than_a_free_column() {
    let (radius_m, height_m, modulus) = (2e-3, 20e-3, 50e3);
    let cylinder = Object::Cylinder { radius_m, height_m };
    let press = Press::new(cylinder, Material::new(modulus, 0.3).unwrap()).unwrap();
    let strain = 1e-3;
    let state = &press
        .scene()
        .unwrap()
        .solve(&[Load::Approach(strain * height_m)])
        .states[0];
    let column = core::f64::consts::PI * radius_m * radius_m * modulus * strain;
    let ratio = state.force_n() / column;
    // Glued at one end, ten radii long: the end that cannot spread adds some percent, the strain itself 0.1 %.
    assert!((1.0..1.03).contains(&ratio), "{ratio}");
}

#[test]
fn the_rim_of_the_guide_is_not_felt() {
    let material = |modulus| Material::new(modulus, 0.495).unwrap();
    // The thickest guide beside the ball, where the rim is nearest in thicknesses.
    for (ball, thickness_m) in [(3e-3, 10e-3), (8e-3, 10e-3)] {
        let contact = |guide_radius| {
            let layer = Layer {
                thickness_m,
                material: material(60e3),
            };
            let guide = Guide::new(vec![layer], guide_radius).unwrap();
            let scene = Scene::ball_on_guide(ball, material(100e3), &guide).unwrap();
            let state = &scene.solve(&[Load::Approach(0.6 * ball)]).states[0];
            (state.force_n(), state.contact_radius().unwrap().radius_m)
        };
        let table = contact((4.0 * ball).max(2.5 * thickness_m));
        let wide = contact((8.0 * ball).max(5.0 * thickness_m));
        // F over a cubed is what a modulus follows from.
        let ratio = table.0 / wide.0 * (wide.1 / table.1).powi(3);
        assert!((ratio - 1.0).abs() < 2e-3, "{ball}: {ratio}");
    }
}

#[test]
fn a_finer_mesh_moves_the_table_little() {
    let material = |modulus| Material::new(modulus, 0.495).unwrap();
    let layer = |thickness_m, modulus| Layer {
        thickness_m,
        material: material(modulus),
    };
    let layers = vec![layer(2e-3, 136e3), layer(3e-3, 80e3), layer(5e-3, 34e3)];
    let guide = Guide::new(layers, 25e-3).unwrap();
    let press = Press::new(Object::Ball { radius_m: 3e-3 }, material(103e3)).unwrap();
    let press = press.on_guide(guide).unwrap();
    let loads = [0.05, 0.3, 1.0].map(Load::Force);
    let radii = |fineness| -> Vec<f64> {
        let scene = press
            .clone()
            .with_fineness(fineness)
            .unwrap()
            .scene()
            .unwrap();
        let states = scene.solve(&loads).states;
        states
            .iter()
            .map(|s| s.contact_radius().unwrap().radius_m)
            .collect()
    };
    for (default, fine) in radii(5).iter().zip(radii(8)) {
        // F at a given radius goes with its third to fourth power: estimates carry a standard error of 0.3 % for the elements, 0.09 % of
        // the radius; this is half as much again.
        assert!((default / fine - 1.0).abs() < 1.4e-3, "{default} {fine}");
    }
}
