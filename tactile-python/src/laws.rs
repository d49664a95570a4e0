//! Contact laws: forces and radii of contacts, and moduli from them.
use crate::arrays;
use crate::errors::{self, invalid};
use crate::pipeline::{Object, guide};
use crate::press::modulus;
use crate::results::{HertzContact, Modulus};
use pyo3::prelude::*;
use tactile_imaging as rust;
use tactile_imaging::core::Estimate;
use tactile_imaging::elasticity::contact::{self, Body};
use tactile_imaging::elasticity::modulus::{LoadSeries, LoadState, ModulusEstimator};
use tactile_imaging::force::ForceOptions;
use tactile_imaging::pipeline::{LightContact, StagesConfig};

/// Hertz's contact of a ball with a flat: a³ = 3FR/(4E*), d = a²/R, p₀ = 3F/(2πa²).
///
/// Parameters
/// ----------
/// force : float
///     Force in newtons.
/// radius : float
///     Radius of the ball in metres.
/// youngs_modulus, poisson_ratio : float
///     Modulus of the ball in pascals, and its Poisson's ratio.
/// other_modulus, other_poisson_ratio : float
///     Those of the flat, which is rigid if the modulus is None.
#[pyfunction]
#[pyo3(signature = (
    force, radius, youngs_modulus, *, poisson_ratio=0.5, other_modulus=None,
    other_poisson_ratio=0.5
))]
pub(crate) fn hertz(
    force: f64,
    radius: f64,
    youngs_modulus: f64,
    poisson_ratio: f64,
    other_modulus: Option<f64>,
    other_poisson_ratio: f64,
) -> PyResult<HertzContact> {
    let other = other_modulus.map(|modulus| Body::elastic(modulus, other_poisson_ratio));
    let other = other.transpose().map_err(invalid)?;
    let found = Body::elastic(youngs_modulus, poisson_ratio)
        .and_then(|ball| ball.reduced_modulus_pa(other.unwrap_or(Body::rigid())))
        .and_then(|reduced| contact::HertzContact::from_force(force, radius, reduced))
        .map_err(invalid)?;
    Ok(HertzContact {
        text: format!("contact radius {:.4e} m", found.contact_radius_m),
        contact_radius: found.contact_radius_m,
        indentation: found.indentation_m,
        peak_pressure: found.peak_pressure_pa,
        mean_pressure: found.mean_pressure_pa,
        stiffness: found.stiffness_n_per_m,
        reduced_modulus: found.reduced_modulus_pa,
    })
}

/// Computes Young's modulus from forces and contact radii by a contact law.
///
/// Parameters
/// ----------
/// forces, radii : (n, 2) arrays
///     Forces in newtons and radii in metres, each with its standard error.
/// object : Object
/// waveguide : (k, 3) array
///     As in `Pipeline`.
/// estimator : str
///     As in `Pipeline`.
#[pyfunction]
#[pyo3(signature = (forces, radii, object, *, waveguide=None, estimator=None))]
pub(crate) fn estimate_modulus(
    py: Python<'_>,
    forces: &Bound<'_, PyAny>,
    radii: &Bound<'_, PyAny>,
    object: &Object,
    waveguide: Option<&Bound<'_, PyAny>>,
    estimator: Option<String>,
) -> PyResult<Modulus> {
    let forces = arrays::columns::<2>("forces", forces)?;
    let radii = arrays::columns::<2>("radii", radii)?;
    if forces.len() != radii.len() {
        let (expected, found) = (forces.len(), radii.len());
        return Err(invalid(format!(
            "radii must have {expected} rows, as forces, found {found}"
        )));
    }
    let estimate = |[value, error]: [f64; 2]| Estimate::new(value, error);
    let load = |(force, radius)| LoadState::new(estimate(force)).with_radius(estimate(radius));
    let loads: Vec<_> = forces.into_iter().zip(radii).map(load).collect();
    let config = StagesConfig {
        estimator: crate::pipeline::named(estimator)?,
        ..StagesConfig::default()
    };
    let guide = waveguide.map(guide).transpose()?;
    let estimator = LightContact::gauged([1.0; 2], &ForceOptions::default())
        .and_then(|contact| rust::Pipeline::new(contact, object.0))
        .and_then(|pipeline| pipeline.with_settings(|settings| settings.waveguide = guide))
        .and_then(|pipeline| pipeline.with_stages(&config))
        .and_then(|pipeline| pipeline.estimator())
        .map_err(errors::pipeline)?;
    let found = py.detach(|| estimator.estimate(&LoadSeries::new(loads)));
    Ok(modulus(&found.map_err(errors::refused)?))
}
