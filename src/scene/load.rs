//! The files of a scene, read and checked against each other.
use super::{CalibrationSource, Scene, SceneError, read_contact_table};
use crate::elasticity::contact::ContactTable;
use crate::force::CalibrationPair;
use crate::io::{ReadError, read_columns, read_grey_levels};
use crate::sensor::Sensor;
use ndarray::{Array2, ArrayView2};
use std::path::Path;

/// A scene's calibration, read.
///
/// ```
/// use tactile_imaging::force::CalibrationPair;
/// use tactile_imaging::scene::LoadedCalibration;
/// let name = |calibration: &LoadedCalibration| match calibration {
///     LoadedCalibration::Pairs(pairs) => format!("{} readings, the last of {} N", pairs.len(), pairs[1].force_n),
///     LoadedCalibration::Gauge => "a gauge's forces".into(),
///     LoadedCalibration::Sensor(sensor) => format!("of {}", sensor.date),
///     LoadedCalibration::DepthTable(rows) => format!("down to {} m", rows[1].1),
/// };
/// let pairs = [0.0, 1.0].map(|f| CalibrationPair::loading(1e5 * f, f)).to_vec();
/// assert_eq!(name(&LoadedCalibration::Pairs(pairs)), "2 readings, the last of 1 N");
/// assert_eq!(name(&LoadedCalibration::DepthTable(vec![(0.0, 0.0), (60.0, 1.9e-3)])), "down to 0.0019 m");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum LoadedCalibration {
    /// Integrated pixel value and force.
    Pairs(Vec<CalibrationPair>),
    /// Darkness in grey levels and depth in metres.
    DepthTable(Vec<(f64, f64)>),
    /// None: the forces are a gauge's.
    Gauge,
    /// A sensor with its curve, lens and layers.
    Sensor(Box<Sensor>),
}

/// A scene's images and calibration.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # use tactile_simulate::{CalibrationRun, Camera, PressOptions, PressScene, write_folder};
/// use tactile_imaging::scene::{LoadedCalibration, Scene};
/// # let camera = Camera::default().coarser(16);
/// # let made = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// # let folder = tempfile::tempdir()?;
/// # let calibration = CalibrationRun { steps: 8, ..CalibrationRun::default() };
/// # let path = write_folder(&made, &made.calibrate(&calibration)?, folder.path())?;
/// let data = Scene::read(&path)?.load()?; // a calibration up to 2 N in 8 steps and back
/// assert!(data.frames.iter().all(|frame| frame.dim() == data.reference.dim()));
/// let LoadedCalibration::Pairs(pairs) = &data.calibration else { unreachable!() };
/// assert!(pairs.len() == 17 && (pairs[8].force_n - 2.0).abs() < 0.01);
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SceneData {
    /// The frame without contact.
    pub reference: Array2<u8>,
    /// The frames, in the order of the scene. Those that are missing are read from their files whenever a stage needs them.
    pub frames: Vec<Array2<u8>>,
    /// The calibration.
    pub calibration: LoadedCalibration,
    /// The table of contacts, where the scene names one.
    pub contact_table: Option<ContactTable>,
}

impl Scene {
    /// Reads the images and the calibration, and checks that the images have one size. Where the frames are too many for the memory,
    /// [`measure_file`](Self::measure_file) keeps none of them.
    ///
    /// # Errors
    /// [`SceneError::File`] and [`SceneError::SizeMismatch`], naming the field and the file.
    pub fn load(&self) -> Result<SceneData, SceneError> {
        let mut data = self.load_without_frames()?;
        let reference = data.reference.view();
        let frames = (0..self.frames.len()).map(|index| self.read_frame(index, reference));
        data.frames = frames.collect::<Result<_, _>>()?;
        Ok(data)
    }

    /// As [`load`](Self::load) without the frames: a [`press`](Self::press) then reads each when it is added and again when a stage needs it, so
    /// that any number of them fits into memory.
    pub fn load_without_frames(&self) -> Result<SceneData, SceneError> {
        Ok(SceneData {
            reference: self.image("reference", &self.reference)?,
            frames: Vec::new(),
            calibration: self.load_calibration()?,
            contact_table: (self.contact_table.as_ref())
                .map(read_contact_table)
                .transpose()?,
        })
    }

    /// The image of a frame, of the reference's size.
    pub(super) fn read_frame(
        &self,
        index: usize,
        reference: ArrayView2<'_, u8>,
    ) -> Result<Array2<u8>, SceneError> {
        let path = &self.frames[index].image;
        let field = format!("frames[{}].image", index + 1);
        let image = self.image(&field, path)?;
        if image.dim() == reference.dim() {
            return Ok(image);
        }
        Err(SceneError::SizeMismatch {
            file: self.file.clone(),
            field,
            image: path.clone(),
            reference: self.reference.clone(),
            expected: size(reference),
            found: size(image.view()),
        })
    }

    fn image(&self, field: &str, path: &Path) -> Result<Array2<u8>, SceneError> {
        read_image(path, self.bits).map_err(|source| self.file_error(field, source))
    }

    fn load_calibration(&self) -> Result<LoadedCalibration, SceneError> {
        match &self.calibration {
            CalibrationSource::Gauge => Ok(LoadedCalibration::Gauge),
            CalibrationSource::Sensor(path) => {
                Ok(LoadedCalibration::Sensor(Box::new(Sensor::read(path)?)))
            }
            CalibrationSource::Pairs(path) => {
                let pairs = read_pairs(path);
                let pairs = pairs.map_err(|source| self.file_error("calibration.pairs", source))?;
                Ok(LoadedCalibration::Pairs(pairs))
            }
            CalibrationSource::DepthTable(path) => {
                let wanted: [(&[&str], &str); 2] =
                    [(&["darkness"], "grey_levels"), (&["depth"], "mm")];
                let field = "calibration.depth_table";
                let columns = read_columns(path, wanted);
                let [darkness, depth] = columns.map_err(|source| self.file_error(field, source))?;
                let rows = darkness.into_iter().zip(depth).collect();
                Ok(LoadedCalibration::DepthTable(rows))
            }
        }
    }

    fn file_error(&self, field: &str, source: ReadError) -> SceneError {
        SceneError::File {
            file: self.file.clone(),
            field: field.into(),
            source: Box::new(source),
        }
    }
}

/// An image in eight bits a pixel, of a camera of `bits` where that is said.
pub fn read_image(path: &Path, bits: Option<u8>) -> Result<Array2<u8>, ReadError> {
    read_grey_levels(path, bits)
}

/// Pairs of integrated pixel value and force from a CSV file.
pub fn read_pairs(path: &Path) -> Result<Vec<CalibrationPair>, ReadError> {
    let value = (&["integrated_pixel_value"][..], "grey_levels");
    let [values, forces] = read_columns(path, [value, (&["force"], "N")])?;
    let pairs = values.into_iter().zip(forces);
    Ok(pairs.map(|(v, f)| CalibrationPair::loading(v, f)).collect())
}

fn size(image: ArrayView2<'_, u8>) -> [u32; 2] {
    [image.nrows() as u32, image.ncols() as u32]
}
