//! Normal maps, as images and as arrays.
use super::error::FileError;
use super::files::read_bytes;
use super::image::{decode, refused};
use super::numbers;
use ndarray::Array3;
use std::path::Path;

/// Reads a normal map: the axes x, y and z of a surface's normals, `[row, column, axis]`.
///
/// An image of 8 or 16 bits holds (n + 1)/2 in red, green and blue. Arrays of shape (rows, columns,
/// 3) or (3, rows, columns), in `.npy`, `.npz` and `.mat` (version 5), hold n itself.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::read_normal_map;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("normals.ppm");
/// std::fs::write(&path, b"P6\n1 1\n255\n\x00\x33\xff")?;
/// assert_eq!(read_normal_map(&path)?, ndarray::array![[[-1.0, -0.6, 1.0]]]);
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FileError`] if the file cannot be read or holds no colours or vectors.
pub fn read_normal_map(path: impl AsRef<Path>) -> Result<Array3<f64>, FileError> {
    let path = path.as_ref();
    let bytes = read_bytes(path)?;
    if let Some(vectors) = numbers::vectors(&bytes, path) {
        return vectors;
    }
    let image = decode(&bytes, path)?;
    if !image.color().has_color() {
        let reason = "it is grey: a normal map has three channels, and slopes are two files";
        return Err(refused(path, reason));
    }
    let image = image.into_rgb16();
    let shape = (image.height() as usize, image.width() as usize, 3);
    let axis = |sample: &u16| 2.0 * f64::from(*sample) / 65_535.0 - 1.0;
    let axes = image.iter().map(axis).collect();
    Ok(Array3::from_shape_vec(shape, axes).unwrap_or_else(|_| Array3::zeros(shape)))
}
