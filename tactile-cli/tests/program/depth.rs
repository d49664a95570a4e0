//! Depth from a table: the grey that it is entered with, and where its depths are counted from.
use super::harness::{run, value, words};
use super::json::assert_keeps_to_schema;
use std::fs;

/// A frame of 40 × 40 pixels of grey 200, a stamp of 20 × 20 in the middle darker by this much in
/// blue.
fn frame(blue: u8) -> Vec<u8> {
    let mut bytes = b"P6\n40 40\n255\n".to_vec();
    for at in 0..1600 {
        let stamped = [at / 40, at % 40].iter().all(|k| (10..30).contains(k));
        bytes.extend([200, 200, if stamped { 200 - blue } else { 200 }]);
    }
    bytes
}

#[test]
fn the_grey_and_the_zero_are_those_of_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    put("reference.ppm", &frame(0));
    put("pressed.ppm", &frame(90));
    // A level is 30 µm deep, counted from where three levels were seen.
    let rows = (3..60).map(|s| format!("{s},{}\n", 0.03 * f64::from(s - 3)));
    let table = format!("darkness,depth_mm\n{}", rows.collect::<String>());
    put("table.csv", table.as_bytes());
    let from_flat = table.replace("depth_mm\n", "depth_mm\n0,0\n");
    put("from_flat.csv", from_flat.as_bytes());
    let depth_mm = |table: &str, options: &str| {
        let call = format!(
            "depth --reference reference.ppm --table {table} --pixel-um 100 pressed.ppm --json \
             {options}"
        );
        let output = run(folder.path(), &words(&call));
        let value = value(&output);
        assert_keeps_to_schema(&value, &call);
        1e3 * value["frames"][0]["contact"]["surface"]["largest_depth_m"]
            .as_f64()
            .unwrap()
    };
    // 90 levels of blue are 30 of the mean, 0.114 · 90 = 10.3 of Rec. 601 and 0.0722 · 90 = 6.5 of
    // Rec. 709, of which frames of eight bits have 10 and 6.
    for (options, expected) in [
        ("", 0.30),
        ("--grey rec601", 0.30),
        ("--grey rec709", 0.18),
        ("--grey mean", 0.90),
        ("--grey mean --zero-table", 0.90),
    ] {
        let found = depth_mm("table.csv", options);
        assert!((found - expected).abs() < 1e-9, "{options}: {found}");
    }
    // The row 0, 0 states that depth was counted from no darkness.
    for (options, expected) in [("--grey mean", 0.81), ("--grey mean --zero-table", 0.90)] {
        let found = depth_mm("from_flat.csv", options);
        assert!((found - expected).abs() < 1e-9, "{options}: {found}");
    }
}
