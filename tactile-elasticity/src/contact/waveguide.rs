//! The elastic layers of a sensor.

use super::{Body, Bond, LayerEquation};
use crate::error::{ElasticityError, Quantity, poisson};
use nalgebra::{DMatrix, DVector};

/// One elastic layer of the waveguide.
///
/// ```
/// use tactile_elasticity::contact::{Layer, Waveguide};
///
/// let glass = Layer { thickness_m: 1e-3, youngs_modulus_pa: 64e9_f64, poisson_ratio: 0.2 };
/// assert!(Waveguide::new(vec![glass]).is_ok());
/// assert!(Waveguide::new(vec![Layer { poisson_ratio: 0.6, ..glass }]).is_err());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Layer {
    /// Thickness in m. Zero is allowed and counts for nothing.
    pub thickness_m: f64,
    /// Young's modulus in Pa.
    pub youngs_modulus_pa: f64,
    /// Poisson's ratio in (−1, ½].
    pub poisson_ratio: f64,
}

/// Elastic layers on a rigid base, the touched one first.
///
/// ```
/// use tactile_elasticity::contact::{Layer, Waveguide};
/// let layer = |thickness_m, youngs_modulus_pa| Layer {
///     thickness_m,
///     youngs_modulus_pa,
///     poisson_ratio: 0.48,
/// };
/// // Epidermis, dermis and subcutanea of the paper's sensor.
/// let waveguide = Waveguide::new(vec![
///     layer(2e-3, 1.36e5),
///     layer(3e-3, 8.0e4),
///     layer(5e-3, 3.4e4),
/// ])?;
/// assert!((waveguide.thickness_m() - 10e-3f64).abs() < 1e-17);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Waveguide {
    layers: Vec<Layer>,
}

impl Waveguide {
    /// From the touched layer down.
    ///
    /// # Errors
    /// No layers or no thickness at all, a negative thickness, a modulus that is not above zero, a
    /// Poisson ratio out of range.
    pub fn new(layers: Vec<Layer>) -> Result<Self, ElasticityError> {
        for layer in &layers {
            Quantity::Thickness.not_negative(layer.thickness_m)?;
            Quantity::YoungsModulus.positive(layer.youngs_modulus_pa)?;
            poisson(layer.poisson_ratio)?;
        }
        let waveguide = Self { layers };
        Quantity::Thickness.positive(waveguide.thickness_m())?;
        Ok(waveguide)
    }

    /// A rigid flat: no layers.
    ///
    /// ```
    /// use tactile_elasticity::contact::Waveguide;
    ///
    /// let flat = Waveguide::rigid();
    /// assert!(flat.layers().is_empty() && flat.as_body().compliance_per_pa() == 0.0);
    /// ```
    pub fn rigid() -> Self {
        Self { layers: Vec::new() }
    }

    /// The layers, the touched one first.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Layer, Waveguide};
    ///
    /// let layer = |thickness_m, youngs_modulus_pa| Layer {
    ///     thickness_m,
    ///     youngs_modulus_pa,
    ///     poisson_ratio: 0.48_f64,
    /// };
    /// let waveguide = Waveguide::new(vec![layer(2e-3, 1.36e5), layer(8e-3, 5.0e4)])?;
    /// assert_eq!(waveguide.layers().len(), 2);
    /// // As one deep body: the layers in series, 10 mm over 2 mm/136 kPa + 8 mm/50 kPa.
    /// let plane_strain = (1.0 - 0.48 * 0.48) / 10e-3 * (2e-3 / 1.36e5 + 8e-3 / 5e4);
    /// assert!((waveguide.as_body().compliance_per_pa() / plane_strain - 1.0).abs() < 1e-14);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Σ h in m.
    pub fn thickness_m(&self) -> f64 {
        self.sum(|_| 1.0)
    }

    /// The waveguide as one deep body: (1 − ν²)/E of the layers in series, Σ(h(1 − ν²)/E)/Σh in
    /// 1/Pa.
    ///
    /// True while the contact is small beside every layer's thickness and the layers are alike.
    pub fn as_body(&self) -> Body {
        if self.layers.is_empty() {
            return Body::rigid();
        }
        let compliance =
            self.sum(|l| (1.0 - l.poisson_ratio) * (1.0 + l.poisson_ratio) / l.youngs_modulus_pa);
        Body::from_compliance(compliance / self.thickness_m())
    }

    /// The layer that is touched, as a half-space. Rigid where there is none.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Body, Layer, Waveguide};
    ///
    /// let gel = Layer { thickness_m: 2e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
    /// assert_eq!(Waveguide::new(vec![gel])?.touched(), Body::elastic(75e3, 0.5)?);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn touched(&self) -> Body {
        let touched = self.layers.iter().find(|layer| layer.thickness_m > 0.0);
        touched.map_or_else(Body::rigid, |layer| {
            let nu = layer.poisson_ratio;
            Body::from_compliance((1.0 - nu) * (1.0 + nu) / layer.youngs_modulus_pa)
        })
    }

    fn sum(&self, density: impl Fn(&Layer) -> f64) -> f64 {
        self.layers
            .iter()
            .fold(0.0, |sum, l| sum + l.thickness_m * density(l))
    }
}

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

/// Relative standard error of the guide's compliance under a contact of radius a (m), from the
/// covariance of ln E of all layers, ln h and ν. None where that has another size or the layer
/// equation cannot be solved.
///
/// ```
/// use nalgebra::DMatrix;
/// use tactile_elasticity::contact::{Layer, guide_compliance_error};
/// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
/// // Two per cent of the modulus are two per cent of the compliance.
/// let covariance = DMatrix::from_diagonal(&vec![4e-4, 0.0, 0.0].into());
/// assert!((guide_compliance_error(&[gel], &covariance, 1e-3).unwrap() - 0.02).abs() < 1e-6);
/// ```
pub fn guide_compliance_error(
    layers: &[Layer],
    covariance: &DMatrix<f64>,
    radius_m: f64,
) -> Option<f64> {
    let slopes = log_stiffness_gradient(layers, radius_m)?;
    (covariance.nrows() == slopes.len())
        .then(|| slopes.dot(&(covariance * &slopes)).max(0.0).sqrt())
}

/// Covariance of the logarithm of the guide's compliance under a contact of radius a (m) with
/// another quantity, from its covariances with ln E of all layers, ln h and ν. None as of
/// [`guide_compliance_error`].
///
/// ```
/// use nalgebra::DVector;
/// use tactile_elasticity::contact::{Layer, guide_compliance_covariance};
///
/// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
/// // A stiffer gel yields less.
/// let with_modulus = DVector::from_column_slice(&[4e-4, 0.0, 0.0]);
/// let covariance = guide_compliance_covariance(&[gel], &with_modulus, 1e-3).unwrap();
/// assert!((covariance + 4e-4).abs() < 1e-7);
/// ```
pub fn guide_compliance_covariance(
    layers: &[Layer],
    covariances: &DVector<f64>,
    radius_m: f64,
) -> Option<f64> {
    let slopes = log_stiffness_gradient(layers, radius_m)?;
    (covariances.len() == slopes.len()).then(|| -slopes.dot(covariances))
}

#[cfg(test)]
#[path = "waveguide_tests.rs"]
mod tests;
