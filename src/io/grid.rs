//! Grids of numbers (heights, depths, pressures) as CSV matrices, one image row a line.
use super::error::{Expected, ReadError, read_bytes, write_bytes};
use super::table::parse_table;
use ndarray::{Array2, ArrayView2};
use std::fmt::Write as _;
use std::path::Path;

/// Reads a matrix `[row, column]`; empty cells and `nan` are NaN.
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
    parse_grid(&read_bytes(path)?, path)
}

/// Parses a matrix from the bytes of a CSV file; `name` stands for the file in errors.
///
/// ```
/// use tactile_imaging::io::grid::parse_grid;
/// let pressure_pa = parse_grid(b"0;1.5e4\n2e4;0\n", "pressure.csv")?;
/// assert_eq!(pressure_pa, ndarray::array![[0.0, 1.5e4], [2e4, 0.0]]);
/// # Ok::<(), tactile_imaging::io::ReadError>(())
/// ```
///
/// # Errors
/// As [`read_grid`].
pub fn parse_grid(bytes: &[u8], name: impl AsRef<Path>) -> Result<Array2<f64>, ReadError> {
    let path = name.as_ref();
    let table = parse_table(bytes, path, Expected::NumberOrNan)?;
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

/// Writes a matrix without a header; reading it again gives the same bits (NaN stays NaN).
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{read_grid, write_grid};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("made/for/it/depth.csv");
/// let depth = ndarray::array![[0.1 + 0.2, 1e-300], [f64::NAN, -0.0]];
/// write_grid(&path, depth.view())?;
/// let same = read_grid(&path)?.iter().zip(&depth).all(|(a, b)| a.to_bits() == b.to_bits());
/// assert!(same);
/// # Ok(()) }
/// ```
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
