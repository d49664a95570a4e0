//! Stages written in Python: objects with the method of the trait, by name and arguments.
use crate::arrays::{self, kept_tensor};
use crate::errors::invalid;
use crate::results::{Estimate, Load};
use nalgebra::{Matrix3, Point, Point3, SMatrix};
use ndarray::{Array2, ArrayView2};
use numpy::{PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyWeakrefMethods, PyWeakrefReference};
use std::sync::Arc;
use tactile_imaging::core::Estimate as CoreEstimate;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::elasticity::modulus::{
    EstimatorKind, LoadSeries, ModulusEstimate, ModulusEstimator, Uncertain,
};
use tactile_imaging::elasticity::strain::{Deformation, StrainMeasure};
use tactile_imaging::force::{ForceError, ReferenceFrame};
use tactile_imaging::matching::{MatchError, Matching, PointMatcher};
use tactile_imaging::pipeline::{ContactReading, ContactStage, FrameContact};
use tactile_imaging::sfs::{
    ControlPointSampler, Domain, Image, SfsError, Surface, SurfaceReconstruction,
};
use tactile_imaging::tps::{TpsError, Warp, WarpModel};

/// An object with the method of a stage.
///
/// The reference is weak if the object allows it. The pipeline or the press keeps the object alive,
/// visible to the garbage collector, because an object that refers to its own press is a cycle.
#[derive(Clone)]
pub(crate) struct OwnStage {
    object: Arc<Held>,
    method: &'static str,
}

enum Held {
    Weakly(Py<PyWeakrefReference>),
    Strongly(Py<PyAny>),
}

impl OwnStage {
    /// Creates the stage `name` from an object with its method. The name of a built-in stage is an
    /// error.
    pub(crate) fn new(
        name: &str,
        method: &'static str,
        given: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        if !given.hasattr(method)? {
            return Err(PyTypeError::new_err(format!(
                "{name} must be a name or an object with a method {method}, found {}",
                given.get_type().name()?
            )));
        }
        let held = match PyWeakrefReference::new(given) {
            Ok(weak) => Held::Weakly(weak.unbind()),
            Err(_) => Held::Strongly(given.clone().unbind()),
        };
        let object = Arc::new(held);
        Ok(Self { object, method })
    }

    fn object<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &*self.object {
            Held::Strongly(object) => Ok(object.bind(py).clone()),
            Held::Weakly(weak) => {
                let gone = || invalid(format!("the stage with {} is gone", self.method));
                weak.bind(py).upgrade().ok_or_else(gone)
            }
        }
    }

    fn call<'py>(
        &self,
        py: Python<'py>,
        arguments: impl pyo3::call::PyCallArgs<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.object(py)?.call_method1(self.method, arguments)
    }

    /// Heights, which must have the requested shape.
    fn heights(
        &self,
        answer: &Bound<'_, PyAny>,
        expected: (usize, usize),
    ) -> PyResult<Array2<f64>> {
        let what = format!("the heights of {}", self.method);
        let heights = arrays::matrix(&what, answer)?;
        let heights = arrays::owned(heights.as_array());
        if heights.dim() != expected {
            let found = heights.dim();
            return Err(invalid(format!(
                "{what} must have the shape {expected:?} of the image, found {found:?}"
            )));
        }
        match heights.iter().any(|height| height.is_infinite()) {
            true => Err(invalid(format!(
                "{what} must be finite, or NaN where there are none"
            ))),
            false => Ok(heights),
        }
    }

    fn pairs<const D: usize>(
        &self,
        py: Python<'_>,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> PyResult<Matching<D>> {
        let array = |points| PyArray2::from_owned_array(py, arrays::rows(points));
        let answer = self.call(py, (array(model), array(target)))?;
        let (assignment, confidence) = if let Ok(both) = answer.cast::<PyTuple>() {
            (both.get_item(0)?, Some(both.get_item(1)?))
        } else if answer.hasattr("assignment")? {
            (
                answer.getattr("assignment")?,
                answer.getattr_opt("confidence")?,
            )
        } else {
            (answer, None)
        };
        let rows = arrays::indices("the assignment of match_points", &assignment)?;
        let confidence = match confidence {
            Some(given) => arrays::vector("the confidence of match_points", &given)?,
            None => vec![1.0; rows.len()],
        };
        let (expected, found) = (model.len(), [rows.len(), confidence.len()]);
        if found != [expected; 2] {
            return Err(invalid(format!(
                "match_points must return an assignment and a confidence for each of {expected} \
                 model points, found {} and {}",
                found[0], found[1]
            )));
        }
        let mut pairs = Vec::with_capacity(expected);
        for (i, (&row, &confidence)) in rows.iter().zip(&confidence).enumerate() {
            match usize::try_from(row) {
                Ok(j) => pairs.push((i, j, confidence)),
                Err(_) if row == -1 => {}
                Err(_) => {
                    return Err(invalid(format!(
                        "match_points must return rows of the target or -1, found {row}"
                    )));
                }
            }
        }
        // A repeated row or a NaN confidence is also an error of the stage.
        Matching::from_pairs(model, target, &pairs)
            .map_err(|error| invalid(format!("match_points: {error}")))
    }
}

/// `match_points(model, target)` returns the target row of every model point (−1 for none), or these
/// rows and their confidences as a tuple or as the attributes `assignment` and `confidence`.
impl<const D: usize> PointMatcher<D> for OwnStage {
    fn match_points(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        Python::attach(|py| self.pairs(py, model, target)).map_err(MatchError::custom)
    }
}

/// The pixels to be reconstructed, as an array.
fn mask_of(domain: &Domain<'_, f64>, shape: (usize, usize)) -> Array2<bool> {
    Array2::from_shape_fn(shape, |(row, column)| domain.contains(row, column))
}

/// `reconstruct(image, mask, pixel_size)` returns heights in the unit of the pixel size.
impl SurfaceReconstruction<f64> for OwnStage {
    fn reconstruct(&self, image: Image<'_, '_, f64>) -> Result<Surface<f64>, SfsError> {
        let Image { values, domain } = image;
        let shape = values.dim();
        let heights = Python::attach(|py| {
            let image = Array2::from_shape_fn(shape, |(row, column)| values.at(row, column));
            let answer = self.call(
                py,
                (
                    PyArray2::from_owned_array(py, image),
                    PyArray2::from_owned_array(py, mask_of(&domain, shape)),
                    PyTuple::new(py, domain.pixel_size_m)?,
                ),
            )?;
            self.heights(&answer, shape)
        });
        Ok(Surface::from_heights(heights.map_err(SfsError::custom)?))
    }
}

/// `sample(heights, mask, pixel_size, count)` returns `count` points, (count, 3).
impl ControlPointSampler<f64> for OwnStage {
    fn sample(
        &self,
        heights: ArrayView2<'_, f64>,
        domain: &Domain<'_, f64>,
        count: usize,
    ) -> Result<Vec<Point3<f64>>, SfsError> {
        let points = Python::attach(|py| {
            let mask = mask_of(domain, heights.dim());
            let answer = self.call(
                py,
                (
                    PyArray2::from_array(py, &heights),
                    PyArray2::from_owned_array(py, mask),
                    PyTuple::new(py, domain.pixel_size_m)?,
                    count,
                ),
            )?;
            let points = arrays::columns::<3>("the points of sample", &answer)?;
            let finite = points.iter().flatten().all(|x| x.is_finite());
            match points.len() == count && finite {
                true => Ok(points.into_iter().map(Point3::from).collect()),
                false => Err(invalid(format!(
                    "sample must return {count} points of finite coordinates"
                ))),
            }
        });
        points.map_err(SfsError::custom)
    }
}

fn tensor(what: &str, answer: &Bound<'_, PyAny>) -> PyResult<Matrix3<f64>> {
    let array = arrays::matrix(what, answer)?;
    let view = array.as_array();
    match view.dim() == (3, 3) && view.iter().all(|entry| entry.is_finite()) {
        true => Ok(arrays::tensor(view)),
        false => Err(invalid(format!("{what} must be 3 × 3 finite numbers"))),
    }
}

/// `strain(deformation_gradient)` returns a 3 × 3 tensor.
impl StrainMeasure for OwnStage {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        let strain = Python::attach(|py| {
            let gradient = kept_tensor(py, &deformation.deformation_gradient());
            tensor("the strain of strain", &self.call(py, (gradient,))?)
        });
        strain.map_err(ElasticityError::custom)
    }

    fn name(&self) -> &'static str {
        "own measure"
    }
}

/// `estimate(loads)` returns Young's modulus in pascals and its standard error. If the attribute
/// `counts_guide` is true, the call is `estimate(loads, layers)` with the layers of the guide in the
/// format of `Pipeline`, or no layers if the guide is rigid.
impl ModulusEstimator for OwnStage {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let estimate = Python::attach(|py| {
            let loads = series.loads().iter().map(|load| Load::of(py, load));
            let loads = loads.collect::<PyResult<Vec<_>>>()?;
            let answer = if self.truth("counts_guide", false) {
                self.call(py, (loads, layers(py, series)))?
            } else {
                self.call(py, (loads,))?
            };
            let (value, error): (f64, f64) = answer.extract().map_err(|_| {
                invalid("estimate must return a modulus in pascals and its standard error")
            })?;
            match value.is_finite() && error >= 0.0 {
                true => Ok(CoreEstimate::new(value, error)),
                false => Err(invalid(format!(
                    "estimate must return finite numbers, found {value} and {error}"
                ))),
            }
        });
        Ok(ModulusEstimate::new(
            self.kind(),
            estimate.map_err(ElasticityError::custom)?,
        ))
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::Other("own estimator")
    }

    /// The attribute `needs_strain`, by default true.
    fn needs_strain(&self) -> bool {
        self.truth("needs_strain", true)
    }

    /// The attribute `counts_guide`, by default false.
    fn counts_guide(&self) -> bool {
        self.truth("counts_guide", false)
    }
}

impl OwnStage {
    /// An attribute as a boolean.
    fn truth(&self, attribute: &str, otherwise: bool) -> bool {
        Python::attach(|py| {
            let given = self.object(py).and_then(|object| object.getattr(attribute));
            given
                .and_then(|given| given.is_truthy())
                .unwrap_or(otherwise)
        })
    }
}

/// Thickness, modulus and Poisson's ratio of the layers of the guide, one row per layer.
fn layers<'py>(py: Python<'py>, series: &LoadSeries) -> Bound<'py, PyArray2<f64>> {
    let guide = series.bodies().and_then(|bodies| bodies.guide());
    let layers = guide.map_or(&[][..], |guide| guide.layers());
    let values = Array2::from_shape_fn((layers.len(), 3), |(k, column)| {
        let layer = &layers[k];
        [
            layer.thickness_m,
            layer.youngs_modulus_pa,
            layer.poisson_ratio,
        ][column]
    });
    PyArray2::from_owned_array(py, values)
}

/// `fit(sources, targets, weights)` returns a callable that maps points to points and has a method
/// `jacobian`, for example a `ThinPlateSpline`.
impl WarpModel<3> for OwnStage {
    fn fit(
        &self,
        sources: &[Point3<f64>],
        targets: &[Point3<f64>],
        weights: Option<&[f64]>,
    ) -> Result<Box<dyn Warp<3> + Send + Sync>, TpsError> {
        let fitted = Python::attach(|py| {
            let array = |points| PyArray2::from_owned_array(py, arrays::rows(points));
            let weights = weights.map(|weights| PyArray1::from_slice(py, weights));
            let fitted = self.call(py, (array(sources), array(targets), weights))?;
            // Called once at all sources, so that an invalid warp fails here.
            let warp = OwnWarp(fitted.unbind());
            warp.images(py, sources)?;
            warp.jacobians(py, sources)?;
            Ok(warp)
        });
        Ok(Box::new(
            fitted.map_err(|error: PyErr| TpsError::custom(error))?,
        ))
    }
}

struct OwnWarp(Py<PyAny>);

impl OwnWarp {
    fn images(&self, py: Python<'_>, points: &[Point3<f64>]) -> PyResult<Vec<Point3<f64>>> {
        let given = PyArray2::from_owned_array(py, arrays::rows(points));
        let answer = self.0.bind(py).call1((given,))?;
        let images = arrays::columns::<3>("the images of a warp", &answer)?;
        match images.len() == points.len() && images.iter().flatten().all(|x| x.is_finite()) {
            true => Ok(images.into_iter().map(Point3::from).collect()),
            false => Err(invalid("a warp must return a finite image of every point")),
        }
    }

    fn jacobians(&self, py: Python<'_>, points: &[Point3<f64>]) -> PyResult<Vec<Matrix3<f64>>> {
        let given = PyArray2::from_owned_array(py, arrays::rows(points));
        let answer = self.0.bind(py).call_method1("jacobian", (given,))?;
        let wrong = || invalid("jacobian must return finite float64 of shape (points, 3, 3)");
        let array = answer.cast::<PyArrayDyn<f64>>().map_err(|_| wrong())?;
        let array = array.try_readonly()?;
        let view = array.as_array();
        if array.shape() != [points.len(), 3, 3] || !view.iter().all(|x| x.is_finite()) {
            return Err(wrong());
        }
        let at = |n: usize| Matrix3::from_fn(|i, j| view[[n, i, j]]);
        Ok((0..points.len()).map(at).collect())
    }
}

/// A warp was called once when it was fitted. If a later call fails, the result is NaN, which the
/// following stages refuse.
impl Warp<3> for OwnWarp {
    fn apply(&self, point: &Point3<f64>) -> Point3<f64> {
        let image = Python::attach(|py| self.images(py, &[*point]));
        image.map_or(Point3::from([f64::NAN; 3]), |images| images[0])
    }

    fn jacobian(&self, point: &Point3<f64>) -> SMatrix<f64, 3, 3> {
        let jacobian = Python::attach(|py| self.jacobians(py, &[*point]));
        jacobian.map_or(Matrix3::from_element(f64::NAN), |jacobians| jacobians[0])
    }

    fn apply_into(
        &self,
        points: &[Point3<f64>],
        images: &mut [Point3<f64>],
    ) -> Result<(), TpsError> {
        let found = Python::attach(|py| self.images(py, points)).map_err(TpsError::custom)?;
        same_length("images", found.len(), images.len())?;
        images.copy_from_slice(&found);
        Ok(())
    }

    fn jacobian_into(
        &self,
        points: &[Point3<f64>],
        jacobians: &mut [SMatrix<f64, 3, 3>],
    ) -> Result<(), TpsError> {
        let found = Python::attach(|py| self.jacobians(py, points)).map_err(TpsError::custom)?;
        same_length("jacobians", found.len(), jacobians.len())?;
        jacobians.copy_from_slice(&found);
        Ok(())
    }
}

/// The slices of the caller must be as long as the result of the stage.
fn same_length(input: &'static str, expected: usize, found: usize) -> Result<(), TpsError> {
    match found == expected {
        true => Ok(()),
        false => Err(TpsError::Length {
            input,
            expected,
            found,
        }),
    }
}

/// `measure(frame, reference)` returns a dictionary, or None if there is no contact. It contains
/// `radius` in metres and `force` in newtons or None, both as (value, standard error), `mask` with
/// the shape of the frame, and `centre` (x, y) in pixels.
pub(crate) struct OwnContact {
    pub stage: OwnStage,
    pub pixel_size_m: [f64; 2],
}

impl OwnContact {
    fn found(&self, answer: &Bound<'_, PyAny>, expected: (usize, usize)) -> PyResult<FrameContact> {
        if answer.is_none() {
            return Ok(FrameContact::default());
        }
        let wrong = || invalid("measure must return None or a dict with radius, force and mask");
        let answer = answer.cast::<PyDict>().map_err(|_| wrong())?;
        let estimate = |name: &str| -> PyResult<Option<CoreEstimate>> {
            match answer.get_item(name)?.filter(|given| !given.is_none()) {
                None => Ok(None),
                Some(given) => {
                    let (value, error): (f64, f64) = given.extract().map_err(|_| {
                        invalid(format!("{name} must be a value and its standard error"))
                    })?;
                    match value.is_finite() && error >= 0.0 {
                        true => Ok(Some(CoreEstimate::new(value, error))),
                        false => Err(invalid(format!("{name} must be finite"))),
                    }
                }
            }
        };
        let mask = arrays::mask("mask", &answer.get_item("mask")?.ok_or_else(wrong)?)?;
        if mask.dim() != expected {
            let found = mask.dim();
            return Err(invalid(format!(
                "mask must have the frame's shape {expected:?}, found {found:?}"
            )));
        }
        let radius = estimate("radius")?.ok_or_else(wrong)?;
        let mut reading = ContactReading::new(estimate("force")?, radius);
        if let Some(centre) = answer.get_item("centre")?.filter(|given| !given.is_none()) {
            let centre: [f64; 2] = centre.extract()?;
            if centre.iter().any(|place| !place.is_finite()) {
                return Err(invalid("centre must be finite"));
            }
            reading.centroid_px = centre.map(CoreEstimate::exact);
        }
        Ok(FrameContact::new(reading, mask.view()))
    }
}

impl ContactStage for OwnContact {
    fn measure(
        &self,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<FrameContact, ForceError> {
        let contact = Python::attach(|py| {
            let frames = (
                PyArray2::from_array(py, &frame),
                PyArray2::from_array(py, &reference.image()),
            );
            self.found(&self.stage.call(py, frames)?, frame.dim())
        });
        contact.map_err(ForceError::custom)
    }

    fn pixel_size_m(&self) -> [f64; 2] {
        self.pixel_size_m
    }
}

impl Load {
    fn of(
        py: Python<'_>,
        load: &tactile_imaging::elasticity::modulus::LoadState,
    ) -> PyResult<Self> {
        let estimate = |given: Option<Uncertain>| {
            let given = given.map(|number| Estimate::of(py, number.total()));
            given.transpose()
        };
        Ok(Self {
            text: format!("{} N", load.force_n.value),
            force: Estimate::of(py, load.force_n.total())?,
            radius: estimate(load.contact_radius_m)?,
            area: estimate(load.contact_area_m2)?,
            indentation: estimate(load.indentation_m)?,
            strain: estimate(load.mean_strain)?,
        })
    }
}
