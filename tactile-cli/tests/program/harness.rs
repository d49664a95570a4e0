//! Running the program.
use serde_json::Value;
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// The largest address space of a call, in KiB: 8 GB.
const ADDRESS_SPACE_KIB: u32 = 8 << 20;

/// Runs the program with these arguments in this folder, with a limited address space.
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

/// The output of a successful call.
pub(crate) fn printed(folder: &Path, call: &str) -> String {
    let output = run(folder, &words(call));
    let errors = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "tactile {call}: {errors}");
    text(&output.stdout)
}

/// The JSON object printed by a call.
pub(crate) fn value(output: &Output) -> Value {
    json(&text(&output.stdout)).unwrap_or_else(|e| panic!("{e}: {}", text(&output.stderr)))
}

/// The printed JSON of a call. In JSON Lines the last line is the result, and the lines before it
/// are its `updates`.
pub(crate) fn json(printed: &str) -> serde_json::Result<Value> {
    let mut lines: Vec<&str> = printed.lines().collect();
    if !lines
        .iter()
        .all(|line| line.starts_with('{') && line.ends_with('}'))
    {
        return serde_json::from_str(printed);
    }
    let mut answer: Value = serde_json::from_str(lines.pop().unwrap_or_default())?;
    if answer["command"] == "stream" {
        let updates: Result<_, _> = lines.into_iter().map(serde_json::from_str).collect();
        answer["updates"] = Value::Array(updates?);
    }
    Ok(answer)
}

/// The words of a shell command, without quotes.
pub(crate) fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// A folder in which the paths in the help lead to the example data.
pub(crate) fn folder_with_examples() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    std::os::unix::fs::symlink(examples, folder.path().join("examples")).unwrap();
    folder
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
