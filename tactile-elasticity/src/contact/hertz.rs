//! Hertz's contact of two elastic bodies with spherical surfaces.

use crate::error::{ElasticityError, Quantity, poisson};
use std::f64::consts::PI;

/// A sphere pressed with a known force (Johnson 1985, *Contact Mechanics*, §4.2).
///
/// a = (3FR/4E*)^⅓, δ = a²/R, p₀ = 3F/(2πa²), pressure p₀√(1 − r²/a²). It is accurate for a/R up to
/// about 0.3.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// let contact = HertzContact::from_force(0.05, 0.003, 26_666.7)?;
/// assert!((contact.contact_radius_m - 1.6158e-3f64).abs() < 1e-7);
/// // Far outside the range of Hertz: the ball is squeezed.
/// assert!(contact.contact_radius_m / contact.radius_m > 0.5);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct HertzContact {
    /// F.
    pub force_n: f64,
    /// R, the relative radius of curvature.
    pub radius_m: f64,
    /// E*.
    pub reduced_modulus_pa: f64,
    /// a.
    pub contact_radius_m: f64,
    /// Indentation δ, the approach of distant points of the bodies.
    pub indentation_m: f64,
    /// Pressure p₀ at the centre.
    pub peak_pressure_pa: f64,
    /// F/(πa²) = ⅔ p₀.
    pub mean_pressure_pa: f64,
    /// dF/dδ = 2 E* a.
    pub stiffness_n_per_m: f64,
}

impl HertzContact {
    /// Computes the contact from force (N, zero allowed), relative radius (m) and reduced modulus
    /// (Pa).
    ///
    /// # Errors
    /// [`ElasticityError::Negative`] for the force, [`ElasticityError::NotPositive`] for radius or
    /// modulus.
    pub fn from_force(
        force_n: f64,
        radius_m: f64,
        reduced_modulus_pa: f64,
    ) -> Result<Self, ElasticityError> {
        Quantity::Force.not_negative(force_n)?;
        Quantity::Radius.positive(radius_m)?;
        Quantity::ReducedModulus.positive(reduced_modulus_pa)?;
        let a = (0.75 * force_n / reduced_modulus_pa * radius_m).cbrt();
        let mean = if a > 0.0 { force_n / a / a / PI } else { 0.0 };
        Ok(Self {
            force_n,
            radius_m,
            reduced_modulus_pa,
            contact_radius_m: a,
            indentation_m: a / radius_m * a,
            peak_pressure_pa: mean * 1.5,
            mean_pressure_pa: mean,
            stiffness_n_per_m: reduced_modulus_pa * a * 2.0,
        })
    }

    /// Normal displacement (m) at distance r of a half-space under p₀√(1 − r²/a²) (Johnson 1985,
    /// eq. 3.42).
    ///
    /// Inside the contact it is π p₀(2a² − r²)/(4aE*). Outside it is p₀/(2aE*)·[(2a² − r²)
    /// asin(a/r) + a√(r² − a²)]. Its terms cancel to (a/r)², so from r = 2a on it is summed as ½ p₀
    /// a/E* Σ 4 b_k (a/r)^(2k+1)/((2k+1)(2k+3)) with b_k = (2k)!/(4ᵏ k!²), whose terms are all
    /// positive.
    ///
    /// ```
    /// use tactile_elasticity::contact::HertzContact;
    /// // Far away the contact acts as a point force: F/(π E* r), with F = ⅔ π a² p₀.
    /// let far = HertzContact::surface_displacement_m(1e8, 1.0, 1.0, 1.0);
    /// assert!((far * 1e8 - 2.0f64 / 3.0).abs() < 1e-15);
    /// // Under a rigid sphere the rim sinks half as deep as the centre.
    /// let c = HertzContact::from_force(1e-3_f64, 5e-3, 50e3)?;
    /// let depth = |r| {
    ///     HertzContact::surface_displacement_m(r, c.contact_radius_m, c.peak_pressure_pa, 50e3)
    ///         / c.indentation_m
    /// };
    /// assert!((depth(0.0) - 1.0).abs() < 1e-14 && (depth(c.contact_radius_m) - 0.5).abs() < 1e-14);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn surface_displacement_m(
        r: f64,
        a: f64,
        peak_pressure_pa: f64,
        reduced_modulus_pa: f64,
    ) -> f64 {
        let r = r.abs();
        if a <= 0.0 {
            return 0.0;
        }
        let unit = peak_pressure_pa * a / reduced_modulus_pa;
        if r <= a {
            let x = r / a;
            return unit * std::f64::consts::FRAC_PI_4 * (2.0 - x * x);
        }
        let x = a / r;
        if x > 0.5 {
            let y = r / a;
            let chord = ((r - a) / a * ((r + a) / a)).sqrt();
            // asin(a/r) from its tangent: near the rim a/r loses digits that r − a keeps.
            return unit * 0.5 * ((2.0 - y * y) * 1f64.atan2(chord) + chord);
        }
        unit * 0.5 * far_series(x)
    }
}

fn far_series(x: f64) -> f64 {
    let (mut power, mut b, mut sum) = (x, 1.0, 0.0);
    for k in 0..40 {
        let k = f64::from(k);
        let odd = k + k + 1.0;
        let term = b * power * 4.0 / (odd * (odd + 2.0));
        sum += term;
        if term <= sum * f64::EPSILON {
            break;
        }
        b *= odd / (odd + 1.0);
        power *= x * x;
    }
    sum
}

/// An isotropic elastic body, or a rigid one.
///
/// ```
/// use tactile_elasticity::contact::Body;
///
/// let rubber = Body::elastic(1e6_f64, 0.5)?;
/// assert_eq!(rubber.compliance_per_pa(), 0.75e-6);
/// assert_eq!(Body::rigid().compliance_per_pa(), 0.0);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Body {
    compliance_per_pa: f64,
}

impl Body {
    /// Creates a body from Young's modulus (Pa) and Poisson's ratio.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn elastic(youngs_modulus_pa: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Quantity::YoungsModulus.positive(youngs_modulus_pa)?;
        poisson(poisson_ratio)?;
        Ok(Self {
            compliance_per_pa: (1.0 - poisson_ratio) * (1.0 + poisson_ratio) / youngs_modulus_pa,
        })
    }

    pub(crate) fn from_compliance(compliance_per_pa: f64) -> Self {
        Self { compliance_per_pa }
    }

    /// A rigid body, without compliance.
    pub fn rigid() -> Self {
        Self {
            compliance_per_pa: 0.0,
        }
    }

    /// (1 − ν²)/E in 1/Pa, the inverse of the plane-strain modulus.
    pub fn compliance_per_pa(&self) -> f64 {
        self.compliance_per_pa
    }

    /// E* with another body, 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂, in Pa.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`] if both are rigid.
    ///
    /// ```
    /// use tactile_elasticity::contact::Body;
    /// let gel = Body::elastic(20_000.0, 0.5)?;
    /// assert!((Body::rigid().reduced_modulus_pa(gel)? - 20_000.0f64 / 0.75).abs() < 1e-9);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn reduced_modulus_pa(self, other: Self) -> Result<f64, ElasticityError> {
        let compliance = self.compliance_per_pa + other.compliance_per_pa;
        Quantity::ReducedModulus.positive(compliance)?;
        Ok(1.0 / compliance)
    }
}
