//! Strain over points, grids and contacts.

mod propagation;
mod robust;
mod source;
mod summary;

pub use propagation::{mean_strain_covariance, strain_covariance};
pub use robust::Averaging;
pub use source::{DisplacementGradient, JacobianOf, Samples};
pub use summary::{StrainField, StrainSummary};
