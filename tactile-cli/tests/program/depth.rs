//! Depth from a table: the conversion to grey, and the zero of the depths.
use super::harness::{run, value, words};
use super::json::assert_keeps_to_schema;
use std::fs;

/// A frame of 40 × 40 pixels with grey level 200. A square of 20 × 20 pixels in the middle is
/// darker by this amount in blue.
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
    // A grey level corresponds to 30 µm, starting at a darkness of three levels.
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
        1e3 * value["frames"][0]["contact"]["depth_below_far_m"]["value"]
            .as_f64()
            .unwrap()
    };
    // 90 levels of blue give 30 levels of the mean, 0.114 · 90 = 10.3 of Rec. 601 and 0.0722 · 90 =
    // 6.5 of Rec. 709. Frames of eight bits have 10 and 6.
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
    // The row 0, 0 states that zero darkness means zero depth.
    for (options, expected) in [("--grey mean", 0.81), ("--grey mean --zero-table", 0.90)] {
        let found = depth_mm("from_flat.csv", options);
        assert!((found - expected).abs() < 1e-9, "{options}: {found}");
    }
}

/// A saddle beside a dome: slopes with a wrong sign, or exchanged, cannot belong to a surface.
#[test]
fn slopes_of_no_surface_are_named_and_normal_maps_integrated() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, columns) = (40, 50);
    let slope = |row: usize, column: usize| {
        let (x, y) = (column as f64 / 10.0 - 2.0, row as f64 / 10.0 - 2.0);
        [
            0.2 * (x + 0.3 * y + y.cos() * x.cos()),
            0.2 * (0.3 * x - y.sin() * x.sin()),
        ]
    };
    let table = |axis: usize, sign: f64| {
        let line = |row| {
            (0..columns)
                .map(|c| (sign * slope(row, c)[axis]).to_string())
                .collect::<Vec<_>>()
        };
        (0..rows)
            .map(|row| line(row).join(",") + "\n")
            .collect::<String>()
    };
    for (name, axis, sign) in [("p", 0, 1.0), ("q", 1, 1.0), ("up", 1, -1.0)] {
        std::fs::write(folder.path().join(format!("{name}.csv")), table(axis, sign)).unwrap();
    }
    for (call, kinds, words) in [
        ("p.csv q.csv", 0, ""),
        ("p.csv up.csv", 1, "the sign of Q changed"),
        ("q.csv p.csv", 1, "P and Q exchanged"),
    ] {
        let value = value(&run(folder.path(), &words_of(call)));
        let cautions = value["cautions"].as_array().unwrap();
        assert_eq!(cautions.len(), kinds, "{call}");
        let found = cautions
            .first()
            .map_or(String::new(), |caution| caution["text"].to_string());
        assert!(found.contains(words), "{found}");
    }
    // The same surface as a normal map of 16 bits, with y upwards and a margin without normals.
    let mut map = format!("P6\n{columns} {rows}\n65535\n").into_bytes();
    for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
        let [p, q] = slope(row, column);
        let normal = [-p, q, 1.0].map(|n| n / (1.0 + p * p + q * q).sqrt());
        let samples = normal.map(|n| ((n + 1.0) / 2.0 * 65535.0).round() as u16);
        let inside = column > 2;
        map.extend(
            samples
                .iter()
                .flat_map(|s| (s * u16::from(inside)).to_be_bytes()),
        );
    }
    std::fs::write(folder.path().join("normals.ppm"), map).unwrap();
    let value = value(&run(folder.path(), &words_of("normals.ppm")));
    assert_eq!(
        (&value["cautions"][0]["y"], &value["solved"]),
        (&"up".into(), &(40 * 47).into())
    );
    assert!(value["slope_rms"].as_f64().unwrap() < 0.01, "{value}");
}

fn words_of(call: &str) -> Vec<&str> {
    ["integrate", "--json"]
        .into_iter()
        .chain(words(call))
        .collect()
}
