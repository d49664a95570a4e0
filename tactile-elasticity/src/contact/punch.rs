//! Rigid flat punch and cone on a half-space (Sneddon 1965).

use crate::error::{ElasticityError, Quantity, not_negative, positive};

/// A flat circular punch: F = 2E*aδ.
///
/// ```
/// use tactile_elasticity::contact::flat_punch;
///
/// let contact = flat_punch(1e5_f64, 2e-3, 1e-3)?;
/// assert!((contact.mean_pressure_pa - contact.force_n / (std::f64::consts::PI * 4e-6)).abs() < 1e-9);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PunchContact {
    /// F.
    pub force_n: f64,
    /// F/(πa²); the pressure at the edge is infinite.
    pub mean_pressure_pa: f64,
}

/// Of reduced modulus E* (Pa), punch radius a (m) and indentation δ (m, zero allowed).
///
/// # Errors
/// [`ElasticityError::NotPositive`], [`ElasticityError::Negative`].
///
/// ```
/// let contact = tactile_elasticity::contact::flat_punch(1e5, 2e-3, 1e-3)?;
/// assert!((contact.force_n - 0.4f64).abs() < 1e-15);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn flat_punch(
    reduced_modulus_pa: f64,
    radius_m: f64,
    indentation_m: f64,
) -> Result<PunchContact, ElasticityError> {
    positive(reduced_modulus_pa, Quantity::ReducedModulus)?;
    positive(radius_m, Quantity::Radius)?;
    not_negative(indentation_m, Quantity::Indentation)?;
    let force_n = 2.0 * reduced_modulus_pa * radius_m * indentation_m;
    Ok(PunchContact {
        force_n,
        mean_pressure_pa: force_n / radius_m / radius_m / std::f64::consts::PI,
    })
}

/// A cone: F = (2/π)E* tan α δ².
///
/// ```
/// use tactile_elasticity::contact::cone;
///
/// // Twice as deep, four times the force, the same pressure.
/// let [once, twice] = [cone(1e5_f64, 1.0, 1e-4)?, cone(1e5, 1.0, 2e-4)?];
/// assert!((twice.force_n / once.force_n - 4.0).abs() < 1e-14);
/// assert_eq!(twice.mean_pressure_pa, once.mean_pressure_pa);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ConeContact {
    /// F.
    pub force_n: f64,
    /// a = (2/π)δ tan α.
    pub contact_radius_m: f64,
    /// E*/(2 tan α), whatever the load.
    pub mean_pressure_pa: f64,
}

/// Of reduced modulus E* (Pa), tangent of the half opening angle α from the axis, and indentation δ (m, zero allowed).
///
/// The tangent, because an angle near 90° has lost what makes it differ; see [`tangent_of_degrees`].
///
/// # Errors
/// [`ElasticityError::NotPositive`], [`ElasticityError::Negative`].
///
/// ```
/// use tactile_elasticity::contact::{cone, tangent_of_degrees};
/// let contact = cone(1.0, tangent_of_degrees(45.0)?, 0.5)?;
/// assert!((contact.mean_pressure_pa - 0.5f64).abs() < 1e-15);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn cone(
    reduced_modulus_pa: f64,
    half_angle_tangent: f64,
    indentation_m: f64,
) -> Result<ConeContact, ElasticityError> {
    positive(reduced_modulus_pa, Quantity::ReducedModulus)?;
    positive(half_angle_tangent, Quantity::HalfAngle)?;
    not_negative(indentation_m, Quantity::Indentation)?;
    let slope = half_angle_tangent * indentation_m * std::f64::consts::FRAC_2_PI;
    Ok(ConeContact {
        force_n: reduced_modulus_pa * slope * indentation_m,
        contact_radius_m: slope,
        mean_pressure_pa: reduced_modulus_pa / half_angle_tangent * 0.5,
    })
}

/// tan of an angle in degrees in (0, 90), accurate up to its last digit at both ends.
///
/// # Errors
/// [`ElasticityError::OutOfRange`], [`ElasticityError::NotPositive`].
///
/// ```
/// use tactile_elasticity::contact::tangent_of_degrees;
///
/// // A needle of 10⁻¹⁰ degrees from the surface: tan(π/2 − x) = 1/x.
/// let blunt = tangent_of_degrees(90.0_f64 - f64::powi(2.0, -33))?;
/// assert!((blunt * (f64::powi(2.0, -33) * std::f64::consts::PI / 180.0) - 1.0).abs() < 1e-15);
/// assert!(tangent_of_degrees(90.0_f64).is_err());
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn tangent_of_degrees(degrees: f64) -> Result<f64, ElasticityError> {
    let found = positive(degrees, Quantity::HalfAngle)?;
    let right: f64 = 90.0;
    if degrees >= right {
        return Err(ElasticityError::OutOfRange {
            quantity: Quantity::HalfAngle,
            found,
            limit: 90.0,
        });
    }
    let radian = std::f64::consts::PI / 180.0;
    let half: f64 = 45.0;
    // 90° − α is exact from 45° on.
    Ok(if degrees <= half {
        (degrees * radian).tan()
    } else {
        1.0 / ((right - degrees) * radian).tan()
    })
}
