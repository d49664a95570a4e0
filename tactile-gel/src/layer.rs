//! The layer of gel on its plate.

use tactile_elasticity::ElasticityError;
use tactile_elasticity::contact::{Layer, Waveguide};

/// The layer of gel on its rigid plate, with the names used in `[gel]` of sensor files.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[non_exhaustive]
pub struct GelLayer {
    /// Thickness in metres.
    pub thickness_m: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Young's modulus in pascals.
    pub youngs_modulus_pa: f64,
    /// Standard error of Young's modulus in pascals.
    pub youngs_modulus_error_pa: f64,
}

impl GelLayer {
    /// Creates a layer from its thickness in metres, Poisson's ratio, and Young's modulus with its
    /// standard error in pascals.
    pub fn new(thickness_m: f64, poisson_ratio: f64, youngs_modulus_pa: [f64; 2]) -> Self {
        let [youngs_modulus_pa, youngs_modulus_error_pa] = youngs_modulus_pa;
        Self {
            thickness_m,
            poisson_ratio,
            youngs_modulus_pa,
            youngs_modulus_error_pa,
        }
    }

    /// Default Poisson ratio, that of silicones, which are nearly incompressible.
    pub const DEFAULT_POISSON_RATIO: f64 = 0.48;

    /// The layer in the form used by the contact laws.
    ///
    /// # Errors
    /// [`ElasticityError`] for a layer with an invalid thickness, modulus or Poisson ratio.
    pub fn guide(&self) -> Result<Waveguide, ElasticityError> {
        Waveguide::new(vec![Layer {
            thickness_m: self.thickness_m,
            youngs_modulus_pa: self.youngs_modulus_pa,
            poisson_ratio: self.poisson_ratio,
        }])
    }
}
