//! Frames that do not fit their reference, that repeat one another, and many of them.
use super::harness::{folder_with_examples, run, text, value, words};
use super::json::assert_keeps_to_schema;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;
use tactile_files::io::{Grey, read_grey_image, write_grey_image};

/// The frames of the examples' press: without contact, at the lower and at the higher load.
const REFERENCE: &str = "examples/data/press/reference.png";
const LOWER: &str = "examples/data/press/frame_1.png";
const HIGHER: &str = "examples/data/press/frame_2.png";

/// The scene of the examples with other frames, all by their paths from the folder.
fn scene(folder: &Path, name: &str, reference: &str, frames: &[impl AsRef<str>]) {
    let text = fs::read_to_string(folder.join("examples/data/press/scene.toml")).unwrap();
    let (head, rest) = text.split_once("[[frames]]").unwrap();
    let object = rest.find("[object]").unwrap();
    let frames: String = frames
        .iter()
        .map(|frame| format!("[[frames]]\nimage = \"{}\"\n", frame.as_ref()))
        .collect();
    let head = head
        .replace("reference.png", reference)
        .replace("calibration.csv", "examples/data/press/calibration.csv");
    fs::write(folder.join(name), head + &frames + &rest[object..]).unwrap();
}

fn measured(folder: &Path, scene: &str) -> (Value, Option<i32>) {
    let output = run(folder, &words(&format!("measure {scene} --json")));
    let value = value(&output);
    assert_keeps_to_schema(&value, scene);
    (value, output.status.code())
}

#[test]
fn a_swapped_reference_is_named_as_one() {
    let folder = folder_with_examples();
    scene(folder.path(), "swapped.toml", HIGHER, &[REFERENCE, LOWER]);
    let (value, code) = measured(folder.path(), "swapped.toml");
    assert_eq!(code, Some(1));
    let error = value["youngs_modulus_pa"]["error"].as_str().unwrap();
    assert!(error.contains("were the two swapped"), "{error}");
    // A frame without contact is not taken for one.
    scene(folder.path(), "empty.toml", REFERENCE, &[REFERENCE]);
    let (value, _) = measured(folder.path(), "empty.toml");
    let error = value["youngs_modulus_pa"]["error"].as_str().unwrap();
    assert!(
        error.contains("does not differ from the reference"),
        "{error}"
    );
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

/// Thousands of different frames in one scene take little memory and no more text than a line each.
#[test]
fn thousands_of_frames_are_one_measurement() {
    const FRAMES: usize = 1_000;
    let folder = folder_with_examples();
    let read = |path| read_grey_image(folder.path().join(path), Grey::default(), None).unwrap();
    let pressed = [LOWER, HIGHER].map(|path| read(path).to_u8());
    let names: Vec<String> = (0..FRAMES).map(|k| format!("{k}.pgm")).collect();
    for (k, name) in names.iter().enumerate() {
        // A pixel of its own beyond the contact makes each a frame that no other repeats.
        let mut frame = pressed[k % 2].clone();
        let pixel = frame.iter_mut().nth(k / 2).unwrap();
        *pixel ^= 1;
        write_grey_image(folder.path().join(name), frame.view()).unwrap();
    }
    scene(folder.path(), "many.toml", REFERENCE, &names);
    // Beside the program itself, a thousand results and the frames, which are kept up to 64 MB,
    // take 53 MB of address space. A matrix of all loads would add 8 MB, a mask of each frame's
    // contact 20 MB.
    let program = env!("CARGO_BIN_EXE_tactile");
    let limit = fs::metadata(program).unwrap().len() / 1024 + 57_000;
    let output = Command::new("sh")
        .arg("-c")
        .arg(format!("ulimit -v {limit}; exec \"$@\""))
        .arg("sh")
        .arg(program)
        .args(["measure", "many.toml"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let errors = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{errors}");
    let printed = text(&output.stdout);
    assert!(
        printed.lines().count() < FRAMES + 100,
        "a line a frame, and few more"
    );
}
