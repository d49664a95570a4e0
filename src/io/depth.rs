//! What a sample of a decoded image says of the level it stands for.
use super::error::ReadError;
use ::image::DynamicImage;
use std::path::Path;

/// Samples of 16 bits that do not go beyond this may be those of a camera with 12.
const TWELVE_BITS: u16 = 4095;

/// The decoded sample that stands for the level 255. The decoder stretches the samples of a PGM, PPM or PAM from the largest
/// value that the header announces to the full range of 8 or 16 bits.
pub fn full_scale(
    image: &DynamicImage,
    bytes: &[u8],
    path: &Path,
    bits: Option<u8>,
) -> Result<f64, ReadError> {
    let Samples::Sixteen(samples) = Samples::of(image) else {
        return Ok(255.0);
    };
    let brightest = brightest(samples, usize::from(image.color().channel_count()));
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
        (None, None) if brightest > TWELVE_BITS || is_stretched(samples) => Ok(FULL_RANGE),
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

/// The samples of a decoded image, pixel by pixel.
#[derive(Clone, Copy)]
pub enum Samples<'a> {
    Eight(&'a [u8]),
    Sixteen(&'a [u16]),
}

impl<'a> Samples<'a> {
    pub fn of(image: &'a DynamicImage) -> Self {
        match image {
            DynamicImage::ImageLuma16(i) => Self::Sixteen(i.as_raw()),
            DynamicImage::ImageLumaA16(i) => Self::Sixteen(i.as_raw()),
            DynamicImage::ImageRgb16(i) => Self::Sixteen(i.as_raw()),
            DynamicImage::ImageRgba16(i) => Self::Sixteen(i.as_raw()),
            // None of the formats that are read has samples of another kind (floats).
            image => Self::Eight(image.as_bytes()),
        }
    }

    /// Bits of a sample.
    pub fn bits(self) -> u8 {
        match self {
            Self::Eight(_) => 8,
            Self::Sixteen(_) => 16,
        }
    }
}

/// Whether every sample is a multiple of 257, as where a program stored 8 bits in 16: those of a camera with more bits are not.
fn is_stretched(samples: &[u16]) -> bool {
    samples.iter().all(|sample| sample.is_multiple_of(257))
}

/// The largest sample of a pixel's colours.
fn brightest(samples: &[u16], channels: usize) -> u16 {
    let colours = if channels < 3 { 1 } else { 3 };
    let pixels = samples.chunks_exact(channels);
    let found = pixels.flat_map(|p| &p[..colours]).copied().max();
    found.unwrap_or(u16::MAX)
}
