//! The measures, as types, and the strain each works on.

use crate::strain::{Biot, EulerAlmansi, GreenLagrange};

/// A measure of stress.
///
/// ```
/// use tactile_elasticity::strain::GreenLagrange;
/// use tactile_elasticity::stress::{SecondPiolaKirchhoff, StressMeasure};
///
/// // Each stress names the strain it works on: these are one type.
/// let partner: <SecondPiolaKirchhoff as StressMeasure>::Conjugate = GreenLagrange;
/// assert_eq!(std::mem::size_of_val(&partner), 0);
/// ```
pub trait StressMeasure {
    /// The strain it works on.
    type Conjugate;
}

/// σ: force over area, both of the deformed state.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::stress::{Cauchy, Stress};
///
/// // A bar under 100 kPa along x: von Mises' stress is the same.
/// let stress = Stress::<Cauchy, f64>::new(Matrix3::from_partial_diagonal(&[1e5]));
/// assert!((stress.von_mises_pa() - 1e5).abs() < 1e-9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cauchy;
/// τ = J σ.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::{strain::Deformation, stress::{Cauchy, Kirchhoff, Stress}};
///
/// let twice = Deformation::from_deformation_gradient(Matrix3::from_diagonal_element(2.0));
/// let stress: Stress<Kirchhoff, f64> = Stress::<Cauchy, f64>::new(Matrix3::identity()).to_kirchhoff(&twice)?;
/// assert_eq!(stress.tensor_pa()[(0, 0)], 8.0);
/// assert_eq!(stress.to_cauchy(&twice)?.tensor_pa()[(0, 0)], 1.0);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kirchhoff;
/// P = τ F⁻ᵀ, the nominal stress: force now over area before; not symmetric.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::{strain::Deformation, stress::{FirstPiolaKirchhoff, Stress}};
///
/// // 1 N on an undeformed 1 m², stretched to twice its length: half as much by the second measure.
/// let twice = Deformation::from_deformation_gradient(Matrix3::from_diagonal_element(2.0));
/// let nominal = Stress::<FirstPiolaKirchhoff, f64>::new(Matrix3::identity());
/// assert_eq!(nominal.to_second(&twice)?.tensor_pa()[(0, 0)], 0.5);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FirstPiolaKirchhoff;
/// S = F⁻¹ τ F⁻ᵀ, the stress of equation (31).
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::{strain::Deformation, stress::{SecondPiolaKirchhoff, Stress}};
///
/// let twice = Deformation::from_deformation_gradient(Matrix3::from_diagonal_element(2.0));
/// let second = Stress::<SecondPiolaKirchhoff, f64>::new(Matrix3::identity());
/// assert_eq!(second.to_first(&twice)?.tensor_pa()[(0, 0)], 2.0);
/// assert_eq!(second.to_cauchy(&twice)?.tensor_pa()[(0, 0)], 0.5);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SecondPiolaKirchhoff;
/// sym(Rᵀ P) = sym(U S).
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::{strain::Deformation, stress::{BiotStress, SecondPiolaKirchhoff, Stress}};
///
/// let twice = Deformation::from_deformation_gradient(Matrix3::from_diagonal_element(2.0));
/// let biot: Stress<BiotStress, f64> =
///     Stress::<SecondPiolaKirchhoff, f64>::new(Matrix3::identity()).to_biot(&twice)?;
/// assert!((biot.tensor_pa()[(0, 0)] - 2.0).abs() < 1e-14);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BiotStress;
/// The deformation gradient as the partner of the first Piola–Kirchhoff stress.
///
/// ```
/// use tactile_elasticity::stress::{FirstPiolaKirchhoff, Gradient, StressMeasure};
///
/// fn works_on<S: StressMeasure<Conjugate = Gradient>>() -> &'static str {
///     "the deformation gradient"
/// }
/// assert_eq!(works_on::<FirstPiolaKirchhoff>(), "the deformation gradient");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gradient;

impl StressMeasure for Cauchy {
    type Conjugate = EulerAlmansi;
}
impl StressMeasure for Kirchhoff {
    type Conjugate = EulerAlmansi;
}
impl StressMeasure for FirstPiolaKirchhoff {
    type Conjugate = Gradient;
}
impl StressMeasure for SecondPiolaKirchhoff {
    type Conjugate = GreenLagrange;
}
impl StressMeasure for BiotStress {
    type Conjugate = Biot;
}
