//! Gels that are lit in colours: calibrated, wrong circles named, and depth of the whole frame.
use super::harness::{folder_with_examples, run, text, words};
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
