//! Sensors with a gel lit in colours: calibration file and sensor file.
use crate::io::{
    FileError, beside, length, one_or_more, positive, read_bytes, read_colour_levels, read_toml,
    write_bytes, write_colour_image,
};
use ndarray::Array3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use tactile_imaging::core::Estimate;
use tactile_imaging::gel::{
    BallPress, CalibrationReport, GaugeForce, GelError, GelForce, GelLaw, GelLayer, GelModel,
    GelSensor,
};

/// Presses of balls on a gel lit in colours, as named in a calibration file.
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
/// use tactile_files::sensor::PhotometricPresses;
/// let presses = PhotometricPresses::read("calibration.toml")?;
/// let (gel, found) = presses.calibrate()?;
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
    /// The gel layer, and frames under known weights.
    gel: Option<(GelLayer, Vec<KnownWeight>)>,
    /// Frames of one body, with the gauge reading of each in newtons.
    gauge: Vec<(Array3<u8>, f64)>,
    /// Frame, ball radius in metres and drawn circle of each press.
    presses: Vec<(Array3<u8>, f64, Option<[f64; 3]>)>,
}

/// A frame of a body under a weight, and the force of the weight in newtons.
type KnownWeight = (Array3<u8>, Estimate);

/// The value of `kind` in files of these sensors.
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
    gel: Option<GelTable>,
    #[serde(default)]
    gauge: Vec<GaugeTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GaugeTable {
    image: PathBuf,
    #[serde(rename = "force_N", deserialize_with = "positive")]
    force_n: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GelTable {
    #[serde(deserialize_with = "length")]
    thickness_m: f64,
    poisson_ratio: Option<f64>,
    youngs_modulus_pa: Option<f64>,
    youngs_modulus_error_pa: Option<f64>,
    #[serde(default)]
    weights: Vec<WeightTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WeightTable {
    image: PathBuf,
    #[serde(rename = "force_N", deserialize_with = "positive")]
    force_n: f64,
    #[serde(rename = "force_error_N", deserialize_with = "positive")]
    force_error_n: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PressTable {
    image: PathBuf,
    #[serde(deserialize_with = "length")]
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
        let reference = frame(path, "reference", &file.reference, None)?;
        let mut names = Vec::new();
        let mut presses = Vec::new();
        for (k, press) in file.presses.into_iter().enumerate() {
            let field = format!("presses[{}].image", k + 1);
            let frame = frame(path, &field, &press.image, Some(&reference))?;
            presses.push((frame, press.ball_radius_m, press.circle_px));
            names.push(press.image);
        }
        let gel = file.gel.map(|table| table.read(path, &reference));
        let mut gauge = Vec::new();
        for (k, reading) in file.gauge.into_iter().enumerate() {
            let field = format!("gauge[{}].image", k + 1);
            let frame = frame(path, &field, &reading.image, Some(&reference))?;
            gauge.push((frame, reading.force_n));
        }
        Ok(Self {
            gel: gel.transpose()?,
            gauge,
            reference_path,
            reference,
            pixel_size_m: file.pixel_size_m,
            names,
            presses,
        })
    }

    /// Calibrates the sensor and its forces. If weights are given, the modulus of the gel is chosen
    /// so that the sensor reads them correctly.
    ///
    /// # Errors
    /// The errors of [`GelSensor::calibrate`], and [`GelError::NoContact`] if a weight or a gauge
    /// reading shows no contact.
    pub fn calibrate(&self) -> Result<(CalibratedGel, CalibrationReport), GelError> {
        let presses = self
            .presses
            .iter()
            .map(|(frame, radius, circle)| BallPress {
                frame: frame.view(),
                ball_radius_m: *radius,
                circle_px: *circle,
            });
        let presses: Vec<_> = presses.collect();
        let (sensor, report) =
            GelSensor::calibrate(self.reference.view(), self.pixel_size_m, &presses)?;
        let layer = self.gel.as_ref().map(|(gel, weights)| {
            let weights: Vec<_> = weights.iter().map(|(f, n)| (f.view(), *n)).collect();
            match weights.is_empty() {
                true => Ok(*gel),
                false => gel.weighed(&sensor, &weights),
            }
        });
        let (layer, gauge) = (layer.transpose()?, gauge_force(&sensor, &self.gauge)?);
        Ok((
            CalibratedGel {
                sensor,
                layer,
                gauge,
            },
            report,
        ))
    }
}

/// The force law from gauge readings. `None` without readings.
fn gauge_force(
    sensor: &GelSensor,
    readings: &[(Array3<u8>, f64)],
) -> Result<Option<GaugeForce>, GelError> {
    if readings.is_empty() {
        return Ok(None);
    }
    let frames = readings
        .iter()
        .map(|(frame, force)| Ok((sensor.read(frame.view())?, *force)));
    let frames = frames.collect::<Result<Vec<_>, GelError>>()?;
    let pairs: Vec<_> = frames
        .iter()
        .map(|(frame, force)| (frame, *force))
        .collect();
    GaugeForce::fit(&pairs).map(Some)
}

/// A calibrated gel: its sensor and the source of its forces.
#[derive(Clone, Debug)]
pub struct CalibratedGel {
    /// The sensor.
    pub sensor: GelSensor,
    /// The gel layer, if known.
    pub layer: Option<GelLayer>,
    /// The force law from gauge readings, if there are any.
    pub gauge: Option<GaugeForce>,
}

impl CalibratedGel {
    /// The force law: that of the layer, else that of the gauge. `None` without both.
    ///
    /// # Errors
    /// The errors of [`GelForce::new`].
    pub fn law(&self) -> Result<Option<GelLaw>, GelError> {
        match (self.layer, self.gauge) {
            (Some(layer), _) => {
                let law = GelForce::new(&layer, &self.sensor)?;
                Ok(Some(GelLaw::Layer(Box::new(law))))
            }
            (None, gauge) => Ok(gauge.map(GelLaw::Gauge)),
        }
    }

    /// Writes a sensor file, and the frame without contact beside it as `NAME_reference.png`.
    ///
    /// # Errors
    /// [`FileError::Write`] and [`FileError::Image`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        let path = path.as_ref();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let reference = format!("{stem}_reference.png");
        write_colour_image(path.with_file_name(&reference), self.sensor.reference())?;
        let text = PhotometricSensor::of(reference, self)
            .to_toml()
            .map_err(|error| FileError::field(path, "model", error))?;
        write_bytes(path, text.as_bytes())
    }
}

impl GelTable {
    fn read(
        self,
        path: &Path,
        reference: &Array3<u8>,
    ) -> Result<(GelLayer, Vec<KnownWeight>), FileError> {
        let mut weights = Vec::new();
        for (k, weight) in self.weights.into_iter().enumerate() {
            let field = format!("gel.weights[{}].image", k + 1);
            let frame = frame(path, &field, &weight.image, Some(reference))?;
            weights.push((frame, Estimate::new(weight.force_n, weight.force_error_n)));
        }
        let modulus = match (self.youngs_modulus_pa, self.youngs_modulus_error_pa) {
            (Some(value), Some(error)) if weights.is_empty() => [value, error],
            (None, None) if !weights.is_empty() => [1.0, 0.0],
            _ => {
                let wanted = "expected youngs_modulus_pa with youngs_modulus_error_pa, or weights";
                return Err(FileError::field(path, "gel", wanted));
            }
        };
        let ratio = self
            .poisson_ratio
            .unwrap_or(GelLayer::DEFAULT_POISSON_RATIO);
        let gel = GelLayer::new(self.thickness_m, ratio, modulus);
        check(&gel, path)?;
        Ok((gel, weights))
    }
}

/// The gel layer on its rigid plate, table `[gel]` of the files.
fn check(gel: &GelLayer, path: &Path) -> Result<(), FileError> {
    let error = gel.youngs_modulus_error_pa;
    if !(error >= 0.0 && error.is_finite()) {
        let wanted = "expected a number of 0 or more";
        return Err(FileError::field(
            path,
            "gel.youngs_modulus_error_pa",
            wanted,
        ));
    }
    let guide = gel.guide().map(|_| ());
    guide.map_err(|error| FileError::field(path, "gel", error))
}

/// The colour image that a field of `file` names. It must have the size of the reference.
fn frame(
    file: &Path,
    field: &str,
    name: &Path,
    reference: Option<&Array3<u8>>,
) -> Result<Array3<u8>, FileError> {
    let frame = read_colour_levels(beside(file, name));
    let frame = frame.map_err(|error| FileError::field(file, field, error))?;
    let [(rows, columns, _), (high, wide, _)] =
        [&frame, reference.unwrap_or(&frame)].map(Array3::dim);
    if (rows, columns) == (high, wide) {
        return Ok(frame);
    }
    let reason =
        format!("the image is {columns} × {rows} pixels, but the reference is {wide} × {high}");
    Err(FileError::field(file, field, reason))
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
    /// The fitted model.
    pub model: GelModel,
    /// The gel layer, for forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gel: Option<GelLayer>,
    /// The force law from gauge readings, for a gel without a known layer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gauge: Option<GaugeForce>,
}

impl PhotometricSensor {
    /// The sensor file of a calibrated gel. `reference` is the frame without contact, relative to
    /// the file.
    pub fn of(reference: impl Into<PathBuf>, gel: &CalibratedGel) -> Self {
        Self {
            kind: Kind::Photometric,
            reference: reference.into(),
            model: gel.sensor.model().clone(),
            gel: gel.layer,
            gauge: gel.gauge,
        }
    }

    /// The text of the file.
    ///
    /// # Errors
    /// The errors of the TOML writer, for numbers that it cannot represent.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// Reads a sensor file and its frame without contact.
    ///
    /// # Errors
    /// [`FileError`]: one sentence that names the file, the field and what was expected.
    pub fn read(path: impl AsRef<Path>) -> Result<CalibratedGel, FileError> {
        Self::from_file(path.as_ref())
    }

    /// Not generic, so that the parser is compiled once, not again in every crate that reads.
    fn from_file(path: &Path) -> Result<CalibratedGel, FileError> {
        let file: Self = read_toml(path)?;
        if let Some(gel) = &file.gel {
            check(gel, path)?;
        }
        let reference = frame(path, "reference", &file.reference, None)?;
        let stereo = GelSensor::new(file.model, reference.view());
        let stereo = stereo.map_err(|error| FileError::field(path, "model", error))?;
        Ok(CalibratedGel {
            sensor: stereo,
            layer: file.gel,
            gauge: file.gauge,
        })
    }
}
