//! From deformation gradients to strain, and from stress and strain to Young modulus, with uncertainty.
#![forbid(unsafe_code)]

pub mod contact;
pub mod curve;
mod error;
pub mod field;
pub mod modulus;
mod scalar;
pub mod strain;
pub mod stress;

pub use error::{ElasticityError, Quantity};
