//! An inclusion in a block of tissue, from frames: ring means of pressure images and the scene file
//! that names them.
//!
//! The search itself is [`InclusionSearch`], of the crate `tactile-inclusion`.
mod rings;
#[cfg(feature = "scene")]
mod scene;
#[cfg(test)]
mod tests;

pub use rings::{RingError, RingMeans, ring_means};
#[cfg(feature = "scene")]
pub use scene::{InclusionScene, LoadedInclusion};
pub use tactile_inclusion::*;
