//! Sensors with a gel that is lit in colours: calibration file and sensor file.
use crate::io::{
    FileError, beside, one_or_more, positive, read_bytes, read_colour_levels, read_toml,
};
use crate::sfs::{BallPress, PhotometricCalibration, PhotometricModel, PhotometricStereo};
use ndarray::Array3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Presses of balls on a gel that is lit in colours, as a calibration file names them.
///
/// ```toml
/// kind = "photometric"
/// reference = "reference.png"        # the gel without contact
/// pixel_size_m = 5.107e-5
///
/// [[presses]]
/// image = "0001.png"
/// ball_radius_m = 2.35e-3
/// circle_px = [76, 182, 38]          # x, y, radius: may be left out, it is found then
/// ```
///
/// ```no_run
/// use tactile_imaging::sensor::PhotometricPresses;
/// let presses = PhotometricPresses::read("calibration.toml")?;
/// let found = presses.calibrate()?;
/// for (name, circle) in presses.names.iter().zip(&found.circles).filter(|(_, c)| c.wrong) {
///     println!("{}: drawn {:?}, found {:?}", name.display(), circle.drawn_px, circle.found_px);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct PhotometricPresses {
    /// Path of the frame without contact.
    pub reference_path: PathBuf,
    /// Frame without contact, `[row, column, channel]`.
    pub reference: Array3<u8>,
    /// Size of a pixel on the gel in metres.
    pub pixel_size_m: f64,
    /// Images of the presses, as the file names them.
    pub names: Vec<PathBuf>,
    /// Frame, ball's radius in metres and drawn circle of each press.
    presses: Vec<(Array3<u8>, f64, Option<[f64; 3]>)>,
}

/// The word of `kind` in files of these sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    #[default]
    Photometric,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationFile {
    #[serde(rename = "kind")]
    _kind: Kind,
    reference: PathBuf,
    #[serde(deserialize_with = "positive")]
    pixel_size_m: f64,
    #[serde(deserialize_with = "one_or_more")]
    presses: Vec<PressTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PressTable {
    image: PathBuf,
    #[serde(deserialize_with = "positive")]
    ball_radius_m: f64,
    circle_px: Option<[f64; 3]>,
}

impl PhotometricPresses {
    /// Whether a calibration or sensor file is of this kind.
    pub fn names_kind(path: impl AsRef<Path>) -> bool {
        let text = read_bytes(path.as_ref()).unwrap_or_default();
        let table = String::from_utf8_lossy(&text).parse::<toml::Table>();
        table.is_ok_and(|table| {
            table
                .get("kind")
                .is_some_and(|k| k.as_str() == Some("photometric"))
        })
    }

    /// Reads a calibration file and its images.
    ///
    /// # Errors
    /// [`FileError`]: one sentence that names the file, the field and what was expected.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FileError> {
        Self::from_file(path.as_ref())
    }

    /// Not generic, so that the parser is compiled once, not again in every crate that reads.
    fn from_file(path: &Path) -> Result<Self, FileError> {
        let file: CalibrationFile = read_toml(path)?;
        let reference_path = beside(path, &file.reference);
        let reference = read_colour_levels(&reference_path)
            .map_err(|error| FileError::field(path, "reference", error))?;
        let mut names = Vec::new();
        let mut presses = Vec::new();
        for (k, press) in file.presses.into_iter().enumerate() {
            let field = format!("presses[{}].image", k + 1);
            let frame = read_colour_levels(beside(path, &press.image));
            let frame = frame.map_err(|error| FileError::field(path, &field, error))?;
            check_size(&frame, &reference)
                .map_err(|reason| FileError::field(path, &field, reason))?;
            presses.push((frame, press.ball_radius_m, press.circle_px));
            names.push(press.image);
        }
        Ok(Self {
            reference_path,
            reference,
            pixel_size_m: file.pixel_size_m,
            names,
            presses,
        })
    }

    /// Calibrates the sensor.
    ///
    /// # Errors
    /// Those of [`PhotometricStereo::calibrate`].
    pub fn calibrate(&self) -> Result<PhotometricCalibration, crate::sfs::SfsError> {
        let presses = self
            .presses
            .iter()
            .map(|(frame, radius, circle)| BallPress {
                frame: frame.view(),
                ball_radius_m: *radius,
                circle_px: *circle,
            });
        let presses: Vec<_> = presses.collect();
        PhotometricStereo::calibrate(self.reference.view(), self.pixel_size_m, &presses)
    }
}

fn check_size(frame: &Array3<u8>, reference: &Array3<u8>) -> Result<(), String> {
    if frame.dim() == reference.dim() {
        return Ok(());
    }
    let [(rows, columns, _), (high, wide, _)] = [frame.dim(), reference.dim()];
    Err(format!(
        "the image is {columns} × {rows} pixels, but the reference is {wide} × {high}"
    ))
}

/// The file of a calibrated sensor of this kind.
///
/// ```toml
/// kind = "photometric"
/// reference = "sensor_reference.png" # relative to this file
///
/// [model]                            # as the calibration found it
/// pixel_size_m = 5.107e-5
/// # …
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PhotometricSensor {
    kind: Kind,
    /// Frame without contact, relative to the sensor file.
    pub reference: PathBuf,
    /// Numbers of the calibration.
    pub model: PhotometricModel,
}

impl PhotometricSensor {
    /// A sensor file with this frame without contact, relative to the file.
    pub fn new(reference: impl Into<PathBuf>, model: PhotometricModel) -> Self {
        Self {
            kind: Kind::Photometric,
            reference: reference.into(),
            model,
        }
    }

    /// The file's text.
    ///
    /// # Errors
    /// Those of the TOML writer, for numbers that it cannot hold.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// Reads a sensor file and its frame without contact.
    ///
    /// # Errors
    /// [`FileError`]: one sentence that names the file, the field and what was expected.
    pub fn read(path: impl AsRef<Path>) -> Result<PhotometricStereo, FileError> {
        Self::from_file(path.as_ref())
    }

    /// Not generic, so that the parser is compiled once, not again in every crate that reads.
    fn from_file(path: &Path) -> Result<PhotometricStereo, FileError> {
        let file: Self = read_toml(path)?;
        let reference = read_colour_levels(beside(path, &file.reference));
        let reference = reference.map_err(|error| FileError::field(path, "reference", error))?;
        PhotometricStereo::new(file.model, reference.view())
            .map_err(|error| FileError::field(path, "model", error))
    }
}
