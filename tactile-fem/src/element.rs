//! The element: nine displacement nodes, three discontinuous pressures.
//!
//! It uses the perturbed Lagrangian $\int W_{dev} + p (J - 1) - p^2 / 2\kappa$ with p linear in (r,
//! z) within each element. The pressures of an element and its centre node are eliminated, so that
//! the global system contains only the displacements of the eight outer nodes and is symmetric.

use crate::material::{Gradient, Kinematics, Material, PointDeformation, StressResponse};

/// Number of displacement components of the outer nodes (r, z of each).
pub(crate) const OUTER: usize = 16;
/// Number of displacement components of all nodes.
pub(crate) const ALL: usize = 18;

/// Three-point Gauss rule on [−1, 1].
pub(crate) const GAUSS3: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 9.0),
    (0.0, 8.0 / 9.0),
    (0.774_596_669_241_483_4, 5.0 / 9.0),
];

/// Quadratic shape functions with nodes at −1, 0 and 1, and their derivatives, for x in [−1, 1].
pub(crate) fn quadratic(x: f64) -> ([f64; 3], [f64; 3]) {
    (
        [0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)],
        [x - 0.5, -2.0 * x, x + 0.5],
    )
}

/// Columns and rows of the nine nodes in the grid of three by three.
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

/// Values of the shape functions at a Gauss point in the reference configuration.
#[derive(Debug, Clone, Default)]
pub(crate) struct GaussPoint {
    /// ∂N/∂r of each node.
    by_r: [f64; 9],
    /// ∂N/∂z.
    by_z: [f64; 9],
    /// N/r.
    over_r: [f64; 9],
    /// Reference volume 2π r dr dz.
    pub weight: f64,
    /// Pressure shape functions 1, (r − r₀)/h, (z − z₀)/h.
    pressure: [f64; 3],
}

/// The reference configuration of an element.
#[derive(Debug, Clone)]
pub(crate) struct ElementGeometry {
    pub points: [GaussPoint; 9],
    /// Inverse of the pressures' mass matrix.
    inverse_mass: [[f64; 3]; 3],
}

/// Position of a point of an element from its shape functions, the derivatives of the position by ξ
/// and η, and their determinant.
pub(crate) fn position(
    nodes: &[[f64; 2]; 9],
    shapes: &[[f64; 3]; 9],
) -> ([f64; 2], [[f64; 2]; 2], f64) {
    let mut position = [0.0; 2];
    let mut jacobian = [[0.0; 2]; 2];
    for (node, [n, by_xi, by_eta]) in nodes.iter().zip(shapes) {
        for k in 0..2 {
            position[k] += n * node[k];
            jacobian[0][k] += by_xi * node[k];
            jacobian[1][k] += by_eta * node[k];
        }
    }
    let determinant = jacobian[0][0] * jacobian[1][1] - jacobian[0][1] * jacobian[1][0];
    (position, jacobian, determinant)
}

/// The point ξ, η of an element: position, gradients, and determinant of the Jacobian.
pub(crate) fn map(nodes: &[[f64; 2]; 9], xi: f64, eta: f64) -> ([f64; 2], [[f64; 3]; 9], f64) {
    let shapes = shape(xi, eta);
    let (position, jacobian, determinant) = position(nodes, &shapes);
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

impl ElementGeometry {
    /// `None` if the element is inverted or degenerate at a Gauss point.
    pub(crate) fn new(nodes: &[[f64; 2]; 9]) -> Option<Self> {
        let mut points: [GaussPoint; 9] = Default::default();
        let mut mass = nalgebra::Matrix3::<f64>::zeros();
        for (row, (eta, eta_weight)) in GAUSS3.into_iter().enumerate() {
            for (column, (xi, xi_weight)) in GAUSS3.into_iter().enumerate() {
                let (position, gradients, determinant) = map(nodes, xi, eta);
                if !(determinant > 0.0 && position[0] > 0.0) {
                    return None;
                }
                let weight =
                    core::f64::consts::TAU * position[0] * determinant * xi_weight * eta_weight;
                let pressure = pressure_functions(nodes, position);
                let functions = nalgebra::Vector3::from(pressure);
                mass += weight * functions * functions.transpose();
                points[3 * row + column] = GaussPoint {
                    by_r: gradients.map(|[by_r, ..]| by_r),
                    by_z: gradients.map(|[_, by_z, _]| by_z),
                    over_r: gradients.map(|[.., over_r]| over_r),
                    weight,
                    pressure,
                };
            }
        }
        let inverse = mass.try_inverse()?;
        Some(Self {
            points,
            inverse_mass: core::array::from_fn(|i| core::array::from_fn(|j| inverse[(i, j)])),
        })
    }
}

impl GaussPoint {
    /// Displacement gradient from nodal displacements (r, z of each node).
    #[inline]
    fn gradient(&self, u: &[f64; ALL]) -> Gradient {
        let mut h = [0.0; 5];
        for a in 0..9 {
            let (ur, uz) = (u[2 * a], u[2 * a + 1]);
            h[0] += self.by_r[a] * ur;
            h[1] += self.by_z[a] * ur;
            h[2] += self.by_r[a] * uz;
            h[3] += self.by_z[a] * uz;
            h[4] += self.over_r[a] * ur;
        }
        h
    }

    /// Nodal forces of a stress, along r and along z.
    #[inline]
    fn forces(&self, stress: &Gradient) -> [[f64; 9]; 2] {
        let s = stress.map(|component| self.weight * component);
        [
            core::array::from_fn(|a| {
                s[0] * self.by_r[a] + s[1] * self.by_z[a] + s[4] * self.over_r[a]
            }),
            core::array::from_fn(|a| s[2] * self.by_r[a] + s[3] * self.by_z[a]),
        ]
    }
}

/// Contributions of an element before the elimination.
pub(crate) struct Forces {
    /// Derivative of the deviatoric energy by the nodal displacements.
    deviatoric: [f64; ALL],
    /// ∫ψⱼ ∂J/∂u.
    volume_by_displacement: [[f64; ALL]; 3],
    /// ∫ψⱼ (J − 1).
    pub volume: [f64; 3],
}

impl Forces {
    /// Derivative of the energy by the nodal displacements at given pressures.
    pub(crate) fn internal(&self, pressures: &[f64; 3]) -> [f64; ALL] {
        with_pressures(&self.deviatoric, &self.volume_by_displacement, pressures)
    }
}

/// Adds the nodal forces of pressures.
fn with_pressures(
    forces: &[f64; ALL],
    volume_by_displacement: &[[f64; ALL]; 3],
    pressures: &[f64; 3],
) -> [f64; ALL] {
    let mut forces = *forces;
    for (row, pressure) in volume_by_displacement.iter().zip(pressures) {
        for (force, by) in forces.iter_mut().zip(row) {
            *force += pressure * by;
        }
    }
    forces
}

/// Sums over Gauss points, for all nodes along r and along z.
#[derive(Default)]
struct Sums {
    deviatoric: [[f64; 9]; 2],
    volume_by_displacement: [[[f64; 9]; 2]; 3],
    volume: [f64; 3],
}

#[inline]
fn add(sums: &mut [[f64; 9]; 2], times: f64, forces: &[[f64; 9]; 2]) {
    for (sums, forces) in sums.iter_mut().zip(forces) {
        for (sum, force) in sums.iter_mut().zip(forces) {
            *sum += times * force;
        }
    }
}

impl Sums {
    #[inline]
    fn add(&mut self, point: &GaussPoint, response: &StressResponse) {
        let stress = point.forces(&response.stress);
        let volume = point.forces(&response.cofactor);
        add(&mut self.deviatoric, 1.0, &stress);
        for (row, psi) in (self.volume_by_displacement.iter_mut()).zip(&point.pressure) {
            add(row, *psi, &volume);
        }
        for (volume, psi) in self.volume.iter_mut().zip(&point.pressure) {
            *volume += point.weight * psi * response.volume;
        }
    }

    fn forces(&self) -> Forces {
        let interleaved = |[r, z]: &[[f64; 9]; 2]| {
            core::array::from_fn(|k| if k % 2 == 0 { r } else { z }[k / 2])
        };
        Forces {
            deviatoric: interleaved(&self.deviatoric),
            volume_by_displacement: core::array::from_fn(|k| {
                interleaved(&self.volume_by_displacement[k])
            }),
            volume: self.volume,
        }
    }
}

/// Second derivatives of the energy by the nodes' displacements.
struct Stiffness {
    /// By u_r of both nodes, by u_z of both, and by u_r of the first and u_z of the second.
    radial: [[f64; 9]; 9],
    axial: [[f64; 9]; 9],
    mixed: [[f64; 9]; 9],
}

impl Stiffness {
    #[inline]
    fn add(&mut self, point: &GaussPoint, tangent: &[Gradient; 5]) {
        let (by_r, by_z, over_r) = (&point.by_r, &point.by_z, &point.over_r);
        for i in 0..9 {
            let (r, z, o) = (by_r[i], by_z[i], over_r[i]);
            // Stress increments from unit displacements of node i along r and z.
            let [along_r, along_z] = [
                core::array::from_fn(|k| {
                    let [a, b, _, _, c] = tangent[k];
                    point.weight * (a * r + b * z + c * o)
                }),
                core::array::from_fn(|k| {
                    let [_, _, a, b, _] = tangent[k];
                    point.weight * (a * r + b * z)
                }),
            ] as [Gradient; 2];
            let (radial, mixed) = (&mut self.radial[i], &mut self.mixed[i]);
            for j in 0..9 {
                radial[j] += along_r[0] * by_r[j] + along_r[1] * by_z[j] + along_r[4] * over_r[j];
                mixed[j] += along_r[2] * by_r[j] + along_r[3] * by_z[j];
            }
            let axial = &mut self.axial[i];
            for j in 0..9 {
                axial[j] += along_z[2] * by_r[j] + along_z[3] * by_z[j];
            }
        }
    }

    /// All components, lower half.
    fn interleaved(&self) -> [[f64; ALL]; ALL] {
        let mut all = [[0.0; ALL]; ALL];
        for i in 0..9 {
            for j in 0..=i {
                all[2 * i][2 * j] = self.radial[i][j];
                all[2 * i][2 * j + 1] = self.mixed[i][j];
                all[2 * i + 1][2 * j] = self.mixed[j][i];
                all[2 * i + 1][2 * j + 1] = self.axial[i][j];
            }
        }
        all
    }
}

impl ElementGeometry {
    /// Forces at given displacements. `None` if the element is inverted.
    pub(crate) fn forces(
        &self,
        kinematics: Kinematics,
        shear: f64,
        u: &[f64; ALL],
    ) -> Option<Forces> {
        let mut forces = Sums::default();
        for point in &self.points {
            let deformation = PointDeformation::new(kinematics, shear, &point.gradient(u))?;
            forces.add(point, &deformation.response());
        }
        Some(forces.forces())
    }

    /// Forces, and the lower half of the second derivative of the energy by the nodal displacements
    /// at fixed pressures.
    fn forces_and_stiffness(
        &self,
        kinematics: Kinematics,
        shear: f64,
        u: &[f64; ALL],
        pressures: &[f64; 3],
    ) -> Option<(Forces, [[f64; ALL]; ALL])> {
        let mut forces = Sums::default();
        let mut stiffness = Stiffness {
            radial: [[0.0; 9]; 9],
            axial: [[0.0; 9]; 9],
            mixed: [[0.0; 9]; 9],
        };
        for point in &self.points {
            let deformation = PointDeformation::new(kinematics, shear, &point.gradient(u))?;
            forces.add(point, &deformation.response());
            let pressure: f64 = (point.pressure.iter().zip(pressures))
                .map(|(a, b)| a * b)
                .sum();
            stiffness.add(point, &deformation.tangent(pressure));
        }
        Some((forces.forces(), stiffness.interleaved()))
    }
}

/// Contribution of an element to the global system, and the data to recover its eliminated
/// unknowns.
#[derive(Debug, Clone)]
pub(crate) struct Condensed {
    /// Stiffness of the outer nodes, lower half.
    pub stiffness: [[f64; OUTER]; OUTER],
    /// Residual of the outer nodes after the elimination.
    pub residual: [f64; OUTER],
    pub elimination: Elimination,
}

/// Data to recover the centre's displacement and the pressures from the increments of the outer
/// nodes.
#[derive(Debug, Clone)]
pub(crate) struct Elimination {
    centre_inverse: [[f64; 2]; 2],
    centre_row: [[f64; OUTER]; 2],
    centre_residual: [f64; 2],
    /// Nodal forces of the deviatoric stress before the step.
    deviatoric: [f64; ALL],
    volume_by_displacement: [[f64; ALL]; 3],
    /// ∫ψⱼ (J − 1) before the step.
    volume: [f64; 3],
    /// κ M⁻¹.
    compliance_inverse: [[f64; 3]; 3],
}

impl ElementGeometry {
    /// Stiffness and residual after elimination of pressures and centre. `None` if the element is
    /// inverted.
    pub(crate) fn condensed(
        &self,
        kinematics: Kinematics,
        material: &Material,
        u: &[f64; ALL],
        pressures: &[f64; 3],
        centre_load: [f64; 2],
    ) -> Option<Condensed> {
        let shear = material.shear_modulus();
        let (forces, stiffness) = self.forces_and_stiffness(kinematics, shear, u, pressures)?;
        Some(self.eliminate(material.bulk_modulus(), &forces, stiffness, centre_load))
    }

    /// Outer residual and elimination after a small change of shape and material, from the new
    /// forces and the stiffness `before`. This is accurate to first order in the change. `None` if
    /// the element is inverted.
    pub(crate) fn nearby(
        &self,
        kinematics: Kinematics,
        material: &Material,
        u: &[f64; ALL],
        before: &Elimination,
    ) -> Option<([f64; OUTER], Elimination)> {
        let forces = self.forces(kinematics, material.shear_modulus(), u)?;
        let elimination = Elimination {
            deviatoric: forces.deviatoric,
            volume_by_displacement: forces.volume_by_displacement,
            volume: forces.volume,
            compliance_inverse: self.compliance_inverse(material.bulk_modulus()),
            ..*before
        };
        Some(elimination.balanced([0.0; 2]))
    }

    /// Like [`Self::nearby`], for an unchanged shape: forces are proportional to the moduli.
    pub(crate) fn of_material(
        &self,
        [from, to]: [&Material; 2],
        before: &Elimination,
    ) -> ([f64; OUTER], Elimination) {
        let times = to.shear_modulus() / from.shear_modulus();
        let elimination = Elimination {
            deviatoric: before.deviatoric.map(|force| times * force),
            compliance_inverse: self.compliance_inverse(to.bulk_modulus()),
            ..*before
        };
        elimination.balanced([0.0; 2])
    }

    /// Residual of all nodes, with the pressures eliminated by the tangent `before`, and κM⁻¹∫ψ(J −
    /// 1). `None` if the element is inverted.
    ///
    /// The pressures remain independent unknowns: if the current $\partial J/\partial u$ were used
    /// in their elimination, the earlier tangent would be wrong by κ/μ times the difference.
    pub(crate) fn balance(
        &self,
        kinematics: Kinematics,
        material: &Material,
        u: &[f64; ALL],
        pressures: &[f64; 3],
        before: &Elimination,
    ) -> Option<([f64; ALL], [f64; 3])> {
        let forces = self.forces(kinematics, material.shear_modulus(), u)?;
        let compliance_inverse = self.compliance_inverse(material.bulk_modulus());
        let projected = product(&compliance_inverse, &forces.volume);
        let steps: [f64; 3] = core::array::from_fn(|k| projected[k] - pressures[k]);
        let internal = forces.internal(pressures);
        Some((
            with_pressures(&internal, &before.volume_by_displacement, &steps),
            projected,
        ))
    }

    /// κ M⁻¹.
    fn compliance_inverse(&self, bulk: f64) -> [[f64; 3]; 3] {
        self.inverse_mass.map(|row| row.map(|value| bulk * value))
    }

    fn eliminate(
        &self,
        bulk: f64,
        forces: &Forces,
        mut stiffness: [[f64; ALL]; ALL],
        centre_load: [f64; 2],
    ) -> Condensed {
        let compliance_inverse = self.compliance_inverse(bulk);
        let rows = &forces.volume_by_displacement;
        let scaled_rows: [[f64; ALL]; 3] = core::array::from_fn(|i| {
            core::array::from_fn(|k| (0..3).map(|j| compliance_inverse[i][j] * rows[j][k]).sum())
        });
        for i in 0..ALL {
            for k in 0..=i {
                for (row, scaled) in rows.iter().zip(&scaled_rows) {
                    stiffness[i][k] += row[i] * scaled[k];
                }
            }
        }
        let (a, b, c) = (stiffness[16][16], stiffness[17][16], stiffness[17][17]);
        let determinant = a * c - b * b;
        let centre_inverse = [
            [c / determinant, -b / determinant],
            [-b / determinant, a / determinant],
        ];
        let centre_row: [[f64; OUTER]; 2] =
            core::array::from_fn(|i| core::array::from_fn(|k| stiffness[OUTER + i][k]));
        let elimination = Elimination {
            centre_inverse,
            centre_row,
            centre_residual: [0.0; 2],
            deviatoric: forces.deviatoric,
            volume_by_displacement: *rows,
            volume: forces.volume,
            compliance_inverse,
        };
        let mut outer = [[0.0; OUTER]; OUTER];
        for i in 0..OUTER {
            let gain = elimination.gain(i);
            for k in 0..=i {
                outer[i][k] =
                    stiffness[i][k] - gain[0] * centre_row[0][k] - gain[1] * centre_row[1][k];
            }
        }
        let (residual, elimination) = elimination.balanced(centre_load);
        Condensed {
            stiffness: outer,
            residual,
            elimination,
        }
    }
}

impl Elimination {
    /// Residual of the nodes after elimination of the pressures, without loads.
    fn residual(&self) -> [f64; ALL] {
        let pressures = product(&self.compliance_inverse, &self.volume);
        with_pressures(&self.deviatoric, &self.volume_by_displacement, &pressures)
    }

    /// Outer residual after elimination of the centre, and `self` with the residual of the centre.
    fn balanced(mut self, centre_load: [f64; 2]) -> ([f64; OUTER], Self) {
        let mut residual = self.residual();
        for (k, load) in centre_load.into_iter().enumerate() {
            residual[OUTER + k] -= load;
            self.centre_residual[k] = residual[OUTER + k];
        }
        (self.outer_residual(&residual), self)
    }

    /// Outer residual before the step that this elimination belongs to.
    pub(crate) fn outer_residual_before(&self) -> [f64; OUTER] {
        self.outer_residual(&self.residual())
    }

    /// Contribution of the centre's residuals to the outer component `i`.
    fn gain(&self, i: usize) -> [f64; 2] {
        let column = [self.centre_row[0][i], self.centre_row[1][i]];
        let inverse = &self.centre_inverse;
        [
            column[0] * inverse[0][0] + column[1] * inverse[1][0],
            column[0] * inverse[0][1] + column[1] * inverse[1][1],
        ]
    }

    /// Residual of the outer nodes after elimination of the centre.
    pub(crate) fn outer_residual(&self, residual: &[f64; ALL]) -> [f64; OUTER] {
        core::array::from_fn(|i| {
            let gain = self.gain(i);
            residual[i] - gain[0] * residual[OUTER] - gain[1] * residual[OUTER + 1]
        })
    }

    /// Increments of the centre's displacement, from its residual and the outer increments.
    pub(crate) fn centre(&self, residual: [f64; 2], outer: &[f64; OUTER]) -> [f64; 2] {
        let right: [f64; 2] = core::array::from_fn(|i| {
            let coupled: f64 = (self.centre_row[i].iter().zip(outer))
                .map(|(a, b)| a * b)
                .sum();
            -(residual[i] + coupled)
        });
        core::array::from_fn(|i| {
            self.centre_inverse[i][0] * right[0] + self.centre_inverse[i][1] * right[1]
        })
    }

    /// Increments of the centre's displacement and the new pressures, from the outer increments.
    pub(crate) fn recover(&self, outer: &[f64; OUTER]) -> ([f64; 2], [f64; 3]) {
        let centre = self.centre(self.centre_residual, outer);
        let before = product(&self.compliance_inverse, &self.volume);
        let change = self.pressure_change(outer, centre);
        (centre, core::array::from_fn(|k| before[k] + change[k]))
    }

    /// Change of κM⁻¹∫ψ(J − 1) because of increments.
    pub(crate) fn pressure_change(&self, outer: &[f64; OUTER], centre: [f64; 2]) -> [f64; 3] {
        let volume = self.volume_by_displacement.map(|row| {
            let by_outer: f64 = row.iter().zip(outer).map(|(a, b)| a * b).sum();
            by_outer + row[OUTER] * centre[0] + row[OUTER + 1] * centre[1]
        });
        product(&self.compliance_inverse, &volume)
    }
}

/// κM⁻¹ times ∫ψ(J − 1): the equilibrium pressures of an element, for which ∫ψ(J − 1) − M p/κ = 0.
fn product(compliance_inverse: &[[f64; 3]; 3], volume: &[f64; 3]) -> [f64; 3] {
    compliance_inverse.map(|row| row.iter().zip(volume).map(|(a, b)| a * b).sum())
}
