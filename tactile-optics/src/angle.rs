//! Critical and acceptance angles of a layer, the paper's (1)–(4).
//!
//! Light in a layer of index nᵢ is totally reflected at the ambient of index n₀ < nᵢ beyond the
//! critical angle θ_c = asin(n₀/nᵢ). Light entering through the layer's edge, perpendicular to its
//! faces, meets them beyond θ_c while its angle in the ambient stays below the acceptance angle
//!
//! θᵢ = asin(√(nᵢ² − n₀²)/n₀),
//!
//! the paper's asin √(nᵢ² − 1) for air. At nᵢ² ≥ 2n₀² every ray is trapped, at nᵢ ≤ n₀ none: both
//! are answers, not errors.
//!
//! The formulas used are θ_c = atan2(n₀, √((nᵢ − n₀)(nᵢ + n₀))) and θᵢ = atan2(√((nᵢ − n₀)(nᵢ +
//! n₀)), √(2n₀² − nᵢ²)). They keep all digits where the textbook ones lose half of them: nᵢ near n₀
//! and near √2 n₀. Whether nᵢ² ≥ 2n₀² is decided exactly.
//!
//! Propagation angles through a stack: n sin θ is the same in every layer.

use core::f64::consts::FRAC_PI_2;

#[cfg(not(feature = "std"))]
use num_traits::Float;

use crate::error::{OpticsError, index, within};

/// An angle between 0 and π/2 together with its complement, both to full precision.
///
/// ```
/// use tactile_optics::critical_angle;
///
/// // An index 10⁻¹⁴ above the ambient's: the complement keeps the digits that π/2 minus the angle
/// // has lost.
/// let angle = critical_angle(1.0 + 1e-14_f64, 1.0)?.expect("denser than its ambient");
/// assert!((angle.complement / 1.4136e-7 - 1.0).abs() < 1e-2);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Angle {
    /// The angle in radians.
    pub radians: f64,
    /// π/2 minus the angle, accurate also near a right angle.
    pub complement: f64,
}

impl Angle {
    /// The angle of the right-angled triangle with these two legs.
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

/// The critical angle of light in a layer of index `n` against an ambient of index `ambient`:
/// beyond it light is totally reflected. `None` if the layer's index does not exceed its ambient's:
/// no light is.
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
    // The root of each factor: the product of two huge indices would overflow.
    Ok((n > n0).then(|| Angle::from_legs(n0, (n - n0).sqrt() * (n + n0).sqrt())))
}

/// The acceptance angle of a layer of index `n` in an ambient of index `ambient`, (1)–(4). Of the
/// rays entering through the layer's edge those are trapped whose angle to the layer's plane,
/// measured in the ambient, is below it.
///
/// 0 radians where no ray is trapped (n ≤ n₀). A complement of 0 where every ray is (n² ≥ 2n₀²).
/// Between them both are positive.
///
/// # Errors
/// [`OpticsError::OutOfRange`] for an index that is not positive and finite.
///
/// ```
/// use tactile_optics::acceptance_angle;
/// // The paper's 71.98°, truncated from 71.9894°.
/// let angle = acceptance_angle(1.38_f64, 1.0)?;
/// assert!((angle.radians.to_degrees() - 71.9894).abs() < 1e-4);
/// // Every ray is trapped, and none.
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
    // Beyond √2 n₀ every ray is trapped. The exact comparison below holds up to 2n₀ only.
    if n >= n0 + n0 {
        return Ok(Angle::right());
    }
    // Squares of very small or large indices would leave the range of numbers.
    let scale = power_of_two_near(n0).recip();
    let (n, n0) = (n * scale, n0 * scale);
    let cosine_leg_squared = twice_square_minus_square(n0, n);
    Ok(if cosine_leg_squared > 0.0 {
        Angle::from_legs(((n - n0) * (n + n0)).sqrt(), cosine_leg_squared.sqrt())
    } else {
        Angle::right()
    })
}

/// A power of two near `x`, for scaling without rounding, 1 in the range where nothing needs it.
fn power_of_two_near(x: f64) -> f64 {
    if x > 1e-3 && x < 1e3 {
        return 1.0;
    }
    let exponent = x.log2().round() as i32;
    2.0_f64.powi(exponent)
}

/// The angle at which light of invariant `n sin θ` = `invariant` travels in a medium of index `n`:
/// θ = atan2(s, √((n − s)(n + s))), π/2 at equality. `None` where the invariant exceeds the index:
/// the field decays exponentially and no light propagates. Near grazing the cosine is the sine of
/// the angle's complement, to all digits.
///
/// # Errors
/// [`OpticsError::OutOfRange`] for an index that is not positive or an invariant that is negative,
/// or either not finite.
///
/// ```
/// use tactile_optics::propagation;
/// // Entering from air at 30°: the invariant is sin 30°.
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

/// 2a² − b² for b in [a, 2a], with its sign right on the numbers as they stand.
///
/// Both squares split exactly into a rounded part and its error (fused multiply–add). The rounded
/// parts lie within a factor of two of each other wherever the sign is in doubt, so their
/// difference is exact. The errors' difference is kept as a rounded sum and its remainder.
fn twice_square_minus_square(a: f64, b: f64) -> f64 {
    let twice = a + a;
    let (p, q) = (twice * a, b * b);
    let (p_error, q_error) = (twice.mul_add(a, -p), b.mul_add(b, -q));
    let low = p_error - q_error;
    // Remainder of that subtraction (Knuth's two-sum).
    let back = low - p_error;
    let rest = (p_error - (low - back)) - (q_error + back);
    ((p - q) + low) + rest
}
