//! Point sets in CSV: one point a row.
//!
//! With a header the columns `x`, `y` and, in space, `z` are found by name, other columns (an `id`) are passed over, and
//! units (`x_um`, `y (mm)`) are converted to metres; pixels (`x_px`) stay pixels. Without one the file has two or three columns in any unit.
use super::error::{Expected, ReadError};
use super::files::read_bytes;
use super::table::{Column, Table, parse_table};
use super::units::{Heading, Quantity};
use nalgebra::{Point, Point2, Point3};
use std::path::Path;

/// The unit of positions in an image.
const PIXELS: &str = "px";

/// Points of a file whose number of coordinates is not known beforehand.
#[derive(Clone, Debug, PartialEq)]
pub enum PointTable {
    /// Points of two coordinates.
    Plane(Vec<Point2<f64>>),
    /// Points of three coordinates.
    Space(Vec<Point3<f64>>),
}

/// Reads points with two or three coordinates, as many as the file has, and whether the file names the unit of its coordinates: they are in
/// metres if it does, and in the file's own unit if not.
///
/// # Errors
/// [`ReadError`], see the [module](super).
pub fn read_point_table(path: impl AsRef<Path>) -> Result<(PointTable, bool), ReadError> {
    let path = path.as_ref();
    let table = parse_table(&read_bytes(path)?, path, Expected::FiniteNumber)?;
    let headings: Vec<Heading> = table.header.iter().map(|h| Heading::parse(h)).collect();
    let unit = headings
        .iter()
        .find(|h| h.name == "x")
        .and_then(|h| h.unit.as_deref());
    let in_metres = unit.is_some_and(|unit| unit != PIXELS);
    let dimensions = match table.values.ncols() {
        _ if headings.iter().any(|h| h.name == "z") => 3,
        _ if !headings.is_empty() => 2,
        columns @ (2 | 3) => columns,
        found => {
            return Err(ReadError::Line {
                path: path.into(),
                line: 1,
                expected: Expected::TwoOrThreeColumns,
                found,
            });
        }
    };
    let points = if dimensions == 3 {
        PointTable::Space(to_points(&table, path)?)
    } else {
        PointTable::Plane(to_points(&table, path)?)
    };
    Ok((points, in_metres))
}

/// Reads points with `D` coordinates, a row each.
///
/// With a header the columns `x`, `y` and, in space, `z` are found by name, other columns (an `id`) are passed over, and units (`x_um`, `y (mm)`)
/// are converted to metres; pixels (`x_px`) stay pixels. Without one the file has `D` columns in any unit.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::read_points;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("points.csv");
/// std::fs::write(&path, "id;x_mm;y_mm\n# rim\n7;500;1500\n8;2000;3\n")?;
/// assert_eq!(read_points::<2>(&path)?[1], [2.0, 0.003].into());
/// std::fs::write(&path, "1,2,0.5\n")?;
/// assert_eq!(read_points::<3>(&path)?, [[1.0, 2.0, 0.5].into()]);
/// assert!(read_points::<2>(&path).is_err());
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`ReadError`], among others where the file has not `D` columns.
pub fn read_points<const D: usize>(
    path: impl AsRef<Path>,
) -> Result<Vec<Point<f64, D>>, ReadError> {
    let path = path.as_ref();
    let table = parse_table(&read_bytes(path)?, path, Expected::FiniteNumber)?;
    to_points(&table, path)
}

fn to_points<const D: usize>(table: &Table, path: &Path) -> Result<Vec<Point<f64, D>>, ReadError> {
    let headings: Vec<Heading> = table.header.iter().map(|h| Heading::parse(h)).collect();
    let has = |name: &str| headings.iter().any(|h| h.name == name);
    if D == 2 && has("z") {
        return Err(ReadError::Line {
            path: path.into(),
            line: 1,
            expected: Expected::Columns(2),
            found: 3,
        });
    }
    let axes = ["x", "y", "z"];
    let has_unit = |wanted: bool| {
        axes[..D].iter().find(|axis| {
            let mut of_axis = headings.iter().filter(|h| h.name == **axis);
            of_axis.any(|h| h.unit.is_some() == wanted)
        })
    };
    // A unit beside one coordinate and none beside another leaves open what the other is in.
    if let (Some(axis), Some(_)) = (has_unit(false), has_unit(true)) {
        return Err(ReadError::Unit {
            path: path.into(),
            column: (*axis).into(),
            known: "the units of length, as other columns name one".into(),
            found: String::new(),
        });
    }
    let names: [[&str; 1]; D] = std::array::from_fn(|i| [axes[i]]);
    // Positions of tracked points are often in pixels, which have no length here: they stay as they are.
    let in_pixels = headings
        .iter()
        .any(|h| h.name == "x" && h.unit.as_deref() == Some(PIXELS));
    let (quantity, unit) = if in_pixels {
        (Quantity::Number, PIXELS)
    } else {
        (Quantity::Length, "m")
    };
    let wanted: [Column<'_>; D] = std::array::from_fn(|i| Column {
        names: &names[i],
        quantity,
        unit,
    });
    let columns = table.columns(wanted, path)?;
    let rows = 0..table.values.nrows();
    Ok(rows
        .map(|row| Point::from(std::array::from_fn(|i| columns[i][row])))
        .collect())
}
