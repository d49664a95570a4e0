//! Frames that do not fit their reference, repeated frames, and many frames.
use super::harness::{folder_with_examples, run, text, value, words};
use super::json::assert_keeps_to_schema;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;
use tactile_files::io::{Grey, read_grey_image, write_colour_image, write_grey_image};

/// The frames of the example press: without contact, at the lower load and at the higher load.
const REFERENCE: &str = "examples/data/press/reference.png";
const LOWER: &str = "examples/data/press/frame_1.png";
const HIGHER: &str = "examples/data/press/frame_2.png";

/// The example scene with other frames, with all paths relative to the folder.
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
    // A frame without contact must not be measured as a contact.
    scene(folder.path(), "empty.toml", REFERENCE, &[REFERENCE]);
    let (value, _) = measured(folder.path(), "empty.toml");
    let error = value["youngs_modulus_pa"]["error"].as_str().unwrap();
    assert!(
        error.contains("does not differ from the reference"),
        "{error}"
    );
}

/// Files that are left out, or whose colours differ from the reference, are named, and the program
/// continues.
#[test]
fn frames_that_do_not_fit_the_others_are_named() {
    let folder = folder_with_examples();
    let tinted = |from: &str, to: &str, weights: [f64; 3]| {
        let levels = read_grey_image(folder.path().join(from), Grey::default(), None).unwrap();
        let levels = levels.levels.insert_axis(ndarray::Axis(2));
        let shape = (levels.dim().0, levels.dim().1, 3);
        let weights = ndarray::arr1(&weights);
        let colours = &levels.broadcast(shape).unwrap() * &weights;
        let colours = colours.mapv(|level| level.round().min(255.0) as u8);
        write_colour_image(folder.path().join(to), colours.view()).unwrap();
    };
    tinted(REFERENCE, "blue.png", [0.4, 0.9, 1.4]);
    tinted(LOWER, "blue_press.png", [0.4, 0.9, 1.4]);
    tinted(LOWER, "red_press.png", [1.4, 0.9, 0.4]);
    tinted(LOWER, "three.png", [1.0; 3]);
    fs::write(folder.path().join("empty.png"), b"").unwrap();
    for (reference, frames, code, says) in [
        (
            REFERENCE,
            "blue_press.png",
            0,
            "blue_press.png is in colour",
        ),
        ("blue.png", LOWER, 0, "frame_1.png is grey"),
        (
            "blue.png",
            "red_press.png",
            0,
            "exchanged between red_press.png",
        ),
        ("blue.png", "blue_press.png", 0, ""),
        (REFERENCE, "three.png", 0, ""),
        (
            REFERENCE,
            "empty.png examples/data/press/frame_1.png",
            1,
            "empty.png: expected",
        ),
        (
            REFERENCE,
            "examples/data/press/frame_1.png absent.png",
            1,
            "cannot read absent.png",
        ),
    ] {
        let call = format!(
            "force --reference {reference} --pairs examples/data/press/calibration.csv \
             --pixel-um 40 --json {frames}"
        );
        let output = run(folder.path(), &words(&call));
        assert_eq!(
            output.status.code(),
            Some(code),
            "{call}: {}",
            text(&output.stderr)
        );
        let value = value(&output);
        assert_eq!(value["frames"].as_array().unwrap().len(), 1, "{call}");
        let cautions = value["cautions"].as_array().unwrap().iter();
        let kinds = ["colours_differ", "input_left_out"];
        let named = cautions.filter(|c| kinds.iter().any(|kind| c["kind"] == *kind));
        let named: Vec<_> = named.map(|c| c["text"].as_str().unwrap()).collect();
        let fits = named
            .first()
            .map_or(says.is_empty(), |text| text.contains(says));
        assert!(fits && named.len() < 2, "{call}: {named:?}");
    }
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

/// Thousands of different frames in one scene take little memory and at most one line of text each.
#[test]
fn thousands_of_frames_are_one_measurement() {
    const FRAMES: usize = 1_000;
    let folder = folder_with_examples();
    let read = |path| read_grey_image(folder.path().join(path), Grey::default(), None).unwrap();
    let pressed = [LOWER, HIGHER].map(|path| read(path).to_u8());
    let names: Vec<String> = (0..FRAMES).map(|k| format!("{k}.pgm")).collect();
    for (k, name) in names.iter().enumerate() {
        // One different pixel outside the contact makes each frame unique.
        let mut frame = pressed[k % 2].clone();
        let pixel = frame.iter_mut().nth(k / 2).unwrap();
        *pixel ^= 1;
        write_grey_image(folder.path().join(name), frame.view()).unwrap();
    }
    scene(folder.path(), "many.toml", REFERENCE, &names);
    // In addition to the program, a thousand results and the frames, which are kept up to 64 MB,
    // take 53 MB of address space. A matrix of all loads would add 8 MB, and a contact mask for
    // each frame 20 MB.
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
