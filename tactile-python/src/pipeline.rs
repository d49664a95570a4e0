//! The stages, by name or as Python objects.
use crate::arrays;
use crate::check::CheckPress;
use crate::errors::{self, invalid};
use crate::matching::Matcher;
use crate::own::{OwnContact, OwnStage};
use crate::sensor::Sensor;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use pyo3::{PyTraverseError, PyVisit};
use std::str::FromStr;
use tactile_imaging as rust;
use tactile_imaging::elasticity::contact::{Layer, Waveguide};
use tactile_imaging::elasticity::strain::{
    Biot, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, StrainMeasure,
};
use tactile_imaging::force::{CalibrationPair, ForceOptions, Source};
use tactile_imaging::matching::{AnnealedSoftassign, Search};
use tactile_imaging::pipeline::{
    Assumptions, DarkContact, EstimatorChoice, LightContact, StagesConfig, StrainChoice,
    SurfaceInput,
};

/// The object that is pressed on the sensor. Lengths are in metres.
#[pyclass(frozen, module = "tactile_imaging")]
pub(crate) struct Object(pub rust::Object);

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

    /// A cylinder on its flat face.
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

    /// A cone with the half angle in radians.
    #[classmethod]
    #[pyo3(signature = (half_angle, *, poisson_ratio=0.5))]
    fn cone(_class: &Bound<'_, PyType>, half_angle: f64, poisson_ratio: f64) -> Self {
        let half_angle_rad = half_angle;
        Self(rust::Object::Cone {
            half_angle_rad,
            poisson_ratio,
        })
    }

    /// A layer into which a ball is pressed.
    #[classmethod]
    #[pyo3(signature = (indenter_radius, thickness, *, poisson_ratio=0.5))]
    fn layer(
        _class: &Bound<'_, PyType>,
        indenter_radius: f64,
        thickness: f64,
        poisson_ratio: f64,
    ) -> Self {
        Self(rust::Object::Layer {
            indenter_radius_m: indenter_radius,
            thickness_m: thickness,
            poisson_ratio,
        })
    }

    /// An object of unknown shape. It counts as flat if its contacts are those of a flat face.
    #[classmethod]
    #[pyo3(signature = (*, poisson_ratio=0.5))]
    fn unknown(_class: &Bound<'_, PyType>, poisson_ratio: f64) -> Self {
        Self(rust::Object::Unknown { poisson_ratio })
    }

    fn __repr__(&self) -> String {
        use rust::Object as Kind;
        let ratio = self.0.poisson_ratio();
        let (kind, sizes) = match self.0 {
            Kind::Sphere { radius_m, .. } => ("sphere", format!("radius={radius_m}, ")),
            Kind::Block { .. } => ("block", String::new()),
            Kind::Cylinder { .. } => ("cylinder", String::new()),
            Kind::FlatPunch { radius_m, .. } => ("flat_punch", format!("radius={radius_m}, ")),
            Kind::Cone { half_angle_rad, .. } => ("cone", format!("half_angle={half_angle_rad}, ")),
            Kind::Layer {
                indenter_radius_m,
                thickness_m,
                ..
            } => (
                "layer",
                format!("indenter_radius={indenter_radius_m}, thickness={thickness_m}, "),
            ),
            _ => ("unknown", String::new()),
        };
        format!("Object.{kind}({sizes}poisson_ratio={ratio})")
    }
}

/// The stages from a frame to Young's modulus.
///
/// A stage is a name or an object with the method of the stage. An exception of the object, or a
/// result of the wrong shape, gives a `TactileError` with this cause.
///
/// Parameters
/// ----------
/// object : Object
///     The object that is pressed on the sensor.
/// pairs : (n, 2) array
///     Integrated pixel values and forces in newtons of a calibration. Without them forces come from
///     a gauge, `Press.add_frame(..., gauge=)`.
/// sensor : Sensor
///     A calibrated sensor, instead of `pairs`, `pixel_size` and `waveguide`.
/// depth_table : (n, 2) array
///     Grey levels below the reference and depths in metres, for a sensor that darkens.
/// contact : object
///     A user-defined contact stage instead of these: an object with a method
///     `measure(frame, reference)` that returns None or a dict with `radius` (m) and `force` (N) as
///     (value, standard error), `mask` and `centre`.
/// pixel_size : float or (x, y)
///     Size of a pixel in metres.
/// waveguide : (k, 3) array
///     Thickness in metres, Young's modulus in pascals and Poisson's ratio of its layers, from the
///     side of the object. None is a rigid flat.
/// control_points : int
///     Number of points that are matched.
/// surface : str or object
///     "eikonal", "tsai-shah", or `reconstruct(image, mask, pixel_size)`.
/// sampler : str or object
///     "contact", "equally-spaced", or `sample(heights, mask, pixel_size, count)`.
/// matcher, matcher_options : str or object, dict
///     As in `match_points`. The default search is for neighbouring loads.
/// warp : str or object
///     "thin-plate-spline", "cubic-spline", "affine", "rigid", or `fit(sources, targets, weights)`
///     that returns a callable with a method `jacobian`.
/// strain : str or object
///     "green-lagrange", "euler-almansi", "hencky", "biot", "infinitesimal", or
///     `strain(deformation_gradient)`.
/// estimator : str or object
///     "best", "paper-ratio", "regression", "sphere", "sphere-on-waveguide", "flat-punch", "cone"
///     and others, or `estimate(loads)` that returns a modulus in pascals and its standard error.
///     Its attribute `needs_strain` determines whether loads have strains. If its attribute
///     `counts_guide` is true, the call is `estimate(loads, layers)` with layers as in `waveguide`.
///     Otherwise the modulus has a warning if the guide is compliant.
/// flat_field : bool
///     Whether frames are divided by the brightness of the reference.
/// gauge_error, coupling_error, pixel_size_error, layer_error, radius_error,
/// poisson_ratio_error, adhesion_error : float
///     Standard errors common to all loads, named as in scene files: the first four are relative,
///     the others in metres, absolute, and in J/m². The defaults are 0.22 %, 12 %, 0.3 %, 5 %, 0.5 %
///     of the radius, 0.01, and 0.001 J/m².
///
/// Raises
/// ------
/// ValueError
///     An unknown name, or an unphysical value.
#[pyclass(frozen, module = "tactile_imaging")]
pub(crate) struct Pipeline {
    pub pipeline: rust::Pipeline,
    /// The stages in Python, which must be visible to the garbage collector.
    pub own: Vec<Py<PyAny>>,
}

#[pymethods]
impl Pipeline {
    #[new]
    #[pyo3(signature = (
        object, *, pairs=None, sensor=None, depth_table=None, contact=None, pixel_size=None,
        waveguide=None, control_points=200, surface=None, sampler=None,
        matcher=None, matcher_options=None, warp=None, strain=None, estimator=None,
        flat_field=None, gauge_error=None, coupling_error=None, pixel_size_error=None,
        layer_error=None, radius_error=None, poisson_ratio_error=None, adhesion_error=None
    ))]
    fn new(
        object: &Object,
        pairs: Option<&Bound<'_, PyAny>>,
        sensor: Option<&Sensor>,
        depth_table: Option<&Bound<'_, PyAny>>,
        contact: Option<&Bound<'_, PyAny>>,
        pixel_size: Option<&Bound<'_, PyAny>>,
        waveguide: Option<&Bound<'_, PyAny>>,
        control_points: usize,
        surface: Option<&Bound<'_, PyAny>>,
        sampler: Option<&Bound<'_, PyAny>>,
        matcher: Option<&Bound<'_, PyAny>>,
        matcher_options: Option<&Bound<'_, PyDict>>,
        warp: Option<&Bound<'_, PyAny>>,
        strain: Option<&Bound<'_, PyAny>>,
        estimator: Option<&Bound<'_, PyAny>>,
        flat_field: Option<bool>,
        gauge_error: Option<f64>,
        coupling_error: Option<f64>,
        pixel_size_error: Option<f64>,
        layer_error: Option<f64>,
        radius_error: Option<f64>,
        poisson_ratio_error: Option<f64>,
        adhesion_error: Option<f64>,
    ) -> PyResult<Self> {
        let stages = [contact, surface, sampler, matcher, warp, strain, estimator];
        let own = stages
            .into_iter()
            .flatten()
            .map(|given| given.clone().unbind());
        let own = own.collect();
        let (surface_name, own_surface) = stage("surface", "reconstruct", surface)?;
        let (sampler_name, own_sampler) = stage("sampler", "sample", sampler)?;
        let (warp_name, own_warp) = stage("warp", "fit", warp)?;
        let (estimator_name, own_estimator) = stage("estimator", "estimate", estimator)?;
        let config = StagesConfig {
            reconstruction: named(surface_name)?,
            sampler: named(sampler_name)?,
            warp: named(warp_name)?,
            estimator: named::<EstimatorChoice>(estimator_name)?,
            ..StagesConfig::default()
        };
        let near = AnnealedSoftassign::default().with_search(Search::Near);
        let matcher = Matcher::new(matcher, matcher_options, near)?;
        let guide = waveguide.map(guide).transpose()?;
        let sources = [pairs, depth_table, contact];
        let pipeline = started(object.0, &config, sensor, sources, pixel_size)?;
        let mut pipeline = (pipeline.with_settings(|settings| {
            if guide.is_some() {
                settings.waveguide = guide;
            }
            settings.flat_field = flat_field.unwrap_or(settings.flat_field);
            let size_error = radius_error.zip(settings.object.radius_m());
            let mut errors = Assumptions::default();
            for (source, stated) in [
                (Source::Gain, gauge_error),
                (Source::Coupling, coupling_error),
                (Source::PixelSize, pixel_size_error),
                (Source::Guide, layer_error),
                (
                    Source::ObjectSize,
                    size_error.map(|(error, radius)| error / radius),
                ),
                (Source::PoissonRatio, poisson_ratio_error),
                (Source::Adhesion, adhesion_error),
            ] {
                if let Some(error) = stated {
                    errors.state(source, error);
                }
            }
            settings.state_errors(&errors);
        }))
        .map_err(errors::pipeline)?
        .with_control_points(control_points)
        .with_matcher(matcher.boxed::<3>());
        if let Some(own) = own_surface {
            pipeline = pipeline.with_surface(own, SurfaceInput::Shading);
        }
        if let Some(own) = own_sampler {
            pipeline = pipeline.with_sampler(own);
        }
        if let Some(own) = own_warp {
            pipeline = pipeline.with_warp(own);
        }
        if let Some(given) = strain {
            pipeline = pipeline.with_strain(strain_measure("strain", given)?);
        }
        if let Some(own) = own_estimator {
            pipeline = pipeline.with_estimator(own);
        }
        Ok(Self { pipeline, own })
    }

    /// Creates a press on this pipeline, with the frame without contact.
    fn press<'py>(
        slf: &Bound<'py, Self>,
        reference: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        // By name, because the module of presses depends on that of pipelines.
        let module = slf.py().import("tactile_imaging._native")?;
        module.getattr("Press")?.call1((slf, reference))
    }

    /// Creates a pipeline that uses presses of known force.
    ///
    /// Presses of the sample or the calibration object give the gain of the light, by which forces
    /// are divided. Presses of balls of known modulus give the layers of the waveguide.
    ///
    /// Parameters
    /// ----------
    /// reference : (rows, columns) array of uint8
    ///     The frame without contact for all these presses.
    /// checks : sequence of CheckPress
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A press that is unreliable or contradicts the stated values.
    fn with_checks(
        &self,
        py: Python<'_>,
        reference: &Bound<'_, PyAny>,
        checks: Vec<PyRef<'_, CheckPress>>,
    ) -> PyResult<Self> {
        let reference = arrays::frame("reference", reference)?;
        let view = reference.as_array();
        let presses = checks.iter();
        let presses: Vec<_> = presses
            .map(|c| rust::pipeline::CheckPress::new(c.frame.view(), c.known_n, c.object))
            .collect();
        let checked = py.detach(|| self.pipeline.clone().with_checks(view, &presses));
        let pipeline = checked.map_err(errors::pipeline)?;
        let own = self.own.iter().map(|stage| stage.clone_ref(py)).collect();
        Ok(Self { pipeline, own })
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.own.iter().try_for_each(|stage| visit.call(stage))
    }

    fn __repr__(&self) -> String {
        let settings = self.pipeline.settings();
        let (object, points) = (Object(settings.object).__repr__(), settings.control_points);
        format!("Pipeline({object}, control_points={points})")
    }
}

/// The source of force and contact: a sensor, or at most one of calibration pairs, a table of depths
/// and an object.
fn started(
    object: rust::Object,
    config: &StagesConfig,
    sensor: Option<&Sensor>,
    sources: [Option<&Bound<'_, PyAny>>; 3],
    pixel_size: Option<&Bound<'_, PyAny>>,
) -> PyResult<rust::Pipeline> {
    let others = sources.iter().filter(|given| given.is_some()).count();
    if others + usize::from(sensor.is_some()) > 1 {
        return Err(PyTypeError::new_err(
            "only one of pairs, sensor, depth_table and contact may be given",
        ));
    }
    if let Some(Sensor(sensor)) = sensor {
        let pipeline = sensor.pipeline(object);
        let staged = pipeline.and_then(|pipeline| pipeline.with_stages(config));
        return staged.map_err(errors::pipeline);
    }
    let [pairs, depth_table, contact] = sources;
    let missing = || PyTypeError::new_err("pixel_size is missing");
    let size = arrays::pixel_size(pixel_size.ok_or_else(missing)?)?;
    let pipeline = if let Some(contact) = contact {
        let stage = OwnStage::new("contact", "measure", contact)?;
        let pixel_size_m = size;
        rust::Pipeline::new(
            OwnContact {
                stage,
                pixel_size_m,
            },
            object,
        )
    } else if let Some(table) = depth_table {
        let table = arrays::columns::<2>("depth_table", table)?;
        let table: Vec<(f64, f64)> = table.into_iter().map(Into::into).collect();
        let contact = DarkContact::new(&table, size).map_err(errors::pipeline)?;
        let depths = DarkContact::depth_table(&table).map_err(errors::pipeline)?;
        return rust::Pipeline::new(contact, object)
            .and_then(|pipeline| pipeline.with_stages(config))
            .map(|pipeline| pipeline.with_surface(depths, SurfaceInput::Signal))
            .map_err(errors::pipeline);
    } else if let Some(pairs) = pairs {
        let pair = |[light, force]: [f64; 2]| CalibrationPair::loading(light, force);
        let pairs = arrays::columns::<2>("pairs", pairs)?;
        let pairs: Vec<_> = pairs.into_iter().map(pair).collect();
        rust::Pipeline::from_pairs(&pairs, size, object)
    } else {
        LightContact::gauged(size, &ForceOptions::default())
            .and_then(|contact| rust::Pipeline::new(contact, object))
    };
    let staged = pipeline.and_then(|pipeline| pipeline.with_stages(config));
    staged.map_err(errors::pipeline)
}

/// A stage as its name, or as an object without a name.
fn stage(
    name: &str,
    method: &'static str,
    given: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Option<String>, Option<OwnStage>)> {
    let Some(given) = given else {
        return Ok((None, None));
    };
    match given.extract::<String>() {
        Ok(text) => Ok((Some(text), None)),
        Err(_) => Ok((None, Some(OwnStage::new(name, method, given)?))),
    }
}

/// A choice by its name, or the default without a name.
pub(crate) fn named<T: FromStr<Err: ToString> + Default>(name: Option<String>) -> PyResult<T> {
    name.map_or_else(|| Ok(T::default()), |name| name.parse().map_err(invalid))
}

type SharedMeasure = Box<dyn StrainMeasure + Send + Sync>;

/// A strain measure by its name, or an object with a method `strain`.
pub(crate) fn strain_measure(name: &str, given: &Bound<'_, PyAny>) -> PyResult<SharedMeasure> {
    let (text, own) = stage(name, "strain", Some(given))?;
    if let Some(own) = own {
        return Ok(Box::new(own));
    }
    Ok(match named::<StrainChoice>(text)? {
        StrainChoice::EulerAlmansi => Box::new(EulerAlmansi),
        StrainChoice::Hencky => Box::new(Hencky),
        StrainChoice::Biot => Box::new(Biot),
        StrainChoice::Infinitesimal => Box::new(Infinitesimal),
        _ => Box::new(GreenLagrange),
    })
}

/// A waveguide of layers: thickness in metres, Young's modulus in pascals, Poisson's ratio.
pub(crate) fn guide(layers: &Bound<'_, PyAny>) -> PyResult<Waveguide> {
    let layer = |[thickness_m, youngs_modulus_pa, poisson_ratio]: [f64; 3]| Layer {
        thickness_m,
        youngs_modulus_pa,
        poisson_ratio,
    };
    let layers = arrays::columns::<3>("waveguide", layers)?;
    Waveguide::new(layers.into_iter().map(layer).collect()).map_err(invalid)
}
