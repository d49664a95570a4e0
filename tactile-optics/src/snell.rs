//! Propagation angles through a stack: n sin θ is the same in every layer.

use crate::angle::Angle;
use crate::error::OpticsError;
use crate::real::{index, within};
use num_traits::{Float, FloatConst};

/// The angle at which light of invariant `n sin θ` = `invariant` travels in a medium of index `n`:
/// θ = atan2(s, √((n − s)(n + s))); π/2 at equality. `None` where the invariant exceeds the index: the field decays exponentially
/// and no light propagates. Near grazing the cosine is the sine of the angle's complement, to all digits.
///
/// # Errors
/// [`OpticsError::OutOfRange`] for an index that is not positive or an invariant that is negative, or either not finite.
///
/// ```
/// use tactile_optics::propagation;
/// // Entering from air at 30°: the invariant is sin 30°.
/// let angle = propagation(1.40_f64, 0.5)?.expect("denser than air");
/// assert!((angle.radians.to_degrees() - 20.9248).abs() < 1e-4);
/// assert_eq!(propagation(1.0, 1.2)?, None);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn propagation<T: Float + FloatConst>(
    n: T,
    invariant: T,
) -> Result<Option<Angle<T>>, OpticsError> {
    let n = index(n)?;
    let s = within("invariant n sin θ", invariant, 0.0, f64::MAX)?;
    Ok((s <= n).then(|| Angle::from_legs(s, (n - s).sqrt() * (n + s).sqrt())))
}
