#![doc = include_str!("../README.md")]
//!
//! # Conventions
//! SI units; tensors are `nalgebra::Matrix3`; x = column, y = row, z towards the object. Strain measures are generic over
//! `f32` and `f64`; statistics and contact laws on a handful of numbers are computed in `f64` and rounded once.
//!
//! # References
//! K. L. Johnson, *Contact Mechanics* (1985). I. N. Sneddon, Int. J. Eng. Sci. 3 (1965) 47. E. K. Dimitriadis et al., Biophys. J.
//! 82 (2002) 2798. N. N. Lebedev & Ia. S. Ufliand, J. Appl. Math. Mech. 22 (1958) 442. Y. Tatara, J. Eng. Mater. Technol. 113 (1991) 285.
//! T. Ogita, S. M. Rump & S. Oishi, SIAM J. Sci. Comput. 26 (2005) 1955. K. P. Burnham & D. R. Anderson, *Model Selection and
//! Multimodel Inference* (2002).
#![forbid(unsafe_code)]

pub mod contact;
pub mod curve;
mod error;
pub mod field;
pub mod modulus;
mod scalar;
mod selection;
pub mod strain;
pub mod stress;

pub use error::{ElasticityError, Quantity};
