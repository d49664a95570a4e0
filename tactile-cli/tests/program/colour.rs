//! Gels that are lit in colours: calibration, reports of wrong circles, and depth of the whole
//! frame.
use super::harness::{folder_with_examples, json, printed, text, value};
use super::json::assert_keeps_to_schema;
use super::streams::piped;
use serde_json::Value;
use std::fs;
use tactile_files::io::{read_colour_levels, write_colour_image};

#[test]
fn a_calibrated_gel_gives_depth_and_gradients() {
    let folder = folder_with_examples();
    let call = |line: &str| printed(folder.path(), line);
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
    // A ball of 24 px in contact up to 16 px from (58, 30), pixels of 50 µm: a²/2R by Hertz's law.
    // The sensor's own standard error is 3 %.
    let value: Value = serde_json::from_str(&call(
        "depth --sensor made/sensor.toml examples/data/colour/press_6.png --json",
    ))
    .unwrap();
    assert_keeps_to_schema(&value, "depth");
    let contacts = &value["frames"][0]["contacts"];
    assert_eq!(contacts.as_array().map(Vec::len), Some(1), "{contacts}");
    let truth = 50e-6 * 16.0_f64.powi(2) / 48.0;
    let found = contacts[0]["largest_depth_m"]["value"].as_f64().unwrap();
    assert!((found / truth - 1.0).abs() < 0.1, "{found} {truth}");
    let centre: Vec<f64> = serde_json::from_value(contacts[0]["centroid"].clone()).unwrap();
    assert!(
        (centre[0] - 58.0).hypot(centre[1] - 30.0) < 1.0,
        "{centre:?}"
    );
    // The depth of the face is measured from the gel far away.
    assert!(depth[30][58] > found && depth[80][110].abs() < 0.2 * depth[30][58]);
    assert!(x[30][50] > 0.1 && y[38][58] < -0.1);
    let labels = table("press_6_contact.csv");
    assert!(labels[30][58] == 1.0 && labels[80][110] == 0.0);
    let mesh = fs::read(folder.path().join("made/press_6.ply")).unwrap();
    let header = b"end_header\n";
    let at = mesh
        .windows(header.len())
        .position(|w| w == header)
        .unwrap()
        + header.len();
    assert_eq!(mesh.len() - at, 12 * 120 * 90 + 17 * 119 * 89);
    assert!(folder.path().join("made/press_6.npz").exists());
    // This circle is wrong by eight pixels.
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

/// Frames of other sensors are named and have no result.
#[test]
fn a_frame_of_others_is_not_read() {
    let folder = folder_with_examples();
    let sensor = "examples/data/colour/sensor.toml";
    let press = folder.path().join("examples/data/colour/press_6.png");
    let mut levels = read_colour_levels(press).unwrap();
    levels.invert_axis(ndarray::Axis(2));
    let mut exchanged = b"P6\n120 90\n255\n".to_vec();
    exchanged.extend(&levels);
    let mut black = b"P6\n120 90\n255\n".to_vec();
    black.extend(vec![0; 3 * 120 * 90]);
    for (bytes, kinds) in [
        (exchanged, &["channels_exchanged", "no_surface"][..]),
        (black, &["black_frame"][..]),
    ] {
        let output = piped(
            folder.path(),
            &format!("depth --sensor {sensor} --json -"),
            &bytes,
        );
        let value = value(&output);
        let kind = value["cautions"][0]["kind"].as_str().unwrap_or_default();
        assert!(kinds.contains(&kind), "{value}");
    }
}

/// The modulus follows from a known weight, and the force of a press from its depth.
#[test]
fn a_known_weight_makes_forces() {
    let folder = folder_with_examples();
    let call = |line: &str| printed(folder.path(), line);
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
    let forces = |sensor: &str| -> Vec<Value> {
        let presses = [6, 3, 4]
            .map(|k| format!("examples/data/colour/press_{k}.png"))
            .join(" ");
        let printed = call(&format!("measure {sensor} {presses} --json"));
        let value: Value = serde_json::from_str(&printed).unwrap();
        assert_keeps_to_schema(&value, "measure");
        (0..3).map(|k| value["frames"][k].clone()).collect()
    };
    let of = |frame: &Value| {
        ["value", "standard_error"].map(|name| frame["force_n"][name].as_f64().unwrap())
    };
    let found = forces("made/sensor.toml");
    // The force must be the weight, within the error of the weight and twice that of the depth.
    assert!((of(&found[0])[0] - 2.0).abs() < 1e-6, "{:?}", of(&found[0]));
    assert!(of(&found[0])[1] > 0.1);
    // For contacts of one ball, a smaller contact has a smaller force.
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
    let second = rows.lines().nth(1).and_then(|row| row.split(',').nth(1));
    let force: f64 = second.unwrap().parse().unwrap();
    assert!((force - 2.0).abs() < 1e-6, "{rows}");
}

/// Dots printed on all frames of the example, every 15 px, and moved by 2 px in the last press: the
/// depth is that without dots, and the shear force that of the layer over all cells.
#[test]
fn dots_on_a_gel_give_its_force_sideways() {
    let folder = folder_with_examples();
    let data = folder.path().join("examples/data/colour");
    let made = folder.path().join("dotted");
    fs::create_dir(&made).unwrap();
    let print = |from: &str, to: &str, shift: f64| {
        let mut levels = read_colour_levels(data.join(from)).unwrap();
        let near = |at: f64| (at - 7.5).rem_euclid(15.0) - 7.5;
        for ((row, column, _), level) in levels.indexed_iter_mut() {
            let [x, y] = [near(column as f64 - 7.5 - shift), near(row as f64 - 7.5)];
            let cover = 1.0 / (1.0 + (2.0 * (x.hypot(y) - 2.5)).exp());
            *level = (f64::from(*level) * (1.0 - 0.8 * cover)).round() as u8;
        }
        write_colour_image(made.join(to), levels.view()).unwrap();
    };
    for name in [
        "reference",
        "press_1",
        "press_2",
        "press_3",
        "press_4",
        "press_5",
        "press_6",
    ] {
        print(&format!("{name}.png"), &format!("{name}.png"), 0.0);
    }
    print("press_6.png", "sheared.png", 2.0);
    let text = fs::read_to_string(data.join("calibration.toml")).unwrap();
    let gel = "[gel]\nthickness_m = 4e-3\nyoungs_modulus_pa = 1.2e5\nyoungs_modulus_error_pa = 0";
    let [thickness, modulus] = [4e-3, 1.2e5];
    fs::write(made.join("calibration.toml"), format!("{text}\n{gel}\n")).unwrap();
    let call = |line: &str| printed(folder.path(), line);
    call("calibrate dotted/calibration.toml --out made/dots.toml");
    let frames = "dotted/press_6.png dotted/sheared.png";
    let found = call(&format!("measure made/dots.toml {frames} --json"));
    let found: Value = serde_json::from_str(&found).unwrap();
    assert_keeps_to_schema(&found, "measure");
    // As without dots, within the 3 % of the calibration and the 6 % of the dots.
    let depth = |k: usize| {
        let contact = &found["frames"][k]["contact"];
        contact["largest_depth_m"]["value"].as_f64().unwrap()
    };
    let truth = 50e-6 * 16.0_f64.powi(2) / 48.0;
    assert!(
        (0..2).all(|k| (depth(k) / truth - 1.0).abs() < 0.15),
        "{found}"
    );
    // 48 cells of 15 by 15 pixels move by 2 pixels of 50 µm. Poisson's ratio is 0.48.
    let truth = modulus / 2.96 / thickness * 48.0 * (15.0 * 50e-6_f64).powi(2) * 100e-6;
    let along = |k: usize| {
        let force = &found["frames"][k]["dots"]["wrench"]["force_n"][0]["value"];
        force.as_f64().unwrap()
    };
    assert!(along(0).abs() < 0.02 * truth, "{found}");
    // Dots cut by the border are left out, and the edges of others are lit by the contact.
    assert!(
        (along(1) / truth - 1.0).abs() < 0.05,
        "{} {truth}",
        along(1)
    );
    let stream = format!("stream made/dots.toml {frames} --allowed-late 100 --out made");
    call(&stream);
    let rows = fs::read_to_string(folder.path().join("made/stream.csv")).unwrap();
    let heading: Vec<_> = rows.lines().next().unwrap().split(',').collect();
    let column = heading
        .iter()
        .position(|name| *name == "force_x_N")
        .unwrap();
    let last: Vec<_> = rows.lines().last().unwrap().split(',').collect();
    assert_eq!(last[column].parse::<f64>().unwrap(), along(1), "{rows}");
}

/// Frames from a camera, as a sequence of PPM images, have the same results as the files.
#[test]
fn a_pipe_of_colours_gives_the_answers_of_the_files() {
    let folder = folder_with_examples();
    let sensor = "examples/data/colour/sensor.toml";
    let names = [3, 6].map(|k| format!("examples/data/colour/press_{k}.png"));
    let mut camera = Vec::new();
    for name in &names {
        camera.extend(b"P6\n120 90\n255\n");
        camera.extend(read_colour_levels(folder.path().join(name)).unwrap());
    }
    let files = |call: &str| -> Value { json(&printed(folder.path(), call)).unwrap() };
    let stream = format!("stream {sensor} --rate 25 --allowed-late 100 --json");
    let measured = files(&format!("{stream} {}", names.join(" ")));
    assert_keeps_to_schema(&measured, "stream");
    let live = piped(
        folder.path(),
        &format!("{stream} --record kept.ppm -"),
        &camera,
    );
    assert_eq!(live.status.code(), Some(0), "{}", text(&live.stderr));
    // Times of files follow from the numbers in their names, those of a pipe from its frames.
    let contacts = |of: &Value| [0, 1].map(|k| of["updates"][k]["contact"].clone());
    assert_eq!(contacts(&value(&live)), contacts(&measured));
    assert_eq!(value(&live)["updates"][1]["time_s"], 0.04);
    assert_eq!(fs::read(folder.path().join("kept.ppm")).unwrap(), camera);
    let again = files(&format!("{stream} kept.ppm"));
    assert_eq!(again["updates"], value(&live)["updates"]);
    let rows = fs::read_to_string(folder.path().join("kept.csv")).unwrap();
    assert_eq!(rows.lines().count(), 3, "{rows}");
    let depth = format!("depth --sensor {sensor} --json");
    let piped_depth = value(&piped(folder.path(), &format!("{depth} -"), &camera));
    let of_files = files(&format!("{depth} {}", names.join(" ")));
    for k in [0, 1] {
        assert_eq!(
            piped_depth["frames"][k]["contact"],
            of_files["frames"][k]["contact"]
        );
    }
}

/// Each fault gives one sentence, and earlier results are kept.
#[test]
fn frames_without_colours_are_refused() {
    let folder = folder_with_examples();
    let stream = "stream examples/data/colour/sensor.toml - --allowed-late 100 --json";
    for (bytes, found) in [
        (
            &b"YUV4MPEG2 W2 H1 F25:1 Cmono\nFRAME\n\x0a\x14"[..],
            "found luma and chroma",
        ),
        (b"P5\n2 1\n255\nab", "a grey one"),
        (b"P6\n2 1\n255\nabcdef", "has 1 rows and 2 columns"),
    ] {
        let output = piped(folder.path(), stream, bytes);
        let errors = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{errors}");
        assert!(
            errors.contains(found) && output.stdout.is_empty(),
            "{errors}"
        );
    }
    let press = folder.path().join("examples/data/colour/press_3.png");
    let mut cut = b"P6\n120 90\n255\n".to_vec();
    cut.extend(read_colour_levels(press).unwrap());
    cut.extend(b"P6\n120 90\n255\nabc");
    let output = piped(folder.path(), stream, &cut);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert_eq!(value(&output)["frames"], 1);
}

/// Forces without layer and modulus: the sensor file stores a law from gauge readings, valid for
/// the same ball.
#[test]
fn a_gauge_gives_forces_without_a_layer() {
    let folder = folder_with_examples();
    let data = "examples/data/colour/";
    let mut text = fs::read_to_string(folder.path().join(data).join("calibration.toml")).unwrap();
    text = text.replace("= \"press", &format!("= \"{data}press"));
    text = text.replace("\"reference.png\"", &format!("\"{data}reference.png\""));
    // Contact radii in pixels. The force of a ball is proportional to their cube.
    for (press, radius) in [(1, 16.0_f64), (3, 15.0), (4, 17.0), (5, 17.0)] {
        let force = 0.1 * (radius / 16.0).powi(3);
        text += &format!("\n[[gauge]]\nimage = \"{data}press_{press}.png\"\nforce_N = {force}\n");
    }
    fs::write(folder.path().join("gauge.toml"), text).unwrap();
    printed(folder.path(), "calibrate gauge.toml --out made/gauge.toml");
    let line = format!("measure made/gauge.toml {data}press_6.png --json");
    let found: Value = serde_json::from_str(&printed(folder.path(), &line)).unwrap();
    assert_keeps_to_schema(&found, "measure");
    let part = |name: &str| found["frames"][0]["force_n"][name].as_f64().unwrap();
    let miss = (part("value") - 0.1).abs();
    assert!(
        miss < 0.02 && miss < 3.0 * part("standard_error"),
        "{found}"
    );
}
