//! Frames that do not fit their reference, that repeat one another, and many of them.
use super::harness::{folder_with_examples, run, text, words};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

/// The scene of the examples with other frames.
fn scene(folder: &Path, name: &str, reference: &str, frames: &[&str]) {
    let text = fs::read_to_string(folder.join("examples/data/press/scene.toml")).unwrap();
    let (head, rest) = text.split_once("[[frames]]").unwrap();
    let object = rest.find("[object]").unwrap();
    let frames: String = frames
        .iter()
        .map(|frame| format!("[[frames]]\nimage = \"examples/data/press/{frame}\"\n"))
        .collect();
    let head = head
        .replace("reference.png", &format!("examples/data/press/{reference}"))
        .replace("calibration.csv", "examples/data/press/calibration.csv");
    fs::write(folder.join(name), head + &frames + &rest[object..]).unwrap();
}

fn measured(folder: &Path, scene: &str) -> (Value, Option<i32>) {
    let output = run(folder, &words(&format!("measure {scene} --json")));
    let value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{e}: {}", text(&output.stderr)));
    (value, output.status.code())
}

#[test]
fn a_swapped_reference_is_named_as_one() {
    let folder = folder_with_examples();
    scene(
        folder.path(),
        "swapped.toml",
        "frame_2.png",
        &["reference.png", "frame_1.png"],
    );
    let (value, code) = measured(folder.path(), "swapped.toml");
    assert_eq!(code, Some(1));
    let error = value["youngs_modulus_pa"]["error"].as_str().unwrap();
    assert!(error.contains("were the two swapped"), "{error}");
    // A frame without contact is not taken for one.
    scene(
        folder.path(),
        "empty.toml",
        "reference.png",
        &["reference.png"],
    );
    let (value, _) = measured(folder.path(), "empty.toml");
    let error = value["youngs_modulus_pa"]["error"].as_str().unwrap();
    assert!(
        error.contains("does not differ from the reference"),
        "{error}"
    );
}

#[test]
fn a_frame_given_often_makes_no_modulus_surer() {
    let folder = folder_with_examples();
    let error_of = |value: &Value| {
        value["youngs_modulus_pa"]["value"]["standard_error"]
            .as_f64()
            .unwrap()
    };
    scene(
        folder.path(),
        "once.toml",
        "reference.png",
        &["frame_1.png", "frame_2.png"],
    );
    scene(
        folder.path(),
        "often.toml",
        "reference.png",
        &[
            "frame_1.png",
            "frame_2.png",
            "frame_1.png",
            "frame_2.png",
            "frame_2.png",
        ],
    );
    let once = measured(folder.path(), "once.toml").0;
    let often = measured(folder.path(), "often.toml").0;
    assert_eq!(error_of(&once), error_of(&often));
}

#[test]
fn a_sample_too_stiff_to_measure_has_a_bound_or_a_reason() {
    let folder = folder_with_examples();
    let output = run(
        folder.path(),
        &words("measure --modulus-kpa 1000000 --forces 0.2,0.3"),
    );
    let printed = text(&output.stdout);
    assert!(!printed.contains("above 0"), "{printed}");
}

/// 8,000 frames in one scene within 200 MB, and no more text than that.
#[test]
fn thousands_of_frames_are_one_measurement() {
    let folder = folder_with_examples();
    let frames: Vec<&str> = (0..8_000)
        .map(|k| ["frame_1.png", "frame_2.png"][k % 2])
        .collect();
    scene(folder.path(), "many.toml", "reference.png", &frames);
    // Some 8 kB a frame (its contact, its results) and the program itself: neither the pixels, 180 MB, nor a matrix of all loads, 512 MB,
    // fit beside them.
    let limit = 200_000;
    let output = Command::new("sh")
        .arg("-c")
        .arg(format!("ulimit -v {limit}; exec \"$@\""))
        .arg("sh")
        .arg(env!("CARGO_BIN_EXE_tactile"))
        .args(["measure", "many.toml"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let errors = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{errors}");
    let printed = text(&output.stdout);
    assert!(
        printed.lines().count() < 8_100,
        "a line a frame, and few more"
    );
}
