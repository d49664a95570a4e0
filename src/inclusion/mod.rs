//! An inclusion in a block of tissue, from frames: ring means and cell means of pressure images.
//!
//! The search itself is [`InclusionSearch`], from the crate `tactile-inclusion`.
mod rings;
#[cfg(test)]
mod tests;

pub use rings::{FaceCells, RingError, RingMeans, ring_means, rounding_error};
pub use tactile_inclusion::*;
