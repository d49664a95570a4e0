//! A stack of plane layers with the same ambient on both sides, given by the refractive indices
//! from the object's side to the glass.
//!
//! Critical, acceptance and propagation angles are per layer: call
//! [`critical_angle`](crate::critical_angle), [`acceptance_angle`] or
//! [`propagation`](crate::propagation) on the index wanted.

use core::f64::consts::PI;

use crate::angle::{Angle, acceptance_angle};
use crate::error::{OpticsError, index, within};

/// Transmittance and reflectance of a lossless stack at normal incidence, from
/// [`normal_incidence`].
///
/// ```
/// use tactile_optics::normal_incidence;
///
/// // A pane of glass: 4 % at each face; the light between the faces adds a little.
/// let pane = normal_incidence(&[1.5_f64], 1.0)?;
/// assert!((pane.single_pass - 0.96 * 0.96).abs() < 1e-15);
/// assert!((pane.transmittance - 12.0 / 13.0).abs() < 1e-15);
/// assert!((pane.transmittance + pane.reflectance - 1.0).abs() < 1e-15);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct NormalIncidence {
    /// Transmittance if what is reflected once is lost, Π(1 − Rⱼ).
    pub single_pass: f64,
    /// Transmittance with all reflections added by intensity, 1/(1 + Σ Rⱼ/(1 − Rⱼ)).
    pub transmittance: f64,
    /// Reflectance with all reflections added by intensity, 1 − transmittance.
    pub reflectance: f64,
}

/// The comparison of an LED's cone of light with the acceptance angles of a stack, from
/// [`led_cone`].
///
/// ```
/// use tactile_optics::led_cone;
///
/// let cone = led_cone(&[1.38_f64, 1.41], 1.0, 150.0_f64.to_radians())?;
/// assert!(!cone.trapped);
/// // Six degrees too wide for the layer of 1.38.
/// assert!((cone.margin.to_degrees() + 6.0211).abs() < 1e-4);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct LedCone {
    /// Full angle of the LED's cone in radians.
    pub full_angle: f64,
    /// The smallest acceptance angle of the layers.
    pub weakest: Angle,
    /// The largest full angle trapped, twice the weakest layer's acceptance angle, less the cone's.
    /// Negative: that much too wide. A cone of less than π inside a stack that traps every ray has
    /// at least π less its own angle.
    pub margin: f64,
    /// Whether every ray of the cone is trapped.
    pub trapped: bool,
}

/// Transmittance and reflectance at normal incidence of layers with these `indices`, ambient to
/// ambient, without interference.
///
/// Rⱼ/(1 − Rⱼ) = (a − b)²/(4ab) and 1 − Rⱼ = 4ab/(a + b)² at the interface of indices a and b.
/// O(layers).
///
/// # Errors
/// [`OpticsError::Empty`] without layers, [`OpticsError::OutOfRange`] for an index that is not
/// positive and finite.
///
/// ```
/// use tactile_optics::normal_incidence;
///
/// // An index between the ambient's and the layer's on both faces halves the loss.
/// let bare = normal_incidence(&[1.5_f64], 1.0)?;
/// let coated = normal_incidence(&[1.5_f64.sqrt(), 1.5, 1.5_f64.sqrt()], 1.0)?;
/// assert!(coated.reflectance < 0.55 * bare.reflectance);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn normal_incidence(indices: &[f64], ambient: f64) -> Result<NormalIncidence, OpticsError> {
    checked(indices, ambient)?;
    let (mut single_pass, mut reflected) = (1.0, 0.0);
    let mut before = ambient;
    for after in indices.iter().copied().chain(core::iter::once(ambient)) {
        let (sum, step) = (before + after, before - after);
        // Ratios stay below 1 where products of indices could overflow.
        single_pass *= 4.0 * (before / sum) * (after / sum);
        reflected += step / before * (step / after) / 4.0;
        before = after;
    }
    Ok(NormalIncidence {
        single_pass,
        transmittance: (1.0 + reflected).recip(),
        reflectance: reflected / (1.0 + reflected),
    })
}

/// Whether the cone of an LED at the edge of layers with these `indices` is trapped by every layer:
/// its full angle must stay under 2·min θᵢ.
///
/// # Errors
/// [`OpticsError::Empty`] without layers. [`OpticsError::OutOfRange`] for an index that is not
/// positive and finite, or a full angle outside 0 to π.
///
/// ```
/// use tactile_optics::led_cone;
/// // The LED's cone must stay under 143.96° (143.9789 untruncated), the weakest layer's.
/// let layers = [1.38_f64, 1.39, 1.40, 1.41];
/// assert!(led_cone(&layers, 1.0, 140.0_f64.to_radians())?.trapped);
/// assert!(!led_cone(&layers, 1.0, 150.0_f64.to_radians())?.trapped);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn led_cone(indices: &[f64], ambient: f64, full_angle: f64) -> Result<LedCone, OpticsError> {
    checked(indices, ambient)?;
    within("full angle of the cone", full_angle, 0.0, PI * (1.0 + 1e-7))?;
    let mut weakest = Angle::right();
    for &n in indices {
        let angle = acceptance_angle(n, ambient)?;
        if angle.radians < weakest.radians {
            weakest = angle;
        }
    }
    let margin = weakest.radians + weakest.radians - full_angle;
    Ok(LedCone {
        full_angle,
        weakest,
        margin,
        // A weakest layer that traps every ray has no limit to exceed, even for a cone of π and a
        // margin of 0.
        trapped: weakest.radians > 0.0 && (weakest.complement == 0.0 || margin > 0.0),
    })
}

fn checked(indices: &[f64], ambient: f64) -> Result<(), OpticsError> {
    if indices.is_empty() {
        return Err(OpticsError::Empty {
            quantity: "stack of layers",
        });
    }
    for &n in indices {
        index(n)?;
    }
    index(ambient).map(|_| ())
}
