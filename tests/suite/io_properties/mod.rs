//! No content makes a reader panic, and what is written is read back bit for bit.
use nalgebra::Point3;
use proptest::prelude::*;
use tactile_imaging::io::{
    cases::parse_cases, grid::parse_grid, image::parse_grey_image, points::parse_points,
};
use tactile_imaging::io::{read_grid, read_points, write_grid, write_points};
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

proptest! {
    #[test]
    fn no_bytes_panic(bytes in prop_oneof![prop::collection::vec(any::<u8>(), 0..300), tabular()]) {
        let _ = parse_points::<2>(&bytes, "a");
        let _ = parse_points::<3>(&bytes, "a");
        let _ = parse_grid(&bytes, "a");
        let _ = parse_cases(&bytes, "a");
        let _ = parse_grey_image(&bytes, "a");
        let _ = Scene::parse(&String::from_utf8_lossy(&bytes), "a");
    }

    #[test]
    fn broken_images_do_not_panic(kind in 0..4usize, bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let start: &[u8] = [b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".as_slice(), b"P5\n9 9\n255\n", b"P2 3 3 15 ", b"\xff\xd8\xff\xe0\0\x10JFIF\0"][kind];
        let _ = parse_grey_image(&[start, &bytes].concat(), "a");
    }

    #[test]
    fn points_and_grids_come_back(values in prop::collection::vec(prop::array::uniform3(-1e300..1e300f64), 1..20)) {
        let folder = tempfile::tempdir().unwrap();
        let points: Vec<Point3<f64>> = values.iter().map(|&v| v.into()).collect();
        let path = folder.path().join("points.csv");
        write_points(&path, &["x", "y", "z"], &points).unwrap();
        prop_assert_eq!(read_points::<3>(&path).unwrap(), points);
        let grid = ndarray::Array2::from_shape_fn((values.len(), 3), |(r, c)| values[r][c]);
        write_grid(&path, grid.view()).unwrap();
        prop_assert_eq!(read_grid(&path).unwrap(), grid);
    }
}
