//! Presses of an object on a flat or a guide: comparison with another program, and over shapes,
//! proportions and meshes.

use super::*;
use tactile_elasticity::ElasticityError;

/// The paper's three layers.
fn paper_guide(radius_m: f64) -> Guide {
    let layers =
        [(2e-3, 136e3), (3e-3, 80e3), (5e-3, 34e3)].map(|(thickness_m, modulus)| GuideLayer {
            thickness_m,
            material: Material::new(modulus, 0.495).unwrap(),
        });
    Guide::new(layers.to_vec(), radius_m).unwrap()
}

#[test]
fn a_ball_on_a_layered_guide_agrees_with_another_program_at_large_contact_radii() {
    let material = |modulus| Material::new(modulus, 0.495).unwrap();
    let guide = paper_guide(25e-3);
    let scene = ball_on_guide(3e-3, material(103e3), &guide);
    // Force, contact radius and approach by an independent program: axisymmetric elements at finite
    // strain, neo-Hookean, without friction, extrapolated over its meshes.
    let reference = [
        (0.2, 1.818000e-3, 1.067087e-3),
        (0.7, 2.747523e-3, 2.247527e-3),
        (1.2, 3.214206e-3, 3.004672e-3),
    ];
    let solution = scene.solve(&reference.map(|(force, ..)| AppliedLoad::Force(force)));
    assert_eq!(solution.report.outcome, Outcome::Solved);
    for (state, (force, radius, approach)) in solution.states.iter().zip(reference) {
        assert!((state.force_n() / force - 1.0).abs() < 1e-7);
        let by_radius = state.contact_radius().unwrap().radius_m / radius;
        let by_approach = state.approach_m() / approach;
        // F is at most proportional to a^3.4 here: 0.3 % in the radius is 1 % in the force at a
        // given radius.
        assert!((by_radius - 1.0).abs() < 3e-3, "{by_radius}");
        assert!((by_approach - 1.0).abs() < 4e-3, "{by_approach}");
    }
}

#[test]
fn balls_on_guides_solve_to_contact_radii_beyond_their_own() {
    let material = |modulus| Material::new(modulus, 0.495).unwrap();
    for (radius, modulus, approach) in [(3e-3, 250e3, 1.2), (12e-3, 30e3, 0.7)] {
        let guide = paper_guide(5.0 * radius);
        let scene = ball_on_guide(radius, material(modulus), &guide);
        let loads = [0.4, 0.7, 1.0].map(|part| AppliedLoad::Approach(part * approach * radius));
        let solution = scene.solve(&loads);
        assert_eq!(solution.report.outcome, Outcome::Solved);
        let ratios: Vec<f64> = (solution.states.iter())
            .map(|state| state.contact_radius().unwrap().radius_m / radius)
            .collect();
        assert!(ratios.windows(2).all(|pair| pair[1] > pair[0]));
        assert!(ratios[2] > 0.95, "{ratios:?}");
        for state in &solution.states {
            // The pressure carries the force, with p² linear in r² between the points and down to
            // zero at the edge of the contact.
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
            // The underlying means carry it exactly. The difference is that between the arc of a
            // parabola and its chord.
            assert!((carried / state.force_n() - 1.0).abs() < 3e-3, "{carried}");
            // It decreases from the axis to the edge, point by point.
            assert!(
                nodes.windows(2).all(|pair| pair[1][1] < pair[0][1]),
                "{nodes:?}"
            );
        }
    }
}

#[test]
fn objects_of_every_shape_are_pressed_on_a_flat_and_on_a_guide() {
    let guide = layer(6e-3, Material::new(80e3, 0.495).unwrap(), 12e-3);
    let objects = [
        ObjectShape::HalfBall { radius_m: 3e-3 },
        ObjectShape::Cylinder {
            radius_m: 2e-3,
            height_m: 3e-3,
        },
        ObjectShape::Cylinder {
            radius_m: 20e-3,
            height_m: 3e-3,
        },
        ObjectShape::Cone {
            half_angle_rad: 1.2,
            height_m: 2e-3,
        },
    ];
    for object in objects {
        let force = |press: &ObjectPress| {
            let solution = press
                .scene()
                .unwrap()
                .solve(&[AppliedLoad::Approach(0.3e-3)]);
            assert_eq!(solution.report.outcome, Outcome::Solved, "{object:?}");
            solution.states[0].force_n()
        };
        let on_flat = ObjectPress::new(object, Material::new(60e3, 0.495).unwrap()).unwrap();
        let on_guide = on_flat.clone().on_guide(guide.clone()).unwrap();
        let [flat, soft] = [force(&on_flat), force(&on_guide)];
        assert!(0.0 < soft && soft < flat, "{object:?}: {soft} {flat}");
        for (press, expected) in [(on_flat, flat), (on_guide, soft)] {
            let finer = force(&press.with_fineness(8).unwrap());
            // The tip of a cone and the rim of a cylinder are singular: their errors are several
            // tenths of a per cent larger than for a ball.
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
    let refused = |object| ObjectPress::new(object, gel).unwrap_err();
    assert!(matches!(
        refused(ObjectShape::Ball { radius_m: f64::NAN }),
        ElasticityError::NotPositive { .. }
    ));
    assert!(matches!(
        refused(ObjectShape::Cone {
            half_angle_rad: 1.6,
            height_m: 1e-3
        }),
        ElasticityError::OutOfRange { .. }
    ));
    let ball = ObjectPress::new(ObjectShape::Ball { radius_m: 3e-3 }, gel).unwrap();
    assert!(ball.clone().with_fineness(1).is_err());
    assert!(ball.on_guide(layer(6e-3, gel, 3e-3)).is_err());
    for [radius, height] in [[f64::NAN, 1e-2], [0.0, 1e-2], [1e-2, -1e-3]] {
        let scene = FemScene::cylinder_between_plates(radius, height, gel, Interface::Bonded);
        assert!(matches!(scene, Err(ElasticityError::NotPositive { .. })));
    }
}

/// The shells of the ball do not intersect its core, for any number of elements.
#[test]
fn a_ball_can_be_meshed_at_any_fineness() {
    let ball = ObjectShape::Ball { radius_m: 3e-3 };
    let press = ObjectPress::new(ball, Material::new(103e3, 0.495).unwrap()).unwrap();
    for fineness in 2..=24 {
        let scene = press.clone().with_fineness(fineness).unwrap().scene();
        assert!(scene.is_ok(), "{fineness}: {:?}", scene.err());
    }
}

#[test]
fn a_soft_cylinder_on_a_flat_is_stiffer_than_a_free_column() {
    let (radius_m, height_m, modulus) = (2e-3, 20e-3, 50e3);
    let cylinder = ObjectShape::Cylinder { radius_m, height_m };
    let press = ObjectPress::new(cylinder, Material::new(modulus, 0.3).unwrap()).unwrap();
    let strain = 1e-3;
    let state = &press
        .scene()
        .unwrap()
        .solve(&[AppliedLoad::Approach(strain * height_m)])
        .states[0];
    let column = core::f64::consts::PI * radius_m * radius_m * modulus * strain;
    let ratio = state.force_n() / column;
    // The cylinder is glued at one end and ten radii long. The end that cannot spread adds a few
    // per cent, and the strain itself 0.1 %.
    assert!((1.0..1.03).contains(&ratio), "{ratio}");
}

#[test]
fn the_rim_of_the_guide_is_not_felt() {
    let material = |modulus| Material::new(modulus, 0.495).unwrap();
    // The thickest guide compared with the ball, where the rim is nearest in units of thickness.
    for (ball, thickness_m) in [(3e-3, 10e-3), (8e-3, 10e-3)] {
        let contact = |guide_radius| {
            let guide = layer(thickness_m, material(60e3), guide_radius);
            let scene = ball_on_guide(ball, material(100e3), &guide);
            let state = &scene.solve(&[AppliedLoad::Approach(0.6 * ball)]).states[0];
            (state.force_n(), state.contact_radius().unwrap().radius_m)
        };
        let table = contact((4.0 * ball).max(2.5 * thickness_m));
        let wide = contact((8.0 * ball).max(5.0 * thickness_m));
        // A modulus is derived from F over a cubed.
        let ratio = table.0 / wide.0 * (wide.1 / table.1).powi(3);
        assert!((ratio - 1.0).abs() < 2e-3, "{ball}: {ratio}");
    }
}

#[test]
fn a_finer_mesh_moves_the_table_little() {
    let material = |modulus| Material::new(modulus, 0.495).unwrap();
    let guide = paper_guide(25e-3);
    let press = ObjectPress::new(ObjectShape::Ball { radius_m: 3e-3 }, material(103e3)).unwrap();
    let press = press.on_guide(guide).unwrap();
    let loads = [0.05, 0.3, 1.0].map(AppliedLoad::Force);
    let radii = |fineness| -> Vec<f64> {
        let finer = press.clone().with_fineness(fineness).unwrap();
        let states = finer.scene().unwrap().solve(&loads).states;
        let radii = states.iter().map(|s| s.contact_radius().unwrap().radius_m);
        radii.collect()
    };
    for (default, fine) in radii(5).iter().zip(radii(8)) {
        // F at a given radius is proportional to its third to fourth power. Estimates include a
        // standard error of 0.3 % for the elements, 0.09 % of the radius; the tolerance is half as
        // much again.
        assert!((default / fine - 1.0).abs() < 1.4e-3, "{default} {fine}");
    }
}
