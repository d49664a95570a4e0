//! How much stiffer than a half-space layers on a rigid base are, by wavenumber.
//!
//! Under a pressure of wavenumber ξ a half-space yields by 2p/(E*ξ); layers of total thickness h by L(ξh) times that, with E* of the
//! touched one: L → 0 for long waves and 1 for short ones.

use super::quadrature::{gauss_panels, panel_edges};
use super::stack::{Stack, StackLayer};
use super::waveguide::Waveguide;
use crate::error::{ElasticityError, Quantity, poisson, positive};

/// How the layer sits on its rigid base.
///
/// ```
/// use tactile_elasticity::contact::{Bond, LayerEquation};
///
/// // Bonded to its base a layer is stiffer than one that slides.
/// let ratio = |bond| LayerEquation::new(bond, 0.5)?.solve(1.0).map(|contact| contact.force_ratio);
/// assert!(ratio(Bond::Bonded)? > 1.5 * ratio(Bond::Free)?);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Bond {
    /// No displacement at the base.
    #[default]
    Bonded,
    /// The base holds the layer down but not sideways: it slides without friction.
    Free,
}

/// The deficit 1 − L(s) of layers on a rigid base, s = ξh with h their total thickness.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LayerKernel {
    stack: Stack,
}

impl LayerKernel {
    /// Of one layer with Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::PoissonRatio`].
    pub(crate) fn new(bond: Bond, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        let layer = StackLayer {
            thickness: 1.0,
            shear_modulus: 1.0,
            poisson_ratio: poisson(poisson_ratio)?,
        };
        Ok(Self {
            stack: Stack::new(vec![layer], bond),
        })
    }

    /// Of layers bonded to one another, the touched one first; `bond` is that of the lowest to the rigid base.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`] thickness: a rigid waveguide has no layers.
    pub(crate) fn of_layers(waveguide: &Waveguide, bond: Bond) -> Result<Self, ElasticityError> {
        let total = positive(waveguide.thickness_m(), Quantity::Thickness)?;
        let layers: Vec<_> = waveguide
            .layers()
            .iter()
            .map(|layer| StackLayer {
                thickness: layer.thickness_m / total,
                shear_modulus: 0.5 * layer.youngs_modulus_pa / (1.0 + layer.poisson_ratio),
                poisson_ratio: layer.poisson_ratio,
            })
            .filter(|layer| layer.thickness > 0.0)
            .collect();
        let top = layers[0].shear_modulus;
        let in_units_of_top = |layer: StackLayer| StackLayer {
            shear_modulus: layer.shear_modulus / top,
            ..layer
        };
        let layers = layers.into_iter().map(in_units_of_top).collect();
        Ok(Self {
            stack: Stack::new(layers, bond),
        })
    }

    /// 1 − L(s): 1 for long waves, 0 for short ones; below zero where a soft layer lies under a stiff one.
    pub(crate) fn deficit(&self, s: f64) -> f64 {
        self.stack.deficit(s)
    }

    /// m₀ = ∫(1 − L) ds and m₂ = ∫s²(1 − L) ds over [0, ∞), which fix the series in χ.
    pub(crate) fn moments(&self) -> (f64, f64) {
        self.samples(0.0)
            .iter()
            .fold((0.0, 0.0), |(m0, m2), &(s, w)| (m0 + w, m2 + w * s * s))
    }

    /// Thickness of the touched layer over the total.
    pub(crate) fn top_thickness(&self) -> f64 {
        self.stack.top_thickness()
    }

    /// Nodes s and weights w·(1 − L(s)), for integrands that turn as fast as cos²(s·x).
    pub(crate) fn samples(&self, x: f64) -> Vec<(f64, f64)> {
        // The deficit falls as s²e^(−2s) in units of the touched layer: at 25 it is below 10⁻¹⁸.
        let end = 25.0 / self.top_thickness();
        // Sixteen Gauss points resolve a decay by e⁻⁵ and an argument of 16 to the last digits.
        let widest = (2.5 / self.top_thickness()).min(8.0 / x.max(f64::MIN_POSITIVE));
        gauss_panels(&panel_edges(end, 0.5, widest))
            .into_iter()
            .map(|(s, w)| (s, w * self.deficit(s)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// m₀ and m₂ of a bonded incompressible layer, computed at 60 digits.
    #[test]
    fn moments_of_a_bonded_incompressible_layer() {
        let (m0, m2) = LayerKernel::new(Bond::Bonded, 0.5).unwrap().moments();
        assert!((m0 - 1.770_216_773_37).abs() < 1e-11);
        assert!((m2 - 3.831_077_155_59).abs() < 1e-11);
    }
}
