//! Point sets in CSV: one point a row.
//!
//! With a header the columns `x`, `y` and, in space, `z` are found by name, other columns (an `id`) are passed over, and
//! units (`x_um`, `y (mm)`) are converted to metres; pixels (`x_px`) stay pixels. Without one the file has two or three columns in any unit.
use super::error::{Expected, ReadError, read_bytes, write_bytes};
use super::table::{Column, Table, parse_table};
use super::units::{Heading, Quantity};
use nalgebra::{Point, Point2, Point3};
use std::fmt::Write as _;
use std::path::Path;

/// The unit of positions in an image.
const PIXELS: &str = "px";

/// Points of a file whose number of coordinates is not known beforehand.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{PointTable, read_point_table};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("points.csv");
/// for (text, dimension) in [("0.5,1.5\n2,3\n", 2), ("0.5,1.5,0.1\n2,3,0.2\n", 3)] {
///     std::fs::write(&path, text)?;
///     let (found, points) = match read_point_table(&path)? {
///         PointTable::Plane(points) => (2, points.len()),
///         PointTable::Space(points) => (3, points.len()),
///     };
///     assert_eq!((found, points), (dimension, 2));
/// }
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum PointTable {
    /// Points of two coordinates.
    Plane(Vec<Point2<f64>>),
    /// Points of three coordinates.
    Space(Vec<Point3<f64>>),
}

/// Reads points with two or three coordinates, as many as the file has.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{PointTable, read_point_table};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("points.csv");
/// std::fs::write(&path, "x_m,y_m,z_m\n1e-3,2e-3,5e-4\n")?;
/// assert_eq!(read_point_table(&path)?, PointTable::Space(vec![[1e-3, 2e-3, 5e-4].into()]));
/// std::fs::write(&path, "1e-3\n")?;
/// assert!(read_point_table(&path).unwrap_err().to_string().ends_with("expected 2 or 3 columns, found 1"));
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`ReadError`], see the [module](super).
pub fn read_point_table(path: impl AsRef<Path>) -> Result<PointTable, ReadError> {
    read_point_table_in(path).map(|(points, _)| points)
}

/// As [`read_point_table`], and whether the file names the unit of its coordinates: they are in metres if it does, and
/// in the file's own unit if not.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{PointTable, points::read_point_table_in};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("points.csv");
/// std::fs::write(&path, "id,x_mm,y_mm\n7,500,1500\n")?;
/// assert_eq!(read_point_table_in(&path)?, (PointTable::Plane(vec![[0.5, 1.5].into()]), true));
/// std::fs::write(&path, "id,x,y\n7,500,1500\n")?;
/// assert_eq!(read_point_table_in(&path)?, (PointTable::Plane(vec![[500.0, 1500.0].into()]), false));
/// # Ok(()) }
/// ```
///
/// # Errors
/// As [`read_point_table`].
pub fn read_point_table_in(path: impl AsRef<Path>) -> Result<(PointTable, bool), ReadError> {
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

/// Reads points with `D` coordinates.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{read_points, write_points};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("points.csv");
/// std::fs::write(&path, "x_m,y_m\n0.5,1.5\n2,3e-3\n")?;
/// let points = read_points::<2>(&path)?;
/// assert_eq!(points[1], [2.0, 0.003].into());
/// write_points(&path, &["x_m", "y_m"], &points)?;
/// assert_eq!(read_points::<2>(&path)?, points);
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`ReadError`], among others where the file has not `D` columns.
pub fn read_points<const D: usize>(
    path: impl AsRef<Path>,
) -> Result<Vec<Point<f64, D>>, ReadError> {
    let path = path.as_ref();
    parse_points(&read_bytes(path)?, path)
}

/// Parses points from the bytes of a CSV file; `name` stands for the file in errors.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_imaging::io::points::parse_points;
/// let points = parse_points::<3>(b"x_mm;y_mm;z_mm\n# rim\n1;2;0.5\n", "points.csv")?;
/// assert_eq!(points, [Point3::new(1e-3, 2e-3, 5e-4)]);
/// assert!(parse_points::<2>(b"1,2,0.5\n", "points.csv").is_err());
/// # Ok::<(), tactile_imaging::io::ReadError>(())
/// ```
///
/// # Errors
/// As [`read_points`].
pub fn parse_points<const D: usize>(
    bytes: &[u8],
    name: impl AsRef<Path>,
) -> Result<Vec<Point<f64, D>>, ReadError> {
    let path = name.as_ref();
    to_points(&parse_table(bytes, path, Expected::FiniteNumber)?, path)
}

/// Writes points with a header; reading them again gives the same bits.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use nalgebra::Point2;
/// use tactile_imaging::io::write_points;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("points.csv");
/// write_points(&path, &["x_m", "y_m"], &[Point2::new(1e-3, 0.25), Point2::new(0.1 + 0.2, 0.0)])?;
/// assert_eq!(std::fs::read_to_string(&path)?, "x_m,y_m\n0.001,0.25\n0.30000000000000004,0.0\n");
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`ReadError::Write`].
pub fn write_points<const D: usize>(
    path: impl AsRef<Path>,
    header: &[&str; D],
    points: &[Point<f64, D>],
) -> Result<(), ReadError> {
    let mut text = header.join(",") + "\n";
    for p in points {
        for (i, v) in p.iter().enumerate() {
            let _ = write!(text, "{}{v:?}", if i == 0 { "" } else { "," });
        }
        text.push('\n');
    }
    write_bytes(path.as_ref(), text.as_bytes())
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
