//! The guide under a ball: its stiffness, the derivatives by the parameters of its layers, and its
//! error.

use super::layers::log_force_slopes;
use super::{Bond, Layer, LayerEquation, Waveguide};
use crate::numerics::cubic;
use nalgebra::{DMatrix, DVector};
use std::sync::OnceLock;
use tactile_core::{Source, Uncertain};

// Step of the numerical derivatives. The error is of third order in it, and rounding of the
// integral equation is far below.
const STEP: f64 = 1e-3;

impl Layer {
    /// Number of parameters of a layer with errors: ln E, ln h and ν.
    pub const PARAMETERS: usize = 3;

    /// ln of the stiffness E_g of the guide under a ball's contact of radius a, F = 4/3 E_g a³/R.
    /// `None` if the layer equation cannot be solved.
    ///
    /// ```
    /// use tactile_elasticity::contact::Layer;
    /// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
    /// // For a small contact the guide is a half-space, E/(1 − ν²).
    /// let stiffness_pa = Layer::log_stiffness(&[gel], 1e-5).unwrap().exp();
    /// assert!((stiffness_pa / 100e3 - 1.0).abs() < 0.01);
    /// ```
    pub fn log_stiffness(layers: &[Self], radius_m: f64) -> Option<f64> {
        let guide = Waveguide::new(layers.to_vec()).ok()?;
        let equation = LayerEquation::of_layers(&guide, Bond::Bonded).ok()?;
        let contact = equation.solve(radius_m / guide.thickness_m()).ok()?;
        let plane_strain = guide.touched().compliance_per_pa().recip();
        Some(plane_strain.ln() + contact.force_ratio_same_radius.ln())
    }

    /// Layers with their parameters changed by a step: ln E of all layers, then ln h, then ν, which
    /// is limited to ½.
    ///
    /// ```
    /// use nalgebra::DVector;
    /// use tactile_elasticity::contact::Layer;
    /// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
    /// let stiffer = Layer::stepped(&[gel], &DVector::from_vec(vec![2_f64.ln(), 0.0, 0.1]));
    /// assert!((stiffer[0].youngs_modulus_pa - 150e3).abs() < 1e-6 && stiffer[0].poisson_ratio == 0.5);
    /// ```
    pub fn stepped(layers: &[Self], step: &DVector<f64>) -> Vec<Self> {
        let n = layers.len();
        let layer = |(i, layer): (usize, &Self)| Self {
            youngs_modulus_pa: layer.youngs_modulus_pa * step[i].exp(),
            thickness_m: layer.thickness_m * step[n + i].exp(),
            poisson_ratio: (layer.poisson_ratio + step[2 * n + i]).min(0.5),
        };
        layers.iter().enumerate().map(layer).collect()
    }

    /// Derivatives of values by parameters x, such as of forces by those of
    /// [`stepped`](Self::stepped), as a matrix \[value, parameter\]. `here` holds the values at x.
    /// Steps are negative, because ν is at most ½. Parameters without a step have zeros. `None` if
    /// the values are `None`.
    ///
    /// ```
    /// use nalgebra::DVector;
    /// use tactile_elasticity::contact::Layer;
    /// let values = |x: &DVector<f64>| Some(vec![x[0].exp(), x[0] * x[1]]);
    /// let x = DVector::from_vec(vec![0.0, 2.0]);
    /// let slopes = Layer::slopes(&[1.0, 0.0], &x, |k| k == 0, values).unwrap();
    /// assert!((slopes[(0, 0)] - 1.0).abs() < 1e-3 && (slopes[(1, 0)] - 2.0).abs() < 1e-3);
    /// assert_eq!(slopes[(1, 1)], 0.0);
    /// ```
    pub fn slopes(
        here: &[f64],
        x: &DVector<f64>,
        moves: impl Fn(usize) -> bool,
        values: impl Fn(&DVector<f64>) -> Option<Vec<f64>>,
    ) -> Option<DMatrix<f64>> {
        let mut slopes = DMatrix::zeros(here.len(), x.len());
        for k in (0..x.len()).filter(|&k| moves(k)) {
            let mut beside = x.clone();
            beside[k] -= STEP;
            for (i, (there, here)) in values(&beside)?.iter().zip(here).enumerate() {
                slopes[(i, k)] = (there - here) / -STEP;
            }
        }
        Some(slopes)
    }
}

/// Derivatives of [`Layer::log_stiffness`] by ln E, ln h and ν of the layers, in this order. `None`
/// if the layer equation cannot be solved.
fn log_stiffness_gradient(guide: &Waveguide, radius_m: f64) -> Option<DVector<f64>> {
    let layers = guide.layers();
    let count = Layer::PARAMETERS * layers.len();
    // ν is at most ½, so only negative steps are used.
    let upper = |k: usize| if k < 2 * layers.len() { STEP } else { 0.0 };
    let moved = (0..count).map(|k| {
        let at = |value: f64| {
            let mut step = DVector::zeros(count);
            step[k] = value;
            Layer::stepped(layers, &step)
        };
        ([at(-STEP), at(upper(k))], upper(k) + STEP)
    });
    let mut slopes = DVector::from_vec(log_force_slopes(guide, radius_m, moved).ok()?);
    // The touched layer as a half-space: ln E/(1 − ν²).
    let touched = layers.iter().position(|layer| layer.thickness_m > 0.0)?;
    let nu = layers[touched].poisson_ratio;
    slopes[touched] += 1.0;
    slopes[2 * layers.len() + touched] += 2.0 * nu / (1.0 - nu * nu);
    Some(slopes)
}

/// A guide with the errors of its layers, for contacts of any radius.
///
/// The derivatives of the stiffness by the layers' parameters are interpolated by cubics in ln a
/// between rows. A row is solved when a contact first needs it: four for the first contact, then
/// hardly any.
#[derive(Clone, Debug)]
pub(crate) struct GuideErrors {
    guide: Waveguide,
    /// Covariance of ln E of all layers, then of ln h, then of ν.
    covariance: DMatrix<f64>,
    /// Change of each parameter per standard deviation of the pixel size.
    by_pixel_size: DVector<f64>,
    /// Derivatives by the parameters. `None` if the layer equation cannot be solved.
    rows: Vec<OnceLock<Option<DVector<f64>>>>,
}

// Range of ratios of contact radius to thickness, from a half-space to the largest that is solved,
// and the width of a row in ln a. The cubic has an error of 5·10⁻⁵ (see the test).
const FIRST_RATIO: f64 = 1e-3;
const LAST_RATIO: f64 = 20.0;
const ROW: f64 = 0.2;

impl GuideErrors {
    /// The sizes must match, which the caller has checked.
    pub(crate) fn new(
        guide: Waveguide,
        covariance: DMatrix<f64>,
        by_pixel_size: Option<DVector<f64>>,
    ) -> Self {
        let rows = ((LAST_RATIO / FIRST_RATIO).ln() / ROW) as usize + 1;
        Self {
            by_pixel_size: by_pixel_size.unwrap_or_else(|| DVector::zeros(covariance.nrows())),
            guide,
            covariance,
            rows: vec![OnceLock::new(); rows],
        }
    }

    fn row(&self, k: usize) -> Option<&DVector<f64>> {
        let radius_m = FIRST_RATIO * (ROW * k as f64).exp() * self.guide.thickness_m();
        let solve = || log_stiffness_gradient(&self.guide, radius_m);
        self.rows[k].get_or_init(solve).as_ref()
    }

    /// The guide's compliance relative to the stated one, for a contact of radius a (m): one, with
    /// its errors by [`Source::Guide`] and [`Source::PixelSize`]. `None` if the layer equation
    /// cannot be solved.
    pub(crate) fn compliance(&self, radius_m: f64) -> Option<Uncertain> {
        let ratio = radius_m / self.guide.thickness_m();
        if !(ratio > 0.0 && ratio <= LAST_RATIO) {
            return None;
        }
        // Below the first row the guide is a half-space.
        let at = (ratio / FIRST_RATIO).ln().max(0.0);
        let first = ((at / ROW) as usize)
            .saturating_sub(1)
            .min(self.rows.len() - 4);
        let mut rows = [None; 4];
        for (i, row) in rows.iter_mut().enumerate() {
            *row = Some(self.row(first + i)?);
        }
        let mut weights = [0.0; 4];
        for (i, weight) in weights.iter_mut().enumerate() {
            let unit = |j: usize| (ROW * (first + j) as f64, f64::from(i == j));
            *weight = cubic([unit(0), unit(1), unit(2), unit(3)], at).0;
        }
        let slope = |k: usize| {
            let terms = rows.iter().flatten().zip(weights);
            terms.map(|(row, weight)| weight * row[k]).sum::<f64>()
        };
        let n = self.covariance.nrows();
        let (mut variance, mut of_pixels) = (0.0, 0.0);
        for i in 0..n {
            let by_others: f64 = (0..n).map(|j| self.covariance[(i, j)] * slope(j)).sum();
            variance += slope(i) * by_others;
            of_pixels -= slope(i) * self.by_pixel_size[i];
        }
        let all = variance.max(0.0).sqrt();
        let of_pixels = of_pixels.clamp(-all, all);
        let rest = (all * all - of_pixels * of_pixels).sqrt();
        let factor = Uncertain::exact(1.0).by(Source::Guide, rest);
        Some(factor.by(Source::PixelSize, of_pixels))
    }
}

/// Rows that are already solved are not part of the value.
impl PartialEq for GuideErrors {
    fn eq(&self, other: &Self) -> bool {
        let known = |errors: &Self| (errors.guide.clone(), errors.covariance.clone());
        known(self) == known(other) && self.by_pixel_size == other.by_pixel_size
    }
}

#[cfg(test)]
#[path = "guide_tests.rs"]
mod tests;
