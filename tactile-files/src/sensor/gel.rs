//! Gel sensors, lit in colours or darkening: calibration file and sensor file.
use crate::io::{
    FileError, Grey, beside, length, positive, read_bytes, read_colour_levels, read_columns,
    read_grey_image, read_toml, write_bytes, write_colour_image, write_grey_image,
};
use crate::scene::doubt_of_depths;
use ndarray::{Array2, Array3};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use tactile_imaging::core::Estimate;
use tactile_imaging::gel::{
    BallPress, CalibrationReport, ColourModel, DarkModel, GaugeForce, GelError, GelForce, GelImage,
    GelLaw, GelLayer, GelModel, GelSensor,
};

/// Presses of balls on a gel, as named in a calibration file.
///
/// ```toml
/// kind = "photometric"               # lit in colours, or "darkening"
/// reference = "reference.png"        # the gel without contact
/// pixel_size_m = 5.107e-5
///
/// [[presses]]
/// image = "0001.png"
/// ball_radius_m = 2.35e-3
/// circle_px = [76, 182, 38]          # x, y, radius: may be left out, it is found then
/// ```
///
/// A gel that darkens may have a table of darkness and depth instead of presses, and the conversion
/// of colours to grey that the table was made with:
///
/// ```toml
/// kind = "darkening"
/// reference = "reference.png"
/// pixel_size_m = 1e-4
/// grey = "mean"                      # "rec601" if left out, or "rec709"
/// table = "depth_table.csv"          # columns darkness_grey_levels, depth_mm
/// ```
///
/// ```no_run
/// use tactile_files::sensor::GelPresses;
/// let presses = GelPresses::read("calibration.toml")?;
/// let (gel, found) = presses.calibrate()?;
/// let circles = found.iter().flat_map(|report| &report.circles);
/// for (name, circle) in presses.names.iter().zip(circles).filter(|(_, c)| c.wrong) {
///     println!("{}: drawn {:?}, found {:?}", name.display(), circle.drawn_px, circle.found_px);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GelPresses {
    /// Path of the frame without contact.
    pub reference_path: PathBuf,
    /// Frame without contact.
    pub reference: GelPixels,
    /// Conversion of colours to grey, for a gel that darkens.
    pub grey: Grey,
    /// Size of a pixel on the gel in metres.
    pub pixel_size_m: f64,
    /// Images of the presses, as the file names them.
    pub names: Vec<PathBuf>,
    /// The gel layer, and frames under known weights.
    gel: Option<(GelLayer, Vec<KnownWeight>)>,
    /// Frames of one body, with the gauge reading of each in newtons.
    gauge: Vec<(GelPixels, f64)>,
    /// Frame, ball radius in metres and drawn circle of each press.
    presses: Vec<(GelPixels, f64, Option<[f64; 3]>)>,
    /// Darkness in grey levels and depth in metres, instead of presses.
    table: Option<Vec<[f64; 2]>>,
}

/// A frame of a body under a weight, and the force of the weight in newtons.
type KnownWeight = (GelPixels, Estimate);

/// Levels of a gel's frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum GelPixels {
    /// Grey levels, of a gel that darkens.
    Grey(Array2<u8>),
    /// Red, green and blue, `[row, column, channel]`.
    Colour(Array3<u8>),
}

impl GelPixels {
    /// The levels for [`GelSensor`].
    pub fn view(&self) -> GelImage<'_> {
        match self {
            Self::Grey(levels) => levels.into(),
            Self::Colour(levels) => levels.into(),
        }
    }
}

/// The value of `kind` in the files of these sensors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Photometric,
    Darkening,
}

impl Kind {
    /// The kind of a calibration or sensor file. `None` if it belongs to another sensor.
    fn of(path: &Path) -> Option<Self> {
        let text = read_bytes(path).unwrap_or_default();
        let table = String::from_utf8_lossy(&text).parse::<toml::Table>().ok()?;
        match table.get("kind")?.as_str()? {
            "photometric" => Some(Self::Photometric),
            "darkening" => Some(Self::Darkening),
            _ => None,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationFile {
    kind: Kind,
    reference: PathBuf,
    grey: Option<Grey>,
    #[serde(deserialize_with = "positive")]
    pixel_size_m: f64,
    #[serde(default)]
    presses: Vec<PressTable>,
    table: Option<PathBuf>,
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

impl GelPresses {
    /// Whether a calibration or sensor file is that of a gel.
    pub fn names_kind(path: impl AsRef<Path>) -> bool {
        Kind::of(path.as_ref()).is_some()
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
        let images = Images::of(path, file.kind, file.grey)?;
        let reference_path = beside(path, &file.reference);
        let reference = images.read("reference", &file.reference, None)?;
        let frame = |field: String, name: &Path| images.read(&field, name, Some(&reference));
        let table = file.table.map(|table| read_table(path, file.kind, &table));
        let table = table.transpose()?;
        if table.is_some() != file.presses.is_empty() {
            let wanted = "expected one or more presses, or a table for a gel that darkens";
            return Err(FileError::field(path, "presses", wanted));
        }
        let mut names = Vec::new();
        let mut presses = Vec::new();
        for (k, press) in file.presses.into_iter().enumerate() {
            let frame = frame(format!("presses[{}].image", k + 1), &press.image)?;
            presses.push((frame, press.ball_radius_m, press.circle_px));
            names.push(press.image);
        }
        let gel = file.gel.map(|table| table.read(path, &frame));
        let mut gauge = Vec::new();
        for (k, reading) in file.gauge.into_iter().enumerate() {
            let frame = frame(format!("gauge[{}].image", k + 1), &reading.image)?;
            gauge.push((frame, reading.force_n));
        }
        Ok(Self {
            gel: gel.transpose()?,
            gauge,
            reference_path,
            grey: images.grey,
            reference,
            pixel_size_m: file.pixel_size_m,
            names,
            presses,
            table,
        })
    }

    /// Calibrates the sensor and its forces. If weights are given, they determine the modulus of the
    /// gel. A sensor made from a table has no report.
    ///
    /// # Errors
    /// The errors of [`GelSensor::calibrate`], and [`GelError::NoContact`] for a weight or a gauge
    /// reading without contact.
    pub fn calibrate(&self) -> Result<(CalibratedGel, Option<CalibrationReport>), GelError> {
        let presses = self
            .presses
            .iter()
            .map(|(frame, radius, circle)| BallPress {
                circle_px: *circle,
                ..BallPress::new(frame.view(), *radius)
            });
        let presses: Vec<_> = presses.collect();
        let reference = self.reference.view();
        let (sensor, report) = match &self.table {
            Some(table) => {
                let model = DarkModel::new(self.pixel_size_m, table.clone());
                (GelSensor::new(model, reference)?, None)
            }
            None => {
                let (sensor, report) =
                    GelSensor::calibrate(reference, self.pixel_size_m, &presses)?;
                (sensor, Some(report))
            }
        };
        let layer = self.gel.as_ref().map(|(gel, weights)| {
            let weights: Vec<_> = weights.iter().map(|(f, n)| (f.view(), *n)).collect();
            match weights.is_empty() {
                true => Ok(*gel),
                false => gel.weighed(&sensor, &weights),
            }
        });
        let (layer, gauge) = (layer.transpose()?, gauge_force(&sensor, &self.gauge)?);
        let gel = CalibratedGel {
            sensor,
            grey: self.grey,
            layer,
            gauge,
        };
        Ok((gel, report))
    }
}

/// The force law from gauge readings. `None` without readings.
fn gauge_force(
    sensor: &GelSensor,
    readings: &[(GelPixels, f64)],
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
    /// Conversion of colours to grey, for a gel that darkens.
    pub grey: Grey,
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
        let image = path.with_file_name(&reference);
        match self.sensor.reference() {
            GelImage::Colour(levels) => write_colour_image(image, levels)?,
            GelImage::Grey(levels) => write_grey_image(image, levels)?,
        }
        let text = GelFile::of(reference, self)
            .to_toml()
            .map_err(|error| FileError::field(path, "model", error))?;
        write_bytes(path, text.as_bytes())
    }
}

impl GelTable {
    fn read(
        self,
        path: &Path,
        frame: &dyn Fn(String, &Path) -> Result<GelPixels, FileError>,
    ) -> Result<(GelLayer, Vec<KnownWeight>), FileError> {
        let mut weights = Vec::new();
        for (k, weight) in self.weights.into_iter().enumerate() {
            let frame = frame(format!("gel.weights[{}].image", k + 1), &weight.image)?;
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

/// The table of a gel that darkens: darkness in grey levels and depth in metres.
fn read_table(file: &Path, kind: Kind, name: &Path) -> Result<Vec<[f64; 2]>, FileError> {
    let in_field = |reason: String| FileError::field(file, "table", reason);
    if kind != Kind::Darkening {
        let reason = "a table is for a gel that darkens, kind = \"darkening\"";
        return Err(in_field(reason.to_owned()));
    }
    let columns = [(&["darkness"][..], "grey_levels"), (&["depth"], "mm")];
    let [darkness, depth] = read_columns(beside(file, name), columns)?;
    let rows: Vec<_> = darkness.into_iter().zip(depth).collect();
    match doubt_of_depths(&rows) {
        Some(reason) => Err(in_field(reason)),
        None => Ok(rows.into_iter().map(<[f64; 2]>::from).collect()),
    }
}

/// How the images that a file names are read.
struct Images<'a> {
    file: &'a Path,
    kind: Kind,
    grey: Grey,
}

impl<'a> Images<'a> {
    fn of(file: &'a Path, kind: Kind, grey: Option<Grey>) -> Result<Self, FileError> {
        if kind == Kind::Photometric && grey.is_some() {
            let reason = "expected none: a gel lit in colours is read in colours";
            return Err(FileError::field(file, "grey", reason));
        }
        let grey = grey.unwrap_or_default();
        Ok(Self { file, kind, grey })
    }

    /// The image that a field names, of the size of the reference.
    fn read(
        &self,
        field: &str,
        name: &Path,
        reference: Option<&GelPixels>,
    ) -> Result<GelPixels, FileError> {
        let path = beside(self.file, name);
        let image = match self.kind {
            Kind::Photometric => read_colour_levels(path).map(GelPixels::Colour),
            Kind::Darkening => {
                let image = read_grey_image(path, self.grey, None);
                image.map(|image| GelPixels::Grey(image.to_u8()))
            }
        };
        let image = image.map_err(|error| FileError::field(self.file, field, error))?;
        let [(rows, columns), (high, wide)] =
            [&image, reference.unwrap_or(&image)].map(|image| image.view().dim());
        if (rows, columns) == (high, wide) {
            return Ok(image);
        }
        let reason =
            format!("the image is {columns} × {rows} pixels, but the reference is {wide} × {high}");
        Err(FileError::field(self.file, field, reason))
    }
}

/// The file of a calibrated gel sensor.
///
/// ```toml
/// kind = "photometric"               # or "darkening"
/// reference = "sensor_reference.png" # relative to this file
///
/// [model]                            # as the calibration found it
/// pixel_size_m = 5.107e-5
/// # …
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct GelFile {
    kind: Kind,
    /// Frame without contact, relative to the sensor file.
    pub reference: PathBuf,
    /// Conversion of colours to grey, for a gel that darkens.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grey: Option<Grey>,
    /// Parameters of the sensor.
    pub model: GelModel,
    /// Layer of the gel, for forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gel: Option<GelLayer>,
    /// Law of a gauge's readings, for forces without a layer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gauge: Option<GaugeForce>,
}

/// A sensor file as it is read: the model depends on the kind.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredFile<M> {
    kind: Kind,
    reference: PathBuf,
    grey: Option<Grey>,
    model: M,
    gel: Option<GelLayer>,
    gauge: Option<GaugeForce>,
}

impl GelFile {
    /// The sensor file of a calibrated gel. `reference` is the frame without contact, relative to
    /// the file.
    pub fn of(reference: impl Into<PathBuf>, gel: &CalibratedGel) -> Self {
        let model = gel.sensor.model().clone();
        let (kind, grey) = match model {
            GelModel::Dark(_) => (Kind::Darkening, Some(gel.grey)),
            _ => (Kind::Photometric, None),
        };
        Self {
            kind,
            reference: reference.into(),
            grey,
            model,
            gel: gel.layer,
            gauge: gel.gauge,
        }
    }

    /// The text of the file.
    ///
    /// # Errors
    /// The errors of the TOML writer, for numbers that TOML does not represent.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// Reads a sensor file and its frame without contact.
    ///
    /// # Errors
    /// [`FileError`]: one sentence that names the file, the field and what was expected.
    pub fn read(path: impl AsRef<Path>) -> Result<CalibratedGel, FileError> {
        let path = path.as_ref();
        match Kind::of(path) {
            Some(Kind::Darkening) => opened(path, read_toml::<StoredFile<DarkModel>>(path)?),
            _ => opened(path, read_toml::<StoredFile<ColourModel>>(path)?),
        }
    }
}

fn opened<M: Into<GelModel>>(path: &Path, file: StoredFile<M>) -> Result<CalibratedGel, FileError> {
    if let Some(gel) = &file.gel {
        check(gel, path)?;
    }
    let images = Images::of(path, file.kind, file.grey)?;
    let reference = images.read("reference", &file.reference, None)?;
    let sensor = GelSensor::new(file.model, reference.view());
    let sensor = sensor.map_err(|error| FileError::field(path, "model", error))?;
    Ok(CalibratedGel {
        sensor,
        grey: images.grey,
        layer: file.gel,
        gauge: file.gauge,
    })
}
