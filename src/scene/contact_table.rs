//! Contact tables as files, and from the description of a ball and a guide.
#[cfg(feature = "fem")]
use super::fields::Fields;
#[cfg(feature = "fem")]
use super::tables;
use super::{SceneError, SceneLayer};
use crate::elasticity::ElasticityError;
use crate::elasticity::contact::{ContactTable, Layer, Waveguide};
#[cfg(feature = "fem")]
use crate::fem::{TableOptions, TableProgress, solve_contact_table as solve_by_elements};
use crate::io::{ReadError, read_bytes, write_bytes};
#[cfg(feature = "fem")]
use crate::pipeline::{Object, PipelineError};
#[cfg(feature = "fem")]
use std::ops::ControlFlow;
use std::path::Path;

/// Reads a contact table from a TOML file and checks it.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::elasticity::contact::{ContactCurve, ContactTable, Waveguide};
/// use tactile_imaging::scene::{read_contact_table, write_contact_table};
///
/// let contact_radius_m: Vec<f64> = (1..=10).map(|k| 0.1e-3 * f64::from(k)).collect();
/// let force_n = contact_radius_m.iter().map(|a| 4.0 / 3.0 * 80e3 * a.powi(3) / 3e-3).collect();
/// let curve = ContactCurve { youngs_modulus_pa: 60e3, contact_radius_m, force_n };
/// let table = ContactTable::new(3e-3, 0.5, &Waveguide::rigid(), vec![curve])?;
/// let path = tempfile::tempdir()?.path().join("table.toml");
/// # std::fs::create_dir_all(path.parent().unwrap())?;
/// write_contact_table(&path, &table)?;
/// assert_eq!(read_contact_table(&path)?, table);
/// std::fs::write(&path, "version = 7")?;
/// assert!(read_contact_table(&path).is_err());
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`SceneError::Open`], [`SceneError::Syntax`]. [`SceneError::ContactTable`] for contacts that make no table, or a table of another version.
pub fn read_contact_table(path: impl AsRef<Path>) -> Result<ContactTable, SceneError> {
    let path = path.as_ref();
    let table = read_toml(path)?;
    table.try_into().map_err(|error| SceneError::ContactTable {
        file: path.into(),
        message: error.message().lines().next().unwrap_or_default().into(),
    })
}

/// Writes a contact table as TOML. Numbers keep all their digits.
///
/// ```no_run
/// # use tactile_imaging::elasticity::contact::ContactTable;
/// # fn keep(table: &ContactTable) -> Result<(), tactile_imaging::io::ReadError> {
/// use tactile_imaging::scene::write_contact_table;
/// write_contact_table("table.toml", table)
/// # }
/// ```
///
/// # Errors
/// [`ReadError::Write`].
pub fn write_contact_table(path: impl AsRef<Path>, table: &ContactTable) -> Result<(), ReadError> {
    let path = path.as_ref();
    let text = toml::to_string(table).map_err(|error| ReadError::Write {
        path: path.into(),
        source: std::io::Error::other(error),
    })?;
    write_bytes(path, text.as_bytes())
}

/// Computes the contact table of the ball and the waveguide that a file describes: a scene file, or one with its tables `object` and
/// `waveguide` alone. `progress` is called before each modulus and after the last.
///
/// # Errors
/// Those of a scene's `object` and `waveguide`. [`SceneError::Measure`] where the object is no ball, or the table cannot be computed.
#[cfg(feature = "fem")]
pub fn solve_contact_table(
    path: impl AsRef<Path>,
    options: &TableOptions,
    progress: impl FnMut(TableProgress) -> ControlFlow<()>,
) -> Result<ContactTable, SceneError> {
    let path = path.as_ref();
    let text = read_toml(path)?;
    let fields = Fields::new(path, &text);
    fields.only(&tables::FIELDS)?;
    let object = tables::object(&fields)?;
    let layers = tables::layers(&fields)?;
    let failed = |field: &str, error| SceneError::Measure {
        file: path.into(),
        field: field.into(),
        source: Box::new(error),
    };
    let Object::Sphere {
        radius_m,
        poisson_ratio,
    } = object
    else {
        let error = PipelineError::WrongEstimator {
            estimator: crate::pipeline::EstimatorChoice::TabulatedContact,
            needs: "a ball as the object",
        };
        return Err(failed("object.shape", error));
    };
    let solved = |guide: Waveguide| -> Result<_, ElasticityError> {
        solve_by_elements(radius_m, poisson_ratio, &guide, options, progress)
    };
    guide(&layers)
        .and_then(solved)
        .map_err(|error| failed("waveguide", PipelineError::Material(error)))
}

/// The layers of a scene as a waveguide, rigid without any.
pub fn guide(layers: &[SceneLayer]) -> Result<Waveguide, ElasticityError> {
    if layers.is_empty() {
        return Ok(Waveguide::rigid());
    }
    let layer = |l: &SceneLayer| Layer {
        thickness_m: l.thickness_m,
        youngs_modulus_pa: l.youngs_modulus_pa,
        poisson_ratio: l.poisson_ratio,
    };
    Waveguide::new(layers.iter().map(layer).collect())
}

fn read_toml(path: &Path) -> Result<toml::Table, SceneError> {
    let bytes = read_bytes(path).map_err(|error| SceneError::Open(Box::new(error)))?;
    super::parse_table(&String::from_utf8_lossy(&bytes), path)
}
