//! The element: nine displacement nodes, three discontinuous pressures.
//!
//! The perturbed Lagrangian $\int W_{dev} + p (J - 1) - p^2 / 2\kappa$ with p linear in (r, z) within
//! each element.

use super::material::{Gradient, Kinematics, respond, tangent};

/// Displacement components of the outer nodes (r, z of each).
pub(crate) const OUTER: usize = 16;
/// Displacement components of all nodes.
pub(crate) const ALL: usize = 18;

/// Three-point Gauss rule on [−1, 1].
pub(crate) const GAUSS3: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 9.0),
    (0.0, 8.0 / 9.0),
    (0.774_596_669_241_483_4, 5.0 / 9.0),
];

/// Quadratic shape functions at x = −1, 0, 1 and their derivatives, for x in [−1, 1].
pub(crate) fn quadratic(x: f64) -> ([f64; 3], [f64; 3]) {
    (
        [0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)],
        [x - 0.5, -2.0 * x, x + 0.5],
    )
}

/// Columns and rows of the nine nodes among the three each way.
const GRID: [[usize; 2]; 9] = [
    [0, 0],
    [2, 0],
    [2, 2],
    [0, 2],
    [1, 0],
    [2, 1],
    [1, 2],
    [0, 1],
    [1, 1],
];

/// Shape functions and their derivatives by ξ and η.
pub(crate) fn shape(xi: f64, eta: f64) -> [[f64; 3]; 9] {
    let (a, da) = quadratic(xi);
    let (b, db) = quadratic(eta);
    GRID.map(|[i, j]| [a[i] * b[j], da[i] * b[j], a[i] * db[j]])
}

/// Shape values at a Gauss point in the reference configuration.
#[derive(Debug, Clone)]
pub(crate) struct GaussPoint {
    /// ∂N/∂r, ∂N/∂z and N/r of each node.
    pub(crate) gradients: [[f64; 3]; 9],
    /// Reference volume 2π r dr dz.
    pub(crate) weight: f64,
    /// Pressure shape functions 1, (r − r₀)/h, (z − z₀)/h.
    pub(crate) pressure: [f64; 3],
}

/// The reference configuration of an element.
#[derive(Debug, Clone)]
pub(crate) struct Geometry {
    pub(crate) points: [GaussPoint; 9],
    /// Inverse of the pressures' mass matrix.
    pub(crate) inverse_mass: [[f64; 3]; 3],
}

/// The point ξ, η of an element: position, gradients, Jacobian's determinant.
pub(crate) fn map(nodes: &[[f64; 2]; 9], xi: f64, eta: f64) -> ([f64; 2], [[f64; 3]; 9], f64) {
    let shapes = shape(xi, eta);
    let mut position = [0.0; 2];
    let mut jacobian = [[0.0; 2]; 2];
    for (node, [n, by_xi, by_eta]) in nodes.iter().zip(&shapes) {
        for k in 0..2 {
            position[k] += n * node[k];
            jacobian[0][k] += by_xi * node[k];
            jacobian[1][k] += by_eta * node[k];
        }
    }
    let determinant = jacobian[0][0] * jacobian[1][1] - jacobian[0][1] * jacobian[1][0];
    let gradients = shapes.map(|[n, by_xi, by_eta]| {
        [
            (jacobian[1][1] * by_xi - jacobian[0][1] * by_eta) / determinant,
            (jacobian[0][0] * by_eta - jacobian[1][0] * by_xi) / determinant,
            n / position[0],
        ]
    });
    (position, gradients, determinant)
}

/// Pressure shape functions 1, (r − r₀)/h, (z − z₀)/h of an element at a reference position.
pub(crate) fn pressure_functions(nodes: &[[f64; 2]; 9], position: [f64; 2]) -> [f64; 3] {
    let centre = nodes[8];
    let size = (nodes[0][0] - nodes[2][0]).hypot(nodes[0][1] - nodes[2][1]);
    [
        1.0,
        (position[0] - centre[0]) / size,
        (position[1] - centre[1]) / size,
    ]
}

impl Geometry {
    /// `None` where the element is turned inside out or degenerate at a Gauss point.
    pub(crate) fn new(nodes: &[[f64; 2]; 9]) -> Option<Self> {
        let mut points = Vec::with_capacity(9);
        let mut mass = nalgebra::Matrix3::<f64>::zeros();
        for (eta, eta_weight) in GAUSS3 {
            for (xi, xi_weight) in GAUSS3 {
                let (position, gradients, determinant) = map(nodes, xi, eta);
                if !(determinant > 0.0 && position[0] > 0.0) {
                    return None;
                }
                let weight =
                    core::f64::consts::TAU * position[0] * determinant * xi_weight * eta_weight;
                let pressure = pressure_functions(nodes, position);
                let functions = nalgebra::Vector3::from(pressure);
                mass += weight * functions * functions.transpose();
                points.push(GaussPoint {
                    gradients,
                    weight,
                    pressure,
                });
            }
        }
        let inverse = mass.try_inverse()?;
        Some(Self {
            points: points.try_into().ok()?,
            inverse_mass: core::array::from_fn(|i| core::array::from_fn(|j| inverse[(i, j)])),
        })
    }
}

impl GaussPoint {
    /// Displacement gradient from nodal displacements (r, z of each node).
    pub(crate) fn gradient(&self, u: &[f64; ALL]) -> Gradient {
        let mut h = [0.0; 5];
        for (a, [by_r, by_z, over_r]) in self.gradients.iter().enumerate() {
            let (ur, uz) = (u[2 * a], u[2 * a + 1]);
            h[0] += by_r * ur;
            h[1] += by_z * ur;
            h[2] += by_r * uz;
            h[3] += by_z * uz;
            h[4] += over_r * ur;
        }
        h
    }
}

/// What an element contributes before elimination.
pub(crate) struct Forces {
    /// Derivative of the energy by the nodal displacements.
    pub(crate) internal: [f64; ALL],
    /// ∫ψⱼ ∂J/∂u.
    pub(crate) volume_by_displacement: [[f64; ALL]; 3],
    /// ∫ψⱼ (J − 1).
    pub(crate) volume: [f64; 3],
    /// Stored energy with the pressure at its own equilibrium.
    pub(crate) energy: f64,
}

impl Geometry {
    /// Forces at given displacements and pressures; `None` where the element is turned inside out.
    pub(crate) fn forces(
        &self,
        kinematics: Kinematics,
        shear: f64,
        u: &[f64; ALL],
        pressures: &[f64; 3],
    ) -> Option<Forces> {
        let mut forces = Forces {
            internal: [0.0; ALL],
            volume_by_displacement: [[0.0; ALL]; 3],
            volume: [0.0; 3],
            energy: 0.0,
        };
        for point in &self.points {
            let h = point.gradient(u);
            let response = respond(kinematics, shear, &h)?;
            forces.energy += point.weight * response.energy;
            let (s, c) = (response.stress, response.cofactor);
            for (a, [by_r, by_z, over_r]) in point.gradients.iter().enumerate() {
                forces.internal[2 * a] +=
                    point.weight * (s[0] * by_r + s[1] * by_z + s[4] * over_r);
                forces.internal[2 * a + 1] += point.weight * (s[2] * by_r + s[3] * by_z);
                let by_ur = point.weight * (c[0] * by_r + c[1] * by_z + c[4] * over_r);
                let by_uz = point.weight * (c[2] * by_r + c[3] * by_z);
                for (row, psi) in forces
                    .volume_by_displacement
                    .iter_mut()
                    .zip(&point.pressure)
                {
                    row[2 * a] += psi * by_ur;
                    row[2 * a + 1] += psi * by_uz;
                }
            }
            for (volume, psi) in forces.volume.iter_mut().zip(&point.pressure) {
                *volume += point.weight * psi * response.volume;
            }
        }
        for (row, pressure) in forces.volume_by_displacement.iter().zip(pressures) {
            for (force, by) in forces.internal.iter_mut().zip(row) {
                *force += pressure * by;
            }
        }
        Some(forces)
    }

    /// Second derivative of the energy by the nodal displacements at fixed pressures, lower half.
    pub(crate) fn stiffness(
        &self,
        kinematics: Kinematics,
        shear: f64,
        u: &[f64; ALL],
        pressures: &[f64; 3],
    ) -> [[f64; ALL]; ALL] {
        let mut stiffness = [[0.0; ALL]; ALL];
        for point in &self.points {
            let h = point.gradient(u);
            let pressure: f64 = (point.pressure.iter().zip(pressures))
                .map(|(a, b)| a * b)
                .sum();
            let a = tangent(kinematics, shear, pressure, &h);
            for (j, [by_r, by_z, over_r]) in point.gradients.iter().enumerate() {
                // Stress increments from unit displacements of node j along r and z.
                let (r, z, o) = (
                    point.weight * by_r,
                    point.weight * by_z,
                    point.weight * over_r,
                );
                let along_r: Gradient =
                    core::array::from_fn(|k| a[k][0] * r + a[k][1] * z + a[k][4] * o);
                let along_z: Gradient = core::array::from_fn(|k| a[k][2] * r + a[k][3] * z);
                for (i, [by_r, by_z, over_r]) in point.gradients.iter().enumerate().skip(j) {
                    let radial = |s: &Gradient| s[0] * by_r + s[1] * by_z + s[4] * over_r;
                    let axial = |s: &Gradient| s[2] * by_r + s[3] * by_z;
                    stiffness[2 * i][2 * j] += radial(&along_r);
                    stiffness[2 * i][2 * j + 1] += radial(&along_z);
                    stiffness[2 * i + 1][2 * j] += axial(&along_r);
                    stiffness[2 * i + 1][2 * j + 1] += axial(&along_z);
                }
            }
        }
        stiffness
    }
}
