//! Tables of numbers in CSV: the reader below points, grids, calibration pairs and depth tables.
//!
//! Fields are separated by commas, semicolons or tabs (the first of these that the first line has). The first line is a
//! header if none of its fields is a number. Empty lines and lines that start with `#` are passed over.
use super::error::{Expected, ReadError, read_bytes, shorten};
use ndarray::Array2;
use std::path::Path;

/// A rectangular table of numbers with the names of its columns, if it has a header.
///
/// ```
/// use std::path::Path;
/// use tactile_imaging::io::{ReadError, Table};
/// let path = Path::new("calibration.csv");
/// let values = ndarray::array![[5e4, 0.5], [1e5, 1.0]];
/// let table = Table { header: vec!["integrated_pixel_value".into(), "force_N".into()], values };
/// assert_eq!(table.column("force_n", 0, path)?, [0.5, 1.0], "a header counts, whatever its case");
/// let bare = Table { header: vec![], ..table.clone() };
/// assert_eq!(bare.column("force_n", 1, path)?, [0.5, 1.0], "without one the position does");
/// assert!(matches!(table.column("depth_mm", 0, path), Err(ReadError::MissingColumn { .. })));
/// # Ok::<(), ReadError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Names of the columns; empty where the file has no header line.
    pub header: Vec<String>,
    /// The numbers, `[row, column]`.
    pub values: Array2<f64>,
}

impl Table {
    /// The column with this name, or, in a table without a header, the column at `position`.
    ///
    /// # Errors
    /// [`ReadError::MissingColumn`] where neither exists; `path` is the name it gives to the file.
    pub fn column(&self, name: &str, position: usize, path: &Path) -> Result<Vec<f64>, ReadError> {
        let found = if self.header.is_empty() {
            Some(position).filter(|&i| i < self.values.ncols())
        } else {
            self.header
                .iter()
                .position(|h| h.eq_ignore_ascii_case(name))
        };
        let missing = || ReadError::MissingColumn {
            path: path.into(),
            column: name.into(),
            found: self.header.clone(),
        };
        found
            .map(|i| self.values.column(i).to_vec())
            .ok_or_else(missing)
    }
}

/// Reads a table of finite numbers.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::read_table;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("calibration.csv");
/// std::fs::write(&path, "# sensor 3\nintegrated_pixel_value\tforce_N\n5e4\t0.5\n1e5\t1\n")?;
/// let table = read_table(&path)?;
/// assert_eq!(table.header, ["integrated_pixel_value", "force_N"]);
/// assert_eq!(table.values, ndarray::array![[5e4, 0.5], [1e5, 1.0]]);
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`ReadError`] where the file cannot be read, a field is no finite number, rows differ in length, or there are none.
pub fn read_table(path: impl AsRef<Path>) -> Result<Table, ReadError> {
    let path = path.as_ref();
    parse_table(&read_bytes(path)?, path, Expected::FiniteNumber)
}

/// Parses the bytes of a table; `path` is the name that errors give.
pub(crate) fn parse_table(bytes: &[u8], path: &Path, cell: Expected) -> Result<Table, ReadError> {
    let mut reader = reader(bytes);
    let (mut header, mut values, mut columns) = (Vec::new(), Vec::new(), None);
    for record in reader.byte_records() {
        let record = record.map_err(|e| ReadError::Open {
            path: path.into(),
            source: e.into(),
        })?;
        let line = record.position().map_or(0, csv::Position::line);
        let fields: Vec<_> = record.iter().map(String::from_utf8_lossy).collect();
        let first = columns.is_none();
        if *columns.get_or_insert(fields.len()) != fields.len() {
            let expected = Expected::Columns(columns.unwrap_or(0));
            return Err(ReadError::Line {
                path: path.into(),
                line,
                expected,
                found: fields.len(),
            });
        }
        if first && is_header(&fields) {
            header = fields.iter().map(|f| shorten(f)).collect();
            continue;
        }
        push_numbers(&fields, &cell, path, line, &mut values)?;
    }
    let columns = columns.filter(|_| !values.is_empty());
    let empty = || ReadError::Empty {
        path: path.into(),
        expected: Expected::Rows,
    };
    let columns = columns.ok_or_else(empty)?;
    let values =
        Array2::from_shape_vec((values.len() / columns, columns), values).map_err(|_| empty())?;
    Ok(Table { header, values })
}

/// Rows of trimmed fields, of whatever length; `#` starts a comment.
fn reader(bytes: &[u8]) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .delimiter(delimiter(bytes))
        .from_reader(bytes)
}

/// Appends a row's numbers.
fn push_numbers(
    fields: &[std::borrow::Cow<'_, str>],
    cell: &Expected,
    path: &Path,
    line: u64,
    values: &mut Vec<f64>,
) -> Result<(), ReadError> {
    for (i, field) in fields.iter().enumerate() {
        values.push(number(field, cell).ok_or_else(|| ReadError::Field {
            path: path.into(),
            line,
            column: i + 1,
            expected: cell.clone(),
            found: shorten(field),
        })?);
    }
    Ok(())
}

/// A first line is a header when it has a word that is no number, and no number.
fn is_header(fields: &[std::borrow::Cow<'_, str>]) -> bool {
    fields.iter().all(|f| f.parse::<f64>().is_err()) && fields.iter().any(|f| !f.is_empty())
}

fn number(field: &str, cell: &Expected) -> Option<f64> {
    match cell {
        Expected::NumberOrNan if field.is_empty() => Some(f64::NAN),
        Expected::NumberOrNan => field.parse().ok().filter(|v: &f64| !v.is_infinite()),
        _ => field.parse().ok().filter(|v: &f64| v.is_finite()),
    }
}

/// The separator of the first line that has one.
fn delimiter(bytes: &[u8]) -> u8 {
    let lines = bytes
        .split(|&b| b == b'\n')
        .filter(|l| !l.starts_with(b"#"));
    let first = lines
        .into_iter()
        .find(|l| !l.trim_ascii().is_empty())
        .unwrap_or_default();
    [b',', b';', b'\t']
        .into_iter()
        .find(|d| first.contains(d))
        .unwrap_or(b',')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Table, ReadError> {
        parse_table(text.as_bytes(), Path::new("t.csv"), Expected::FiniteNumber)
    }

    #[test]
    fn a_header_is_recognised_and_columns_found_by_name() {
        let table = parse("# note\nforce_N, pixel\n1, 2\n\n3,4\n").unwrap();
        assert_eq!(
            table.column("FORCE_n", 1, Path::new("")).unwrap(),
            [1.0, 3.0]
        );
        assert!(
            matches!(
                table.column("x", 0, Path::new("")),
                Err(ReadError::MissingColumn { .. })
            ),
            "a header decides, not the position"
        );
        assert_eq!(
            parse("1;2\n3;4")
                .unwrap()
                .column("any", 1, Path::new(""))
                .unwrap(),
            [2.0, 4.0]
        );
    }

    #[test]
    fn errors_name_line_and_column() {
        let message = |text: &str| parse(text).unwrap_err().to_string();
        assert_eq!(
            message("x,y\n1,2\n1,two\n"),
            "t.csv, line 3, column 2: expected a finite number, found `two`"
        );
        assert_eq!(
            message("1,2\n3\n"),
            "t.csv, line 2: expected 2 columns, found 1"
        );
        assert_eq!(
            message("1,inf\n"),
            "t.csv, line 1, column 2: expected a finite number, found `inf`"
        );
        assert_eq!(
            message("x,y\n"),
            "t.csv: expected at least one row of numbers, found none"
        );
    }
}
