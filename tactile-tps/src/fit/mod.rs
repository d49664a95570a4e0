//! The equations of a spline: distinct points, the directions that they span, and the matrix to be
//! solved.
//!
//! With weights W the equations K w + λW⁻¹w + P a = y, Pᵀw = 0 become, for v = W^-½ w, S v + W^½P
//! a = W^½ y and (W^½P)ᵀv = 0 with S = W^½KW^½ + λI. The scaling by rows separates weights that
//! differ by many decades.
//!
//! Let W^½P = QR with orthonormal Q, and Π = I − QQᵀ. The solution satisfies v = Πv and ΠSΠ v = Π
//! W^½y. On the range of Π the matrix ΠSΠ is positive definite. Adding σQQᵀ makes it positive
//! definite everywhere without changing the solution. If σ is the mean eigenvalue on the range of
//! Π, the condition number is unchanged.

mod affine_basis;
mod buffers;
mod centres;
mod equations;
mod factorization;
mod iterative;
mod spectrum;
mod system;
mod triangle;

pub use factorization::{Factorization, SplineWorkspace};
