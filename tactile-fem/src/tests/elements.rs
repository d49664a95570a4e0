//! Manufactured solutions.

use crate::element::{GAUSS3, map, shape};
use crate::material::{Gradient, Kinematics, Material, PointDeformation, inverse_cube_root};
use crate::mesh::Mesh;
use crate::model::{DofMotion, ElementModel};
use crate::scene::{AppliedLoad, Outcome};

/// An annulus (0 ≤ r ≤ 1, 0 ≤ z ≤ 1) of n × n elements with its inner nodes displaced.
fn distorted(n: usize) -> Mesh {
    let lines: Vec<f64> = (0..=n).map(|k| k as f64 / n as f64).collect();
    let mut mesh = Mesh::cylinder(&lines, &lines);
    for node in &mut mesh.nodes {
        let [r, z] = *node;
        let bubble = 0.05 * (16.0 * r * (1.0 - r) * z * (1.0 - z));
        *node = [r + bubble * (3.0 * z).sin(), z + bubble * (4.0 * r).cos()];
    }
    mesh
}

/// Sets all displacements of the outer boundary to those of `field` at an approach of one.
fn clamp_to(model: &mut ElementModel, field: impl Fn([f64; 2]) -> [f64; 2]) {
    for part in model.parts.clone() {
        for edge in part.boundaries.values().flatten() {
            for &node in edge {
                let u = field(model.nodes[node]);
                for (k, u) in u.into_iter().enumerate() {
                    if !(k == 0 && model.nodes[node][0] == 0.0) && on_boundary(model.nodes[node]) {
                        model.motion[2 * node + k] = DofMotion::Driven(u);
                    }
                }
            }
        }
    }
}

/// The axis belongs to the boundary only at its ends.
fn on_boundary([r, z]: [f64; 2]) -> bool {
    r >= 1.0 || z <= 0.0 || z >= 1.0
}

/// Displacement of the manufactured solution: smooth, at finite strain, regular at the axis.
fn smooth([r, z]: [f64; 2]) -> [f64; 2] {
    [
        0.03 * r * (2.0 * z).cos() * (1.0 - 0.4 * r * r),
        0.03 * (1.0 + r * r) * (2.0 * z + 0.5).sin(),
    ]
}

/// First Piola–Kirchhoff stress of the manufactured solution, with the displacement gradient from
/// differences.
fn stress(kinematics: Kinematics, material: &Material, [r, z]: [f64; 2]) -> Gradient {
    let step = 1e-4;
    let difference = |dr: f64, dz: f64| -> [f64; 2] {
        // Fourth order, with an error of about 1e-13.
        let at = |k: f64| smooth([r + k * step * dr, z + k * step * dz]);
        core::array::from_fn(|i| {
            (8.0 * (at(1.0)[i] - at(-1.0)[i]) - (at(2.0)[i] - at(-2.0)[i])) / (12.0 * step)
        })
    };
    let (by_r, by_z) = (difference(1.0, 0.0), difference(0.0, 1.0));
    let hoop = if r == 0.0 {
        by_r[0]
    } else {
        smooth([r, z])[0] / r
    };
    let h = [by_r[0], by_z[0], by_r[1], by_z[1], hoop];
    let deformation = PointDeformation::new(kinematics, material.shear_modulus(), &h).unwrap();
    let response = deformation.response();
    let pressure = material.bulk_modulus() * response.volume;
    core::array::from_fn(|k| response.stress[k] + pressure * response.cofactor[k])
}

/// Root mean square error of the displacement with n × n elements.
fn manufactured_error(kinematics: Kinematics, poisson: f64, n: usize) -> f64 {
    let material = Material::new(1.0, poisson).unwrap();
    let mesh = distorted(n);
    let mut model = ElementModel::new(kinematics);
    model.add(&mesh, &[material]).unwrap();
    clamp_to(&mut model, smooth);
    let step = 1e-3;
    for (element, geometry) in model.elements.clone().iter().zip(model.geometry.clone()) {
        let nodes = element.map(|node| model.nodes[node]);
        for (q, point) in geometry.points.iter().enumerate() {
            let (xi, eta) = (GAUSS3[q % 3].0, GAUSS3[q / 3].0);
            let ([r, z], _, _) = map(&nodes, xi, eta);
            let s = stress(kinematics, &material, [r, z]);
            let along = |dr: f64, dz: f64, k: usize| {
                let at = |t: f64| {
                    stress(
                        kinematics,
                        &material,
                        [r + t * step * dr, z + t * step * dz],
                    )[k]
                };
                (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step)
            };
            // Equilibrium: Div P + b = 0.
            let body = [
                -(along(1.0, 0.0, 0) + along(0.0, 1.0, 1) + (s[0] - s[4]) / r),
                -(along(1.0, 0.0, 2) + along(0.0, 1.0, 3) + s[2] / r),
            ];
            for (node, [n, _, _]) in element.iter().zip(shape(xi, eta)) {
                for (k, density) in body.iter().enumerate() {
                    model.external[2 * node + k] += point.weight * n * density;
                }
            }
        }
    }
    let solution = model.solve(&[AppliedLoad::Approach(1.0)]);
    assert_eq!(
        solution.report.outcome,
        Outcome::Solved,
        "{kinematics:?} {poisson} {n}"
    );
    let (u, _) = solution.states[0].fields.displacement.as_chunks::<2>();
    let (mut squares, mut volume) = (0.0, 0.0);
    for (element, geometry) in model.elements.iter().zip(&model.geometry) {
        let nodes = element.map(|node| model.nodes[node]);
        for (q, point) in geometry.points.iter().enumerate() {
            let (xi, eta) = (GAUSS3[q % 3].0, GAUSS3[q / 3].0);
            let (position, _, _) = map(&nodes, xi, eta);
            let exact = smooth(position);
            for k in 0..2 {
                let shapes = shape(xi, eta);
                let found: f64 = element
                    .iter()
                    .zip(shapes)
                    .map(|(node, s)| s[0] * u[*node][k])
                    .sum();
                squares += point.weight * (found - exact[k]).powi(2);
            }
            volume += point.weight;
        }
    }
    (squares / volume).sqrt()
}

#[test]
fn a_manufactured_solution_converges_with_the_third_order() {
    let cases = [
        (Kinematics::Linear, 0.3),
        (Kinematics::Linear, 0.495),
        (Kinematics::Linear, 0.4999),
        (Kinematics::Finite, 0.3),
        (Kinematics::Finite, 0.495),
    ];
    for (kinematics, poisson) in cases {
        let errors = [6, 12].map(|n| manufactured_error(kinematics, poisson, n));
        let order = (errors[0] / errors[1]).log2();
        // Quadratic displacements give third order, which this refinement approaches within a
        // tenth.
        assert!(order > 2.8, "{kinematics:?} {poisson}: {errors:?}");
    }
}

#[test]
fn the_inverse_cube_root_is_one() {
    for k in -95..300 {
        let v = 0.01 * f64::from(k);
        let x = inverse_cube_root(v);
        // Three products and a sum: a few rounding errors.
        assert!(((1.0 + v) * x * x * x - 1.0).abs() < 2e-15, "{v}: {x}");
    }
}
