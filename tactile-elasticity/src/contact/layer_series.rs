//! Series in χ = √(Rδ)/h for a sphere on a layer, published and corrected.

use super::layer_kernel::{Bond, LayerKernel};
use crate::error::{ElasticityError, poisson};
use std::f64::consts::PI;

/// F/F_Hertz = Σ cₖ χᵏ, k = 0..4.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct LayerSeries {
    /// c₀..c₄.
    pub coefficients: [f64; 5],
}

impl LayerSeries {
    /// As Dimitriadis et al. print it (2002, Biophys. J. 82, 2798), by the general formula in ν:
    /// bonded α₀ = −(1.2876 − 1.4678ν + 1.3442ν²)/(1 − ν), β₀ = (0.6387 − 1.0277ν + 1.5164ν²)/(1 − ν);
    /// free α₀ = −0.347(3 − 2ν)/(1 − ν), β₀ = 0.056(5 − 2ν)/(1 − ν).
    ///
    /// Beyond the linear term it is not the solution of the contact problem: the force is 2 % low at χ = 0.27,
    /// 15 % at 0.75. The free α₀ is empirical: a layer sliding on its base does not depend on ν. Use it to compare with
    /// results obtained by it.
    ///
    /// # Errors
    /// [`ElasticityError::PoissonRatio`].
    pub fn published(bond: Bond, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        let nu = poisson(poisson_ratio)?;
        let (alpha, beta) = match bond {
            Bond::Bonded => (
                -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu),
                0.6387 - 1.0277 * nu + 1.5164 * nu * nu,
            ),
            Bond::Free => (-0.347 * (3.0 - 2.0 * nu), 0.056 * (5.0 - 2.0 * nu)),
        };
        let (alpha, beta) = (alpha / (1.0 - nu), beta / (1.0 - nu));
        let cube = alpha.powi(3);
        Ok(Self {
            coefficients: [
                1.0,
                -2.0 * alpha / PI,
                4.0 * alpha * alpha / (PI * PI),
                -8.0 / PI.powi(3) * (cube + 4.0 * PI * PI * beta / 15.0),
                16.0 * alpha / PI.powi(4) * (cube + 3.0 * PI * PI * beta / 5.0),
            ],
        })
    }

    /// The expansion of the true solution: 1 + (2m₀/π)χ + (14m₀²/3π²)χ² + 8(200m₀³ − 9π²m₂)/(135π³)χ³
    /// + 2m₀(715m₀³ − 72π²m₂)/(45π⁴)χ⁴. Within 1 % up to χ = 0.5 (ν = ½, bonded).
    ///
    /// `share` is the layer's share of the whole compliance: 1 where the other body is rigid.
    ///
    /// # Errors
    /// [`ElasticityError::PoissonRatio`].
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, LayerEquation, LayerSeries};
    ///
    /// let exact = LayerEquation::new(Bond::Bonded, 0.5)?.solve(0.5)?;
    /// let series = LayerSeries::corrected(Bond::Bonded, 0.5, 1.0)?.force_ratio(exact.chi);
    /// assert!((series / exact.force_ratio - 1.0_f64).abs() < 0.01);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn corrected(bond: Bond, poisson_ratio: f64, share: f64) -> Result<Self, ElasticityError> {
        Ok(Self::of_kernel(
            &LayerKernel::new(bond, poisson_ratio)?,
            share,
        ))
    }

    pub(crate) fn of_kernel(kernel: &LayerKernel, share: f64) -> Self {
        let (m0, m2) = kernel.moments();
        let (m0, m2) = (share * m0, share * m2);
        Self {
            coefficients: [
                1.0,
                2.0 * m0 / PI,
                14.0 * m0 * m0 / (3.0 * PI * PI),
                8.0 * (200.0 * m0.powi(3) - 9.0 * PI * PI * m2) / (135.0 * PI.powi(3)),
                2.0 * m0 * (715.0 * m0.powi(3) - 72.0 * PI * PI * m2) / (45.0 * PI.powi(4)),
            ],
        }
    }

    /// F/F_Hertz at χ.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, LayerSeries};
    /// let ratio = LayerSeries::published(Bond::Bonded, 0.5)?.force_ratio(0.1);
    /// assert!((ratio - 1.126_87f64).abs() < 1e-4);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn force_ratio(&self, chi: f64) -> f64 {
        self.coefficients
            .iter()
            .rev()
            .fold(0.0, |sum, c| sum * chi + c)
    }

    /// d ln(F/F_Hertz)/d ln χ.
    pub(crate) fn log_slope(&self, chi: f64) -> f64 {
        let weighted = |k: usize| k as f64 * self.coefficients[k] * chi.powi(k as i32);
        (1..5).map(weighted).sum::<f64>() / self.force_ratio(chi)
    }
}
