//! Meshes and states as files that ParaView, VisIt and meshio read.

use super::scene::Scene;
use super::state::State;
use std::io::{Result, Write};

/// VTK's number of the nine-node quadrilateral; its nodes come in the order of ours.
const BIQUADRATIC_QUAD: u8 = 28;

impl Scene {
    /// Writes the undeformed mesh of all bodies with a state's fields in VTK's legacy text format: at the nodes the displacement (m), in the
    /// elements Young's modulus (Pa) and the Cauchy stress at their centres (Pa, tension positive). x is r, y is z.
    ///
    /// ```
    /// use tactile_fem::{Load, Material, Object, Press};
    ///
    /// let scene = Press::new(Object::Ball { radius_m: 3e-3 }, Material::new(1e5, 0.495).unwrap()).and_then(|press| press.scene()).unwrap();
    /// let state = &scene.solve(&[Load::Approach(0.3e-3)]).states[0];
    /// let mut file = Vec::new();
    /// scene.write_vtk(state, &mut file)?;
    /// let text = String::from_utf8(file).unwrap();
    /// let cells = format!("CELL_TYPES {}", scene.element_count());
    /// assert!(text.starts_with("# vtk DataFile Version 3.0") && text.contains(&cells));
    /// # Ok::<(), std::io::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of `out`; [`InvalidInput`](std::io::ErrorKind::InvalidInput) for a state of another scene.
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

#[cfg(test)]
mod tests {
    use crate::*;

    /// The numbers after the line that begins with `title`.
    fn block<'a>(text: &'a str, title: &str) -> impl Iterator<Item = f64> + 'a {
        let start = text.find(title).expect("a title");
        let lines = text[start..].lines().skip(1);
        let numbers = lines.flat_map(str::split_whitespace);
        numbers.map_while(|word| word.parse().ok())
    }

    #[test]
    fn a_file_holds_mesh_displacements_and_stresses() {
        // A cylinder free to slide between plates, squeezed by a hundredth.
        let mesh = Mesh::rectangle(&[0.0, 1e-3, 2e-3], &[0.0, 1e-3]);
        let mut model = Model::new(Kinematics::Linear);
        let body = model
            .add(&mesh, &[Material::new(1e5, 0.45).unwrap()])
            .unwrap();
        model.drive(body, Boundary::Base, Support::Sliding);
        model.hold(body, Boundary::Contact, Support::Sliding);
        let scene = Scene::from_model(model);
        let state = &scene.solve(&[Load::Approach(1e-5)]).states[0];
        let mut file = Vec::new();
        scene.write_vtk(state, &mut file).unwrap();
        let text = String::from_utf8(file).unwrap();
        let points: Vec<f64> = block(&text, "POINTS").collect();
        assert_eq!(points.len(), 3 * mesh.nodes.len());
        let displacements: Vec<f64> = block(&text, "VECTORS").collect();
        for (point, u) in points.chunks(3).zip(displacements.chunks(3)) {
            // The base rises by 10 µm, the top stays; the sides spread by ν of the strain. The residual's tolerance is left.
            assert!((u[1] - 1e-5 * (1.0 - point[1] / 1e-3)).abs() < 1e-11);
            assert!((u[0] - 0.45e-2 * point[0]).abs() < 1e-11);
        }
        let stresses: Vec<f64> = block(&text, "TENSORS").collect();
        assert_eq!(stresses.len(), 9 * scene.element_count());
        assert!(
            stresses
                .chunks(9)
                .all(|s| (s[4] + 1e3).abs() < 1e-3 && s[0].abs() < 1e-3)
        );
        assert_eq!(block(&text, "CELL_TYPES").count(), scene.element_count());
    }

    #[test]
    fn a_state_of_another_scene_is_refused() {
        let ball = |radius| {
            let gel = Material::new(1e5, 0.495).unwrap();
            let object = Object::Ball { radius_m: radius };
            Press::new(object, gel).unwrap()
        };
        let scene = ball(3e-3).with_fineness(3).unwrap().scene().unwrap();
        let other = ball(3e-3).with_fineness(4).unwrap().scene().unwrap();
        let state = &scene.solve(&[Load::Approach(1e-4)]).states[0];
        assert!(other.write_vtk(state, &mut Vec::new()).is_err());
    }
}
