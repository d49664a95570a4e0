//! The errors of reading and writing files.
use std::fmt;
use std::path::PathBuf;

/// What a reader wanted to find at the place that [`ReadError`] names.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{Expected, ReadError, read_points};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("points.csv");
/// std::fs::write(&path, "0.5,1.5\n2,x\n")?;
/// let error = read_points::<2>(&path).unwrap_err();
/// let ReadError::Field { line, column, expected, .. } = error else { unreachable!() };
/// assert_eq!((line, column, expected), (2, 2, Expected::FiniteNumber));
/// assert_eq!(Expected::TaggedRows('m', 3).to_string(), "3 rows tagged m");
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Expected {
    /// A finite number.
    FiniteNumber,
    /// A number, or `nan`, or an empty cell.
    NumberOrNan,
    /// A count or index: a whole number that is not negative.
    WholeNumber,
    /// A row of exactly this many columns.
    Columns(usize),
    /// A row of two or three columns.
    TwoOrThreeColumns,
    /// At least one row of numbers.
    Rows,
    /// A line `case NAME D n_model n_target`.
    CaseHeader,
    /// One of the tags `case`, `m`, `t`, `g`, `p`.
    CaseTag,
    /// The dimension 2 or 3.
    Dimension,
    /// This many rows with this tag, as the case's header announced.
    TaggedRows(char, usize),
}

impl fmt::Display for Expected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FiniteNumber => write!(f, "a finite number"),
            Self::NumberOrNan => write!(f, "a number, `nan` or an empty cell"),
            Self::WholeNumber => write!(f, "a whole number"),
            Self::Columns(1) => write!(f, "1 column"),
            Self::Columns(n) => write!(f, "{n} columns"),
            Self::TwoOrThreeColumns => write!(f, "2 or 3 columns"),
            Self::Rows => write!(f, "at least one row of numbers"),
            Self::CaseHeader => write!(f, "`case NAME D n_model n_target`"),
            Self::CaseTag => write!(f, "a row that starts with case, m, t, g or p"),
            Self::Dimension => write!(f, "dimension 2 or 3"),
            Self::TaggedRows(tag, n) => write!(f, "{n} rows tagged {tag}"),
        }
    }
}

/// Why a file could not be read or written. Every message names the file.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{ReadError, read_grid};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("depth.csv");
/// std::fs::write(&path, "0.1,0.2\n0.3\n")?;
/// let ragged = read_grid(&path).unwrap_err();
/// assert!(ragged.to_string().ends_with("depth.csv, line 2: expected 2 columns, found 1"));
/// let absent = read_grid("nowhere/depth.csv").unwrap_err();
/// assert!(matches!(absent, ReadError::Open { .. }));
/// assert!(absent.to_string().starts_with("cannot read nowhere/depth.csv: "));
/// # Ok(()) }
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The operating system would not open or read the file.
    #[error("cannot read {}: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The operating system would not create or write the file.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// One field is not what it should be.
    #[error("{}, line {line}, column {column}: expected {expected}, found `{found}`", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: u64,
        /// Column, counted from 1.
        column: usize,
        /// What belongs there.
        expected: Expected,
        /// The field as it stands in the file (shortened if long).
        found: String,
    },
    /// A line has the wrong shape.
    #[error("{}, line {line}: expected {expected}, found {found}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: u64,
        /// What belongs there.
        expected: Expected,
        /// Number of columns (or rows) found.
        found: usize,
    },
    /// A table without a needed column.
    #[error("{}: expected a column named `{column}`, found {}", path.display(), list(found))]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// The name looked for.
        column: String,
        /// The names in the header (empty: there is no header).
        found: Vec<String>,
    },
    /// A column is there more than once.
    #[error("{}: the column `{column}` occurs more than once: rename one", path.display())]
    RepeatedColumn {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
    },
    /// A column's unit is not one of its quantity.
    #[error("{}: the column `{column}` {}, expected one of {known}", path.display(), named(found))]
    Unit {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The units that are known.
        known: String,
        /// The unit in the heading. Empty where it names none.
        found: String,
    },
    /// A value that no number can hold after its conversion to SI.
    #[error("{}: the column `{column}` has the value {value:e}, too large to be converted to SI", path.display())]
    Overflow {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The value as it stands in the file.
        value: f64,
    },
    /// A table that is not UTF-8.
    #[error("{} is UTF-16 text: save it as UTF-8", path.display())]
    Encoding {
        /// The file.
        path: PathBuf,
    },
    /// A folder, a pipe or a device instead of a file.
    #[error("cannot read {}: it is {found}, not a file", path.display())]
    NotAFile {
        /// What should be a file.
        path: PathBuf,
        /// What it is.
        found: &'static str,
    },
    /// The file is larger than any that is meant to be read.
    #[error("{} has {bytes} bytes, more than the {limit} that are read", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
        /// The largest size that is read.
        limit: u64,
    },
    /// An image of more pixels than any that is meant to be read.
    #[error("the image {} is {width} × {height} pixels, more than the {} million that are read", path.display(), limit / 1_000_000)]
    TooManyPixels {
        /// The file.
        path: PathBuf,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// The largest number of pixels that is read.
        limit: u64,
    },
    /// Samples of 16 bits that look like those of a camera with fewer.
    #[error("the 16-bit image {} has no sample above {brightest}: say how many bits its camera gives (bits = {likely}, or 16)", path.display())]
    UnclearBits {
        /// The file.
        path: PathBuf,
        /// The largest sample.
        brightest: u16,
        /// The number of bits that the largest sample suggests.
        likely: u8,
    },
    /// Samples with more bits than the caller said.
    #[error("the image {} has a sample of {brightest}, more than {bits} bits hold", path.display())]
    TooFewBits {
        /// The file.
        path: PathBuf,
        /// The largest sample.
        brightest: u16,
        /// The bits the caller gave.
        bits: u8,
    },
    /// The file is empty, or has a header alone.
    #[error("{}: expected {expected}, found none", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
        /// What belongs there.
        expected: Expected,
    },
    /// The file is no image that can be decoded.
    #[error("cannot decode the image {}: {}", path.display(), plain(source))]
    Image {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        source: ::image::ImageError,
    },
}

/// What a decoder said, on one line. That of portable anymaps prints the fields of a header as `Some(3)` and `None`.
fn plain(source: &::image::ImageError) -> String {
    let mut text = source.to_string();
    while let Some(start) = text.find("Some(") {
        let inner = start + "Some(".len();
        let Some(length) = text[inner..].find(')') else {
            break;
        };
        text.replace_range(inner + length..=inner + length, "");
        text.replace_range(start..inner, "");
    }
    let text = text.replace("None", "missing");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A heading's unit for a message.
fn named(unit: &str) -> String {
    match unit {
        "" => "names no unit".into(),
        unit => format!("is in `{unit}`"),
    }
}

fn list(names: &[String]) -> String {
    if names.is_empty() {
        "no header line".into()
    } else {
        format!("`{}`", names.join("`, `"))
    }
}

/// The field as it can stand in a message: at most 40 characters, no control characters.
pub fn shorten(field: &str) -> String {
    let clean: String = field.trim().chars().filter(|c| !c.is_control()).collect();
    match clean.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &clean[..end]),
        None => clean,
    }
}
