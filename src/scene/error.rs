//! What can be wrong with a scene, one sentence each.
use crate::io::ReadError;
use crate::pipeline::PipelineError;
use std::path::PathBuf;

/// Why a scene could not be read. Every message is one sentence that names the file and the field.
///
/// ```
/// use tactile_imaging::scene::{Scene, SceneError};
/// let broken = Scene::parse("reference = \"a.png\"\npixel_size_m = [2e-5,\n", "scene.toml").unwrap_err();
/// assert!(matches!(broken, SceneError::Syntax { .. }));
/// let unknown = Scene::parse("referense = \"a.png\"\n", "scene.toml").unwrap_err();
/// assert!(unknown.to_string().starts_with("scene.toml: unknown field `referense`, expected one of `reference`"));
/// let wrong = Scene::parse("reference = 3\n", "scene.toml").unwrap_err();
/// let SceneError::Wrong { field, found, .. } = wrong else { unreachable!() };
/// assert_eq!((field.as_str(), found.as_str()), ("reference", "3"));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The scene file is no TOML.
    #[error("{}, line {line}: {message}", file.display())]
    Syntax {
        /// The scene file.
        file: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// What the parser said.
        message: String,
    },
    /// A field that must be there is not.
    #[error("{}: field `{field}` is missing, expected {expected}", file.display())]
    Missing {
        /// The scene file.
        file: PathBuf,
        /// The field, with its path inside the file.
        field: String,
        /// What belongs there.
        expected: &'static str,
    },
    /// A field has the wrong kind of value.
    #[error("{}: field `{field}` must be {expected}, found {found}", file.display())]
    Wrong {
        /// The scene file.
        file: PathBuf,
        /// The field, with its path inside the file.
        field: String,
        /// What belongs there.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// A field has a value that cannot be used.
    #[error("{}: field `{field}`: {message}", file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// The field, with its path inside the file.
        field: String,
        /// What is wrong with it, and what was expected.
        message: String,
    },
    /// A field that no scene has: most likely a misspelling.
    #[error("{}: unknown field `{field}`, expected one of `{}`", file.display(), known.join("`, `"))]
    Unknown {
        /// The scene file.
        file: PathBuf,
        /// The field, with its path inside the file.
        field: String,
        /// The fields that may stand there.
        known: Vec<&'static str>,
    },
    /// A file that a field names cannot be read.
    #[error("{}: field `{field}`: {source}", file.display())]
    File {
        /// The scene file.
        file: PathBuf,
        /// The field, with its path inside the file.
        field: String,
        /// What is wrong with the file it names.
        source: Box<ReadError>,
    },
    /// What a field names or says can be read, but not used.
    #[error("{}: field `{field}`: {reason}", file.display())]
    Unusable {
        /// The scene file.
        file: PathBuf,
        /// The field, with its path inside the file.
        field: String,
        /// Why not.
        reason: String,
    },
    /// The scene file itself cannot be read.
    #[error(transparent)]
    Open(Box<ReadError>),
    /// A contact table whose contacts make no table, or of another version.
    #[error("{}: {message}", file.display())]
    ContactTable {
        /// The table's file.
        file: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// A frame differs in size from the reference.
    #[error(
        "{}: field `{field}`: the image {} is {} × {} pixels, but the reference {} is {} × {}",
        file.display(), image.display(), found[1], found[0], reference.display(), expected[1], expected[0]
    )]
    SizeMismatch {
        /// The scene file.
        file: PathBuf,
        /// The field, with its path inside the file.
        field: String,
        /// The image that differs.
        image: PathBuf,
        /// The reference.
        reference: PathBuf,
        /// Rows and columns of the reference.
        expected: [u32; 2],
        /// Rows and columns of the image.
        found: [u32; 2],
    },
    /// The frames could be read, but not be measured.
    #[error("{}: field `{field}`: {source}", file.display())]
    Measure {
        /// The scene file.
        file: PathBuf,
        /// The field that the trouble comes from.
        field: String,
        /// What went wrong.
        source: Box<PipelineError>,
    },
}
