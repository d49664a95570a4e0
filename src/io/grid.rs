//! Grids of numbers (heights, depths, pressures) as CSV matrices, one image row a line.
use super::error::{Expected, ReadError, read_bytes, write_bytes};
use super::table::parse_table;
use ndarray::{Array2, ArrayView2};
use std::fmt::Write as _;
use std::path::Path;

/// Reads a matrix `[row, column]`; empty cells and `nan` are NaN.
///
/// # Errors
/// [`ReadError`], see the [module](super).
pub fn read_grid(path: impl AsRef<Path>) -> Result<Array2<f64>, ReadError> {
    let path = path.as_ref();
    parse_grid(&read_bytes(path)?, path)
}

/// Parses a matrix from the bytes of a CSV file; `name` stands for the file in errors.
///
/// # Errors
/// As [`read_grid`].
pub fn parse_grid(bytes: &[u8], name: impl AsRef<Path>) -> Result<Array2<f64>, ReadError> {
    Ok(parse_table(bytes, name.as_ref(), Expected::NumberOrNan)?.values)
}

/// Writes a matrix without a header; reading it again gives the same bits (NaN stays NaN).
///
/// # Errors
/// [`ReadError::Write`].
pub fn write_grid(path: impl AsRef<Path>, values: ArrayView2<'_, f64>) -> Result<(), ReadError> {
    let mut text = String::new();
    for row in values.rows() {
        for (i, v) in row.iter().enumerate() {
            let _ = write!(text, "{}{v:?}", if i == 0 { "" } else { "," });
        }
        text.push('\n');
    }
    write_bytes(path.as_ref(), text.as_bytes())
}
