//! Tables of numbers, as text or arrays: columns by name in SI units, points, grids.
use super::columns::{DISPLACEMENTS, FRAME, Heading, axes, in_si};
use super::error::{FileError, FilePlace, quoted};
use super::files::read_bytes;
use super::numbers;
use super::text::{TextCells, cells, columns_in_words};
use nalgebra::{Point, Point2, Point3};
use ndarray::Array2;
use std::path::{Path, PathBuf};

/// Treatment of rows with missing numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Gaps {
    /// The rows are left out and counted.
    #[default]
    LeaveOut,
    /// The table is refused with an error.
    Refuse,
    /// The number becomes NaN, so that rows still correspond to those of other tables.
    Keep,
}

/// Options of reading a table, for tables that are not recognised automatically.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{TableOptions, read_table_with};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("export.txt");
/// std::fs::write(&path, "Gauge 7\nZug;Weg;Kraft\n1;0,5;2\n2;;3\n")?;
/// let mut options = TableOptions::default();
/// (options.skip_lines, options.columns) = (1, vec!["Weg".into(), "3".into()]);
/// let mut table = read_table_with(&path, &options)?;
/// assert_eq!(table.columns([(&["depth"], "mm"), (&["force"], "N")])?, [[0.5e-3], [2.0]]);
/// assert_eq!(table.notes[0], "its decimal points are commas");
/// assert!(table.notes[1].contains("1 of 2 rows"), "the row without a way");
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TableOptions {
    /// The wanted columns in order, by heading or by number from 1. If empty, columns are found by
    /// their usual names.
    pub columns: Vec<String>,
    /// Number of lines before the table, such as an instrument's preamble.
    pub skip_lines: usize,
    /// Treatment of rows without a number in a wanted column.
    pub gaps: Gaps,
}

/// A rectangular table of numbers with the names of its columns, if it has a header.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::read_table;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("pairs.csv");
/// std::fs::write(&path, "force_mN,pixel\n1,2\n\n3,4\n")?;
/// let mut table = read_table(&path)?;
/// assert_eq!((table.header[1].as_str(), table.values[[1, 1]]), ("pixel", 4.0));
/// assert_eq!(table.columns([(&["load", "force"], "N")])?, [[1.0 * 1e-3, 3.0 * 1e-3]]);
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Table {
    /// Names of the columns. Empty if the file has no header line.
    pub header: Vec<String>,
    /// The numbers, `[row, column]`. NaN if a cell holds none.
    pub values: Array2<f64>,
    /// Assumptions that were made while reading, one sentence each.
    pub notes: Vec<String>,
    /// The rows of the columns that were read last.
    pub rows: Vec<usize>,
    missing: Vec<Option<u64>>,
    words: Vec<Option<(u64, String)>>,
    options: TableOptions,
    path: PathBuf,
}

impl Table {
    /// Columns in SI units, found as in [`read_columns`]. Rows without a number in one of them are
    /// left out.
    ///
    /// # Errors
    /// [`FileError::Content`] if a column is missing, occurs twice or has an unknown unit, if a
    /// word stands in place of a number, or if a number is missing and [`Gaps::Refuse`] is set.
    pub fn columns<const N: usize>(
        &mut self,
        wanted: [(&[&str], &str); N],
    ) -> Result<[Vec<f64>; N], FileError> {
        let mut found = self.columns_of(&wanted)?.into_iter();
        Ok(std::array::from_fn(|_| found.next().unwrap_or_default()))
    }

    fn columns_of(&mut self, wanted: &[(&[&str], &str)]) -> Result<Vec<Vec<f64>>, FileError> {
        let count = wanted.len();
        let headings = self.headings();
        let chosen = !self.options.columns.is_empty();
        if headings.is_empty() && !chosen && self.values.ncols() != count {
            let found = self.values.ncols().to_string();
            return Err(self.error(FilePlace::Line(1), columns_in_words(count), found));
        }
        let places = wanted.iter().enumerate().map(|(position, (names, _))| {
            match (chosen, headings.is_empty()) {
                (true, _) => self.chosen(position, count),
                (false, true) => Ok(position),
                (false, false) => self.find(names, &headings),
            }
        });
        let places = places.collect::<Result<Vec<usize>, _>>()?;
        self.keep_rows(&places)?;
        let mut found = Vec::with_capacity(count);
        for ((names, unit), at) in wanted.iter().zip(places) {
            let name = names.first().copied().unwrap_or_default();
            let given = headings.get(at).and_then(|heading| heading.unit.as_deref());
            // The wanted unit defines the quantity. The file may use any multiple of its base unit.
            let (base, _) = in_si(unit).unwrap_or(("1", 1.0));
            let factor = match in_si(given.unwrap_or(unit)) {
                Some((found, factor)) if found == base => factor,
                _ => {
                    let expected = format!("the column `{name}` in {base} or a multiple of it");
                    let found = format!("`{}`", quoted(given.unwrap_or(unit), 40));
                    return Err(self.error(FilePlace::File, expected, found));
                }
            };
            let column = self.rows.iter().map(|row| self.values[[*row, at]]);
            let in_si: Vec<f64> = column.clone().map(|value| value * factor).collect();
            let overflows = |(si, value): &(&f64, f64)| value.is_finite() && !si.is_finite();
            if let Some((_, value)) = in_si.iter().zip(column).find(overflows) {
                let expected = format!("values of the column `{name}` that SI units can hold");
                return Err(self.error(FilePlace::File, expected, format!("{value:e}")));
            }
            found.push(in_si);
        }
        Ok(found)
    }

    /// The column that the options name for this position.
    fn chosen(&self, position: usize, count: usize) -> Result<usize, FileError> {
        let names = &self.options.columns;
        if names.len() != count {
            let expected = format!("{} in the list of columns", columns_in_words(count));
            return Err(self.error(FilePlace::File, expected, names.len().to_string()));
        }
        let name = &names[position];
        let by_heading = self.header.iter().position(|heading| heading == name);
        let by_name = || {
            let mut names = self.headings().into_iter().map(|heading| heading.name);
            names.position(|heading| heading == name.to_lowercase())
        };
        let number = name
            .parse::<usize>()
            .ok()
            .and_then(|number| number.checked_sub(1));
        let by_number = number.filter(|column| *column < self.values.ncols());
        by_heading.or_else(by_name).or(by_number).ok_or_else(|| {
            let found = format!("`{}`", self.header.join("`, `"));
            self.error(
                FilePlace::File,
                format!("a column `{}`", quoted(name, 40)),
                found,
            )
        })
    }

    /// Finds the rows with a number in each of these columns.
    fn keep_rows(&mut self, columns: &[usize]) -> Result<(), FileError> {
        let cell = |line: u64, column: usize| FilePlace::Cell {
            line,
            column: column + 1,
        };
        let expected = || "a finite number".to_owned();
        for &column in columns {
            if let Some((line, word)) = &self.words[column] {
                return Err(self.error(cell(*line, column), expected(), format!("`{word}`")));
            }
            if let Some(line) = self.missing[column].filter(|_| self.options.gaps == Gaps::Refuse) {
                return Err(self.error(cell(line, column), expected(), "none".into()));
            }
        }
        if self.options.gaps == Gaps::Keep {
            self.rows = (0..self.values.nrows()).collect();
            return Ok(());
        }
        let whole = |row: &usize| columns.iter().all(|at| !self.values[[*row, *at]].is_nan());
        self.rows = (0..self.values.nrows()).filter(whole).collect();
        let (left, all) = (self.values.nrows() - self.rows.len(), self.values.nrows());
        if self.rows.is_empty() {
            return Err(FileError::no_rows(&self.path));
        }
        if left > 0 {
            let note = format!(
                "{left} of {all} rows have a cell without a number and are left out: rows are \
                 counted without them"
            );
            self.notes.push(note);
        }
        Ok(())
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
        let found = format!("`{}`", quoted(&self.header.join("`, `"), 200));
        Err(self.error(FilePlace::File, expected, found))
    }

    fn headings(&self) -> Vec<Heading> {
        self.header.iter().map(|text| Heading::of(text)).collect()
    }

    fn error(&self, place: FilePlace, expected: String, found: String) -> FileError {
        FileError::content(&self.path, place, expected, found)
    }
}

/// Reads columns of a CSV file in SI units.
///
/// Each wanted column is given by its possible names without the unit, the usual one first, and by
/// the unit to assume if the file states none. A file with a header may have other columns, and
/// units in its headings (`depth_um`, `force (mN)`). A unit of another quantity is an error. A file
/// without a header must have exactly these columns, in this order.
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
/// [`FileError`] if the file cannot be read, a field is not a finite number, rows differ in length,
/// a column is missing or occurs twice, or its unit belongs to another quantity.
pub fn read_columns<const N: usize>(
    path: impl AsRef<Path>,
    wanted: [(&[&str], &str); N],
) -> Result<[Vec<f64>; N], FileError> {
    read_table_with(path, &strict())?.columns(wanted)
}

/// Reads a table of numbers with rows of one length: text, `.npy`, `.npz` or `.mat`.
///
/// # Errors
/// [`FileError`] if the file cannot be read, is no table, has rows of different length or has no
/// rows.
pub fn read_table(path: impl AsRef<Path>) -> Result<Table, FileError> {
    read_table_with(path, &TableOptions::default())
}

/// Does the same as [`read_table`], with options.
///
/// # Errors
/// The errors of [`read_table`].
pub fn read_table_with(path: impl AsRef<Path>, options: &TableOptions) -> Result<Table, FileError> {
    let path = path.as_ref();
    let bytes = read_bytes(path)?;
    let found = numbers::cells(&bytes, path);
    let found = found.unwrap_or_else(|| cells(&bytes, path, options.skip_lines))?;
    let TextCells {
        header,
        values,
        columns,
        missing,
        words,
        notes,
    } = found;
    let rows = values.len() / columns.max(1);
    let values = Array2::from_shape_vec((rows, columns), values).unwrap_or_default();
    let table = Table {
        header,
        rows: (0..rows).collect(),
        values,
        notes,
        missing,
        words,
        options: options.clone(),
        path: path.into(),
    };
    if table.values.is_empty() {
        return Err(FileError::no_rows(path));
    }
    Ok(table)
}

/// Options for [`read_columns`], which does not report rows that are left out: it refuses them.
fn strict() -> TableOptions {
    TableOptions {
        gaps: Gaps::Refuse,
        ..TableOptions::default()
    }
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
/// [`FileError`] if the file cannot be read or is not such a table.
pub fn read_grid(path: impl AsRef<Path>) -> Result<Array2<f64>, FileError> {
    let table = read_table(path)?;
    let expected = "a number, `nan` or an empty cell";
    // A matrix has no header. A line of words shows another kind of table.
    let word = table.header.first().map(|word| (1, word.clone()));
    let words = table.words.iter().enumerate();
    let words = words.filter_map(|(column, word)| Some((column + 1, word.clone()?)));
    let first = words.min_by_key(|(_, (line, _))| *line);
    if let Some((column, (line, word))) = word.map(|word| (1, word)).or(first) {
        let place = FilePlace::Cell { line, column };
        return Err(table.error(place, expected.into(), format!("`{word}`")));
    }
    Ok(table.values)
}

/// Points of a file that may have two or three coordinates.
#[derive(Clone, Debug, PartialEq)]
pub enum PointTable {
    /// Points with two coordinates.
    Plane(Vec<Point2<f64>>),
    /// Points with three coordinates.
    Space(Vec<Point3<f64>>),
}

/// The points of a table.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Points {
    /// The points, in metres if the table states a unit of length, else in the table's unit.
    pub points: PointTable,
    /// The displaced points, if displacements are read too.
    pub displaced: Option<PointTable>,
    /// Whether the points are in metres.
    pub metric: bool,
    /// The row of each point in the table, from 0.
    pub rows: Vec<usize>,
    /// Assumptions that were made while reading, one sentence each.
    pub notes: Vec<String>,
    /// Number of rows of the table, including those without numbers.
    table_rows: usize,
}

impl Points {
    /// If both tables have the same number of rows, keeps the points whose rows are complete in
    /// both.
    pub fn keep_shared_rows(&mut self, other: &mut Self) {
        if self.table_rows != other.table_rows || self.rows == other.rows {
            return;
        }
        let shared = |of: &Self, with: &Self| {
            let is_shared = |k: &usize| with.rows.binary_search(&of.rows[*k]).is_ok();
            of.only(&(0..of.rows.len()).filter(is_shared).collect::<Vec<_>>())
        };
        (*self, *other) = (shared(self, other), shared(other, self));
    }

    /// The points at these positions.
    fn only(&self, kept: &[usize]) -> Self {
        let of = |points: &PointTable| match points {
            PointTable::Plane(all) => PointTable::Plane(kept.iter().map(|k| all[*k]).collect()),
            PointTable::Space(all) => PointTable::Space(kept.iter().map(|k| all[*k]).collect()),
        };
        Self {
            points: of(&self.points),
            displaced: self.displaced.as_ref().map(of),
            rows: kept.iter().map(|k| self.rows[*k]).collect(),
            notes: self.notes.clone(),
            ..*self
        }
    }
}

/// Reads points with two or three coordinates, depending on the file. A table of tracked points
/// with a column of frame numbers gives one set of points per frame, in ascending order. The set is
/// empty if no row of the frame is complete.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{PointTable, TableOptions, read_point_frames};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("trackpy.csv");
/// std::fs::write(&path, ",y,x,mass,frame,particle\n0,2,1,9,0,0\n1,3,nan,9,0,1\n2,4,5,9,1,0\n")?;
/// let frames = read_point_frames(&path, &TableOptions::default())?;
/// assert_eq!(frames[0].points, PointTable::Plane(vec![[1.0, 2.0].into()]));
/// assert_eq!((frames.len(), frames[1].rows[0]), (2, 2));
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FileError`] if the file cannot be read or is not such a table.
pub fn read_point_frames(
    path: impl AsRef<Path>,
    options: &TableOptions,
) -> Result<Vec<Points>, FileError> {
    let mut table = read_table_with(path, options)?;
    let whole = points_of(&mut table, false)?;
    let headings = table.headings();
    let is_frame = |heading: &Heading| FRAME.contains(&heading.name.as_str());
    let frame = headings.iter().position(is_frame);
    let Some(frame) = frame.filter(|_| !axes(&headings).is_empty()) else {
        return Ok(vec![whole]);
    };
    let mut distinct = table.values.column(frame).to_vec();
    distinct.retain(|number| !number.is_nan());
    distinct.sort_by(f64::total_cmp);
    distinct.dedup();
    if distinct.len() < 2 {
        return Ok(vec![whole]);
    }
    let mut frames = vec![Vec::new(); distinct.len()];
    for (k, row) in whole.rows.iter().enumerate() {
        let number = table.values[[*row, frame]];
        if let Ok(at) = distinct.binary_search_by(|other| other.total_cmp(&number)) {
            frames[at].push(k);
        }
    }
    Ok(frames.iter().map(|kept| whole.only(kept)).collect())
}

/// Reads points and their displacements: columns `x`, `y` and, in space, `z` with the displacements
/// `u`, `v` and `w` (also `u_x` and `displacement_x`), in one unit. Options must choose four
/// columns, or six in space.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{PointTable, TableOptions, read_displaced_points};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("piv.csv");
/// std::fs::write(&path, "x,y,u,v\n1,2,0.5,0\n3,4,nan,\n")?;
/// let table = read_displaced_points(&path, &TableOptions::default())?;
/// assert_eq!(table.displaced, Some(PointTable::Plane(vec![[1.5, 2.0].into()])));
/// assert_eq!((table.rows.len(), table.metric), (1, false));
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FileError`], for example if a displacement has no column or another unit.
pub fn read_displaced_points(
    path: impl AsRef<Path>,
    options: &TableOptions,
) -> Result<Points, FileError> {
    points_of(&mut read_table_with(path, options)?, true)
}

/// Points of a table, with their displacements if `displaced` is set.
fn points_of(table: &mut Table, displaced: bool) -> Result<Points, FileError> {
    let (headings, chosen) = (table.headings(), table.options.columns.len());
    let found = axes(&headings);
    if chosen == 0 && !headings.is_empty() && found.is_empty() {
        let expected = "columns named `x` and `y` (--columns chooses others)".into();
        let found = format!("`{}`", quoted(&table.header.join("`, `"), 200));
        return Err(table.error(FilePlace::File, expected, found));
    }
    let per_axis = 1 + usize::from(displaced);
    let count = match (chosen, headings.is_empty()) {
        (0, false) => per_axis * found.len(),
        (0, true) => table.values.ncols(),
        _ => chosen,
    };
    let axis_count = count / per_axis;
    if !matches!(axis_count, 2 | 3) || count % per_axis > 0 {
        let expected = format!(
            "{} or {} (--columns chooses them)",
            2 * per_axis,
            columns_in_words(3 * per_axis)
        );
        return Err(table.error(FilePlace::Line(1), expected, count.to_string()));
    }
    // Tracked points are often in pixels, which cannot be converted to metres.
    let first = found.first().copied();
    let in_pixels = first.is_some_and(Heading::is_in_pixels);
    let metric = first.is_some_and(|x| x.unit.is_some() && !in_pixels);
    let unit = if in_pixels { "px" } else { "m" };
    let names = |axis: usize| found.get(axis).map(|heading| heading.name.as_str());
    let names: Vec<Vec<&str>> = (0..axis_count)
        .map(|axis| vec![names(axis).unwrap_or(["x", "y", "z"][axis])])
        .collect();
    let displacements = DISPLACEMENTS
        .iter()
        .take(if displaced { axis_count } else { 0 });
    let wanted = names
        .iter()
        .map(Vec::as_slice)
        .chain(displacements.copied());
    let wanted: Vec<(&[&str], &str)> = wanted.map(|names| (names, unit)).collect();
    if chosen == 0 && !headings.is_empty() {
        // If only some columns state a unit, the unit of the others is unclear.
        let with_unit = |(names, _): &(&[&str], &str)| {
            let known = headings.iter().find(|h| names.contains(&h.name.as_str()));
            known.map(|heading| heading.unit.is_some())
        };
        let without = wanted.iter().find(|of| with_unit(of) == Some(false));
        if let Some((names, _)) = without
            && wanted.iter().any(|of| with_unit(of) == Some(true))
        {
            let expected = format!("a unit of the column `{}`, as others have one", names[0]);
            return Err(table.error(FilePlace::Line(1), expected, "none".into()));
        }
    }
    let columns = table.columns_of(&wanted)?;
    if chosen == 0 && first.is_some_and(|x| x.name != "x") {
        let names: Vec<&str> = names.concat();
        let note = format!("the coordinates are the columns {}", names.join(", "));
        table.notes.push(note);
    }
    let (places, moves) = columns.split_at(axis_count);
    let rows = 0..table.rows.len();
    let point = |row: usize, axis: usize, moved: bool| {
        places[axis][row] + moves.get(axis).filter(|_| moved).map_or(0.0, |by| by[row])
    };
    let of = |moved: bool| match axis_count {
        2 => PointTable::Plane(
            rows.clone()
                .map(|row| [0, 1].map(|k| point(row, k, moved)).into())
                .collect(),
        ),
        _ => PointTable::Space(
            rows.clone()
                .map(|row| [0, 1, 2].map(|k| point(row, k, moved)).into())
                .collect(),
        ),
    };
    Ok(Points {
        points: of(false),
        displaced: displaced.then(|| of(true)),
        metric,
        rows: table.rows.clone(),
        notes: table.notes.clone(),
        table_rows: table.values.nrows(),
    })
}

/// Reads points with `D` coordinates, one per row.
///
/// With a header the columns `x`, `y` and, in space, `z` are found by name, and other columns (such
/// as `id`) are skipped. Units (`x_um`, `y (mm)`) are converted to metres. Pixels (`x_px`) stay
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
/// [`FileError`], for example if the file does not have `D` columns.
pub fn read_points<const D: usize>(
    path: impl AsRef<Path>,
) -> Result<Vec<Point<f64, D>>, FileError> {
    let mut table = read_table_with(path, &strict())?;
    let found = points_of(&mut table, false)?.points;
    let coordinates: Vec<Vec<f64>> = match &found {
        PointTable::Plane(all) => all.iter().map(|p| p.iter().copied().collect()).collect(),
        PointTable::Space(all) => all.iter().map(|p| p.iter().copied().collect()).collect(),
    };
    let points = coordinates
        .iter()
        .map(|point| Some(Point::from(<[f64; D]>::try_from(point.as_slice()).ok()?)));
    points.collect::<Option<_>>().ok_or_else(|| {
        let found = if D == 2 { "3" } else { "2" };
        table.error(FilePlace::Line(1), columns_in_words(D), found.into())
    })
}
