//! Soft layers on glass: what objects are pressed on.

use super::material::Material;
use crate::error::{Quantity, positive};
use tactile_elasticity::ElasticityError;

/// A layer of a [`Guide`].
///
/// ```
/// use tactile_fem::{Layer, Material};
///
/// let epidermis = Layer { thickness_m: 2e-3, material: Material::new(136e3, 0.495).unwrap() };
/// assert_eq!(epidermis.material.youngs_modulus_pa(), 136e3);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Layer {
    /// Thickness, in metres.
    pub thickness_m: f64,
    /// What it is made of.
    pub material: Material,
}

/// A soft guide: bonded layers, the first towards the object, the last bonded to rigid glass.
///
/// ```
/// use tactile_fem::{Guide, Layer, Material};
///
/// let layer = |thickness_m, modulus| Layer { thickness_m, material: Material::new(modulus, 0.495).unwrap() };
/// let guide = Guide::new(vec![layer(2e-3, 136e3), layer(3e-3, 80e3), layer(5e-3, 34e3)], 25e-3).unwrap();
/// assert_eq!((guide.layers().len(), guide.radius_m()), (3, 25e-3));
/// assert!(Guide::new(vec![], 25e-3).is_err());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Guide {
    layers: Vec<Layer>,
    radius_m: f64,
}

impl Guide {
    /// Layers from the object's side to the glass, and the guide's radius in metres.
    ///
    /// # Errors
    /// No layer; a thickness or a radius that is not positive.
    pub fn new(layers: Vec<Layer>, radius_m: f64) -> Result<Self, ElasticityError> {
        positive(radius_m, Quantity::Radius)?;
        if layers.is_empty() {
            return Err(ElasticityError::LengthMismatch {
                quantity: Quantity::Layers,
                expected: 1,
                found: 0,
            });
        }
        for layer in &layers {
            positive(layer.thickness_m, Quantity::Thickness)?;
        }
        Ok(Self { layers, radius_m })
    }

    /// The layers, from the object's side.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Its radius, in metres.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    pub(super) fn thicknesses(&self) -> Vec<f64> {
        self.layers.iter().map(|layer| layer.thickness_m).collect()
    }

    pub(super) fn materials(&self) -> Vec<Material> {
        self.layers.iter().map(|layer| layer.material).collect()
    }
}
