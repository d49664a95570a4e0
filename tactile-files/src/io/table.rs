//! Tables of numbers in CSV: columns by name in SI units, points, grids.
use super::error::{FileError, FilePlace, quoted};
use super::files::read_bytes;
use nalgebra::{Point, Point2, Point3};
use ndarray::Array2;
use std::path::{Path, PathBuf};

/// A rectangular table of numbers with the names of its columns, if it has a header.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::read_table;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("pairs.csv");
/// std::fs::write(&path, "force_mN,pixel\n1,2\n\n3,4\n")?;
/// let table = read_table(&path)?;
/// assert_eq!((table.header[1].as_str(), table.values[[1, 1]]), ("pixel", 4.0));
/// assert_eq!(table.columns([(&["load", "force"], "N")])?, [[1.0 * 1e-3, 3.0 * 1e-3]]);
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Table {
    /// Names of the columns, empty where the file has no header line.
    pub header: Vec<String>,
    /// The numbers, `[row, column]`.
    pub values: Array2<f64>,
    path: PathBuf,
}

/// A heading cut into its name, in lower case, and its unit.
struct Heading {
    name: String,
    unit: Option<String>,
}

impl Table {
    /// Columns in SI units, as [`read_columns`] finds them.
    ///
    /// # Errors
    /// [`FileError::Content`] for a column that is missing, there twice or in an unknown unit.
    pub fn columns<const N: usize>(
        &self,
        wanted: [(&[&str], &str); N],
    ) -> Result<[Vec<f64>; N], FileError> {
        let headings = self.headings();
        if headings.is_empty() && self.values.ncols() != N {
            let found = self.values.ncols().to_string();
            return Err(self.error(FilePlace::Line(1), columns_in_words(N), found));
        }
        let mut found = [const { Vec::new() }; N];
        for (position, (names, unit)) in wanted.into_iter().enumerate() {
            let name = names.first().copied().unwrap_or_default();
            let mut at = position;
            let mut given = None;
            if !headings.is_empty() {
                at = self.find(names, &headings)?;
                given = headings[at].unit.as_deref();
            }
            // The wanted unit stands for its quantity: any multiple of its base may stand in the
            // file.
            let (base, _) = in_si(unit).unwrap_or(("1", 1.0));
            let factor = match in_si(given.unwrap_or(unit)) {
                Some((found, factor)) if found == base => factor,
                _ => {
                    let expected = format!("the column `{name}` in {base} or a multiple of it");
                    let found = format!("`{}`", quoted(given.unwrap_or(unit), 40));
                    return Err(self.error(FilePlace::File, expected, found));
                }
            };
            let column = self.values.column(at);
            found[position] = column.iter().map(|value| value * factor).collect();
            let overflows = |(si, value): &(&f64, &f64)| value.is_finite() && !si.is_finite();
            if let Some((_, value)) = found[position].iter().zip(column).find(overflows) {
                let expected = format!("values of the column `{name}` that SI units can hold");
                return Err(self.error(FilePlace::File, expected, format!("{value:e}")));
            }
        }
        Ok(found)
    }

    /// The position of the first of `names` that occurs, which must not occur twice.
    fn find(&self, names: &[&str], headings: &[Heading]) -> Result<usize, FileError> {
        for name in names {
            let mut at = (0..headings.len()).filter(|&i| headings[i].name == *name);
            match (at.next(), at.next()) {
                (None, _) => {}
                (Some(i), None) => return Ok(i),
                (Some(_), Some(_)) => {
                    let expected = format!("one column named `{name}`");
                    return Err(self.error(FilePlace::File, expected, "more than one".into()));
                }
            }
        }
        let expected = format!("a column named `{}`", names.first().unwrap_or(&""));
        let found = format!("`{}`", self.header.join("`, `"));
        Err(self.error(FilePlace::File, expected, found))
    }

    fn headings(&self) -> Vec<Heading> {
        self.header.iter().map(|text| heading(text)).collect()
    }

    fn error(&self, place: FilePlace, expected: String, found: String) -> FileError {
        FileError::content(&self.path, place, expected, found)
    }
}

/// Reads columns of a CSV file in SI units.
///
/// Each column is wanted by the names it may have, the usual one first and without the unit, and by
/// the unit it has where the file names none. A file with a header may have other columns, and
/// units in its headings (`depth_um`, `force (mN)`). A unit of another quantity than the given one
/// is an error. A file without a header has exactly these columns, in this order.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{FileError, read_columns};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("curve.csv");
/// std::fs::write(&path, "# probe 3\ntime_s,indentation (µm),force_mN\n0,5,1.5\n0.1,10,4.2\n")?;
/// let [z, f] = read_columns(&path, [(&["indentation", "depth"], "m"), (&["force"], "N")])?;
/// assert_eq!((z[1], f[1]), (10.0 * 1e-6, 4.2 * 1e-3));
/// let pressure = read_columns(&path, [(&["pressure"], "Pa")]);
/// assert!(matches!(pressure, Err(FileError::Content { .. })));
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FileError`] where the file cannot be read, a field is no finite number, rows differ in length,
/// a column is not there or there twice, or its unit is not one of its quantity.
pub fn read_columns<const N: usize>(
    path: impl AsRef<Path>,
    wanted: [(&[&str], &str); N],
) -> Result<[Vec<f64>; N], FileError> {
    read_table(path)?.columns(wanted)
}

/// Reads a table of finite numbers.
///
/// # Errors
/// [`FileError`] where the file cannot be read, a field is no finite number, rows differ in length,
/// or there are none.
pub fn read_table(path: impl AsRef<Path>) -> Result<Table, FileError> {
    let finite = |field: &str| field.parse().ok().filter(|v: &f64| v.is_finite());
    parse_table(path.as_ref(), "a finite number", finite)
}

/// Reads a matrix `[row, column]`. Empty cells and `nan` are NaN.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::read_grid;
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
/// [`FileError`], see the [module](super).
pub fn read_grid(path: impl AsRef<Path>) -> Result<Array2<f64>, FileError> {
    let expected = NUMBER_OR_GAP;
    let table = parse_table(path.as_ref(), expected, number_or_gap)?;
    // A matrix has no names. A line of words is the header of another kind of table.
    match table.header.first() {
        None => Ok(table.values),
        Some(word) => {
            let place = FilePlace::Cell { line: 1, column: 1 };
            Err(table.error(place, expected.into(), format!("`{word}`")))
        }
    }
}

/// A field of a table that may have gaps.
const NUMBER_OR_GAP: &str = "a number, `nan` or an empty cell";

fn number_or_gap(field: &str) -> Option<f64> {
    match field {
        "" => Some(f64::NAN),
        field => field.parse().ok().filter(|v: &f64| !v.is_infinite()),
    }
}

/// Points of a file whose number of coordinates is not known beforehand.
#[derive(Clone, Debug, PartialEq)]
pub enum PointTable {
    /// Points of two coordinates.
    Plane(Vec<Point2<f64>>),
    /// Points of three coordinates.
    Space(Vec<Point3<f64>>),
}

/// Reads points with two or three coordinates, as many as the file has, and whether the file names
/// the unit of its coordinates. They are in metres if it does, and in the file's own unit if not.
///
/// # Errors
/// [`FileError`], see the [module](super).
pub fn read_point_table(path: impl AsRef<Path>) -> Result<(PointTable, bool), FileError> {
    point_table(&read_table(path)?)
}

/// As [`read_point_table`], with empty cells and `nan` as NaN: a row then is a row of other files.
///
/// # Errors
/// [`FileError`], see the [module](super).
pub fn read_point_rows(path: impl AsRef<Path>) -> Result<(PointTable, bool), FileError> {
    point_table(&parse_table(path.as_ref(), NUMBER_OR_GAP, number_or_gap)?)
}

/// Reads points and where they go: columns `x`, `y` and, in space, `z` with the displacements `u`,
/// `v` and `w` (also `u_x`, `u_y`, `u_z`), in one unit. Empty cells and `nan` are NaN. Gives points
/// before and after, and whether the file names the unit.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{PointTable, read_displaced_points};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("piv.csv");
/// std::fs::write(&path, "x,y,u,v\n1,2,0.5,0\n3,4,nan,\n")?;
/// let ([PointTable::Plane(before), PointTable::Plane(after)], false) =
///     read_displaced_points(&path)?
/// else {
///     panic!("points of the plane, without a unit");
/// };
/// assert_eq!((before[0], after[0]), ([1.0, 2.0].into(), [1.5, 2.0].into()));
/// assert!(after[1].x.is_nan());
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FileError`], among others where a displacement has no column or another unit.
pub fn read_displaced_points(path: impl AsRef<Path>) -> Result<([PointTable; 2], bool), FileError> {
    let table = parse_table(path.as_ref(), NUMBER_OR_GAP, number_or_gap)?;
    let headings = table.headings();
    let unit = |name: &str| {
        let named = headings.iter().find(|h| h.name == name);
        named.map(|h| h.unit.as_deref())
    };
    let names: [&[&str]; 3] = [
        &["u", "u_x", "ux"],
        &["v", "u_y", "uy"],
        &["w", "u_z", "uz"],
    ];
    let (before, has_unit) = point_table(&table)?;
    let axes = if matches!(before, PointTable::Plane(_)) {
        2
    } else {
        3
    };
    for names in &names[..axes] {
        let Some(found) = names.iter().find_map(|name| unit(name)) else {
            let expected = format!("a column named `{}` beside the coordinates", names[0]);
            let found = format!("`{}`", table.header.join("`, `"));
            return Err(table.error(FilePlace::Line(1), expected, found));
        };
        if found.is_some() != unit("x").flatten().is_some() {
            let expected = format!("the unit of `{}` beside that of `x`, or none", names[0]);
            let found = found.unwrap_or("none").to_owned();
            return Err(table.error(FilePlace::Line(1), expected, found));
        }
    }
    let base = if unit("x").flatten() == Some("px") {
        "px"
    } else {
        "m"
    };
    let after = match &before {
        PointTable::Plane(points) => {
            let columns = table.columns([(names[0], base), (names[1], base)])?;
            PointTable::Plane(displaced(points, &columns))
        }
        PointTable::Space(points) => {
            let columns = table.columns(names.map(|names| (names, base)))?;
            PointTable::Space(displaced(points, &columns))
        }
    };
    Ok(([before, after], has_unit))
}

/// Points, each moved by its row of displacements.
fn displaced<const D: usize>(
    points: &[Point<f64, D>],
    columns: &[Vec<f64>; D],
) -> Vec<Point<f64, D>> {
    let rows = points.iter().enumerate();
    rows.map(|(row, p)| Point::from(std::array::from_fn(|k| p[k] + columns[k][row])))
        .collect()
}

fn point_table(table: &Table) -> Result<(PointTable, bool), FileError> {
    let headings = table.headings();
    let mut has_z = headings.iter().any(|h| h.name == "z");
    if headings.is_empty() {
        has_z = match table.values.ncols() {
            2 => false,
            3 => true,
            found => {
                let expected = "2 or 3 columns".into();
                return Err(table.error(FilePlace::Line(1), expected, found.to_string()));
            }
        };
    }
    let unit = headings
        .into_iter()
        .find(|h| h.name == "x")
        .and_then(|h| h.unit);
    let points = if has_z {
        PointTable::Space(to_points(table)?)
    } else {
        PointTable::Plane(to_points(table)?)
    };
    Ok((points, unit.is_some_and(|unit| unit != "px")))
}

/// Reads points with `D` coordinates, a row each.
///
/// With a header the columns `x`, `y` and, in space, `z` are found by name, other columns (an `id`)
/// are passed over, and units (`x_um`, `y (mm)`) are converted to metres. Pixels (`x_px`) stay
/// pixels. A file without a header has `D` columns in any unit.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::read_points;
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
/// [`FileError`], among others where the file has not `D` columns.
pub fn read_points<const D: usize>(
    path: impl AsRef<Path>,
) -> Result<Vec<Point<f64, D>>, FileError> {
    to_points(&read_table(path)?)
}

fn to_points<const D: usize>(table: &Table) -> Result<Vec<Point<f64, D>>, FileError> {
    let headings = table.headings();
    let find = |axis: &str| headings.iter().find(|h| h.name == axis);
    if D == 2 && find("z").is_some() {
        return Err(table.error(FilePlace::Line(1), columns_in_words(2), "3".into()));
    }
    // Positions of tracked points are often in pixels, which have no length here.
    let in_pixels = find("x").is_some_and(|h| h.unit.as_deref() == Some("px"));
    let unit = if in_pixels { "px" } else { "m" };
    let axes = [["x"], ["y"], ["z"]];
    let columns = table.columns(std::array::from_fn::<_, D, _>(|i| (&axes[i][..], unit)))?;
    let with_unit = |axis: &&[&str; 1]| find(axis[0]).is_some_and(|h| h.unit.is_some());
    // A unit beside one coordinate and none beside another leaves open what the other is in.
    if axes[..D].iter().any(|axis| with_unit(&axis))
        && !headings.is_empty()
        && let Some(axis) = axes[..D].iter().find(|axis| !with_unit(axis))
    {
        let expected = format!("a unit of the column `{}`, as others have one", axis[0]);
        return Err(table.error(FilePlace::Line(1), expected, "none".into()));
    }
    let rows = 0..table.values.nrows();
    Ok(rows
        .map(|row| Point::from(std::array::from_fn(|i| columns[i][row])))
        .collect())
}

fn columns_in_words(count: usize) -> String {
    format!("{count} column{}", if count == 1 { "" } else { "s" })
}

/// The base unit and the value in SI of a unit. Both signs for micro are `u`.
fn in_si(unit: &str) -> Option<(&'static str, f64)> {
    let unit = unit.replace(['µ', 'μ'], "u");
    if ["px", "grey_levels", "1"].contains(&unit.as_str()) {
        return Some(("1", 1.0));
    }
    ["m", "N", "Pa", "s"].into_iter().find_map(|base| {
        let factor = match unit.strip_suffix(base)? {
            "n" => 1e-9,
            "u" => 1e-6,
            "m" => 1e-3,
            "c" => 1e-2,
            "" => 1.0,
            "k" => 1e3,
            "M" => 1e6,
            "G" => 1e9,
            _ => return None,
        };
        Some((base, factor))
    })
}

/// Cuts `Force (mN)`, `x [µm]`, `depth mm` or `indentation_um` into name and unit.
fn heading(text: &str) -> Heading {
    let bracketed = || {
        let inside = text.strip_suffix([')', ']'])?;
        inside.rsplit_once(['(', '['])
    };
    let suffixed = || {
        let cuts = text.match_indices(['_', ' ']);
        let mut parts = cuts.map(|(at, _)| (&text[..at], &text[at + 1..]));
        parts.find(|(name, unit)| !name.is_empty() && in_si(unit).is_some())
    };
    // Whatever stands in brackets is meant as a unit, a word after a blank or a line only if it is
    // one.
    let (name, unit) = match bracketed().or_else(suffixed) {
        Some((name, unit)) => (name, Some(unit.trim().to_owned())),
        None => (text, None),
    };
    let name = name.trim().trim_end_matches('_').to_lowercase();
    Heading { name, unit }
}

/// Parses a file whose fields are `expected` and read by `number`.
///
/// A field becomes a number at once, so that a file of any shape needs little more memory than its
/// numbers.
fn parse_table(
    path: &Path,
    expected: &str,
    number: impl Fn(&str) -> Option<f64>,
) -> Result<Table, FileError> {
    let bytes = read_bytes(path)?;
    let error =
        |place, expected: &str, found: &str| FileError::content(path, place, expected, found);
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(error(FilePlace::File, "UTF-8 text", "UTF-16 text"));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let is_passed_over = |line: &[u8]| line.is_empty() || line.starts_with(b"#");
    // The first line that is not passed over decides for the whole file.
    let mut lines = bytes.split(|b| *b == b'\n').map(<[u8]>::trim_ascii);
    let first = lines.find(|line| !is_passed_over(line)).unwrap_or_default();
    let separators = [b',', b';', b'\t'].into_iter();
    let delimiter = separators
        .clone()
        .find(|separator| first.contains(separator));
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .delimiter(delimiter.unwrap_or(b','))
        .from_reader(bytes);
    let (mut header, mut values, mut columns) = (Vec::new(), Vec::new(), None);
    let mut record = csv::ByteRecord::new();
    loop {
        let start = reader.position().clone();
        let more = reader.read_byte_record(&mut record);
        // Lines that are passed over belong to the record that follows them.
        let line = || {
            let lines = bytes[start.byte() as usize..].split(|b| *b == b'\n');
            let before = lines.take_while(|line| is_passed_over(line.trim_ascii()));
            start.line() + before.count() as u64
        };
        match more {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => {
                return Err(FileError::Rejected {
                    path: path.into(),
                    place: FilePlace::Line(line()),
                    source: error.into(),
                });
            }
        }
        record.trim();
        let field = |bytes| -> String {
            let text = String::from_utf8_lossy(bytes);
            text.trim_matches(|c: char| c == '"' || c.is_whitespace())
                .into()
        };
        // Lines of blanks, and comments after blanks, are records to the parser.
        if record.len() == 1 && record[0].is_empty() || record[0].starts_with(b"#") {
            continue;
        }
        // A header is a first line with a word and without a number.
        if columns.is_none() {
            let fields: Vec<String> = record.iter().map(field).collect();
            columns = Some(fields.len());
            let no_number = fields.iter().all(|field| field.parse::<f64>().is_err());
            if no_number && fields.iter().any(|field| !field.is_empty()) {
                header = fields.iter().map(|field| quoted(field, 40)).collect();
                continue;
            }
        }
        for (column, bytes) in record.iter().enumerate() {
            let text = field(bytes);
            values.push(number(&text).ok_or_else(|| {
                let (line, column) = (line(), column + 1);
                let found = format!("`{}`", quoted(&text, 40));
                error(FilePlace::Cell { line, column }, expected, &found)
            })?);
        }
        if let Some(columns) = columns.filter(|columns| *columns != record.len()) {
            let found = record.len().to_string();
            return Err(error(
                FilePlace::Line(line()),
                &columns_in_words(columns),
                &found,
            ));
        }
    }
    let columns = columns.unwrap_or(1);
    match Array2::from_shape_vec((values.len() / columns, columns), values) {
        Ok(values) if !values.is_empty() => Ok(Table {
            header,
            values,
            path: path.into(),
        }),
        _ => Err(error(
            FilePlace::File,
            "at least one row of numbers",
            "none",
        )),
    }
}
