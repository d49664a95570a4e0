//! A sensor calibrated from frames by the program.
use super::harness::{printed, run, text, words};
use super::json::assert_keeps_to_schema;
use std::fs;
use std::path::Path;
use tactile_files::io::{Grey, read_grey_image};
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

/// Masses of weights instead of forces, and a video instead of an image, give the same sensor.
#[test]
fn weights_and_videos_calibrate_like_forces_and_frames() {
    let folder = calibration("", "");
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
    let pixels = |name: &str| {
        let path = folder.path().join(name);
        let image = read_grey_image(path, Grey::default(), None).unwrap();
        image.to_u8().iter().copied().collect::<Vec<u8>>()
    };
    // Other frames around the press, which `frames` leaves out.
    let mut video = b"YUV4MPEG2 W72 H72 F25:1 Cmono\n".to_vec();
    for name in [
        "reference.png",
        "weight_2.png",
        "weight_2.png",
        "reference.png",
    ] {
        video.extend([&b"FRAME\n"[..], &pixels(name)].concat());
    }
    fs::write(folder.path().join("weight_2.y4m"), video).unwrap();
    let plain = read("weights.toml");
    let mass = |force_n: f64| format!("mass_kg = {:.9}", force_n / 9.81);
    let changed = plain
        .replace("\"weight_2.png\"", "\"weight_2.y4m\"\nframes = [2, 3]")
        .replace("force_N = 0.005882", &mass(0.005882))
        .replace("force_N = 0.011777", &mass(0.011777));
    let stated = changed.replacen("gauge_error", "gravity_m_per_s2 = 9.81\ngauge_error", 1);
    for (name, text) in [("unstated.toml", &changed), ("stated.toml", &stated)] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let value = |name: &str| -> serde_json::Value {
        let call = format!("calibrate {name} --json");
        serde_json::from_str(&printed(folder.path(), &call)).unwrap()
    };
    let [plain, stated, unstated] = ["weights.toml", "stated.toml", "unstated.toml"].map(value);
    let of =
        |value: &serde_json::Value, k: usize, key: &str| value["presses"][k][key].as_f64().unwrap();
    for k in 0..5 {
        let [light, again] = [&plain, &stated].map(|v| of(v, k, "integrated_pixel_value"));
        assert_eq!(light, again, "{k}");
        let [force, again] = [&plain, &stated].map(|v| of(v, k, "force_n"));
        assert!((force / again - 1.0).abs() < 1e-6, "{k}");
    }
    // Standard gravity, whose error is that of all places.
    assert!((of(&unstated, 4, "force_n") / of(&plain, 4, "force_n") - 9.80665 / 9.81).abs() < 1e-6);
    let [exact, wide] = [&stated, &unstated].map(|v| v["sensor"]["gauge_error"].as_f64().unwrap());
    assert!(exact == 1e-3 && wide > 1.5e-3);
    // Neither a force nor a mass, and frames that the video does not have.
    for (from, to, sentence) in [
        (mass(0.011777), String::new(), "mass_kg"),
        ("[2, 3]".to_owned(), "[7, 9]".to_owned(), "no frames 7 to 9"),
    ] {
        fs::write(
            folder.path().join("wrong.toml"),
            changed.replace(&from, &to),
        )
        .unwrap();
        let output = run(folder.path(), &words("calibrate wrong.toml"));
        assert!(
            text(&output.stderr).contains(sentence),
            "{}",
            text(&output.stderr)
        );
    }
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
