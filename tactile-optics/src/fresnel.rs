//! Reflectance and transmittance of an interface between lossless media.
//!
//! With the cosines c₁ and c₂, and the sine s₁ of the angle of incidence:
//!
//! * r_s = (n₁c₁ − n₂c₂)/(n₁c₁ + n₂c₂) = (n₁ − n₂)(n₁ + n₂)/(n₁c₁ + n₂c₂)²,
//! * r_p = (n₂c₁ − n₁c₂)/(n₂c₁ + n₁c₂) = (n₂ − n₁)(n₂ + n₁)(n₂c₁ − n₁s₁)(n₂c₁ + n₁s₁)/(n₂(n₂c₁ +
//!   n₁c₂))²,
//! * T = 4 n₁c₁ n₂c₂/(…)² with the same denominators, never 1 − R.
//!
//! The only cancellation in the right-hand forms is that at Brewster's angle, which belongs to the
//! result. n₂c₂ is √((n₂ − n₁s₁)(n₂ + n₁s₁)). Near grazing incidence, s₁ rounds to 1, and n₂ − n₁s₁
//! is computed as (n₂ − n₁) + n₁c₁²/(1 + s₁).

use core::f64::consts::FRAC_PI_2;

#[cfg(not(feature = "std"))]
use num_traits::Float;

use crate::angle::Angle;
use crate::error::{OpticsError, index, within};

/// Reflectance, transmittance and refraction of an interface, by polarisation.
///
/// ```
/// use tactile_optics::fresnel;
///
/// // At Brewster's angle, atan(n₂/n₁), no light polarised in the plane of incidence is reflected.
/// let glass = fresnel(1.0_f64, 1.5, 1.5_f64.atan())?;
/// assert!(glass.reflectance_p < 1e-30 && glass.reflectance_s > 0.14);
/// assert!(glass.refraction.is_some());
/// assert!((glass.reflectance + glass.transmittance - 1.0).abs() < 1e-15);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Fresnel {
    /// Angle of refraction. `None` if the reflection is total.
    pub refraction: Option<Angle>,
    /// Reflectance of light polarised perpendicular to the plane of incidence.
    pub reflectance_s: f64,
    /// Reflectance of light polarised in the plane of incidence.
    pub reflectance_p: f64,
    /// Transmittance of light polarised perpendicular to the plane of incidence.
    pub transmittance_s: f64,
    /// Transmittance of light polarised in the plane of incidence.
    pub transmittance_p: f64,
    /// Reflectance of unpolarised light, the mean of both.
    pub reflectance: f64,
    /// Transmittance of unpolarised light, the mean of both.
    pub transmittance: f64,
}

impl Fresnel {
    fn total() -> Self {
        Self {
            refraction: None,
            reflectance_s: 1.0,
            reflectance_p: 1.0,
            transmittance_s: 0.0,
            transmittance_p: 0.0,
            reflectance: 1.0,
            transmittance: 0.0,
        }
    }
}

/// Fresnel's coefficients for light in a medium of index `n1` at the interface to a medium of index
/// `n2`, with the angle of `incidence` (radians, 0 to π/2).
///
/// # Errors
/// [`OpticsError::OutOfRange`] for an index that is not positive and finite, or an angle outside 0
/// to π/2.
///
/// ```
/// use tactile_optics::fresnel;
/// let glass = fresnel(1.0_f64, 1.5, 0.0)?;
/// assert!((glass.reflectance - 0.04).abs() < 1e-15);
/// let trapped = fresnel(1.40, 1.0, 0.9)?;
/// assert!(trapped.refraction.is_none() && trapped.reflectance == 1.0);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn fresnel(n1: f64, n2: f64, incidence: f64) -> Result<Fresnel, OpticsError> {
    // π/2 converted from degrees may exceed a right angle by rounding.
    within(
        "angle of incidence",
        incidence,
        0.0,
        FRAC_PI_2 * (1.0 + 1e-7),
    )?;
    let (n1, n2) = (index(n1)?, index(n2)?);
    let (sine, cosine) = (incidence.sin(), incidence.cos().max(0.0));
    let Some(b) = refracted_normal(n1, n2, sine, cosine) else {
        return Ok(Fresnel::total());
    };
    let a = n1 * cosine;
    let across = n1 * sine;
    // Amplitudes divided by the common factor: s uses n₁c₁ and n₂c₂, p uses n₂c₁ and n₁c₂ =
    // n₁(n₂c₂)/n₂.
    let (c, d) = (n2 * cosine, n1 * (b / n2));
    let step = (n1 - n2) * (n1 + n2);
    let r_s = step / ((a + b) * (a + b));
    let brewster = difference_of_products(n2, cosine, n1, sine) * (c + across);
    let r_p = step / (n2 * (c + d)) * (brewster / (n2 * (c + d)));
    let flow = 4.0 * a;
    let (reflectance_s, reflectance_p) = (r_s * r_s, r_p * r_p);
    let transmittance_s = flow / (a + b) * (b / (a + b));
    let transmittance_p = flow / (c + d) * (b / (c + d));
    Ok(Fresnel {
        refraction: Some(Angle::from_legs(across, b)),
        reflectance_s,
        reflectance_p,
        transmittance_s,
        transmittance_p,
        reflectance: (reflectance_s + reflectance_p) * 0.5,
        transmittance: (transmittance_s + transmittance_p) * 0.5,
    })
}

/// n₂ cos θ₂. `None` if the reflection is total.
fn refracted_normal(n1: f64, n2: f64, sine: f64, cosine: f64) -> Option<f64> {
    // The margin is n₂ − n₁ sin θ₁. Near grazing incidence the sine rounds to 1, and the cosine
    // keeps the digits.
    let margin = if sine > 0.8 {
        margin_from_cosine(n1, n2, sine, cosine)
    } else {
        (-n1).mul_add(sine, n2)
    };
    // A margin of 0 is the critical angle itself, at which light still propagates along the
    // interface.
    (margin >= 0.0).then(|| margin.sqrt() * (n2 + n1 * sine).sqrt())
}

/// n₂ − n₁ sin θ₁ as (n₂ − n₁) + n₁ cos² θ₁/(1 + sin θ₁), which keeps its digits if sin θ₁ is near
/// 1.
fn margin_from_cosine(n1: f64, n2: f64, sine: f64, cosine: f64) -> f64 {
    (n2 - n1) + n1 * (cosine / (1.0 + sine)) * cosine
}

/// Transmittance of unpolarised light and n₂ cos θ₂. `None` if the reflection is total. This is the
/// part of Fresnel's formulas that a ray tracer needs. It uses no angles and no fused multiply–adds
/// (which are slow unless the code is compiled for a processor that has them).
pub(crate) fn crossing(n1: f64, n2: f64, sine: f64, cosine: f64) -> Option<(f64, f64)> {
    let margin = margin_from_cosine(n1, n2, sine, cosine);
    // The transmittance at the critical angle is zero, so that a tracer may treat it as total
    // reflection.
    if margin <= 0.0 {
        return None;
    }
    let b = (margin * (n2 + n1 * sine)).sqrt();
    let a = n1 * cosine;
    let (s, p) = (a + b, n2 * cosine + n1 * (b / n2));
    let share = 2.0 * a * b * ((s * s).recip() + (p * p).recip());
    Some((share.min(1.0), b))
}

/// a·b − c·d with a correction of the rounding of each product (Kahan): the error is below 1.5 ulp
/// of the result (C.-P. Jeannerod, N. Louvet, J.-M. Muller, Math. Comp. 82 (2013) 2245–2264).
fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let cd = c * d;
    let error = (-c).mul_add(d, cd);
    a.mul_add(b, -cd) + error
}
