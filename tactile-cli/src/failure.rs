//! Exit codes, and why a call came to nothing.
use crate::text::printable;
use std::fmt::{self, Display};
use std::path::Path;
use tactile_files::io::FileError;

/// The exit codes, as the help of the program lists them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// All that was asked for is there.
    Complete,
    /// Something is there, but a stage has no answer. It is printed with its reason.
    Partial,
    /// Arguments or input that cannot be used: nothing was computed.
    Input,
    /// The answer could not be written.
    Output,
    /// Stopped by Ctrl-C or a signal of its kind, after the results at that time were printed.
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

    /// Complete or, where something is missing, partial.
    pub(crate) fn complete_if(complete: bool) -> Self {
        if complete {
            Self::Complete
        } else {
            Self::Partial
        }
    }
}

/// Why a call came to nothing, in one sentence.
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

    /// The input is fine, but there is no answer.
    pub(crate) fn no_answer(sentence: impl Display) -> Self {
        Self::new(Exit::Partial, sentence)
    }

    /// The answer could not be written.
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
