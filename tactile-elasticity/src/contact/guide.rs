//! The guide under a ball, by the parameters of its layers: its stiffness, the derivatives of it and
//! its error.

use super::{Bond, Layer, LayerEquation, Waveguide};
use nalgebra::{DMatrix, DVector};
use tactile_core::{Source, Uncertain};

/// Parameters of a layer whose errors count: ln E, ln h and ν.
pub const PARAMETERS_PER_LAYER: usize = 3;

// Step of the numerical derivatives: third powers of it are lost, rounding of the integral
// equation is far below.
const STEP: f64 = 1e-3;

/// ln of the stiffness E_g of the guide under a ball's contact of radius a, F = 4/3 E_g a³/R. None
/// where the layer equation cannot be solved.
///
/// ```
/// use tactile_elasticity::contact::{Layer, guide_log_stiffness};
/// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
/// // Under a small contact the guide is a half-space, E/(1 − ν²).
/// let stiffness_pa = guide_log_stiffness(&[gel], 1e-5).unwrap().exp();
/// assert!((stiffness_pa / 100e3 - 1.0).abs() < 0.01);
/// ```
pub fn guide_log_stiffness(layers: &[Layer], radius_m: f64) -> Option<f64> {
    let guide = Waveguide::new(layers.to_vec()).ok()?;
    let equation = LayerEquation::of_layers(&guide, Bond::Bonded).ok()?;
    let contact = equation.solve(radius_m / guide.thickness_m()).ok()?;
    let top = layers.first()?;
    let plane_strain = top.youngs_modulus_pa / (1.0 - top.poisson_ratio.powi(2));
    Some(plane_strain.ln() + contact.force_ratio_same_radius.ln())
}

/// Layers with their parameters moved by a step: ln E of all layers, then ln h, then ν, which stays
/// at most ½.
///
/// ```
/// use nalgebra::DVector;
/// use tactile_elasticity::contact::{Layer, stepped_layers};
/// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
/// let stiffer = stepped_layers(&[gel], &DVector::from_vec(vec![2_f64.ln(), 0.0, 0.1]));
/// assert!((stiffer[0].youngs_modulus_pa - 150e3).abs() < 1e-6 && stiffer[0].poisson_ratio == 0.5);
/// ```
pub fn stepped_layers(layers: &[Layer], step: &DVector<f64>) -> Vec<Layer> {
    let n = layers.len();
    let layer = |(i, layer): (usize, &Layer)| Layer {
        youngs_modulus_pa: layer.youngs_modulus_pa * step[i].exp(),
        thickness_m: layer.thickness_m * step[n + i].exp(),
        poisson_ratio: (layer.poisson_ratio + step[2 * n + i]).min(0.5),
    };
    layers.iter().enumerate().map(layer).collect()
}

/// Relative error of F = 4/3 E_g a³/R at a/R = 1 from taking a rigid ball for a parabola and strains
/// as small. It goes as (a/R)².
pub const PARABOLA_ERROR: f64 = 0.1;

/// Derivatives by parameters x of values that are `here` at x, as of forces by
/// [`stepped_layers`]'s parameters: \[value, parameter\]. Steps are downwards, as ν is at most ½.
/// Parameters that do not move have zeros. `None` if the values are.
///
/// ```
/// use nalgebra::DVector;
/// use tactile_elasticity::contact::parameter_slopes;
/// let values = |x: &DVector<f64>| Some(vec![x[0].exp(), x[0] * x[1]]);
/// let x = DVector::from_vec(vec![0.0, 2.0]);
/// let slopes = parameter_slopes(&[1.0, 0.0], &x, |k| k == 0, values).unwrap();
/// assert!((slopes[(0, 0)] - 1.0).abs() < 1e-3 && (slopes[(1, 0)] - 2.0).abs() < 1e-3);
/// assert_eq!(slopes[(1, 1)], 0.0);
/// ```
pub fn parameter_slopes(
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

/// Derivatives of [`guide_log_stiffness`] by ln E, ln h and ν of the layers, in this order.
fn log_stiffness_gradient(layers: &[Layer], radius_m: f64) -> Option<DVector<f64>> {
    let count = PARAMETERS_PER_LAYER * layers.len();
    let mut slopes = DVector::zeros(count);
    for k in 0..count {
        // ν is at most ½: it is stepped downwards alone.
        let upper = if k < 2 * layers.len() { STEP } else { 0.0 };
        let at = |value: f64| {
            let mut step = DVector::zeros(count);
            step[k] = value;
            guide_log_stiffness(&stepped_layers(layers, &step), radius_m)
        };
        slopes[k] = (at(upper)? - at(-STEP)?) / (upper + STEP);
    }
    Some(slopes)
}

/// The guide's compliance over the one stated, under a contact of radius a (m): one, with the errors
/// from the covariance of ln E of all layers, ln h and ν, [`Source::Guide`]. What one standard
/// deviation of the size of a pixel does to these parameters is a part of [`Source::PixelSize`].
/// `None` if either has another size or the layer equation cannot be solved.
///
/// ```
/// use nalgebra::{DMatrix, DVector};
/// use tactile_elasticity::contact::{Layer, Waveguide, guide_compliance};
/// use tactile_elasticity::modulus::Source;
/// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
/// let gel = Waveguide::new(vec![gel])?;
/// // Two per cent of the modulus are two per cent of the compliance, a stiffer gel yields less.
/// let covariance = DMatrix::from_diagonal(&vec![4e-4, 0.0, 0.0].into());
/// let by_pixel_size = DVector::from_column_slice(&[0.01, 0.0, 0.0]);
/// let factor = guide_compliance(&gel, &covariance, Some(&by_pixel_size), 1e-3).unwrap();
/// assert!((factor.standard_error() - 0.02).abs() < 1e-6);
/// assert!((factor.part(Source::PixelSize) + 0.01).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn guide_compliance(
    guide: &Waveguide,
    covariance: &DMatrix<f64>,
    by_pixel_size: Option<&DVector<f64>>,
    radius_m: f64,
) -> Option<Uncertain> {
    let slopes = log_stiffness_gradient(guide.layers(), radius_m)?;
    let n = slopes.len();
    if covariance.shape() != (n, n) || by_pixel_size.is_some_and(|v| v.len() != n) {
        return None;
    }
    let all = slopes.dot(&(covariance * &slopes)).max(0.0).sqrt();
    let of_pixels = by_pixel_size
        .map_or(0.0, |v| -slopes.dot(v))
        .clamp(-all, all);
    let rest = (all * all - of_pixels * of_pixels).sqrt();
    let factor = Uncertain::exact(1.0).by(Source::Guide, rest);
    Some(factor.by(Source::PixelSize, of_pixels))
}

#[cfg(test)]
#[path = "guide_tests.rs"]
mod tests;
