//! Reads and writes whole files, and reads TOML files into structs with checked numbers.
use super::error::{FileError, FilePlace, quoted};
use serde::de::{self, Deserialize, DeserializeOwned, Deserializer, Unexpected, Visitor};
use std::fmt;
use std::fs::{self, File, Metadata, OpenOptions, Permissions};
use std::io::{Error, ErrorKind, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use tempfile::TempPath;
use toml::Spanned;
use toml::de::{DeTable, DeValue};
#[cfg(target_os = "linux")]
use {
    rustix::fs::{AtFlags, CWD, Mode, OFlags},
    std::os::fd::AsRawFd,
};

/// Largest length of a line in a video header and of an image header, in bytes. No real file has
/// longer ones, and a line without an end would fill the memory.
pub(super) const LONGEST_HEADER: u64 = 4096;

/// Size limit of a file that is read, in bytes. No table, scene or frame needs more.
pub(super) const LARGEST_FILE: u64 = 512 << 20;

/// Reads a whole file of at most 512 MiB.
///
/// # Errors
/// [`FileError::Read`], which includes folders, pipes and devices.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>, FileError> {
    let read = || {
        let file = open_file(path)?;
        let length = file.metadata()?.len();
        let mut bytes = Vec::new();
        if length <= LARGEST_FILE {
            // The file may grow while it is read, and files in /proc have no stated size.
            file.take(LARGEST_FILE + 1).read_to_end(&mut bytes)?;
        }
        // One byte beyond the limit is enough to refuse a file.
        let size = length.max(bytes.len() as u64);
        if size > LARGEST_FILE {
            let reason = format!("it has {size} bytes, more than the {LARGEST_FILE} that are read");
            return Err(Error::other(reason));
        }
        Ok(bytes)
    };
    read().map_err(|source| FileError::Read {
        path: path.into(),
        source,
    })
}

/// Opens a regular file. Folders, pipes and devices are refused.
pub(super) fn open_file(path: &Path) -> std::io::Result<fs::File> {
    let metadata = fs::metadata(path)?;
    // Opening a pipe without a writer would wait for ever, and a device may never end.
    if metadata.is_dir() {
        return Err(Error::other(
            "it is a folder, not a file: name the files in it",
        ));
    }
    if !metadata.is_file() {
        return Err(Error::other("it is a pipe or a device, not a file"));
    }
    fs::File::open(path)
}

/// Writes a whole file as [`replace_file`] does.
///
/// # Errors
/// [`FileError::Write`], which names the file.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    replace_file(path, bytes).map_err(|source| FileError::Write {
        path: path.into(),
        source,
    })
}

/// Writes a whole file and creates its folder if it is missing.
///
/// A reader finds either the old file or the complete new one. If the disk is full, the file
/// exceeds a size limit or the process ends, the old file stays and no partial file is left. The
/// exception is the instant before the replacement, when the complete new file has a temporary name
/// (`.part`). The permissions of a replaced file are kept, and a link is followed. A device
/// (`/dev/stdout`) is written to directly.
///
/// # Errors
/// The errors of the operating system. A pipe is refused, because it may have no reader.
pub fn replace_file(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let refused = |kind, reason: &str| Err(Error::new(kind, reason));
    let (target, permissions) = match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => {
            return refused(ErrorKind::IsADirectory, "it is a folder");
        }
        Ok(metadata) if is_pipe(&metadata) => {
            return refused(ErrorKind::InvalidInput, "it is a pipe or a socket");
        }
        Ok(metadata) if !metadata.is_file() => {
            return OpenOptions::new().write(true).open(path)?.write_all(bytes);
        }
        Ok(metadata) => (fs::canonicalize(path)?, Some(metadata.permissions())),
        Err(_) => {
            fs::create_dir_all(path.parent().unwrap_or(Path::new("")))?;
            (path.to_owned(), None)
        }
    };
    if target.file_name().is_none() {
        return refused(ErrorKind::InvalidInput, "it has no file name");
    }
    let folder = target.parent().filter(|f| !f.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    match temporary(folder, &target, bytes, permissions)? {
        Some(temporary) => temporary.persist(&target).map_err(|error| error.error),
        None => Ok(()),
    }
}

/// A temporary file with this content, which is removed when the value is dropped. `None` if the
/// target did not exist, so that the file could take its name at once.
fn temporary(
    folder: &Path,
    #[cfg_attr(not(target_os = "linux"), allow(unused))] target: &Path,
    bytes: &[u8],
    permissions: Option<Permissions>,
) -> std::io::Result<Option<TempPath>> {
    let fill = |mut file: &File| {
        file.write_all(bytes)?;
        permissions.map_or(Ok(()), |kept| file.set_permissions(kept))
    };
    let mut name = tempfile::Builder::new();
    name.prefix(".").suffix(".part");
    // The file has no name until it is complete, so that a process that ends early leaves nothing.
    #[cfg(target_os = "linux")]
    if let Ok(file) = rustix::fs::open(
        folder,
        OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC,
        Mode::from_raw_mode(0o666),
    ) {
        let file = File::from(file);
        fill(&file)?;
        let own = format!("/proc/self/fd/{}", file.as_raw_fd());
        let link = |path: &Path| rustix::fs::linkat(CWD, &own, CWD, path, AtFlags::SYMLINK_FOLLOW);
        // If no file has the target's name, it is taken at once.
        if link(target).is_ok() {
            return Ok(None);
        }
        // A temporary name, until the file replaces the old one.
        let linked = name.make_in(folder, |path| Ok(link(path)?));
        return Ok(Some(linked?.into_temp_path()));
    }
    let create = |path: &Path| OpenOptions::new().write(true).create_new(true).open(path);
    let file = name.make_in(folder, create)?;
    fill(file.as_file())?;
    Ok(Some(file.into_temp_path()))
}

#[cfg(unix)]
fn is_pipe(metadata: &Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    metadata.file_type().is_fifo() || metadata.file_type().is_socket()
}

#[cfg(not(unix))]
fn is_pipe(_: &Metadata) -> bool {
    false
}

/// Reads a TOML file into a struct.
pub(crate) fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, FileError> {
    parse_toml(&String::from_utf8_lossy(&read_bytes(path)?), path)
}

/// Reads a TOML text into a struct. The error names the field with its path, counted from 1.
pub(crate) fn parse_toml<T: DeserializeOwned>(text: &str, path: &Path) -> Result<T, FileError> {
    let rejected = |place: FilePlace, error: &toml::de::Error| FileError::Rejected {
        path: path.into(),
        place,
        // The message is one line for any content of the file, and 400 characters hold the longest
        // list of names. The parser words the error of a name that is not a string differently.
        source: quoted(error.message(), 400)
            .replace("wanted string or table", "invalid type, expected a string")
            .into(),
    };
    let parsed = toml::Deserializer::parse(text).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start.min(text.len()));
        let line = 1 + text.as_bytes()[..start]
            .iter()
            .filter(|b| **b == b'\n')
            .count();
        rejected(FilePlace::Line(line as u64), &error)
    })?;
    T::deserialize(parsed).map_err(|error| {
        let place = match error.span().and_then(|span| field_at(&span, text)) {
            None => FilePlace::File,
            Some(field) => FilePlace::Field(quoted(&field, 80)),
        };
        rejected(place, &error)
    })
}

/// The path of the field whose key or value stands at these bytes of a TOML text.
fn field_at(bytes: &Range<usize>, text: &str) -> Option<String> {
    // The parser places an array of tables at the header of its first table. The inner table is
    // named.
    fn within(bytes: &Range<usize>, path: String, value: &Spanned<DeValue<'_>>) -> Option<String> {
        let inner = match value.get_ref() {
            DeValue::Table(table) => in_table(bytes, &format!("{path}."), table),
            DeValue::Array(array) => (1..)
                .zip(array.iter())
                .find_map(|(i, value)| within(bytes, format!("{path}[{i}]"), value)),
            _ => None,
        };
        inner.or_else(|| (value.span() == *bytes).then_some(path))
    }
    fn in_table(bytes: &Range<usize>, prefix: &str, table: &DeTable<'_>) -> Option<String> {
        table.iter().find_map(|(key, value)| {
            let path = format!("{prefix}{}", key.get_ref());
            if key.span() == *bytes {
                return Some(path);
            }
            within(bytes, path, value)
        })
    }
    in_table(bytes, "", DeTable::parse(text).ok()?.get_ref())
}

/// Resolves a path in a file relative to the folder of that file.
pub(crate) fn beside(file: &Path, name: &Path) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(name)
}

/// The condition of a field, in words and as a test.
struct Number {
    expected: &'static str,
    accepts: fn(f64) -> bool,
}

impl Visitor<'_> for Number {
    type Value = f64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expected)
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<f64, E> {
        if (self.accepts)(value) {
            Ok(value)
        } else {
            Err(E::invalid_value(Unexpected::Float(value), &self))
        }
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<f64, E> {
        self.visit_f64(value as f64)
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<f64, E> {
        self.visit_f64(value as f64)
    }
}

/// A number, or an optional number, that passes a test. For `#[serde(deserialize_with = …)]`.
pub(crate) fn number<'de, D: Deserializer<'de>, T: From<f64>>(
    deserializer: D,
    expected: &'static str,
    accepts: fn(f64) -> bool,
) -> Result<T, D::Error> {
    let number = deserializer.deserialize_f64(Number { expected, accepts })?;
    Ok(number.into())
}

pub(crate) fn finite<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    number(d, "a finite number", f64::is_finite)
}

pub(crate) fn positive<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    number(d, "a positive number", |v| v > 0.0 && v.is_finite())
}

pub(crate) fn not_negative<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    let expected = "zero or a positive number";
    number(d, expected, |v| v >= 0.0 && v.is_finite())
}

/// A Poisson ratio at which an isotropic solid is stable.
pub(crate) fn poisson_ratio<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    let expected = "a number above -1, at most 0.5";
    number(d, expected, |v| v > -1.0 && v <= 0.5)
}

/// Two positive numbers.
pub(crate) fn positive_pair<'de, D: Deserializer<'de>, T: From<[f64; 2]>>(
    deserializer: D,
) -> Result<T, D::Error> {
    #[derive(serde::Deserialize)]
    struct Positive(#[serde(deserialize_with = "positive")] f64);
    let pair = <[Positive; 2]>::deserialize(deserializer)?;
    Ok(pair.map(|number| number.0).into())
}

/// An array with at least one element.
pub(crate) fn one_or_more<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<Vec<T>, D::Error> {
    let array = Vec::deserialize(deserializer)?;
    if array.is_empty() {
        return Err(de::Error::invalid_length(0, &"one or more"));
    }
    Ok(array)
}
