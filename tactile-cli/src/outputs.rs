//! The files of a call: named before the work starts, written after it.
use crate::failure::Failure;
use crate::plot::Page;
use std::collections::HashSet;
use std::ffi::OsStr;
use std::fmt::{Debug, Write as _};
use std::path::{Path, PathBuf};
use tactile_imaging::io::{ReadError, write_bytes};

/// A folder for results, or none.
pub struct Outputs {
    folder: Option<PathBuf>,
    planned: Vec<PathBuf>,
    written: Vec<PathBuf>,
}

impl Outputs {
    /// Checks that none of the files to be written is one of the inputs, and that no two have one name.
    pub fn plan<N: AsRef<OsStr>>(
        folder: Option<&Path>,
        names: &[N],
        inputs: &[&Path],
    ) -> Result<Self, Failure> {
        let outputs = Self {
            folder: folder.map(Path::to_path_buf),
            planned: Vec::new(),
            written: Vec::new(),
        };
        let Some(folder) = folder else {
            return Ok(outputs);
        };
        if folder.exists() && !folder.is_dir() {
            return Err(Failure::input(format!(
                "--out {} is not a folder: name a folder for the results",
                folder.display()
            )));
        }
        let mut taken = HashSet::new();
        let mut planned = Vec::new();
        for name in names {
            let path = folder.join(name.as_ref());
            if !taken.insert(name.as_ref()) {
                return Err(Failure::input(format!(
                    "two inputs would be answered in the same file {}: rename one",
                    path.display()
                )));
            }
            planned.push(path);
        }
        let outputs = Self { planned, ..outputs };
        outputs.check(inputs)?;
        Ok(outputs)
    }

    /// Refuses more inputs that one of the results would replace.
    pub fn check(&self, inputs: &[&Path]) -> Result<(), Failure> {
        for path in &self.planned {
            if let Some(input) = inputs.iter().find(|input| same_file(input, path)) {
                return Err(Failure::input(format!(
                    "the result {} would replace the input {}: choose another folder for --out",
                    path.display(),
                    input.display()
                )));
            }
        }
        Ok(())
    }

    /// Whether files are wanted at all.
    pub fn wanted(&self) -> bool {
        self.folder.is_some()
    }

    /// Writes a file, if files are wanted.
    pub fn write(&mut self, name: impl AsRef<Path>, bytes: &[u8]) -> Result<(), Failure> {
        if let Some(folder) = &self.folder {
            let path = folder.join(name);
            write_bytes(&path, bytes).map_err(|error| match error {
                // A path that the system refuses (a name too long, say) was given by the user as well.
                ReadError::Write { .. } => Failure::output(error),
                error => error.into(),
            })?;
            self.written.push(path);
        }
        Ok(())
    }

    /// Writes a page of plots, if files are wanted.
    pub fn page(&mut self, name: &str, page: impl FnOnce() -> Page) -> Result<(), Failure> {
        if self.wanted() {
            let svg = page().to_svg().map_err(Failure::output)?;
            self.write(name, svg.as_bytes())?;
        }
        Ok(())
    }

    /// A sentence that says what was written where.
    pub fn summary(&self) -> Option<String> {
        let names: Vec<_> = self
            .written
            .iter()
            .map(|p| p.display().to_string())
            .collect();
        (!names.is_empty()).then(|| format!("wrote {}", names.join(", ")))
    }
}

/// Whether both paths lead to one file that exists.
fn same_file(a: &Path, b: &Path) -> bool {
    match (std::fs::metadata(a), std::fs::metadata(b)) {
        (Ok(x), Ok(y)) => {
            identity(&x).is_some_and(|id| Some(id) == identity(&y)) || same_path(a, b)
        }
        _ => false,
    }
}

fn same_path(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Device and number of a file: equal for two names of one file, hard links too.
#[cfg(unix)]
fn identity(metadata: &std::fs::Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    Some((metadata.dev(), metadata.ino()))
}

#[cfg(not(unix))]
fn identity(_: &std::fs::Metadata) -> Option<(u64, u64)> {
    None
}

/// CSV text: a header, and rows of numbers with the digits that give them back.
pub struct Csv {
    text: String,
}

impl Csv {
    pub fn new<H: AsRef<str>>(header: &[H]) -> Self {
        let names: Vec<&str> = header.iter().map(AsRef::as_ref).collect();
        Self {
            text: names.join(",") + "\n",
        }
    }

    pub fn without_header() -> Self {
        Self {
            text: String::new(),
        }
    }

    pub fn row(&mut self, values: impl IntoIterator<Item = impl Debug>) {
        for (i, value) in values.into_iter().enumerate() {
            if i > 0 {
                self.text.push(',');
            }
            let _ = write!(self.text, "{value:?}");
            // A whole number is written as one.
            if self.text.ends_with(".0") {
                self.text.truncate(self.text.len() - 2);
            }
        }
        self.text.push('\n');
    }

    /// A row of numbers of which some are not known: their cells are empty.
    pub fn cells<const N: usize>(&mut self, values: [Option<f64>; N]) {
        let cell = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:?}"));
        self.text += &values.map(cell).join(",");
        self.text.push('\n');
    }

    pub fn into_bytes(self) -> Vec<u8> {
        self.text.into_bytes()
    }
}
