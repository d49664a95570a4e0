//! How colours make grey.

/// How red, green and blue make a grey level, on the stored (gamma-coded) values.
///
/// A calibration holds for the grey that it was made with: reading colour frames by another one moves every level.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{Grey, read_grey_image};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("blue.ppm");
/// std::fs::write(&path, b"P6\n1 1\n255\n\x00\x00\x5a")?; // 90 levels of blue
/// let levels = |grey| read_grey_image(&path, grey, None).map(|image| image.to_u8()[[0, 0]]);
/// assert_eq!((levels(Grey::Mean)?, levels(Grey::default())?), (30, 10));
/// # Ok(()) }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Grey {
    /// The luma of Rec. 601, 0.299 R + 0.587 G + 0.114 B: what OpenCV and most camera software do.
    #[default]
    Rec601,
    /// The luma of Rec. 709, 0.2126 R + 0.7152 G + 0.0722 B.
    Rec709,
    /// The mean of the channels: the depth tables of 9DTact.
    Mean,
}

impl Grey {
    /// Weights of red, green and blue, of sum 1.
    pub fn weights(self) -> [f64; 3] {
        match self {
            Grey::Rec601 => [0.299, 0.587, 0.114],
            Grey::Rec709 => [0.2126, 0.7152, 0.0722],
            Grey::Mean => [1.0 / 3.0; 3],
        }
    }
}
