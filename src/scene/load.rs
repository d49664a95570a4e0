//! The files of a scene, read and checked against each other.
use super::{CalibrationSource, Scene, SceneError};
use crate::force::CalibrationPair;
use crate::io::{ReadError, read_grey_image, read_table};
use ndarray::Array2;
use std::path::Path;

/// A scene's calibration, read.
#[derive(Clone, Debug, PartialEq)]
pub enum LoadedCalibration {
    /// Integrated pixel value and force.
    Pairs(Vec<CalibrationPair<f64>>),
    /// Darkness in grey levels and depth in metres.
    DepthTable(Vec<(f64, f64)>),
}

/// A scene's images and calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneData {
    /// The frame without contact.
    pub reference: Array2<u8>,
    /// The frames, in the order of the scene.
    pub frames: Vec<Array2<u8>>,
    /// The calibration.
    pub calibration: LoadedCalibration,
}

impl Scene {
    /// Reads the images and the calibration, and checks that the images have one size.
    ///
    /// # Errors
    /// [`SceneError::File`] and [`SceneError::SizeMismatch`], naming the field and the file.
    pub fn load(&self) -> Result<SceneData, SceneError> {
        let reference = self.image("reference", &self.reference)?;
        let mut frames = Vec::with_capacity(self.frames.len());
        for (i, frame) in self.frames.iter().enumerate() {
            let field = format!("frames[{}].image", i + 1);
            let image = self.image(&field, &frame.image)?;
            if image.dim() != reference.dim() {
                return Err(SceneError::SizeMismatch {
                    file: self.file.clone(),
                    field,
                    image: frame.image.clone(),
                    reference: self.reference.clone(),
                    expected: size(&reference),
                    found: size(&image),
                });
            }
            frames.push(image);
        }
        Ok(SceneData { reference, frames, calibration: self.load_calibration()? })
    }

    fn image(&self, field: &str, path: &Path) -> Result<Array2<u8>, SceneError> {
        read_grey_image(path).map(|i| i.to_u8()).map_err(|source| self.file_error(field, source))
    }

    fn load_calibration(&self) -> Result<LoadedCalibration, SceneError> {
        let columns = |field: &str, path: &Path, names: [&str; 2]| {
            let read = || {
                let table = read_table(path)?;
                let first = table.column(names[0], 0, path)?;
                Ok(first.into_iter().zip(table.column(names[1], 1, path)?))
            };
            read().map_err(|source| self.file_error(field, source))
        };
        match &self.calibration {
            CalibrationSource::Pairs(path) => {
                let pairs = columns("calibration.pairs", path, ["integrated_pixel_value", "force_N"])?;
                Ok(LoadedCalibration::Pairs(pairs.map(|(v, f)| CalibrationPair::loading(v, f)).collect()))
            }
            CalibrationSource::DepthTable(path) => {
                let rows = columns("calibration.depth_table", path, ["darkness_grey_levels", "depth_mm"])?;
                Ok(LoadedCalibration::DepthTable(rows.map(|(d, z)| (d, z * 1e-3)).collect()))
            }
        }
    }

    fn file_error(&self, field: &str, source: ReadError) -> SceneError {
        SceneError::File { file: self.file.clone(), field: field.into(), source: Box::new(source) }
    }
}

fn size(image: &Array2<u8>) -> [u32; 2] {
    [image.nrows() as u32, image.ncols() as u32]
}
