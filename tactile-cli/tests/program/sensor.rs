//! A sensor calibrated from frames by the program.
use super::harness::{printed, run, text, words};
use super::json::assert_keeps_to_schema;
use std::fs;
use std::path::Path;
use tactile_files::sensor::Sensor;
use tactile_imaging::force::LocalCalibration;
use tempfile::TempDir;

/// The example calibration under its own name, with all occurrences of one text replaced.
fn calibration(from: &str, to: &str) -> TempDir {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/data/sensor");
    let folder = tempfile::tempdir().unwrap();
    for entry in fs::read_dir(data).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
    }
    let file = folder.path().join("calibration.toml");
    let said = fs::read_to_string(&file).unwrap();
    assert!(said.contains(from), "{from}");
    fs::write(&file, said.replace(from, to)).unwrap();
    folder
}

#[test]
fn a_calibration_writes_a_sensor_and_a_report_and_says_what_was_learned() {
    let folder = calibration("", "");
    let call = "calibrate calibration.toml --out made/sensor.toml --json";
    let value: serde_json::Value = serde_json::from_str(&printed(folder.path(), call)).unwrap();
    assert_keeps_to_schema(&value, "calibrate");
    // The frames belong to a layer of 100 kPa, for which 95 ± 10 kPa are stated.
    let modulus = &value["layers"][0];
    assert_eq!(modulus["parameter"], "youngs_modulus_pa");
    assert_eq!(modulus["identified"], true);
    let [fitted, error] =
        ["value", "standard_error"].map(|key| modulus["fitted"][key].as_f64().unwrap());
    // Contact radii of 8 to 22 pixels are accurate to some hundredths of a pixel, and forces to 0.5
    // % or better. The tolerance is three standard errors.
    assert!(
        (fitted - 100e3).abs() < 3.0 * error && error < 2e3,
        "{fitted} ± {error}"
    );
    // The bottom of the layer is ten contact radii away, so that the presses do not determine its
    // depth.
    assert_eq!(value["layers"][1]["identified"], false);
    let sensor = Sensor::read(folder.path().join("made/sensor.toml")).unwrap();
    assert_eq!(sensor.layers[0].youngs_modulus_pa, fitted);
    // The light is 0.012 grey levels per pascal, within the stated error of the curve.
    let pressure = sensor.curve.pressure_pa(120.0);
    assert!((pressure.value - 1e4).abs() < 4.0 * pressure.standard_error.max(25.0));
    let report = fs::read_to_string(folder.path().join("made/sensor.svg")).unwrap();
    assert!(report.contains("not identified, stays as stated"));
}

/// A change of the calibration, the exit code of the call, and the expected sentence.
const MISTAKES: [(&str, &str, &str, &str); 9] = [
    ("date = ", "date ", "", "calibration.toml"),
    ("gauge_error = 1e-3", "gauge_error = -1", "", "gauge_error"),
    ("gauge_error", "gauge_eror", "", "gauge_eror"),
    ("press_07.png", "nothing.png", "", "nothing.png"),
    (
        "branch = \"unloading\"",
        "branch = \"upwards\"",
        "",
        "upwards",
    ),
    (
        "covers_N = [0.003, 0.02]",
        "covers_N = [0.003, 0.2]",
        "",
        "scenes will have 0.003 N to 0.200 N",
    ),
    ("", "", "--out made", "ends with .toml"),
    ("", "", "--out calibration.toml", "would replace the input"),
    ("", "", "--there-and-back", "branch"),
];

/// A description of the fault in how the calibration in this folder is refused. `None` if there is
/// none.
fn complaint(folder: &Path, end: &str, says: &str) -> Option<String> {
    let before = fs::read_dir(folder).unwrap().count();
    let end = if end.is_empty() {
        "--out made/sensor.toml"
    } else {
        end
    };
    let output = run(folder, &words(&format!("calibrate calibration.toml {end}")));
    let errors = text(&output.stderr);
    let refused = output.status.code() == Some(2) && output.stdout.is_empty();
    let sentence = errors.lines().count() == 1 && errors.contains(says);
    let nothing_written = fs::read_dir(folder).unwrap().count() == before;
    (!(refused && sentence && nothing_written))
        .then(|| format!("{says}: {:?} {errors}", output.status))
}

#[test]
fn every_bad_calibration_is_refused_in_one_sentence_and_nothing_is_written() {
    let mut complaints = Vec::new();
    for (from, to, end, says) in MISTAKES {
        complaints.extend(complaint(calibration(from, to).path(), end, says));
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}
