//! No content makes a reader panic, errors name the file, and what is written is read back bit for
//! bit. What is asked of a reader is what the fuzz corpus asks of it.

use crate::corpus::readers;
use nalgebra::{Point, Point3};
use proptest::prelude::*;
use std::fmt::Write;
use tactile_imaging::elasticity::curve::{
    CurveOptions, IndentationCurve, Indenter, Model, select_model,
};
use tactile_imaging::force::{
    CalibrationOptions, CalibrationPair, LinearCalibration, StressCalibration,
};
use tactile_imaging::io::{
    Grey, read_cases, read_columns, read_grey_image, read_grid, read_points, write_grey_image,
};
use tactile_imaging::scene::Scene;
use tactile_imaging::tps::ThinPlateSpline;

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

/// One change: what is done, where as a share of the file, and with what.
type Edit = (u8, f64, u8);

/// Few changes, so that most of the file stays valid and doubling keeps it small.
fn edits() -> impl Strategy<Value = Vec<Edit>> {
    prop::collection::vec((0..12_u8, 0.0..1.0, any::<u8>()), 1..6)
}

/// Values and words that a field of a table or scene may wrongly hold.
const FIELDS: [&str; 12] = [
    "",
    "0",
    "-1",
    "nan",
    "inf",
    "1e308",
    "-1e-320",
    "1e999",
    "99999999999999999999",
    "x",
    "\"",
    "[[1]]",
];

fn mutated(valid: &[u8], edits: &[Edit]) -> Vec<u8> {
    let mut bytes = valid.to_vec();
    for &(kind, place, value) in edits {
        let at = (place * bytes.len() as f64) as usize;
        match kind {
            _ if at >= bytes.len() => bytes.push(value),
            0 => bytes[at] = value,
            1 => bytes[at] ^= 1 << (value % 8),
            2 => drop(bytes.remove(at)),
            3 => bytes.insert(at, value),
            4 => bytes.truncate(at),
            5 => bytes.extend_from_within(at..),
            6 => drop(bytes.drain(piece(&bytes, at, b"\n"))),
            7 => {
                let line = bytes[piece(&bytes, at, b"\n")].to_vec();
                bytes.splice(at..at, line);
            }
            _ => {
                let field = FIELDS[usize::from(value) % FIELDS.len()];
                bytes.splice(piece(&bytes, at, b",;= \n"), field.bytes());
            }
        }
    }
    bytes
}

/// The line or field around `at`, without the separators that end it.
fn piece(bytes: &[u8], at: usize, separators: &[u8]) -> std::ops::Range<usize> {
    let ends = |byte: &u8| separators.contains(byte);
    let start = bytes[..at].iter().rposition(ends).map_or(0, |k| k + 1);
    start
        ..bytes[at..]
            .iter()
            .position(ends)
            .map_or(bytes.len(), |k| at + k)
}

const SCENE: &[u8] = br#"
reference = "reference.png"
pixel_size_m = [1e-4, 1e-4]
[calibration]
pairs = "pairs.csv"
[[frames]]
image = "one.png"
force_N = 0.8
[[frames]]
image = "two.pgm"
[object]
shape = "sphere"
radius_m = 0.02
poisson_ratio = 0.5
[waveguide]
layers = [{ refractive_index = 1.41, thickness_m = 0.1, youngs_modulus_pa = 1e7 }]
"#;

const TABLE: &[u8] = b"integrated_pixel_value,force_N\n0,0\n50000,0.5\n100000,1.0\n150000,1.5\n";

const CURVE: &[u8] =
    b"indentation_m,force_N\n0,0\n1e-5,1e-3\n2e-5,3e-3\n3e-5,5e-3\n4e-5,8e-3\n5e-5,1.1e-2\n6e-5,1.4e-2\n7e-5,1.8e-2\n";

const POINTS: &[u8] = b"x,y\n1,2\n3.5,-4e-3\n0,7\n2,2\n5,1\n4,6\n";

const CASES: &[u8] = b"case q 2 4 4\nm 0 0\nm 3 0\nm 3 2\nm 0 1\nt 3 2\nt 0 0\nt 3 0\nt 0 1\n";

/// A small image in the format of the file name's ending.
fn image(name: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let pixels = ndarray::Array2::from_shape_fn((9, 12), |(r, c)| (20 * r + c) as u8);
    write_grey_image(&path, pixels.view()).unwrap();
    std::fs::read(path).unwrap()
}

/// Two columns of a table.
fn columns(bytes: &[u8], [first, second]: [(&str, &str); 2]) -> Option<[Vec<f64>; 2]> {
    let table = file(bytes);
    read_columns(
        table.path(),
        [(&[first.0], first.1), (&[second.0], second.1)],
    )
    .ok()
}

const PAIRS: [(&str, &str); 2] = [("integrated_pixel_value", "grey_levels"), ("force", "N")];
const DEPTHS: [(&str, &str); 2] = [("indentation", "m"), ("force", "N")];

/// A valid file and the check of its readers.
type Valid = (Vec<u8>, fn(&[u8]));

fn valid_files() -> [Valid; 6] {
    [
        (SCENE.to_vec(), readers::toml),
        (POINTS.to_vec(), readers::table),
        (b"1,2,nan\n,5,6\n7,8,-9e9\n".to_vec(), readers::table),
        (CASES.to_vec(), readers::case),
        (image("a.png"), readers::image),
        (image("a.pgm"), readers::image),
    ]
}

proptest! {
    #[test]
    fn no_bytes_panic(bytes in prop_oneof![prop::collection::vec(any::<u8>(), 0..300), tabular()]) {
        for check in [readers::table, readers::case, readers::image, readers::toml] {
            check(&bytes);
        }
    }

    #[test]
    fn broken_images_do_not_panic(
        kind in 0..4usize,
        bytes in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let start: &[u8] = [
            b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".as_slice(),
            b"P5\n9 9\n255\n",
            b"P2 3 3 15 ",
            b"\xff\xd8\xff\xe0\0\x10JFIF\0",
        ][kind];
        readers::image(&[start, &bytes].concat());
    }

    /// Random bytes end at a parser's door; a valid file with a few edits comes further in.
    #[test]
    fn valid_files_with_edits_do_not_panic(edits in edits()) {
        for (valid, check) in valid_files() {
            check(&mutated(&valid, &edits));
        }
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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// A scene whose files are there, one of them damaged, is measured or refused with a sentence.
    #[test]
    fn scenes_with_their_files(edits in edits(), which in 0..5_usize) {
        let folder = tempfile::tempdir().unwrap();
        let names = ["scene.toml", "pairs.csv", "reference.png", "one.png", "two.pgm"];
        for (k, name) in names.iter().enumerate() {
            let valid = match k { 0 => SCENE.to_vec(), 1 => TABLE.to_vec(), _ => image(name) };
            let bytes = if k == which { mutated(&valid, &edits) } else { valid };
            std::fs::write(folder.path().join(name), bytes).unwrap();
        }
        if let Err(error) = Scene::measure_file(folder.path().join("scene.toml")) {
            let name = folder.path().file_name().unwrap().to_string_lossy().into_owned();
            prop_assert!(error.to_string().contains(&name), "{error}");
        }
    }

    /// Tables from files go on into a spline, a calibration and a curve's model, whatever values
    /// they hold; what comes of them has no NaN.
    #[test]
    fn tables_go_into_what_they_are_read_for(edits in edits()) {
        let points = file(&mutated(POINTS, &edits));
        if let Ok(points) = read_points::<2>(points.path()) {
            let targets: Vec<Point<f64, 2>> = points.iter().map(|p| p * 1.01).collect();
            let spline = ThinPlateSpline::<f64, 2>::fit(&points, &targets, &Default::default());
            let _ = spline.map(|spline| spline.apply(&points[0]));
        }
        if let Some([values, forces]) = columns(&mutated(TABLE, &edits), PAIRS) {
            let pair = |(&v, &f): (&f64, &f64)| CalibrationPair::loading(v, f);
            let pairs: Vec<_> = values.iter().zip(&forces).map(pair).collect();
            if let Ok(line) = LinearCalibration::fit(&pairs, &CalibrationOptions::default()) {
                prop_assert!(!line.force_n(line.range()[0]).is_nan());
            }
        }
        if let Some([depths, forces]) = columns(&mutated(CURVE, &edits), DEPTHS)
            && let Ok(curve) = IndentationCurve::new(&depths, &forces)
        {
            let (punch, options) = (Indenter::Punch { radius_m: 1e-3 }, CurveOptions::default());
            if let Ok(found) = select_model(&curve, &punch, 0.5, Model::Auto, &options) {
                prop_assert!(!found.chosen().youngs_modulus_pa.is_nan());
            }
        }
    }
}

#[test]
fn the_unchanged_files_are_read() {
    assert!(Scene::parse(std::str::from_utf8(SCENE).unwrap(), "scene.toml").is_ok());
    assert_eq!(read_points::<2>(file(POINTS).path()).unwrap().len(), 6);
    assert_eq!(read_cases(file(CASES).path()).unwrap().len(), 1);
    let [depths, forces] = columns(CURVE, DEPTHS).unwrap();
    assert!(IndentationCurve::new(&depths, &forces).is_ok());
    for name in ["a.png", "a.pgm"] {
        assert!(read_grey_image(file(&image(name)).path(), Grey::default(), None).is_ok());
    }
    assert_eq!(columns(TABLE, PAIRS).unwrap()[0][3], 150_000.0);
}
