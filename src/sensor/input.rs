//! What is told of a sensor before its calibration.
use crate::scene::SceneLayer;

/// What a calibration presses on the sensor.
///
/// ```
/// use tactile_imaging::sensor::Indenter;
/// let ball = Indenter::Ball { radius_m: 4e-3, radius_error_m: 5e-6 };
/// assert_ne!(ball, Indenter::Punch { radius_m: 4e-3 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Indenter {
    /// A rigid ball: it teaches the curve and, by its contact radii, the layers.
    Ball {
        /// Radius in metres.
        radius_m: f64,
        /// Standard error of the radius in metres.
        radius_error_m: f64,
    },
    /// A rigid flat punch: it teaches the curve alone, as its contact radius is its own.
    Punch {
        /// Radius in metres.
        radius_m: f64,
    },
}

/// A layer as its maker states it, with standard errors. A calibration starts from these.
///
/// ```
/// use tactile_imaging::{scene::SceneLayer, sensor::LayerInput};
/// let layer = SceneLayer { refractive_index: 1.41, thickness_m: 2e-3, youngs_modulus_pa: 136e3, poisson_ratio: 0.495 };
/// let known = LayerInput { layer, thickness_error_m: 20e-6, youngs_modulus_error_pa: 14e3, poisson_ratio_error: 0.003 };
/// assert!(known.youngs_modulus_error_pa / known.layer.youngs_modulus_pa > 0.1, "to a tenth");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerInput {
    /// The stated values.
    pub layer: SceneLayer,
    /// Standard error of the thickness in metres.
    pub thickness_error_m: f64,
    /// Standard error of Young's modulus in pascals.
    pub youngs_modulus_error_pa: f64,
    /// Standard error of Poisson's ratio.
    pub poisson_ratio_error: f64,
}

impl LayerInput {
    /// Standard errors of ln E, ln h and ν.
    pub(super) fn parameter_errors(&self) -> [f64; 3] {
        [
            self.youngs_modulus_error_pa / self.layer.youngs_modulus_pa,
            self.thickness_error_m / self.layer.thickness_m,
            self.poisson_ratio_error,
        ]
    }
}
