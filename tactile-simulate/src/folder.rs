//! Writes a scene as files for the command line: images, calibration table and scene description.

use crate::calibration::CalibrationSeries;
use crate::contact::ContactModel;
use crate::press::PressScene;
use std::path::{Path, PathBuf};
use tactile_files::io::{FileError, write_bytes, write_grey_image};
use toml::{Table, Value};

/// Writes a scene and a calibration of its sensor as files: `reference.png`, `frame_1.png` …,
/// `calibration.csv` (columns `integrated_pixel_value,force_N`) and `scene.toml` in `folder`, which
/// is created if necessary. Returns the path of `scene.toml`.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::scene::Scene;
/// use tactile_simulate::{CalibrationRun, Camera, PressOptions, PressScene, write_folder};
/// let camera = Camera::default().coarser(16);
/// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// let folder = tempfile::tempdir()?;
/// let calibration = scene.calibrate(&CalibrationRun { steps: 4, ..CalibrationRun::default() })?;
/// let path = write_folder(&scene, &calibration, folder.path())?;
/// let (read, data) = (Scene::read(&path)?, Scene::read(&path)?.load()?);
/// assert_eq!(read.frames[1].force_n, Some(1.2));
/// assert_eq!(data.frames[1], scene.frame(1, 0));
/// # Ok(()) }
/// ```
///
/// [`FileError::Write`] and [`FileError::Image`], with the name of the file that could not be
/// written.
/// [`FileError::Write`] and [`FileError::Image`], naming the file that could not be written.
pub fn write_folder(
    scene: &PressScene,
    calibration: &CalibrationSeries,
    folder: &Path,
) -> Result<PathBuf, FileError> {
    let made = scene.simulate();
    write_grey_image(folder.join("reference.png"), made.reference.view())?;
    for (k, frame) in made.frames.iter().enumerate() {
        write_grey_image(folder.join(format!("frame_{}.png", k + 1)), frame.view())?;
    }
    let mut table = String::from("integrated_pixel_value,force_N\n");
    for pair in &calibration.pairs {
        table.push_str(&format!(
            "{},{}\n",
            pair.integrated_pixel_value, pair.force_n
        ));
    }
    write_bytes(&folder.join("calibration.csv"), table.as_bytes())?;
    let path = folder.join("scene.toml");
    write_bytes(&path, description(scene).to_string().as_bytes())?;
    Ok(path)
}

/// The scene description in the format of the command line.
fn description(scene: &PressScene) -> Table {
    let options = scene.options();
    let size = Value::Array(options.camera.pixel_size_m.map(Value::Float).to_vec());
    let frame = |(k, load): (usize, &crate::PressLoad)| {
        let image = Value::String(format!("frame_{}.png", k + 1));
        Value::Table(table([
            ("image", image),
            ("force_N", Value::Float(load.force_n)),
        ]))
    };
    // The modulus of the object is omitted, because a measurement of the folder should find it.
    let object = table([
        ("shape", Value::String("sphere".to_owned())),
        ("radius_m", Value::Float(options.object.radius_m)),
        (
            "poisson_ratio",
            Value::Float(options.object.material.poisson_ratio),
        ),
    ]);
    let layers = Value::Array(options.waveguide.layers.iter().map(layer).collect());
    // Contacts by a closed form are evaluated with the same law, tabulated contacts with the
    // default one.
    let estimator = match options.law {
        ContactModel::Hertz | ContactModel::Tatara => "sphere",
        _ => "best",
    };
    let stages = table([("estimator", Value::String(estimator.to_owned()))]);
    table([
        ("reference", Value::String("reference.png".to_owned())),
        ("pixel_size_m", size),
        (
            "calibration",
            Value::Table(table([(
                "pairs",
                Value::String("calibration.csv".to_owned()),
            )])),
        ),
        (
            "frames",
            Value::Array(options.loads.iter().enumerate().map(frame).collect()),
        ),
        ("object", Value::Table(object)),
        ("waveguide", Value::Table(table([("layers", layers)]))),
        ("stages", Value::Table(stages)),
    ])
}

fn table<const N: usize>(entries: [(&str, Value); N]) -> Table {
    entries
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value))
        .collect()
}

/// A layer of the waveguide.
fn layer(l: &crate::materials::WaveguideLayer) -> Value {
    Value::Table(table([
        ("refractive_index", Value::Float(l.refractive_index)),
        ("thickness_m", Value::Float(l.thickness_m)),
        (
            "youngs_modulus_pa",
            Value::Float(l.material.youngs_modulus_pa),
        ),
        ("poisson_ratio", Value::Float(l.material.poisson_ratio)),
    ]))
}
