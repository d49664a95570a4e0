//! Grey images from PNG, PGM, JPEG and TIFF files.
use super::error::FileError;
use super::files::{LONGEST_HEADER, read_bytes, write_bytes};
use super::kinds::kind_of;
use ::image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};
use ndarray::{Array2, Array3, ArrayView2, ArrayView3};
use std::io::Cursor;
use std::path::Path;

/// Smallest difference between red, green and blue of a coloured pixel, in grey levels. It exceeds
/// the rounding of codecs, and is small because a sensor without contact is nearly black.
const LEAST_TINT: f64 = 1.0;

/// Smallest share of coloured pixels in a colour image. A time stamp in the picture has fewer.
const TINTED_SHARE: f64 = 1e-3;

/// The weights that turn the stored (gamma-coded) red, green and blue into a grey level.
///
/// A calibration is valid only for the conversion that it was made with. Another conversion changes
/// every grey level of a colour frame.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{Grey, read_grey_image};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("blue.ppm");
/// std::fs::write(&path, b"P6\n1 1\n255\n\x00\x00\x5a")?; // 90 levels of blue
/// let levels = |grey| read_grey_image(&path, grey, None).map(|image| image.to_u8()[[0, 0]]);
/// assert_eq!((levels(Grey::Mean)?, levels(Grey::default())?), (30, 10));
/// # Ok(()) }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Grey {
    /// The luma of Rec. 601, 0.299 R + 0.587 G + 0.114 B, as in OpenCV and most camera software.
    #[default]
    Rec601,
    /// The luma of Rec. 709, 0.2126 R + 0.7152 G + 0.0722 B.
    Rec709,
    /// The mean of the channels, as in the depth tables of 9DTact.
    Mean,
}

impl Grey {
    /// Weights of red, green and blue, which add up to 1.
    pub fn weights(self) -> [f64; 3] {
        match self {
            Grey::Rec601 => [0.299, 0.587, 0.114],
            Grey::Rec709 => [0.2126, 0.7152, 0.0722],
            Grey::Mean => [1.0 / 3.0; 3],
        }
    }
}

/// A grey image, `[row, column]`.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{Grey, read_grey_image};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("red_and_grey.ppm");
/// std::fs::write(&path, b"P6\n2 1\n255\n\xff\x00\x00\x0a\x0a\x0a")?;
/// let image = read_grey_image(&path, Grey::Rec601, None)?;
/// assert_eq!((image.colour, image.bits), (Some([132.5, 5.0, 5.0]), 8));
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
    /// Mean red, green and blue. `None` for a grey image, even if it is stored in three channels.
    pub colour: Option<[f64; 3]>,
}

impl GreyImage {
    /// The levels rounded to 8 bits (half up).
    pub fn to_u8(&self) -> Array2<u8> {
        self.levels
            .mapv(|v| (v + 0.5).floor().clamp(0.0, 255.0) as u8)
    }
}

/// Reads a grey image. The format is detected from the content, not from the name.
///
/// Colour is turned to grey by the weights of `grey`, on the stored (gamma-coded) values. Alpha is
/// ignored. Levels are on the scale of 8 bits, and samples of more bits keep their precision as
/// fractions. A sample v becomes 255 v/m, where m is the largest value of the camera.
///
/// - Images of 8 bits are not scaled.
/// - A PGM or PPM states m, its `maxval`.
/// - A PNG or TIFF of 16 bits does not state m. It is 65535, or 2ᵇ − 1 if the caller passes the
///   `bits` b from 1 to 16. Cameras of 12 bits often store their samples unscaled in 16 bits. An
///   image without a sample above 4095 is therefore refused if `bits` is `None`. An exception are
///   images whose samples are all multiples of 257, which are 8 bits scaled to 16.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{Grey, read_grey_image};
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
/// assert!(read(None).unwrap_err().to_string().contains("give the bits of its camera"));
/// assert_eq!(read(Some(12))?.levels, ndarray::array![[255.0, 51.0]]);
/// assert!(read(Some(10)).is_err(), "4095 takes 12 bits");
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FileError`] if the file cannot be read or decoded, is too large or has an unclear depth, or if
/// a sample needs more than `bits` bits.
pub fn read_grey_image(
    path: impl AsRef<Path>,
    grey: Grey,
    bits: Option<u8>,
) -> Result<GreyImage, FileError> {
    let path = path.as_ref();
    let bytes = read_bytes(path)?;
    let image = decode(&bytes, path)?;
    to_grey(image, &bytes, path, grey, bits)
}

/// Rows and columns of an image, read from its header. `None` if the file is not a readable image.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::image_size;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("frame.pgm");
/// std::fs::write(&path, b"P5\n3 2\n255\n......")?;
/// assert_eq!(image_size(&path), Some((2, 3)));
/// assert_eq!(image_size(folder.path()), None);
/// # Ok(()) }
/// ```
#[must_use]
pub fn image_size(path: impl AsRef<Path>) -> Option<(usize, usize)> {
    let (width, height) = header(path.as_ref())?.dimensions();
    Some((height as usize, width as usize))
}

fn header(path: &Path) -> Option<impl ImageDecoder + use<>> {
    // Opening a pipe without a writer would wait for ever.
    path.metadata().ok().filter(std::fs::Metadata::is_file)?;
    let reader = ImageReader::open(path).ok()?.with_guessed_format().ok()?;
    reader.into_decoder().ok()
}

/// Reads a grey image and rounds it to eight bits per pixel, as [`GreyImage::to_u8`] does.
///
/// # Errors
/// The errors of [`read_grey_image`].
pub fn read_grey_levels(path: &Path, bits: Option<u8>) -> Result<Array2<u8>, FileError> {
    let bytes = read_bytes(path)?;
    let image = eight_bit_levels(decode(&bytes, path)?, &bytes, path, Grey::default(), bits)?;
    Ok(image.0)
}

/// Mean red, green and blue of an image file, see [`GreyImage::colour`]. A grey image is not
/// decoded.
///
/// # Errors
/// The errors of [`read_grey_image`].
pub fn image_colour(path: &Path) -> Result<Option<[f64; 3]>, FileError> {
    match header(path) {
        Some(header) if !header.color_type().has_color() => Ok(None),
        _ => Ok(read_grey_image(path, Grey::default(), Some(16))?.colour),
    }
}

/// The colour of an image and its levels in eight bits per pixel. The encoded `bytes` may state the
/// largest sample.
pub(super) fn eight_bit_levels(
    image: DynamicImage,
    bytes: &[u8],
    path: &Path,
    grey: Grey,
    bits: Option<u8>,
) -> Result<(Array2<u8>, Option<[f64; 3]>), FileError> {
    match image {
        // Grey samples of eight bits are used unchanged.
        DynamicImage::ImageLuma8(image) => {
            let shape = (image.height() as usize, image.width() as usize);
            let levels = Array2::from_shape_vec(shape, image.into_raw());
            Ok((levels.unwrap_or_else(|_| Array2::zeros(shape)), None))
        }
        image => {
            let image = to_grey(image, bytes, path, grey, bits)?;
            Ok((image.to_u8(), image.colour))
        }
    }
}

/// Reads a colour image with eight bits per channel, `[row, column, channel]`.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::read_colour_levels;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("red.ppm");
/// std::fs::write(&path, b"P6\n1 1\n255\n\xf0\x10\x00")?;
/// assert_eq!(read_colour_levels(&path)?, ndarray::array![[[240, 16, 0]]]);
/// let path = folder.path().join("grey.pgm");
/// std::fs::write(&path, b"P5\n1 1\n255\n\x80")?;
/// assert!(read_colour_levels(&path).unwrap_err().to_string().contains("grey"));
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FileError`] if the file cannot be read or decoded, is too large or is grey.
pub fn read_colour_levels(path: impl AsRef<Path>) -> Result<Array3<u8>, FileError> {
    let path = path.as_ref();
    let image = decode(&read_bytes(path)?, path)?;
    colour_levels(image).ok_or_else(|| refused(path, "it is grey, a colour image is needed"))
}

/// Red, green and blue in eight bits. `None` for a grey image.
///
/// Samples of 16 bits that do not exceed 10 or 12 bits come from a camera of that depth. They are
/// divided by its range, not by that of 16 bits.
pub(super) fn colour_levels(image: DynamicImage) -> Option<Array3<u8>> {
    if !image.color().has_color() || is_grey_in_three(&image) {
        return None;
    }
    if let DynamicImage::ImageRgb16(_) | DynamicImage::ImageRgba16(_) = image {
        let image = image.into_rgb16();
        let largest = image.iter().copied().max().unwrap_or(0);
        let shift = [2, 4].into_iter().find(|shift| largest >> shift < 256);
        let shape = (image.height() as usize, image.width() as usize, 3);
        let levels = image
            .into_raw()
            .into_iter()
            .map(|v| (v >> shift.unwrap_or(8)) as u8);
        return Array3::from_shape_vec(shape, levels.collect()).ok();
    }
    let image = image.into_rgb8();
    let shape = (image.height() as usize, image.width() as usize, 3);
    Array3::from_shape_vec(shape, image.into_raw()).ok()
}

/// Whether a grey image was saved in three equal channels. An image of a single colour does not
/// count.
fn is_grey_in_three(image: &DynamicImage) -> bool {
    let DynamicImage::ImageRgb8(image) = image else {
        return false;
    };
    let pixels = image.as_chunks::<3>().0;
    let is_grey = pixels.iter().all(|[r, g, b]| r == g && g == b);
    is_grey && pixels.iter().any(|pixel| *pixel != pixels[0])
}

/// Reads the image that a field of `file` names. Its size must be that of the reference, if there
/// is one.
pub(crate) fn read_frame(
    file: &Path,
    field: &str,
    path: &Path,
    bits: Option<u8>,
    reference: Option<(usize, usize)>,
) -> Result<Array2<u8>, FileError> {
    let image = read_grey_levels(path, bits);
    let image = image.map_err(|error| FileError::field(file, field, error))?;
    let (rows, columns) = reference.unwrap_or(image.dim());
    if image.dim() == (rows, columns) {
        return Ok(image);
    }
    let reason = format!(
        "the image {} is {} × {} pixels, but the reference is {columns} × {rows}",
        path.display(),
        image.ncols(),
        image.nrows()
    );
    Err(FileError::field(file, field, reason))
}

/// Limits of the side and the number of pixels. A damaged header can announce any size.
pub(super) fn largest_image() -> (u32, u64) {
    (30_000, 64_000_000)
}

pub(super) fn decode(bytes: &[u8], path: &Path) -> Result<DynamicImage, FileError> {
    if !::image::guess_format(bytes).is_ok_and(|format| format.reading_enabled()) {
        let text = if bytes.is_empty() { "empty" } else { "a text" };
        let kind = kind_of(bytes).unwrap_or(text.into());
        return Err(refused(path, format!("it is {kind}: an image is needed")));
    }
    if is_cut_jpeg(bytes) {
        return Err(refused(path, DAMAGED));
    }
    // An animated PNG announces its frames before the samples.
    let start = &bytes[..bytes.len().min(LONGEST_HEADER as usize)];
    if start.starts_with(b"\x89PNG") && start.windows(4).any(|chunk| chunk == b"acTL") {
        return Err(refused(path, "it is an animation: save its frames as PNG"));
    }
    let (side, pixels) = largest_image();
    let mut limits = Limits::default();
    limits.max_image_width = Some(side);
    limits.max_image_height = Some(side);
    // The widest pixel that is decoded has four samples of 16 bits.
    limits.max_alloc = Some(8 * pixels);
    // Errors of the decoder and of this reader are wrapped in one place.
    let decoded = || {
        let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
        reader.limits(limits.clone());
        let mut decoder = reader.into_decoder()?;
        decoder.set_limits(limits)?;
        let (width, height) = decoder.dimensions();
        if width == 0 || height == 0 {
            return Ok(Err("it has no pixels".to_owned()));
        }
        if u64::from(width) * u64::from(height) > pixels {
            return Ok(Err(format!(
                "{width} × {height} pixels are more than the {} million that are read",
                pixels / 1_000_000
            )));
        }
        let orientation = decoder.orientation()?;
        let mut image = DynamicImage::from_decoder(decoder)?;
        // A rotated camera notes its orientation beside the pixels.
        image.apply_orientation(orientation);
        if image.color().bytes_per_pixel() / image.color().channel_count() > 2 {
            return Ok(Err(OTHER_SAMPLES.to_owned()));
        }
        Ok(above_maximum(bytes, (width, height)).map_or(Ok(image), Err))
    };
    let decoded = decoded().unwrap_or_else(|error: ImageError| Err(in_words(&error)));
    decoded.map_err(|reason| refused(path, reason))
}

const DAMAGED: &str = "the image is damaged or cut short";

/// Whether the samples of a JPEG image lack their end marker. The decoder would invent the rest.
fn is_cut_jpeg(bytes: &[u8]) -> bool {
    let last = |marker: u8| bytes.windows(2).rposition(|pair| pair == [0xff, marker]);
    let (end, samples) = (0xd9, 0xda);
    bytes.starts_with(b"\xff\xd8\xff") && last(end) < last(samples)
}

/// The message for images that cannot be decoded to levels.
const OTHER_SAMPLES: &str = "it is stored in a way that is not read: save it with whole numbers of 8 or 16 \
     bits without sign, packed by LZW, Deflate or not at all";

/// The message of this reader for an error of the codec.
fn in_words(error: &ImageError) -> String {
    match error {
        ImageError::Unsupported(_) => OTHER_SAMPLES.into(),
        ImageError::Decoding(_) | ImageError::IoError(_) => DAMAGED.into(),
        other => other.to_string(),
    }
}

pub(super) fn refused(path: &Path, reason: impl Into<String>) -> FileError {
    FileError::Image {
        path: path.into(),
        reason: reason.into(),
    }
}

fn to_grey(
    image: DynamicImage,
    bytes: &[u8],
    path: &Path,
    grey: Grey,
    bits: Option<u8>,
) -> Result<GreyImage, FileError> {
    let (colour, shape) = (
        image.color(),
        (image.height() as usize, image.width() as usize),
    );
    // The decoder scales 8 bits to 16 by the factor 257, which the division below inverts exactly.
    let samples = match colour.has_color() {
        true => image.into_rgb16().into_raw(),
        false => image.into_luma16().into_raw(),
    };
    let is_wide = colour.bytes_per_pixel() / colour.channel_count() > 1;
    let white = if is_wide {
        white_of(&samples, bytes, bits)
    } else {
        Ok(65_535.0)
    };
    let scale = white.map_err(|reason| refused(path, reason))? / 255.0;
    // If the caller passes the bits, the decoder's rounding can exceed the largest level.
    let level = |sample: u16| f64::from(sample) / scale;
    let (mut sums, mut tinted) = ([0; 3], 0);
    let levels: Vec<f64> = if colour.has_color() {
        let weights = grey.weights();
        let least = (LEAST_TINT * scale) as u16;
        let weighted = samples.as_chunks::<3>().0.iter().map(|rgb| {
            let [r, g, b] = *rgb;
            tinted += usize::from(r.max(g).max(b) - r.min(g).min(b) > least);
            (0..3).for_each(|i| sums[i] += u64::from(rgb[i]));
            let terms = (0..3).map(|i| weights[i] * level(rgb[i]));
            terms.sum::<f64>().min(255.0)
        });
        weighted.collect()
    } else {
        samples
            .iter()
            .map(|sample| level(*sample).min(255.0))
            .collect()
    };
    let pixels = levels.len() as f64;
    let means = sums.map(|sum| sum as f64 / (scale * pixels));
    Ok(GreyImage {
        levels: Array2::from_shape_vec(shape, levels).unwrap_or_else(|_| Array2::zeros(shape)),
        bits: if is_wide { 16 } else { 8 },
        colour: (tinted as f64 > TINTED_SHARE * pixels).then_some(means),
    })
}

/// The 16-bit sample that corresponds to level 255. The decoder scales the samples of a PGM, PPM or
/// PAM from the maximum in the header to the full range.
fn white_of(samples: &[u16], bytes: &[u8], bits: Option<u8>) -> Result<f64, String> {
    let brightest = samples.iter().copied().max().unwrap_or(u16::MAX);
    let announced = announced_maximum(bytes);
    if let Some(bits) = bits {
        let stretch = announced.map_or(1.0, |maximum| f64::from(u16::MAX) / f64::from(maximum));
        let white = stretch * f64::from((1_u32 << bits.clamp(1, 16)) - 1);
        // Half a sample allows for the decoder's rounding.
        if f64::from(brightest) <= white + 0.5 {
            return Ok(white);
        }
        let brightest = (f64::from(brightest) / stretch).round();
        return Err(format!(
            "it has a sample of {brightest}, more than {bits} bits hold"
        ));
    }
    // A program that stores 8 bits in 16 makes every sample a multiple of 257. Samples of a camera
    // with 12 bits or fewer do not exceed 4095.
    let is_stretched = samples.iter().all(|sample| sample.is_multiple_of(257));
    if announced.is_some() || brightest > 4095 || is_stretched {
        return Ok(f64::from(u16::MAX));
    }
    // Cameras of 10 bits do not exceed 1023.
    let likely = if brightest > 1023 { 12 } else { 10 };
    let bits = format!("give the bits of its camera (bits = {likely}, or 16)");
    Err(format!("no 16-bit sample is above {brightest}: {bits}"))
}

/// The words in the header of a PGM, PPM or PAM, without comments.
pub(super) fn header_words(header: &str) -> impl Iterator<Item = &str> {
    let lines = header.lines();
    let lines = lines.map(|line| line.split('#').next().unwrap_or(""));
    lines.flat_map(str::split_ascii_whitespace)
}

/// The largest value of a sample that the header of a PGM, PPM or PAM announces.
fn announced_maximum(bytes: &[u8]) -> Option<u16> {
    let kind = bytes.strip_prefix(b"P")?.first()?;
    // No header is longer than this. Words beyond are samples.
    let header = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    let mut words = header_words(&header);
    let word = match kind {
        b'2' | b'3' | b'5' | b'6' => words.nth(3),
        b'7' => words.skip_while(|word| *word != "MAXVAL").nth(1),
        _ => None,
    };
    word?.parse().ok().filter(|&maximum| maximum > 0)
}

/// An error message if a sample of a binary PGM, PPM or PAM exceeds the maximum in its header. The
/// decoder would clip the sample.
fn above_maximum(bytes: &[u8], (width, height): (u32, u32)) -> Option<String> {
    let announced = announced_maximum(bytes)?;
    let channels = match bytes.get(1)? {
        b'5' => 1,
        b'6' => 3,
        // A PAM states its depth in the header, and the decoder checks samples written as text.
        _ => return None,
    };
    let width_bytes = if announced > 255 { 2 } else { 1 };
    let samples = width as usize * height as usize * channels;
    let start = bytes.len().checked_sub(samples * width_bytes)?;
    // If other data follow the samples, the position of the samples cannot be counted from the end.
    let header = String::from_utf8_lossy(&bytes[..start.min(4096)]);
    if !header.trim_end().ends_with(&announced.to_string()) {
        return None;
    }
    let raster = bytes[start..].chunks_exact(width_bytes);
    let largest = raster
        .map(|sample| {
            sample
                .iter()
                .fold(0, |sum, &byte| 256 * sum + u16::from(byte))
        })
        .max()?;
    (largest > announced).then(|| {
        format!("it has a sample of {largest}, above the {announced} that its header announces")
    })
}

/// Writes an 8-bit grey image, as PGM if the name ends in `.pgm`, else as PNG.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::write_grey_image;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("frame.pgm");
/// write_grey_image(&path, ndarray::array![[10, 20, 30]].view())?;
/// assert_eq!(std::fs::read(&path)?, b"P5\n3 1\n255\n\x0a\x14\x1e");
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FileError::Write`] if the file cannot be written, [`FileError::Image`] if the image cannot be
/// encoded.
pub fn write_grey_image(
    path: impl AsRef<Path>,
    pixels: ArrayView2<'_, u8>,
) -> Result<(), FileError> {
    let path = path.as_ref();
    let (rows, columns) = pixels.dim();
    let samples: Vec<u8> = pixels.iter().copied().collect();
    let extension = path.extension();
    if extension.is_some_and(|name| name.eq_ignore_ascii_case("pgm")) {
        let header = format!("P5\n{columns} {rows}\n255\n").into_bytes();
        return write_bytes(path, &[header, samples].concat());
    }
    write_png(
        path,
        &samples,
        (rows, columns),
        ::image::ExtendedColorType::L8,
    )
}

/// Writes levels `[row, column, channel]` of red, green and blue as PNG.
///
/// # Errors
/// [`FileError::Write`] if the file cannot be written, [`FileError::Image`] if the image cannot be
/// encoded.
pub fn write_colour_image(
    path: impl AsRef<Path>,
    levels: ArrayView3<'_, u8>,
) -> Result<(), FileError> {
    let (rows, columns, _) = levels.dim();
    let samples: Vec<u8> = levels.iter().copied().collect();
    let colour = ::image::ExtendedColorType::Rgb8;
    write_png(path.as_ref(), &samples, (rows, columns), colour)
}

fn write_png(
    path: &Path,
    samples: &[u8],
    (rows, columns): (usize, usize),
    colour: ::image::ExtendedColorType,
) -> Result<(), FileError> {
    let mut png = Cursor::new(Vec::new());
    let (width, height) = (columns as u32, rows as u32);
    let format = ImageFormat::Png;
    ::image::write_buffer_with_format(&mut png, samples, width, height, colour, format)
        .map_err(|error| refused(path, in_words(&error)))?;
    write_bytes(path, png.get_ref())
}
