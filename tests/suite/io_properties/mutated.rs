//! Valid files with bytes, fields or lines changed, dropped, doubled or cut: every reader gives an
//! answer or an error that names the file, none panics; nor does what the values are given to.
//!
//! Random bytes alone end at a parser's door; a valid file with a few edits comes further in.

use nalgebra::Point;
use proptest::prelude::*;
use std::path::Path;
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

/// The answer, if there is one; an error must name the file.
fn answer<T, E: std::fmt::Display>(result: Result<T, E>, file: &str) -> Option<T> {
    result
        .map_err(|error| assert!(error.to_string().contains(file), "{error}"))
        .ok()
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

/// What a reader says of a file with these bytes; an error must name the file.
fn read<T, E: std::fmt::Display>(
    bytes: &[u8],
    name: &str,
    reader: impl FnOnce(&Path) -> Result<T, E>,
) -> Option<T> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    answer(reader(&path), name)
}

/// Two columns of a table.
fn columns(bytes: &[u8], [first, second]: [(&str, &str); 2]) -> Option<[Vec<f64>; 2]> {
    read(bytes, "table.csv", |path| {
        read_columns(path, [(&[first.0], first.1), (&[second.0], second.1)])
    })
}

const PAIRS: [(&str, &str); 2] = [("integrated_pixel_value", "grey_levels"), ("force", "N")];
const DEPTHS: [(&str, &str); 2] = [("indentation", "m"), ("force", "N")];

proptest! {
    #[test]
    fn scenes(edits in edits()) {
        let text = String::from_utf8_lossy(&mutated(SCENE, &edits)).into_owned();
        answer(Scene::parse(&text, "scene.toml"), "scene.toml");
    }

    /// The readable ones go on into a spline, whatever values their points have.
    #[test]
    fn points(edits in edits()) {
        read(&mutated(POINTS, &edits), "a.csv", |path| read_points::<3>(path));
        let Some(points) = read(&mutated(POINTS, &edits), "a.csv", |path| read_points::<2>(path)) else { return Ok(()) };
        let targets: Vec<Point<f64, 2>> = points.iter().map(|p| p * 1.01).collect();
        if let Ok(spline) = ThinPlateSpline::<f64, 2>::fit(&points, &targets, &Default::default()) {
            let _ = spline.apply(&points[0]);
        }
    }

    #[test]
    fn grids_and_cases(edits in edits()) {
        read(&mutated(b"1,2,nan\n,5,6\n7,8,-9e9\n", &edits), "grid.csv", |path| read_grid(path));
        read(&mutated(CASES, &edits), "cases.txt", |path| read_cases(path));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn images(edits in edits()) {
        for name in ["a.png", "a.pgm"] {
            read(&mutated(&image(name), &edits), name, |path| read_grey_image(path, Grey::default(), None));
        }
    }

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
        let measured = Scene::measure_file(folder.path().join("scene.toml"));
        answer(measured, &folder.path().file_name().unwrap().to_string_lossy());
    }

    /// A table from a file goes into a calibration, which gives no NaN within its range.
    #[test]
    fn calibration_tables(edits in edits()) {
        let Some([values, forces]) = columns(&mutated(TABLE, &edits), PAIRS) else { return Ok(()) };
        let pairs: Vec<_> = values.iter().zip(&forces).map(|(&v, &f)| CalibrationPair::loading(v, f)).collect();
        if let Ok(line) = LinearCalibration::fit(&pairs, &CalibrationOptions::default()) {
            prop_assert!(!line.force_n(line.range()[0]).is_nan());
        }
    }

    #[test]
    fn indentation_curves(edits in edits()) {
        let Some([depths, forces]) = columns(&mutated(CURVE, &edits), DEPTHS) else { return Ok(()) };
        let Ok(curve) = IndentationCurve::new(&depths, &forces) else { return Ok(()) };
        let punch = Indenter::Punch { radius_m: 1e-3 };
        if let Ok(selection) = select_model(&curve, &punch, 0.5, Model::Auto, &CurveOptions::default()) {
            prop_assert!(!selection.chosen().youngs_modulus_pa.is_nan());
        }
    }
}

#[test]
fn the_unchanged_files_are_read() {
    assert!(Scene::parse(std::str::from_utf8(SCENE).unwrap(), "scene.toml").is_ok());
    let points = read(POINTS, "a", |path| read_points::<2>(path));
    assert_eq!(points.unwrap().len(), 6);
    assert_eq!(read(CASES, "a", |path| read_cases(path)).unwrap().len(), 1);
    let [depths, forces] = columns(CURVE, DEPTHS).unwrap();
    assert!(IndentationCurve::new(&depths, &forces).is_ok());
    let image = read(&image("a.png"), "a", |path| {
        read_grey_image(path, Grey::default(), None)
    });
    assert!(image.is_some());
    assert_eq!(columns(TABLE, PAIRS).unwrap()[0][3], 150_000.0);
}
