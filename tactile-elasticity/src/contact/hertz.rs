//! Hertz's contact of two elastic bodies with spherical surfaces.

use crate::error::{ElasticityError, Quantity, not_negative, positive};

/// A sphere pressed with a known force (Johnson 1985, *Contact Mechanics*, §4.2).
///
/// a = (3FR/4E*)^⅓, δ = a²/R, p₀ = 3F/(2πa²), pressure p₀√(1 − r²/a²). Good for a/R up to about 0.3.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// let contact = HertzContact::from_force(0.05, 0.003, 26_666.7)?;
/// assert!((contact.contact_radius_m - 1.6158e-3f64).abs() < 1e-7);
/// assert!(contact.contact_radius_m / contact.radius_m > 0.5); // far too large for Hertz: squeezed, not touched
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
        not_negative(force_n, Quantity::Force)?;
        positive(radius_m, Quantity::Radius)?;
        positive(reduced_modulus_pa, Quantity::ReducedModulus)?;
        let three_quarters: f64 = 0.75;
        let a = (three_quarters * force_n / reduced_modulus_pa * radius_m).cbrt();
        let mean = if a > 0.0 {
            force_n / a / a / std::f64::consts::PI
        } else {
            0.0
        };
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

/// Normal displacement (m) at distance r of a half-space under p₀√(1 − r²/a²) (Johnson 1985, eq. 3.42).
///
/// Inside π p₀(2a² − r²)/(4aE*); outside p₀/(2aE*)·[(2a² − r²) asin(a/r) + a√(r² − a²)], which cancels as (r/a)²
/// and is summed beyond r = 2a as ½ p₀ a/E* Σ 4 b_k (a/r)^(2k+1)/((2k+1)(2k+3)), b_k = (2k)!/(4ᵏ k!²): all terms positive.
///
/// ```
/// use tactile_elasticity::contact::hertz_surface_displacement_m;
/// // A distant point sees a point force: F/(π E* r), with F = ⅔ π a² p₀.
/// let far = hertz_surface_displacement_m(1e8, 1.0, 1.0, 1.0);
/// assert!((far * 1e8 - 2.0f64 / 3.0).abs() < 1e-15);
/// // Under a rigid sphere the rim has sunk half as deep as the centre.
/// let c = tactile_elasticity::contact::HertzContact::from_force(1e-3_f64, 5e-3, 50e3)?;
/// let depth = |r| hertz_surface_displacement_m(r, c.contact_radius_m, c.peak_pressure_pa, 50e3) / c.indentation_m;
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
    let two: f64 = 2.0;
    if r <= a {
        let x = r / a;
        return unit * std::f64::consts::FRAC_PI_4 * (two - x * x);
    }
    let half: f64 = 0.5;
    let x = a / r;
    if x > half {
        let y = r / a;
        let chord = ((r - a) / a * ((r + a) / a)).sqrt();
        // asin(a/r) through its tangent: near the rim a/r has lost what r − a keeps.
        return unit * half * ((two - y * y) * 1f64.atan2(chord) + chord);
    }
    unit * half * far_series(x)
}

fn far_series(x: f64) -> f64 {
    let (mut power, mut b, mut sum) = (x, 1.0, 0.0);
    for k in 0..40 {
        let k: f64 = f64::from(k);
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

/// E* = 3FR/(4a³) from a force (N) and the contact radius (m) it makes.
///
/// # Errors
/// [`ElasticityError::NotPositive`].
///
/// ```
/// use tactile_elasticity::contact::{HertzContact, reduced_modulus_from_contact_radius};
///
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 50e3)?;
/// let back = reduced_modulus_from_contact_radius(1e-3, 5e-3, contact.contact_radius_m)?;
/// assert!((back - 50e3).abs() < 1e-9);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn reduced_modulus_from_contact_radius(
    force_n: f64,
    radius_m: f64,
    contact_radius_m: f64,
) -> Result<f64, ElasticityError> {
    positive(force_n, Quantity::Force)?;
    positive(radius_m, Quantity::Radius)?;
    positive(contact_radius_m, Quantity::ContactRadius)?;
    let a = contact_radius_m;
    Ok(0.75 * (force_n / a) / a * (radius_m / a))
}

/// E* = 3F/(4√R δ^{3⁄2}) from a force (N) and the indentation (m) it makes.
///
/// # Errors
/// [`ElasticityError::NotPositive`].
///
/// ```
/// use tactile_elasticity::contact::{HertzContact, reduced_modulus_from_indentation};
///
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 50e3)?;
/// let back = reduced_modulus_from_indentation(1e-3, 5e-3, contact.indentation_m)?;
/// assert!((back - 50e3).abs() < 1e-9);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn reduced_modulus_from_indentation(
    force_n: f64,
    radius_m: f64,
    indentation_m: f64,
) -> Result<f64, ElasticityError> {
    positive(force_n, Quantity::Force)?;
    positive(radius_m, Quantity::Radius)?;
    positive(indentation_m, Quantity::Indentation)?;
    Ok(0.75 * (force_n / indentation_m) / (radius_m * indentation_m).sqrt())
}
