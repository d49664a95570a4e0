//! Contacts by finite elements, as CSV: the contacts of the simulator's finite-element scene, or
//! those of a test.
//!
//! ```console
//! cargo run --release --example contact_states > tactile-simulate/src/finite_elements.csv
//! cargo run --release --example contact_states -- presses > tests/data/finite_element_presses.csv
//! ```
//!
//! Neo-Hookean balls on neo-Hookean layers or on a rigid flat, without friction. ν = ½ is computed
//! as 0.4999. Each row is one point: its contact (modulus, radius, layers as thickness:modulus,
//! force, contact radius, approach), then distance from the axis, pressure and height.
use std::io::{Result, Write, stdout};
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::fem::{
    AppliedLoad, Guide, GuideLayer, Material, ObjectPress, ObjectShape, State,
};
use tactile_simulate::{Elastic, LightGuide};

const POISSON_RATIO: f64 = 0.4999;

struct Ball {
    youngs_modulus_pa: f64,
    radius_m: f64,
    /// Thickness and modulus of each layer. Empty for a rigid flat.
    layers: Vec<(f64, f64)>,
    forces_n: Vec<f64>,
}

impl Ball {
    fn states(&self) -> std::result::Result<Vec<State>, ElasticityError> {
        let material = |modulus| Material::new(modulus, POISSON_RATIO);
        let ball = ObjectShape::Ball {
            radius_m: self.radius_m,
        };
        let mut press = ObjectPress::new(ball, material(self.youngs_modulus_pa)?)?;
        if !self.layers.is_empty() {
            let thickness_m: f64 = self.layers.iter().map(|layer| layer.0).sum();
            let mut layers = Vec::with_capacity(self.layers.len());
            for &(thickness_m, modulus) in &self.layers {
                layers.push(GuideLayer {
                    thickness_m,
                    material: material(modulus)?,
                });
            }
            // Wide enough for the rim to have no effect.
            let guide = Guide::new(layers, (5.0 * self.radius_m).max(2.8 * thickness_m))?;
            press = press.on_guide(guide)?;
        }
        let loads: Vec<AppliedLoad> = self
            .forces_n
            .iter()
            .map(|&f| AppliedLoad::Force(f))
            .collect();
        Ok(press.scene()?.solve(&loads).states)
    }

    fn write(&self, out: &mut impl Write) -> Result<()> {
        let layers: Vec<String> = (self.layers.iter())
            .map(|(thickness_m, modulus)| format!("{thickness_m}:{modulus}"))
            .collect();
        for state in self.states().map_err(std::io::Error::other)? {
            let Some(contact) = state.contact_radius() else {
                continue;
            };
            let a = contact.radius_m;
            // Heights are counted from the undeformed surface of the guide, which the glass has
            // lifted by the approach.
            let mut rows: Vec<[f64; 3]> = (state.pressure().iter())
                .map(|p| [p.r_m, p.pressure_pa, p.z_m - state.approach_m()])
                .collect();
            let rim = rows.last().map_or(0.0, |row| row[2]);
            rows.push([a, 0.0, rim]);
            for [r, p, z] in rows {
                writeln!(
                    out,
                    "{},{},{},{:.4},{a:.5e},{:.5e},{r:.5e},{p:.4e},{z:.4e}",
                    self.youngs_modulus_pa,
                    self.radius_m,
                    layers.join(";"),
                    state.force_n(),
                    state.approach_m()
                )?;
            }
        }
        Ok(())
    }
}

fn main() -> Result<()> {
    let mut out = stdout().lock();
    writeln!(
        out,
        "youngs_modulus_pa,ball_radius_m,layers,force_n,contact_radius_m,indentation_m,radius_m,\
         pressure_pa,height_m"
    )?;
    let balls = match std::env::args().nth(1).as_deref() {
        Some("presses") => presses(),
        _ => polymers(),
    };
    balls.iter().try_for_each(|ball| ball.write(&mut out))
}

fn papers_layers() -> Vec<(f64, f64)> {
    (LightGuide::default().layers.iter())
        .map(|l| (l.thickness_m, l.material.youngs_modulus_pa))
        .collect()
}

/// The two polymers of the paper on its waveguide.
fn polymers() -> Vec<Ball> {
    [Elastic::CL2000X, Elastic::CL2003X]
        .map(|polymer| Ball {
            youngs_modulus_pa: polymer.youngs_modulus_pa,
            radius_m: 3e-3,
            layers: papers_layers(),
            forces_n: vec![0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.7, 0.85, 1.0, 1.2, 1.3],
        })
        .into()
}

/// Moduli, radii, guides and loads that are in no table and were not used for the fit of a law.
fn presses() -> Vec<Ball> {
    let on = |layers: &[(f64, f64)], modulus, radius_m, forces_n: &[f64]| Ball {
        youngs_modulus_pa: modulus,
        radius_m,
        layers: layers.to_vec(),
        forces_n: forces_n.to_vec(),
    };
    let paper = papers_layers();
    vec![
        on(&paper, 45e3, 3e-3, &[0.02, 0.06, 0.15, 0.35, 0.6, 0.8]),
        on(&paper, 80e3, 3e-3, &[0.02, 0.08, 0.22, 0.5, 0.9, 1.2]),
        on(&paper, 180e3, 3e-3, &[0.03, 0.1, 0.3, 0.7, 1.1, 1.6]),
        on(&paper, 60e3, 8e-3, &[0.1, 0.4, 1.0, 2.0, 4.0]),
        on(&[(7.5e-3, 80e3)], 60e3, 3e-3, &[0.02, 0.08, 0.2, 0.5, 0.9]),
        on(&[(3e-3, 150e3)], 100e3, 3e-3, &[0.04, 0.15, 0.4, 0.9, 1.6]),
        on(&[], 30e3, 10e-3, &[0.05, 0.3, 1.0, 2.5, 5.0]),
        on(&[], 200e3, 4e-3, &[0.03, 0.2, 0.8, 2.0, 3.5]),
    ]
}
