//! Propagation angles through a stack: n sin θ is the same in every layer.

use crate::angle::Angle;
use crate::error::OpticsError;
use crate::real::{Real, index, within};

/// The direction in which light of a given invariant n sin θ travels in a medium.
///
/// ```
/// use tactile_optics::{Propagation, propagation};
///
/// // Near grazing the cosine keeps digits that the angle has lost.
/// let Propagation::At { angle, cosine } = propagation(1.0 + 1e-14_f64, 1.0)? else { unreachable!() };
/// assert!((cosine - angle.complement().sin()).abs() < 1e-15 * cosine);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Propagation<T> {
    /// Light propagates at this angle to the interfaces' normal. `cosine` is given as well because near grazing it keeps
    /// more digits than the angle.
    At {
        /// Angle to the normal.
        angle: Angle<T>,
        /// Its cosine.
        cosine: T,
    },
    /// The invariant exceeds the index: the field decays exponentially and no light propagates.
    Evanescent,
}

/// The angle at which light of invariant `n sin θ` = `invariant` travels in a medium of index `n`:
/// θ = atan2(s, √((n − s)(n + s))), cos θ = √((n − s)(n + s))/n; π/2 at equality.
///
/// # Errors
/// [`OpticsError::OutOfRange`] for an index that is not positive or an invariant that is negative, or either not finite.
///
/// ```
/// use tactile_optics::{Propagation, propagation};
/// // Entering from air at 30°: the invariant is sin 30°.
/// let Propagation::At { angle, .. } = propagation(1.40_f64, 0.5)? else { unreachable!() };
/// assert!((angle.degrees() - 20.9248).abs() < 1e-4);
/// assert_eq!(propagation(1.0, 1.2)?, Propagation::Evanescent);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn propagation<T: Real>(n: T, invariant: T) -> Result<Propagation<T>, OpticsError> {
    let n = index(n)?;
    let s = within("invariant n sin θ", invariant, 0.0, f64::MAX)?;
    if s > n {
        return Ok(Propagation::Evanescent);
    }
    let normal = (n - s).sqrt() * (n + s).sqrt();
    Ok(Propagation::At {
        angle: Angle::from_legs(s, normal),
        cosine: normal / n,
    })
}
