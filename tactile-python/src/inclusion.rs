//! A lump under the surface of a block.
use crate::arrays;
use crate::errors::{self, Signals, invalid};
use crate::pipeline::guide;
use crate::results::{Estimate, HiddenLumps, Inclusion, Lump};
use pyo3::prelude::*;
use std::path::PathBuf;
use tactile_files::scene::InclusionScene;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::fem::{Guide, GuideLayer, Interface, Material};
use tactile_imaging::inclusion::{
    Estimated, Identifiable, InclusionEstimate, InclusionSearch, PressureProfile, SearchVerdict,
    TissueBlock,
};
use tactile_imaging::pipeline::with_error;

/// Searches for a lump in a block with the frames of a scene file, like `tactile inclusion`. The scene
/// may have several presses at stated positions.
///
/// Parameters
/// ----------
/// path : path
///     The scene file.
/// hidden : float
///     If given, the result also has the largest balls that would not be found. It is the ratio of
///     their modulus to that of the tissue.
///
/// Raises
/// ------
/// OSError, ValueError
///     A file that cannot be read or used.
#[pyfunction]
#[pyo3(signature = (path, *, hidden=None))]
pub(crate) fn inclusion_of_scene(
    py: Python<'_>,
    path: PathBuf,
    hidden: Option<f64>,
) -> PyResult<Inclusion> {
    let scene = InclusionScene::read(path).map_err(errors::file)?;
    let loaded = py.detach(|| scene.load()).map_err(errors::file)?;
    let mut signals = Signals::new();
    let found = py.detach(|| loaded.estimate(&mut |_| signals.check()));
    signals.finish()?;
    let estimate = found.map_err(errors::refused)?;
    let mut found = result(py, &estimate)?;
    if let Some(contrast) = hidden {
        let hidden = py.detach(|| loaded.hidden(&estimate, contrast, &mut |_| signals.check()));
        signals.finish()?;
        let hidden = hidden.map_err(errors::refused)?;
        found.hidden = Some(Py::new(
            py,
            HiddenLumps {
                text: format!(
                    "{} positions, {} depths",
                    hidden.positions_m.len(),
                    hidden.depths_m.len()
                ),
                positions: arrays::kept_rows(py, &hidden.positions_m),
                diameters: arrays::kept_rows(py, &hidden.diameters_m),
                depths: arrays::kept_vector(py, hidden.depths_m),
                next_position: hidden.next_position_m.map(|[x, y]| (x, y)),
            },
        )?);
    }
    Ok(found)
}

/// Searches for a lump in a block onto which a round guide was pressed.
///
/// Parameters
/// ----------
/// radii : (n,) array
///     Distances from the axis in metres.
/// approaches : (k,) array
///     Displacement of the guide towards the block in metres, increasing.
/// pressures, standard_errors : (k, n) arrays
///     Mean pressure at each distance and its standard error, in pascals.
/// forces : (k,) array
///     Gauge readings in newtons.
/// block_height, block_radius, guide_radius : float
///     In metres.
/// waveguide : (m, 3) array
///     The layers of the guide from the side of the block: thickness, Young's modulus, and Poisson's
///     ratio below 0.5.
/// interface : str
///     Contact between block and guide: "bonded" or "frictionless". If it is None, both are tried.
/// youngs_modulus : (value, standard error)
///     Modulus of the block in pascals, if it is known.
///
/// Returns
/// -------
/// Inclusion
#[pyfunction]
#[pyo3(signature = (
    radii, approaches, pressures, standard_errors, *, block_height, block_radius, guide_radius,
    waveguide, forces=None, interface=None, youngs_modulus=None
))]
pub(crate) fn inclusion(
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
    let mut specimen = TissueBlock::new(block_height, block_radius).map_err(invalid)?;
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
    let mut signals = Signals::new();
    let found =
        py.detach(|| search.search_with_progress(&radii, &profiles, &mut |_| signals.check()));
    signals.finish()?;
    result(py, &found.map_err(errors::refused)?)
}

fn result(py: Python<'_>, found: &InclusionEstimate) -> PyResult<Inclusion> {
    let verdict = match found.verdict() {
        SearchVerdict::Found => "found",
        SearchVerdict::Absent => "absent",
        SearchVerdict::Uncertain => "uncertain",
    };
    Ok(Inclusion {
        text: format!("{verdict}, probability {:.3}", found.probability),
        verdict: verdict.into(),
        probability: found.probability,
        block_modulus: estimate(py, &found.block_modulus_pa)?,
        lumps: (found.inclusions().iter())
            .map(|lump| Py::new(py, one(py, lump)?))
            .collect::<PyResult<_>>()?,
        interface: match found.interface {
            Interface::Bonded => "bonded".into(),
            _ => "frictionless".into(),
        },
        hidden: None,
        flags: found.warnings.iter().map(ToString::to_string).collect(),
    })
}

fn estimate(py: Python<'_>, given: &Estimated) -> PyResult<Py<Estimate>> {
    let [low, high] = given.interval;
    Estimate::within(py, given.value, given.standard_error, (low, Some(high)))
}

fn one(py: Python<'_>, lump: &tactile_imaging::inclusion::Inclusion) -> PyResult<Lump> {
    let parts = [
        ("diameter", &lump.diameter_m),
        ("depth", &lump.depth_m),
        ("youngs_modulus", &lump.youngs_modulus_pa),
    ];
    let part = |given: &Identifiable| estimate(py, given.estimate());
    let of = |given: &Estimated| estimate(py, given);
    let text = parts[..2].iter().map(|(name, part)| {
        let Estimated {
            value,
            standard_error,
            ..
        } = part.estimate();
        format!("{name} {} mm", with_error(*value, *standard_error, 1e3))
    });
    let identified = parts.iter().filter(|(_, part)| part.value().is_some());
    let [x, y] = [0, 1].map(|k| lump.position_m.as_ref().map(|position| of(&position[k])));
    Ok(Lump {
        text: text.collect::<Vec<_>>().join(", "),
        x: x.transpose()?,
        y: y.transpose()?,
        diameter: part(&lump.diameter_m)?,
        depth: part(&lump.depth_m)?,
        youngs_modulus: part(&lump.youngs_modulus_pa)?,
        height_over_width: lump.height_over_width.as_ref().map(of).transpose()?,
        ball_probability: lump.ball_probability,
        identified: identified.map(|(name, _)| (*name).to_string()).collect(),
    })
}
