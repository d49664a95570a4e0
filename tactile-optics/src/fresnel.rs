//! Reflectance and transmittance of an interface between lossless media.
//!
//! With c₁, c₂ the cosines and s₁ the sine of incidence,
//!
//! * r_s = (n₁c₁ − n₂c₂)/(n₁c₁ + n₂c₂) = (n₁ − n₂)(n₁ + n₂)/(n₁c₁ + n₂c₂)²,
//! * r_p = (n₂c₁ − n₁c₂)/(n₂c₁ + n₁c₂) = (n₂ − n₁)(n₂ + n₁)(n₂c₁ − n₁s₁)(n₂c₁ + n₁s₁)/(n₂(n₂c₁ + n₁c₂))²,
//! * T = 4 n₁c₁ n₂c₂/(…)² with the same denominators, never 1 − R.
//!
//! The right-hand forms have no cancellation but the one at Brewster's angle, which is the answer's own. n₂c₂ is
//! √((n₂ − n₁s₁)(n₂ + n₁s₁)); towards grazing, where s₁ has rounded to 1, n₂ − n₁s₁ is taken as (n₂ − n₁) + n₁c₁²/(1 + s₁).

use crate::angle::Angle;
use crate::error::OpticsError;
use crate::real::{difference_of_products, index, real, within};
use num_traits::{Float, FloatConst};

/// Reflectance, transmittance and refraction of an interface, by polarisation.
///
/// ```
/// use tactile_optics::fresnel;
///
/// // At Brewster's angle, atan(n₂/n₁), nothing polarised in the plane of incidence is reflected.
/// let glass = fresnel(1.0_f64, 1.5, 1.5_f64.atan())?;
/// assert!(glass.reflectance_p < 1e-30 && glass.reflectance_s > 0.14);
/// assert!(glass.refraction.is_some());
/// assert!((glass.reflectance + glass.transmittance - 1.0).abs() < 1e-15);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Fresnel<T> {
    /// Angle of refraction; `None` when reflection is total.
    pub refraction: Option<Angle<T>>,
    /// Reflectance of light polarised perpendicular to the plane of incidence.
    pub reflectance_s: T,
    /// Reflectance of light polarised in the plane of incidence.
    pub reflectance_p: T,
    /// Transmittance, perpendicular.
    pub transmittance_s: T,
    /// Transmittance, in the plane.
    pub transmittance_p: T,
    /// Reflectance of unpolarised light, the mean of both.
    pub reflectance: T,
    /// Transmittance of unpolarised light, the mean of both.
    pub transmittance: T,
}

impl<T: Float + FloatConst> Fresnel<T> {
    fn total() -> Self {
        Self {
            refraction: None,
            reflectance_s: T::one(),
            reflectance_p: T::one(),
            transmittance_s: T::zero(),
            transmittance_p: T::zero(),
            reflectance: T::one(),
            transmittance: T::zero(),
        }
    }
}

/// Fresnel's coefficients for light in a medium of index `n1` that meets one of index `n2` at `incidence` (radians, 0 to π/2).
///
/// # Errors
/// [`OpticsError::OutOfRange`] for an index that is not positive and finite, or an angle outside 0 to π/2.
///
/// ```
/// use tactile_optics::fresnel;
/// let glass = fresnel(1.0_f64, 1.5, 0.0)?;
/// assert!((glass.reflectance - 0.04).abs() < 1e-15);
/// let trapped = fresnel(1.40, 1.0, 0.9)?;
/// assert!(trapped.refraction.is_none() && trapped.reflectance == 1.0);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn fresnel<T: Float + FloatConst>(
    n1: T,
    n2: T,
    incidence: T,
) -> Result<Fresnel<T>, OpticsError> {
    // A scalar's π/2 may lie above the true one by rounding.
    within(
        "angle of incidence",
        incidence,
        0.0,
        core::f64::consts::FRAC_PI_2 * (1.0 + 1e-7),
    )?;
    let (sine, cosine) = incidence.sin_cos();
    Ok(from_sine_and_cosine(
        index(n1)?,
        index(n2)?,
        sine,
        cosine.max(T::zero()),
    ))
}

/// [`fresnel`] for an incidence given by sine and cosine, as a ray tracer has it.
pub(crate) fn from_sine_and_cosine<T: Float + FloatConst>(
    n1: T,
    n2: T,
    sine: T,
    cosine: T,
) -> Fresnel<T> {
    let Some(b) = refracted_normal(n1, n2, sine, cosine) else {
        return Fresnel::total();
    };
    let a = n1 * cosine;
    let across = n1 * sine;
    // Amplitudes over the common factor: s uses n₁c₁ and n₂c₂, p uses n₂c₁ and n₁c₂ = n₁(n₂c₂)/n₂.
    let (c, d) = (n2 * cosine, n1 * (b / n2));
    let step = (n1 - n2) * (n1 + n2);
    let r_s = step / ((a + b) * (a + b));
    let brewster = difference_of_products(n2, cosine, n1, sine) * (c + across);
    let r_p = step / (n2 * (c + d)) * (brewster / (n2 * (c + d)));
    let flow = real::<T>(4.0) * a;
    let (reflectance_s, reflectance_p) = (r_s * r_s, r_p * r_p);
    let transmittance_s = flow / (a + b) * (b / (a + b));
    let transmittance_p = flow / (c + d) * (b / (c + d));
    Fresnel {
        refraction: Some(Angle::from_legs(across, b)),
        reflectance_s,
        reflectance_p,
        transmittance_s,
        transmittance_p,
        reflectance: (reflectance_s + reflectance_p) * real(0.5),
        transmittance: (transmittance_s + transmittance_p) * real(0.5),
    }
}

/// n₂ cos θ₂, or `None` when reflection is total.
fn refracted_normal<T: Float + FloatConst>(n1: T, n2: T, sine: T, cosine: T) -> Option<T> {
    // n₂ − n₁ sin θ₁; towards grazing incidence the sine has rounded to 1 and the cosine carries the digits.
    let margin = if sine > real(0.8) {
        margin_from_cosine(n1, n2, sine, cosine)
    } else {
        (-n1).mul_add(sine, n2)
    };
    (margin >= T::zero()).then(|| margin.sqrt() * (n2 + n1 * sine).sqrt())
}

/// n₂ − n₁ sin θ₁ as (n₂ − n₁) + n₁ cos² θ₁/(1 + sin θ₁), which keeps its digits where sin θ₁ is near 1.
fn margin_from_cosine<T: Float + FloatConst>(n1: T, n2: T, sine: T, cosine: T) -> T {
    (n2 - n1) + n1 * (cosine / (T::one() + sine)) * cosine
}

/// Transmittance of unpolarised light and n₂ cos θ₂, or `None` when reflection is total: the part of Fresnel's formulas that a
/// ray tracer needs, without angles and without fused multiply–adds (slow where the processor is not known to have them).
pub(crate) fn crossing<T: Float + FloatConst>(n1: T, n2: T, sine: T, cosine: T) -> Option<(T, T)> {
    let margin = margin_from_cosine(n1, n2, sine, cosine);
    if margin <= T::zero() {
        return None;
    }
    let b = (margin * (n2 + n1 * sine)).sqrt();
    let a = n1 * cosine;
    let (s, p) = (a + b, n2 * cosine + n1 * (b / n2));
    let two = T::one() + T::one();
    Some((two * a * b * ((s * s).recip() + (p * p).recip()), b))
}
