//! An inclusion in a block of tissue, from frames: ring means of pressure images, and their cells.
//!
//! The search itself is [`InclusionSearch`], of the crate `tactile-inclusion`.
mod rings;
#[cfg(test)]
mod tests;

pub use rings::{FaceCells, RingError, RingMeans, ring_means};
pub use tactile_inclusion::*;
