//! Running the program.
use serde_json::Value;
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// The largest address space that a call may take, in KiB: 8 GB.
const ADDRESS_SPACE_KIB: u32 = 8 << 20;

/// The program with these arguments in this folder, under a limit of its address space.
pub(crate) fn tactile(folder: &Path, arguments: &[impl AsRef<OsStr>]) -> Command {
    let mut command = Command::new("sh");
    command
        .arg("-c")
        .arg(format!("ulimit -v {ADDRESS_SPACE_KIB}; exec \"$@\""))
        .arg("sh")
        .arg(env!("CARGO_BIN_EXE_tactile"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null());
    command
}

pub(crate) fn run(folder: &Path, arguments: &[impl AsRef<OsStr>]) -> Output {
    tactile(folder, arguments).output().expect("sh runs")
}

/// What a call prints that ends well.
pub(crate) fn printed(folder: &Path, call: &str) -> String {
    let output = run(folder, &words(call));
    let errors = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "tactile {call}: {errors}");
    text(&output.stdout)
}

/// The JSON object of a call.
pub(crate) fn value(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{e}: {}", text(&output.stderr)))
}

/// The words of a line of a shell, without quotes.
pub(crate) fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// A folder in which the paths of the help lead to the examples' data.
pub(crate) fn folder_with_examples() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    std::os::unix::fs::symlink(examples, folder.path().join("examples")).unwrap();
    folder
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
