//! The failure of a user-defined stage.

use std::error::Error;
use std::fmt::{self, Display};
use std::sync::Arc;

/// The failure of a user-defined stage, as part of the error types of the workspace.
///
/// It is cheap to clone, and two failures are equal if their messages are. It is transparent in a
/// chain of sources: it has the message and the source of the user's error.
///
/// ```
/// use std::error::Error;
/// use tactile_core::CustomError;
/// let failure = CustomError::new("the network has no weights");
/// assert_eq!(failure.to_string(), "the network has no weights");
/// let failure = CustomError::new("seven".parse::<u8>().unwrap_err());
/// assert!(failure.get_ref().is::<std::num::ParseIntError>());
/// assert!(failure.source().is_none(), "it has no source");
/// ```
#[derive(Clone, Debug)]
pub struct CustomError(Arc<dyn Error + Send + Sync>);

impl CustomError {
    /// Wraps an error or a message.
    pub fn new(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self(Arc::from(error.into()))
    }

    /// The user's error.
    #[must_use]
    pub fn get_ref(&self) -> &(dyn Error + Send + Sync + 'static) {
        &*self.0
    }
}

impl PartialEq for CustomError {
    fn eq(&self, other: &Self) -> bool {
        // The boxed errors have no common type that could be compared.
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
        self.0.source()
    }
}

/// Serialises the message.
#[cfg(feature = "serde")]
impl serde::Serialize for CustomError {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
