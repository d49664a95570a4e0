//! Simulated presses for trying the pipeline.
use crate::arrays;
use crate::errors::invalid;
use crate::results::SimulatedPress;
use ndarray::Array2;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tactile_simulate::{CalibrationRun, Camera, ContactModel, PressLoad, PressOptions, Trial};

/// Simulates a ball pressed on the layered sensor: frames, calibration and truth.
///
/// Parameters
/// ----------
/// forces : sequence of float
///     Forces in newtons, one per frame.
/// radius : float
///     Radius of the ball in metres.
/// youngs_modulus, poisson_ratio : float
///     Modulus of the ball in pascals, and its Poisson's ratio.
/// physics : str
///     "finite-elements", which exist for balls of 3 mm with 103 or 62 kPa up to 1.3 N, or "hertz".
/// coarser : int
///     Factor by which pixels are larger than those of 1392 × 1042 on 30 mm.
/// seed : int
///     Seed of the camera noise.
///
/// Returns
/// -------
/// SimulatedPress
#[pyfunction]
#[pyo3(signature = (
    *, forces=None, radius=3e-3, youngs_modulus=103e3, poisson_ratio=0.5,
    physics="finite-elements", coarser=1, seed=1
))]
pub(crate) fn simulate(
    py: Python<'_>,
    forces: Option<Vec<f64>>,
    radius: f64,
    youngs_modulus: f64,
    poisson_ratio: f64,
    physics: &str,
    coarser: usize,
    seed: u64,
) -> PyResult<SimulatedPress> {
    let forces = forces.unwrap_or_else(|| vec![0.7, 1.2]);
    let (law, estimator) = match physics {
        "finite-elements" => (ContactModel::FiniteElements, "best"),
        // Evaluated by the same law.
        "hertz" => (ContactModel::Hertz, "sphere"),
        other => {
            return Err(invalid(format!(
                "physics must be \"finite-elements\" or \"hertz\", found {other:?}"
            )));
        }
    };
    if coarser == 0 {
        return Err(invalid("coarser must be 1 or more, found 0"));
    }
    let mut options = PressOptions {
        law,
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
        poisson_ratio,
        estimator: estimator.into(),
        truth: truth.unbind(),
    })
}
