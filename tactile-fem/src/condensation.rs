//! Elimination of an element's pressures and of its centre node, so that the global system holds the
//! displacements of the eight outer nodes alone and is symmetric.

use super::element::{ALL, Forces, Geometry, OUTER, with_pressures};
use super::material::{Kinematics, Material};

/// An element's contribution to the global system, and what recovers its eliminated unknowns.
#[derive(Debug, Clone)]
pub(crate) struct Condensed {
    /// Stiffness of the outer nodes, lower half.
    pub(crate) stiffness: [[f64; OUTER]; OUTER],
    /// Residual of the outer nodes after elimination.
    pub(crate) residual: [f64; OUTER],
    pub(crate) elimination: Elimination,
}

/// What recovers the centre's displacement and the pressures from the outer nodes' increments.
#[derive(Debug, Clone)]
pub(crate) struct Elimination {
    centre_inverse: [[f64; 2]; 2],
    centre_row: [[f64; OUTER]; 2],
    centre_residual: [f64; 2],
    /// The deviatoric stress's forces before the step.
    deviatoric: [f64; ALL],
    volume_by_displacement: [[f64; ALL]; 3],
    /// ∫ψⱼ (J − 1) before the step.
    volume: [f64; 3],
    /// κ M⁻¹.
    compliance_inverse: [[f64; 3]; 3],
}

impl Geometry {
    /// Stiffness and residual with pressures and centre eliminated; `None` where turned inside out.
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

    /// Outer residual and elimination after a slight change of shape and material, by the forces there and
    /// the stiffness `before`: right to first order in the change. `None` where turned inside out.
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

    /// As [`Self::nearby`] of the same shape: forces are proportional to the moduli.
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

    /// Residual of all nodes with the pressures eliminated by the tangent `before`, and κM⁻¹∫ψ(J − 1); `None` where turned
    /// inside out.
    ///
    /// The pressures stay unknowns of their own: with $\partial J/\partial u$ of here in their elimination, a tangent of
    /// elsewhere would be wrong by κ/μ times the difference.
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
    /// Residual of the nodes with the pressures eliminated, before loads.
    fn residual(&self) -> [f64; ALL] {
        let pressures = product(&self.compliance_inverse, &self.volume);
        with_pressures(&self.deviatoric, &self.volume_by_displacement, &pressures)
    }

    /// Outer residual with the centre eliminated, and this with the centre's.
    fn balanced(mut self, centre_load: [f64; 2]) -> ([f64; OUTER], Self) {
        let mut residual = self.residual();
        for (k, load) in centre_load.into_iter().enumerate() {
            residual[OUTER + k] -= load;
            self.centre_residual[k] = residual[OUTER + k];
        }
        (self.outer_residual(&residual), self)
    }

    /// Outer residual before the step that this is for.
    pub(crate) fn outer_residual_before(&self) -> [f64; OUTER] {
        self.outer_residual(&self.residual())
    }

    /// What the centre's residuals give the outer component `i`.
    fn gain(&self, i: usize) -> [f64; 2] {
        let column = [self.centre_row[0][i], self.centre_row[1][i]];
        let inverse = &self.centre_inverse;
        [
            column[0] * inverse[0][0] + column[1] * inverse[1][0],
            column[0] * inverse[0][1] + column[1] * inverse[1][1],
        ]
    }

    /// Residual of the outer nodes with the centre eliminated.
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

    /// Change of κM⁻¹∫ψ(J − 1) by increments.
    pub(crate) fn pressure_change(&self, outer: &[f64; OUTER], centre: [f64; 2]) -> [f64; 3] {
        let volume = self.volume_by_displacement.map(|row| {
            let by_outer: f64 = row.iter().zip(outer).map(|(a, b)| a * b).sum();
            by_outer + row[OUTER] * centre[0] + row[OUTER + 1] * centre[1]
        });
        product(&self.compliance_inverse, &volume)
    }
}

/// κM⁻¹ times ∫ψ(J − 1): the pressures of an element in balance, for ∫ψ(J − 1) − M p/κ = 0.
fn product(compliance_inverse: &[[f64; 3]; 3], volume: &[f64; 3]) -> [f64; 3] {
    compliance_inverse.map(|row| row.iter().zip(volume).map(|(a, b)| a * b).sum())
}
