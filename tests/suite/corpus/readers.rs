//! Requirements of every reader for any bytes: a result within its documented range, or an error of
//! one sentence that names the file.
//!
//! Used by the replay of the kept corpus and by the fuzz targets in `fuzz/`.

use ndarray::{Array, Dimension};
use std::fmt::Display;
use std::path::{Path, PathBuf};
use tactile_files::io::{
    CasePoints, FileError, FrameReader, Grey, read_cases, read_columns, read_grey_image, read_grid,
    read_points,
};
use tactile_files::scene::{Scene, read_contact_table};
use tactile_files::sensor::{Sensor, SensorCalibration};
use tactile_imaging::pipeline::FrameSource;

/// A CSV file, read by every reader of CSV files.
pub(crate) fn table(bytes: &[u8]) {
    let file = Scratch::new("table.csv", bytes);
    let finite = |values: &[f64]| assert!(values.iter().all(|v| v.is_finite()), "{values:?}");
    for point in answer(bytes, read_points::<2>(&file.path)).unwrap_or_default() {
        finite(point.coords.as_slice());
    }
    for point in answer(bytes, read_points::<3>(&file.path)).unwrap_or_default() {
        finite(point.coords.as_slice());
    }
    if let Some(grid) = answer(bytes, read_grid(&file.path)) {
        assert!(!grid.is_empty() && grid.iter().all(|v| !v.is_infinite()));
    }
    for (names, unit) in [
        (["x", "indentation"], "m"),
        (["force", "f"], "N"),
        (["pressure", "p"], "Pa"),
        (["time", "t"], "s"),
        (["y", "value"], "1"),
    ] {
        if let Some([values]) = answer(bytes, read_columns(&file.path, [(&names, unit)])) {
            finite(&values);
        }
    }
}

/// A file of matching cases.
pub(crate) fn case(bytes: &[u8]) {
    let file = Scratch::new("cases.txt", bytes);
    for case in answer(bytes, read_cases(&file.path)).unwrap_or_default() {
        let finite = match &case.points {
            CasePoints::Plane { model, target } => {
                let mut points = model.iter().chain(target);
                points.all(|p| p.iter().all(|c| c.is_finite()))
            }
            CasePoints::Space { model, target } => {
                let mut points = model.iter().chain(target);
                points.all(|p| p.iter().all(|c| c.is_finite()))
            }
        };
        assert!(finite && !case.name.is_empty(), "{case:?}");
    }
}

/// An image file, with and without the number of bits of its camera.
pub(crate) fn image(bytes: &[u8]) {
    let file = Scratch::new("image.png", bytes);
    for bits in [None, Some(1), Some(12), Some(16)] {
        let Some(image) = answer(bytes, read_grey_image(&file.path, Grey::default(), bits)) else {
            continue;
        };
        let grey = |level: &f64| (0.0..=255.0).contains(level);
        assert!(image.levels.iter().all(grey) && [8, 16].contains(&image.bits));
        assert_eq!(image.to_u8().dim(), image.levels.dim());
    }
}

/// A stream of frames, of which the first hundred are read, grey and in colours.
pub(crate) fn stream(bytes: &[u8]) {
    frames(bytes, |reader, frame| reader.next_frame(frame));
    frames(bytes, |reader, frame| reader.next_colour_frame(frame));
}

fn frames<D: Dimension>(
    bytes: &[u8],
    next: impl Fn(&mut FrameReader, &mut Array<u8, D>) -> Result<Option<f64>, FileError>,
) {
    let input = std::io::Cursor::new(bytes.to_vec());
    let Some(mut reader) = answer(bytes, FrameReader::new(input, "stream.y4m", 80.0)) else {
        return;
    };
    let (mut frame, mut size) = (Array::default(D::default()), None);
    for _ in 0..100 {
        match answer(bytes, next(&mut reader, &mut frame)) {
            Some(Some(time_s)) => assert!(time_s.is_finite() && !frame.is_empty()),
            _ => break,
        }
        assert_eq!(*size.get_or_insert(frame.raw_dim()), frame.raw_dim());
    }
}

/// A TOML file, read as a scene, a sensor, the presses of a calibration and a table of contacts.
pub(crate) fn toml(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    answer(bytes, Scene::parse(&text, "file.toml"));
    let file = Scratch::new("file.toml", bytes);
    if let Some(sensor) = answer(bytes, Sensor::read(&file.path)) {
        let again = Scratch::new("file.toml", b"");
        sensor.write(&again.path).expect("a sensor can be written");
        Sensor::read(&again.path).expect("what was read and written is read again");
    }
    answer(bytes, SensorCalibration::read(&file.path));
    answer(bytes, read_contact_table(&file.path));
}

/// Returns the result, if there is one. An error must name the file and must not contain a value in
/// debug format, unless it quotes one from the file.
fn answer<T, E: Display>(bytes: &[u8], result: Result<T, E>) -> Option<T> {
    let sentence = match result {
        Ok(answer) => return Some(answer),
        Err(error) => error.to_string(),
    };
    let files = [
        "table.csv",
        "cases.txt",
        "image.png",
        "stream.y4m",
        "file.toml",
    ];
    assert!(files.iter().any(|f| sentence.contains(f)), "{sentence}");
    // Quotations contain no control characters.
    let file = String::from_utf8_lossy(bytes).replace(char::is_control, "");
    for printed in ["Some(", "Err("] {
        let quoted = file.contains(printed);
        assert!(quoted || !sentence.contains(printed), "{sentence}");
    }
    None
}

/// A file in a folder that is deleted with it.
struct Scratch {
    path: PathBuf,
    _folder: tempfile::TempDir,
}

impl Scratch {
    fn new(name: impl AsRef<Path>, bytes: &[u8]) -> Self {
        let folder = tempfile::tempdir().expect("a folder for temporary files");
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("a temporary file");
        Self {
            path,
            _folder: folder,
        }
    }
}
