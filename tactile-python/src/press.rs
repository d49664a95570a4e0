//! Presses and sessions on a pipeline.
use crate::arrays;
use crate::errors;
use crate::matching::{answer, tensor_text};
use crate::pipeline::Pipeline;
use crate::results::{Contact, Estimate, Match, Modulus, Strain, Surface, ends, of_values};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyType};
use pyo3::{PyTraverseError, PyVisit};
use std::path::PathBuf;
use std::sync::{Mutex, RwLock};
use std::thread::ThreadId;
use tactile_files::io::FileError;
use tactile_files::scene::Scene;
use tactile_imaging as rust;
use tactile_imaging::core::Estimate as CoreEstimate;
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::force::ForceError;
use tactile_imaging::pipeline::{ContactReading, ContactSurface, Flag, PairStrain, PipelineError};

/// Values and their standard errors.
type ValuesAndErrors<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Frames at one or more loads. Every result is computed on demand and only once.
///
/// Frames and loads are counted from zero, also in messages, and frames from the end if negative;
/// `press[i]` is a frame with its results. Threads may share a press. The interpreter lock is released during
/// computations; a frame that another thread adds meanwhile waits.
///
/// Parameters
/// ----------
/// pipeline : Pipeline
/// reference : (rows, columns) array of uint8
///     The frame without contact.
#[pyclass(frozen, module = "tactile_imaging")]
pub(crate) struct Press {
    /// A frame that is added during a computation waits for its end.
    press: RwLock<rust::Press<'static>>,
    /// The stages in Python, which must be visible to the garbage collector.
    own: Vec<Py<PyAny>>,
    /// Threads that compute. A stage in Python that uses its own press would wait for itself.
    busy: Mutex<Vec<ThreadId>>,
}

/// Removes a thread from the list when its computation ends for any reason.
struct Busy<'a>(&'a Mutex<Vec<ThreadId>>);

impl Drop for Busy<'_> {
    fn drop(&mut self) {
        let mut busy = self.0.lock().unwrap_or_else(|broken| broken.into_inner());
        let here = std::thread::current().id();
        busy.retain(|thread| *thread != here);
    }
}

impl Press {
    fn new_on(press: rust::Press<'static>, own: Vec<Py<PyAny>>) -> Self {
        Self {
            press: RwLock::new(press),
            own,
            busy: Mutex::default(),
        }
    }

    /// The frame of an index. A negative index counts from the end.
    fn nth(&self, py: Python<'_>, index: i64) -> PyResult<usize> {
        let frames = self.__len__(py)?;
        let from = if index < 0 { frames as i64 } else { 0 };
        let frame = usize::try_from(from.saturating_add(index)).ok();
        let missing = || format!("there is no frame {index}: the press has {frames}");
        frame
            .filter(|&frame| frame < frames)
            .ok_or_else(|| PyIndexError::new_err(missing()))
    }

    /// Computes without the interpreter lock.
    fn ask<T: Send>(
        &self,
        py: Python<'_>,
        compute: impl Send + FnOnce(&rust::Press<'static>) -> Result<T, PipelineError>,
    ) -> PyResult<T> {
        self.alone(py, |press| {
            compute(&press.read().unwrap_or_else(|broken| broken.into_inner()))
        })
    }

    /// Runs without the interpreter lock. An error inside a computation of the same press.
    fn alone<T: Send>(
        &self,
        py: Python<'_>,
        work: impl Send + FnOnce(&RwLock<rust::Press<'static>>) -> Result<T, PipelineError>,
    ) -> PyResult<T> {
        let here = std::thread::current().id();
        {
            let mut busy = self
                .busy
                .lock()
                .unwrap_or_else(|broken| broken.into_inner());
            if busy.contains(&here) {
                return Err(errors::TactileError::new_err(
                    "a stage must not use the press that runs it, which waits for the stage",
                ));
            }
            busy.push(here);
        }
        let busy = Busy(&self.busy);
        let found = py.detach(|| work(&self.press));
        drop(busy);
        found.map_err(errors::pipeline)
    }
}

#[pymethods]
impl Press {
    #[new]
    fn new(py: Python<'_>, pipeline: &Pipeline, reference: &Bound<'_, PyAny>) -> PyResult<Self> {
        let reference = arrays::frame("reference", reference)?;
        let view = reference.as_array();
        let press = py.detach(|| pipeline.pipeline.press(view));
        let own = pipeline
            .own
            .iter()
            .map(|stage| stage.clone_ref(py))
            .collect();
        Ok(Self::new_on(press.map_err(errors::pipeline)?, own))
    }

    /// Reads the press of a scene file, like `tactile measure`.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     A file that cannot be read.
    /// ValueError
    ///     A file that cannot be used, with the field and the expected value.
    #[classmethod]
    fn from_scene(_class: &Bound<'_, PyType>, py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let press = py.detach(|| press_of_scene(path));
        Ok(Self::new_on(press.map_err(errors::file)?, Vec::new()))
    }

    /// Adds a frame and returns its number.
    ///
    /// Parameters
    /// ----------
    /// frame : (rows, columns) array of uint8
    /// gauge, gauge_error : float
    ///     Force in newtons measured by a gauge, and its standard error.
    /// time : float
    ///     Seconds since the first frame.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A time that is negative or before that of an earlier frame. The frame is then added
    ///     without a time.
    #[pyo3(signature = (frame, *, gauge=None, gauge_error=0.0, time=None))]
    fn add_frame(
        &self,
        py: Python<'_>,
        frame: &Bound<'_, PyAny>,
        gauge: Option<f64>,
        gauge_error: f64,
        time: Option<f64>,
    ) -> PyResult<usize> {
        let frame = arrays::owned(arrays::frame("frame", frame)?.as_array());
        if gauge.is_some_and(|force_n| {
            !(force_n.is_finite() && (0.0..f64::INFINITY).contains(&gauge_error))
        }) {
            return Err(errors::invalid(format!(
                "gauge and gauge_error must be finite and the error not negative, found {gauge:?} \
                 and {gauge_error}"
            )));
        }
        let gauge = gauge.map(|force_n| CoreEstimate::new(force_n, gauge_error));
        self.alone(py, |press| {
            let mut press = press.write().unwrap_or_else(|broken| broken.into_inner());
            let (frame_number, expected) = (press.frames(), press.reference().image().dim());
            if frame.dim() != expected {
                let (found, frame) = (frame.dim(), frame_number);
                let source = ForceError::SizeMismatch { expected, found };
                return Err(PipelineError::Contact { frame, source });
            }
            let number = press.add_gauged_frame(frame, gauge);
            if let Some(time_s) = time {
                press.set_time_s(number, time_s)?;
            }
            Ok(number)
        })
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.ask(py, |press| Ok(press.frames()))
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.own.iter().try_for_each(|stage| visit.call(stage))
    }

    /// The unchanged frame, (rows, columns) of uint8.
    fn image<'py>(&self, py: Python<'py>, frame: i64) -> PyResult<Bound<'py, PyArray2<u8>>> {
        let frame = self.nth(py, frame)?;
        let image = self.ask(py, |press| Ok(press.image(frame)?.into_owned()))?;
        Ok(PyArray2::from_owned_array(py, image))
    }

    /// Force, radius and centroid of the contact in a frame, or None without contact.
    fn contact(&self, py: Python<'_>, frame: i64) -> PyResult<Option<Contact>> {
        let frame = self.nth(py, frame)?;
        let found = self.ask(py, |press| Ok(press.contact(frame)?.copied()))?;
        found
            .map(|reading| contact(py, frame, &reading))
            .transpose()
    }

    /// A frame with its results. A negative index counts from the end.
    fn __getitem__<'py>(slf: &Bound<'py, Self>, frame: i64) -> PyResult<Bound<'py, PyAny>> {
        let number = slf.get().nth(slf.py(), frame)?;
        of_values(slf.py(), "PressFrame", (slf, number))
    }

    /// Indentation of the guide by a ball, by the law of the guide's layers.
    ///
    /// Parameters
    /// ----------
    /// frame : int
    /// distances : array_like
    ///     Distances from the centre of the contact in metres.
    ///
    /// Returns
    /// -------
    /// depth, standard_error : ndarray
    ///     In metres. None if there is no contact, if the object is not a ball, or if force or
    ///     layers are unknown.
    fn guide_depression<'py>(
        &self,
        py: Python<'py>,
        frame: i64,
        distances: Vec<f64>,
    ) -> PyResult<Option<ValuesAndErrors<'py>>> {
        let frame = self.nth(py, frame)?;
        let depths = self.ask(py, |press| press.guide_depression_m(frame, &distances))?;
        Ok(depths.map(|depths| {
            let values = depths.iter().map(|depth| depth.value);
            let errors = depths.iter().map(|depth| depth.standard_error);
            (
                PyArray1::from_iter(py, values),
                PyArray1::from_iter(py, errors),
            )
        }))
    }

    /// The reconstructed surface of a frame.
    fn surface(&self, py: Python<'_>, frame: i64) -> PyResult<Surface> {
        let frame = self.nth(py, frame)?;
        let surface = self.ask(py, |press| press.surface(frame).cloned())?;
        Ok(surface_result(py, surface))
    }

    /// Control points of a frame in metres, (n, 3).
    fn control_points<'py>(
        &self,
        py: Python<'py>,
        frame: i64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let frame = self.nth(py, frame)?;
        let points = self.ask(py, |press| press.control_points(frame).map(arrays::rows))?;
        Ok(PyArray2::from_owned_array(py, points))
    }

    /// The match of the control points of the first frame with those of a frame.
    fn matching(&self, py: Python<'_>, frame: i64) -> PyResult<Match> {
        let frame = self.nth(py, frame)?;
        self.ask(py, |press| {
            let sets = [press.control_points(0)?, press.control_points(frame)?];
            let found = press.matching(frame)?;
            Ok(Python::attach(|py| answer(py, found, sets)))
        })
    }

    /// Mean strain between the first frame and a frame.
    fn strain(&self, py: Python<'_>, frame: i64) -> PyResult<Strain> {
        let frame = self.nth(py, frame)?;
        let strain = self.ask(py, |press| press.strain(frame).cloned())?;
        Ok(strain_result(py, &strain))
    }

    /// Young's modulus from all frames.
    ///
    /// Raises
    /// ------
    /// TactileError
    ///     No frame with a contact and a force, or loads that do not determine the modulus.
    fn modulus(&self, py: Python<'_>) -> PyResult<Modulus> {
        Ok(modulus(&self.ask(py, |press| press.modulus())?))
    }

    /// The moduli from all estimators that can be used with the frames.
    fn estimates(&self, py: Python<'_>) -> PyResult<Vec<Modulus>> {
        let estimates = self.ask(py, |press| press.estimates())?;
        Ok(estimates.iter().map(modulus).collect())
    }

    /// All results as a dictionary of plain values, `Measurement` for type checkers. They are those of
    /// `tactile measure --json`, whose `cautions` are `flags` here, with frames counted from zero. A
    /// missing result has its reason.
    fn measure<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self.ask(py, |press| Ok(serde_json::to_string(&press.measure())))?;
        let text = text.map_err(errors::invalid)?;
        let found = py.import("json")?.call_method1("loads", (text,))?;
        found.call_method1("setdefault", ("flags", PyList::empty(py)))?;
        Ok(found)
    }

    /// All results as text, with the reasons of missing ones.
    fn summary(&self, py: Python<'_>) -> PyResult<String> {
        self.ask(py, |press| Ok(press.measure().to_string()))
    }

    /// Draws a frame with its contact, and the reconstructed surface.
    ///
    /// Parameters
    /// ----------
    /// frame : int
    ///     Index of the frame, counted from the end if negative.
    ///
    /// Returns
    /// -------
    /// matplotlib.figure.Figure
    ///
    /// Raises
    /// ------
    /// ImportError
    ///     matplotlib is not installed.
    #[pyo3(signature = (frame=-1), text_signature = "($self, frame=-1)")]
    fn plot<'py>(slf: &Bound<'py, Self>, frame: i64) -> PyResult<Bound<'py, PyAny>> {
        let plots = slf.py().import("tactile_imaging._plot")?;
        plots.call_method1("plot_press", (slf, frame))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("Press({} frames)", self.__len__(py)?))
    }
}

/// A press that owns its frames.
fn press_of_scene(path: PathBuf) -> Result<rust::Press<'static>, FileError> {
    let scene = Scene::read(path)?;
    let data = scene.load()?;
    let press = scene.pipeline(&data)?.press(data.reference.view());
    let mut press = press.map_err(|error| scene.measure_error(error))?;
    for (frame, image) in scene.frames.iter().zip(data.frames) {
        let error_n = frame.force_error_n.unwrap_or(0.0);
        let gauge = frame
            .force_n
            .map(|force_n| CoreEstimate::new(force_n, error_n));
        let number = press.add_gauged_frame(image, gauge);
        if let Some(time_s) = frame.time_s {
            let set = press.set_time_s(number, time_s);
            set.map_err(|error| scene.measure_error(error))?;
        }
    }
    Ok(press)
}

fn contact(py: Python<'_>, frame: usize, reading: &ContactReading) -> PyResult<Contact> {
    let estimate = |estimate| Estimate::of(py, estimate);
    let [x, y] = reading.centroid_px;
    Ok(Contact {
        text: reading.to_string(),
        force: (reading.force_n.map(|force| estimate(force.total()))).transpose()?,
        radius: estimate(reading.contact_radius_m.total())?,
        indentation: reading.indentation_m.map(estimate).transpose()?,
        x: estimate(x)?,
        y: estimate(y)?,
        area: reading.area_m2,
        touches_edge: reading.touches_edge,
        flags: reading.flags(frame).map(|flag| flag.to_string()).collect(),
    })
}

pub(crate) fn surface_result(py: Python<'_>, surface: ContactSurface) -> Surface {
    let heights = surface.surface.heights;
    Surface {
        text: format!("{} × {} heights", heights.nrows(), heights.ncols()),
        heights: arrays::kept(py, heights),
        pixel_size: surface.pixel_size_m.into(),
        origin: surface.origin_m.into(),
    }
}

fn strain_result(py: Python<'_>, strain: &PairStrain) -> Strain {
    let summary = &strain.summary;
    let (mean, error) = (summary.mean, summary.standard_error);
    let points = summary.folded.len();
    let folded = (points > 0).then(|| Flag::Folded { points }.to_string());
    Strain {
        text: format!("{}: {}", strain.measure, tensor_text(&mean, &error)),
        value: arrays::kept_tensor(py, &mean),
        standard_error: arrays::kept_tensor(py, &error),
        spread: arrays::kept_tensor(py, &summary.spread),
        measure: strain.measure.into(),
        used: summary.used,
        flags: folded.into_iter().collect(),
    }
}

pub(crate) fn modulus(estimate: &ModulusEstimate) -> Modulus {
    Modulus {
        text: rust::pipeline::ModulusResult::from(estimate).to_string(),
        value: estimate.youngs_modulus_pa,
        standard_error: estimate.standard_error_pa,
        interval_95: ends(estimate.interval_95),
        estimator: estimate.estimator.to_string(),
        flags: estimate
            .warnings
            .iter()
            .map(|warning| warning.to_string())
            .collect(),
    }
}

/// A stream of frames from one sensor and one object, with constant memory.
///
/// A session belongs to one thread at a time. Different sessions can run in parallel.
///
/// Parameters
/// ----------
/// pipeline : Pipeline
/// references : sequence of (rows, columns) arrays of uint8
///     One or more frames without contact.
#[pyclass(module = "tactile_imaging")]
pub(crate) struct Session {
    session: rust::pipeline::Session,
    /// The stages in Python, which must be visible to the garbage collector.
    own: Vec<Py<PyAny>>,
}

#[pymethods]
impl Session {
    #[new]
    fn new(
        py: Python<'_>,
        pipeline: &Pipeline,
        references: Vec<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let read = |frame| arrays::frame("references", frame);
        let frames: Vec<_> = references.iter().map(read).collect::<PyResult<_>>()?;
        let views: Vec<_> = frames.iter().map(|frame| frame.as_array()).collect();
        let session = py.detach(|| rust::pipeline::Session::new(&pipeline.pipeline, &views));
        let session = session.map_err(errors::pipeline)?;
        let own = pipeline
            .own
            .iter()
            .map(|stage| stage.clone_ref(py))
            .collect();
        Ok(Self { session, own })
    }

    /// Measures the next frame: its contact, or None without contact.
    fn push(&mut self, py: Python<'_>, frame: &Bound<'_, PyAny>) -> PyResult<Option<Contact>> {
        let frame = arrays::frame("frame", frame)?;
        let (session, view) = (&mut self.session, frame.as_array());
        let update = py.detach(|| session.push(view)).map_err(errors::pipeline)?;
        let number = update.frame as usize;
        let reading = update.contact;
        reading
            .map(|reading| contact(py, number, &reading))
            .transpose()
    }

    fn __len__(&self) -> usize {
        self.session.frames() as usize
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.own.iter().try_for_each(|stage| visit.call(stage))
    }

    /// Mean strain since the load of the first call, for which it is None.
    fn strain(&mut self, py: Python<'_>) -> PyResult<Option<Strain>> {
        let session = &mut self.session;
        let strain = py.detach(|| Ok(session.strain()?.map(|followed| followed.strain.clone())));
        let strain = strain.map_err(errors::pipeline)?;
        Ok(strain.map(|strain| strain_result(py, &strain)))
    }

    /// Young's modulus from all frames so far.
    fn modulus(&mut self, py: Python<'_>) -> PyResult<Modulus> {
        let session = &mut self.session;
        let estimate = py.detach(|| session.modulus());
        Ok(modulus(&estimate.map_err(errors::pipeline)?))
    }

    fn __repr__(&self) -> String {
        format!("Session({} frames)", self.session.frames())
    }
}
