//! No reader and no use of its numbers panics on files with a few wrong bytes. Written files are
//! read back bit for bit.

use crate::corpus::{READERS, inputs};
use crate::scene_files::{VALID, small_scene};
use nalgebra::{Point, Point3};
use proptest::prelude::*;
use std::fmt::Write;
use tactile_files::io::{read_columns, read_grid, read_points};
use tactile_files::scene::Scene;
use tactile_imaging::force::{CalibrationPair, LinearCalibration, StressCalibration};
use tactile_imaging::tps::ThinPlateSpline;

/// A file with the given content.
fn file(bytes: &[u8]) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    file
}

/// One edit: the operation, the position as a fraction of the file, and the value.
type Edit = (u8, f64, u8);

/// Few edits, so that most of the file remains valid and duplication keeps it small.
fn edits() -> impl Strategy<Value = Vec<Edit>> {
    prop::collection::vec((0..12_u8, 0.0..1.0, any::<u8>()), 1..6)
}

/// Wrong values and words for a field of a table or scene.
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

/// The line or field around `at`, without the trailing separators.
fn piece(bytes: &[u8], at: usize, separators: &[u8]) -> std::ops::Range<usize> {
    let ends = |byte: &u8| separators.contains(byte);
    let start = bytes[..at].iter().rposition(ends).map_or(0, |k| k + 1);
    start
        ..bytes[at..]
            .iter()
            .position(ends)
            .map_or(bytes.len(), |k| at + k)
}

const POINTS: &[u8] = b"x,y\n1,2\n3.5,-4e-3\n0,7\n2,2\n5,1\n4,6\n";

const PAIRS: &[u8] = b"value,force_N\n0,0\n50000,0.5\n100000,1.0\n150000,1.5\n";

/// Two columns of a table.
fn columns(bytes: &[u8], [first, second]: [(&str, &str); 2]) -> Option<[Vec<f64>; 2]> {
    let wanted: [(&[&str], &str); 2] = [(&[first.0], first.1), (&[second.0], second.1)];
    read_columns(file(bytes).path(), wanted).ok()
}

/// The results of a spline and a calibration, each from a table with these edits.
fn uses_of_tables(edits: &[Edit]) -> [Option<f64>; 2] {
    let spline = || {
        let sources = read_points::<2>(file(&mutated(POINTS, edits)).path()).ok()?;
        let targets: Vec<Point<f64, 2>> = sources.iter().map(|p| p * 1.01).collect();
        let spline = ThinPlateSpline::<2>::fit(&sources, &targets, &Default::default());
        Some(spline.ok()?.apply(&sources[0]).x)
    };
    let line = || {
        let wanted = [("value", "grey_levels"), ("force", "N")];
        let [values, forces] = columns(&mutated(PAIRS, edits), wanted)?;
        let pair = |(&v, &f): (&f64, &f64)| CalibrationPair::loading(v, f);
        let pairs: Vec<_> = values.iter().zip(&forces).map(pair).collect();
        let line = LinearCalibration::fit(&pairs).ok()?;
        Some(line.force_n(line.range()[0]))
    };
    [spline(), line()]
}

proptest! {
    /// Random bytes fail at the start of a parser. A kept input with a few edits reaches its later
    /// stages.
    #[test]
    fn inputs_with_edits_end_as_they_should(edits in edits(), which in 0.0..1.0) {
        for (folder, check) in READERS {
            let inputs = inputs(folder);
            let (_, input) = &inputs[(which * inputs.len() as f64) as usize];
            check(&mutated(input, &edits));
        }
    }

    #[test]
    fn points_and_grids_come_back(
        values in prop::collection::vec(prop::array::uniform3(-1e300..1e300f64), 1..20)
    ) {
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

    /// A scene with existing files, one of them damaged, is measured or refused with a sentence.
    #[test]
    fn scenes_with_their_files(edits in edits(), which in 0..5_usize) {
        let folder = tempfile::tempdir().unwrap();
        small_scene(folder.path());
        let scene = folder.path().join("scene.toml");
        std::fs::write(&scene, VALID).unwrap();
        let names = ["scene.toml", "pairs.csv", "reference.png", "one.png", "two.pgm"];
        let damaged = folder.path().join(names[which]);
        std::fs::write(&damaged, mutated(&std::fs::read(&damaged).unwrap(), &edits)).unwrap();
        if let Err(error) = Scene::measure_file(scene) {
            let name = folder.path().file_name().unwrap().to_string_lossy().into_owned();
            prop_assert!(error.to_string().contains(&name), "{error}");
        }
    }

    /// For any values in tables, no result is NaN.
    #[test]
    fn tables_go_into_what_they_are_read_for(edits in edits()) {
        prop_assert!(uses_of_tables(&[]).iter().all(Option::is_some));
        prop_assert!(uses_of_tables(&edits).iter().flatten().all(|v| !v.is_nan()));
    }
}

#[test]
fn the_guide_lists_every_format_of_frames() {
    let guide = include_str!("../../docs/cameras.md");
    for format in tactile_files::io::frame_formats().split(", ") {
        assert!(guide.contains(format), "{format}");
    }
}
