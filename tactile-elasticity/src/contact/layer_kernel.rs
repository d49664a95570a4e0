//! How much stiffer than a half-space a layer on a rigid base is, by wavenumber.
//!
//! Under a pressure of wavenumber ξ a half-space yields by 2p/(E*ξ); a layer of thickness h by L(ξh) times that, L → 0 for
//! long waves and 1 for short ones.

use super::quadrature::panels;
use crate::error::{ElasticityError, poisson};
use crate::scalar::widen;
use nalgebra::RealField;

/// How the layer sits on its rigid base.
///
/// ```
/// use tactile_elasticity::contact::{Bond, LayerEquation, LayerKernel};
///
/// // Glued to its base a layer is stiffer than one that slides.
/// let ratio = |bond| LayerEquation::new(&LayerKernel::new(bond, 0.5)?).solve(1.0).map(|contact| contact.force_ratio);
/// assert!(ratio(Bond::Bonded)? > 1.5 * ratio(Bond::Free)?);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Bond {
    /// Glued: no displacement at the base.
    #[default]
    Bonded,
    /// Free to slide without friction.
    Free,
}

/// The kernel's deficit 1 − L(s) of a layer, s = ξh.
///
/// Bonded, k = 3 − 4ν: L = (2k sinh 2s − 4s)/(2k cosh 2s + 1 + k² + 4s²). Free: L = (cosh 2s − 1)/(sinh 2s + 2s), whatever ν.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerKernel {
    bond: Bond,
    kolosov: f64,
}

impl LayerKernel {
    /// Of a layer with Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::PoissonRatio`].
    pub fn new<T: RealField + Copy>(bond: Bond, poisson_ratio: T) -> Result<Self, ElasticityError> {
        Ok(Self {
            bond,
            kolosov: 3.0 - 4.0 * poisson(widen(poisson_ratio))?,
        })
    }

    /// 1 − L(s), in [0, 1]-ish, without cancellation or overflow.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, LayerKernel};
    ///
    /// // Long waves feel the base and move nothing; short ones do not know of it.
    /// let kernel = LayerKernel::new(Bond::Bonded, 0.5)?;
    /// assert!((kernel.deficit(0.0) - 1.0_f64).abs() < 1e-15 && kernel.deficit(30.0) < 1e-20);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn deficit(&self, s: f64) -> f64 {
        let e2 = (-2.0 * s).exp();
        match self.bond {
            Bond::Bonded => {
                let k = self.kolosov;
                let base = 1.0 + k * k + 4.0 * s * s;
                let numerator = 2.0 * k * e2 * e2 + (base + 4.0 * s) * e2;
                numerator / (k * (1.0 + e2 * e2) + base * e2)
            }
            Bond::Free if s < 1e-9 => 1.0,
            Bond::Free => {
                let numerator = 2.0 * e2 * (2.0 * s - (-2.0 * s).exp_m1());
                numerator / (-(-4.0 * s).exp_m1() + 4.0 * s * e2)
            }
        }
    }

    /// m₀ = ∫(1 − L) ds and m₂ = ∫s²(1 − L) ds over [0, ∞), which fix the series in χ.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, LayerKernel};
    /// let (m0, m2) = LayerKernel::new(Bond::Bonded, 0.5)?.moments();
    /// assert!((m0 - 1.770_216_773_37f64).abs() < 1e-10 && (m2 - 3.831_077_155_59f64).abs() < 1e-10);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn moments(&self) -> (f64, f64) {
        samples(self, 0.0)
            .iter()
            .fold((0.0, 0.0), |(m0, m2), &(s, w)| (m0 + w, m2 + w * s * s))
    }
}

/// Nodes s and weights w·(1 − L(s)), for integrands that turn as fast as cos(s·x): the deficit falls as s²e^(−2s), beyond
/// 30 it is below 10⁻²².
pub(crate) fn samples(kernel: &LayerKernel, x: f64) -> Vec<(f64, f64)> {
    panels(30.0, 12 + (2.0 * x) as usize)
        .into_iter()
        .map(|(s, w)| (s, w * kernel.deficit(s)))
        .collect()
}
