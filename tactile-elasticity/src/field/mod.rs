//! Strain over points, grids and contacts.

mod summary;

pub use summary::{StrainField, StrainSummary};
