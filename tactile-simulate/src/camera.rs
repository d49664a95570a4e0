//! From light to an 8-bit frame: blur, vignetting, photon and read noise, quantisation and
//! saturation. Each row of each frame has its own random stream.

use crate::error::{SimulateError, at_least, not_negative, positive, within};
use crate::light::Illumination;
use crate::pixel_average::{PixelPatch, PixelPlane};
use ndarray::{Array2, ArrayView2, Axis};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};

/// Number of electrons from which Poisson noise is approximated by a normal distribution (skewness
/// 1/√256 = 0.06).
const NORMAL_FROM_ELECTRONS: f64 = 256.0;

/// The camera's noise in grey levels.
#[derive(Debug, Clone, Copy)]
struct NoiseLaw {
    /// Photon noise: variance over expected grey level, which is one over the number of electrons
    /// per grey level.
    variance_per_grey: f64,
    read_variance: f64,
    /// Grey level from which the normal distribution replaces the Poisson distribution.
    normal_from_grey: f64,
}

/// Camera, lens and stray light.
///
/// ```
/// use tactile_simulate::Camera;
/// let camera = Camera { shape: [200, 300], ..Camera::default() };
/// assert!((camera.pixel_size_m[0] - 21.55e-6).abs() < 1e-8);
/// // 15 000 electrons at 255 grey levels: photon noise √(200/58.8), read noise 0.5 and rounding
/// // add up to 1.93.
/// let light = ndarray::Array2::from_elem((200, 300), 200.0);
/// let mean = |camera: Camera| camera.expose(light.view(), 1, 0).mapv(f64::from).mean();
/// assert_eq!(mean(camera.ideal()), Some(200.0));
/// let limit = 5.0 * 1.93 / 60e3_f64.sqrt();
/// assert!(mean(camera).is_some_and(|m| m != 200.0 && (m - 200.0).abs() < limit));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Camera {
    /// Rows and columns.
    pub shape: [usize; 2],
    /// Size of a pixel on the sensing surface in metres, x and y.
    pub pixel_size_m: [f64; 2],
    /// Stray light without contact, in grey levels.
    pub background_grey: f64,
    /// Barrel distortion about the centre of the frame: the relative displacement of the corners
    /// towards it. A point at the distance d from the centre appears at the distance e with d = e
    /// (1 + barrel (e/e_corner)²). Negative values give pincushion distortion.
    pub barrel: f64,
    /// Fraction of the light lost in the corners of the frame. It grows with the squared distance
    /// from the centre.
    pub vignetting: f64,
    /// Standard deviation of the Gaussian point-spread function in pixels. 0 for no blur.
    pub blur_sigma_px: f64,
    /// Electrons at grey level 255, which determine the photon noise. Infinite for no photon noise.
    pub full_well_electrons: f64,
    /// Standard deviation of the read noise in grey levels. 0 for no read noise.
    pub read_noise_grey: f64,
}

impl Default for Camera {
    /// The paper's 1392×1042 pixels over 30 mm, 15 grey levels of stray light, 3 % vignetting and
    /// 0.8 px blur. The full well is 15 000 electrons (a scientific CCD of that pitch), the read
    /// noise half a grey level.
    fn default() -> Self {
        Self {
            shape: [1042, 1392],
            pixel_size_m: [30e-3 / 1392.0; 2],
            background_grey: 15.0,
            barrel: 0.0,
            vignetting: 0.03,
            blur_sigma_px: 0.8,
            full_well_electrons: 15e3,
            read_noise_grey: 0.5,
        }
    }
}

impl Camera {
    /// The same field of view, lens and pixel noise, with pixels `factor` times as wide and high. 0
    /// counts as 1. Scenes that need no fine frame are drawn `factor²` times as fast.
    ///
    /// ```
    /// use tactile_simulate::Camera;
    /// let camera = Camera::default().coarser(4);
    /// assert_eq!(camera.shape, [260, 348]);
    /// assert!((camera.pixel_size_m[0] * 348.0 / 30e-3 - 1.0).abs() < 1e-12);
    /// ```
    pub fn coarser(self, factor: usize) -> Self {
        let factor = factor.max(1);
        Self {
            shape: self.shape.map(|pixels| pixels / factor),
            pixel_size_m: self.pixel_size_m.map(|size| size * factor as f64),
            ..self
        }
    }

    /// The same camera without blur, vignetting and noise. Only the rounding to grey levels
    /// remains.
    pub fn ideal(self) -> Self {
        Self {
            vignetting: 0.0,
            blur_sigma_px: 0.0,
            full_well_electrons: f64::INFINITY,
            read_noise_grey: 0.0,
            ..self
        }
    }

    /// Area of a pixel on the sensing surface in square metres.
    pub(crate) fn pixel_area_m2(&self) -> f64 {
        self.pixel_size_m[0] * self.pixel_size_m[1]
    }

    /// The coordinates (x, y) of the centre of the frame in pixels.
    pub(crate) fn middle_px(&self) -> [f64; 2] {
        [
            (self.shape[1] as f64 - 1.0) / 2.0,
            (self.shape[0] as f64 - 1.0) / 2.0,
        ]
    }

    /// Lens and pixels in the form of an image plane.
    pub(crate) fn plane(&self) -> PixelPlane {
        let middle = self.middle_px();
        let [width, height] = self.pixel_size_m;
        let corner = (middle[0] * width).hypot(middle[1] * height);
        PixelPlane {
            middle_px: middle,
            pixel_size_m: self.pixel_size_m,
            // A frame of one pixel has no corner.
            bend: self.barrel / (corner * corner).max(f64::MIN_POSITIVE),
        }
    }

    /// The requested centre, or the centre of the frame.
    pub(crate) fn centre_px(&self, asked: Option<[f64; 2]>) -> [f64; 2] {
        asked.unwrap_or_else(|| self.middle_px())
    }

    /// Converts expected grey levels into an exposure: noise, rounding, and clipping at 0 and 255.
    /// Each pair (`seed`, `frame`) has its own noise. Any image may be passed. O(pixels).
    pub fn expose(&self, expected_grey: ArrayView2<'_, f64>, seed: u64, frame: u64) -> Array2<u8> {
        self.expose_for(Purpose::Frames, expected_grey, seed, frame)
    }

    /// Like [`expose`](Self::expose), with the random streams of another purpose.
    pub(crate) fn expose_for(
        &self,
        purpose: Purpose,
        expected_grey: ArrayView2<'_, f64>,
        seed: u64,
        frame: u64,
    ) -> Array2<u8> {
        let mut image = Array2::zeros(expected_grey.dim());
        let law = self.noise_law();
        for (row, (mut out, light)) in image
            .rows_mut()
            .into_iter()
            .zip(expected_grey.rows())
            .enumerate()
        {
            let mut rng = row_stream(seed, purpose, frame, row);
            for (pixel, &grey) in out.iter_mut().zip(light) {
                // `as` truncates towards zero and saturates at 0 and 255.
                *pixel = (self.noisy(grey, &law, &mut rng) + 0.5) as u8;
            }
        }
        image
    }

    fn electrons_per_grey(&self) -> f64 {
        self.full_well_electrons / 255.0
    }

    fn noisy(&self, grey: f64, law: &NoiseLaw, rng: &mut ChaCha8Rng) -> f64 {
        let normal: f64 = StandardNormal.sample(rng);
        if grey >= law.normal_from_grey {
            // Photon and read noise are independent, so their variances add and one deviate
            // represents both.
            return grey + (grey * law.variance_per_grey + law.read_variance).sqrt() * normal;
        }
        let photons = match Poisson::new(grey / law.variance_per_grey) {
            Ok(law) => law.sample(rng),
            Err(_) => 0.0, // no light
        };
        photons * law.variance_per_grey + self.read_noise_grey * normal
    }

    fn noise_law(&self) -> NoiseLaw {
        NoiseLaw {
            variance_per_grey: self.electrons_per_grey().recip(),
            read_variance: self.read_noise_grey * self.read_noise_grey,
            normal_from_grey: NORMAL_FROM_ELECTRONS / self.electrons_per_grey(),
        }
    }

    /// Margin in pixels around the contact that contains all of the blurred light.
    pub(crate) fn blur_reach(&self) -> usize {
        // Four standard deviations exclude 6e-5 of a Gaussian's weight.
        (4.0 * self.blur_sigma_px).ceil() as usize
    }

    /// Blurs a patch in place. Light that leaves the patch is lost.
    pub(crate) fn blur(&self, patch: &mut PixelPatch) {
        let reach = self.blur_reach();
        if reach == 0 {
            return;
        }
        let weight = |k: usize| (-0.5 * (k as f64 / self.blur_sigma_px).powi(2)).exp();
        // The truncated weights are normalised to 1, so that the blur preserves the sum of the
        // light.
        let total = 1.0 + 2.0 * (1..=reach).map(weight).sum::<f64>();
        let kernel: Vec<f64> = (0..=reach).map(|k| weight(k) / total).collect();
        // A Gaussian is separable: two one-dimensional passes replace a two-dimensional one.
        for axis in [Axis(0), Axis(1)] {
            let source = patch.values.clone();
            patch.values.map_inplace(|v| *v *= kernel[0]);
            let length = source.len_of(axis);
            for (k, &w) in kernel
                .iter()
                .enumerate()
                .skip(1)
                .filter(|(k, _)| *k < length)
            {
                let head = ndarray::Slice::from(..length - k);
                let tail = ndarray::Slice::from(k..);
                patch
                    .values
                    .slice_axis_mut(axis, tail)
                    .scaled_add(w, &source.slice_axis(axis, head));
                patch
                    .values
                    .slice_axis_mut(axis, head)
                    .scaled_add(w, &source.slice_axis(axis, tail));
            }
        }
    }

    /// Expected grey levels: background plus the patches of leaked light, times illumination and
    /// lens.
    pub(crate) fn compose(
        &self,
        leaked_grey: &[PixelPatch],
        illumination: &Illumination,
    ) -> Array2<f64> {
        let [rows, cols] = self.shape;
        let mut frame = Array2::from_elem((rows, cols), self.background_grey);
        for patch in leaked_grey {
            patch.add_to(&mut frame);
        }
        let [cx, cy] = self.middle_px();
        // Relative to the corner, where the loss equals the stated fraction.
        let fall = self.vignetting / (cx * cx + cy * cy).max(f64::MIN_POSITIVE);
        let tilt = [
            illumination.tilt[0] / (2.0 * cx).max(1.0),
            illumination.tilt[1] / (2.0 * cy).max(1.0),
        ];
        for (r, mut line) in frame.rows_mut().into_iter().enumerate() {
            let dy = r as f64 - cy;
            for (c, value) in line.iter_mut().enumerate() {
                let dx = c as f64 - cx;
                let lens = 1.0 - fall * (dx * dx + dy * dy);
                // A strong tilt must not make the light negative on the dark side.
                *value *= lens * (illumination.level + tilt[0] * dx + tilt[1] * dy).max(0.0);
            }
        }
        frame
    }

    /// An exposure of a target instead of the sensing surface: bright dots on a square grid, with a
    /// diameter of a third of the pitch (in metres). They are 180 grey levels above the background,
    /// with the same lens, blur, vignetting and noise.
    ///
    /// ```
    /// use tactile_simulate::Camera;
    /// let camera = Camera::default().coarser(4);
    /// let target = camera.dot_target(2e-3, 7);
    /// let bright = target.iter().filter(|v| **v > 100).count() as f64 / target.len() as f64;
    /// // π/4 of a ninth of the area.
    /// assert!((bright - 0.0873).abs() < 0.01, "{bright}");
    /// ```
    pub fn dot_target(&self, pitch_m: f64, seed: u64) -> Array2<u8> {
        const LIGHT_GREY: f64 = 180.0;
        const STEPS: i32 = 4;
        let plane = self.plane();
        let lit = |pixel: [f64; 2]| {
            // The centre of the frame lies between dots, as it would by chance.
            let place = plane.to_metres(pixel).map(|p| p / pitch_m + 0.3);
            let from_dot = place.map(|p| p - p.round());
            f64::from(from_dot[0].hypot(from_dot[1]) < 1.0 / 6.0)
        };
        let [rows, cols] = self.shape;
        let offset = |k: i32| (f64::from(k) + 0.5) / f64::from(STEPS) - 0.5;
        let share = |(r, c): (usize, usize)| {
            let parts = (0..STEPS * STEPS)
                .map(|k| lit([c as f64 + offset(k % STEPS), r as f64 + offset(k / STEPS)]));
            parts.sum::<f64>() / f64::from(STEPS * STEPS)
        };
        let mut patch = PixelPatch {
            origin: [0, 0],
            values: Array2::from_shape_fn((rows, cols), |at| LIGHT_GREY * share(at)),
        };
        self.blur(&mut patch);
        let light = self.compose(&[patch], &Illumination::default());
        self.expose_for(Purpose::CalibrationFrames, light.view(), seed, 1 << 40)
    }

    /// An exposure without contact. Each `repeat` has its own noise.
    pub(crate) fn expose_reference(&self, seed: u64, repeat: u32) -> Array2<u8> {
        let dark = self.compose(&[], &Illumination::default());
        self.expose(dark.view(), seed, u64::from(repeat) << 16)
    }

    /// An exposure of the light of load `load`. Each `repeat` has its own noise.
    pub(crate) fn expose_load(
        &self,
        light: ArrayView2<'_, f64>,
        seed: u64,
        load: usize,
        repeat: u32,
    ) -> Array2<u8> {
        self.expose(light, seed, u64::from(repeat) << 16 | (load as u64 + 1))
    }

    pub(crate) fn validate(&self) -> Result<(), SimulateError> {
        at_least("shape", self.shape[0].min(self.shape[1]), 1)?;
        // The row number takes 16 bits of the number of its noise stream.
        within(
            "shape",
            self.shape[0].max(self.shape[1]) as f64,
            1.0,
            65535.0,
        )?;
        positive("pixel_size_m", self.pixel_size_m[0])?;
        positive("pixel_size_m", self.pixel_size_m[1])?;
        not_negative("background_grey", self.background_grey)?;
        // Outside this range the image folds in the corners.
        within("barrel", self.barrel, -0.3, 0.3)?;
        within("vignetting", self.vignetting, 0.0, 1.0)?;
        within("blur_sigma_px", self.blur_sigma_px, 0.0, 1000.0)?;
        within(
            "full_well_electrons",
            self.full_well_electrons,
            1.0,
            f64::INFINITY,
        )?;
        not_negative("read_noise_grey", self.read_noise_grey)
    }
}

/// The use of a random stream. Streams of different uses are independent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Purpose {
    /// Noise of the frames of a scene.
    Frames = 0,
    /// Noise of the force gauge of a calibration.
    Gauge = 1,
    /// Noise of the frames of a calibration.
    CalibrationFrames = 2,
    /// Positions of the bumps of a surface pattern.
    Pattern = 3,
}

/// The stream of row `row` in frame `frame`. `frame` must be below 2⁴⁸, `row` below 2¹⁶.
pub(crate) fn row_stream(seed: u64, purpose: Purpose, frame: u64, row: usize) -> ChaCha8Rng {
    let mut key = [0_u8; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8] = purpose as u8;
    let mut rng = ChaCha8Rng::from_seed(key);
    // Seed and purpose are the key, frame and row the stream, so that no two of them share numbers.
    rng.set_stream(frame << 16 | row as u64);
    rng
}
