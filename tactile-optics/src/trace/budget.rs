//! The light budget: shares of the LED's light by where it ended.

use num_traits::{Float, FloatConst};

/// Shares of the LED's light by where it ended; they add up to 1 to rounding.
///
/// ```
/// use tactile_optics::Led;
/// use tactile_optics::surface::Flat;
/// use tactile_optics::trace::{Slab, SlabLayer, TraceOptions, trace};
///
/// let slab = Slab::new(&[SlabLayer { index: 1.40_f64, thickness_m: 10e-3 }], 1.0, 30e-3)?;
/// let budget = trace(&slab, &Led::default(), &Flat, &TraceOptions::default(), &mut [])?;
/// let leaked = budget.above + budget.below + budget.camera;
/// let rest = budget.entry + budget.returned + budget.absorbed + budget.unresolved;
/// assert!((budget.guided + leaked + rest - 1.0).abs() < 1e-12);
/// // A flat layer keeps nearly all that enters it.
/// assert!(budget.guided / (1.0 - budget.entry) > 0.98 && leaked < 0.02);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct LightBudget<T> {
    /// Reflected at the lit edge, never entering.
    pub entry: T,
    /// Guided to the far edge by total reflection.
    pub guided: T,
    /// Came back to the lit edge.
    pub returned: T,
    /// Left through the top into the ambient.
    pub above: T,
    /// Left through the bottom at an angle the camera does not see.
    pub below: T,
    /// Left through the bottom towards the camera.
    pub camera: T,
    /// Lost in the touching object.
    pub absorbed: T,
    /// Not followed to its end: branches below the cut-off, rays with too many events.
    pub unresolved: T,
}

/// The outcome of a ray, in the order of [`LightBudget`]'s fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub(crate) enum RayOutcome {
    Entry,
    Guided,
    Returned,
    Above,
    Below,
    Camera,
    Absorbed,
    Unresolved,
}

/// Compensated sums (Neumaier), one for each outcome: a million rays add up without loss.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tally<T> {
    sums: [T; 8],
    errors: [T; 8],
}

impl<T: Float + FloatConst> Tally<T> {
    pub(crate) fn new() -> Self {
        Self {
            sums: [T::zero(); 8],
            errors: [T::zero(); 8],
        }
    }

    pub(crate) fn add(&mut self, outcome: RayOutcome, power: T) {
        let k = outcome as usize;
        let (old, new) = (self.sums[k], self.sums[k] + power);
        let lost = if old.abs() >= power.abs() {
            (old - new) + power
        } else {
            (power - new) + old
        };
        self.sums[k] = new;
        self.errors[k] = self.errors[k] + lost;
    }

    /// Shares of `total`.
    pub(crate) fn budget(&self, total: T) -> LightBudget<T> {
        let share = |outcome: RayOutcome| {
            (self.sums[outcome as usize] + self.errors[outcome as usize]) / total
        };
        LightBudget {
            entry: share(RayOutcome::Entry),
            guided: share(RayOutcome::Guided),
            returned: share(RayOutcome::Returned),
            above: share(RayOutcome::Above),
            below: share(RayOutcome::Below),
            camera: share(RayOutcome::Camera),
            absorbed: share(RayOutcome::Absorbed),
            unresolved: share(RayOutcome::Unresolved),
        }
    }
}
