//! Critical and acceptance angles of a layer, (1)–(4) of the paper.
//!
//! In a layer of index nᵢ in an ambient of index n₀ < nᵢ, light is totally reflected beyond the
//! critical angle θ_c = asin(n₀/nᵢ). Light that enters through the edge of the layer, perpendicular
//! to its faces, is trapped if its angle in the ambient is below the acceptance angle
//!
//! θᵢ = asin(√(nᵢ² − n₀²)/n₀),
//!
//! The paper has asin √(nᵢ² − 1), for air. If nᵢ² ≥ 2n₀², every ray is trapped, and if nᵢ ≤ n₀, no
//! ray is. Both are valid results, not errors.
//!
//! The formulas used are θ_c = atan2(n₀, √((nᵢ − n₀)(nᵢ + n₀))) and θᵢ = atan2(√((nᵢ − n₀)(nᵢ +
//! n₀)), √(2n₀² − nᵢ²)). They keep all digits, whereas the textbook formulas lose half of them if
//! nᵢ is near n₀ or near √2 n₀. The condition nᵢ² ≥ 2n₀² is evaluated exactly.
//!
//! Propagation angles through a stack: n sin θ is the same in every layer.

use core::f64::consts::FRAC_PI_2;

#[cfg(not(feature = "std"))]
use num_traits::Float;

use crate::error::{OpticsError, index, within};

/// An angle between 0 and π/2 and its complement, both to full precision.
///
/// ```
/// use tactile_optics::critical_angle;
///
/// // With an index 10⁻¹⁴ above that of the ambient, the complement keeps the digits that π/2 minus
/// // the angle loses.
/// let angle = critical_angle(1.0 + 1e-14_f64, 1.0)?.expect("denser than its ambient");
/// assert!((angle.complement / 1.4136e-7 - 1.0).abs() < 1e-2);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Angle {
    /// The angle in radians.
    pub radians: f64,
    /// π/2 minus the angle, which is also accurate near a right angle.
    pub complement: f64,
}

impl Angle {
    /// The angle of a right-angled triangle with these two legs.
    pub(crate) fn from_legs(opposite: f64, adjacent: f64) -> Self {
        Self {
            radians: opposite.atan2(adjacent),
            complement: adjacent.atan2(opposite),
        }
    }

    /// π/2, with a complement of exactly 0.
    pub(crate) fn right() -> Self {
        Self {
            radians: FRAC_PI_2,
            complement: 0.0,
        }
    }
}

/// The critical angle of light in a layer of index `n` in an ambient of index `ambient`: light is
/// totally reflected beyond it. `None` if the index of the layer does not exceed that of the
/// ambient: there is no total reflection.
///
/// # Errors
/// [`OpticsError::OutOfRange`] for an index that is not positive and finite.
///
/// ```
/// use tactile_optics::critical_angle;
/// let angle = critical_angle(1.40_f64, 1.0)?.expect("denser than its ambient");
/// assert!((angle.radians.to_degrees() - 45.5847).abs() < 1e-4);
/// assert_eq!(critical_angle(1.0, 1.33)?, None);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn critical_angle(n: f64, ambient: f64) -> Result<Option<Angle>, OpticsError> {
    let (n, n0) = (index(n)?, index(ambient)?);
    // The root of each factor: the product of two very large indices would overflow.
    Ok((n > n0).then(|| Angle::from_legs(n0, (n - n0).sqrt() * (n + n0).sqrt())))
}

/// The acceptance angle of a layer of index `n` in an ambient of index `ambient`, (1)–(4). A ray
/// that enters through the edge of the layer is trapped if its angle to the plane of the layer,
/// measured in the ambient, is below the acceptance angle.
///
/// 0 radians if no ray is trapped (n ≤ n₀), and a complement of 0 if every ray is trapped (n² ≥
/// 2n₀²). Otherwise both are positive.
///
/// # Errors
/// [`OpticsError::OutOfRange`] for an index that is not positive and finite.
///
/// ```
/// use tactile_optics::acceptance_angle;
/// // The paper has 71.98°, truncated from 71.9894°.
/// let angle = acceptance_angle(1.38_f64, 1.0)?;
/// assert!((angle.radians.to_degrees() - 71.9894).abs() < 1e-4);
/// // Every ray is trapped, and no ray is.
/// assert_eq!(acceptance_angle(1.5, 1.0)?.complement, 0.0);
/// assert_eq!(acceptance_angle(1.3, 1.33)?.radians, 0.0);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn acceptance_angle(n: f64, ambient: f64) -> Result<Angle, OpticsError> {
    let (n, n0) = (index(n)?, index(ambient)?);
    if n <= n0 {
        return Ok(Angle {
            radians: 0.0,
            complement: FRAC_PI_2,
        });
    }
    // Beyond √2 n₀ every ray is trapped. The exact comparison below is valid only up to 2n₀.
    if n >= n0 + n0 {
        return Ok(Angle::right());
    }
    // Squares of very small or large indices would underflow or overflow.
    let scale = power_of_two_near(n0).recip();
    let (n, n0) = (n * scale, n0 * scale);
    let cosine_leg_squared = twice_square_minus_square(n0, n);
    Ok(if cosine_leg_squared > 0.0 {
        Angle::from_legs(((n - n0) * (n + n0)).sqrt(), cosine_leg_squared.sqrt())
    } else {
        Angle::right()
    })
}

/// A power of two near `x`, for scaling without rounding. It is 1 in the range that needs no
/// scaling.
fn power_of_two_near(x: f64) -> f64 {
    if x > 1e-3 && x < 1e3 {
        return 1.0;
    }
    let exponent = x.log2().round() as i32;
    2.0_f64.powi(exponent)
}

/// The angle of light with the invariant `n sin θ` = `invariant` in a medium of index `n`: θ =
/// atan2(s, √((n − s)(n + s))), and π/2 at equality. `None` if the invariant exceeds the index: the
/// field decays exponentially and no light propagates. Near grazing incidence the cosine is the
/// sine of the complement, with all digits.
///
/// # Errors
/// [`OpticsError::OutOfRange`] for an index that is not positive, an invariant that is negative, or
/// either if it is not finite.
///
/// ```
/// use tactile_optics::propagation;
/// // Light that enters from air at 30°: the invariant is sin 30°.
/// let angle = propagation(1.40_f64, 0.5)?.expect("denser than air");
/// assert!((angle.radians.to_degrees() - 20.9248).abs() < 1e-4);
/// assert_eq!(propagation(1.0, 1.2)?, None);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn propagation(n: f64, invariant: f64) -> Result<Option<Angle>, OpticsError> {
    let n = index(n)?;
    let s = within("invariant n sin θ", invariant, 0.0, f64::MAX)?;
    Ok((s <= n).then(|| Angle::from_legs(s, (n - s).sqrt() * (n + s).sqrt())))
}

/// 2a² − b² for b in [a, 2a], with the correct sign for the given floating-point numbers.
///
/// Each square is split exactly into a rounded part and its error (fused multiply–add). If the sign
/// is uncertain, the rounded parts are within a factor of two of each other, so that their
/// difference is exact. The difference of the errors is kept as a rounded sum and its remainder.
fn twice_square_minus_square(a: f64, b: f64) -> f64 {
    let twice = a + a;
    let (p, q) = (twice * a, b * b);
    let (p_error, q_error) = (twice.mul_add(a, -p), b.mul_add(b, -q));
    let low = p_error - q_error;
    // Remainder of the subtraction above (Knuth's two-sum).
    let back = low - p_error;
    let rest = (p_error - (low - back)) - (q_error + back);
    ((p - q) + low) + rest
}
