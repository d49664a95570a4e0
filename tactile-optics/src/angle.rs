//! Critical and acceptance angles of a layer, the paper's (1)–(4).
//!
//! Light in a layer of index nᵢ is totally reflected at the ambient of index n₀ < nᵢ beyond the critical angle
//! θ_c = asin(n₀/nᵢ). Light entering through the layer's edge, perpendicular to its faces, meets them beyond θ_c while its
//! angle in the ambient stays below the acceptance angle
//!
//! θᵢ = asin(√(nᵢ² − n₀²)/n₀),
//!
//! the paper's asin √(nᵢ² − 1) for air. At nᵢ² ≥ 2n₀² every ray is trapped, at nᵢ ≤ n₀ none: both are answers, not errors.
//!
//! The formulas used are θ_c = atan2(n₀, √((nᵢ − n₀)(nᵢ + n₀))) and θᵢ = atan2(√((nᵢ − n₀)(nᵢ + n₀)), √(2n₀² − nᵢ²)), which keep all
//! digits where the textbook ones lose half of them: nᵢ near n₀ and near √2 n₀. Whether nᵢ² ≥ 2n₀² is decided exactly.

use crate::error::OpticsError;
use crate::real::{Real, index, real, twice_square_minus_square};

/// An angle between 0 and π/2 together with its complement, both to full precision.
///
/// ```
/// use tactile_optics::{CriticalAngle, critical_angle};
///
/// // An index 10⁻¹⁴ above the ambient's: the complement keeps the digits that π/2 minus the angle has lost.
/// let CriticalAngle::Beyond(angle) = critical_angle(1.0 + 1e-14_f64, 1.0)? else { unreachable!() };
/// assert!((angle.complement() / 1.4136e-7 - 1.0).abs() < 1e-2);
/// assert!((angle.degrees() - angle.radians().to_degrees()).abs() < 1e-12);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Angle<T> {
    radians: T,
    complement: T,
}

impl<T: Real> Angle<T> {
    /// The angle of the right-angled triangle with these two legs.
    pub(crate) fn from_legs(opposite: T, adjacent: T) -> Self {
        Self {
            radians: opposite.atan2(adjacent),
            complement: adjacent.atan2(opposite),
        }
    }

    /// The angle in radians.
    pub fn radians(&self) -> T {
        self.radians
    }

    /// The angle in degrees.
    pub fn degrees(&self) -> T {
        self.radians.to_degrees()
    }

    /// π/2 minus the angle, accurate also near a right angle.
    pub fn complement(&self) -> T {
        self.complement
    }
}

/// The angle of incidence beyond which light is totally reflected.
///
/// ```
/// use tactile_optics::{CriticalAngle, critical_angle};
///
/// let describe = |n: f64| match critical_angle(n, 1.0)? {
///     CriticalAngle::Beyond(angle) => Ok::<_, tactile_optics::OpticsError>(format!("beyond {:.1}°", angle.degrees())),
///     CriticalAngle::Never => Ok("never".to_string()),
/// };
/// assert_eq!(describe(1.41)?, "beyond 45.2°");
/// assert_eq!(describe(0.9)?, "never");
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CriticalAngle<T> {
    /// Light is totally reflected beyond this angle.
    Beyond(Angle<T>),
    /// No angle: the layer's index does not exceed its ambient's.
    Never,
}

/// The set of rays entering through a layer's edge that total reflection traps.
///
/// ```
/// use tactile_optics::{AcceptanceAngle, acceptance_angle};
///
/// assert_eq!(acceptance_angle(1.3_f64, 1.33)?, AcceptanceAngle::NoneTrapped);
/// assert_eq!(acceptance_angle(1.5_f64, 1.0)?, AcceptanceAngle::AllTrapped);
/// assert_eq!(acceptance_angle(1.5_f64, 1.0)?.radians(), std::f64::consts::FRAC_PI_2);
/// assert!(matches!(acceptance_angle(1.38_f64, 1.0)?, AcceptanceAngle::Below(angle) if angle.degrees() < 72.0));
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AcceptanceAngle<T> {
    /// No ray: the layer's index does not exceed its ambient's.
    NoneTrapped,
    /// The rays whose angle to the layer's plane, measured in the ambient, is below this one.
    Below(Angle<T>),
    /// Every ray: nᵢ² ≥ 2n₀².
    AllTrapped,
}

impl<T: Real> AcceptanceAngle<T> {
    /// The acceptance angle in radians: 0 where no ray is trapped, π/2 where all are.
    pub fn radians(&self) -> T {
        match self {
            Self::NoneTrapped => T::zero(),
            Self::Below(angle) => angle.radians(),
            Self::AllTrapped => T::FRAC_PI_2(),
        }
    }
}

/// The critical angle of light in a layer of index `n` against an ambient of index `ambient`.
///
/// # Errors
/// [`OpticsError::OutOfRange`] for an index that is not positive and finite.
///
/// ```
/// use tactile_optics::{CriticalAngle, critical_angle};
/// let CriticalAngle::Beyond(angle) = critical_angle(1.40_f64, 1.0)? else { unreachable!() };
/// assert!((angle.degrees() - 45.5847).abs() < 1e-4);
/// assert_eq!(critical_angle(1.0, 1.33)?, CriticalAngle::Never);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn critical_angle<T: Real>(n: T, ambient: T) -> Result<CriticalAngle<T>, OpticsError> {
    let (n, n0) = (index(n)?, index(ambient)?);
    if n <= n0 {
        return Ok(CriticalAngle::Never);
    }
    // The root of each factor: the product of two huge indices would overflow.
    Ok(CriticalAngle::Beyond(Angle::from_legs(
        n0,
        (n - n0).sqrt() * (n + n0).sqrt(),
    )))
}

/// The acceptance angle of a layer of index `n` in an ambient of index `ambient`, (1)–(4).
///
/// # Errors
/// [`OpticsError::OutOfRange`] for an index that is not positive and finite.
///
/// ```
/// use tactile_optics::{AcceptanceAngle, acceptance_angle};
/// // The paper's 71.98°, truncated from 71.9894°.
/// let AcceptanceAngle::Below(angle) = acceptance_angle(1.38_f64, 1.0)? else { unreachable!() };
/// assert!((angle.degrees() - 71.9894).abs() < 1e-4);
/// assert_eq!(acceptance_angle(1.5, 1.0)?, AcceptanceAngle::AllTrapped);
/// assert_eq!(acceptance_angle(1.3, 1.33)?, AcceptanceAngle::NoneTrapped);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn acceptance_angle<T: Real>(n: T, ambient: T) -> Result<AcceptanceAngle<T>, OpticsError> {
    let (n, n0) = (index(n)?, index(ambient)?);
    if n <= n0 {
        return Ok(AcceptanceAngle::NoneTrapped);
    }
    if n >= n0 + n0 {
        return Ok(AcceptanceAngle::AllTrapped);
    }
    // Squares of very small or large indices would leave the scalar's range.
    let scale = power_of_two_near(n0).recip();
    let (n, n0) = (n * scale, n0 * scale);
    let cosine_leg_squared = twice_square_minus_square(n0, n);
    Ok(if cosine_leg_squared > T::zero() {
        AcceptanceAngle::Below(Angle::from_legs(
            ((n - n0) * (n + n0)).sqrt(),
            cosine_leg_squared.sqrt(),
        ))
    } else {
        AcceptanceAngle::AllTrapped
    })
}

/// A power of two near `x`, for scaling without rounding; 1 in the range where nothing needs it.
fn power_of_two_near<T: Real>(x: T) -> T {
    if x > real(1e-3) && x < real(1e3) {
        return T::one();
    }
    let exponent = x.log2().round().to_i32().unwrap_or(0);
    real::<T>(2.0).powi(exponent)
}
