//! The noise of frames and of their differences.

use ndarray::ArrayView2;
use tactile_core::{Requirement, vectorised};

use crate::error::ForceError;

/// Variance of one pixel of one frame: read variance + gain × grey level, in squared grey levels.
///
/// The read variance includes the 1/12 of rounding to integer grey levels. The gain of the camera
/// is in grey levels per photoelectron: the variance of the shot noise at a grey level g is gain ×
/// g.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{NoiseModel, ReferenceFrame};
///
/// let camera = NoiseModel::new(1.5, 0.02)?;
/// // 1.5² of reading, 1/12 of rounding, 0.02 × 100 of photons.
/// assert!((camera.variance(100.0) - (2.25 + 1.0 / 12.0 + 2.0)).abs() < 1e-12);
/// // A uniform image shows no noise except rounding.
/// let even = ReferenceFrame::new(Array2::from_elem((32, 32), 9).view())?;
/// assert_eq!(even.noise().read_variance, 1.0 / 12.0);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct NoiseModel {
    /// Variance at grey level zero, in squared grey levels. At least 1/12.
    pub read_variance: f64,
    /// Growth of the variance per grey level, in grey levels.
    pub gain: f64,
}

/// Variance of one pixel's difference frame − reference: background + gain × difference, in squared
/// grey levels. Also the variances of errors common to all pixels.
///
/// ```
/// use tactile_force::DifferenceNoise;
///
/// let mut noise = DifferenceNoise::white(4.0);
/// noise.gain = 0.02;
/// // The variance of a pixel that is 100 grey levels brighter in a contact.
/// assert_eq!(noise.background + noise.gain * 100.0, 6.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct DifferenceNoise {
    /// Variance outside contacts, of frame and reference together.
    pub background: f64,
    /// Growth of the variance per grey level of difference.
    pub gain: f64,
    /// Variance of a background error common to all pixels, from the drift correction.
    pub common: f64,
    /// Variance of a relative error of the whole signal, from the illumination correction.
    pub scale: f64,
    /// Variance of a relative error of the whole signal, from the vignetting correction.
    pub flat_field: f64,
}

impl DifferenceNoise {
    /// Equal variance for all pixels, in squared grey levels, without common errors.
    ///
    /// ```
    /// assert_eq!(tactile_force::DifferenceNoise::white(4.0).gain, 0.0);
    /// ```
    #[must_use]
    pub const fn white(background: f64) -> Self {
        Self {
            background,
            gain: 0.0,
            common: 0.0,
            scale: 0.0,
            flat_field: 0.0,
        }
    }
}

/// Variance of rounding to integers.
pub(crate) const QUANTISATION: f64 = 1.0 / 12.0;

impl NoiseModel {
    /// Creates the model from the standard deviation of the read noise (without rounding) and the
    /// gain.
    ///
    /// # Errors
    /// An error if either is negative or not finite.
    pub fn new(read_sd: f64, gain: f64) -> Result<Self, ForceError> {
        Requirement::NonNegative.check("read_sd", read_sd)?;
        Requirement::NonNegative.check("gain", gain)?;
        Ok(Self {
            read_variance: read_sd * read_sd + QUANTISATION,
            gain,
        })
    }

    /// Variance of a pixel at a grey level.
    pub fn variance(&self, grey_level: f64) -> f64 {
        self.read_variance + self.gain * grey_level.max(0.0)
    }

    /// White noise of a frame without contact, from its second differences in both directions.
    ///
    /// The response of the filter [1 −2 1; −2 4 −2; 1 −2 1] has 36 times the variance of a pixel
    /// and vanishes for a quadratic background (Immerkær 1996). Responses beyond three standard
    /// deviations are dropped repeatedly, and the remaining variance is corrected for the truncated
    /// tails.
    pub(crate) fn of_frame(frame: ArrayView2<'_, u8>) -> Self {
        let columns = frame.ncols();
        let mut counts = Counts::new();
        let mut lines = [0, 1, 2].map(|_| vec![0_i16; columns]);
        let mut scratch = [vec![0_i16; columns], vec![0_i16; columns]];
        vectorised(
            #[inline(always)]
            || {
                for (row, pixels) in frame.rows().into_iter().enumerate() {
                    lines.rotate_left(1);
                    match pixels.as_slice() {
                        Some(pixels) => widen(pixels.iter(), &mut lines[2]),
                        None => widen(pixels.iter(), &mut lines[2]),
                    }
                    if row >= 2 && columns >= 3 {
                        counts.add(respond(&lines, &mut scratch));
                    }
                }
            },
        );
        let histogram = counts.histogram();
        Self {
            read_variance: (trimmed_variance(&histogram) / 36.0).max(QUANTISATION),
            gain: 0.0,
        }
    }

    /// White noise from repeated frames of one scene, from the changes of each pixel about its
    /// mean.
    pub(crate) fn of_repeats(frames: &[ArrayView2<'_, u8>], mean: ArrayView2<'_, f32>) -> Self {
        let mut squares = 0.0;
        for frame in frames {
            squares += frame
                .iter()
                .zip(mean)
                .map(|(f, m)| (f64::from(*f) - f64::from(*m)).powi(2))
                .sum::<f64>();
        }
        let variance = squares / (mean.len() * (frames.len() - 1)) as f64;
        Self {
            read_variance: variance.max(QUANTISATION),
            gain: 0.0,
        }
    }
}

#[inline(always)]
pub(crate) fn widen<'a>(pixels: impl Iterator<Item = &'a u8>, levels: &mut [i16]) {
    for (level, pixel) in levels.iter_mut().zip(pixels) {
        *level = i16::from(*pixel);
    }
}

/// Absolute responses of the middle one of three rows, without its two ends. Rows have at least
/// three pixels.
#[inline(always)]
pub(crate) fn respond<'a>(
    [above, here, below]: &[Vec<i16>; 3],
    [bends, responses]: &'a mut [Vec<i16>; 2],
) -> &'a [i16] {
    for (((bend, a), h), b) in bends.iter_mut().zip(above).zip(here).zip(below) {
        *bend = a - 2 * h + b;
    }
    let beside = bends.iter().zip(&bends[1..]).zip(&bends[2..]);
    for (response, ((left, middle), right)) in responses.iter_mut().zip(beside) {
        *response = (left - 2 * middle + right).abs();
    }
    &responses[..bends.len() - 2]
}

/// Responses below this are counted two at a time.
pub(crate) const SMALL: u16 = 64;

/// Counts of a frame's responses. If two neighbours are both small, as nearly all are, they are
/// counted in a joint bin. This halves the writes, which limit the speed.
pub(crate) struct Counts {
    pairs: Vec<u32>,
    single: Vec<u32>,
}

impl Counts {
    pub(crate) fn new() -> Self {
        Self {
            pairs: vec![0; usize::from(SMALL).pow(2)],
            // Range of absolute responses of second differences: up to 16 × 255.
            single: vec![0; 4081],
        }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, responses: &[i16]) {
        let (pairs, rest) = responses.as_chunks::<2>();
        for pair in pairs {
            let [a, b] = pair.map(i16::cast_unsigned);
            if a | b < SMALL {
                self.pairs[usize::from(a * SMALL + b)] += 1;
            } else {
                self.single[usize::from(a)] += 1;
                self.single[usize::from(b)] += 1;
            }
        }
        for a in rest {
            self.single[usize::from(a.cast_unsigned())] += 1;
        }
    }

    /// Number of responses with each absolute value.
    pub(crate) fn histogram(&self) -> Vec<u64> {
        let mut counts: Vec<u64> = self.single.iter().map(|&n| u64::from(n)).collect();
        let small = usize::from(SMALL);
        for (pair, &n) in self.pairs.iter().enumerate() {
            counts[pair / small] += u64::from(n);
            counts[pair % small] += u64::from(n);
        }
        counts
    }
}

/// Variance of a normal sample given as a histogram of absolute values, without values beyond 3 sd.
pub(crate) fn trimmed_variance(histogram: &[u64]) -> f64 {
    // Variance of a standard normal truncated at ±3: 1 − 6 φ(3)/(2Φ(3) − 1).
    const CUT: f64 = 0.973_336_950_7;
    let mut variance = f64::INFINITY;
    for _ in 0..50 {
        let limit = 3.0 * variance.sqrt();
        let (mut count, mut total) = (0.0, 0.0);
        for (value, &n) in histogram
            .iter()
            .enumerate()
            .take_while(|(v, _)| *v as f64 <= limit)
        {
            count += n as f64;
            total += n as f64 * (value * value) as f64;
        }
        if count == 0.0 {
            return 0.0;
        }
        let next = total / count / if variance.is_finite() { CUT } else { 1.0 };
        // Truncation only reduces the variance. The first value that is not smaller ends the loop.
        if next >= variance {
            break;
        }
        variance = next;
    }
    variance
}

#[cfg(test)]
#[path = "noise_tests.rs"]
mod tests;
