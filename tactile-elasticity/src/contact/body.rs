//! The two bodies of a contact: their moduli and curvatures as one.

use crate::error::{ElasticityError, Quantity, finite, poisson, positive};

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
    /// From Young's modulus (Pa) and Poisson's ratio.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn elastic(youngs_modulus_pa: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        positive(youngs_modulus_pa, Quantity::YoungsModulus)?;
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
}

/// E* of two bodies, 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂, in Pa.
///
/// # Errors
/// [`ElasticityError::NotPositive`] where both are rigid.
///
/// ```
/// use tactile_elasticity::contact::{Body, reduced_modulus_pa};
/// let gel = Body::elastic(20_000.0, 0.5)?;
/// assert!((reduced_modulus_pa(Body::rigid(), gel)? - 20_000.0f64 / 0.75).abs() < 1e-9);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn reduced_modulus_pa(one: Body, other: Body) -> Result<f64, ElasticityError> {
    let compliance = one.compliance_per_pa + other.compliance_per_pa;
    positive(compliance, Quantity::ReducedModulus)?;
    Ok(1.0 / compliance)
}

/// R of two surfaces, 1/R = 1/R₁ + 1/R₂, in m; `None` is a flat surface, a negative radius a hollow one.
///
/// # Errors
/// [`ElasticityError::Conforming`] where the relative curvature is zero or negative;
/// [`ElasticityError::NotFinite`], or [`ElasticityError::NotPositive`] for a radius of zero.
///
/// ```
/// use tactile_elasticity::{ElasticityError, contact::relative_radius_m};
/// assert_eq!(relative_radius_m(Some(0.005), None)?, 0.005);
/// assert!(matches!(relative_radius_m(Some(0.01), Some(-0.01)), Err(ElasticityError::Conforming { .. })));
/// # Ok::<(), ElasticityError>(())
/// ```
pub fn relative_radius_m(one: Option<f64>, other: Option<f64>) -> Result<f64, ElasticityError> {
    for radius in [one, other].into_iter().flatten() {
        let radius = finite(radius, Quantity::Radius)?;
        if radius == 0.0 {
            return Err(ElasticityError::NotPositive {
                quantity: Quantity::Radius,
                found: radius,
            });
        }
    }
    let radius = match (one, other) {
        (Some(a), Some(b)) => {
            // The sum of the radii is exact where they nearly cancel; that of the curvatures is not.
            let curvature = (a + b) / a / b;
            if curvature <= 0.0 {
                return Err(ElasticityError::Conforming {
                    curvature_per_m: curvature,
                });
            }
            a / (a + b) * b
        }
        (Some(radius), None) | (None, Some(radius)) => radius,
        (None, None) => {
            return Err(ElasticityError::Conforming {
                curvature_per_m: 0.0,
            });
        }
    };
    if radius > 0.0 {
        Ok(radius)
    } else {
        Err(ElasticityError::Conforming {
            curvature_per_m: 1.0 / radius,
        })
    }
}

/// Young's modulus (Pa) of one body from E* and the other body: E = (1 − ν²)/(1/E* − (1 − ν₁²)/E₁).
///
/// # Errors
/// [`ElasticityError::StifferThanResolvable`] where the other body alone is already softer than the contact;
/// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
///
/// ```
/// use tactile_elasticity::{ElasticityError, contact::{Body, sample_modulus_pa}};
/// let waveguide = Body::elastic(100e3, 0.48)?;
/// let soft = sample_modulus_pa(50e3, 0.48, waveguide)?;
/// assert!(soft > 50e3);
/// assert!(matches!(sample_modulus_pa(150e3, 0.48, waveguide), Err(ElasticityError::StifferThanResolvable { .. })));
/// # Ok::<(), ElasticityError>(())
/// ```
pub fn sample_modulus_pa(
    reduced_modulus_pa: f64,
    poisson_ratio: f64,
    other: Body,
) -> Result<f64, ElasticityError> {
    positive(reduced_modulus_pa, Quantity::ReducedModulus)?;
    poisson(poisson_ratio)?;
    // 1/E* − C = (1 − C E*)/E*, the product rounded once.
    let left = (-other.compliance_per_pa).mul_add(reduced_modulus_pa, 1.0);
    if left <= 0.0 {
        return Err(ElasticityError::StifferThanResolvable {
            lower_bound_pa: None,
        });
    }
    Ok((1.0 - poisson_ratio) * (1.0 + poisson_ratio) * reduced_modulus_pa / left)
}
