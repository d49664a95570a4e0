//! The sensor and its file.
use crate::io::{FileError, finite, not_negative, read_toml, write_bytes};
use crate::scene::{SceneLayer, guide};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::path::Path;
use tactile_imaging::core::Source;
use tactile_imaging::elasticity::contact::Waveguide;
use tactile_imaging::force::{
    ContactOptions, DriftCorrection, ForceOptions, LensGeometry, NoiseModel, PressureCurve,
    ShearCalibration,
};
use tactile_imaging::pipeline::{LightContact, Object, Pipeline, PipelineError, ReferenceLight};

/// The map from pixels to metres, with its errors.
///
/// ```no_run
/// use tactile_files::sensor::{Sensor, SensorGeometry};
/// let SensorGeometry { lens, covariance, .. } = Sensor::read("sensor.toml")?.geometry;
/// println!("a pixel is {} ± {} m wide", lens.pixel_size_m()[0], covariance[0][0].sqrt());
/// # Ok::<(), tactile_files::io::FileError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorGeometry {
    /// Number of columns and rows of the frame.
    pub frame_px: [usize; 2],
    /// Covariance of the lens parameters [h_x, h_y, k₁, k₂].
    pub covariance: [[f64; 4]; 4],
    /// Relative standard error of the size of the target.
    #[serde(deserialize_with = "not_negative")]
    pub target_error: f64,
    /// The map from pixels to metres.
    pub lens: LensGeometry,
}

impl SensorGeometry {
    /// Relative standard error that all lengths share. It combines the errors of √(h_x h_y), of the
    /// distortion at half the frame's diagonal (ρ² = ¼) and of the target.
    pub fn length_scale_error(&self) -> f64 {
        let [hx, hy] = self.lens.pixel_size_m();
        // ln √(h_x h_y (1 + 4 k₁ρ² + 6 k₂ρ⁴)) to first order, at ρ² = ¼.
        let slopes = [0.5 / hx, 0.5 / hy, 0.5, 0.1875];
        let mut variance = self.target_error * self.target_error;
        for (i, row) in self.covariance.iter().enumerate() {
            for (j, c) in row.iter().enumerate() {
                variance += slopes[i] * c * slopes[j];
            }
        }
        variance.max(0.0).sqrt()
    }
}

/// A calibrated sensor.
///
/// ```no_run
/// use tactile_imaging::force::{ForceOptions, LocalCalibration, Source};
/// use tactile_files::sensor::Sensor;
/// use tactile_imaging::pipeline::{Object, Pipeline};
/// let sensor = Sensor::read("sensor.toml")?;
/// let ball = Object::sphere(3e-3);
/// let pipeline = sensor
///     .pipeline(ball)?
///     .with_settings(|s| s.assumptions.state(Source::ObjectSize, 5e-6 / 3e-3))?;
/// // Its parts, for a pipeline that is assembled by hand.
/// let (contact, guide) = (sensor.contact(&ForceOptions::default())?, sensor.waveguide()?);
/// let by_hand = Pipeline::new(contact, ball)?.with_settings(|s| s.waveguide = Some(guide))?;
/// println!("100 grey levels are {} Pa", sensor.curve.pressure_pa(100.0));
/// sensor.write("copy.toml")?;
/// # let _ = (pipeline, by_hand);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// The error for an unusable file is one sentence:
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::sensor::Sensor;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("sensor.toml");
/// std::fs::write(&path, "date = \"2026-11-22\"\nflat_field = 3\n")?;
/// let error = Sensor::read(&path).unwrap_err().to_string();
/// assert!(error.contains("sensor.toml: field `flat_field`: invalid type: integer `3`, expected"));
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Date of the calibration, as the user writes it.
    pub date: String,
    /// Temperature during the calibration, in degrees Celsius.
    #[serde(
        default,
        deserialize_with = "finite",
        skip_serializing_if = "Option::is_none"
    )]
    pub temperature_c: Option<f64>,
    /// Whether frames are divided by the reference's own brightness, which corrects vignetting.
    pub flat_field: bool,
    /// Relative standard error of the gauge, common to all forces.
    #[serde(deserialize_with = "not_negative")]
    pub gauge_error: f64,
    /// Relative standard error of the light that an object couples, compared with the calibrator.
    /// Zero under a fixed diffusing skin. If `None`, the value of
    /// [`Assumption::ALL`](tactile_imaging::pipeline::Assumption::ALL) is assumed.
    #[serde(
        default,
        deserialize_with = "not_negative",
        skip_serializing_if = "Option::is_none"
    )]
    pub coupling_error: Option<f64>,
    /// Covariance of ln E of all layers, then ln h, then ν. If empty, the errors of the layers are
    /// unknown and assumed.
    #[serde(default)]
    pub layer_covariance: Vec<Vec<f64>>,
    /// Lens and frame size.
    pub geometry: SensorGeometry,
    /// Noise of one pixel of a frame.
    pub noise: NoiseModel,
    /// Light of the reference used for the curve. Later references are compared with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<ReferenceLight>,
    /// Shear stiffnesses, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shear: Option<ShearCalibration>,
    /// The guide's layers from the object's side, rigid if empty.
    #[serde(default)]
    pub layers: Vec<SceneLayer>,
    /// The local light-to-pressure curve, with the hysteresis in its report.
    pub curve: PressureCurve,
}

impl Sensor {
    /// Reads and checks a sensor file.
    ///
    /// # Errors
    /// [`FileError`]: one sentence that names the file, the field and what was expected.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FileError> {
        Self::from_file(path.as_ref())
    }

    /// Not generic, so that the parser is compiled once, not again in every crate that reads.
    fn from_file(path: &Path) -> Result<Self, FileError> {
        let sensor: Self = read_toml(path)?;
        match sensor.mistake() {
            None => Ok(sensor),
            Some((field, reason)) => Err(FileError::field(path, field, reason)),
        }
    }

    /// Writes the sensor file.
    ///
    /// # Errors
    /// [`FileError::Write`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        self.to_file(path.as_ref())
    }

    fn to_file(&self, path: &Path) -> Result<(), FileError> {
        let text = toml::to_string(self).map_err(|error| FileError::Write {
            path: path.into(),
            source: std::io::Error::other(error),
        })?;
        write_bytes(path, text.as_bytes())
    }

    /// The guide, which is rigid without layers.
    ///
    /// # Errors
    /// [`PipelineError::Material`].
    pub fn waveguide(&self) -> Result<Waveguide, PipelineError> {
        guide(&self.layers).map_err(PipelineError::Material)
    }

    /// The options for finding contacts. Detected changes of the lamps since the reference are
    /// divided out.
    pub(crate) fn force_options() -> ForceOptions {
        let contact = ContactOptions::default().with_drift(DriftCorrection::Automatic);
        ForceOptions::default().with_contact(contact)
    }

    /// The stage from frame to force. It undistorts contours, converts grey levels to pressures and
    /// propagates the errors of both.
    ///
    /// # Errors
    /// [`PipelineError::Sensor`] if the parts do not fit together.
    pub fn contact(&self, options: &ForceOptions) -> Result<LightContact, PipelineError> {
        let lens = self.geometry.lens;
        Ok(LightContact::new(self.curve.clone(), lens.pixel_size_m(), options)?.with_lens(lens))
    }

    /// The default pipeline for an object on this sensor.
    ///
    /// # Errors
    /// [`PipelineError`].
    pub fn pipeline(&self, object: Object) -> Result<Pipeline, PipelineError> {
        let contact = self.contact(&Self::force_options())?;
        self.configured(Pipeline::new(contact, object)?)
    }

    /// A pipeline with this sensor's layers, flat field and errors.
    pub(crate) fn configured(&self, pipeline: Pipeline) -> Result<Pipeline, PipelineError> {
        let guide = self.waveguide()?;
        let n = self.layer_covariance.len();
        // A row that is too short yields NaN, which the settings refuse.
        let entry = |i: usize, j: usize| self.layer_covariance[i].get(j).copied();
        let covariance = DMatrix::from_fn(n, n, |i, j| entry(i, j).unwrap_or(f64::NAN));
        pipeline.with_settings(|settings| {
            settings.flat_field = self.flat_field;
            settings.assumptions.state(Source::Gain, self.gauge_error);
            if let Some(error) = self.coupling_error {
                settings.assumptions.state(Source::Coupling, error);
            }
            settings.calibrated_light.clone_from(&self.light);
            let length_error = self.geometry.length_scale_error();
            settings.assumptions.state(Source::PixelSize, length_error);
            // On a rigid guide the settings keep their default.
            if !self.layers.is_empty() {
                settings.waveguide = Some(guide);
                settings.layer_covariance = (n > 0).then_some(covariance);
            }
        })
    }

    /// The name of an invalid field and the expected value. `None` if all are valid.
    fn mistake(&self) -> Option<(&'static str, String)> {
        let not_negative = |v: f64| v >= 0.0 && v.is_finite();
        if self.geometry.frame_px.contains(&0) {
            return Some(("geometry.frame_px", "expected two positive numbers".into()));
        }
        let mut entries = self.geometry.covariance.iter().flatten();
        let length_error = self.geometry.length_scale_error();
        if !entries.all(|entry| entry.is_finite()) || !length_error.is_finite() {
            return Some(("geometry.covariance", "expected finite numbers".into()));
        }
        if !(not_negative(self.noise.read_variance) && not_negative(self.noise.gain)) {
            return Some(("noise", "expected zero or positive numbers".into()));
        }
        if let Err(error) = self.waveguide() {
            return Some(("layers", error.to_string()));
        }
        let (rows, expected) = (&self.layer_covariance, 3 * self.layers.len());
        let is_square = rows.len() == expected && rows.iter().all(|row| row.len() == expected);
        if !rows.is_empty() && !is_square {
            let reason = format!("expected {expected} rows of {expected} numbers, three per layer");
            return Some(("layer_covariance", reason));
        }
        let is_variance = |(i, row): (usize, &Vec<f64>)| {
            row.iter().all(|entry| entry.is_finite()) && row[i] >= 0.0
        };
        if !rows.iter().enumerate().all(is_variance) {
            let reason = "expected finite numbers, none below zero on the diagonal".into();
            return Some(("layer_covariance", reason));
        }
        None
    }
}
