//! Stress measures, their conversions, and the strain each belongs to.
//!
//! Work per volume of the undeformed material is the same in every conjugate pair: S : Ė = P : Ḟ = τ : d. Types keep the
//! pairs together: [`Stress<SecondPiolaKirchhoff, T>`](Stress) pairs with [`Strain<GreenLagrange, T>`](Strain) and with
//! nothing else.
//!
//! | stress | force on | area | conjugate strain |
//! |---|---|---|---|
//! | [`Cauchy`] σ | now | now | (the rate of) Euler–Almansi, through τ |
//! | [`Kirchhoff`] τ = Jσ | now | now, per undeformed volume | Euler–Almansi (rotated) |
//! | [`FirstPiolaKirchhoff`] P = τF⁻ᵀ | now | before | F itself |
//! | [`SecondPiolaKirchhoff`] S = F⁻¹τF⁻ᵀ | pulled back | before | Green–Lagrange |
//! | [`BiotStress`] sym(RᵀP) | turned back | before | Biot |
//!
//! A stress paired with the wrong strain does not compile:
//!
//! ```compile_fail
//! use nalgebra::Matrix3;
//! use tactile_elasticity::{strain::{Deformation, GreenLagrange}, stress::{Cauchy, Strain, Stress, secant_modulus_pa}};
//! let f = Deformation::from_displacement_gradient(Matrix3::from_diagonal_element(0.01));
//! let strain = Strain::<GreenLagrange, f64>::of(&f).unwrap();
//! let stress = Stress::<Cauchy, f64>::new(Matrix3::from_diagonal_element(100.0));
//! secant_modulus_pa(&stress, &strain, 2); // second Piola–Kirchhoff is asked for
//! ```

mod conversion;
mod law;
mod measure;

pub use law::{saint_venant_kirchhoff, secant_modulus_pa, uniaxial_second_piola_pa};
pub use measure::{
    BiotStress, Cauchy, FirstPiolaKirchhoff, Gradient, Kirchhoff, SecondPiolaKirchhoff,
    StressMeasure,
};

use crate::error::ElasticityError;
use crate::strain::{Deformation, StrainMeasure, deviator, scaled_norm};
use core::marker::PhantomData;
use nalgebra::{Matrix3, RealField};

/// A strain tensor typed by its measure.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::{strain::{Deformation, GreenLagrange}, stress::Strain};
///
/// let deformation = Deformation::from_displacement_gradient(Matrix3::from_diagonal_element(0.1));
/// let strain = Strain::<GreenLagrange, f64>::of(&deformation)?;
/// assert!((strain.tensor()[(0, 0)] - 0.105).abs() < 1e-16);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strain<M, T> {
    tensor: Matrix3<T>,
    measure: PhantomData<M>,
}

/// A stress tensor (Pa) typed by its measure.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::{strain::Deformation, stress::{Cauchy, Stress}};
///
/// // There and back again.
/// let deformation = Deformation::from_displacement_gradient(Matrix3::new(0.1, 0.2, 0.0, 0.0, -0.1, 0.0, 0.0, 0.0, 0.3));
/// let stress = Stress::<Cauchy, f64>::new(Matrix3::new(3.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0));
/// let back = stress.to_second(&deformation)?.to_cauchy(&deformation)?;
/// assert!((back.tensor_pa() - stress.tensor_pa()).norm() < 1e-14);
/// assert!((stress.to_kirchhoff(&deformation)?.von_mises_pa() / stress.von_mises_pa() - deformation.jacobian()).abs() < 1e-14);
/// assert!((stress.to_second(&deformation)?.to_first(&deformation)?.to_second(&deformation)?.to_biot(&deformation)?.tensor_pa()
///     - stress.to_second(&deformation)?.to_biot(&deformation)?.tensor_pa()).norm() < 1e-14);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stress<M, T> {
    tensor: Matrix3<T>,
    measure: PhantomData<M>,
}

impl<M: StrainMeasure<T> + Default, T: RealField + Copy> Strain<M, T> {
    /// The strain of a deformation.
    ///
    /// # Errors
    /// As [`StrainMeasure::of`].
    pub fn of(deformation: &Deformation<T>) -> Result<Self, ElasticityError> {
        Ok(Self {
            tensor: M::default().of(deformation)?,
            measure: PhantomData,
        })
    }
}

impl<M, T: RealField + Copy> Strain<M, T> {
    /// The tensor.
    pub fn tensor(&self) -> &Matrix3<T> {
        &self.tensor
    }
}

impl<M, T: RealField + Copy> Stress<M, T> {
    /// From a tensor (Pa) of this measure.
    pub fn new(tensor_pa: Matrix3<T>) -> Self {
        Self {
            tensor: tensor_pa,
            measure: PhantomData,
        }
    }

    /// The tensor in Pa.
    pub fn tensor_pa(&self) -> &Matrix3<T> {
        &self.tensor
    }

    /// √(3⁄2 dev : dev) in Pa.
    pub fn von_mises_pa(&self) -> T {
        scaled_norm(&deviator(&self.tensor), nalgebra::convert(1.5))
    }
}
