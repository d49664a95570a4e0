//! Files that are replaced only by complete ones.
use std::fs::{self, OpenOptions};
use std::io::{Error, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Writes a whole file, creating its folder where needed: the bytes go to a temporary file in the same folder, which then takes the name. A
/// link is followed. What is no file (`/dev/stdout`) is written to as it is.
pub fn replace_file(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => {
            Err(Error::new(ErrorKind::IsADirectory, "it is a folder"))
        }
        Ok(metadata) if !metadata.is_file() => {
            let mut device = OpenOptions::new().write(true).open(path)?;
            device.write_all(bytes)
        }
        Ok(_) => replace(&fs::canonicalize(path)?, bytes),
        Err(_) => {
            if let Some(folder) = path.parent() {
                fs::create_dir_all(folder)?;
            }
            replace(path, bytes)
        }
    }
}

/// Writes beside `path` and renames. Nothing is left behind where that fails.
fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    if path.file_name().is_none() {
        return Err(Error::new(ErrorKind::InvalidInput, "it has no file name"));
    }
    let temporary = beside(path);
    // A new file only: one that is there belongs to somebody else.
    let mut file = OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(&temporary)?;
    let written = file.write_all(bytes).and_then(|()| file.flush());
    drop(file);
    let done = written.and_then(|()| fs::rename(&temporary, path));
    if done.is_err() {
        let _ = fs::remove_file(&temporary);
    }
    done
}

/// A name in the folder of `path` that nothing else has, and that is short whatever the name of `path`.
fn beside(path: &Path) -> PathBuf {
    let process = std::process::id();
    let candidate = |k: u32| path.with_file_name(format!(".{process}-{k}.part"));
    (0..u32::MAX)
        .map(candidate)
        .find(|p| fs::symlink_metadata(p).is_err())
        .unwrap_or_else(|| candidate(u32::MAX))
}
