//! Where displacement components stand among the equations.

use super::element::OUTER;
use super::gap::DRIVER;

/// Where a displacement component's share of the system goes.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Slot {
    Nowhere,
    Driver(f64),
    Equation(usize),
}

/// Where the entries of an element's stiffness, the lower half row by row, stand among the tangent's values;
/// [`NO_PLACE`] where one of the two components has no equation.
pub(crate) type Places = [u32; OUTER * (OUTER + 1) / 2];

/// Of entries that are not in the tangent.
pub(crate) const NO_PLACE: u32 = u32::MAX;

/// The slot of a displacement component of a [`Gap`](super::gap::Gap).
pub(crate) fn slot(slots: &[Slot], dof: usize) -> Slot {
    if dof == DRIVER {
        Slot::Driver(1.0)
    } else {
        slots[dof]
    }
}
