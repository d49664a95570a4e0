//! Scenes solved by another program.

use crate::shared::{self, number, table, text};
use std::error::Error;
use std::path::Path;
use tactile_fem::Interface;

pub(crate) struct SolvedScene {
    pub(crate) name: String,
    /// D, d, E₁, and height over width. `None` for a plain block.
    pub(crate) lump: Option<[f64; 4]>,
    pub(crate) block_modulus_pa: f64,
    pub(crate) height_m: f64,
    pub(crate) radius_m: f64,
    pub(crate) face_radius_m: f64,
    pub(crate) interface: Interface,
    pub(crate) approaches_m: Vec<f64>,
    pub(crate) forces_n: Vec<f64>,
    pub(crate) radii_m: Vec<f64>,
    pub(crate) pressures_pa: Vec<Vec<f64>>,
}

pub(crate) fn scenes(folder: &Path) -> Result<Vec<SolvedScene>, Box<dyn Error>> {
    let mut scenes = Vec::new();
    for row in table(&folder.join("scenes.csv"))? {
        let number = |name: &str| number(&row, name);
        let name = text(&row, "scene")?.to_owned();
        let loads = row.keys().filter(|c| c.starts_with("approach_")).count();
        let numbers = |prefix: &str, unit: &str| -> Result<Vec<f64>, Box<dyn Error>> {
            let names = (1..=loads).map(|load| format!("{prefix}_{load}_{unit}"));
            names
                .filter(|name| text(&row, name).is_ok_and(|text| !text.is_empty()))
                .map(|name| number(&name))
                .collect()
        };
        let approaches_m = numbers("approach", "m")?;
        let points = table(&folder.join(format!("{name}.csv")))?;
        let mut radii_m = Vec::new();
        let mut pressures_pa = vec![Vec::new(); approaches_m.len()];
        for point in points {
            let load: usize = text(&point, "load_index")?.parse()?;
            let radius = shared::number(&point, "r_m")?;
            if radius == 0.0 {
                // A ring has a positive area.
                continue;
            }
            if load == 1 {
                radii_m.push(radius);
            }
            pressures_pa[load - 1].push(shared::number(&point, "pressure_pa")?);
        }
        let diameter = number("D_m")?;
        // Folders of balls do not have this column.
        let aspect = number("aspect").unwrap_or(1.0);
        let lump = [diameter, number("depth_m")?, number("E1_pa")?, aspect];
        scenes.push(SolvedScene {
            lump: (diameter > 0.0).then_some(lump),
            block_modulus_pa: number("E0_pa")?,
            height_m: number("block_height_m")?,
            radius_m: number("block_radius_m")?,
            face_radius_m: number("disc_radius_m")?,
            interface: match text(&row, "contact")? {
                "bonded" => Interface::Bonded,
                _ => Interface::Frictionless,
            },
            approaches_m,
            forces_n: numbers("force", "n")?,
            radii_m,
            pressures_pa,
            name,
        });
    }
    Ok(scenes)
}
