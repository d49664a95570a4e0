//! Photon, read and quantisation noise.

use ndarray::ArrayView2;

use crate::error::{ForceError, Requirement};

/// Variance of one pixel of one frame: read variance + gain × grey level, in squared grey levels.
///
/// The read variance includes the 1/12 of rounding to whole grey levels. The gain is the camera's: grey levels per
/// photoelectron, so that the shot noise of a grey level g is gain × g.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{NoiseModel, ReferenceFrame};
///
/// let camera = NoiseModel::new(1.5, 0.02)?;
/// // 1.5² of reading, 1/12 of rounding, 0.02 × 100 of photons.
/// assert!((camera.variance(100.0) - (2.25 + 1.0 / 12.0 + 2.0)).abs() < 1e-12);
/// // An even image shows no noise but its rounding.
/// let even = ReferenceFrame::new(Array2::from_elem((32, 32), 9).view())?;
/// assert_eq!(even.noise().read_variance, 1.0 / 12.0);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NoiseModel {
    /// Variance at grey level zero, in squared grey levels; at least 1/12.
    pub read_variance: f64,
    /// Growth of the variance per grey level, in grey levels.
    pub gain: f64,
}

/// Variance of one pixel's difference frame − reference, background + gain × difference in squared grey levels, and the
/// variances of errors that all pixels share.
///
/// ```
/// use tactile_force::DifferenceNoise;
///
/// let noise = DifferenceNoise { background: 4.0, gain: 0.02, common: 0.0, scale: 0.0, flat_field: 0.0 };
/// // The variance of a pixel that contact has made 100 grey levels brighter.
/// assert_eq!(noise.background + noise.gain * 100.0, 6.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DifferenceNoise {
    /// Variance outside the contact, of frame and reference together.
    pub background: f64,
    /// Growth of the variance per grey level of difference.
    pub gain: f64,
    /// Variance of a background error common to all pixels, from the correction of drift.
    pub common: f64,
    /// Variance of a relative error of the whole signal, from the correction of illumination.
    pub scale: f64,
    /// Variance of a relative error of the whole signal, from the correction for vignetting.
    pub flat_field: f64,
}

/// Variance of rounding to whole numbers.
pub(crate) const QUANTISATION: f64 = 1.0 / 12.0;

/// Absolute values that the response of a frame's second differences may have: up to 16 × 255.
const RESPONSES: usize = 4081;

impl NoiseModel {
    /// From the standard deviation of the read noise (rounding excluded) and the gain.
    ///
    /// # Errors
    /// Either is negative or not finite.
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
    /// The response of [1 −2 1; −2 4 −2; 1 −2 1] has 36 times the variance of a pixel and none of a quadratic background
    /// (Immerkær 1996). Responses beyond three standard deviations are left out, again and again, and the variance of
    /// what stays is corrected for the cut tails.
    pub(super) fn of_frame(frame: ArrayView2<'_, u8>) -> Self {
        let columns = frame.ncols();
        // Counting one value again and again waits for memory; in turn in several histograms it does not.
        let mut histograms = [[0_u32; RESPONSES]; 4];
        let mut lines = [0, 1, 2].map(|_| vec![0_i16; columns]);
        let (mut bends, mut responses) = (vec![0_i16; columns], Vec::with_capacity(columns));
        for (row, pixels) in frame.rows().into_iter().enumerate() {
            let [above, here, below] = &mut lines;
            std::mem::swap(above, here);
            std::mem::swap(here, below);
            for (level, pixel) in below.iter_mut().zip(&pixels) {
                *level = i16::from(*pixel);
            }
            if row < 2 || columns < 3 {
                continue;
            }
            for (x, bend) in bends.iter_mut().enumerate() {
                *bend = above[x] - 2 * here[x] + below[x];
            }
            let (left, middle, right) = (&bends[..columns - 2], &bends[1..], &bends[2..]);
            let beside = left.iter().zip(middle).zip(right);
            responses.clear();
            responses.extend(beside.map(|((l, m), r)| (l - 2 * m + r).unsigned_abs()));
            for responses in responses.chunks(histograms.len()) {
                for (histogram, &response) in histograms.iter_mut().zip(responses) {
                    histogram[usize::from(response)] += 1;
                }
            }
        }
        let [a, b, c, d] = &histograms;
        let histogram: Vec<u64> = (0..RESPONSES)
            .map(|k| [a, b, c, d].map(|part| u64::from(part[k])).iter().sum())
            .collect();
        Self {
            read_variance: (trimmed_variance(&histogram) / 36.0).max(QUANTISATION),
            gain: 0.0,
        }
    }

    /// White noise of repeated frames of one scene, from the changes of every pixel about its mean.
    pub(super) fn of_repeats(frames: &[ArrayView2<'_, u8>], mean: ArrayView2<'_, f32>) -> Self {
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

/// Variance of a normal sample given as a histogram of absolute values, with everything beyond 3 sd left out.
pub(crate) fn trimmed_variance(histogram: &[u64]) -> f64 {
    /// Variance of a standard normal cut at ±3: 1 − 6 φ(3)/(2Φ(3) − 1).
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
        if next >= variance {
            break;
        }
        variance = next;
    }
    variance
}
