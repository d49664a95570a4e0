//! What a sample of a decoded image says of the level it stands for.
use super::error::ReadError;
use ::image::DynamicImage;
use std::path::Path;

/// Samples of 16 bits that do not go beyond this may be those of a camera with 12.
const TWELVE_BITS: u16 = 4095;

/// The decoded sample that stands for the level 255. The decoder stretches the samples of a PGM, PPM or PAM from the largest
/// value that the header announces to the full range of 8 or 16 bits.
pub(crate) fn full_scale(
    image: &DynamicImage,
    bytes: &[u8],
    path: &Path,
    bits: Option<u8>,
) -> Result<f64, ReadError> {
    if !is_wide(image) {
        return Ok(255.0);
    }
    let brightest = brightest(image);
    let announced = pnm_maxval(bytes);
    match (bits, announced) {
        (Some(bits), _) => {
            let stretch = announced.map_or(1.0, |maxval| FULL_RANGE / f64::from(maxval));
            let largest = stretch * f64::from((1_u32 << bits.clamp(1, 16)) - 1);
            // Half a sample for the decoder's rounding.
            if f64::from(brightest) > largest + 0.5 {
                return Err(ReadError::TooFewBits {
                    path: path.into(),
                    brightest: (f64::from(brightest) / stretch).round() as u16,
                    bits,
                });
            }
            Ok(largest)
        }
        (None, Some(_)) => Ok(FULL_RANGE),
        (None, None) if brightest > TWELVE_BITS || is_stretched(image) => Ok(FULL_RANGE),
        (None, None) => Err(ReadError::UnclearBits {
            path: path.into(),
            brightest,
            likely: if brightest > 1023 { 12 } else { 10 },
        }),
    }
}

/// The largest sample of 16 bits.
const FULL_RANGE: f64 = 65_535.0;

/// The largest value of a sample that the header of a PGM, PPM or PAM announces.
fn pnm_maxval(bytes: &[u8]) -> Option<u16> {
    let kind = bytes.strip_prefix(b"P")?.first()?;
    // No header is longer; words beyond it are samples.
    let header = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    let lines = header
        .lines()
        .map(|line| line.split('#').next().unwrap_or(""));
    let mut words = lines.flat_map(str::split_ascii_whitespace);
    let word = match kind {
        b'2' | b'3' | b'5' | b'6' => words.nth(3),
        b'7' => words.skip_while(|word| *word != "MAXVAL").nth(1),
        _ => None,
    };
    word?.parse().ok().filter(|&maxval| maxval > 0)
}

pub(crate) fn is_wide(image: &DynamicImage) -> bool {
    image.color().bytes_per_pixel() / image.color().channel_count() > 1
}

/// Whether every sample is a multiple of 257, as where a program stored 8 bits in 16: those of a camera with more bits are not.
fn is_stretched(image: &DynamicImage) -> bool {
    let samples = match image {
        DynamicImage::ImageLuma16(i) => i.as_raw(),
        DynamicImage::ImageLumaA16(i) => i.as_raw(),
        DynamicImage::ImageRgb16(i) => i.as_raw(),
        DynamicImage::ImageRgba16(i) => i.as_raw(),
        _ => return false,
    };
    samples.iter().all(|sample| sample.is_multiple_of(257))
}

/// The largest sample of 16 bits, of any colour.
fn brightest(image: &DynamicImage) -> u16 {
    let largest = |samples: &[u16], channels: usize, colours: usize| {
        let pixels = samples.chunks(channels);
        pixels.flat_map(|p| p.iter().take(colours)).copied().max()
    };
    let found = match image {
        DynamicImage::ImageLuma16(i) => largest(i.as_raw(), 1, 1),
        DynamicImage::ImageLumaA16(i) => largest(i.as_raw(), 2, 1),
        DynamicImage::ImageRgb16(i) => largest(i.as_raw(), 3, 3),
        DynamicImage::ImageRgba16(i) => largest(i.as_raw(), 4, 3),
        _ => None,
    };
    found.unwrap_or(u16::MAX)
}
