//! Grey images from PNG, PGM and JPEG files.
use super::depth::{Samples, full_scale};
use super::error::ReadError;
use super::files::{read_bytes, write_bytes};
use super::grey::Grey;
use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use ndarray::{Array2, ArrayView2};
use std::io::Cursor;
use std::path::Path;

/// Longest side of an image in pixels.
pub const LARGEST_SIDE: u32 = 30_000;

/// Most pixels of an image: 64 million.
pub const LARGEST_IMAGE: u64 = 64_000_000;

/// A grey image, `[row, column]`.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{Grey, read_grey_image};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("red_and_grey.ppm");
/// std::fs::write(&path, b"P6\n2 1\n255\n\xff\x00\x00\x0a\x0a\x0a")?;
/// let image = read_grey_image(&path, Grey::Rec601, None)?;
/// assert!(image.colour && image.bits == 8);
/// assert!((image.levels[[0, 0]] - 0.299 * 255.0).abs() < 1e-12);
/// assert_eq!(image.to_u8(), ndarray::array![[76, 10]]);
/// # Ok(()) }
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

/// Reads a grey image. The kind of file is told from its content, not its name.
///
/// Colour is turned to grey by the weights of `grey`, on the stored (gamma-coded) values. Alpha is ignored. Levels are on the scale of 8 bits,
/// and samples of more bits keep their precision as fractions: a sample v becomes 255 v/m, where m is the largest value that the camera
/// gives. A PGM or PPM says m (its `maxval`). A PNG of 16 bits does not: m is 65535, or 2ᵇ − 1 where the caller gives the `bits` b, 1 to 16. A
/// camera of 12 bits often writes its samples into 16 as they are. An image without any sample above 4095 is therefore refused until the
/// bits are given, unless all are multiples of 257, as 8 bits stretched to 16 are. Images of 8 bits are not scaled.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{Grey, ReadError, read_grey_image};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("frame.ppm");
/// std::fs::write(&path, b"P6\n1 1\n255\n\x1e\x3c\x00")?;
/// // Red 30, green 60, blue 0.
/// assert_eq!(read_grey_image(&path, Grey::Mean, None)?.levels, ndarray::array![[30.0]]);
/// assert_eq!(read_grey_image(&path, Grey::Rec601, None)?.to_u8(), ndarray::array![[44]]);
/// let path = folder.path().join("frame.png");
/// let samples = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![4095, 819]);
/// samples.ok_or("two samples")?.save(&path)?;
/// let read = |bits| read_grey_image(&path, Grey::default(), bits);
/// assert!(matches!(read(None), Err(ReadError::UnclearBits { likely: 12, .. })));
/// assert_eq!(read(Some(12))?.levels, ndarray::array![[255.0, 51.0]]);
/// assert!(matches!(read(Some(10)), Err(ReadError::TooFewBits { .. })));
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`ReadError`] where the file cannot be read or decoded, is too large, its depth is not clear, or a sample needs more bits than given.
pub fn read_grey_image(
    path: impl AsRef<Path>,
    grey: Grey,
    bits: Option<u8>,
) -> Result<GreyImage, ReadError> {
    let path = path.as_ref();
    parse(&read_bytes(path)?, path, grey, bits)
}

fn parse(bytes: &[u8], path: &Path, grey: Grey, bits: Option<u8>) -> Result<GreyImage, ReadError> {
    let (image, largest) = decode(bytes, path, bits)?;
    Ok(to_grey(&image, largest, grey))
}

/// The image, and the sample that stands for the level 255.
fn decode(bytes: &[u8], path: &Path, bits: Option<u8>) -> Result<(DynamicImage, f64), ReadError> {
    let broken = |source| ReadError::Image {
        path: path.into(),
        source,
    };
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| broken(e.into()))?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE);
    limits.max_image_height = Some(LARGEST_SIDE);
    // Four samples of 16 bits a pixel, the widest that is decoded.
    limits.max_alloc = Some(8 * LARGEST_IMAGE);
    reader.limits(limits.clone());
    let mut decoder = reader.into_decoder().map_err(broken)?;
    decoder.set_limits(limits).map_err(broken)?;
    let (width, height) = decoder.dimensions();
    // Before anything is decoded: a header of some bytes can announce any size.
    if u64::from(width) * u64::from(height) > LARGEST_IMAGE {
        return Err(ReadError::TooManyPixels {
            path: path.into(),
            width,
            height,
            limit: LARGEST_IMAGE,
        });
    }
    let decoded = DynamicImage::from_decoder(decoder).map_err(broken)?;
    let largest = full_scale(&decoded, bytes, path, bits)?;
    Ok((decoded, largest))
}

/// Reads a grey image in eight bits a pixel: as [`GreyImage::to_u8`], but samples that are grey levels already are taken as they stand.
pub fn read_grey_levels(path: &Path, bits: Option<u8>) -> Result<Array2<u8>, ReadError> {
    match decode(&read_bytes(path)?, path, bits)? {
        (DynamicImage::ImageLuma8(image), 255.0) => {
            let shape = (image.height() as usize, image.width() as usize);
            let levels = Array2::from_shape_vec(shape, image.into_raw());
            Ok(levels.unwrap_or_else(|_| Array2::zeros(shape)))
        }
        (image, largest) => Ok(to_grey(&image, largest, Grey::default()).to_u8()),
    }
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

/// Levels from samples of which `largest` stands for 255.
fn to_grey(image: &DynamicImage, largest: f64, grey: Grey) -> GreyImage {
    let channels = usize::from(image.color().channel_count());
    let scale = largest / 255.0;
    let samples = Samples::of(image);
    let levels = match samples {
        Samples::Eight(samples) => levels(samples, channels, scale, grey),
        Samples::Sixteen(samples) => levels(samples, channels, scale, grey),
    };
    let shape = (image.height() as usize, image.width() as usize);
    GreyImage {
        levels: Array2::from_shape_vec(shape, levels).unwrap_or_else(|_| Array2::zeros(shape)),
        bits: samples.bits(),
        colour: image.color().has_color(),
    }
}

/// The level of the largest sample. Where the caller says how many bits there are, the decoder's rounding can pass it.
const WHITE: f64 = 255.0;

/// Levels of pixels of one (grey), two (grey, alpha), three (colours) or four channels (colours, alpha).
fn levels<S: Copy + Into<f64>>(samples: &[S], channels: usize, scale: f64, grey: Grey) -> Vec<f64> {
    let weights = grey.weights();
    let pixels = samples.chunks_exact(channels);
    if channels < 3 {
        return pixels
            .map(|pixel| (pixel[0].into() / scale).min(WHITE))
            .collect();
    }
    pixels
        .map(|pixel| (0..3).map(|i| weights[i] * (pixel[i].into() / scale)))
        .map(|colours| colours.sum::<f64>().min(WHITE))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pnm(header: &str, samples: &[u8]) -> GreyImage {
        let bytes = [header.as_bytes(), samples].concat();
        parse(&bytes, Path::new("i"), Grey::default(), None).unwrap()
    }

    #[test]
    fn colour_is_rec_601() {
        let image = pnm("P6\n3 1\n255\n", &[255, 0, 0, 0, 255, 0, 0, 0, 255]);
        assert!(image.colour);
        // 255 times the weights; the sums differ from the products by rounding alone.
        for (level, weight) in image.levels.iter().zip(Grey::Rec601.weights()) {
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

    /// A dark frame of 8 bits that another program saved in 16.
    #[test]
    fn eight_bits_stretched_to_sixteen_are_known() {
        let png = |samples: Vec<u16>| {
            let image = ::image::ImageBuffer::<::image::Luma<u16>, _>::from_raw(3, 1, samples);
            let mut bytes = Cursor::new(Vec::new());
            image
                .unwrap()
                .write_to(&mut bytes, ImageFormat::Png)
                .unwrap();
            let path = Path::new("dark.png");
            parse(bytes.get_ref(), path, Grey::default(), None)
        };
        let levels = png(vec![0, 3 * 257, 11 * 257]).unwrap().levels;
        assert_eq!(levels.as_slice().unwrap(), [0.0, 3.0, 11.0]);
        assert!(png(vec![0, 3 * 257, 11 * 257 + 1]).is_err());
    }

    #[test]
    fn a_text_file_is_an_error_that_names_it() {
        let error = parse(b"hello", Path::new("frame.png"), Grey::default(), None)
            .unwrap_err()
            .to_string();
        assert!(
            error.starts_with("cannot decode the image frame.png: "),
            "{error}"
        );
    }

    #[test]
    fn a_pgm_is_scaled_by_the_largest_value_it_announces() {
        let image = pnm(
            "P5\n# a camera of 12 bits\n2 1\n4095\n",
            &[0x0f, 0xff, 0x03, 0x33],
        );
        // 65535 / 4095 and its products are right to rounding; the decoder rounds 819 of 4095 to 13107 of 65535, which is exact.
        assert!((image.levels[[0, 0]] - 255.0).abs() < 1e-12);
        assert!((image.levels[[0, 1]] - 51.0).abs() < 1e-12);
        let coarse = pnm("P2\n2 1\n15\n15 3\n", b"");
        assert_eq!(coarse.levels.as_slice().unwrap(), [255.0, 51.0]);
    }

    #[test]
    fn bits_given_beside_an_announced_largest_value_count_in_its_samples() {
        let bytes = [b"P5\n2 1\n4095\n".as_slice(), &[0x03, 0xff, 0x01, 0x55]].concat();
        let path = Path::new("frame.pgm");
        let read = |bits| parse(&bytes, path, Grey::default(), Some(bits));
        let image = read(10).unwrap();
        // 1023 of ten bits is 255, 341 a third of it; the decoder rounds to one part in 65535.
        assert!((image.levels[[0, 0]] - 255.0).abs() < 255.0 / 16_000.0);
        assert!((image.levels[[0, 1]] - 85.0).abs() < 255.0 / 16_000.0);
        assert!(matches!(
            read(9),
            Err(ReadError::TooFewBits {
                brightest: 1023,
                bits: 9,
                ..
            })
        ));
    }
}
