//! Results that cannot be written, and readers that close the pipe.
use super::harness::{folder_with_examples, printed, run, tactile, text, value, words};
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

const STRAIN: &str = "strain examples/data/before.csv examples/data/after.csv";

#[test]
fn a_reader_that_goes_away_ends_the_printing_and_not_the_program() {
    for example in [
        "light --rays 100 --out results",
        "strain examples/data/before.csv examples/data/after.csv --out results",
        "match examples/data/cases.txt --out results",
        "--help",
        "strain --help",
    ] {
        let folder = folder_with_examples();
        let mut child = tactile(folder.path(), &words(example))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let errors = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "tactile {example}: {errors}");
        assert!(errors.is_empty(), "tactile {example}: {errors}");
        if example.contains("--out") {
            let written = fs::read_dir(folder.path().join("results")).unwrap().count();
            assert!(written > 0, "tactile {example} wrote nothing");
        }
    }
}

#[test]
fn a_full_disk_is_a_sentence() {
    let folder = folder_with_examples();
    let full = || File::options().write(true).open("/dev/full").unwrap();
    for example in ["light --rays 100", STRAIN, &format!("{STRAIN} --json")] {
        let output = tactile(folder.path(), &words(example))
            .stdout(Stdio::from(full()))
            .output()
            .unwrap();
        let errors = text(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "tactile {example}: {errors}");
        assert!(
            errors.starts_with("tactile: cannot write to standard output: "),
            "{errors}"
        );
        assert_eq!(errors.lines().count(), 1, "{errors}");
    }
}

/// The bytes of every file in a folder.
fn files(folder: &Path) -> BTreeMap<OsString, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries
        .map(|entry| (entry.file_name(), fs::read(entry.path()).unwrap()))
        .collect()
}

#[test]
fn what_ends_the_program_leaves_earlier_results_whole() {
    let folder = folder_with_examples();
    let call = format!("{STRAIN} --out results");
    printed(folder.path(), &call);
    let results = folder.path().join("results");
    let before = files(&results);
    // The system ends a program at this file size limit, in blocks of 512 or 1024 bytes. Every
    // result is larger.
    let program = env!("CARGO_BIN_EXE_tactile");
    let limited = format!("ulimit -f 1; exec {program} {call}");
    let ended = Command::new("sh")
        .args(["-c", &limited])
        .current_dir(folder.path())
        .output();
    assert!(!ended.unwrap().status.success());
    assert!(
        files(&results) == before,
        "after a limit of the file's size"
    );
    // The program is killed at several instants of a run of a fraction of a second.
    for milliseconds in (0..120).step_by(8) {
        let quiet = || Stdio::null();
        let child = tactile(folder.path(), &words(&call))
            .stdout(quiet())
            .stderr(quiet())
            .spawn();
        let mut child = child.unwrap();
        std::thread::sleep(Duration::from_millis(milliseconds));
        child.kill().unwrap();
        child.wait().unwrap();
        // The same call writes the same files. Each must exist, and no other file may remain except
        // a complete one that was about to replace an old one.
        let mut after = files(&results);
        after.retain(|name, bytes| {
            let is_whole = before.values().any(|whole| whole == bytes);
            let is_waiting = is_whole && name.to_string_lossy().ends_with(".part");
            if is_waiting {
                fs::remove_file(results.join(name)).unwrap();
            }
            !is_waiting
        });
        assert!(after == before, "after {milliseconds} ms");
    }
}

#[test]
fn a_stage_without_an_answer_does_not_hide_the_others() {
    let folder = tempfile::tempdir().unwrap();
    // Three points do not determine the error of an affine field.
    let rows = "0,0\n1,0\n0,1\n";
    fs::write(folder.path().join("few.csv"), rows).unwrap();
    let output = run(
        folder.path(),
        &words("strain few.csv few.csv --json --out results"),
    );
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    let value = value(&output);
    assert_eq!(value["match"]["pairs"], 3);
    assert!(
        value["strain"]["error"]
            .as_str()
            .unwrap()
            .contains("too few")
    );
    assert!(folder.path().join("results/pairs.csv").exists());
}

#[test]
fn tables_of_a_strain_name_units_and_whole_rows() {
    let folder = tempfile::tempdir().unwrap();
    let grid = |stretch: f64| -> String {
        (0..36)
            .map(|k| format!("{},{}\n", stretch * f64::from(k % 6), k / 6))
            .collect()
    };
    for (heading, suffix) in [("x_mm,y_mm", "_m"), ("x,y", "")] {
        for (name, stretch) in [("before.csv", 1.0), ("after.csv", 1.02)] {
            let table = format!("{heading}\n{}", grid(stretch));
            fs::write(folder.path().join(name), table).unwrap();
        }
        printed(folder.path(), "strain before.csv after.csv --out results");
        let read = |name: &str| fs::read_to_string(folder.path().join("results").join(name));
        let (pairs, strains) = (read("pairs.csv").unwrap(), read("strain.csv").unwrap());
        assert!(
            pairs.starts_with(&format!("row_before,row_after,x{suffix},y{suffix},")),
            "{pairs}"
        );
        assert!(pairs.lines().nth(2).unwrap().starts_with("1,1,"), "{pairs}");
        assert!(
            strains.starts_with(&format!("row_before,x{suffix},y{suffix},e_xx,")),
            "{strains}"
        );
    }
}

/// A deformation that no matcher can solve, as two files and as displacements, with a gap.
#[test]
fn known_pairs_are_not_matched() {
    let folder = tempfile::tempdir().unwrap();
    let [mut before, mut after, mut both] = ["x,y\n", "x,y\n", "x,y,u,v\n"].map(str::to_owned);
    for k in 0..36 {
        let (x, y) = (f64::from(k % 6), f64::from(k / 6));
        // The points are stretched by half and shifted beyond all neighbours.
        let u = 0.5 * x + 100.0;
        let image = if k == 7 {
            "nan".into()
        } else {
            (x + u).to_string()
        };
        before += &format!("{x},{y}\n");
        after += &format!("{image},{y}\n");
        let u = if k == 7 { String::new() } else { u.to_string() };
        both += &format!("{x},{y},{u},0\n");
    }
    for (name, text) in [
        ("before.csv", before),
        ("after.csv", after),
        ("both.csv", both),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    for call in ["strain --paired before.csv after.csv", "strain both.csv"] {
        let call = format!("{call} --grid 1 --out results --json");
        let value = value(&run(folder.path(), &words(&call)));
        let mean = value["strain"]["components"]["e_xx"]["value"]
            .as_f64()
            .unwrap();
        // The strain is ½ (1.5² − 1), with exact coordinates.
        assert!((mean - 0.625).abs() < 1e-6, "{value}");
        assert_eq!(value["match"]["pairs"], 35);
        assert_eq!(value["cautions"][0]["kind"], "skipped_rows", "{value}");
        let table = fs::read_to_string(folder.path().join("results/pairs.csv")).unwrap();
        assert!(table.lines().nth(8).unwrap().starts_with("8,8,"), "{table}");
        // A stretch by half along x: there is no rotation, and areas grow by half.
        let medians = &value["strain"]["medians"];
        let near = |name: &str, expected: f64| {
            let found = medians[name]["value"].as_f64().unwrap();
            assert!((found - expected).abs() < 1e-6, "{name}: {medians}");
        };
        near("rotation_rad", 0.0);
        near("area_ratio", 1.5);
        near("e_1", 0.625);
        near("e_von_mises", 0.625 * 2.0 / 3.0);
        for name in ["strain.csv", "grid.csv"] {
            let table = fs::read_to_string(folder.path().join("results").join(name)).unwrap();
            let columns = |line: &str| line.split(',').count();
            let mut lines = table.lines();
            let header = lines.next().unwrap();
            assert!(header.contains(",dux_dx,") && header.ends_with(",se_n1_rad,se_n2_rad"));
            assert!(
                lines.all(|line| columns(line) == columns(header)),
                "{table}"
            );
        }
        fs::remove_dir_all(folder.path().join("results")).unwrap();
    }
    let few = "x,y\n0,0\n";
    fs::write(folder.path().join("few.csv"), few).unwrap();
    let output = run(folder.path(), &words("strain --paired before.csv few.csv"));
    assert!(
        text(&output.stderr).contains("36 rows"),
        "{}",
        text(&output.stderr)
    );
}

/// Three or more files are followed: tracks, strain of every step and relative to the first frame.
#[test]
fn frames_of_a_series_give_tracks_and_strains() {
    let folder = tempfile::tempdir().unwrap();
    for frame in 0..4 {
        let stretch = 1.0 + 0.05 * f64::from(frame);
        let row = |k: i32| {
            let x = f64::from(k % 7) + 0.05 * f64::from(k * k % 11);
            format!("{},{}\n", stretch * x, k / 7)
        };
        // One point is missing in one frame.
        let seen = (0..49).filter(|&k| frame != 2 || k != 20);
        let rows: String = seen.map(row).collect();
        fs::write(folder.path().join(format!("{frame}.csv")), rows).unwrap();
    }
    // Empty frames of a tracker keep their numbers, both in files and in one table.
    let put = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    put("none.csv", "x,y\n");
    put("gap.csv", "nan,nan\n");
    let frames = [Some("0.csv"), None, Some("1.csv"), Some("3.csv")];
    let mut tracks = "frame,x,y\n".to_owned();
    for (number, frame) in frames.iter().enumerate() {
        let rows = fs::read_to_string(folder.path().join(frame.unwrap_or("gap.csv"))).unwrap();
        rows.lines()
            .for_each(|row| tracks += &format!("{number},{row}\n"));
    }
    put("tracks.csv", &tracks);
    for call in ["strain 0.csv none.csv 1.csv 3.csv", "strain tracks.csv"] {
        let output = run(folder.path(), &words(&format!("{call} --json")));
        assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
        let value: Value = serde_json::from_slice(&output.stdout).unwrap();
        let caution = value["cautions"].as_array().unwrap().last().unwrap();
        assert_eq!(
            (&caution["kind"], &caution["frames"]),
            (&"frames_empty".into(), &1.into())
        );
        assert_eq!(value["frames"][1]["frame"], 4);
        let found = &value["frames"][1]["total"]["components"]["e_xx"]["value"];
        assert!((found.as_f64().unwrap() - 0.5 * (1.15 * 1.15 - 1.0)).abs() < 1e-6);
    }
    let call = "strain 0.csv 1.csv 2.csv 3.csv --json --out results";
    let value: Value = serde_json::from_str(&printed(folder.path(), call)).unwrap();
    for (frame, stretch) in [(1, 1.05), (2, 1.1), (3, 1.15_f64)] {
        let found = &value["frames"][frame - 1];
        let mean = |part: &str| found[part]["components"]["e_xx"]["value"].as_f64().unwrap();
        let step: f64 = stretch / (stretch - 0.05);
        // The positions are exact within rounding, and a spline reproduces a homogeneous stretch.
        assert!(
            (mean("total") - 0.5 * (stretch * stretch - 1.0)).abs() < 1e-6,
            "{found}"
        );
        assert!(
            (mean("step") - 0.5 * (step * step - 1.0)).abs() < 1e-6,
            "{found}"
        );
    }
    let read = |name: &str| fs::read_to_string(folder.path().join("results").join(name)).unwrap();
    assert!(read("tracks.csv").starts_with("track,frame,row,x,y\n0,1,0,"));
    // The track of the missing point continues.
    let track = read("tracks.csv")
        .lines()
        .filter(|l| l.starts_with("20,"))
        .count();
    assert_eq!(track, 3);
    assert_eq!(read("tracks.csv").lines().count(), 4 * 49);
    assert!(read("series.csv").starts_with("frame,pairs_step,e_xx_step,"));
    assert_eq!(read("series.csv").lines().count(), 4);
}
