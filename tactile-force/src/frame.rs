//! The one pass over a frame, the reference it is compared with, and the noise of both.

use std::ops::Range;

use nalgebra::{SMatrix, SVector};
use ndarray::{Array2, ArrayView2};
use tactile_core::{BoundingBox, Requirement, vectorised};

use crate::error::ForceError;

/// The sum of the signed difference d = frame − reference of a whole frame, exact in integers, and
/// where it is large.
///
/// Differences keep their sign: clamping the negative ones to zero would turn noise into force.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::ReferenceFrame;
///
/// let mut frame = Array2::from_elem((40, 40), 7_u8);
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![10..13, 20..29]).fill(107);
/// frame[[0, 0]] = 5;
/// let statistics = reference.compare(frame.view(), 10)?;
/// assert_eq!(statistics.sum, 2698);
/// let found = statistics.bounding_box.expect("pixels above the threshold");
/// assert_eq!((found.rows(), found.columns()), (3, 9));
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FrameStatistics {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Σ d.
    pub sum: i64,
    /// Number of pixels of the frame at 255.
    pub saturated: usize,
    /// Box around every pixel with |d| above the threshold. `None` if there is none.
    pub bounding_box: Option<BoundingBox>,
}

/// Variance of one pixel of one frame: read variance + gain × grey level, in squared grey levels.
///
/// The read variance includes the 1/12 of rounding to whole grey levels. The gain is the camera's:
/// grey levels per photoelectron, so that the shot noise of a grey level g is gain × g.
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
    /// Variance at grey level zero, in squared grey levels. At least 1/12.
    pub read_variance: f64,
    /// Growth of the variance per grey level, in grey levels.
    pub gain: f64,
}

/// Variance of one pixel's difference frame − reference, background + gain × difference in squared
/// grey levels, and the variances of errors that all pixels share.
///
/// ```
/// use tactile_force::DifferenceNoise;
///
/// let noise = DifferenceNoise { gain: 0.02, ..DifferenceNoise::white(4.0) };
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

impl DifferenceNoise {
    /// The same variance for every pixel, in squared grey levels, and no error in common.
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

/// Variance of rounding to whole numbers.
pub const QUANTISATION: f64 = 1.0 / 12.0;

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
    /// The response of [1 −2 1. −2 4 −2. 1 −2 1] has 36 times the variance of a pixel and none of a
    /// quadratic background (Immerkær 1996). Responses beyond three standard deviations are left
    /// out, again and again, and the variance of what stays is corrected for the cut tails.
    fn of_frame(frame: ArrayView2<'_, u8>) -> Self {
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

    /// White noise of repeated frames of one scene, from the changes of every pixel about its mean.
    fn of_repeats(frames: &[ArrayView2<'_, u8>], mean: ArrayView2<'_, f32>) -> Self {
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
fn widen<'a>(pixels: impl Iterator<Item = &'a u8>, levels: &mut [i16]) {
    for (level, pixel) in levels.iter_mut().zip(pixels) {
        *level = i16::from(*pixel);
    }
}

/// Absolute responses of the middle one of three rows, of at least three pixels, without its ends.
#[inline(always)]
fn respond<'a>(
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

/// Responses below this are counted in pairs.
const SMALL: u16 = 64;

/// Counts of a frame's responses. Two neighbours that are both small, as nearly all are, are
/// counted in one place: half the writes, which are what counting waits for.
struct Counts {
    pairs: Vec<u32>,
    single: Vec<u32>,
}

impl Counts {
    fn new() -> Self {
        Self {
            pairs: vec![0; usize::from(SMALL).pow(2)],
            // Absolute values that the response of a frame's second differences may have: up to 16
            // × 255.
            single: vec![0; 4081],
        }
    }

    #[inline(always)]
    fn add(&mut self, responses: &[i16]) {
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

    /// Responses of every absolute value.
    fn histogram(&self) -> Vec<u64> {
        let mut counts: Vec<u64> = self.single.iter().map(|&n| u64::from(n)).collect();
        let small = usize::from(SMALL);
        for (pair, &n) in self.pairs.iter().enumerate() {
            counts[pair / small] += u64::from(n);
            counts[pair % small] += u64::from(n);
        }
        counts
    }
}

/// Variance of a normal sample given as a histogram of absolute values, with everything beyond 3 sd
/// left out.
pub fn trimmed_variance(histogram: &[u64]) -> f64 {
    // Variance of a standard normal cut at ±3: 1 − 6 φ(3)/(2Φ(3) − 1).
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
        // The variance only falls while tails are cut. The first that does not ends the cutting.
        if next >= variance {
            break;
        }
        variance = next;
    }
    variance
}

/// Brightness relative to the frame's middle: a quadratic L(x, y) in x and y, least squares over
/// the tiles of a reference frame.
///
/// Where stray light reaches the camera through the same lens as the signal, the reference shows
/// the vignetting of both.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::ReferenceFrame;
///
/// // Darker towards the corners, by a fifth.
/// let image = Array2::from_shape_fn((240, 320), |(y, x)| {
///     let (u, v) = ((x as f64 - 159.5) / 159.5, (y as f64 - 119.5) / 119.5);
///     (200.0 * (1.0 - 0.1 * (u * u + v * v))).round() as u8
/// });
/// let flat = ReferenceFrame::new(image.view())?
///     .with_flat_field()?
///     .flat_field()
///     .expect("asked for");
/// // L = Σ c_k (1, u, v, u², uv, v²)_k: 0.8 in the corner u = v = −1.
/// let [c, u, v, uu, uv, vv] = flat.coefficients;
/// assert!((c - u - v + uu + uv + vv - 0.8).abs() < 3e-3 && c == 1.0);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FlatField {
    /// Coefficients of 1, u, v, u², uv, v², with u and v running from −1 to 1 over the frame. The
    /// first is 1.
    pub coefficients: [f64; 6],
    middle: [f64; 2],
    /// Covariance of the unscaled coefficients over the square of the first.
    covariance: [[f64; 6]; 6],
}

/// The relative brightness along one row, a parabola.
#[derive(Clone, Copy, Debug)]
pub struct FlatLine([f64; 3]);

impl FlatLine {
    /// At `x` columns from the line's start.
    #[inline(always)]
    pub fn at(&self, x: usize) -> f32 {
        // Frames are narrower than 2³¹, and this conversion has wide instructions.
        let x = f64::from(x as i32);
        (self.0[0] + x * (self.0[1] + x * self.0[2])) as f32
    }
}

impl FlatField {
    /// `None` if the reference is black or has too few tiles for six coefficients. `variance` is
    /// that of one pixel of the reference.
    fn fit(
        (rows, columns): (usize, usize),
        tiles: impl Iterator<Item = TileSum>,
        variance: f64,
    ) -> Option<Self> {
        let middle = [0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0)];
        let (mut normal, mut right) = (SMatrix::<f64, 6, 6>::zeros(), SVector::<f64, 6>::zeros());
        for tile in tiles {
            let terms = SVector::<f64, 6>::from(terms(middle, tile.x, tile.y));
            normal += terms * terms.transpose() * tile.pixels;
            right += terms * tile.reference;
        }
        let cholesky = normal.cholesky()?;
        let (found, inverse) = (cholesky.solve(&right), cholesky.inverse());
        // Relative to the frame's middle, where u and v are zero.
        let level = found[0];
        (level > 0.0).then(|| Self {
            coefficients: std::array::from_fn(|k| found[k] / level),
            middle,
            covariance: std::array::from_fn(|i| {
                std::array::from_fn(|j| inverse[(i, j)] * variance / (level * level))
            }),
        })
    }

    /// Variance of the relative brightness at a pixel: the ratio of two correlated levels.
    pub(crate) fn variance_at(&self, x: f64, y: f64) -> f64 {
        let mut by = terms(self.middle, x, y);
        // The level in the middle appears in numerator and denominator of the ratio.
        by[0] -= self.at(x, y);
        let row = |i: usize| {
            by.iter()
                .zip(&self.covariance[i])
                .map(|(b, c)| b * c)
                .sum::<f64>()
        };
        by.iter().enumerate().map(|(i, b)| b * row(i)).sum()
    }

    /// Relative brightness at a pixel.
    pub(crate) fn at(&self, x: f64, y: f64) -> f64 {
        terms(self.middle, x, y)
            .iter()
            .zip(&self.coefficients)
            .map(|(t, c)| t * c)
            .sum()
    }

    pub(crate) fn line(&self, row: usize, first_column: usize) -> FlatLine {
        let (x, y, wide) = (first_column as f64, row as f64, self.middle[0].max(1.0));
        let bend = self.coefficients[3] / (wide * wide);
        let slope = self.at(x + 1.0, y) - self.at(x, y) - bend;
        FlatLine([self.at(x, y), slope, bend])
    }
}

fn terms(middle: [f64; 2], x: f64, y: f64) -> [f64; 6] {
    let (u, v) = (
        (x - middle[0]) / middle[0].max(1.0),
        (y - middle[1]) / middle[1].max(1.0),
    );
    [1.0, u, v, u * u, u * v, v * v]
}

/// Longest side for which every integer sum of the pass fits its type: 16384⁴/3 · 255 < 2⁶³.
const LONGEST_SIDE: usize = 16_384;

/// A frame of the unpressed sensor, its noise and its sums, prepared once and compared with many
/// frames.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{NoiseModel, ReferenceFrame};
///
/// let frames = [20_u8, 21, 22].map(|grey| Array2::from_elem((40, 50), grey));
/// let reference = ReferenceFrame::from_frames(&frames.each_ref().map(|f| f.view()))?;
/// assert_eq!(reference.image()[[0, 0]], 21);
/// // Each pixel changed by one grey level from frame to frame.
/// assert!((reference.noise().read_variance - 1.0).abs() < 1e-9);
/// let known = reference.with_noise(NoiseModel::new(1.2, 0.01)?);
/// assert_eq!(known.noise().gain, 0.01);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ReferenceFrame {
    image: Array2<u8>,
    /// The mean of several frames, finer than whole grey levels. One frame is its own.
    mean: Option<Array2<f32>>,
    frames: usize,
    noise: NoiseModel,
    /// Whether the gain was given, and not only the noise at the reference's own level measured.
    gain_known: bool,
    flat: Option<FlatField>,
    /// Σ of the image.
    sum: i64,
    tiles: Tiles,
    /// Places, pixels and sums of all tiles, for frames that differ nowhere.
    blank: Vec<TileSum>,
}

/// Buffers of the pass.
#[derive(Clone, Debug, Default)]
pub struct PassWorkspace {
    /// Σ (frame − reference) of every tile.
    pub tiles: Tiles,
    /// A copy of frames that are not in standard layout.
    copy: Vec<u8>,
    /// Eight rows at work.
    band: Vec<u8>,
}

impl ReferenceFrame {
    /// From one frame. Its noise is estimated from its second differences in both directions.
    ///
    /// # Errors
    /// An empty image, or a side longer than 16384 pixels.
    pub fn new(image: ArrayView2<'_, u8>) -> Result<Self, ForceError> {
        Self::from_frames(&[image])
    }

    /// From the mean of several frames of the unpressed sensor: its own noise falls with their
    /// number, and the noise of a frame is that of each pixel from frame to frame, whatever the
    /// texture of the image.
    ///
    /// # Errors
    /// No frame, an empty one, a side longer than 16384 pixels, or frames that differ in size.
    pub fn from_frames(frames: &[ArrayView2<'_, u8>]) -> Result<Self, ForceError> {
        let size = common_size(frames)?;
        let mean = (frames.len() > 1).then(|| mean_of(frames, size));
        // To the nearest, halves upwards: exact, and the standard library's rounding is a function
        // call a pixel.
        let image = match &mean {
            None => frames[0].as_standard_layout().into_owned(),
            Some(mean) => mean.mapv(|m| (f64::from(m) + 0.5) as u8),
        };
        let noise = match &mean {
            None => NoiseModel::of_frame(frames[0]),
            Some(mean) => NoiseModel::of_repeats(frames, mean.view()),
        };
        let mut tiles = Tiles::default();
        let pixels = image.as_slice().unwrap_or_default();
        scan(pixels, size, &mut tiles, &mut Vec::new());
        let sum = tiles.total();
        if let Some(mean) = &mean {
            sum_means(mean.view(), &mut tiles);
        }
        let blank = (0..tiles.sums.len()).map(|k| tiles.blank(k, size));
        Ok(Self {
            image,
            mean,
            frames: frames.len(),
            noise,
            gain_known: false,
            flat: None,
            sum,
            blank: blank.collect(),
            tiles,
        })
    }

    /// The same reference with a known noise instead of the estimated one.
    pub fn with_noise(mut self, noise: NoiseModel) -> Self {
        self.noise = noise;
        self.gain_known = true;
        self
    }

    /// Corrects every difference for vignetting: divides it by the brightness that the reference
    /// itself has there, relative to the frame's middle, smoothed to a quadratic. A calibration
    /// then holds wherever the contact lies.
    ///
    /// Right where stray light and signal come through the same lens.
    ///
    /// # Errors
    /// The reference is too dark to show vignetting: its mean is below one grey level.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::ReferenceFrame;
    ///
    /// let even = ReferenceFrame::new(Array2::from_elem((80, 120), 40_u8).view())?;
    /// assert!(even.flat_field().is_none());
    /// let coefficients = even.with_flat_field()?.flat_field().expect("asked for").coefficients;
    /// assert!(coefficients[0] == 1.0 && coefficients[1..].iter().all(|c| c.abs() < 1e-9));
    /// // A black reference shows no vignetting.
    /// assert!(ReferenceFrame::new(Array2::zeros((80, 120)).view())?.with_flat_field().is_err());
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn with_flat_field(mut self) -> Result<Self, ForceError> {
        let mean = self.mean_grey();
        let too_dark = ForceError::ReferenceTooDark {
            mean,
            required: 1.0,
        };
        let flat = FlatField::fit(
            self.image.dim(),
            (0..self.tiles.sums.len()).map(|k| self.tile_sum(&self.tiles, k)),
            self.own_variance(),
        )
        .filter(|_| mean >= 1.0);
        self.flat = Some(flat.ok_or(too_dark)?);
        Ok(self)
    }

    /// The correction for vignetting, if it was asked for.
    pub fn flat_field(&self) -> Option<FlatField> {
        self.flat
    }

    /// The image. The mean of several frames, rounded.
    pub fn image(&self) -> ArrayView2<'_, u8> {
        self.image.view()
    }

    /// Noise of one pixel of one frame.
    pub fn noise(&self) -> NoiseModel {
        self.noise
    }

    /// Compares a frame with the reference: one pass over both, O(pixels), exact.
    ///
    /// # Errors
    /// The frame has not the reference's size.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::ReferenceFrame;
    /// let reference = ReferenceFrame::new(Array2::from_elem((40, 50), 7).view())?;
    /// let mut frame = Array2::from_elem((40, 50), 7);
    /// frame[[20, 30]] = 107;
    /// let statistics = reference.compare(frame.view(), 10)?;
    /// assert_eq!(statistics.sum, 100);
    /// let at = statistics.bounding_box.expect("a pixel above the threshold");
    /// assert_eq!((at.row_start, at.column_start), (20, 30));
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn compare(
        &self,
        frame: ArrayView2<'_, u8>,
        threshold: u8,
    ) -> Result<FrameStatistics, ForceError> {
        self.check(frame)?;
        Ok(self.compare_with(&mut PassWorkspace::default(), frame, threshold))
    }

    /// The pass proper. The frame has the reference's size.
    pub(crate) fn compare_with(
        &self,
        workspace: &mut PassWorkspace,
        frame: ArrayView2<'_, u8>,
        threshold: u8,
    ) -> FrameStatistics {
        let PassWorkspace { tiles, copy, band } = workspace;
        let pixels = frame.to_slice().unwrap_or_else(|| {
            copy.clear();
            copy.extend(frame.iter());
            copy
        });
        let saturated = scan(pixels, frame.dim(), tiles, band);
        let sum = tiles.total() - self.sum;
        let image = self.image.as_slice().unwrap_or_default();
        let pair = Pair {
            frame: Tiled {
                image: pixels,
                tiles,
            },
            reference: Tiled {
                image,
                tiles: &self.tiles,
            },
            size: frame.dim(),
        };
        let bounding_box = pair
            .tiles_above(threshold)
            .map(|b| tighten(b, [pixels, image], frame.ncols(), threshold));
        tiles
            .sums
            .iter_mut()
            .zip(&self.tiles.sums)
            .for_each(|(f, r)| *f -= r);
        FrameStatistics {
            rows: frame.nrows(),
            columns: frame.ncols(),
            sum,
            saturated,
            bounding_box,
        }
    }

    /// The image before rounding.
    pub(crate) fn levels(&self) -> Levels<'_> {
        match &self.mean {
            None => Levels::Whole(self.image.view()),
            Some(mean) => Levels::Fine(mean.view()),
        }
    }

    /// Mean grey level of the image.
    pub(crate) fn mean_grey(&self) -> f64 {
        self.sum as f64 / self.image.len() as f64
    }

    /// Variance of one pixel's difference frame − reference where nothing presses.
    pub(crate) fn difference_variance(&self) -> f64 {
        // One frame's variance and the mean's, which is a share 1/n of it.
        self.own_variance() * (self.frames as f64 + 1.0)
    }

    /// Variance of one pixel of the reference.
    fn own_variance(&self) -> f64 {
        self.noise.variance(self.mean_grey()) / self.frames as f64
    }

    /// The gain, if it was given.
    pub(crate) fn known_gain(&self) -> Option<f64> {
        self.gain_known.then_some(self.noise.gain)
    }

    /// Every tile of the last pass. `None` if that was of a frame of another size, or none.
    pub(crate) fn tile_sums<'a>(
        &'a self,
        passed: &'a Tiles,
    ) -> Option<impl Iterator<Item = TileSum> + Clone + 'a> {
        let same = (passed.rows, passed.columns) == (self.tiles.rows, self.tiles.columns);
        let both = self.blank.iter().zip(&passed.sums);
        same.then(|| {
            both.map(|(blank, sum)| TileSum {
                difference: f64::from(*sum),
                ..*blank
            })
        })
    }

    /// One tile of the last pass.
    #[inline]
    pub(crate) fn tile_sum(&self, passed: &Tiles, tile: usize) -> TileSum {
        TileSum {
            difference: f64::from(passed.sums[tile]),
            ..self.blank[tile]
        }
    }

    pub(crate) fn check(&self, frame: ArrayView2<'_, u8>) -> Result<(), ForceError> {
        let (expected, found) = (self.image.dim(), frame.dim());
        if expected == found {
            Ok(())
        } else {
            Err(ForceError::SizeMismatch { expected, found })
        }
    }
}

/// The grey levels of a reference: those of one frame, or the mean of several.
#[derive(Clone, Copy, Debug)]
pub enum Levels<'a> {
    Whole(ArrayView2<'a, u8>),
    Fine(ArrayView2<'a, f32>),
}

/// The size that all frames have.
fn common_size(frames: &[ArrayView2<'_, u8>]) -> Result<(usize, usize), ForceError> {
    let size = frames.first().map_or((0, 0), |f| f.dim());
    let (rows, columns) = size;
    if rows == 0 || columns == 0 {
        return Err(ForceError::EmptyImage { rows, columns });
    }
    if rows.max(columns) > LONGEST_SIDE {
        return Err(ForceError::ImageTooLarge {
            found: rows.max(columns),
            limit: LONGEST_SIDE,
        });
    }
    match frames.iter().find(|f| f.dim() != size) {
        Some(other) => Err(ForceError::SizeMismatch {
            expected: size,
            found: other.dim(),
        }),
        None => Ok(size),
    }
}

/// The mean of the frames, pixel by pixel.
fn mean_of(frames: &[ArrayView2<'_, u8>], size: (usize, usize)) -> Array2<f32> {
    let n = frames.len() as f64;
    Array2::from_shape_fn(size, |at| {
        let total: u32 = frames.iter().map(|f| u32::from(f[at])).sum();
        (f64::from(total) / n) as f32
    })
}

/// The tiles' sums from the mean of several frames, which is finer than whole grey levels.
fn sum_means(mean: ArrayView2<'_, f32>, tiles: &mut Tiles) {
    for tile in 0..tiles.sums.len() {
        let pixels = tiles.pixels(tile, mean.dim()).of(mean);
        let sum: f64 = pixels.iter().map(|m| f64::from(*m)).sum();
        // Rounded after the summing: half a grey level at most in a sum of 256 pixels.
        tiles.sums[tile] = sum.round() as i32;
    }
}

/// Rows of a tile.
pub const TILE_ROWS: usize = 8;
/// Columns of a tile.
pub const TILE_COLUMNS: usize = 32;

/// The sums of all tiles of a frame, and their darkest and brightest pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tiles {
    pub rows: usize,
    pub columns: usize,
    pub sums: Vec<i32>,
    darkest: Vec<u8>,
    brightest: Vec<u8>,
}

impl Tiles {
    fn reset(&mut self, (rows, columns): (usize, usize)) {
        self.rows = rows.div_ceil(TILE_ROWS);
        self.columns = columns.div_ceil(TILE_COLUMNS);
        self.sums.clear();
        self.sums.resize(self.rows * self.columns, 0);
        // Written by every pass.
        for extremes in [&mut self.darkest, &mut self.brightest] {
            extremes.resize(self.rows * self.columns, 0);
        }
    }

    /// Sum of all tiles.
    fn total(&self) -> i64 {
        self.sums.iter().map(|&sum| i64::from(sum)).sum()
    }

    /// Greatest sum of a band, each times `sign`.
    pub fn greatest(&self, band: usize, sign: i32) -> i32 {
        let sums = &self.sums[band * self.columns..(band + 1) * self.columns];
        sums.iter().map(|s| sign * s).max().unwrap_or(0)
    }

    /// A tile of a reference, and of a frame that does not differ from it.
    fn blank(&self, tile: usize, size: (usize, usize)) -> TileSum {
        let at = self.pixels(tile, size);
        TileSum {
            x: 0.5 * (at.column_start + at.column_end - 1) as f64,
            y: 0.5 * (at.row_start + at.row_end - 1) as f64,
            pixels: (at.rows() * at.columns()) as f64,
            reference: f64::from(self.sums[tile]),
            difference: 0.0,
        }
    }

    /// The pixels of a tile.
    pub fn pixels(&self, tile: usize, (rows, columns): (usize, usize)) -> BoundingBox {
        let (row, column) = (tile / self.columns, tile % self.columns);
        BoundingBox {
            row_start: row * TILE_ROWS,
            row_end: ((row + 1) * TILE_ROWS).min(rows),
            column_start: column * TILE_COLUMNS,
            column_end: ((column + 1) * TILE_COLUMNS).min(columns),
        }
    }
}

/// One tile: its centre, its number of pixels, the reference's sum and the summed difference.
#[derive(Clone, Copy, Debug)]
pub struct TileSum {
    pub x: f64,
    pub y: f64,
    pub pixels: f64,
    pub reference: f64,
    pub difference: f64,
}

/// The tiles of an image in standard layout and of nonzero size, and the number of its pixels at
/// 255. `band` is scratch.
fn scan(image: &[u8], size: (usize, usize), tiles: &mut Tiles, band: &mut Vec<u8>) -> usize {
    tiles.reset(size);
    let mut saturated = 0;
    for (number, rows) in image.chunks(TILE_ROWS * size.1).enumerate() {
        let here = number * tiles.columns..(number + 1) * tiles.columns;
        let brightest = &mut tiles.brightest[here.clone()];
        let of_band = OfTiles {
            sums: &mut tiles.sums[here.clone()],
            darkest: &mut tiles.darkest[here],
            brightest,
        };
        // As memory has them, pixels that come from far arrive in half the time that they take
        // where tiles fetch them from eight rows in turn.
        band.clear();
        band.extend_from_slice(rows);
        summarise_band(band, size.1, of_band);
        if brightest.contains(&u8::MAX) {
            let full = rows.iter().map(|&p| usize::from(p == u8::MAX));
            saturated += full.sum::<usize>();
        }
    }
    saturated
}

/// The tiles of up to eight rows.
fn summarise_band(rows: &[u8], width: usize, mut tiles: OfTiles<'_>) {
    let is_whole = rows.len() == TILE_ROWS * width;
    let whole = if is_whole { width / TILE_COLUMNS } else { 0 };
    if is_whole {
        let row = |k: usize| rows[k * width..(k + 1) * width].as_chunks().0;
        summarise(std::array::from_fn(row), tiles.first(whole));
    }
    // At the image's edges some have fewer rows or columns.
    for tile in whole..tiles.sums.len() {
        let columns = tile * TILE_COLUMNS..width.min((tile + 1) * TILE_COLUMNS);
        let (mut sum, mut darkest, mut brightest) = (0, u8::MAX, 0);
        for row in rows.chunks(width) {
            for &pixel in &row[columns.clone()] {
                sum += i32::from(pixel);
                darkest = darkest.min(pixel);
                brightest = brightest.max(pixel);
            }
        }
        tiles.sums[tile] = sum;
        (tiles.darkest[tile], tiles.brightest[tile]) = (darkest, brightest);
    }
}

/// A row of a tile.
type Row = [u8; TILE_COLUMNS];

/// Eight rows of equal length, in whole tiles.
type Rows<'a> = [&'a [Row]; TILE_ROWS];

/// What a strip receives: Σ f of every tile, and its darkest and brightest pixel.
struct OfTiles<'a> {
    sums: &'a mut [i32],
    darkest: &'a mut [u8],
    brightest: &'a mut [u8],
}

impl OfTiles<'_> {
    /// The first tiles, of this number.
    fn first(&mut self, number: usize) -> OfTiles<'_> {
        OfTiles {
            sums: &mut self.sums[..number],
            darkest: &mut self.darkest[..number],
            brightest: &mut self.brightest[..number],
        }
    }
}

/// Summarises the tiles of a strip by the widest instructions that the processor has: integers, so
/// that no result depends on which.
fn summarise(rows: Rows<'_>, tiles: OfTiles<'_>) {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return simd.vectorize(avx2::Strip { simd, rows, tiles });
    }
    each(&Plain, rows, tiles);
}

/// Tile after tile, so that nothing but its sums leaves the registers: row after row, as memory has
/// the pixels, takes several times as long.
#[inline(always)]
fn each(instructions: &impl Summarise, rows: Rows<'_>, tiles: OfTiles<'_>) {
    let number = tiles.sums.len();
    let rows = rows.map(|row| &row[..number]);
    let (darkest, brightest) = (&mut tiles.darkest[..number], &mut tiles.brightest[..number]);
    for tile in 0..number {
        let (sum, extremes) = instructions.summary(&rows, tile);
        tiles.sums[tile] = sum;
        [darkest[tile], brightest[tile]] = extremes;
    }
}

/// Instructions that summarise a tile.
trait Summarise {
    /// Sum, darkest and brightest pixel of a tile of eight rows.
    fn summary(&self, rows: &Rows<'_>, tile: usize) -> (i32, [u8; 2]);
}

/// Plain loops, which the compiler turns into the instructions that every processor has.
struct Plain;

impl Summarise for Plain {
    #[inline(always)]
    fn summary(&self, rows: &Rows<'_>, tile: usize) -> (i32, [u8; 2]) {
        let (mut low, mut high) = ([u8::MAX; TILE_COLUMNS], [0_u8; TILE_COLUMNS]);
        let mut columns = [0_u16; TILE_COLUMNS];
        for row in rows {
            let f = &row[tile];
            // A loop for every width of numbers: mixed, the bytes fill half a register.
            for j in 0..TILE_COLUMNS {
                low[j] = low[j].min(f[j]);
                high[j] = high[j].max(f[j]);
            }
            for j in 0..TILE_COLUMNS {
                // Eight times 255 fits. Checked, the sum would be taken pixel by pixel.
                columns[j] = columns[j].wrapping_add(u16::from(f[j]));
            }
        }
        let (mut sum, mut darkest, mut brightest) = (0, u8::MAX, 0);
        for j in 0..TILE_COLUMNS {
            sum = i32::wrapping_add(sum, i32::from(columns[j]));
            darkest = low[j].min(darkest);
            brightest = high[j].max(brightest);
        }
        (sum, [darkest, brightest])
    }
}

/// AVX2, whose sum of absolute differences adds eight bytes at once, which no plain loop becomes: a
/// quarter of the plain loops' time.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{__m128i, __m256i};

    use pulp::x86::V3;

    use super::{OfTiles, Rows, Summarise, each};

    pub struct Strip<'a> {
        pub simd: V3,
        pub rows: Rows<'a>,
        pub tiles: OfTiles<'a>,
    }

    impl pulp::NullaryFnOnce for Strip<'_> {
        type Output = ();

        #[inline(always)]
        fn call(self) {
            each(&self.simd, self.rows, self.tiles);
        }
    }

    impl Summarise for V3 {
        #[inline(always)]
        fn summary(&self, rows: &Rows<'_>, tile: usize) -> (i32, [u8; 2]) {
            let (avx, avx2, sse2) = (self.avx, self.avx2, self.sse2);
            let (zero, ones) = (avx._mm256_setzero_si256(), avx._mm256_set1_epi8(-1));
            let (mut low, mut high, mut sums) = (ones, zero, zero);
            for row in rows {
                let pixels: __m256i = pulp::cast(row[tile]);
                low = avx2._mm256_min_epu8(low, pixels);
                high = avx2._mm256_max_epu8(high, pixels);
                sums = avx2._mm256_add_epi64(sums, avx2._mm256_sad_epu8(pixels, zero));
            }
            let [left, right]: [__m128i; 2] = pulp::cast(sums);
            let [even, odd]: [u64; 2] = pulp::cast(sse2._mm_add_epi64(left, right));
            let brightest = !least(*self, avx2._mm256_xor_si256(high, ones));
            ((even + odd) as i32, [least(*self, low), brightest])
        }
    }

    /// The least of 32 bytes.
    #[inline(always)]
    fn least(simd: V3, bytes: __m256i) -> u8 {
        let (sse2, sse4) = (simd.sse2, simd.sse4_1);
        let [left, right]: [__m128i; 2] = pulp::cast(bytes);
        let pairs = sse2._mm_min_epu8(left, right);
        let least_of_pairs = sse2._mm_min_epu8(pairs, sse2._mm_srli_epi16::<8>(pairs));
        sse2._mm_cvtsi128_si32(sse4._mm_minpos_epu16(least_of_pairs)) as u8
    }
}

/// An image in standard layout with its tiles.
#[derive(Clone, Copy)]
struct Tiled<'a> {
    image: &'a [u8],
    tiles: &'a Tiles,
}

/// A frame f beside its reference r, both of the same size (rows, columns).
struct Pair<'a> {
    frame: Tiled<'a>,
    reference: Tiled<'a>,
    size: (usize, usize),
}

impl Pair<'_> {
    /// The box of the tiles in which |f − r| exceeds a threshold.
    fn tiles_above(&self, threshold: u8) -> Option<BoundingBox> {
        let (size, tiles) = (self.size, self.frame.tiles);
        let of_band = |band: usize| {
            let mut here = self.band(band);
            if !self.may_exceed(here.clone(), threshold) {
                return None;
            }
            // Those between the outermost are not looked at.
            let first = here.find(|&tile| self.exceeds(tile, threshold))?;
            let last = here.rfind(|&tile| self.exceeds(tile, threshold));
            let last = last.unwrap_or(first);
            Some(tiles.pixels(first, size).union(tiles.pixels(last, size)))
        };
        (0..tiles.rows)
            .filter_map(of_band)
            .reduce(BoundingBox::union)
    }

    /// The tiles of a band.
    fn band(&self, band: usize) -> Range<usize> {
        let columns = self.frame.tiles.columns;
        band * columns..(band + 1) * columns
    }

    /// Whether |f − r| exceeds a threshold in a tile.
    fn exceeds(&self, tile: usize, threshold: u8) -> bool {
        let [f, r] = [self.frame.tiles, self.reference.tiles];
        let (dark, bright) = (f.darkest[tile], f.brightest[tile]);
        let (darkest, brightest) = (r.darkest[tile], r.brightest[tile]);
        // The extremes of both images decide nearly all tiles without a look at their pixels.
        let most = u8::max(
            bright.saturating_sub(darkest),
            brightest.saturating_sub(dark),
        );
        let least = u8::max(bright.abs_diff(brightest), dark.abs_diff(darkest));
        most > threshold && (least > threshold || self.difference(tile) > threshold)
    }

    /// Whether |f − r| may exceed a threshold in some tiles.
    fn may_exceed(&self, tiles: Range<usize>, threshold: u8) -> bool {
        let [f, r] = [self.frame.tiles, self.reference.tiles];
        let [dark, bright] = [&f.darkest[tiles.clone()], &f.brightest[tiles.clone()]];
        let [darkest, brightest] = [&r.darkest[tiles.clone()], &r.brightest[tiles]];
        excess(bright, darkest).max(excess(brightest, dark)) > threshold
    }

    /// Greatest |f − r| of a tile.
    fn difference(&self, tile: usize) -> u8 {
        let at = self.frame.tiles.pixels(tile, self.size);
        let images = [self.frame.image, self.reference.image];
        vectorised(
            #[inline(always)]
            || {
                let mut greatest = [0_u8; TILE_COLUMNS];
                for row in at.row_start..at.row_end {
                    let first = row * self.size.1;
                    let span = first + at.column_start..first + at.column_end;
                    let [f, r] = images.map(|image| &image[span.clone()]);
                    for ((greatest, f), r) in greatest.iter_mut().zip(f).zip(r) {
                        *greatest = f.abs_diff(*r).max(*greatest);
                    }
                }
                greatest.into_iter().fold(0, u8::max)
            },
        )
    }
}

/// The greatest a − b of two lists of numbers, zero if negative.
fn excess(a: &[u8], b: &[u8]) -> u8 {
    vectorised(
        #[inline(always)]
        || {
            let (a, rest_of_a) = a.as_chunks::<16>();
            let (b, rest_of_b) = b.as_chunks::<16>();
            let mut lanes = [0_u8; 16];
            for (a, b) in a.iter().zip(b) {
                for k in 0..16 {
                    lanes[k] = lanes[k].max(a[k].saturating_sub(b[k]));
                }
            }
            let rest = rest_of_a.iter().zip(rest_of_b);
            let rest = rest.map(|(a, b)| a.saturating_sub(*b));
            lanes.into_iter().chain(rest).fold(0, u8::max)
        },
    )
}

/// Shrinks a box of whole tiles to the pixels with |frame − reference| > threshold. Both images lie
/// in memory row by row.
fn tighten(mut tight: BoundingBox, images: [&[u8]; 2], width: usize, threshold: u8) -> BoundingBox {
    let row = |row: usize, columns: Range<usize>| {
        let span = row * width + columns.start..row * width + columns.end;
        images.map(|image| &image[span.clone()])
    };
    vectorised(
        #[inline(always)]
        || {
            let is_over = |at: usize, tight: &BoundingBox| {
                let [f, r] = row(at, tight.column_start..tight.column_end);
                let differences = f.iter().zip(r).map(|(f, r)| f.abs_diff(*r));
                differences.fold(0, u8::max) > threshold
            };
            while tight.rows() > 1 && !is_over(tight.row_start, &tight) {
                tight.row_start += 1;
            }
            while tight.rows() > 1 && !is_over(tight.row_end - 1, &tight) {
                tight.row_end -= 1;
            }
            // Greatest |frame − reference| of every column of a strip, at most a tile wide.
            let greatest = |strip: Range<usize>| {
                let mut greatest = [0_u8; TILE_COLUMNS];
                for at in tight.row_start..tight.row_end {
                    let [f, r] = row(at, strip.clone());
                    for ((greatest, f), r) in greatest.iter_mut().zip(f).zip(r) {
                        *greatest = f.abs_diff(*r).max(*greatest);
                    }
                }
                greatest.map(|level| level > threshold)
            };
            // The outermost tile of a side has the pixel looked for, or the box had been smaller.
            let (start, end) = (tight.column_start, tight.column_end);
            let width = (end - start).min(TILE_COLUMNS);
            if let Some(at) = greatest(start..start + width)[..width]
                .iter()
                .position(|over| *over)
            {
                tight.column_start = start + at;
            }
            if let Some(at) = greatest(end - width..end)[..width]
                .iter()
                .rposition(|over| *over)
            {
                tight.column_end = end - width + at + 1;
            }
            tight
        },
    )
}

#[cfg(test)]
#[path = "frame_tests.rs"]
mod tests;
