//! Elimination of an element's pressures and of its centre node, so that the global system holds the
//! displacements of the eight outer nodes alone and is symmetric.

use super::element::{ALL, Forces, Geometry, OUTER};
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
        let mut forces = self.forces(kinematics, shear, u, pressures)?;
        for (force, load) in forces.internal[OUTER..].iter_mut().zip(centre_load) {
            *force -= load;
        }
        let mut stiffness = self.stiffness(kinematics, shear, u, pressures);
        Some(self.eliminate(material.bulk_modulus(), &forces, &mut stiffness, pressures))
    }

    /// Outer residual and elimination after a slight change of material or shape, by the forces there and
    /// the stiffness `before`: right to first order in the change. `None` where turned inside out.
    pub(crate) fn nearby(
        &self,
        kinematics: Kinematics,
        material: &Material,
        u: &[f64; ALL],
        pressures: &[f64; 3],
        before: &Elimination,
    ) -> Option<([f64; OUTER], Elimination)> {
        let forces = self.forces(kinematics, material.shear_modulus(), u, pressures)?;
        let compliance_inverse = self.compliance_inverse(material.bulk_modulus());
        let residual = forces.residual(&compliance_inverse, pressures);
        let elimination = Elimination {
            centre_residual: [residual[16], residual[17]],
            volume_by_displacement: forces.volume_by_displacement,
            volume: forces.volume,
            compliance_inverse,
            ..*before
        };
        Some((elimination.outer_residual(&residual), elimination))
    }

    /// κ M⁻¹.
    fn compliance_inverse(&self, bulk: f64) -> [[f64; 3]; 3] {
        self.inverse_mass.map(|row| row.map(|value| bulk * value))
    }

    fn eliminate(
        &self,
        bulk: f64,
        forces: &Forces,
        stiffness: &mut [[f64; ALL]; ALL],
        pressures: &[f64; 3],
    ) -> Condensed {
        let compliance_inverse = self.compliance_inverse(bulk);
        let rows = &forces.volume_by_displacement;
        let scaled_rows: [[f64; ALL]; 3] = core::array::from_fn(|i| {
            core::array::from_fn(|k| (0..3).map(|j| compliance_inverse[i][j] * rows[j][k]).sum())
        });
        let residual = forces.residual(&compliance_inverse, pressures);
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
            centre_residual: [residual[16], residual[17]],
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
        Condensed {
            stiffness: outer,
            residual: elimination.outer_residual(&residual),
            elimination,
        }
    }
}

impl Forces {
    /// Residual of the nodes with the pressures eliminated.
    ///
    /// Pressure equations: ∫ψ(J − 1) − M p/κ; κM⁻¹ times that is κM⁻¹∫ψ(J − 1) − p.
    fn residual(&self, compliance_inverse: &[[f64; 3]; 3], pressures: &[f64; 3]) -> [f64; ALL] {
        let mut residual = self.internal;
        for (k, row) in self.volume_by_displacement.iter().enumerate() {
            let projected: f64 = (compliance_inverse[k].iter().zip(&self.volume))
                .map(|(a, b)| a * b)
                .sum();
            let step = projected - pressures[k];
            for (residual, by) in residual.iter_mut().zip(row) {
                *residual += by * step;
            }
        }
        residual
    }
}

impl Elimination {
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
    fn outer_residual(&self, residual: &[f64; ALL]) -> [f64; OUTER] {
        core::array::from_fn(|i| {
            let gain = self.gain(i);
            residual[i] - gain[0] * residual[OUTER] - gain[1] * residual[OUTER + 1]
        })
    }

    /// Increments of the centre's displacement and the new pressures, from the outer increments.
    pub(crate) fn recover(&self, outer: &[f64; OUTER]) -> ([f64; 2], [f64; 3]) {
        let right: [f64; 2] = core::array::from_fn(|i| {
            let coupled: f64 = (self.centre_row[i].iter().zip(outer))
                .map(|(a, b)| a * b)
                .sum();
            -(self.centre_residual[i] + coupled)
        });
        let centre: [f64; 2] = core::array::from_fn(|i| {
            self.centre_inverse[i][0] * right[0] + self.centre_inverse[i][1] * right[1]
        });
        let volume: [f64; 3] = core::array::from_fn(|j| {
            let row = &self.volume_by_displacement[j];
            let by_outer: f64 = row.iter().zip(outer).map(|(a, b)| a * b).sum();
            self.volume[j] + by_outer + row[16] * centre[0] + row[17] * centre[1]
        });
        let pressures = core::array::from_fn(|i| {
            (0..3)
                .map(|j| self.compliance_inverse[i][j] * volume[j])
                .sum()
        });
        (centre, pressures)
    }
}
