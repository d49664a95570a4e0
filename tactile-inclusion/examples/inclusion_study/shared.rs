//! Code used by both studies: files of solved scenes, the guide, and smooth errors.

use rand::{RngExt, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use std::collections::HashMap;
use std::error::Error;
use std::path::Path;
use tactile_fem::{Guide, GuideLayer, Material};

/// A row of a file, by the names of its columns.
pub(crate) type Row = HashMap<String, String>;

pub(crate) fn table(path: &Path) -> Result<Vec<Row>, Box<dyn Error>> {
    let text = std::fs::read_to_string(path)?;
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().ok_or("an empty file")?.split(',').collect();
    let row = |line: &str| {
        let cells = names.iter().zip(line.split(','));
        cells
            .map(|(name, cell)| ((*name).to_owned(), cell.to_owned()))
            .collect()
    };
    Ok(lines.map(row).collect())
}

pub(crate) fn text<'a>(row: &'a Row, name: &str) -> Result<&'a str, Box<dyn Error>> {
    let text = row.get(name).ok_or_else(|| format!("no column {name}"))?;
    Ok(text)
}

pub(crate) fn number(row: &Row, name: &str) -> Result<f64, Box<dyn Error>> {
    Ok(text(row, name)?.parse()?)
}

/// The guide of the sensor in all scenes.
pub(crate) fn guide(radius_m: f64) -> Result<Guide, Box<dyn Error>> {
    let layer = |thickness_m, modulus| -> Result<GuideLayer, Box<dyn Error>> {
        Ok(GuideLayer {
            thickness_m,
            material: Material::new(modulus, 0.495)?,
        })
    };
    let layers = vec![layer(2e-3, 136e3)?, layer(3e-3, 80e3)?, layer(5e-3, 34e3)?];
    Ok(Guide::new(layers, radius_m)?)
}

pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

/// Wave vector and phase of one of the waves whose sum is a smooth random field in the plane with
/// Matérn's kernel of order 3/2. Wave vectors follow the spectrum of the kernel, which is Student's
/// t with three degrees of freedom.
pub(crate) fn wave(length_m: f64, rng: &mut ChaCha8Rng) -> ([f64; 2], f64) {
    let chi_squared: f64 = (0..3).map(|_| normal(rng).powi(2)).sum();
    let scale = (3.0 / chi_squared).sqrt() / length_m;
    let vector = [scale * normal(rng), scale * normal(rng)];
    (vector, core::f64::consts::TAU * rng.random::<f64>())
}
