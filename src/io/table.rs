//! Tables of numbers in CSV: the reader below points, grids, calibration pairs and depth tables.
//!
//! Fields are separated by commas, semicolons or tabs (the first of these that the first line has). A field may stand in
//! double quotes. The first line is a header if none of its fields is a number. Empty lines and lines that start with
//! `#` are passed over.
use super::error::{Expected, ReadError, shorten};
use super::files::read_bytes;
use super::units::{Heading, Quantity};
use ndarray::Array2;
use std::path::Path;

/// A column that a reader looks for.
#[derive(Clone, Copy, Debug)]
pub struct Column<'a> {
    /// Names that it may have, the usual one first, without the unit.
    pub names: &'a [&'a str],
    /// What it measures.
    pub quantity: Quantity,
    /// Its unit where the file names none.
    pub unit: &'a str,
}

/// A rectangular table of numbers with the names of its columns, if it has a header.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Names of the columns. Empty where the file has no header line.
    pub header: Vec<String>,
    /// The numbers, `[row, column]`.
    pub values: Array2<f64>,
}

impl Table {
    /// The wanted columns in SI units: by name where the file has a header, whatever other columns it has. By position
    /// in a file without one, which must then have exactly these.
    ///
    /// # Errors
    /// [`ReadError::MissingColumn`], [`ReadError::Unit`], [`ReadError::Overflow`] and, where the number of columns is wrong,
    /// [`ReadError::Line`]. `path` is the name they give to the file.
    pub fn columns<const N: usize>(
        &self,
        wanted: [Column<'_>; N],
        path: &Path,
    ) -> Result<[Vec<f64>; N], ReadError> {
        let headings: Vec<Heading> = self.header.iter().map(|h| Heading::parse(h)).collect();
        if headings.is_empty() && self.values.ncols() != N {
            return Err(ReadError::Line {
                path: path.into(),
                line: 1,
                expected: Expected::Columns(N),
                found: self.values.ncols(),
            });
        }
        let mut found = [const { Vec::new() }; N];
        for (position, column) in wanted.iter().enumerate() {
            let (at, factor) = if headings.is_empty() {
                (position, column.quantity.in_si(column.unit).unwrap_or(1.0))
            } else {
                let at = self.find(column, &headings, path)?;
                let factor = headings[at].factor(column.quantity, column.unit, path)?;
                (at, factor)
            };
            let values = self.values.column(at);
            let overflows = |v: &&f64| v.is_finite() && !(*v * factor).is_finite();
            if let Some(&value) = values.iter().find(overflows) {
                return Err(ReadError::Overflow {
                    path: path.into(),
                    column: column.names.first().copied().unwrap_or_default().into(),
                    value,
                });
            }
            found[position] = values.iter().map(|v| v * factor).collect();
        }
        Ok(found)
    }

    /// The position of a column among the headings: the first of its names that occurs, which must not occur twice.
    fn find(
        &self,
        column: &Column<'_>,
        headings: &[Heading],
        path: &Path,
    ) -> Result<usize, ReadError> {
        for name in column.names {
            let mut at = (0..headings.len()).filter(|&i| headings[i].name == *name);
            match (at.next(), at.next()) {
                (None, _) => {}
                (Some(i), None) => return Ok(i),
                (Some(_), Some(_)) => {
                    return Err(ReadError::RepeatedColumn {
                        path: path.into(),
                        column: (*name).into(),
                    });
                }
            }
        }
        Err(self.missing(column.names.first().copied().unwrap_or_default(), path))
    }

    fn missing(&self, column: &str, path: &Path) -> ReadError {
        ReadError::MissingColumn {
            path: path.into(),
            column: column.into(),
            found: self.header.clone(),
        }
    }
}

/// Reads columns of a CSV file in SI units, each by the names it may have (the usual one first, without the unit) and the unit it is in where the
/// file names none.
///
/// A file with a header may have other columns, and units in its headings (`depth_um`, `force (mN)`). A unit of another quantity than the given
/// one is an error. Without a header it has exactly these columns, in this order.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{ReadError, read_columns};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("curve.csv");
/// std::fs::write(&path, "# probe 3\ntime_s,indentation (µm),force_mN\n0,5,1.5\n0.1,10,4.2\n")?;
/// let [z, f] = read_columns(&path, [(&["indentation", "depth"], "m"), (&["force"], "N")])?;
/// assert_eq!((z[1], f[1]), (10.0 * 1e-6, 4.2 * 1e-3));
/// let pressure = read_columns(&path, [(&["pressure"], "Pa")]);
/// assert!(matches!(pressure, Err(ReadError::MissingColumn { .. })));
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`ReadError`] where the file cannot be read, a field is no finite number, rows differ in length, a column is not there or there twice, or its
/// unit is not one of its quantity.
pub fn read_columns<const N: usize>(
    path: impl AsRef<Path>,
    wanted: [(&[&str], &str); N],
) -> Result<[Vec<f64>; N], ReadError> {
    let path = path.as_ref();
    let wanted = wanted.map(|(names, unit)| Column {
        names,
        quantity: Quantity::of_unit(unit),
        unit,
    });
    read_table(path)?.columns(wanted, path)
}

/// Reads a table of finite numbers.
///
/// # Errors
/// [`ReadError`] where the file cannot be read, a field is no finite number, rows differ in length, or there are none.
pub fn read_table(path: impl AsRef<Path>) -> Result<Table, ReadError> {
    let path = path.as_ref();
    parse_table(&read_bytes(path)?, path, Expected::FiniteNumber)
}

/// Parses the bytes of a table. `path` is the name that errors give.
///
/// A field becomes a number at once, so that a file of any shape needs little more memory than its numbers.
pub fn parse_table(bytes: &[u8], path: &Path, cell: Expected) -> Result<Table, ReadError> {
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(ReadError::Encoding { path: path.into() });
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let delimiter = delimiter(bytes);
    let mut header = Vec::new();
    let mut values = Vec::new();
    let mut columns = None;
    for (i, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let text = String::from_utf8_lossy(line);
        let text = text.trim();
        if text.is_empty() || text.starts_with('#') {
            continue;
        }
        let line = i as u64 + 1;
        let fields = || text.split(delimiter).map(unquoted);
        if columns.is_none() && is_header(fields()) {
            header = fields().map(shorten).collect();
            columns = Some(header.len());
            continue;
        }
        let before = values.len();
        for (column, field) in fields().enumerate() {
            values.push(number(field, &cell).ok_or_else(|| ReadError::Field {
                path: path.into(),
                line,
                column: column + 1,
                expected: cell.clone(),
                found: shorten(field),
            })?);
        }
        let found = values.len() - before;
        let expected = *columns.get_or_insert(found);
        if found != expected {
            return Err(ReadError::Line {
                path: path.into(),
                line,
                expected: Expected::Columns(expected),
                found,
            });
        }
    }
    let empty = || ReadError::Empty {
        path: path.into(),
        expected: Expected::Rows,
    };
    let columns = columns.filter(|_| !values.is_empty()).ok_or_else(empty)?;
    let values =
        Array2::from_shape_vec((values.len() / columns, columns), values).map_err(|_| empty())?;
    Ok(Table { header, values })
}

/// The field without the blanks around it and without its quotes.
fn unquoted(field: &str) -> &str {
    let field = field.trim();
    let inside = field.strip_prefix('"').and_then(|f| f.strip_suffix('"'));
    inside.map_or(field, str::trim)
}

/// A first line is a header when it has a word that is no number, and no number.
fn is_header<'a>(fields: impl Iterator<Item = &'a str>) -> bool {
    let mut words = false;
    for field in fields {
        if field.parse::<f64>().is_ok() {
            return false;
        }
        words |= !field.is_empty();
    }
    words
}

fn number(field: &str, cell: &Expected) -> Option<f64> {
    match cell {
        Expected::NumberOrNan if field.is_empty() => Some(f64::NAN),
        Expected::NumberOrNan => field.parse().ok().filter(|v: &f64| !v.is_infinite()),
        _ => field.parse().ok().filter(|v: &f64| v.is_finite()),
    }
}

/// The separator of the first line that has one.
fn delimiter(bytes: &[u8]) -> char {
    let mut lines = bytes.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
    let first = lines
        .find(|l| !l.is_empty() && !l.starts_with(b"#"))
        .unwrap_or_default();
    let separators = [',', ';', '\t'];
    let found = separators.into_iter().find(|&d| first.contains(&(d as u8)));
    found.unwrap_or(',')
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
        assert_eq!(table.header, ["force_N", "pixel"]);
        assert_eq!(table.values, ndarray::array![[1.0, 2.0], [3.0, 4.0]]);
        let force = |table: &Table| table.columns([FORCE], Path::new(""));
        assert_eq!(force(&table).unwrap(), [[1.0, 3.0]]);
        assert!(
            matches!(
                force(&parse("depth_m\n1\n").unwrap()),
                Err(ReadError::MissingColumn { .. })
            ),
            "a header decides, not the position"
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
    #[test]
    fn quotes_marks_and_line_ends_of_other_programs_are_understood() {
        let table = parse("\u{feff}\"x\",\"y\"\r\n\"1\",2\r\n").unwrap();
        assert_eq!(table.header, ["x", "y"]);
        assert_eq!(table.values, ndarray::array![[1.0, 2.0]]);
        let utf_16 = [0xff, 0xfe, b'1', 0];
        let error = parse_table(&utf_16, Path::new("t.csv"), Expected::FiniteNumber).unwrap_err();
        assert!(matches!(error, ReadError::Encoding { .. }));
    }

    const INDENTATION: Column<'_> = Column {
        names: &["indentation", "depth"],
        quantity: Quantity::Length,
        unit: "m",
    };
    const FORCE: Column<'_> = Column {
        names: &["force"],
        quantity: Quantity::Force,
        unit: "N",
    };

    fn curve(text: &str) -> Result<[Vec<f64>; 2], ReadError> {
        parse(text)?.columns([INDENTATION, FORCE], Path::new("t.csv"))
    }

    #[test]
    fn columns_are_found_by_name_and_come_in_si() {
        let named = curve("time_s,force_mN,depth (µm)\n0,5,10\n").unwrap();
        assert_eq!(named, [vec![10.0 * 1e-6], vec![5.0 * 1e-3]]);
        assert_eq!(
            curve("0.5;2\n").unwrap(),
            [vec![0.5], vec![2.0]],
            "without a header by position"
        );
    }

    #[test]
    fn what_is_not_clear_is_refused() {
        let message = |text: &str| curve(text).unwrap_err().to_string();
        assert_eq!(
            message("1,2,3\n"),
            "t.csv, line 1: expected 2 columns, found 3"
        );
        assert_eq!(
            message("depth_m,load_kg\n1,2\n"),
            "t.csv: expected a column named `force`, found `depth_m`, `load_kg`"
        );
        assert_eq!(
            message("depth_m,force_N,force_mN\n1,2,3\n"),
            "t.csv: the column `force` occurs more than once: rename one"
        );
        assert!(message("depth_m,force (lbf)\n1,2\n").contains("is in `lbf`"));
        // The largest number is 1.8e308: a finite number of kilonewtons need not be one of newtons.
        assert_eq!(
            message("depth_m,force_kN\n1,-9e307\n"),
            "t.csv: the column `force` has the value -9e307, too large to be converted to SI"
        );
    }
}
