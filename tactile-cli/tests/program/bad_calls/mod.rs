//! A table of invalid calls: each ends with the right exit code and one sentence, and changes no
//! file.
mod files;

use super::bad_files;
use super::harness::{run, text};
use files::{good_files, lump_scene, more_files};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Arguments that must be an image file, with `@` in place of the file.
const IMAGES: [&str; 5] = [
    "force --reference @ --pairs calibration.csv --pixel-um 40 frame_1.png",
    "force --reference reference.png --pairs calibration.csv --pixel-um 40 @",
    "depth --reference @ --table depth_table.csv --pixel-um 100 dark_frame.pgm",
    "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 @",
    "integrate slope_x.csv slope_y.csv --mask @",
];

/// Arguments that must be a table.
const TABLES: [&str; 9] = [
    "calibrate @",
    "match @",
    "warp @ after.csv before.csv",
    "warp before.csv @ before.csv",
    "warp before.csv before.csv @",
    "strain @ after.csv",
    "strain before.csv @",
    "integrate @ slope_y.csv",
    "depth --reference dark_reference.pgm --table @ --pixel-um 100 dark_frame.pgm",
];

/// Lines of a file of cases, without empty lines and comments.
fn lines(text: &str) -> impl Iterator<Item = &str> {
    text.lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
}

/// The calls of `calls.txt`, each with a part of the expected sentence.
fn calls() -> Vec<(String, String)> {
    let mut calls = Vec::new();
    for line in lines(include_str!("calls.txt")) {
        let (call, says) = line.split_once(" => ").expect(line);
        let (call, values) = call.split_once(" | ").unwrap_or((call, "@"));
        for value in values.split_whitespace() {
            calls.push((call.replace('@', value), says.to_owned()));
        }
    }
    calls
}

/// The bytes of all regular files in the folder except the huge one.
fn state(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries
        .map(|entry| {
            let regular = entry.file_type().unwrap().is_file();
            let name = entry.file_name().to_string_lossy().into_owned();
            let small = regular && entry.metadata().unwrap().len() < 1 << 24;
            let bytes = if small {
                fs::read(entry.path()).unwrap()
            } else {
                Vec::new()
            };
            (name, bytes)
        })
        .collect()
}

/// A description of the fault in how a call ended. `None` if there is none.
fn complaint(folder: &Path, call: &str, says: &str) -> Option<String> {
    let arguments: Vec<&str> = call.split_whitespace().collect();
    let output = run(folder, &arguments);
    let (out, errors) = (text(&output.stdout), text(&output.stderr));
    let one_sentence = errors.lines().count() == 1 && errors.starts_with("tactile: ");
    // Messages must not contain names of types and fields, which are for programmers.
    let debug = ["panicked", "Error", "Some(", " { ", "unwrap", "Mismatch"];
    let wrong = if output.status.code() != Some(2) {
        format!("ended with {}", output.status)
    } else if !one_sentence {
        "does not say what is wrong in one sentence".into()
    } else if let Some(word) = debug.iter().find(|word| errors.contains(**word)) {
        format!("says `{word}`")
    } else if !errors.contains(says) {
        format!("does not say `{says}`")
    } else if !out.is_empty() {
        "prints results".into()
    } else {
        return None;
    };
    Some(format!(
        "tactile {call}\n    {wrong}: {}{}",
        errors.trim_end(),
        out.trim_end()
    ))
}

/// Scenes with one text replaced, and the calls that use them.
fn edited(folder: &Path) -> Vec<(String, String)> {
    let scene = fs::read_to_string(folder.join("scene.toml")).unwrap();
    let mut calls = Vec::new();
    for (kind, text, edits, commands) in [
        (
            "scene",
            scene,
            include_str!("scene_edits.txt"),
            &["measure", "stream"][..],
        ),
        (
            "lump",
            lump_scene(),
            include_str!("lump_edits.txt"),
            &["inclusion"],
        ),
    ] {
        let mut from = String::new();
        for (k, line) in lines(edits).enumerate() {
            let line = line.replace('¶', "\n");
            let Some(edit) = line.strip_prefix("    ") else {
                assert!(text.contains(&line), "{line}");
                from = line;
                continue;
            };
            let (to, says) = edit.split_once(" => ").expect(edit);
            let name = format!("{kind}_{k}.toml");
            fs::write(folder.join(&name), text.replacen(&from, to, 1)).unwrap();
            let calls_of = commands.iter().map(|command| format!("{command} {name}"));
            calls.extend(calls_of.map(|call| (call, says.to_owned())));
        }
    }
    calls
}

#[test]
fn every_bad_call_is_refused_in_one_sentence_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    good_files(folder);
    let (images, tables) = bad_files::write(folder);
    more_files(folder);
    let edited = edited(folder);
    let before = state(folder);
    let mut calls = self::calls();
    for (places, files) in [(&IMAGES[..], &images), (&TABLES[..], &tables)] {
        for place in places {
            for file in files {
                let is_case_file = place.starts_with("match");
                // A matrix may have any number of columns, and a point has as many coordinates as
                // the file.
                let fits =
                    place.starts_with("integrate") && matches!(*file, "wide.csv" | "infinite.csv");
                if fits && !is_case_file {
                    continue;
                }
                let name = file.trim_start_matches("/dev/").trim_end_matches("_a");
                calls.push((place.replace('@', file), name.to_owned()));
            }
        }
    }
    calls.extend(edited);
    assert!(calls.len() >= 600, "{} calls", calls.len());
    let complaints: Vec<String> = (calls.iter())
        .filter_map(|(call, says)| complaint(folder, call, says))
        .collect();
    assert!(
        complaints.is_empty(),
        "{} of {} calls:\n{}",
        complaints.len(),
        calls.len(),
        complaints.join("\n")
    );
    assert!(
        state(folder) == before,
        "a file was changed, made or removed"
    );
}
