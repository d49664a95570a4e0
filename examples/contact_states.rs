//! The contact states that the simulator's finite-element scene draws from, as the CSV file `src/simulate/finite_elements.csv`.
//!
//! ```console
//! cargo run --release --features fem,simulate --example contact_states > src/simulate/finite_elements.csv
//! ```
//!
//! Balls of the paper's two polymers on its waveguide, neo-Hookean, without friction. ν = ½ is computed as 0.4999.
use std::io::{Result, Write, stdout};
use tactile_imaging::elasticity::fem::{Guide, Layer, Load, Material, Scene};
use tactile_imaging::simulate::{Elastic, Waveguide};

const RADIUS_M: f64 = 3e-3;
/// Wide enough that its rim is not felt.
const GUIDE_RADIUS_M: f64 = 30e-3;
const FORCES_N: [f64; 11] = [0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.7, 0.85, 1.0, 1.2, 1.3];
/// Nodes beyond this part of the contact radius are left out: the element at the rim is only partly in contact.
const INNER: f64 = 0.97;

fn main() -> Result<()> {
    let mut out = stdout().lock();
    writeln!(
        out,
        "youngs_modulus_pa,force_n,contact_radius_m,indentation_m,radius_m,pressure_pa,height_m"
    )?;
    for polymer in [Elastic::CL2000X, Elastic::CL2003X] {
        let scene = scene(polymer).map_err(std::io::Error::other)?;
        let solution = scene.solve(&FORCES_N.map(Load::Force));
        for state in &solution.states {
            let Some(contact) = state.contact_radius() else {
                continue;
            };
            let a = contact.radius_m;
            // Heights count from the guide's undeformed surface, which the glass has carried up by the approach.
            let inside = state.pressure().iter().filter(|p| p.r_m < INNER * a);
            let mut rows: Vec<[f64; 3]> = inside
                .map(|p| [p.r_m, p.pressure_pa, p.z_m - state.approach_m()])
                .collect();
            let rim = rows.last().map_or(0.0, |row| row[2]);
            rows.push([a, 0.0, rim]);
            for [r, p, z] in rows {
                writeln!(
                    out,
                    "{},{:.4},{a:.5e},{:.5e},{r:.4e},{p:.4e},{z:.4e}",
                    polymer.youngs_modulus_pa,
                    state.force_n(),
                    state.approach_m()
                )?;
            }
        }
    }
    Ok(())
}

fn scene(
    polymer: Elastic,
) -> std::result::Result<Scene, tactile_imaging::elasticity::ElasticityError> {
    let material = |e: Elastic| Material::new(e.youngs_modulus_pa, e.poisson_ratio.min(0.4999));
    let waveguide = Waveguide::default();
    let layers: std::result::Result<Vec<_>, _> = (waveguide.layers.iter())
        .map(|l| {
            material(l.material).map(|material| Layer {
                thickness_m: l.thickness_m,
                material,
            })
        })
        .collect();
    let guide = Guide::new(layers?, GUIDE_RADIUS_M)?;
    Scene::ball_on_guide(RADIUS_M, material(polymer)?, &guide)
}
