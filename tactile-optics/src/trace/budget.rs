//! The light budget: shares of the LED's light by where it ended.

use crate::real::Real;

/// Shares of the LED's light by where it ended; they add up to 1 to rounding.
///
/// ```
/// use tactile_optics::Led;
/// use tactile_optics::surface::Flat;
/// use tactile_optics::trace::{Slab, SlabLayer, TraceOptions, trace};
///
/// let slab = Slab::new(&[SlabLayer { index: 1.40_f64, thickness_m: 10e-3 }], 1.0, 30e-3)?;
/// let budget = trace(&slab, &Led::lambertian(), &Flat, &TraceOptions::default(), &mut [])?;
/// assert!((budget.total() - 1.0).abs() < 1e-12);
/// // A flat layer keeps nearly all that enters it.
/// assert!(budget.guided_of_entered() > 0.98 && budget.leaked() < 0.02);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
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

impl<T: Real> LightBudget<T> {
    /// Sum of all shares: 1 to rounding.
    pub fn total(&self) -> T {
        [
            self.entry,
            self.returned,
            self.above,
            self.below,
            self.camera,
            self.absorbed,
            self.unresolved,
        ]
        .iter()
        .fold(self.guided, |sum, &share| sum + share)
    }

    /// Share of the light that left through top or bottom.
    pub fn leaked(&self) -> T {
        self.above + self.below + self.camera
    }

    /// Share of the entered light that reached the far edge.
    pub fn guided_of_entered(&self) -> T {
        self.guided / (T::one() - self.entry)
    }
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

impl<T: Real> Tally<T> {
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
