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
mod discs;

use bend::{Bend, RadialMeans};
use discs::Discs;
use nalgebra::{Matrix6, Vector6};
use ndarray::{Array2, ArrayView2};

use crate::{BoundingBox, Frame, Lighting, Scalar, surface::fill_shape};

/// Pixels nearer than this to the mask's border are replaced: three standard deviations of a lens's blur of 0.8 pixels.
/// With 1.5 and 3.2 the strain of simulated presses is off by a fifth to a half more (frames of 174 to 696 pixels).
///
/// As far outside the mask pixels may come to lie inside the fitted contour.
const RING_PX: f64 = 2.3;

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
    discs: Discs,
    samples: Vec<Sample>,
}

impl<T: Scalar> ProfileBuffers<T> {
    /// Fits the profile and fills `image` and `mask`; `None` where the contact is no ellipse, and nothing is replaced.
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
        let area = grown(area, mask.dim());
        self.discs.load(mask, area);
        self.mask.fill(false);
        self.samples.clear();
        self.samples.reserve(area.area());
        for row in area.top..area.top + area.rows {
            let inner = self.discs.inside(row - area.top);
            for (column, _) in (area.left..).zip(inner).filter(|(_, inner)| **inner) {
                let light = frame.at(row, column);
                self.image[[row, column]] = light;
                self.mask[[row, column]] = true;
                let reflectance = lighting.reflectance(light).as_f64();
                self.samples
                    .extend(Sample::new([row, column], reflectance * reflectance.abs()));
            }
        }
        let profile = Profile::fit(&self.samples, area)?;
        for row in area.top..area.top + area.rows {
            let reached = self.discs.reached(row - area.top);
            for (column, _) in (area.left..).zip(reached).filter(|(_, near)| **near) {
                let at = [row, column];
                if !self.mask[at] {
                    let squared = profile.squared_reflectance(at);
                    self.mask[at] = squared > 0.0;
                    self.image[at] = lighting.intensity(T::of(squared.clamp(0.0, 1.0).sqrt()));
                }
            }
        }
        Some(profile)
    }
}

/// The box and [`RING_PX`] around it, as far as the frame goes.
fn grown(area: BoundingBox, (rows, columns): (usize, usize)) -> BoundingBox {
    let reach = RING_PX as usize;
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

/// A pixel that the profile is fitted to.
#[derive(Clone, Copy, Debug)]
struct Sample {
    at: [usize; 2],
    /// R², with the sign of R.
    squared: f64,
    weight: f64,
}

impl Sample {
    fn new(at: [usize; 2], squared: f64) -> Option<Self> {
        let weight = 1.0 / (squared.abs() + WEIGHT_FLOOR);
        squared.is_finite().then_some(Self {
            at,
            squared,
            weight,
        })
    }
}

/// R² = c·(1, x, y, x², xy, y²), x and y from the middle of the box in units of its longer side.
#[derive(Debug)]
pub(super) struct Profile {
    coefficients: Vector6<f64>,
    middle: [f64; 2],
    unit: f64,
    /// How R² depends on the quadratic, where it is not equal to it.
    bend: Option<Bend>,
}

/// Powers of x and y of the coefficients.
const POWERS: [[usize; 2]; 6] = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];

impl Profile {
    /// Weighted least squares over the samples, row by row; `None` for too few pixels or too poor a fit.
    fn fit(samples: &[Sample], area: BoundingBox) -> Option<Self> {
        if samples.len() < FEWEST {
            return None;
        }
        let mut profile = Self {
            coefficients: Vector6::zeros(),
            middle: [
                area.top as f64 + 0.5 * area.rows as f64,
                area.left as f64 + 0.5 * area.columns as f64,
            ],
            unit: area.rows.max(area.columns) as f64,
            bend: None,
        };
        let moments = profile.moments(samples);
        let matrix = Matrix6::from_fn(|i, j| {
            moments.plain[POWERS[i][1] + POWERS[j][1]][POWERS[i][0] + POWERS[j][0]]
        });
        let side = Vector6::from_fn(|i, _| moments.weighted[POWERS[i][1]][POWERS[i][0]]);
        profile.coefficients = matrix.cholesky()?.solve(&side);
        let curved_down = profile.coefficients[3] < 0.0 && profile.coefficients[5] < 0.0;
        let top = profile.top().filter(|top| curved_down && *top > 0.0)?;
        let mean = side[0] / matrix[(0, 0)];
        let (mut left, mut variance) = (0.0, 0.0);
        let mut means = RadialMeans::default();
        for sample in samples {
            let quadratic = profile.quadratic(sample.at);
            left += sample.weight * (sample.squared - quadratic).powi(2);
            variance += sample.weight * (sample.squared - mean).powi(2);
            means.add(1.0 - quadratic / top, sample.squared, sample.weight);
        }
        if left > (1.0 - EXPLAINED) * variance {
            return None;
        }
        profile.bend = Bend::fit(&means, top, left);
        Some(profile)
    }

    /// Sums over the samples; those of a row are of powers of x alone.
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

    /// The quadratic's greatest value; `None` without one.
    fn top(&self) -> Option<f64> {
        let c = &self.coefficients;
        let determinant = 4.0 * c[3] * c[5] - c[4] * c[4];
        let drop = (c[5] * c[1] * c[1] - c[4] * c[1] * c[2] + c[3] * c[2] * c[2]) / determinant;
        (determinant > 0.0).then_some(c[0] - drop)
    }

    /// The quadratic with its derivatives by x and y.
    #[inline]
    pub(super) fn quadratic_and_gradient(&self, at: [usize; 2]) -> (f64, [f64; 2]) {
        let [x, y] = self.place(at);
        let c = &self.coefficients;
        let along_x = c[1] + y * c[4] + 2.0 * x * c[3];
        let along_y = c[2] + x * c[4] + 2.0 * y * c[5];
        (self.quadratic_at([x, y]), [along_x, along_y])
    }

    /// A pixel's x and y.
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
    /// Adds a row's sums of powers of x.
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
