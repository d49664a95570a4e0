//! Gels that are lit in colours: calibrated, wrong circles named, and depth of the whole frame.
use super::harness::{folder_with_examples, run, text, words};
use super::json::assert_keeps_to_schema;
use std::fs;

#[test]
fn a_calibrated_gel_gives_depth_and_gradients() {
    let folder = folder_with_examples();
    let call = |line: &str| {
        let output = run(folder.path(), &words(line));
        let errors = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "tactile {line}: {errors}");
        text(&output.stdout)
    };
    let calibration = "examples/data/colour/calibration.toml";
    call(&format!("calibrate {calibration} --out made/sensor.toml"));
    call("depth --sensor made/sensor.toml examples/data/colour/press_6.png --out made");
    let table = |name: &str| {
        let rows = fs::read_to_string(folder.path().join("made").join(name)).unwrap();
        let row = |row: &str| {
            row.split(',')
                .map(|v| v.parse().unwrap())
                .collect::<Vec<f64>>()
        };
        rows.lines().map(row).collect::<Vec<_>>()
    };
    let [depth, x, y] =
        ["depth", "gradient_x", "gradient_y"].map(|name| table(&format!("press_6_{name}.csv")));
    for grid in [&depth, &x, &y] {
        assert!(grid.len() == 90 && grid.iter().all(|row| row.len() == 120));
    }
    // A ball of 24 px in contact up to 16 px from (58, 30), pixels of 50 µm: a tenth of its depth.
    let truth = 50e-6 * (24.0 - 320.0_f64.sqrt());
    assert!(
        (depth[30][58] / truth - 1.0).abs() < 0.1,
        "{}",
        depth[30][58]
    );
    assert!(depth[80][110] == 0.0 && x[30][50] > 0.1 && y[38][58] < -0.1);
    // A circle that is eight pixels off.
    let wrong = fs::read_to_string(folder.path().join(calibration)).unwrap();
    let wrong = wrong.replace("[86, 60, 15]", "[78, 60, 15]");
    let wrong = wrong.replace("= \"press", "= \"examples/data/colour/press");
    let wrong = wrong.replace(
        "\"reference.png\"",
        "\"examples/data/colour/reference.png\"",
    );
    fs::write(folder.path().join("wrong.toml"), wrong).unwrap();
    let printed = call("calibrate wrong.toml");
    let named = printed
        .lines()
        .filter(|line| line.contains("circle is wrong"));
    let named: Vec<_> = named.collect();
    assert!(
        matches!(named[..], [line] if line.contains("press_3.png")),
        "{printed}"
    );
}

/// The modulus is that of a known weight, and a press has the force of its depth.
#[test]
fn a_known_weight_makes_forces() {
    let folder = folder_with_examples();
    let call = |line: &str| {
        let output = run(folder.path(), &words(line));
        let errors = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "tactile {line}: {errors}");
        text(&output.stdout)
    };
    let calibration = folder.path().join("examples/data/colour/calibration.toml");
    let calibration = fs::read_to_string(calibration).unwrap();
    let weight = "[[gel.weights]]\nimage = \"press_6.png\"\nforce_N = 2\nforce_error_N = 0.1";
    let weighed = format!("{calibration}\n[gel]\nthickness_m = 4e-3\n{weight}\n");
    let weighed = ["press", "reference"].iter().fold(weighed, |text, name| {
        text.replace(
            &format!("= \"{name}"),
            &format!("= \"examples/data/colour/{name}"),
        )
    });
    fs::write(folder.path().join("weighed.toml"), weighed).unwrap();
    call("calibrate weighed.toml --out made/sensor.toml");
    let forces = |sensor: &str| -> Vec<serde_json::Value> {
        let presses = [6, 3, 4]
            .map(|k| format!("examples/data/colour/press_{k}.png"))
            .join(" ");
        let printed = call(&format!("measure {sensor} {presses} --json"));
        let value: serde_json::Value = serde_json::from_str(&printed).unwrap();
        assert_keeps_to_schema(&value, "measure");
        (0..3).map(|k| value["frames"][k].clone()).collect()
    };
    let of = |frame: &serde_json::Value| {
        ["value", "standard_error"].map(|name| frame["force_n"][name].as_f64().unwrap())
    };
    let found = forces("made/sensor.toml");
    // The weight itself, with the error of the weight and twice that of the depth.
    assert!((of(&found[0])[0] - 2.0).abs() < 1e-6, "{:?}", of(&found[0]));
    assert!(of(&found[0])[1] > 0.1);
    // Contacts of one ball: the smaller, the less.
    for frame in &found[1..] {
        let wider = frame["contact"]["area_m2"].as_f64() > found[0]["contact"]["area_m2"].as_f64();
        assert_eq!(wider, of(frame)[0] > 2.0, "{frame}");
    }
    let refused = forces("examples/data/colour/sensor.toml");
    assert!(
        refused[0]["force_n"]["error"]
            .as_str()
            .unwrap()
            .contains("[gel]")
    );
    call("stream made/sensor.toml examples/data/colour/press_6.png --allowed-late 100 --out made");
    let rows = fs::read_to_string(folder.path().join("made/stream.csv")).unwrap();
    let force: f64 = rows
        .lines()
        .nth(1)
        .unwrap()
        .split(',')
        .nth(1)
        .unwrap()
        .parse()
        .unwrap();
    assert!((force - 2.0).abs() < 1e-6, "{rows}");
}
