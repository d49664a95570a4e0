//! Grids of numbers (heights, depths, pressures) as CSV matrices, one image row a line.
use super::error::{Expected, ReadError};
use super::files::read_bytes;
use super::table::parse_table;
use ndarray::Array2;
use std::path::Path;

/// Reads a matrix `[row, column]`. Empty cells and `nan` are NaN.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::read_grid;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("height_mm.csv");
/// std::fs::write(&path, "0.1,0.2,0.3\n0.4,,nan\n")?;
/// let height = read_grid(&path)?;
/// assert_eq!((height.dim(), height[[0, 2]]), ((2, 3), 0.3));
/// assert!(height[[1, 1]].is_nan() && height[[1, 2]].is_nan());
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`ReadError`], see the [module](super).
pub fn read_grid(path: impl AsRef<Path>) -> Result<Array2<f64>, ReadError> {
    let path = path.as_ref();
    let table = parse_table(&read_bytes(path)?, path, Expected::NumberOrNan)?;
    // A matrix has no names; a line of words is the header of another kind of table.
    if let Some(word) = table.header.first() {
        return Err(ReadError::Field {
            path: path.into(),
            line: 1,
            column: 1,
            expected: Expected::NumberOrNan,
            found: word.clone(),
        });
    }
    Ok(table.values)
}
