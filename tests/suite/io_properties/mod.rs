//! No content makes a reader panic, and what is written is read back bit for bit.
use nalgebra::Point3;
use proptest::prelude::*;
use std::fmt::Write;
use tactile_imaging::io::{Grey, read_cases, read_grey_image, read_grid, read_points};
use tactile_imaging::scene::Scene;

mod mutated;

/// Text that looks like a table often enough to reach the depths of the parsers.
fn tabular() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        Just(",".to_owned()),
        Just(";".into()),
        Just("\n".into()),
        Just("\r\n".into()),
        Just("#".into()),
        Just("\"".into()),
        Just("nan".into()),
        Just("-inf".into()),
        Just("case a 2 1 1\n".into()),
        Just("m ".into()),
        Just("t ".into()),
        Just(" ".into()),
        any::<f64>().prop_map(|v| v.to_string()),
        any::<i32>().prop_map(|v| v.to_string()),
        "[a-z]{1,4}",
    ];
    prop::collection::vec(piece, 0..40).prop_map(|pieces| pieces.concat().into_bytes())
}

/// A file with this content.
fn file(bytes: &[u8]) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    file
}

proptest! {
    #[test]
    fn no_bytes_panic(bytes in prop_oneof![prop::collection::vec(any::<u8>(), 0..300), tabular()]) {
        let file = file(&bytes);
        let _ = read_points::<2>(file.path());
        let _ = read_points::<3>(file.path());
        let _ = read_grid(file.path());
        let _ = read_cases(file.path());
        let _ = read_grey_image(file.path(), Grey::default(), None);
        let _ = Scene::parse(&String::from_utf8_lossy(&bytes), "a");
    }

    #[test]
    fn broken_images_do_not_panic(kind in 0..4usize, bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let start: &[u8] = [b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".as_slice(), b"P5\n9 9\n255\n", b"P2 3 3 15 ", b"\xff\xd8\xff\xe0\0\x10JFIF\0"][kind];
        let file = file(&[start, &bytes].concat());
        let _ = read_grey_image(file.path(), Grey::default(), None);
    }

    #[test]
    fn points_and_grids_come_back(values in prop::collection::vec(prop::array::uniform3(-1e300..1e300f64), 1..20)) {
        let rows = values.iter().fold(String::new(), |mut rows, [x, y, z]| {
            writeln!(rows, "{x:?},{y:?},{z:?}").unwrap();
            rows
        });
        let points: Vec<Point3<f64>> = values.iter().map(|&v| v.into()).collect();
        let with_header = file(format!("x,y,z\n{rows}").as_bytes());
        prop_assert_eq!(read_points::<3>(with_header.path()).unwrap(), points);
        let grid = ndarray::Array2::from_shape_fn((values.len(), 3), |(r, c)| values[r][c]);
        prop_assert_eq!(read_grid(file(rows.as_bytes()).path()).unwrap(), grid);
    }
}
