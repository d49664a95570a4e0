//! A scene written as the files that the command line reads: images, calibration table and scene description.

use std::path::{Path, PathBuf};

use image::{ImageBuffer, Luma};
use ndarray::ArrayView2;
use toml::{Table, Value};

use super::calibration::CalibrationOptions;
use super::contact_law::ContactLaw;
use super::error::SimulateError;
use super::press::PressScene;

/// A scene could not be written.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::simulate::{CalibrationOptions, Camera, FolderError, PressOptions, PressScene, write_folder};
/// let camera = Camera::default().coarser(16);
/// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// let (file, few) = (tempfile::NamedTempFile::new()?, CalibrationOptions { steps: 1, ..Default::default() });
/// assert!(matches!(write_folder(&scene, &few, file.path()), Err(FolderError::Write { .. })), "not a folder");
/// let none = CalibrationOptions { steps: 0, ..few };
/// let error = write_folder(&scene, &none, file.path()).unwrap_err();
/// assert!(matches!(error, FolderError::Calibration(_)) && error.to_string().starts_with("steps is 0"));
/// # Ok(()) }
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FolderError {
    /// A file could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// An image could not be encoded.
    #[error("cannot write the image {}: {source}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// Why.
        source: image::ImageError,
    },
    /// The calibration's options have no meaning.
    #[error(transparent)]
    Calibration(#[from] SimulateError),
}

/// Writes `reference.png`, `frame_1.png` …, `calibration.csv` (columns `integrated_pixel_value,force_N`) and `scene.toml`
/// to `folder`, which is made if need be. Returns the path of `scene.toml`.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::scene::Scene;
/// use tactile_imaging::simulate::{CalibrationOptions, Camera, PressOptions, PressScene, write_folder};
/// let camera = Camera::default().coarser(16);
/// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// let folder = tempfile::tempdir()?;
/// let calibration = CalibrationOptions { steps: 4, ..CalibrationOptions::default() };
/// let path = write_folder(&scene, &calibration, folder.path())?;
/// let (read, data) = (Scene::read(&path)?, Scene::read(&path)?.load()?);
/// assert_eq!(read.frames[1].force_n, Some(1.2));
/// assert_eq!(data.frames[1], scene.frame(1, 0));
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FolderError`] naming the file that could not be written.
pub fn write_folder(
    scene: &PressScene,
    calibration: &CalibrationOptions,
    folder: &Path,
) -> Result<PathBuf, FolderError> {
    let series = scene.calibrate(calibration)?;
    std::fs::create_dir_all(folder).map_err(|source| FolderError::Write {
        path: folder.into(),
        source,
    })?;
    let made = scene.simulate();
    write_image(&folder.join("reference.png"), made.reference.view())?;
    for (k, frame) in made.frames.iter().enumerate() {
        write_image(&folder.join(format!("frame_{}.png", k + 1)), frame.view())?;
    }
    let mut table = String::from("integrated_pixel_value,force_N\n");
    for (value, force) in series.pairs() {
        table.push_str(&format!("{value},{force}\n"));
    }
    write_text(&folder.join("calibration.csv"), &table)?;
    let path = folder.join("scene.toml");
    write_text(&path, &description(scene).to_string())?;
    Ok(path)
}

fn write_text(path: &Path, text: &str) -> Result<(), FolderError> {
    std::fs::write(path, text).map_err(|source| FolderError::Write {
        path: path.into(),
        source,
    })
}

fn write_image(path: &Path, frame: ArrayView2<'_, u8>) -> Result<(), FolderError> {
    let (rows, cols) = frame.dim();
    let image = ImageBuffer::from_fn(cols as u32, rows as u32, |x, y| {
        Luma([frame[[y as usize, x as usize]]])
    });
    image.save(path).map_err(|source| FolderError::Image {
        path: path.into(),
        source,
    })
}

/// The scene's description as the command line reads it.
fn description(scene: &PressScene) -> Table {
    let options = scene.options();
    let size = Value::Array(options.camera.pixel_size_m.map(Value::Float).to_vec());
    let frame = |(k, load): (usize, &super::Load)| {
        let image = Value::String(format!("frame_{}.png", k + 1));
        Value::Table(table([
            ("image", image),
            ("force_N", Value::Float(load.force_n)),
        ]))
    };
    let object = table([
        ("shape", Value::String("sphere".to_owned())),
        ("radius_m", Value::Float(options.object.radius_m)),
        (
            "poisson_ratio",
            Value::Float(options.object.material.poisson_ratio),
        ),
    ]);
    let layers = Value::Array(options.waveguide.layers.iter().map(layer).collect());
    // A closed form is read by its own law; contacts from elsewhere by the default one.
    let estimator = match options.law {
        ContactLaw::Hertz | ContactLaw::Tatara => "sphere",
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
fn layer(l: &super::material::WaveguideLayer) -> Value {
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
