//! Standard output and standard error: results on the one, notes on the other.
use crate::failure::Exit;
use serde::Serialize;
use std::fmt::Display;
use std::io::{BufWriter, ErrorKind, Write, stderr, stdout};

/// Where results are printed. A reader that goes away (`| head -1`) ends the printing, not the program.
pub struct Console {
    /// One JSON object instead of text.
    pub json: bool,
    reader_left: bool,
    error: Option<std::io::Error>,
}

impl Console {
    pub fn new(json: bool) -> Self {
        Self {
            json,
            reader_left: false,
            error: None,
        }
    }

    /// Prints a line of the result, unless JSON is wanted.
    pub fn line(&mut self, text: impl Display) {
        if !self.json {
            self.print(&text.to_string());
        }
    }

    /// Prints the result as JSON, where it is wanted, number by number: that of many frames is as large as what they say.
    pub fn value(&mut self, value: &impl Serialize) {
        if !self.json || self.reader_left || self.error.is_some() {
            return;
        }
        let mut output = BufWriter::new(stdout().lock());
        let written = serde_json::to_writer_pretty(&mut output, value)
            .map_err(std::io::Error::from)
            .and_then(|()| writeln!(output))
            .and_then(|()| output.flush());
        drop(output);
        if let Err(error) = written {
            self.keep(error);
        }
    }

    /// A sentence for the person at the terminal, on standard error.
    pub fn note(&self, text: impl Display) {
        // Nothing can be done about a standard error that is closed.
        let _ = writeln!(stderr(), "tactile: {text}");
    }

    /// The exit code: `exit`, unless the result could not be printed.
    pub fn close(mut self, exit: Exit) -> Exit {
        if let Err(error) = stdout().flush() {
            self.keep(error);
        }
        match &self.error {
            None => exit,
            Some(error) => {
                self.note(format!("cannot write to standard output: {error}"));
                Exit::Output
            }
        }
    }

    fn print(&mut self, text: &str) {
        if self.reader_left || self.error.is_some() {
            return;
        }
        if let Err(error) = writeln!(stdout(), "{text}") {
            self.keep(error);
        }
    }

    fn keep(&mut self, error: std::io::Error) {
        if error.kind() == ErrorKind::BrokenPipe {
            self.reader_left = true;
        } else if self.error.is_none() {
            self.error = Some(error);
        }
    }
}
