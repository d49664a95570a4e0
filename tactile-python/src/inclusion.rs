//! A lump under the surface of a block.
use crate::arrays;
use crate::errors::{self, Signals, invalid};
use crate::pipeline::guide;
use crate::results::{Estimate, Inclusion};
use pyo3::prelude::*;
use std::path::PathBuf;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::fem::{Guide, GuideLayer, Interface, Material};
use tactile_imaging::inclusion::{
    Estimated, Identifiable, InclusionEstimate, InclusionScene, InclusionSearch, PressureProfile,
    Specimen, Verdict,
};

/// Searches for a lump in a block by the frames that a scene file names, as `tactile inclusion`.
///
/// Raises
/// ------
/// OSError, ValueError
///     A file that cannot be read, or not be used.
#[pyfunction]
pub fn inclusion_of_scene(py: Python<'_>, path: PathBuf) -> PyResult<Inclusion> {
    let scene = InclusionScene::read(path).map_err(errors::file)?;
    let loaded = py.detach(|| scene.load()).map_err(errors::file)?;
    let search = InclusionSearch::new(scene.specimen, scene.guide).map_err(invalid)?;
    let mut signals = Signals::new();
    let found = py.detach(|| loaded.search(&search, &mut |_| signals.check()));
    signals.finish()?;
    result(py, &found.map_err(errors::refused)?)
}

/// Searches for a lump in a block that a round guide was pressed onto.
///
/// Parameters
/// ----------
/// radii : (n,) array
///     Distances from the axis in metres.
/// approaches : (k,) array
///     How far the guide was moved against the block in metres, growing.
/// pressures, standard_errors : (k, n) arrays
///     Mean pressure at each distance and its standard error, in pascals.
/// forces : (k,) array
///     Newtons that a gauge read.
/// block_height, block_radius, guide_radius : float
///     Metres.
/// waveguide : (m, 3) array
///     The guide's layers from the block's side: thickness, Young's modulus, Poisson's ratio below
///     0.5.
/// interface : str
///     "bonded" or "frictionless", how the block meets the guide. Both are tried where it is None.
/// youngs_modulus : (value, standard error)
///     Of the block in pascals, where it is known.
///
/// Returns
/// -------
/// Inclusion
#[pyfunction]
#[pyo3(signature = (
    radii, approaches, pressures, standard_errors, *, block_height, block_radius, guide_radius,
    waveguide, forces=None, interface=None, youngs_modulus=None
))]
pub fn inclusion(
    py: Python<'_>,
    radii: &Bound<'_, PyAny>,
    approaches: &Bound<'_, PyAny>,
    pressures: &Bound<'_, PyAny>,
    standard_errors: &Bound<'_, PyAny>,
    block_height: f64,
    block_radius: f64,
    guide_radius: f64,
    waveguide: &Bound<'_, PyAny>,
    forces: Option<&Bound<'_, PyAny>>,
    interface: Option<&str>,
    youngs_modulus: Option<(f64, f64)>,
) -> PyResult<Inclusion> {
    let radii = arrays::vector("radii", radii)?;
    let approaches = arrays::vector("approaches", approaches)?;
    let pressures = arrays::matrix("pressures", pressures)?;
    let errors = arrays::matrix("standard_errors", standard_errors)?;
    let forces = forces
        .map(|forces| arrays::vector("forces", forces))
        .transpose()?;
    let rows = [
        pressures.as_array().nrows(),
        errors.as_array().nrows(),
        forces.as_ref().map_or(approaches.len(), Vec::len),
    ];
    if rows != [approaches.len(); 3] {
        let expected = approaches.len();
        return Err(invalid(format!(
            "pressures, standard_errors and forces must have {expected} rows, as approaches, \
             found {rows:?}"
        )));
    }
    let profile = |k: usize| PressureProfile {
        approach_m: approaches[k],
        force_n: forces.as_ref().map(|forces| forces[k]),
        pressure_pa: pressures.as_array().row(k).to_vec(),
        standard_error_pa: errors.as_array().row(k).to_vec(),
    };
    let profiles: Vec<_> = (0..approaches.len()).map(profile).collect();
    let mut specimen = Specimen::new(block_height, block_radius).map_err(invalid)?;
    if let Some((value, error)) = youngs_modulus {
        specimen = specimen
            .with_youngs_modulus(value, error)
            .map_err(invalid)?;
    }
    match interface {
        None => {}
        Some("bonded") => specimen = specimen.with_interface(Interface::Bonded),
        Some("frictionless") => specimen = specimen.with_interface(Interface::Frictionless),
        Some(other) => {
            return Err(invalid(format!(
                "interface must be \"bonded\" or \"frictionless\", found {other:?}"
            )));
        }
    }
    let layers = guide(waveguide)?;
    let layers = layers.layers().iter().map(|layer| {
        Ok(GuideLayer {
            thickness_m: layer.thickness_m,
            material: Material::new(layer.youngs_modulus_pa, layer.poisson_ratio)?,
        })
    });
    let layers = layers.collect::<Result<Vec<_>, ElasticityError>>();
    let search = layers
        .and_then(|layers| Guide::new(layers, guide_radius))
        .and_then(|guide| InclusionSearch::new(specimen, guide))
        .map_err(invalid)?;
    result(py, &searched(py, &search, &radii, &profiles)?)
}

fn searched(
    py: Python<'_>,
    search: &InclusionSearch,
    radii: &[f64],
    profiles: &[PressureProfile],
) -> PyResult<InclusionEstimate> {
    let mut signals = Signals::new();
    let found =
        py.detach(|| search.search_with_progress(radii, profiles, &mut |_| signals.check()));
    signals.finish()?;
    found.map_err(errors::refused)
}

fn result(py: Python<'_>, found: &InclusionEstimate) -> PyResult<Inclusion> {
    let estimate = |given: &Estimated| {
        let [low, high] = given.interval;
        Estimate::within(py, given.value, given.standard_error, (low, Some(high)))
    };
    let lump = found.inclusion.as_ref();
    let part = |given: Option<&Identifiable>| given.map(|g| estimate(g.estimate())).transpose();
    let named = |lump: &tactile_imaging::inclusion::Inclusion| {
        [
            ("diameter", lump.diameter_m),
            ("depth", lump.depth_m),
            ("youngs_modulus", lump.youngs_modulus_pa),
        ]
    };
    let identified = lump.into_iter().flat_map(named);
    let identified = identified.filter(|(_, part)| part.value().is_some());
    let verdict = match found.verdict() {
        Verdict::Found => "found",
        Verdict::Absent => "absent",
        Verdict::Uncertain => "uncertain",
    };
    Ok(Inclusion {
        text: format!("{verdict}, probability {:.3}", found.probability),
        verdict: verdict.into(),
        probability: found.probability,
        block_modulus: estimate(&found.block_modulus_pa)?,
        diameter: part(lump.map(|lump| &lump.diameter_m))?,
        depth: part(lump.map(|lump| &lump.depth_m))?,
        youngs_modulus: part(lump.map(|lump| &lump.youngs_modulus_pa))?,
        identified: identified.map(|(name, _)| name).collect(),
        interface: match found.interface {
            Interface::Bonded => "bonded",
            _ => "frictionless",
        },
        height_over_width: (lump.and_then(|lump| lump.height_over_width.as_ref()))
            .map(&estimate)
            .transpose()?,
        ball_probability: lump.map(|lump| lump.ball_probability),
        flags: found.warnings.iter().map(ToString::to_string).collect(),
    })
}
