//! Heights from one image, from slopes, or from darkening.
use crate::arrays;
use crate::errors::{self, Signals, invalid};
use crate::pipeline::named;
use crate::press::surface_result;
use crate::results::Surface as SurfaceResult;
use ndarray::Array2;
use numpy::PyArray2;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex};
use tactile_imaging as rust;
use tactile_imaging::pipeline::{DarkContact, ReconstructionChoice, SurfaceInput};
use tactile_imaging::sfs::{
    BoundaryCondition, CosinePoisson, Domain, Eikonal, Image, Lighting, MaskedLeastSquares,
    SfsError, SlopeIntegrator, Surface, SurfaceReconstruction, SurfaceWorkspace, TsaiShah,
};

/// Computes the heights of a surface from one shaded image.
///
/// Grey levels are modelled as ambient + intensity max(0, n·s) with the surface normal n and the
/// direction s to the light.
///
/// Parameters
/// ----------
/// image : (rows, columns) array
/// light : (x, y, z)
///     Direction to the light: x right, y down the image, z to the viewer. If it is None, the light
///     comes from the viewer.
/// method : str
///     "eikonal" or "tsai-shah". By default "eikonal" under frontal light with a mask, else
///     "tsai-shah".
/// mask : (rows, columns) array of bool
///     True at pixels with a height. At its border heights are zero ("eikonal").
/// pixel_size : float or (x, y)
///     Size of a pixel. Heights have its unit.
/// intensity, ambient : float
///     Grey level above the ambient of a surface that faces the light, and the ambient.
///
/// Returns
/// -------
/// (rows, columns) array
///     NaN at pixels without a height.
#[pyfunction]
#[pyo3(signature = (
    image, *, light=None, method=None, mask=None, pixel_size=None, intensity=1.0,
    ambient=0.0
))]
pub(crate) fn reconstruct<'py>(
    py: Python<'py>,
    image: &Bound<'py, PyAny>,
    light: Option<(f64, f64, f64)>,
    method: Option<String>,
    mask: Option<&Bound<'py, PyAny>>,
    pixel_size: Option<&Bound<'py, PyAny>>,
    intensity: f64,
    ambient: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let light = light.unwrap_or((0.0, 0.0, 1.0));
    let image = arrays::matrix("image", image)?;
    let mask = mask.map(|mask| arrays::mask("mask", mask)).transpose()?;
    let size = pixel_size.map_or(Ok([1.0; 2]), arrays::pixel_size)?;
    let lighting = Lighting::new(light.into())
        .and_then(|lighting| lighting.with_normal_intensity(intensity))
        .and_then(|lighting| lighting.with_ambient(ambient))
        .map_err(invalid)?;
    let frontal = (light.0, light.1) == (0.0, 0.0);
    let rimmed = frontal && mask.is_some();
    let choice = match method {
        None if !rimmed => ReconstructionChoice::TsaiShah,
        method => named(method)?,
    };
    let method: Box<dyn SurfaceReconstruction<f64> + Send + Sync> = match choice {
        ReconstructionChoice::TsaiShah => Box::new(TsaiShah::new(lighting)),
        _ => {
            let rim = match mask.is_some() {
                true => BoundaryCondition::Height(0.0),
                false => BoundaryCondition::Free,
            };
            Box::new(Eikonal::new(lighting).with_boundary(rim).map_err(invalid)?)
        }
    };
    let view = image.as_array();
    let heights = heights(py, size, mask.as_ref(), |workspace, domain, surface| {
        method.reconstruct_with(workspace, Image::new(view, *domain), surface)
    });
    Ok(PyArray2::from_owned_array(py, heights?))
}

/// Heights by a method that `KeyboardInterrupt` stops.
fn heights(
    py: Python<'_>,
    pixel_size: [f64; 2],
    mask: Option<&Array2<bool>>,
    method: impl Send
    + FnOnce(
        &mut SurfaceWorkspace<f64>,
        &Domain<'_, f64>,
        &mut Surface<f64>,
    ) -> Result<(), SfsError>,
) -> PyResult<Array2<f64>> {
    let signals = Arc::new(Mutex::new(Signals::new()));
    let found = py.detach(|| -> Result<_, SfsError> {
        let mut domain = Domain::new(pixel_size)?;
        if let Some(mask) = mask {
            domain = domain.with_mask(mask.view());
        }
        let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
        let watch = errors::watch_of(&signals);
        workspace.on_progress(move |_| watch());
        method(&mut workspace, &domain, &mut surface)?;
        Ok(surface.heights)
    });
    let mut signals = signals.lock().unwrap_or_else(|broken| broken.into_inner());
    signals.finish()?;
    found.map_err(errors::refused)
}

/// Computes the heights whose slopes are closest to the given ones, with mean zero.
///
/// Parameters
/// ----------
/// slope_x, slope_y : (rows, columns) arrays
///     ∂z/∂x along a row and ∂z/∂y down the rows.
/// pixel_size : float or (x, y)
///     Size of a pixel. Heights have its unit.
/// method : str
///     "poisson" (the default) or "least-squares" (the default with a mask).
/// mask : (rows, columns) array of bool
///     True at pixels with a height.
///
/// Returns
/// -------
/// (rows, columns) array
///     NaN at pixels without a height.
#[pyfunction]
#[pyo3(signature = (slope_x, slope_y, pixel_size=None, *, method=None, mask=None))]
pub(crate) fn integrate<'py>(
    py: Python<'py>,
    slope_x: &Bound<'py, PyAny>,
    slope_y: &Bound<'py, PyAny>,
    pixel_size: Option<&Bound<'py, PyAny>>,
    method: Option<&str>,
    mask: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let slopes = [
        arrays::matrix("slope_x", slope_x)?,
        arrays::matrix("slope_y", slope_y)?,
    ];
    let size = pixel_size.map_or(Ok([1.0; 2]), arrays::pixel_size)?;
    let mask = mask.map(|mask| arrays::mask("mask", mask)).transpose()?;
    let default = match mask {
        Some(_) => "least-squares",
        None => "poisson",
    };
    let integrator: Box<dyn SlopeIntegrator<f64> + Send + Sync> = match method.unwrap_or(default) {
        "poisson" => Box::new(CosinePoisson),
        "least-squares" => Box::new(MaskedLeastSquares::default()),
        other => {
            return Err(invalid(format!(
                "method must be \"poisson\" or \"least-squares\", found {other:?}"
            )));
        }
    };
    let [p, q] = slopes.each_ref().map(|slope| slope.as_array());
    let heights = heights(py, size, mask.as_ref(), |workspace, domain, surface| {
        integrator.integrate_with(workspace, p, q, domain, surface)
    });
    Ok(PyArray2::from_owned_array(py, heights?))
}

/// Computes the depth of the contact in a frame of a sensor that darkens under pressure.
///
/// Parameters
/// ----------
/// frame, reference : (rows, columns) arrays of uint8
/// table : (n, 2) array
///     Grey levels below the reference and depths in metres.
/// pixel_size : float or (x, y)
///     Size of a pixel in metres.
///
/// Returns
/// -------
/// Surface or None
///     None without contact.
#[pyfunction]
pub(crate) fn depth(
    py: Python<'_>,
    frame: &Bound<'_, PyAny>,
    reference: &Bound<'_, PyAny>,
    table: &Bound<'_, PyAny>,
    pixel_size: &Bound<'_, PyAny>,
) -> PyResult<Option<SurfaceResult>> {
    let frames = [
        arrays::frame("frame", frame)?,
        arrays::frame("reference", reference)?,
    ];
    let [frame, reference] = frames.each_ref().map(|frame| frame.as_array());
    let table = arrays::columns::<2>("table", table)?;
    let table: Vec<(f64, f64)> = table.into_iter().map(Into::into).collect();
    let size = arrays::pixel_size(pixel_size)?;
    // The depth follows from the table for any object.
    let unknown = rust::Object::Unknown {
        poisson_ratio: rust::Object::DEFAULT_POISSON_RATIO,
    };
    let found = py.detach(|| {
        let pipeline = rust::Pipeline::new(DarkContact::new(&table, size)?, unknown)?
            .with_surface(DarkContact::depth_table(&table)?, SurfaceInput::Signal);
        let mut press = pipeline.press(reference)?;
        press.add_frame(frame);
        match press.contact(0)? {
            Some(_) => press.surface(0).cloned().map(Some),
            None => Ok(None),
        }
    });
    let found = found.map_err(errors::pipeline)?;
    Ok(found.map(|surface| surface_result(py, surface)))
}
