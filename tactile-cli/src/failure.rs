//! How a call ends: the exit codes, and the one sentence that goes with the bad ones.
use std::fmt;
use tactile_imaging::io::ReadError;

/// The exit codes; the help of the program lists them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All that was asked for is there.
    Complete,
    /// Something is there, but a stage has no answer; it is printed with its reason.
    Partial,
    /// Arguments or input that cannot be used: nothing was computed.
    Input,
    /// The answer could not be written.
    Output,
    /// Stopped by Ctrl-C; what was there was printed.
    Interrupted,
}

impl Exit {
    pub fn code(self) -> u8 {
        match self {
            Self::Complete => 0,
            Self::Partial => 1,
            Self::Input => 2,
            Self::Output => 3,
            Self::Interrupted => 130,
        }
    }
}

/// Why a call came to nothing, in one sentence.
#[derive(Debug)]
pub struct Failure {
    pub exit: Exit,
    sentence: String,
}

impl Failure {
    /// What was given cannot be used.
    pub fn input(sentence: impl fmt::Display) -> Self {
        Self {
            exit: Exit::Input,
            sentence: sentence.to_string(),
        }
    }

    /// The input is fine, but there is no answer.
    pub fn no_answer(sentence: impl fmt::Display) -> Self {
        Self {
            exit: Exit::Partial,
            sentence: sentence.to_string(),
        }
    }

    /// The answer could not be written.
    pub fn output(sentence: impl fmt::Display) -> Self {
        Self {
            exit: Exit::Output,
            sentence: sentence.to_string(),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Decoders of images say what is wrong in several lines, and go on with their own data.
        let said = self.sentence.split(" while decoding ChunkType").next();
        let words: Vec<&str> = said.unwrap_or_default().split_whitespace().collect();
        f.write_str(&words.join(" "))
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        match error {
            ReadError::Write { .. } => Self::output(error),
            _ => Self::input(error),
        }
    }
}
