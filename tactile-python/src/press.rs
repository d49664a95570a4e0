//! The pipeline, presses and sessions on it, and simulated presses to try them on.
use crate::arrays;
use crate::errors::{self, invalid};
use crate::matching::{self, Matcher};
use crate::results::{Contact, Estimate, Match, Modulus, SimulatedPress, Strain, Surface, ends};
use ndarray::Array2;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use std::str::FromStr;
use tactile_imaging as rust;
use tactile_imaging::core::Estimate as CoreEstimate;
use tactile_imaging::core::statistics::quantile_95;
use tactile_imaging::elasticity::contact::{Layer, Waveguide};
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::matching::Search;
use tactile_imaging::pipeline::{ContactReading, PairStrain, StagesConfig};
use tactile_simulate::{CalibrationRun, Camera, PressLoad, PressOptions, Trial};

/// What is pressed on the sensor. Lengths in metres.
#[pyclass(frozen, module = "tactile_imaging")]
pub struct Object(rust::Object);

#[pymethods]
impl Object {
    /// A ball.
    #[classmethod]
    #[pyo3(signature = (radius, *, poisson_ratio=0.5))]
    fn sphere(_class: &Bound<'_, PyType>, radius: f64, poisson_ratio: f64) -> Self {
        let radius_m = radius;
        Self(rust::Object::Sphere {
            radius_m,
            poisson_ratio,
        })
    }

    /// A block with a flat face.
    #[classmethod]
    #[pyo3(signature = (*, poisson_ratio=0.5))]
    fn block(_class: &Bound<'_, PyType>, poisson_ratio: f64) -> Self {
        Self(rust::Object::Block { poisson_ratio })
    }

    /// A cylinder standing on its flat face.
    #[classmethod]
    #[pyo3(signature = (*, poisson_ratio=0.5))]
    fn cylinder(_class: &Bound<'_, PyType>, poisson_ratio: f64) -> Self {
        Self(rust::Object::Cylinder { poisson_ratio })
    }

    /// A flat punch of small radius.
    #[classmethod]
    #[pyo3(signature = (radius, *, poisson_ratio=0.5))]
    fn flat_punch(_class: &Bound<'_, PyType>, radius: f64, poisson_ratio: f64) -> Self {
        let radius_m = radius;
        Self(rust::Object::FlatPunch {
            radius_m,
            poisson_ratio,
        })
    }

    /// A cone of the half angle in radians.
    #[classmethod]
    #[pyo3(signature = (half_angle, *, poisson_ratio=0.5))]
    fn cone(_class: &Bound<'_, PyType>, half_angle: f64, poisson_ratio: f64) -> Self {
        let half_angle_rad = half_angle;
        Self(rust::Object::Cone {
            half_angle_rad,
            poisson_ratio,
        })
    }

    /// An object of unknown shape: read as one with a flat face where its contacts are those of one.
    #[classmethod]
    #[pyo3(signature = (*, poisson_ratio=0.5))]
    fn unknown(_class: &Bound<'_, PyType>, poisson_ratio: f64) -> Self {
        Self(rust::Object::Unknown { poisson_ratio })
    }

    fn __repr__(&self) -> String {
        format!("Object.{:?}", self.0)
    }
}

/// The stages from a frame to Young's modulus.
///
/// Parameters
/// ----------
/// pairs : (n, 2) array, integrated pixel value and force in newtons
/// pixel_size : metres, one number or (x, y)
/// object : `Object`
/// waveguide : (k, 3) array of thickness in metres, Young's modulus in pascals and Poisson's ratio,
///     or None for a rigid flat
/// control_points : number of points that are matched
/// matcher : a name, or an object with a method `match_points(model, target)`
/// matcher_options : options of a matcher that is given by its name
/// surface, warp, strain, estimator : names of stages
#[pyclass(frozen, module = "tactile_imaging")]
pub struct Pipeline(rust::Pipeline);

#[pymethods]
impl Pipeline {
    #[new]
    #[pyo3(signature = (
        *, pairs, pixel_size, object, waveguide=None, control_points=200, matcher=None,
        matcher_options=None, surface="eikonal", warp="thin-plate-spline", strain="green-lagrange",
        estimator="best"
    ))]
    #[allow(clippy::too_many_arguments)] // keywords of Python
    fn new(
        pairs: &Bound<'_, PyAny>,
        pixel_size: &Bound<'_, PyAny>,
        object: &Object,
        waveguide: Option<&Bound<'_, PyAny>>,
        control_points: usize,
        matcher: Option<&Bound<'_, PyAny>>,
        matcher_options: Option<&Bound<'_, PyDict>>,
        surface: &str,
        warp: &str,
        strain: &str,
        estimator: &str,
    ) -> PyResult<Self> {
        let pairs = columns::<2>("pairs", pairs)?;
        let pairs: Vec<_> = (pairs.iter())
            .map(|&[light, force]| CalibrationPair::loading(light, force))
            .collect();
        let config = StagesConfig {
            reconstruction: named(surface)?,
            warp: named(warp)?,
            strain: named(strain)?,
            estimator: named(estimator)?,
            ..StagesConfig::default()
        };
        let layers = waveguide
            .map(|layers| columns::<3>("waveguide", layers))
            .transpose()?;
        let waveguide = layers
            .map(|layers| Waveguide::new(layers.into_iter().map(layer).collect()))
            .transpose()
            .map_err(errors::elasticity)?;
        let size = arrays::pixel_size(pixel_size)?;
        let mut pipeline = rust::Pipeline::from_pairs(&pairs, size, object.0)
            .and_then(|pipeline| pipeline.with_settings(|settings| settings.waveguide = waveguide))
            .and_then(|pipeline| pipeline.with_stages(&config))
            .map_err(errors::pipeline)?
            .with_control_points(control_points);
        if let Some(matcher) = matcher {
            let matcher = Matcher::new(matcher, matcher_options, Search::Near)?;
            pipeline = pipeline.with_matcher(matcher.boxed::<3>());
        } else if matcher_options.is_some() {
            return Err(invalid(
                "matcher_options belong to a matcher that is given by its name",
            ));
        }
        Ok(Self(pipeline))
    }

    /// A press on this pipeline, with the frame without contact.
    fn press(&self, py: Python<'_>, reference: &Bound<'_, PyAny>) -> PyResult<Press> {
        let reference = arrays::frame("reference", reference)?;
        let press = py.detach(|| self.0.press(reference.view()));
        Ok(Press(press.map_err(errors::pipeline)?))
    }

    fn __repr__(&self) -> String {
        let settings = self.0.settings();
        let points = settings.control_points;
        format!("Pipeline({:?}, {points} control points)", settings.object)
    }
}

fn named<T: FromStr<Err: ToString>>(name: &str) -> PyResult<T> {
    name.parse().map_err(|error: T::Err| invalid(error))
}

fn layer([thickness_m, youngs_modulus_pa, poisson_ratio]: [f64; 3]) -> Layer {
    Layer {
        thickness_m,
        youngs_modulus_pa,
        poisson_ratio,
    }
}

/// The rows of an array of N columns.
fn columns<const N: usize>(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; N]>> {
    let array = arrays::matrix(name, given)?;
    if array.ncols() != N {
        let found = array.ncols();
        return Err(invalid(format!(
            "{name} must have {N} columns, found {found}"
        )));
    }
    let row = |row: ndarray::ArrayView1<'_, f64>| std::array::from_fn(|k| row[k]);
    Ok(array.rows().into_iter().map(row).collect())
}

/// Frames at one or more loads. Nothing is computed before it is asked for, and all of it once.
#[pyclass(module = "tactile_imaging")]
pub struct Press(rust::Press<'static>);

#[pymethods]
impl Press {
    #[new]
    fn new(py: Python<'_>, pipeline: &Pipeline, reference: &Bound<'_, PyAny>) -> PyResult<Self> {
        pipeline.press(py, reference)
    }

    /// Adds a frame (uint8, [row, column]) and returns its number, from zero.
    ///
    /// `gauge` is the force in newtons that a gauge read, `gauge_error` its standard error.
    #[pyo3(signature = (frame, *, gauge=None, gauge_error=0.0))]
    fn add_frame(
        &mut self,
        frame: &Bound<'_, PyAny>,
        gauge: Option<f64>,
        gauge_error: f64,
    ) -> PyResult<usize> {
        let frame = arrays::frame("frame", frame)?;
        let gauge = gauge.map(|force_n| CoreEstimate::new(force_n, gauge_error));
        Ok(self.0.add_gauged_frame(frame, gauge))
    }

    fn __len__(&self) -> usize {
        self.0.frames()
    }

    /// Force, radius and centroid of a frame, or None where nothing touches.
    fn contact(&self, py: Python<'_>, frame: usize) -> PyResult<Option<Contact>> {
        let reading = py.detach(|| self.0.contact(frame));
        let reading = reading.map_err(errors::pipeline)?;
        reading.map(|reading| contact(py, reading)).transpose()
    }

    /// The reconstructed surface of a frame.
    fn surface(&self, py: Python<'_>, frame: usize) -> PyResult<Surface> {
        let surface = py.detach(|| self.0.surface(frame));
        let surface = surface.map_err(errors::pipeline)?;
        let heights = surface.surface.heights.clone();
        Ok(Surface {
            text: format!("{} × {} heights", heights.nrows(), heights.ncols()),
            heights: arrays::kept(py, heights),
            pixel_size: surface.pixel_size_m.into(),
            origin: surface.origin_m.into(),
        })
    }

    /// Control points of a frame in metres, (n, 3).
    fn control_points<'py>(
        &self,
        py: Python<'py>,
        frame: usize,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = py.detach(|| self.0.control_points(frame).map(arrays::rows));
        Ok(PyArray2::from_owned_array(
            py,
            points.map_err(errors::pipeline)?,
        ))
    }

    /// The match of the first frame's control points with those of a frame.
    fn matching(&self, py: Python<'_>, frame: usize) -> PyResult<Match> {
        let found = py.detach(|| self.0.matching(frame));
        Ok(matching::answer(py, found.map_err(errors::pipeline)?))
    }

    /// Mean strain between the first frame and a frame.
    fn strain(&self, py: Python<'_>, frame: usize) -> PyResult<Strain> {
        let strain = py.detach(|| self.0.strain(frame));
        Ok(strain_result(py, strain.map_err(errors::pipeline)?))
    }

    /// Young's modulus from all frames.
    fn modulus(&self, py: Python<'_>) -> PyResult<Modulus> {
        let estimate = py.detach(|| self.0.modulus());
        Ok(modulus(&estimate.map_err(errors::pipeline)?))
    }

    /// The modulus by every estimator that the frames allow.
    fn estimates(&self, py: Python<'_>) -> PyResult<Vec<Modulus>> {
        let estimates = py.detach(|| self.0.estimates());
        Ok(estimates
            .map_err(errors::pipeline)?
            .iter()
            .map(modulus)
            .collect())
    }

    /// All results as text, with what could not be computed and why.
    fn summary(&self, py: Python<'_>) -> String {
        py.detach(|| self.0.measure().to_string())
    }

    fn __repr__(&self) -> String {
        format!("Press({} frames)", self.0.frames())
    }
}

fn contact(py: Python<'_>, reading: &ContactReading) -> PyResult<Contact> {
    let estimate = |estimate| Estimate::of(py, estimate);
    let [x, y] = reading.centroid_px;
    Ok(Contact {
        text: reading.to_string(),
        force: reading.force_n.map(estimate).transpose()?,
        radius: estimate(reading.contact_radius_m)?,
        indentation: reading.indentation_m.map(estimate).transpose()?,
        x: estimate(x)?,
        y: estimate(y)?,
        area: reading.area_m2,
        touches_edge: reading.touches_edge,
    })
}

fn strain_result(py: Python<'_>, strain: &PairStrain) -> Strain {
    let summary = &strain.summary;
    let (mean, error) = (summary.mean, summary.standard_error);
    Strain {
        text: format!(
            "{}: {}",
            strain.measure,
            matching::tensor_text(&mean, &error)
        ),
        value: arrays::kept_tensor(py, &mean),
        standard_error: arrays::kept_tensor(py, &error),
        interval_95: matching::interval(py, &mean, &(error * quantile_95(None))),
        spread: arrays::kept_tensor(py, &summary.spread),
        measure: strain.measure.into(),
        used: summary.used,
    }
}

fn modulus(estimate: &ModulusEstimate) -> Modulus {
    Modulus {
        text: rust::pipeline::ModulusResult::from(estimate).to_string(),
        value: estimate.youngs_modulus_pa,
        standard_error: estimate.standard_error_pa,
        interval_95: ends(estimate.interval_95),
        estimator: estimate.estimator.to_string(),
        flags: estimate.warnings.iter().map(ToString::to_string).collect(),
    }
}

/// A stream of frames from one sensor and one object, with constant memory.
///
/// Parameters
/// ----------
/// pipeline : `Pipeline`
/// references : one frame or more without contact
#[pyclass(module = "tactile_imaging")]
pub struct Session(rust::pipeline::Session);

#[pymethods]
impl Session {
    #[new]
    fn new(pipeline: &Pipeline, references: Vec<Bound<'_, PyAny>>) -> PyResult<Self> {
        let read = |frame| arrays::frame("references", frame);
        let frames: Vec<Array2<u8>> = references.iter().map(read).collect::<PyResult<_>>()?;
        let views: Vec<_> = frames.iter().map(|frame| frame.view()).collect();
        let session = rust::pipeline::Session::new(&pipeline.0, &views);
        Ok(Self(session.map_err(errors::pipeline)?))
    }

    /// Measures the next frame: its contact, or None where nothing touches.
    fn push(&mut self, py: Python<'_>, frame: &Bound<'_, PyAny>) -> PyResult<Option<Contact>> {
        let frame = arrays::frame("frame", frame)?;
        let session = &mut self.0;
        let update = py.detach(|| session.push(frame.view()));
        let reading = update.map_err(errors::pipeline)?.contact;
        reading.map(|reading| contact(py, &reading)).transpose()
    }

    /// Mean strain since the first load that it was asked at, None there.
    fn strain(&mut self, py: Python<'_>) -> PyResult<Option<Strain>> {
        let session = &mut self.0;
        let strain = py.detach(|| Ok(session.strain()?.map(|followed| followed.strain.clone())));
        let strain = strain.map_err(errors::pipeline)?;
        Ok(strain.map(|strain| strain_result(py, &strain)))
    }

    /// Young's modulus from all frames so far.
    fn modulus(&mut self, py: Python<'_>) -> PyResult<Modulus> {
        let session = &mut self.0;
        let estimate = py.detach(|| session.modulus());
        Ok(modulus(&estimate.map_err(errors::pipeline)?))
    }

    fn __repr__(&self) -> String {
        format!("Session({} frames)", self.0.frames())
    }
}

/// Simulates a ball pressed on the sensor: frames, calibration and truth.
///
/// Parameters
/// ----------
/// forces : newtons, a frame each
/// radius : metres
/// youngs_modulus : pascals
/// coarser : factor by which pixels are larger than those of 1392 × 1040 on 30 mm
/// seed : of the noise
#[pyfunction]
#[pyo3(signature = (
    *, forces=vec![0.7, 1.2], radius=3e-3, youngs_modulus=103e3, poisson_ratio=0.5, coarser=1, seed=0
))]
pub fn simulate(
    py: Python<'_>,
    forces: Vec<f64>,
    radius: f64,
    youngs_modulus: f64,
    poisson_ratio: f64,
    coarser: usize,
    seed: u64,
) -> PyResult<SimulatedPress> {
    let mut options = PressOptions {
        camera: Camera::default().coarser(coarser),
        loads: forces.iter().copied().map(PressLoad::normal).collect(),
        seed,
        ..PressOptions::default()
    };
    options.object.radius_m = radius;
    options.object.material.youngs_modulus_pa = youngs_modulus;
    options.object.material.poisson_ratio = poisson_ratio;
    let trial = py.detach(|| Trial::new(options, &CalibrationRun::default()));
    let Trial {
        scene,
        simulation,
        pairs,
    } = trial.map_err(invalid)?;
    let truth = PyDict::new(py);
    truth.set_item("youngs_modulus", simulation.youngs_modulus_pa)?;
    let contacts = simulation.truth.iter();
    let radii: Vec<f64> = contacts
        .clone()
        .map(|truth| truth.contact.contact_radius_m)
        .collect();
    truth.set_item("forces", forces)?;
    truth.set_item("contact_radii", radii)?;
    truth.set_item(
        "centres",
        contacts.map(|truth| truth.centre_px).collect::<Vec<_>>(),
    )?;
    let layers = &scene.options().waveguide.layers;
    let property = |(i, k): (usize, usize)| {
        let (layer, material) = (layers[i].thickness_m, layers[i].material);
        [layer, material.youngs_modulus_pa, material.poisson_ratio][k]
    };
    let pair = |(i, k): (usize, usize)| [pairs[i].integrated_pixel_value, pairs[i].force_n][k];
    let [x, y] = simulation.pixel_size_m;
    let frames = simulation.frames;
    Ok(SimulatedPress {
        text: format!("{} frames, ball of {:.3} mm", frames.len(), radius * 1e3),
        reference: arrays::kept(py, simulation.reference),
        frames: frames
            .into_iter()
            .map(|frame| arrays::kept(py, frame))
            .collect(),
        pairs: arrays::kept(py, Array2::from_shape_fn((pairs.len(), 2), pair)),
        pixel_size: (x, y),
        waveguide: arrays::kept(py, Array2::from_shape_fn((layers.len(), 3), property)),
        radius,
        truth: truth.unbind(),
    })
}
