//! Grey images from PNG, PGM and JPEG files.
//!
//! Colour is turned to grey by the luma of Rec. 601, Y = 0.299 R + 0.587 G + 0.114 B, on the stored (gamma-coded) values,
//! as OpenCV and most camera software do; alpha is ignored. Samples of 16 bits keep their precision: levels are on the
//! scale of 8 bits, 0 to 255, with fractions (v/257).
use super::error::{ReadError, read_bytes, write_bytes};
use ::image::{DynamicImage, ImageFormat, ImageReader, Limits};
use ndarray::{Array2, ArrayView2};
use std::io::Cursor;
use std::path::Path;

/// Weights of red, green and blue in grey: the luma of Rec. 601.
///
/// ```
/// use tactile_imaging::io::image::REC_601;
/// let grey = |rgb: [f64; 3]| (0..3).map(|i| REC_601[i] * rgb[i]).sum::<f64>();
/// assert!((grey([255.0; 3]) - 255.0).abs() < 1e-12, "white stays white");
/// assert!(grey([0.0, 255.0, 0.0]) > grey([255.0, 0.0, 255.0]), "green weighs most");
/// ```
pub const REC_601: [f64; 3] = [0.299, 0.587, 0.114];

/// Largest width and height that is read, px: beyond it a file is taken for broken.
///
/// ```
/// use tactile_imaging::io::image::{LARGEST_SIDE, parse_grey_image};
/// let line = |width: u32| {
///     let header = format!("P5\n{width} 1\n255\n").into_bytes();
///     [header, vec![0; width as usize]].concat()
/// };
/// assert!(parse_grey_image(&line(LARGEST_SIDE), "line.pgm").is_ok());
/// assert!(parse_grey_image(&line(LARGEST_SIDE + 1), "line.pgm").is_err());
/// ```
pub const LARGEST_SIDE: u32 = 30_000;

/// A grey image, `[row, column]`.
///
/// ```
/// use tactile_imaging::io::image::parse_grey_image;
/// let image = parse_grey_image(b"P6\n2 1\n255\n\xff\x00\x00\x0a\x0a\x0a", "red_and_grey.ppm")?;
/// assert!(image.colour && image.bits == 8);
/// assert!((image.levels[[0, 0]] - 0.299 * 255.0).abs() < 1e-12);
/// assert_eq!(image.to_u8(), ndarray::array![[76, 10]]);
/// # Ok::<(), tactile_imaging::io::ReadError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct GreyImage {
    /// Grey levels from 0 to 255, not rounded (colour and 16-bit samples have fractions).
    pub levels: Array2<f64>,
    /// Bits of a sample in the file: 8 or 16.
    pub bits: u8,
    /// Whether the file was in colour.
    pub colour: bool,
}

impl GreyImage {
    /// The levels rounded to 8 bits (half up).
    pub fn to_u8(&self) -> Array2<u8> {
        self.levels
            .mapv(|v| (v + 0.5).floor().clamp(0.0, 255.0) as u8)
    }
}

/// Reads a grey image; the kind of file is told from its content, not its name.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{read_grey_image, write_grey_image};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("frame.png");
/// let frame = ndarray::array![[0u8, 10], [200, 255]];
/// write_grey_image(&path, frame.view())?;
/// assert_eq!(read_grey_image(&path)?.to_u8(), frame);
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`ReadError::Open`] and [`ReadError::Image`].
pub fn read_grey_image(path: impl AsRef<Path>) -> Result<GreyImage, ReadError> {
    let path = path.as_ref();
    parse_grey_image(&read_bytes(path)?, path)
}

/// Decodes a grey image from the bytes of a file; `name` stands for the file in errors.
///
/// ```
/// use tactile_imaging::io::image::parse_grey_image;
/// let image = parse_grey_image(b"P5\n2 1\n65535\n\x80\x80\xff\xff", "frame.pgm")?;
/// assert_eq!((image.bits, image.levels), (16, ndarray::array![[128.0, 255.0]]));
/// let error = parse_grey_image(b"force_N\n0.7\n", "frame.png").unwrap_err();
/// assert!(error.to_string().starts_with("cannot decode the image frame.png"));
/// # Ok::<(), tactile_imaging::io::ReadError>(())
/// ```
///
/// # Errors
/// [`ReadError::Image`].
pub fn parse_grey_image(bytes: &[u8], name: impl AsRef<Path>) -> Result<GreyImage, ReadError> {
    let decode = || {
        let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
        let mut limits = Limits::default();
        limits.max_image_width = Some(LARGEST_SIDE);
        limits.max_image_height = Some(LARGEST_SIDE);
        reader.limits(limits);
        reader.decode()
    };
    let decoded = decode().map_err(|source| ReadError::Image {
        path: name.as_ref().into(),
        source,
    })?;
    Ok(to_grey(decoded))
}

/// Writes an 8-bit grey image: PGM where the name ends in `.pgm`, else PNG.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::write_grey_image;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("frame.pgm");
/// write_grey_image(&path, ndarray::array![[10, 20, 30]].view())?;
/// assert_eq!(std::fs::read(&path)?, b"P5\n3 1\n255\n\x0a\x14\x1e");
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`ReadError::Write`] and [`ReadError::Image`].
pub fn write_grey_image(
    path: impl AsRef<Path>,
    pixels: ArrayView2<'_, u8>,
) -> Result<(), ReadError> {
    let path = path.as_ref();
    let (rows, columns) = pixels.dim();
    let samples: Vec<u8> = pixels.iter().copied().collect();
    let is_pgm = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("pgm"));
    let mut bytes = Vec::new();
    if is_pgm {
        bytes = format!("P5\n{columns} {rows}\n255\n").into_bytes();
        bytes.extend_from_slice(&samples);
    } else {
        let cursor = &mut Cursor::new(&mut bytes);
        let (width, height) = (columns as u32, rows as u32);
        let colour = ::image::ExtendedColorType::L8;
        ::image::write_buffer_with_format(
            cursor,
            &samples,
            width,
            height,
            colour,
            ImageFormat::Png,
        )
        .map_err(|source| ReadError::Image {
            path: path.into(),
            source,
        })?;
    }
    write_bytes(path, &bytes)
}

fn to_grey(image: DynamicImage) -> GreyImage {
    let colour = image.color().has_color();
    let shape = (image.height() as usize, image.width() as usize);
    let luma = |rgb: [f64; 3]| (0..3).map(|i| REC_601[i] * rgb[i]).sum::<f64>();
    let wide = image.color().bytes_per_pixel() / image.color().channel_count() > 1;
    let levels: Vec<f64> = match (wide, colour) {
        (false, false) => image
            .into_luma_alpha8()
            .pixels()
            .map(|p| f64::from(p.0[0]))
            .collect(),
        (false, true) => image
            .into_rgb8()
            .pixels()
            .map(|p| luma(p.0.map(f64::from)))
            .collect(),
        (true, false) => image
            .into_luma_alpha16()
            .pixels()
            .map(|p| f64::from(p.0[0]) / 257.0)
            .collect(),
        (true, true) => image
            .into_rgb16()
            .pixels()
            .map(|p| luma(p.0.map(|v| f64::from(v) / 257.0)))
            .collect(),
    };
    let levels = Array2::from_shape_vec(shape, levels).unwrap_or_else(|_| Array2::zeros(shape));
    GreyImage {
        levels,
        bits: if wide { 16 } else { 8 },
        colour,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pnm(header: &str, samples: &[u8]) -> GreyImage {
        parse_grey_image(&[header.as_bytes(), samples].concat(), "i").unwrap()
    }

    #[test]
    fn colour_is_rec_601() {
        let image = pnm("P6\n3 1\n255\n", &[255, 0, 0, 0, 255, 0, 0, 0, 255]);
        assert!(image.colour);
        // 255 times the weights; the sums differ from the products by rounding alone.
        for (level, weight) in image.levels.iter().zip(REC_601) {
            assert!((level - 255.0 * weight).abs() < 1e-12);
        }
        assert_eq!(image.to_u8().into_raw_vec_and_offset().0, [76, 150, 29]);
    }

    #[test]
    fn sixteen_bits_keep_their_fraction() {
        let image = pnm("P5\n2 1\n65535\n", &[0x01, 0x00, 0xff, 0xff]);
        assert_eq!((image.bits, image.colour), (16, false));
        assert_eq!(image.levels.as_slice().unwrap(), [256.0 / 257.0, 255.0]);
    }

    #[test]
    fn a_text_file_is_an_error_that_names_it() {
        let error = parse_grey_image(b"hello", "frame.png")
            .unwrap_err()
            .to_string();
        assert!(
            error.starts_with("cannot decode the image frame.png: "),
            "{error}"
        );
    }
}
