//! Exit codes, and the reason of a failed call.
use crate::text::printable;
use std::fmt::{self, Display};
use std::path::Path;
use tactile_files::io::FileError;

/// The exit codes, as listed in the help of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// All requested results are available.
    Complete,
    /// Some results are available, but a stage failed. Its reason is printed.
    Partial,
    /// Unusable arguments or input: nothing was computed.
    Input,
    /// The result could not be written.
    Output,
    /// Stopped by Ctrl-C or a similar signal, after the results so far were printed.
    Interrupted,
}

impl Exit {
    pub(crate) fn code(self) -> u8 {
        match self {
            Self::Complete => 0,
            Self::Partial => 1,
            Self::Input => 2,
            Self::Output => 3,
            Self::Interrupted => 130,
        }
    }

    /// Complete, or partial if results are missing.
    pub(crate) fn complete_if(complete: bool) -> Self {
        if complete {
            Self::Complete
        } else {
            Self::Partial
        }
    }
}

/// The reason of a failed call, in one sentence.
#[derive(Debug)]
pub(crate) struct Failure {
    pub exit: Exit,
    sentence: String,
}

impl Failure {
    fn new(exit: Exit, sentence: impl Display) -> Self {
        let sentence = sentence.to_string();
        Self { exit, sentence }
    }

    /// The input cannot be used.
    pub(crate) fn input(sentence: impl Display) -> Self {
        Self::new(Exit::Input, sentence)
    }

    /// This file cannot be used.
    pub(crate) fn in_file(path: &Path, error: impl Display) -> Self {
        Self::input(format!("{}: {error}", path.display()))
    }

    /// The input is valid, but there is no result.
    pub(crate) fn no_answer(sentence: impl Display) -> Self {
        Self::new(Exit::Partial, sentence)
    }

    /// The result could not be written.
    pub(crate) fn output(sentence: impl Display) -> Self {
        Self::new(Exit::Output, sentence)
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<&str> = self.sentence.split_whitespace().collect();
        f.write_str(&printable(&words.join(" ")))
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        match error {
            FileError::Write { .. } => Self::output(error),
            _ => Self::input(error),
        }
    }
}
