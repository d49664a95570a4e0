//! Whole files in and out, and TOML files as structs with checked numbers.
use super::error::{FileError, FilePlace, quoted};
use serde::de::{self, Deserialize, DeserializeOwned, Deserializer, Unexpected, Visitor};
use serde_path_to_error::Segment;
use std::fmt;
use std::fs::{self, OpenOptions};
use std::io::{Error, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

/// Largest file that is read, in bytes. No table, scene or frame needs more, and a device never
/// ends.
const LARGEST_FILE: u64 = 512 << 20;

/// Reads a whole file of at most 512 MiB.
///
/// # Errors
/// [`FileError::Read`], also for a folder, a pipe or a device.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>, FileError> {
    let read = || {
        let metadata = fs::metadata(path)?;
        // Opening a pipe without a writer would wait for ever, and a device may never end.
        if metadata.is_dir() {
            return Err(Error::other("it is a folder, not a file"));
        }
        if !metadata.is_file() {
            return Err(Error::other("it is a pipe or a device, not a file"));
        }
        let mut bytes = Vec::new();
        if metadata.len() <= LARGEST_FILE {
            // The size may grow while the file is read, or be unknown to the system (in /proc).
            let file = fs::File::open(path)?;
            file.take(LARGEST_FILE + 1).read_to_end(&mut bytes)?;
        }
        // One byte beyond the limit is enough to refuse a file.
        let size = metadata.len().max(bytes.len() as u64);
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

/// Writes a whole file, creating its folder where needed.
///
/// The bytes go to a temporary file in the same folder, which then takes the name. A reader finds
/// the old file or the new one, and a full disk leaves the old one. A link is followed. What is no
/// file (`/dev/stdout`) is written to as it is.
///
/// # Errors
/// Those of the operating system.
pub fn replace_file(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let target = match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => {
            return Err(Error::new(ErrorKind::IsADirectory, "it is a folder"));
        }
        Ok(metadata) if !metadata.is_file() => {
            return OpenOptions::new().write(true).open(path)?.write_all(bytes);
        }
        Ok(_) => fs::canonicalize(path)?,
        Err(_) => {
            fs::create_dir_all(path.parent().unwrap_or(Path::new("")))?;
            path.to_owned()
        }
    };
    if target.file_name().is_none() {
        return Err(Error::new(ErrorKind::InvalidInput, "it has no file name"));
    }
    // A new name only: a file that is there belongs to somebody else.
    let process = std::process::id();
    let (temporary, mut file) = (0..u32::MAX)
        .map(|k| target.with_file_name(format!(".{process}-{k}.part")))
        .find_map(|name| {
            let file = OpenOptions::new().write(true).create_new(true).open(&name);
            match file {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => None,
                file => Some(file.map(|file| (name, file))),
            }
        })
        .ok_or_else(|| Error::other("no name is free for a temporary file"))??;
    // The file is closed before it is renamed, as some systems ask.
    let written = file.write_all(bytes);
    drop(file);
    let done = written.and_then(|()| fs::rename(&temporary, &target));
    if done.is_err() {
        let _ = fs::remove_file(&temporary);
    }
    done
}

/// Reads a TOML file into a struct.
pub fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, FileError> {
    parse_toml(&String::from_utf8_lossy(&read_bytes(path)?), path)
}

/// Reads a TOML text into a struct. The error names the field with its path, counted from 1.
pub fn parse_toml<T: DeserializeOwned>(text: &str, path: &Path) -> Result<T, FileError> {
    let rejected = |place: FilePlace, error: &toml::de::Error| FileError::Rejected {
        path: path.into(),
        place,
        // A sentence is one line, whatever the file holds. The longest list of names fits. The
        // parser has words of its own for a name that is no text.
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
    serde_path_to_error::deserialize(parsed).map_err(|error| {
        let mut field = String::new();
        for segment in error.path() {
            let dot = if field.is_empty() { "" } else { "." };
            match segment {
                Segment::Seq { index } => field += &format!("[{}]", index + 1),
                Segment::Map { key } => field += &format!("{dot}{key}"),
                Segment::Enum { variant } => field += &format!("{dot}{variant}"),
                Segment::Unknown => {}
            }
        }
        let place = match field.as_str() {
            "" => FilePlace::File,
            field => FilePlace::Field(quoted(field, 80)),
        };
        rejected(place, error.inner())
    })
}

/// The path that a file names, relative to the folder of that file.
pub fn beside(file: &Path, name: &Path) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(name)
}

/// What a field accepts: the words of a sentence, and the test.
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
pub fn number<'de, D: Deserializer<'de>, T: From<f64>>(
    deserializer: D,
    expected: &'static str,
    accepts: fn(f64) -> bool,
) -> Result<T, D::Error> {
    let number = deserializer.deserialize_f64(Number { expected, accepts })?;
    Ok(number.into())
}

pub fn finite<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    number(d, "a finite number", f64::is_finite)
}

pub fn positive<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    number(d, "a positive number", |v| v > 0.0 && v.is_finite())
}

pub fn not_negative<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    let expected = "zero or a positive number";
    number(d, expected, |v| v >= 0.0 && v.is_finite())
}

/// A Poisson ratio at which an isotropic solid is stable.
pub fn poisson_ratio<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    let expected = "a number above -1, at most 0.5";
    number(d, expected, |v| v > -1.0 && v <= 0.5)
}

/// Two positive numbers.
pub fn positive_pair<'de, D: Deserializer<'de>, T: From<[f64; 2]>>(
    deserializer: D,
) -> Result<T, D::Error> {
    #[derive(serde::Deserialize)]
    struct Positive(#[serde(deserialize_with = "positive")] f64);
    let pair = <[Positive; 2]>::deserialize(deserializer)?;
    Ok(pair.map(|number| number.0).into())
}

/// An array of one or more.
pub fn one_or_more<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<Vec<T>, D::Error> {
    let array = Vec::deserialize(deserializer)?;
    if array.is_empty() {
        return Err(de::Error::invalid_length(0, &"one or more"));
    }
    Ok(array)
}
