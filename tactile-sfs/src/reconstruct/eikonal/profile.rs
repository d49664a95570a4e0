//! The shading next to the boundary of a round contact, from a profile fitted to the inside.
//!
//! The last two or three pixels before an occluding boundary are the worst of a frame: partly covered, blurred by the lens,
//! and where the slope has no end. A surface started there inherits their errors whole. For an elliptical body that the
//! plane cuts in half, as for Hertz's pressure under any two smooth bodies, R² = 1 − x²/a² − y²/b²: a quadratic function of
//! the pixel, which the inside determines and which is zero on the contour.
//!
//! At finite strain the pressure departs from Hertz's, R = √(1 − ρ²) (1 − c ρ²) with ρ² = x²/a² + y²/b² and c from −0.3 to 0.15, and the zero of
//! the quadratic misses the contour by up to a hundredth of a, where the surface is steepest: on the press that `tactile measure`
//! simulates by finite elements the heights came out 10 and 14 % too high. So c is fitted too where that explains most of what the quadratic leaves.

mod bend;

use bend::{Bend, RadialMeans};
use nalgebra::{Matrix6, Vector6};
use ndarray::{Array2, ArrayView2};

use crate::{BoundingBox, Frame, Lighting, Scalar};

/// Pixels nearer than this to the mask's border are replaced: three standard deviations of a lens's blur of 0.8 pixels.
/// With 1.5 and 3.2 the strain of simulated presses is off by a fifth to a half more (frames of 174 to 696 pixels).
const RING_PX: f64 = 2.3;

/// Pixels outside the mask that may come to lie inside the fitted contour.
const REACH_PX: f64 = 2.3;

/// Fewest pixels that six coefficients are fitted to.
const FEWEST: usize = 24;

/// Share of the variance of R² that the profile must explain: noise of two grey levels in 200 leaves 0.98 of a round
/// contact of 19 pixels, a flat or textured contact has nothing to do with an ellipse.
const EXPLAINED: f64 = 0.9;

/// Added to R² in the weights 1/(R² + floor): noise of R² is 2R times that of R, and that of quantisation.
const WEIGHT_FLOOR: f64 = 0.05;

/// Image and mask with the boundary replaced, kept between calls.
#[derive(Debug, Default)]
pub(crate) struct ProfileBuffers<T> {
    pub(super) image: Array2<T>,
    pub(super) mask: Array2<bool>,
    inner: Array2<bool>,
}

impl<T: Scalar> ProfileBuffers<T> {
    /// Fits the profile and fills `image` and `mask`; `false` where the contact is no ellipse, and nothing is replaced.
    pub(super) fn fill(
        &mut self,
        frame: &Frame<'_, T>,
        mask: ArrayView2<'_, bool>,
        area: BoundingBox,
        lighting: &Lighting<T>,
    ) -> bool {
        if self.mask.dim() != mask.dim() {
            self.image = Array2::from_elem(mask.dim(), T::zero());
            self.mask = Array2::from_elem(mask.dim(), false);
            self.inner = Array2::from_elem(mask.dim(), false);
        }
        let area = grown(area, mask.dim());
        for (row, column) in area.pixels() {
            self.inner[[row, column]] =
                mask[[row, column]] && !near(mask, [row, column], RING_PX, false);
        }
        let Some(profile) = Profile::fit(frame, &self.inner, area, lighting) else {
            return false;
        };
        self.mask.fill(false);
        for (row, column) in area.pixels() {
            let at = [row, column];
            if self.inner[at] {
                self.image[at] = frame.at(row, column);
                self.mask[at] = true;
            } else if mask[at] || near(mask, at, REACH_PX, true) {
                let squared = profile.squared_reflectance(at);
                self.mask[at] = squared > 0.0;
                self.image[at] = lighting.intensity(T::of(squared.clamp(0.0, 1.0).sqrt()));
            }
        }
        true
    }
}

/// The box and [`REACH_PX`] around it, as far as the frame goes.
fn grown(area: BoundingBox, (rows, columns): (usize, usize)) -> BoundingBox {
    let reach = REACH_PX as usize;
    let (top, left) = (
        area.top.saturating_sub(reach),
        area.left.saturating_sub(reach),
    );
    BoundingBox {
        top,
        left,
        rows: (area.top + area.rows + reach).min(rows) - top,
        columns: (area.left + area.columns + reach).min(columns) - left,
    }
}

/// Whether a pixel of this kind, or for `false` the frame's border, lies within `distance` pixels.
fn near(mask: ArrayView2<'_, bool>, [row, column]: [usize; 2], distance: f64, kind: bool) -> bool {
    let reach = distance as isize;
    (-reach..=reach).any(|down| {
        (-reach..=reach).any(|right| {
            let close = ((down * down + right * right) as f64) <= distance * distance;
            let place = [
                row.wrapping_add_signed(down),
                column.wrapping_add_signed(right),
            ];
            close && mask.get(place).copied().unwrap_or(false) == kind
        })
    })
}

/// R² = c·(1, x, y, x², xy, y²), x and y from the middle of the box in units of its longer side.
struct Profile {
    coefficients: Vector6<f64>,
    middle: [f64; 2],
    unit: f64,
    /// How R² depends on the quadratic, where it is not equal to it.
    bend: Option<Bend>,
}

impl Profile {
    /// Weighted least squares over the finite inner pixels; `None` for too few pixels or too poor a fit.
    fn fit<T: Scalar>(
        frame: &Frame<'_, T>,
        inner: &Array2<bool>,
        area: BoundingBox,
        lighting: &Lighting<T>,
    ) -> Option<Self> {
        let mut profile = Self {
            coefficients: Vector6::zeros(),
            middle: [
                area.top as f64 + 0.5 * area.rows as f64,
                area.left as f64 + 0.5 * area.columns as f64,
            ],
            unit: area.rows.max(area.columns) as f64,
            bend: None,
        };
        let samples = || {
            area.pixels()
                .filter(|&at| inner[at])
                .filter_map(|(row, column)| {
                    let reflectance = lighting.reflectance(frame.at(row, column)).as_f64();
                    let squared = reflectance * reflectance.abs();
                    squared.is_finite().then_some((
                        [row, column],
                        squared,
                        1.0 / (squared.abs() + WEIGHT_FLOOR),
                    ))
                })
        };
        let (mut matrix, mut side) = (Matrix6::zeros(), Vector6::zeros());
        let (mut count, mut total, mut sum) = (0_usize, 0.0, 0.0);
        for (at, squared, weight) in samples() {
            let basis = profile.basis(at);
            matrix += basis * basis.transpose() * weight;
            side += basis * (weight * squared);
            count += 1;
            total += weight;
            sum += weight * squared;
        }
        if count < FEWEST {
            return None;
        }
        profile.coefficients = matrix.cholesky()?.solve(&side);
        let curved_down = profile.coefficients[3] < 0.0 && profile.coefficients[5] < 0.0;
        let top = profile.top().filter(|top| curved_down && *top > 0.0)?;
        let mean = sum / total;
        let (mut left, mut variance) = (0.0, 0.0);
        let mut means = RadialMeans::default();
        for (at, squared, weight) in samples() {
            let quadratic = profile.quadratic(at);
            left += weight * (squared - quadratic).powi(2);
            variance += weight * (squared - mean).powi(2);
            means.add(1.0 - quadratic / top, squared, weight);
        }
        if left > (1.0 - EXPLAINED) * variance {
            return None;
        }
        profile.bend = Bend::fit(&means, top, left);
        Some(profile)
    }

    /// The quadratic's greatest value; `None` without one.
    fn top(&self) -> Option<f64> {
        let c = &self.coefficients;
        let determinant = 4.0 * c[3] * c[5] - c[4] * c[4];
        let drop = (c[5] * c[1] * c[1] - c[4] * c[1] * c[2] + c[3] * c[2] * c[2]) / determinant;
        (determinant > 0.0).then_some(c[0] - drop)
    }

    fn basis(&self, [row, column]: [usize; 2]) -> Vector6<f64> {
        let x = (column as f64 - self.middle[1]) / self.unit;
        let y = (row as f64 - self.middle[0]) / self.unit;
        Vector6::new(1.0, x, y, x * x, x * y, y * y)
    }

    fn quadratic(&self, at: [usize; 2]) -> f64 {
        self.coefficients.dot(&self.basis(at))
    }

    fn squared_reflectance(&self, at: [usize; 2]) -> f64 {
        let quadratic = self.quadratic(at);
        (self.bend.as_ref()).map_or(quadratic, |bend| bend.squared_reflectance(quadratic))
    }
}
