//! The error type of all file access.
use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};

/// A place in a file. Lines and columns are counted from 1.
///
/// ```
/// use tactile_files::io::FilePlace;
/// assert_eq!(FilePlace::Cell { line: 3, column: 2 }.to_string(), ", line 3, column 2");
/// assert_eq!(FilePlace::Field("object.radius_m".into()).to_string(), ": field `object.radius_m`");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FilePlace {
    /// The file as a whole.
    File,
    /// A line of text.
    Line(u64),
    /// A number or word in a line of text.
    Cell {
        /// The line.
        line: u64,
        /// The column of the table, or the word of the line.
        column: usize,
    },
    /// A frame of a stream, counted from 1.
    Frame(u64),
    /// A field of a TOML file, with its path: `waveguide.layers[2].thickness_m`.
    Field(String),
}

impl fmt::Display for FilePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) => write!(f, ", line {line}"),
            Self::Cell { line, column } => write!(f, ", line {line}, column {column}"),
            Self::Frame(frame) => write!(f, ", frame {frame}"),
            Self::Field(field) => write!(f, ": field `{field}`"),
        }
    }
}

/// Why a file could not be read, written or used, in one sentence that names the file.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{FileError, FilePlace, read_grid};
/// use tactile_files::scene::Scene;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("depth.csv");
/// std::fs::write(&path, "0.1,0.2\n0.3\n")?;
/// let ragged = read_grid(&path).unwrap_err();
/// assert!(ragged.to_string().ends_with("depth.csv, line 2: expected 2 columns, found 1"));
/// assert!(matches!(ragged, FileError::Content { place: FilePlace::Line(2), .. }));
/// let absent = read_grid("nowhere/depth.csv").unwrap_err();
/// assert!(absent.to_string().starts_with("cannot read nowhere/depth.csv: "));
/// let wrong = Scene::parse("reference = 3\n", "a.toml").unwrap_err().to_string();
/// assert!(wrong.starts_with("a.toml: field `reference`: invalid type: integer `3`"));
/// # Ok(()) }
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The operating system cannot read the file, or it is a folder, a pipe or a device.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The operating system cannot create or write the file.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The content at a place of the file differs from what is expected there.
    #[error("{}{place}: expected {expected}, found {found}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The place.
        place: FilePlace,
        /// The expected content.
        expected: String,
        /// The content found, shortened if long.
        found: String,
    },
    /// A table without a complete row, or a stream without a frame.
    #[error("{}: expected at least one {of}, found none", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
        /// The missing content.
        of: &'static str,
    },
    /// A value in the file, or a file that it names, cannot be used.
    #[error("{}{place}: {source}", path.display())]
    Rejected {
        /// The file.
        path: PathBuf,
        /// The place.
        place: FilePlace,
        /// The reason, with the expected value.
        source: Box<dyn Error + Send + Sync>,
    },
    /// An image that cannot be decoded, encoded or turned into grey levels.
    #[error("cannot use the image {}: {reason}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
}

impl FileError {
    /// An error for unexpected content at a place.
    pub(crate) fn content(
        path: &Path,
        place: FilePlace,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Content {
            path: path.into(),
            place,
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// An error for a table without rows.
    pub(super) fn no_rows(path: &Path) -> Self {
        Self::Empty {
            path: path.into(),
            of: "row of numbers",
        }
    }

    /// An error for a field of a TOML file whose value cannot be used.
    pub(crate) fn field(
        path: &Path,
        field: impl Into<String>,
        reason: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> Self {
        Self::Rejected {
            path: path.into(),
            place: FilePlace::Field(field.into()),
            source: reason.into(),
        }
    }
}

/// Text from a file, shortened for an error message: one line of at most `length` characters.
pub(super) fn quoted(text: &str, length: usize) -> String {
    let visible = |c: char| if c.is_control() { ' ' } else { c };
    let clean: String = text.trim().chars().map(visible).collect();
    match clean.char_indices().nth(length) {
        Some((end, _)) => format!("{}…", &clean[..end]),
        None => clean,
    }
}
