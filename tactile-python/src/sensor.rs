//! Sensors: calibrated once and stored in a file.
use crate::arrays;
use crate::errors::{self, invalid};
use pyo3::prelude::*;
use pyo3::types::PyType;
use std::path::PathBuf;
use tactile_files::scene::SceneLayer;
use tactile_files::sensor as rust;
use tactile_files::sensor::{Indenter, LayerInput, SensorCalibration, SensorPress};
use tactile_imaging::force::Branch;

/// A calibrated sensor: lens, light and layers with their errors.
#[pyclass(frozen, module = "tactile_imaging")]
pub(crate) struct Sensor(pub rust::Sensor);

#[pymethods]
impl Sensor {
    /// Reads a sensor file.
    ///
    /// Raises
    /// ------
    /// OSError, ValueError
    ///     A file that cannot be read or used, with the field and the expected value.
    #[classmethod]
    fn load(_class: &Bound<'_, PyType>, path: PathBuf) -> PyResult<Self> {
        rust::Sensor::read(path).map(Self).map_err(errors::file)
    }

    /// Writes the sensor file (TOML).
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.0.write(path).map_err(errors::file)
    }

    /// Calibrates with the presses listed in a calibration file, like `tactile calibrate`.
    #[classmethod]
    fn calibrate(_class: &Bound<'_, PyType>, py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Self::fitted(py, || SensorCalibration::read(path).map_err(Into::into))
    }

    /// Calibrates with presses of balls under known forces.
    ///
    /// Parameters
    /// ----------
    /// references, frames : sequences of (rows, columns) arrays of uint8
    ///     Frames without contact, and one frame per press.
    /// forces : (n,) array
    ///     Gauge readings in newtons.
    /// radii : (n,) array
    ///     Radius of the ball of each press in metres.
    /// pixel_size : float or (x, y)
    ///     Size of a pixel in metres.
    /// layers : (k, 7) array
    ///     Refractive index, thickness and its error in metres, Young's modulus and its error in
    ///     pascals, Poisson's ratio and its error, from the side of the object. None is a rigid flat.
    /// unloading : sequence of bool
    ///     Whether each press was made during unloading.
    /// pixel_size_error, gauge_error : float
    ///     Relative standard errors.
    /// gauge_noise : float
    ///     Standard deviation of one reading in newtons.
    /// date : str
    #[classmethod]
    #[pyo3(signature = (
        references, frames, forces, radii, pixel_size, *, layers=None, unloading=None,
        pixel_size_error=1e-3, gauge_error=1e-3, gauge_noise=2e-3, flat_field=true, date=""
    ))]
    fn from_presses(
        _class: &Bound<'_, PyType>,
        py: Python<'_>,
        references: Vec<Bound<'_, PyAny>>,
        frames: Vec<Bound<'_, PyAny>>,
        forces: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        pixel_size: &Bound<'_, PyAny>,
        layers: Option<&Bound<'_, PyAny>>,
        unloading: Option<Vec<bool>>,
        pixel_size_error: f64,
        gauge_error: f64,
        gauge_noise: f64,
        flat_field: bool,
        date: &str,
    ) -> PyResult<Self> {
        let image = |name, given| -> PyResult<_> {
            Ok(arrays::owned(arrays::frame(name, given)?.as_array()))
        };
        let references = references.iter().map(|given| image("references", given));
        let frames = frames.iter().map(|given| image("frames", given));
        let frames = frames.collect::<PyResult<Vec<_>>>()?;
        let forces = arrays::vector("forces", forces)?;
        let radii = arrays::vector("radii", radii)?;
        let unloading = unloading.unwrap_or_else(|| vec![false; frames.len()]);
        let lengths = [forces.len(), radii.len(), unloading.len()];
        if lengths != [frames.len(); 3] {
            let expected = frames.len();
            return Err(invalid(format!(
                "forces, radii and unloading must have the length {expected} of frames, \
                 found {lengths:?}"
            )));
        }
        let press = |(k, frame)| SensorPress {
            frame,
            force_n: forces[k],
            branch: match unloading[k] {
                true => Branch::Unloading,
                false => Branch::Loading,
            },
            indenter: Indenter::Ball {
                radius_m: radii[k],
                radius_error_m: 0.0,
            },
        };
        let layers = layers.map(|given| arrays::columns::<7>("layers", given));
        let layers = layers.transpose()?.unwrap_or_default();
        let calibration = SensorCalibration {
            date: date.into(),
            temperature_c: None,
            references: references.collect::<PyResult<_>>()?,
            presses: frames.into_iter().enumerate().map(press).collect(),
            target: None,
            pixel_size_m: (arrays::pixel_size(pixel_size)?, pixel_size_error),
            layers: layers.into_iter().map(layer).collect(),
            flat_field,
            gauge_error,
            coupling_error: None,
            gauge_noise_n: gauge_noise,
            shear: None,
            covers_n: None,
        };
        Self::fitted(py, || Ok(calibration))
    }

    /// Pressures in pascals for increases of brightness in grey levels, (n,).
    fn pressure<'py>(
        &self,
        py: Python<'py>,
        grey: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, numpy::PyArray1<f64>>> {
        use tactile_imaging::force::LocalCalibration;
        let grey = arrays::vector("grey", grey)?;
        let pressures = grey
            .into_iter()
            .map(|level| self.0.curve.pressure_pa(level).value);
        Ok(numpy::PyArray1::from_iter(py, pressures))
    }

    /// Date of the calibration, as stated.
    #[getter]
    fn date(&self) -> &str {
        &self.0.date
    }

    /// Size of a pixel in metres, x and y.
    #[getter]
    fn pixel_size(&self) -> (f64, f64) {
        self.0.geometry.lens.pixel_size_m().into()
    }

    fn __repr__(&self) -> String {
        let [columns, rows] = self.0.geometry.frame_px;
        let layers = self.0.layers.len();
        format!("Sensor({columns} × {rows} pixels, {layers} layers)")
    }
}

impl Sensor {
    fn fitted(
        py: Python<'_>,
        calibration: impl Send + FnOnce() -> Result<SensorCalibration, rust::SensorError>,
    ) -> PyResult<Self> {
        let found = py.detach(|| calibration()?.run());
        Ok(Self(found.map_err(errors::sensor)?.sensor))
    }
}

fn layer(row: [f64; 7]) -> LayerInput {
    let [
        index,
        thickness,
        thickness_error,
        modulus,
        modulus_error,
        ratio,
        ratio_error,
    ] = row;
    LayerInput {
        layer: SceneLayer {
            refractive_index: index,
            thickness_m: thickness,
            youngs_modulus_pa: modulus,
            poisson_ratio: ratio,
        },
        thickness_error_m: thickness_error,
        youngs_modulus_error_pa: modulus_error,
        poisson_ratio_error: ratio_error,
    }
}
