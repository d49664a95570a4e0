//! The elastic layers of a sensor.

use super::Body;
use crate::error::{ElasticityError, Quantity, poisson};

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
    /// Thickness in m. Zero is allowed and has no effect.
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
    /// Creates the waveguide from its layers, the touched one first.
    ///
    /// # Errors
    /// An error for no layers, a total thickness of zero, a negative thickness, a modulus that is
    /// not positive, or a Poisson ratio out of range.
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

    /// A rigid flat, without layers.
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
    /// This is accurate if the contact is small compared with the thickness of each layer and the
    /// layers are similar.
    pub fn as_body(&self) -> Body {
        if self.layers.is_empty() {
            return Body::rigid();
        }
        let compliance =
            self.sum(|l| (1.0 - l.poisson_ratio) * (1.0 + l.poisson_ratio) / l.youngs_modulus_pa);
        Body::from_compliance(compliance / self.thickness_m())
    }

    /// The touched layer as a half-space. Rigid if there is none.
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
