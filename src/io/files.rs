//! Whole files in and out: what is no file is refused before it is opened, and a file is replaced only by a complete one.
use super::error::ReadError;
use crate::io::replace_file;
use std::fs::{self, FileType};
use std::io::Read;
use std::path::Path;

/// Largest file that is read, in bytes: more is not a measurement.
pub const LARGEST_FILE: u64 = 512 << 20;

/// Reads a whole file of at most half a gibibyte. The error names it.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>, ReadError> {
    let open = |source| ReadError::Open {
        path: path.into(),
        source,
    };
    let metadata = fs::metadata(path).map_err(open)?;
    // Opening a pipe that nobody writes to would wait for ever, and a device may never end.
    if !metadata.is_file() {
        return Err(ReadError::NotAFile {
            path: path.into(),
            found: kind(metadata.file_type()),
        });
    }
    let too_large = |bytes| ReadError::TooLarge {
        path: path.into(),
        bytes,
        limit: LARGEST_FILE,
    };
    if metadata.len() > LARGEST_FILE {
        return Err(too_large(metadata.len()));
    }
    let mut bytes = Vec::with_capacity(metadata.len() as usize);
    // One byte more than allowed tells a file that grew, or whose size the system does not know (as in /proc).
    let file = fs::File::open(path).map_err(open)?;
    file.take(LARGEST_FILE + 1)
        .read_to_end(&mut bytes)
        .map_err(open)?;
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}

/// Writes a whole file, creating its folder where needed.
///
/// The bytes go to a temporary file in the same folder, which then takes the name: whoever reads finds the old file or
/// the new one, and a full disk leaves the old one. What is no file (`/dev/stdout`) is written to as it is.
///
/// # Errors
/// [`ReadError::Write`], which names the file.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), ReadError> {
    replace_file(path, bytes).map_err(|source| ReadError::Write {
        path: path.into(),
        source,
    })
}

fn kind(file_type: FileType) -> &'static str {
    if file_type.is_dir() {
        "a folder"
    } else {
        special(file_type)
    }
}

#[cfg(unix)]
fn special(file_type: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    if file_type.is_fifo() {
        "a pipe"
    } else if file_type.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

#[cfg(not(unix))]
fn special(_: FileType) -> &'static str {
    "a device"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_nothing_is_left_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        write_bytes(&path, b"first").unwrap();
        write_bytes(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        let blocked = folder.path().join("a.csv/b.csv");
        assert!(write_bytes(&blocked, b"").is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_and_a_file_too_large_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let message = |path: &Path| read_bytes(path).unwrap_err().to_string();
        assert!(message(folder.path()).ends_with("it is a folder, not a file"));
        let path = folder.path().join("huge.csv");
        // A file of holes takes no room on the disk.
        fs::File::create(&path)
            .unwrap()
            .set_len(LARGEST_FILE + 1)
            .unwrap();
        assert!(
            message(&path).ends_with("has 536870913 bytes, more than the 536870912 that are read")
        );
    }
}
