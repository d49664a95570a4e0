//! Strain at many points: its mean, spread and error.

mod propagation;
mod robust;
mod summary;

pub use propagation::{mean_strain_covariance, strain_covariance};
pub use robust::Averaging;
pub use summary::{StrainField, StrainSummary};
