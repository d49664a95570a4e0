//! Meshes and states as files that ParaView, VisIt and meshio read.

use crate::scene::FemScene;
use crate::state::State;
use std::io::{Result, Write};

/// VTK's number of the nine-node quadrilateral. Its nodes come in the order of ours.
const BIQUADRATIC_QUAD: u8 = 28;

impl FemScene {
    /// Writes the undeformed mesh of all bodies with a state's fields in VTK's legacy text format:
    /// at the nodes the displacement (m), in the elements Young's modulus (Pa) and the Cauchy
    /// stress at their centres (Pa, tension positive). x is r, y is z.
    ///
    /// ```
    /// use tactile_fem::{AppliedLoad, Material, ObjectShape, ObjectPress};
    ///
    /// let scene = ObjectPress::new(
    ///     ObjectShape::Ball { radius_m: 3e-3 },
    ///     Material::new(1e5, 0.495).unwrap(),
    /// )
    /// .and_then(|press| press.scene())
    /// .unwrap();
    /// let state = &scene.solve(&[AppliedLoad::Approach(0.3e-3)]).states[0];
    /// let mut file = Vec::new();
    /// scene.write_vtk(state, &mut file)?;
    /// let text = String::from_utf8(file).unwrap();
    /// let cells = format!("CELL_TYPES {}", scene.element_count());
    /// assert!(text.starts_with("# vtk DataFile Version 3.0") && text.contains(&cells));
    /// # Ok::<(), std::io::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of `out`. [`InvalidInput`](std::io::ErrorKind::InvalidInput) for a state of another
    /// scene.
    pub fn write_vtk(&self, state: &State, out: &mut impl Write) -> Result<()> {
        let model = &self.model;
        if state.fields.displacement.len() != 2 * model.nodes.len()
            || state.fields.pressures.len() != model.elements.len()
        {
            return Err(std::io::ErrorKind::InvalidInput.into());
        }
        writeln!(out, "# vtk DataFile Version 3.0")?;
        writeln!(
            out,
            "approach {:e} m, force {:e} N",
            state.approach_m(),
            state.force_n()
        )?;
        writeln!(out, "ASCII\nDATASET UNSTRUCTURED_GRID")?;
        writeln!(out, "POINTS {} double", model.nodes.len())?;
        for [r, z] in &model.nodes {
            writeln!(out, "{r:e} {z:e} 0")?;
        }
        let count = model.elements.len();
        writeln!(out, "CELLS {count} {}", 10 * count)?;
        for nodes in &model.elements {
            write!(out, "9")?;
            for node in nodes {
                write!(out, " {node}")?;
            }
            writeln!(out)?;
        }
        writeln!(out, "CELL_TYPES {count}")?;
        for _ in 0..count {
            writeln!(out, "{BIQUADRATIC_QUAD}")?;
        }
        writeln!(out, "POINT_DATA {}", model.nodes.len())?;
        writeln!(out, "VECTORS displacement double")?;
        for [u, w] in state.displacements() {
            writeln!(out, "{u:e} {w:e} 0")?;
        }
        writeln!(out, "CELL_DATA {count}")?;
        writeln!(out, "SCALARS youngs_modulus double 1\nLOOKUP_TABLE default")?;
        for &region in &model.regions {
            writeln!(out, "{:e}", model.materials[region].youngs_modulus_pa())?;
        }
        writeln!(out, "TENSORS stress double")?;
        for index in 0..count {
            // A state in equilibrium has no inverted element.
            let [rr, rz, zz, hoop] = model
                .element_stress(state, index, [0.0; 2])
                .map_or([f64::NAN; 4], |s| [s.rr_pa, s.rz_pa, s.zz_pa, s.hoop_pa]);
            writeln!(out, "{rr:e} {rz:e} 0\n{rz:e} {zz:e} 0\n0 0 {hoop:e}")?;
        }
        Ok(())
    }
}
