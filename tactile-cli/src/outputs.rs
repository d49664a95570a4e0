//! The files of a call: named and checked before the computation, written after the result is
//! printed.
use crate::failure::Failure;
use crate::plot::Page;
use crate::report::Report;
use ndarray::Array2;
use std::collections::HashSet;
use std::ffi::{OsStr, OsString};
use std::fmt::Debug;
use std::fs::Metadata;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use tactile_files::io::{image_size, write_bytes};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Extensions of videos and arrays, whose frames are read one by one.
const STREAMED: [&str; 4] = ["y4m", "avi", "npy", "npz"];

/// The folder of the results, if requested, and its files.
pub(crate) struct Outputs {
    folder: Option<PathBuf>,
    limit_bytes: f64,
    planned: Vec<PathBuf>,
    ready: Vec<(PathBuf, Vec<u8>)>,
    /// The report page, if requested.
    pub report: Option<Report>,
}

impl Outputs {
    pub(crate) fn new(folder: Option<PathBuf>, limit_gb: f64) -> Self {
        Self {
            folder,
            limit_bytes: 1e9 * limit_gb,
            planned: Vec::new(),
            ready: Vec::new(),
            report: None,
        }
    }

    /// The argument of `--out`.
    pub(crate) fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// Registers the names of the files to be written and the inputs. A result must not replace an
    /// input, including those listed in a scene or calibration file. No two results may have the
    /// same name, the folder must be writable, and every input must fit into the allowed memory.
    pub(crate) fn plan(
        &mut self,
        names: &[impl AsRef<OsStr>],
        inputs: &[impl AsRef<Path>],
    ) -> Result<(), Failure> {
        let Some(folder) = self.folder.clone() else {
            let named = self.allow_inputs(inputs)?;
            return self.plan_report(inputs, &named);
        };
        if folder.exists() && !folder.is_dir() {
            return Err(Failure::input(format!(
                "--out {} is not a folder: name a folder for the results",
                folder.display()
            )));
        }
        self.plan_in(&folder, names, inputs)
    }

    /// An error if a job needs more memory than allowed. `job` is its name and size, `remedy` the
    /// advice in the message.
    pub(crate) fn allow(&self, bytes: f64, job: &str, remedy: &str) -> Result<(), Failure> {
        let size = |bytes: f64| match bytes {
            b if b >= 1e12 => format!("{:.1} TB", b * 1e-12),
            b if b >= 1e9 => format!("{:.1} GB", b * 1e-9),
            b => format!("{:.1} MB", b * 1e-6),
        };
        if bytes <= self.limit_bytes {
            return Ok(());
        }
        Err(Failure::input(format!(
            "{job} needs about {}, more than the {} allowed: {remedy}, or allow more with \
             --memory-gb",
            size(bytes),
            size(self.limit_bytes)
        )))
    }

    /// An error if inputs need more memory than allowed, before they are decoded. Returns the files
    /// listed in scenes and calibrations among them.
    fn allow_inputs(&self, inputs: &[impl AsRef<Path>]) -> Result<Vec<PathBuf>, Failure> {
        let all = inputs.iter().map(AsRef::<Path>::as_ref);
        let named: Vec<PathBuf> = all.clone().flat_map(|path| named_in(path, 0)).collect();
        for path in all.chain(named.iter().map(PathBuf::as_path)) {
            let name = path.display();
            if let Some((rows, columns)) = image_size(path) {
                // Decoded samples, grey levels as numbers, and the passes over both.
                let bytes = 32.0 * rows as f64 * columns as f64;
                let job = format!("the image {name} of {columns} × {rows} pixels");
                self.allow(bytes, &job, "give smaller images")?;
            } else if let Ok(file) = path.metadata()
                && file.is_file()
                && path
                    .extension()
                    .is_none_or(|name| STREAMED.iter().all(|streamed| name != *streamed))
            {
                // Text, and its numbers of eight bytes for one or two characters and a comma.
                let bytes = 6.0 * file.len() as f64;
                self.allow(bytes, &format!("the file {name}"), "give a smaller file")?;
            }
        }
        Ok(named)
    }

    /// Whether pictures are requested.
    pub(crate) fn draws(&self) -> bool {
        self.folder.is_some() || self.report.is_some()
    }

    /// Registers the report page. It must not replace an input.
    fn plan_report(
        &mut self,
        inputs: &[impl AsRef<Path>],
        named: &[PathBuf],
    ) -> Result<(), Failure> {
        let Some(report) = &mut self.report else {
            return Ok(());
        };
        let inputs = inputs.iter().map(|input| input.as_ref().to_path_buf());
        let inputs: Vec<PathBuf> = inputs.chain(named.iter().cloned()).collect();
        report.inputs(inputs.clone());
        self.planned.push(report.path.clone());
        self.protect(&inputs)
    }

    /// Completes the report page.
    pub(crate) fn finish_report(&mut self) {
        if let Some(report) = self.report.take() {
            self.ready
                .push((report.path.clone(), report.html().into_bytes()));
        }
    }

    /// Like [`plan`](Self::plan), for an `--out` that names a file in this folder.
    pub(crate) fn plan_in(
        &mut self,
        folder: &Path,
        names: &[impl AsRef<OsStr>],
        inputs: &[impl AsRef<Path>],
    ) -> Result<(), Failure> {
        let named = self.allow_inputs(inputs)?;
        self.plan_report(inputs, &named)?;
        // The folder is created with the first file, inside the nearest existing folder.
        let nearest = folder.ancestors().find(|f| f.exists());
        let ancestor = nearest.unwrap_or(Path::new("."));
        // Results can be written if a file can be created. It has no name and is removed
        // immediately.
        if let Err(error) = tempfile::tempfile_in(ancestor) {
            return Err(Failure::input(format!(
                "--out {} cannot be written in {} ({error}): name another folder for the results",
                folder.display(),
                ancestor.display()
            )));
        }
        let mut taken = HashSet::new();
        for name in names {
            let path = folder.join(name.as_ref());
            // Frames of one name from two folders.
            if !taken.insert(name.as_ref()) {
                return Err(Failure::input(format!(
                    "two inputs would have the same result file {}: rename one",
                    path.display()
                )));
            }
            refuse_target(&path, folder)?;
            self.planned.push(path);
        }
        self.folder = Some(folder.into());
        self.protect(inputs)?;
        self.protect(&named)
    }

    /// An error if a result would replace one of these further inputs.
    pub(crate) fn protect(&self, inputs: &[impl AsRef<Path>]) -> Result<(), Failure> {
        for path in &self.planned {
            let mut inputs = inputs.iter().map(AsRef::as_ref);
            if let Some(input) = inputs.find(|input| same_file(input, path)) {
                return Err(Failure::input(format!(
                    "the result {} would replace the input {}: choose another folder for --out",
                    path.display(),
                    input.display()
                )));
            }
        }
        Ok(())
    }

    /// Adds a file, if files are requested.
    pub(crate) fn add(&mut self, name: impl AsRef<Path>, bytes: Vec<u8>) {
        if let Some(folder) = &self.folder {
            self.ready.push((folder.join(name), bytes));
        }
    }

    /// Adds a page of plots, if files are requested.
    pub(crate) fn page(
        &mut self,
        name: impl AsRef<Path>,
        page: impl FnOnce() -> Page,
    ) -> Result<(), Failure> {
        if self.draws() {
            let svg = page().to_svg().map_err(Failure::output)?;
            if let Some(report) = &mut self.report {
                report.picture(svg.clone());
            }
            self.add(name, svg.into_bytes());
        }
        Ok(())
    }

    /// Writes the files, each completely or not at all. Results of an interrupted run are partial
    /// and do not replace earlier ones. Returns the paths of the written and of the kept files.
    pub(crate) fn write(&mut self, stopped: bool) -> Result<[Vec<String>; 2], Failure> {
        let [mut written, mut kept] = [Vec::new(), Vec::new()];
        for (path, bytes) in self.ready.drain(..) {
            let name = path.display().to_string();
            if stopped && path.exists() {
                kept.push(name);
            } else {
                write_bytes(&path, &bytes)?;
                written.push(name);
            }
        }
        Ok([written, kept])
    }
}

/// An error if the name of a result leads out of its folder, or to something that is not a file.
fn refuse_target(path: &Path, folder: &Path) -> Result<(), Failure> {
    let refused = |what: &str| {
        Err(Failure::input(format!(
            "the result {} {what}: remove it, or choose another folder for --out",
            path.display()
        )))
    };
    let Ok(entry) = path.symlink_metadata() else {
        return Ok(());
    };
    if entry.is_symlink() {
        let inside = path.canonicalize().ok().zip(folder.canonicalize().ok());
        if !inside.is_some_and(|(target, folder)| target.starts_with(folder)) {
            return refused("is a link that leads out of the folder");
        }
    }
    match path.metadata() {
        Ok(found) if found.is_dir() => refused("is a folder"),
        Ok(found) if !found.is_file() => refused("is a pipe or a device"),
        _ => Ok(()),
    }
}

/// The files listed in a TOML file, and those listed in the TOML files among them.
fn named_in(path: &Path, depth: usize) -> Vec<PathBuf> {
    let toml = path.extension().is_some_and(|e| e == "toml");
    // A scene lists a sensor, and no scene or sensor is as large as a megabyte.
    if !toml
        || depth > 4
        || !path
            .metadata()
            .is_ok_and(|m| m.is_file() && m.len() < 1 << 20)
    {
        return Vec::new();
    }
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let mut names = Vec::new();
    // A file that is not TOML is an error of its reader.
    if let Ok(table) = text.parse::<toml::Table>() {
        strings(&toml::Value::Table(table), &mut names);
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let files = names.into_iter().map(|name| folder.join(name));
    let mut files: Vec<PathBuf> = files.filter(|file| file.is_file()).collect();
    for k in 0..files.len() {
        files.extend(named_in(&files[k], depth + 1));
    }
    files
}

/// All strings of a TOML value.
fn strings(value: &toml::Value, found: &mut Vec<String>) {
    match value {
        toml::Value::String(text) => found.push(text.clone()),
        toml::Value::Array(values) => values.iter().for_each(|v| strings(v, found)),
        toml::Value::Table(table) => table.values().for_each(|v| strings(v, found)),
        _ => {}
    }
}

/// Whether both paths are the same existing file.
fn same_file(a: &Path, b: &Path) -> bool {
    let (Ok(x), Ok(y)) = (a.metadata(), b.metadata()) else {
        return false;
    };
    // A hard link is not visible in the path.
    identity(&x).is_some_and(|id| Some(id) == identity(&y))
        || matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Device and number of a file: equal for two names of one file, hard links too.
#[cfg(unix)]
fn identity(metadata: &Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    Some((metadata.dev(), metadata.ino()))
}

#[cfg(not(unix))]
fn identity(_: &Metadata) -> Option<(u64, u64)> {
    None
}

/// `STEM_suffix`, the name of a result for an input.
pub(crate) fn beside(input: &Path, suffix: &str) -> OsString {
    let mut name = input.file_stem().unwrap_or_default().to_owned();
    name.push(suffix);
    name
}

/// CSV text: a header, and rows of numbers with as many digits as restore them.
#[derive(Default)]
pub(crate) struct Csv {
    text: String,
}

impl Csv {
    pub(crate) fn new(header: &str) -> Self {
        let text = format!("{header}\n");
        Self { text }
    }

    /// A matrix without a header, one line per row.
    pub(crate) fn of_grid(values: &Array2<f64>) -> Vec<u8> {
        let mut csv = Self::default();
        values.rows().into_iter().for_each(|row| csv.row(row));
        csv.into_bytes()
    }

    pub(crate) fn row(&mut self, values: impl IntoIterator<Item = impl Debug>) {
        self.cells(values.into_iter().map(Some));
    }

    /// A row in which unknown values are empty cells.
    pub(crate) fn cells(&mut self, values: impl IntoIterator<Item = Option<impl Debug>>) {
        let cell = |value: Option<_>| {
            let text = value.map_or(String::new(), |value| format!("{value:?}"));
            // An integer is written without decimals.
            text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
        };
        let cells: Vec<String> = values.into_iter().map(cell).collect();
        self.text += &cells.join(",");
        self.text.push('\n');
    }

    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.text.into_bytes()
    }
}

/// Named arrays in the format of `numpy.load`.
pub(crate) struct Npz {
    archive: ZipWriter<Cursor<Vec<u8>>>,
}

impl Npz {
    pub(crate) fn new() -> Self {
        let archive = ZipWriter::new(Cursor::new(Vec::new()));
        Self { archive }
    }

    /// Adds an array in C order. `kind` is NumPy's name of the element type, `<f8` or `<i8`.
    pub(crate) fn add(
        &mut self,
        name: &str,
        kind: &str,
        shape: &[usize],
        elements: impl IntoIterator<Item = [u8; 8]>,
    ) -> Result<(), Failure> {
        let shape: String = shape.iter().map(|n| format!("{n}, ")).collect();
        let mut header =
            format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
        // Data begin at a multiple of 64 bytes, after ten bytes, the header and a line break.
        let padding = 63 - (10 + header.len()) % 64;
        header.push_str(&" ".repeat(padding));
        header.push('\n');
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.bytes());
        bytes.extend(elements.into_iter().flatten());
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        self.archive
            .start_file(format!("{name}.npy"), options)
            .map_err(Failure::output)?;
        self.archive.write_all(&bytes).map_err(Failure::output)
    }

    pub(crate) fn into_bytes(self) -> Result<Vec<u8>, Failure> {
        let archive = self.archive.finish().map_err(Failure::output)?;
        Ok(archive.into_inner())
    }
}
