//! The failure of a user's own stage.

use std::error::Error;
use std::fmt::{self, Display};
use std::sync::Arc;

/// The failure of a stage that a user has written, as the error types of the workspace carry it.
///
/// Cheap to clone. Two are equal if their messages are. The source is the user's own error.
///
/// ```
/// use std::error::Error;
/// use tactile_core::CustomError;
/// let failure = CustomError::new("the network has no weights");
/// assert_eq!(failure.to_string(), "the network has no weights");
/// let failure = CustomError::new("seven".parse::<u8>().unwrap_err());
/// assert!(failure.source().is_some_and(|source| source.is::<std::num::ParseIntError>()));
/// ```
#[derive(Clone, Debug)]
pub struct CustomError(Arc<dyn Error + Send + Sync>);

impl CustomError {
    /// Carries an error, or a message.
    pub fn new(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self(Arc::from(error.into()))
    }
}

impl PartialEq for CustomError {
    fn eq(&self, other: &Self) -> bool {
        // The boxed errors have no type in common that could be compared.
        self.to_string() == other.to_string()
    }
}

impl Display for CustomError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl Error for CustomError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        Some(&*self.0)
    }
}

/// As its message.
#[cfg(feature = "serde")]
impl serde::Serialize for CustomError {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
