//! Scenes solved by another program.

use std::error::Error;
use std::path::Path;
use tactile_fem::Interface;

pub(crate) struct SolvedScene {
    pub(crate) name: String,
    /// D, d, E₁, and height over width; `None` for a plain block.
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

/// A CSV file.
struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

fn table(path: &Path) -> Result<Table, Box<dyn Error>> {
    let text = std::fs::read_to_string(path)?;
    let mut lines = text
        .lines()
        .map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let header = lines.next().ok_or("an empty file")?;
    Ok(Table {
        header,
        rows: lines.collect(),
    })
}

pub(crate) fn scenes(folder: &Path) -> Result<Vec<SolvedScene>, Box<dyn Error>> {
    let Table { header, rows } = table(&folder.join("scenes.csv"))?;
    let mut scenes = Vec::new();
    for row in rows {
        let text = |name: &str| -> Result<&str, String> {
            let column = header.iter().position(|column| column == name);
            let found = column.and_then(|column| row.get(column));
            found.map(String::as_str).ok_or(format!("no column {name}"))
        };
        let number =
            |name: &str| -> Result<f64, Box<dyn Error>> { Ok(text(name)?.parse::<f64>()?) };
        let name = text("scene")?.to_owned();
        let loads = header.iter().filter(|c| c.starts_with("approach_")).count();
        let numbers = |prefix: &str, unit: &str| -> Result<Vec<f64>, Box<dyn Error>> {
            let names = (1..=loads).map(|load| format!("{prefix}_{load}_{unit}"));
            names
                .filter(|name| text(name).is_ok_and(|text| !text.is_empty()))
                .map(|name| number(&name))
                .collect()
        };
        let approaches_m = numbers("approach", "m")?;
        let points = table(&folder.join(format!("{name}.csv")))?.rows;
        let mut radii_m = Vec::new();
        let mut pressures_pa = vec![Vec::new(); approaches_m.len()];
        for point in points {
            let (load, radius): (usize, f64) = (point[0].parse()?, point[1].parse()?);
            if radius == 0.0 {
                // A ring has an area.
                continue;
            }
            if load == 1 {
                radii_m.push(radius);
            }
            pressures_pa[load - 1].push(point[2].parse()?);
        }
        let diameter = number("D_m")?;
        // Folders of balls do without that column.
        let aspect = number("aspect").unwrap_or(1.0);
        let lump = [diameter, number("depth_m")?, number("E1_pa")?, aspect];
        scenes.push(SolvedScene {
            lump: (diameter > 0.0).then_some(lump),
            block_modulus_pa: number("E0_pa")?,
            height_m: number("block_height_m")?,
            radius_m: number("block_radius_m")?,
            face_radius_m: number("disc_radius_m")?,
            interface: match text("contact")? {
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
