//! Strain of a deformation gradient.
//!
//! F = ∂x/∂X = I + H maps material to space, H = ∂u/∂X. All measures agree to first order in H and are
//! functions of the stretch U of F = R U:
//!
//! | measure | tensor | of a stretch λ |
//! |---|---|---|
//! | [`GreenLagrange`] | ½(FᵀF − I) | ½(λ² − 1) |
//! | [`EulerAlmansi`] | ½(I − F⁻ᵀF⁻¹) | ½(1 − λ⁻²) |
//! | [`Hencky`] | ln U | ln λ |
//! | [`Biot`] | U − I | λ − 1 |
//! | [`Infinitesimal`] | ½(H + Hᵀ) | λ − 1 |

mod batch;
mod deformation;
mod double_double;
mod invariants;
mod measure;
mod stretch;

pub use batch::green_lagrange_into;
#[cfg(feature = "rayon")]
pub use batch::green_lagrange_par_into;
pub use deformation::Deformation;
pub use invariants::{Invariants, PrincipalValues, von_mises_strain};
pub use measure::{Biot, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, StrainMeasure};
pub use stretch::PrincipalStretches;

pub(crate) use invariants::{deviator, scaled_norm};
pub(crate) use measure::upright;
