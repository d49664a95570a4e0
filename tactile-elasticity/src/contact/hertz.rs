//! Hertz's contact of two elastic bodies with spherical surfaces.

use crate::error::{ElasticityError, Quantity, poisson};
use std::f64::consts::PI;

/// A sphere pressed with a known force (Johnson 1985, *Contact Mechanics*, §4.2).
///
/// a = (3FR/4E*)^⅓, δ = a²/R, p₀ = 3F/(2πa²), pressure p₀√(1 − r²/a²). Good for a/R up to about
/// 0.3.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// let contact = HertzContact::from_force(0.05, 0.003, 26_666.7)?;
/// assert!((contact.contact_radius_m - 1.6158e-3f64).abs() < 1e-7);
/// // Far too large for Hertz: squeezed, not touched.
/// assert!(contact.contact_radius_m / contact.radius_m > 0.5);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct HertzContact {
    /// F.
    pub force_n: f64,
    /// R, the relative radius of curvature.
    pub radius_m: f64,
    /// E*.
    pub reduced_modulus_pa: f64,
    /// a.
    pub contact_radius_m: f64,
    /// δ, by which far points of the bodies approach.
    pub indentation_m: f64,
    /// p₀, in the centre.
    pub peak_pressure_pa: f64,
    /// F/(πa²) = ⅔ p₀.
    pub mean_pressure_pa: f64,
    /// dF/dδ = 2 E* a.
    pub stiffness_n_per_m: f64,
}

impl HertzContact {
    /// From force (N, zero allowed), relative radius (m) and reduced modulus (Pa).
    ///
    /// # Errors
    /// [`ElasticityError::Negative`] force, [`ElasticityError::NotPositive`] radius or modulus.
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

    /// Pressure at distance r (m) from the centre, p₀√(1 − r²/a²), zero outside.
    ///
    /// ```
    /// use tactile_elasticity::contact::HertzContact;
    ///
    /// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 50e3)?;
    /// assert_eq!(contact.pressure_pa(0.0), contact.peak_pressure_pa);
    /// assert_eq!(contact.pressure_pa(1.01 * contact.contact_radius_m), 0.0);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn pressure_pa(&self, r: f64) -> f64 {
        let a = self.contact_radius_m;
        if r.abs() < a {
            self.peak_pressure_pa * ((1.0 - r / a) * (1.0 + r / a)).sqrt()
        } else {
            0.0
        }
    }
}

/// Normal displacement (m) at distance r of a half-space under p₀√(1 − r²/a²) (Johnson 1985, eq.
/// 3.42).
///
/// Inside π p₀(2a² − r²)/(4aE*). Outside p₀/(2aE*)·[(2a² − r²) asin(a/r) + a√(r² − a²)], which
/// cancels as (r/a)² and is summed beyond r = 2a as ½ p₀ a/E* Σ 4 b_k (a/r)^(2k+1)/((2k+1)(2k+3)),
/// b_k = (2k)!/(4ᵏ k!²): all terms positive.
///
/// ```
/// use tactile_elasticity::contact::hertz_surface_displacement_m;
/// // A distant point sees a point force: F/(π E* r), with F = ⅔ π a² p₀.
/// let far = hertz_surface_displacement_m(1e8, 1.0, 1.0, 1.0);
/// assert!((far * 1e8 - 2.0f64 / 3.0).abs() < 1e-15);
/// // Under a rigid sphere the rim has sunk half as deep as the centre.
/// let c = tactile_elasticity::contact::HertzContact::from_force(1e-3_f64, 5e-3, 50e3)?;
/// let depth = |r| {
///     hertz_surface_displacement_m(r, c.contact_radius_m, c.peak_pressure_pa, 50e3)
///         / c.indentation_m
/// };
/// assert!((depth(0.0) - 1.0).abs() < 1e-14 && (depth(c.contact_radius_m) - 0.5).abs() < 1e-14);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn hertz_surface_displacement_m(
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
        // asin(a/r) through its tangent: near the rim a/r has lost what r − a keeps.
        return unit * 0.5 * ((2.0 - y * y) * 1f64.atan2(chord) + chord);
    }
    unit * 0.5 * far_series(x)
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
    /// From Young's modulus (Pa) and Poisson's ratio.
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
    Quantity::ReducedModulus.positive(compliance)?;
    Ok(1.0 / compliance)
}

/// R of two surfaces, 1/R = 1/R₁ + 1/R₂, in m. `None` is a flat surface, a negative radius a hollow
/// one.
///
/// # Errors
/// [`ElasticityError::Conforming`] where the relative curvature is zero or negative.
/// [`ElasticityError::NotFinite`], or [`ElasticityError::NotPositive`] for a radius of zero.
///
/// ```
/// use tactile_elasticity::{ElasticityError, contact::relative_radius_m};
/// assert_eq!(relative_radius_m(Some(0.005), None)?, 0.005);
/// assert!(matches!(
///     relative_radius_m(Some(0.01), Some(-0.01)),
///     Err(ElasticityError::Conforming { .. })
/// ));
/// # Ok::<(), ElasticityError>(())
/// ```
pub fn relative_radius_m(one: Option<f64>, other: Option<f64>) -> Result<f64, ElasticityError> {
    for radius in [one, other].into_iter().flatten() {
        let radius = Quantity::Radius.finite(radius)?;
        if radius == 0.0 {
            return Err(ElasticityError::NotPositive {
                quantity: Quantity::Radius,
                found: radius,
            });
        }
    }
    let radius = match (one, other) {
        (Some(a), Some(b)) => {
            // The sum of the radii is exact where they nearly cancel. That of the curvatures is
            // not.
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

/// A flat circular punch: F = 2E*aδ.
///
/// ```
/// use tactile_elasticity::contact::flat_punch;
///
/// let contact = flat_punch(1e5_f64, 2e-3, 1e-3)?;
/// assert!(
///     (contact.mean_pressure_pa - contact.force_n / (std::f64::consts::PI * 4e-6)).abs() < 1e-9
/// );
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PunchContact {
    /// F.
    pub force_n: f64,
    /// F/(πa²). The pressure at the edge is infinite.
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
    Quantity::ReducedModulus.positive(reduced_modulus_pa)?;
    Quantity::Radius.positive(radius_m)?;
    Quantity::Indentation.not_negative(indentation_m)?;
    let force_n = 2.0 * reduced_modulus_pa * radius_m * indentation_m;
    Ok(PunchContact {
        force_n,
        mean_pressure_pa: force_n / radius_m / radius_m / PI,
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

/// Of reduced modulus E* (Pa), tangent of the half opening angle α from the axis, and indentation δ
/// (m, zero allowed).
///
/// The tangent, because an angle near 90° has lost what makes it differ. See
/// [`tangent_of_degrees`].
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
    Quantity::ReducedModulus.positive(reduced_modulus_pa)?;
    Quantity::HalfAngle.positive(half_angle_tangent)?;
    Quantity::Indentation.not_negative(indentation_m)?;
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
    let found = Quantity::HalfAngle.positive(degrees)?;
    if degrees >= 90.0 {
        return Err(Quantity::HalfAngle.beyond(found, 90.0));
    }
    let radian = PI / 180.0;
    // 90° − α is exact from 45° on.
    Ok(if degrees <= 45.0 {
        (degrees * radian).tan()
    } else {
        1.0 / ((90.0 - degrees) * radian).tan()
    })
}

// Tatara's large-deformation sphere.
//
// A sphere pressed from both sides deforms at each contact as Hertz's law says, less the
// displacement that the force on the far side causes in the contact region: Boussinesq's
// displacement at (a, 2R) under a point force,
//
// δ = a²/R − (F/πE)·[(1 − ν²)/√(a² + 4R²) + 2(1 + ν)R²/(a² + 4R²)^{3⁄2}],  a³ = 3FR/(4E*)
//
// per contact. Source: Y. Tatara, J. Eng. Mater. Technol. 113 (1991) 285–291, the extensive term.
// His lateral spreading of the free surface and the stiffening of rubber are not included.

/// δ (m) of one contact with contact radius a (m) of a sphere of radius R (m) and Poisson ratio ν
/// between rigid plates.
///
/// # Errors
/// [`ElasticityError::NotPositive`] radius, [`ElasticityError::Negative`] contact radius,
/// [`ElasticityError::PoissonRatio`].
///
/// ```
/// // At a/R = 0.1 the far side takes 4 % off Hertz's a²/R; at 0.5 a fifth.
/// let ratio =
///     |a: f64| tactile_elasticity::contact::tatara_indentation_m(a, 1.0, 0.5).unwrap() / (a * a);
/// assert!((ratio(0.1) - 0.958).abs() < 1e-3 && (ratio(0.5) - 0.800).abs() < 1e-3);
/// ```
pub fn tatara_indentation_m(
    contact_radius_m: f64,
    radius_m: f64,
    poisson_ratio: f64,
) -> Result<f64, ElasticityError> {
    let a = Quantity::ContactRadius.not_negative(contact_radius_m)?;
    let squeeze = Squeeze::new(
        Quantity::Radius.positive(radius_m)?,
        poisson(poisson_ratio)?,
        1.0,
    );
    Ok(squeeze.indentation(a))
}

/// The law in units of R: the far side counts with the sphere's share of the compliance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Squeeze {
    radius_m: f64,
    poisson_ratio: f64,
    share: f64,
}

impl Squeeze {
    pub fn new(radius_m: f64, poisson_ratio: f64, share: f64) -> Self {
        Self {
            radius_m,
            poisson_ratio,
            share,
        }
    }

    fn indentation(&self, a: f64) -> f64 {
        let x = a / self.radius_m;
        self.radius_m * (x * x - self.share * self.far_side(x))
    }

    /// (4x³/3π)·[1/√(x² + 4) + 2/((1 − ν)(x² + 4)^{3⁄2})].
    fn far_side(&self, x: f64) -> f64 {
        let q = x * x + 4.0;
        4.0 * x.powi(3) / (3.0 * PI)
            * (1.0 / q.sqrt() + 2.0 / ((1.0 - self.poisson_ratio) * q.powf(1.5)))
    }

    /// dδ/da.
    pub fn slope(&self, a: f64) -> f64 {
        let x = a / self.radius_m;
        let (q, m) = (x * x + 4.0, 2.0 / (1.0 - self.poisson_ratio));
        let bracket = 1.0 / q.sqrt() + m / q.powf(1.5);
        let derivative = -x / q.powf(1.5) - 3.0 * m * x / q.powf(2.5);
        2.0 * x - self.share * 4.0 / (3.0 * PI) * (3.0 * x * x * bracket + x.powi(3) * derivative)
    }

    /// The contact radius (m) of an indentation (m), by Newton from Hertz's. None where the law has
    /// none below a = R.
    pub fn contact_radius(&self, indentation: f64) -> Option<f64> {
        let mut a = (self.radius_m * indentation).sqrt();
        for _ in 0..60 {
            let step = (self.indentation(a) - indentation) / self.slope(a);
            a -= step;
            if !(a > 0.0 && a <= self.radius_m) {
                return None;
            }
            if step.abs() <= 1e-14 * a {
                return Some(a);
            }
        }
        None
    }
}

#[cfg(test)]
#[path = "hertz_tests.rs"]
mod tests;
