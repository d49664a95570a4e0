//! Hertz's contact of two elastic bodies with spherical surfaces.

use crate::error::{ElasticityError, Quantity, not_negative, positive};
use crate::scalar::{narrow, widen};
use nalgebra::RealField;

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
pub struct HertzContact<T> {
    /// F.
    pub force_n: T,
    /// R, the relative radius of curvature.
    pub radius_m: T,
    /// E*.
    pub reduced_modulus_pa: T,
    /// a.
    pub contact_radius_m: T,
    /// δ, by which far points of the bodies approach.
    pub indentation_m: T,
    /// p₀, in the centre.
    pub peak_pressure_pa: T,
    /// F/(πa²) = ⅔ p₀.
    pub mean_pressure_pa: T,
    /// dF/dδ = 2 E* a.
    pub stiffness_n_per_m: T,
}

impl<T: RealField + Copy> HertzContact<T> {
    /// From force (N, zero allowed), relative radius (m) and reduced modulus (Pa).
    ///
    /// # Errors
    /// [`ElasticityError::Negative`] force, [`ElasticityError::NotPositive`] radius or modulus.
    pub fn from_force(
        force_n: T,
        radius_m: T,
        reduced_modulus_pa: T,
    ) -> Result<Self, ElasticityError> {
        not_negative(widen(force_n), Quantity::Force)?;
        positive(widen(radius_m), Quantity::Radius)?;
        positive(widen(reduced_modulus_pa), Quantity::ReducedModulus)?;
        let three_quarters: T = narrow(0.75);
        let a = (three_quarters * force_n / reduced_modulus_pa * radius_m).cbrt();
        let mean = if a > T::zero() {
            force_n / a / a / T::pi()
        } else {
            T::zero()
        };
        Ok(Self {
            force_n,
            radius_m,
            reduced_modulus_pa,
            contact_radius_m: a,
            indentation_m: a / radius_m * a,
            peak_pressure_pa: mean * narrow(1.5),
            mean_pressure_pa: mean,
            stiffness_n_per_m: reduced_modulus_pa * a * narrow(2.0),
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
    pub fn pressure_pa(&self, r: T) -> T {
        let a = self.contact_radius_m;
        if r.abs() < a {
            self.peak_pressure_pa * ((T::one() - r / a) * (T::one() + r / a)).sqrt()
        } else {
            T::zero()
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
pub fn hertz_surface_displacement_m<T: RealField + Copy>(
    r: T,
    a: T,
    peak_pressure_pa: T,
    reduced_modulus_pa: T,
) -> T {
    let r = r.abs();
    if a <= T::zero() {
        return T::zero();
    }
    let unit = peak_pressure_pa * a / reduced_modulus_pa;
    let two: T = narrow(2.0);
    if r <= a {
        let x = r / a;
        return unit * T::frac_pi_4() * (two - x * x);
    }
    let half: T = narrow(0.5);
    let x = a / r;
    if x > half {
        let y = r / a;
        let chord = ((r - a) / a * ((r + a) / a)).sqrt();
        // asin(a/r) through its tangent: near the rim a/r has lost what r − a keeps.
        return unit * half * ((two - y * y) * T::one().atan2(chord) + chord);
    }
    unit * half * far_series(x)
}

fn far_series<T: RealField + Copy>(x: T) -> T {
    let (mut power, mut b, mut sum) = (x, T::one(), T::zero());
    for k in 0..40 {
        let k: T = narrow(f64::from(k));
        let odd = k + k + T::one();
        let term = b * power * narrow(4.0) / (odd * (odd + narrow(2.0)));
        sum += term;
        if term <= sum * T::default_epsilon() {
            break;
        }
        b *= odd / (odd + T::one());
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
pub fn reduced_modulus_from_contact_radius<T: RealField + Copy>(
    force_n: T,
    radius_m: T,
    contact_radius_m: T,
) -> Result<T, ElasticityError> {
    positive(widen(force_n), Quantity::Force)?;
    positive(widen(radius_m), Quantity::Radius)?;
    positive(widen(contact_radius_m), Quantity::ContactRadius)?;
    let a = contact_radius_m;
    Ok(narrow::<T>(0.75) * (force_n / a) / a * (radius_m / a))
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
pub fn reduced_modulus_from_indentation<T: RealField + Copy>(
    force_n: T,
    radius_m: T,
    indentation_m: T,
) -> Result<T, ElasticityError> {
    positive(widen(force_n), Quantity::Force)?;
    positive(widen(radius_m), Quantity::Radius)?;
    positive(widen(indentation_m), Quantity::Indentation)?;
    Ok(narrow::<T>(0.75) * (force_n / indentation_m) / (radius_m * indentation_m).sqrt())
}
