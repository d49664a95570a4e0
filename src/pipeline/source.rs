//! Where the frames of a stream come from.
use ndarray::Array2;

/// A source of frames of one size: a camera, a folder, the simulator.
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::pipeline::FrameSource;
/// /// A camera that sees the same grey for ever.
/// struct Grey(u64);
/// impl FrameSource for Grey {
///     type Error = std::convert::Infallible;
///     fn next_frame(&mut self, frame: &mut Array2<u8>) -> Result<Option<f64>, Self::Error> {
///         frame.fill(12);
///         self.0 += 1;
///         Ok(Some(self.0 as f64 / 80.0))
///     }
/// }
/// let mut frame = Array2::zeros((4, 6));
/// assert_eq!(Grey(0).next_frame(&mut frame)?, Some(1.0 / 80.0));
/// # Ok::<(), std::convert::Infallible>(())
/// ```
pub trait FrameSource {
    /// What can go wrong.
    type Error: std::error::Error;

    /// Writes the next frame into `frame` (of another size: replaces it) and returns its time in
    /// seconds. `None` at the end.
    ///
    /// # Errors
    /// What the source meets.
    fn next_frame(&mut self, frame: &mut Array2<u8>) -> Result<Option<f64>, Self::Error>;
}

/// The images of a folder in the order of their names, at a given rate.
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::{io::write_grey_image, pipeline::{FrameSource, ImageFolder}};
/// let folder = tempfile::tempdir()?;
/// for grey in [30, 40_u8] {
///     write_grey_image(
///         folder.path().join(format!("{grey}.png")),
///         Array2::from_elem((4, 6), grey).view(),
///     )?;
/// }
/// let mut camera = ImageFolder::open(folder.path(), 80.0)?;
/// let mut frame = Array2::zeros((0, 0));
/// assert_eq!(camera.next_frame(&mut frame)?, Some(0.0));
/// assert_eq!(camera.next_frame(&mut frame)?, Some(1.0 / 80.0));
/// assert_eq!((frame.dim(), frame[[0, 0]]), ((4, 6), 40));
/// assert_eq!(camera.next_frame(&mut frame)?, None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[cfg(feature = "scene")]
#[derive(Clone, Debug)]
pub struct ImageFolder {
    files: std::vec::IntoIter<std::path::PathBuf>,
    period_s: f64,
    next_s: f64,
}

#[cfg(feature = "scene")]
impl ImageFolder {
    /// The PNG, PGM, JPEG and TIFF files of `folder`.
    ///
    /// # Errors
    /// [`FileError::Read`](crate::io::FileError::Read) where the folder cannot be listed.
    pub fn open(
        folder: impl AsRef<std::path::Path>,
        frame_rate_hz: f64,
    ) -> Result<Self, crate::io::FileError> {
        let folder = folder.as_ref();
        let list = || -> std::io::Result<Vec<_>> {
            std::fs::read_dir(folder)?
                .map(|entry| entry.map(|e| e.path()))
                .collect()
        };
        let mut files = list().map_err(|source| crate::io::FileError::Read {
            path: folder.into(),
            source,
        })?;
        let is_image = |path: &std::path::PathBuf| {
            let extension = path
                .extension()
                .and_then(|e| e.to_str())
                .unwrap_or_default();
            ["png", "pgm", "jpg", "jpeg", "tif", "tiff"]
                .contains(&extension.to_ascii_lowercase().as_str())
        };
        files.retain(is_image);
        files.sort();
        Ok(Self {
            files: files.into_iter(),
            period_s: 1.0 / frame_rate_hz,
            next_s: 0.0,
        })
    }
}

#[cfg(feature = "scene")]
impl FrameSource for ImageFolder {
    type Error = crate::io::FileError;

    fn next_frame(&mut self, frame: &mut Array2<u8>) -> Result<Option<f64>, Self::Error> {
        let Some(path) = self.files.next() else {
            return Ok(None);
        };
        *frame = crate::io::read_grey_image(path, crate::io::Grey::default(), None)?.to_u8();
        let time_s = self.next_s;
        self.next_s += self.period_s;
        Ok(Some(time_s))
    }
}
