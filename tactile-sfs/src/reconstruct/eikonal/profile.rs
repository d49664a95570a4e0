//! The shading next to the boundary of a round contact, from a profile fitted to the inside.
//!
//! The last two or three pixels before an occluding boundary have the largest errors in a frame.
//! They are partly covered, blurred by the lens, and infinitely steep at the contour. A surface
//! that starts there inherits all of their errors. For an elliptical body cut in half by the plane,
//! as for Hertz's pressure under any two smooth bodies, R² = 1 − x²/a² − y²/b². This is a quadratic
//! function of the pixel position, which the inside determines and which is zero on the contour.
//!
//! At finite strain the pressure differs from Hertz's: R = √(1 − ρ²) (1 − c ρ²) with ρ² = x²/a² +
//! y²/b² and c from −0.3 to 0.15. The zero of the quadratic then misses the contour by up to a
//! hundredth of a, where the surface is steepest. On a press simulated by finite elements the
//! heights were 10 and 14 % too high. Therefore R² = A (1 − ρ²) (1 − c ρ²)² is fitted to the means
//! of R² along the ellipses of the quadratic. It is used if it explains most of the residual of the
//! quadratic.
//!
//! Contact detection fits a round profile with the same bend to the frame. This profile is
//! separate: it has elliptical contours and is fitted to the image to be reconstructed, which is
//! averaged over blocks, smoothed and made linear in the pressure.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use ndarray::{Array2, ArrayView2};

use crate::surface::fill_shape;
use crate::{BoundingBox, Frame, Lighting, PixelScalar};

/// Pixels closer than this to the border of the mask are replaced: three standard deviations of a
/// lens blur of 0.8 pixels. With 1.5 and 3.2 pixels the error of strain in simulated presses is
/// larger by a fifth to a half (frames of 174 to 696 pixels).
///
/// Pixels within this distance outside the mask may lie inside the fitted contour.
const RING_PX: f64 = 2.3;

/// Number of whole pixels in the ring.
const REACH: usize = RING_PX as usize;

/// Image and mask with the boundary replaced, kept between calls.
#[derive(Debug, Default)]
pub(crate) struct ProfileBuffers<T> {
    pub(super) image: Array2<T>,
    pub(super) mask: Array2<bool>,
    discs: Discs,
    samples: Vec<Sample>,
}

impl<T: PixelScalar> ProfileBuffers<T> {
    /// Fits the profile and fills `image` and `mask`. If the contact is not an ellipse, the result
    /// is `None` and nothing is replaced.
    pub(super) fn fill(
        &mut self,
        frame: &Frame<'_, T>,
        mask: ArrayView2<'_, bool>,
        area: BoundingBox,
        lighting: &Lighting<T>,
    ) -> Option<Profile> {
        if self.mask.dim() != mask.dim() {
            fill_shape(&mut self.image, mask.dim(), T::zero());
            fill_shape(&mut self.mask, mask.dim(), false);
        }
        let area = area.grown(REACH, mask.dim());
        self.discs.load(mask, area);
        self.mask.fill(false);
        self.samples.clear();
        self.samples.reserve(area.area());
        for row in area.row_start..area.row_end {
            let inner = self.discs.inside(row - area.row_start);
            for (column, _) in (area.column_start..)
                .zip(inner)
                .filter(|(_, inner)| **inner)
            {
                let light = frame.at(row, column);
                self.image[[row, column]] = light;
                self.mask[[row, column]] = true;
                let reflectance = lighting.reflectance(light).as_f64();
                // The sign is kept, so that noise about 0 does not acquire a positive mean.
                let squared = reflectance * reflectance.abs();
                if squared.is_finite() {
                    self.samples.push(Sample {
                        at: [row, column],
                        squared,
                        // The noise of R² is 2R times that of R. The constant term accounts for
                        // quantisation.
                        weight: 1.0 / (squared.abs() + 0.05),
                    });
                }
            }
        }
        let profile = Profile::fit(&self.samples, area)?;
        for row in area.row_start..area.row_end {
            let reached = self.discs.reached(row - area.row_start);
            for (column, _) in (area.column_start..)
                .zip(reached)
                .filter(|(_, near)| **near)
            {
                let at = [row, column];
                if !self.mask[at] {
                    let squared = profile.squared_reflectance(at);
                    // The fitted contour decides which of the boundary pixels are inside.
                    self.mask[at] = squared > 0.0;
                    self.image[at] = lighting.intensity(T::of(squared.clamp(0.0, 1.0).sqrt()));
                }
            }
        }
        Some(profile)
    }
}

/// A pixel used for the fit of the profile.
#[derive(Clone, Copy, Debug)]
struct Sample {
    at: [usize; 2],
    /// R², with the sign of R.
    squared: f64,
    weight: f64,
}

/// R² = c·(1, x, y, x², xy, y²), with x and y from the middle of the box in units of its longer
/// side.
#[derive(Debug)]
pub(super) struct Profile {
    coefficients: Vector6<f64>,
    middle: [f64; 2],
    unit: f64,
    /// R² as a function of the quadratic, if the two are not equal.
    bend: Option<Bend>,
}

/// Powers of x and y that belong to the coefficients.
const POWERS: [[usize; 2]; 6] = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];

impl Profile {
    /// Weighted least squares over the samples, row by row. `None` if the pixels are too few or the
    /// fit is too poor.
    fn fit(samples: &[Sample], area: BoundingBox) -> Option<Self> {
        // Four for each of the six coefficients.
        if samples.len() < 24 {
            return None;
        }
        let mut profile = Self {
            coefficients: Vector6::zeros(),
            middle: [
                area.row_start as f64 + 0.5 * area.rows() as f64,
                area.column_start as f64 + 0.5 * area.columns() as f64,
            ],
            unit: area.rows().max(area.columns()) as f64,
            bend: None,
        };
        let moments = profile.moments(samples);
        let matrix = Matrix6::from_fn(|i, j| {
            moments.plain[POWERS[i][1] + POWERS[j][1]][POWERS[i][0] + POWERS[j][0]]
        });
        let side = Vector6::from_fn(|i, _| moments.weighted[POWERS[i][1]][POWERS[i][0]]);
        profile.coefficients = matrix.cholesky()?.solve(&side);
        // A contact is brightest in the middle, so that R² has a maximum along both axes.
        let curved_down = profile.coefficients[3] < 0.0 && profile.coefficients[5] < 0.0;
        let top = profile.top().filter(|top| curved_down && *top > 0.0)?;
        let mean = side[0] / matrix[(0, 0)];
        let (mut residual, mut variance) = (0.0, 0.0);
        let mut means = RadialMeans::default();
        for sample in samples {
            let quadratic = profile.quadratic(sample.at);
            residual += sample.weight * (sample.squared - quadratic).powi(2);
            variance += sample.weight * (sample.squared - mean).powi(2);
            // s is 0 at the top and 1 on the contour of the quadratic.
            means.add(1.0 - quadratic / top, sample.squared, sample.weight);
        }
        // With noise of two grey levels in 200, 0.98 of the variance of a round contact of 19
        // pixels is explained. A flat or textured contact does not follow an ellipse.
        if residual > 0.1 * variance {
            return None;
        }
        profile.bend = Bend::fit(&means, top, residual, samples.len());
        Some(profile)
    }

    /// Sums over the samples. The sums over a row contain only powers of x.
    fn moments(&self, samples: &[Sample]) -> Moments {
        let mut moments = Moments::default();
        for row in samples.chunk_by(|a, b| a.at[0] == b.at[0]) {
            let [_, y] = self.place(row[0].at);
            let (mut plain, mut weighted) = ([0.0; 5], [0.0; 3]);
            for sample in row {
                let [x, _] = self.place(sample.at);
                let mut power = sample.weight;
                for k in 0..5 {
                    plain[k] += power;
                    if k < 3 {
                        weighted[k] += power * sample.squared;
                    }
                    power *= x;
                }
            }
            moments.add(y, plain, weighted);
        }
        moments
    }

    /// The maximum of the quadratic. `None` if it has no maximum.
    fn top(&self) -> Option<f64> {
        let c = &self.coefficients;
        let determinant = 4.0 * c[3] * c[5] - c[4] * c[4];
        let drop = (c[5] * c[1] * c[1] - c[4] * c[1] * c[2] + c[3] * c[2] * c[2]) / determinant;
        (determinant > 0.0).then_some(c[0] - drop)
    }

    /// The quadratic with its derivatives with respect to x and y.
    #[inline]
    pub(super) fn quadratic_and_gradient(&self, at: [usize; 2]) -> (f64, [f64; 2]) {
        let [x, y] = self.place(at);
        let c = &self.coefficients;
        let along_x = c[1] + y * c[4] + 2.0 * x * c[3];
        let along_y = c[2] + x * c[4] + 2.0 * y * c[5];
        (self.quadratic_at([x, y]), [along_x, along_y])
    }

    /// x and y of a pixel.
    #[inline]
    fn place(&self, [row, column]: [usize; 2]) -> [f64; 2] {
        [
            (column as f64 - self.middle[1]) / self.unit,
            (row as f64 - self.middle[0]) / self.unit,
        ]
    }

    #[inline]
    pub(super) fn quadratic(&self, at: [usize; 2]) -> f64 {
        self.quadratic_at(self.place(at))
    }

    #[inline]
    fn quadratic_at(&self, [x, y]: [f64; 2]) -> f64 {
        let c = &self.coefficients;
        c[0] + y * (c[2] + y * c[5]) + x * (c[1] + y * c[4] + x * c[3])
    }

    fn squared_reflectance(&self, at: [usize; 2]) -> f64 {
        let quadratic = self.quadratic(at);
        (self.bend.as_ref()).map_or(quadratic, |bend| bend.squared_reflectance(quadratic))
    }
}

/// Σ w xⁱ yʲ and Σ w R² xⁱ yʲ over pixels, at [j][i].
#[derive(Default)]
struct Moments {
    plain: [[f64; 5]; 5],
    weighted: [[f64; 3]; 3],
}

impl Moments {
    /// Adds the sums over a row of powers of x.
    fn add(&mut self, y: f64, plain: [f64; 5], weighted: [f64; 3]) {
        let mut power = 1.0;
        for j in 0..5 {
            for (sum, term) in self.plain[j].iter_mut().zip(plain) {
                *sum += power * term;
            }
            if j < 3 {
                for (sum, term) in self.weighted[j].iter_mut().zip(weighted) {
                    *sum += power * term;
                }
            }
            power *= y;
        }
    }
}

/// Number of ellipses on which R² is averaged. The curvature of a profile within one is negligible.
const ELLIPSES: usize = 128;

/// Weighted means of R² as a function of s = 1 − q/top, with q the quadratic profile.
#[derive(Debug)]
struct RadialMeans {
    /// Σ w, Σ w s, Σ w R², Σ w R⁴.
    sums: [[f64; 4]; ELLIPSES],
}

impl Default for RadialMeans {
    fn default() -> Self {
        Self {
            sums: [[0.0; 4]; ELLIPSES],
        }
    }
}

impl RadialMeans {
    fn add(&mut self, s: f64, squared: f64, weight: f64) {
        let ellipse = ((s.max(0.0) * ELLIPSES as f64) as usize).min(ELLIPSES - 1);
        let terms = [1.0, s, squared, squared * squared];
        for (sum, term) in self.sums[ellipse].iter_mut().zip(terms) {
            *sum += weight * term;
        }
    }

    /// Weight, mean s and mean R² of every ellipse that contains pixels.
    fn filled(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        let filled = self.sums.iter().filter(|sum| sum[0] > 0.0);
        filled.map(|sum| [sum[0], sum[1] / sum[0], sum[2] / sum[0]])
    }

    /// Σ w (R² − its mean on the ellipse)².
    fn scatter(&self) -> f64 {
        let filled = self.sums.iter().filter(|sum| sum[0] > 0.0);
        filled.map(|sum| sum[3] - sum[2] * sum[2] / sum[0]).sum()
    }
}

/// Number of samples of a contact of 25 pixels' radius. On smaller contacts the smoothing by up to
/// two pixels alone bends the profile by more than a hundredth. There the bend must exceed the
/// noise.
const ENOUGH: usize = 2000;

/// R² as a function of a quadratic profile.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bend {
    /// The maximum of the quadratic.
    top: f64,
    /// A, ρ²/s and c.
    parameters: Vector3<f64>,
}

impl Bend {
    /// Gauss–Newton from the quadratic itself. `None` if the bend explains less than half of
    /// `residual`, the weighted squared residuals of the quadratic.
    ///
    /// With [`ENOUGH`] samples or more, it is enough to explain half of the residual of the means
    /// along the ellipses, because the scatter about the means is noise. With all of `residual` as
    /// the criterion, the same contact would be bent in one frame and not in the next, and its
    /// height would jump by 5 %.
    fn fit(means: &RadialMeans, top: f64, residual: f64, samples: usize) -> Option<Self> {
        let mut bend = Self {
            top,
            // The quadratic itself: its amplitude, its contour and no bend.
            parameters: Vector3::new(top, 1.0, 0.0),
        };
        for _ in 0..8 {
            let (mut matrix, mut side) = (Matrix3::zeros(), Vector3::zeros());
            for [weight, s, squared] in means.filled() {
                let gradient = bend.gradient(s);
                matrix += gradient * gradient.transpose() * weight;
                side += gradient * (weight * (squared - bend.value(s)));
            }
            bend.parameters += matrix.cholesky()?.solve(&side);
        }
        let misfit = |[weight, s, squared]: [f64; 3]| weight * (squared - bend.value(s)).powi(2);
        let bent = means.filled().map(misfit).sum::<f64>();
        let noise = means.scatter();
        let explains = match samples < ENOUGH {
            true => bent + noise < 0.5 * residual,
            false => bent < 0.5 * (residual - noise),
        };
        let [_, scale, c] = bend.parameters.into();
        // Beyond these limits the fit disagrees with the inside.
        let plausible = (scale - 1.0).abs() < 0.2 && c.abs() < 0.6;
        // For Hertz's profile with noise of one grey level in 200, the bend explains nothing of the
        // residual. For contacts computed by finite elements it explains nine tenths.
        (plausible && explains).then_some(bend)
    }

    /// R² at the value `quadratic`. It is negative outside the contour.
    fn squared_reflectance(&self, quadratic: f64) -> f64 {
        self.value(1.0 - quadratic / self.top)
    }

    fn value(&self, s: f64) -> f64 {
        let [amplitude, scale, c] = self.parameters.into();
        let rho2 = scale * s;
        amplitude * (1.0 - rho2) * (1.0 - c * rho2).powi(2)
    }

    /// Derivatives with respect to A, ρ²/s and c.
    fn gradient(&self, s: f64) -> Vector3<f64> {
        let [amplitude, scale, c] = self.parameters.into();
        let rho2 = scale * s;
        let (edge, factor) = (1.0 - rho2, 1.0 - c * rho2);
        let by_rho2 = -amplitude * factor * (factor + 2.0 * c * edge);
        let by_c = -2.0 * amplitude * rho2 * edge * factor;
        Vector3::new(edge * factor * factor, s * by_rho2, by_c)
    }
}

/// The pixels of a mask's box with a border around it, row by row. Outside the frame no pixel is
/// inside the mask.
#[derive(Debug, Default)]
struct Discs {
    padded: Vec<bool>,
    width: usize,
    result: Vec<bool>,
}

impl Discs {
    /// Reads the pixels of the mask in a box that contains all of them.
    fn load(&mut self, mask: ArrayView2<'_, bool>, area: BoundingBox) {
        let columns = area.columns();
        self.width = columns + 2 * REACH;
        self.padded.clear();
        self.padded
            .resize(self.width * (area.rows() + 2 * REACH), false);
        let rows = self.padded.chunks_exact_mut(self.width).skip(REACH);
        for (row, padded) in (area.row_start..).zip(rows).take(area.rows()) {
            let places = &mut padded[REACH..REACH + columns];
            for (column, inside) in (area.column_start..).zip(places) {
                *inside = mask[[row, column]];
            }
        }
    }

    /// The pixels of a row of the box whose disc lies completely in the mask.
    fn inside(&mut self, row: usize) -> &[bool] {
        self.combine(row, true, |all, pixel| all & pixel)
    }

    /// The pixels of a row of the box whose disc overlaps the mask.
    fn reached(&mut self, row: usize) -> &[bool] {
        self.combine(row, false, |any, pixel| any | pixel)
    }

    /// Combines the pixels of every disc of a row, one position of the disc after the other.
    fn combine(&mut self, row: usize, start: bool, with: impl Fn(bool, bool) -> bool) -> &[bool] {
        let columns = self.width - 2 * REACH;
        self.result.clear();
        self.result.resize(columns, start);
        for (down, line) in (self.padded[row * self.width..].chunks_exact(self.width))
            .take(2 * REACH + 1)
            .enumerate()
        {
            let half = half_width(down.abs_diff(REACH));
            for right in REACH - half..=REACH + half {
                for (result, pixel) in self.result.iter_mut().zip(&line[right..]) {
                    *result = with(*result, *pixel);
                }
            }
        }
        &self.result
    }
}

/// Half width of the disc at the distance `down`, in rows from its centre.
fn half_width(down: usize) -> usize {
    let beside = |right: &usize| ((down * down + right * right) as f64) <= RING_PX * RING_PX;
    (1..=REACH).take_while(beside).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of R² = (1 − ρ²)(1 − cρ²)² plus `noise` of alternating sign, for a quadratic whose
    /// contour is at ρ² = `contour`.
    fn means(c: f64, contour: f64, noise: f64) -> (RadialMeans, f64) {
        let (mut means, mut left) = (RadialMeans::default(), 0.0);
        for k in 0..4000_u32 {
            let rho2 = 0.85 * f64::from(k) / 4000.0;
            let sign = if k % 2 == 0 { noise } else { -noise };
            let squared = (1.0 - rho2) * (1.0 - c * rho2).powi(2) + sign;
            means.add(rho2 / contour, squared, 1.0);
            left += (squared - (1.0 - rho2 / contour)).powi(2);
        }
        (means, left)
    }

    #[test]
    fn contour_and_bend_come_back() {
        for c in [-0.3, -0.1, 0.1, 0.15] {
            let (means, left) = means(c, 1.03, 1e-3);
            let bend = Bend::fit(&means, 1.0, left, 4000).unwrap();
            // The curvature of R² changes a mean over an ellipse of width 1/128 by 1e-5.
            let expected = Vector3::new(1.0, 1.03, c);
            assert!((bend.parameters - expected).amax() < 1e-3, "{c}: {bend:?}");
            assert!(bend.squared_reflectance(1.0 - 1.0 / 1.03).abs() < 1e-3);
        }
    }

    #[test]
    fn noise_hides_no_bend_of_a_large_contact() {
        // With noise of a tenth of the peak, the residual is larger than the bend explains.
        let (means, left) = means(0.15, 1.03, 0.1);
        let bend = Bend::fit(&means, 1.0, left, ENOUGH).unwrap();
        // 0.1 over the 37 samples of an ellipse, and over 109 ellipses.
        assert!((bend.parameters[2] - 0.15).abs() < 5e-3, "{bend:?}");
        assert_eq!(Bend::fit(&means, 1.0, left, ENOUGH - 1), None);
    }

    #[test]
    fn noise_is_not_explained() {
        let (means, left) = means(0.0, 1.0, 0.02);
        assert_eq!(Bend::fit(&means, 1.0, left, 4000), None);
    }
}
