//! The sensor and its file.
use super::error::SensorError;
use super::toml_error;
use crate::elasticity::contact::{Layer, Waveguide};
use crate::force::{
    ContactOptions, DriftCorrection, ForceOptions, LensGeometry, NoiseModel, PressureCurve,
    ShearCalibration,
};
use crate::io::read_bytes;
use crate::io::replace_file;
use crate::pipeline::{LightContact, Object, Pipeline, PipelineError};
use crate::scene::{SceneError, SceneLayer};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Where the camera sees what, and how well that is known.
///
/// ```no_run
/// use tactile_imaging::sensor::{Sensor, SensorGeometry};
/// let SensorGeometry { lens, covariance, .. } = Sensor::read("sensor.toml")?.geometry;
/// println!("a pixel is {} ± {} m wide", lens.pixel_size_m()[0], covariance[0][0].sqrt());
/// # Ok::<(), tactile_imaging::scene::SceneError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorGeometry {
    /// The frame's outline: columns and rows.
    pub frame_px: [usize; 2],
    /// Covariance of the lens's [h_x, h_y, k₁, k₂].
    pub covariance: [[f64; 4]; 4],
    /// Relative standard error of the target's own size.
    pub target_error: f64,
    /// Pixels to metres.
    pub lens: LensGeometry,
}

impl SensorGeometry {
    /// Relative standard error that all lengths share: that of √(h_x h_y), of the distortion at half the frame's diagonal (ρ² = ¼) and
    /// of the target.
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
/// use tactile_imaging::{force::{ForceOptions, LocalCalibration}, pipeline::{Object, Pipeline}, sensor::Sensor};
/// let sensor = Sensor::read("sensor.toml")?;
/// let pipeline = sensor.pipeline(Object::sphere(3e-3))?.with_settings(|settings| settings.object_radius_error_m = 5e-6)?;
/// // Its parts, for a pipeline that is put together by hand.
/// let (contact, guide) = (sensor.contact(&ForceOptions::default())?, sensor.waveguide()?);
/// let by_hand = Pipeline::new(contact, Object::sphere(3e-3))?.with_settings(|settings| settings.waveguide = Some(guide))?;
/// println!("100 grey levels are {} Pa", sensor.curve.pressure_pa(100.0));
/// sensor.write("copy.toml")?;
/// # let _ = (pipeline, by_hand);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// A file that cannot be used is refused in one sentence:
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::sensor::Sensor;
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("sensor.toml");
/// std::fs::write(&path, "date = \"2026-11-22\"\nflat_field = 3\n")?;
/// let error = Sensor::read(&path).unwrap_err();
/// assert!(error.to_string().contains("sensor.toml: field `flat_field`: invalid type: integer `3`, expected"));
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// When it was calibrated, as the user writes it.
    pub date: String,
    /// Temperature during the calibration, in degrees Celsius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    /// Whether frames are divided by the brightness that the reference itself has there: corrects vignetting.
    pub flat_field: bool,
    /// Relative standard error of the gauge, common to all forces.
    pub gauge_error: f64,
    /// Covariance of ln E of all layers, then of ln h, then of ν. Empty where the layers are taken as exact.
    #[serde(default)]
    pub layer_covariance: Vec<Vec<f64>>,
    /// Lens and outline.
    pub geometry: SensorGeometry,
    /// Noise of one pixel of a frame.
    pub noise: NoiseModel,
    /// Springs of shear, where they are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shear: Option<ShearCalibration>,
    /// The guide's layers from the object's side; empty: rigid.
    #[serde(default)]
    pub layers: Vec<SceneLayer>,
    /// The local light-to-pressure curve, with the hysteresis that its report names.
    pub curve: PressureCurve,
}

impl Sensor {
    /// Reads and checks a sensor file.
    ///
    /// # Errors
    /// [`SceneError`]: one sentence that names the file, the field and what was expected.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let bytes = read_bytes(path).map_err(|error| SceneError::Open(Box::new(error)))?;
        Self::parse(&String::from_utf8_lossy(&bytes), path)
    }

    /// Checks the text of a sensor file. `file` is its name, for errors.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    fn parse(text: &str, file: impl AsRef<Path>) -> Result<Self, SceneError> {
        let file = file.as_ref();
        let sensor: Self =
            toml::from_str(text).map_err(|error| toml_error::sentence(file, text, &error))?;
        sensor.check(file)?;
        Ok(sensor)
    }

    /// Writes the file.
    ///
    /// # Errors
    /// [`SensorError::Write`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), SensorError> {
        let path = path.as_ref();
        let failed = |source: std::io::Error| SensorError::Write {
            file: path.into(),
            source,
        };
        let text = toml::to_string(self).map_err(|error| failed(std::io::Error::other(error)))?;
        replace_file(path, text.as_bytes()).map_err(failed)
    }

    /// The guide. Rigid without layers.
    pub fn waveguide(&self) -> Result<Waveguide, PipelineError> {
        if self.layers.is_empty() {
            return Ok(Waveguide::rigid());
        }
        Waveguide::new(self.elastic_layers()).map_err(PipelineError::Material)
    }

    pub(super) fn elastic_layers(&self) -> Vec<Layer> {
        let layer = |l: &SceneLayer| Layer {
            thickness_m: l.thickness_m,
            youngs_modulus_pa: l.youngs_modulus_pa,
            poisson_ratio: l.poisson_ratio,
        };
        self.layers.iter().map(layer).collect()
    }

    /// The options that contacts are found with: changes of the illumination are divided out where they can be told.
    pub(crate) fn force_options() -> ForceOptions {
        let contact = ContactOptions::default().with_drift(DriftCorrection::Automatic);
        ForceOptions::default().with_contact(contact)
    }

    /// The stage from frame to force: undistorts contours, turns grey levels into pressures and carries the errors of both.
    ///
    /// # Errors
    /// [`PipelineError::Sensor`].
    pub fn contact(&self, options: &ForceOptions) -> Result<LightContact, PipelineError> {
        let lens = self.geometry.lens;
        Ok(LightContact::new(self.curve.clone(), lens.pixel_size_m(), options)?.with_lens(lens))
    }

    /// The default pipeline for an object on this sensor.
    ///
    /// # Errors
    /// [`PipelineError`].
    pub fn pipeline(&self, object: Object) -> Result<Pipeline, PipelineError> {
        self.configured(Pipeline::new(
            self.contact(&Self::force_options())?,
            object,
        )?)
    }

    /// A pipeline with this sensor's layers, flat field and errors.
    pub(crate) fn configured(&self, pipeline: Pipeline) -> Result<Pipeline, PipelineError> {
        let guide = (!self.layers.is_empty())
            .then(|| self.waveguide())
            .transpose()?;
        let n = self.layer_covariance.len();
        let entry = |i: usize, j: usize| self.layer_covariance[i].get(j).copied();
        let covariance = DMatrix::from_fn(n, n, |i, j| entry(i, j).unwrap_or(f64::NAN));
        pipeline.with_settings(|settings| {
            settings.flat_field = self.flat_field;
            settings.force_scale_error = self.gauge_error;
            settings.length_scale_error = self.geometry.length_scale_error();
            if guide.is_some() {
                settings.waveguide = guide;
                settings.layer_covariance = (n > 0).then_some(covariance);
            }
        })
    }

    fn check(&self, file: &Path) -> Result<(), SceneError> {
        let wrong = |field: &str, message: &str| SceneError::Value {
            file: file.into(),
            field: field.into(),
            message: message.into(),
        };
        let not_negative = |v: f64| v >= 0.0 && v.is_finite();
        if !not_negative(self.gauge_error) {
            return Err(wrong(
                "gauge_error",
                "expected zero or a positive number (relative)",
            ));
        }
        if self.geometry.frame_px.contains(&0) {
            return Err(wrong("geometry.frame_px", "expected two positive numbers"));
        }
        let entries = self.geometry.covariance.iter().flatten();
        if !not_negative(self.geometry.target_error)
            || !entries.into_iter().all(|c| c.is_finite())
            || !self.geometry.length_scale_error().is_finite()
        {
            return Err(wrong("geometry.covariance", "expected finite numbers"));
        }
        if !(not_negative(self.noise.read_variance) && not_negative(self.noise.gain)) {
            return Err(wrong("noise", "expected zero or positive numbers"));
        }
        if let Err(error) = self.waveguide() {
            return Err(wrong("layers", &error.to_string()));
        }
        let expected = 3 * self.layers.len();
        let square = self
            .layer_covariance
            .iter()
            .all(|row| row.len() == self.layer_covariance.len());
        let given = !self.layer_covariance.is_empty();
        let fits = square && self.layer_covariance.len() == expected;
        if given && !fits {
            let message = format!("expected {expected} rows of {expected} numbers, three a layer");
            return Err(wrong("layer_covariance", &message));
        }
        let variances = self.layer_covariance.iter().enumerate();
        if !variances.into_iter().all(|(i, row)| {
            row.iter().all(|c| c.is_finite()) && row.get(i).is_some_and(|v| *v >= 0.0)
        }) {
            return Err(wrong(
                "layer_covariance",
                "expected finite numbers, none below zero on the diagonal",
            ));
        }
        Ok(())
    }
}
