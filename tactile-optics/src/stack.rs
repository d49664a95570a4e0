//! A stack of plane layers with the same ambient on both sides, described by its refractive indices
//! from the object to the glass.
//!
//! Critical, acceptance and propagation angles are per layer: call
//! [`critical_angle`](crate::critical_angle), [`acceptance_angle`] or
//! [`propagation`](crate::propagation) with the index of the layer.

use core::f64::consts::PI;

use crate::angle::{Angle, acceptance_angle};
use crate::error::{OpticsError, index, within};

/// Transmittance and reflectance of a lossless stack at normal incidence, from
/// [`normal_incidence`].
///
/// ```
/// use tactile_optics::normal_incidence;
///
/// // A pane of glass: 4 % at each face, and slightly more by the light between the faces.
/// let pane = normal_incidence(&[1.5_f64], 1.0)?;
/// assert!((pane.single_pass - 0.96 * 0.96).abs() < 1e-15);
/// assert!((pane.transmittance - 12.0 / 13.0).abs() < 1e-15);
/// assert!((pane.transmittance + pane.reflectance - 1.0).abs() < 1e-15);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct NormalIncidence {
    /// Transmittance if reflected light is lost, Π(1 − Rⱼ).
    pub single_pass: f64,
    /// Transmittance with all reflections added by intensity, 1/(1 + Σ Rⱼ/(1 − Rⱼ)).
    pub transmittance: f64,
    /// Reflectance with all reflections added by intensity, 1 − transmittance.
    pub reflectance: f64,
}

/// Comparison of the light cone of an LED with the acceptance angles of a stack, from [`led_cone`].
///
/// ```
/// use tactile_optics::led_cone;
///
/// let cone = led_cone(&[1.38_f64, 1.41], 1.0, 150.0_f64.to_radians())?;
/// assert!(!cone.trapped);
/// // The cone is six degrees too wide for the layer of 1.38.
/// assert!((cone.margin.to_degrees() + 6.0211).abs() < 1e-4);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct LedCone {
    /// Full angle of the LED cone in radians.
    pub full_angle: f64,
    /// The smallest acceptance angle of the layers.
    pub weakest: Angle,
    /// The largest trapped full angle, which is twice the smallest acceptance angle, minus the
    /// angle of the cone. If it is negative, the cone is too wide by this angle. If the stack traps
    /// every ray, the margin is at least π minus the angle of the cone.
    pub margin: f64,
    /// Whether every ray of the cone is trapped.
    pub trapped: bool,
}

/// Transmittance and reflectance at normal incidence of layers with these `indices`, from ambient
/// to ambient, without interference.
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
/// // An index between those of the ambient and the layer, on both faces, halves the loss.
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
        // Ratios stay below 1, whereas products of indices could overflow.
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

/// Whether every layer traps the cone of an LED at the edge of layers with these `indices`: the
/// full angle of the cone must be below 2·min θᵢ.
///
/// # Errors
/// [`OpticsError::Empty`] without layers; [`OpticsError::OutOfRange`] for an index that is not
/// positive and finite, or a full angle outside 0 to π.
///
/// ```
/// use tactile_optics::led_cone;
/// // The cone must be below 143.96° (143.9789 untruncated), the limit of the weakest layer.
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
        // If the weakest layer traps every ray, there is no limit, even for a cone of π and a
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
