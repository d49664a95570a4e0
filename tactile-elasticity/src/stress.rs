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

use crate::error::ElasticityError;
use crate::scalar::widen;
use crate::strain::{
    Biot, Deformation, EulerAlmansi, GreenLagrange, StrainMeasure, deviator, scaled_norm, upright,
};
use core::marker::PhantomData;
use nalgebra::{Matrix3, RealField};

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
/// // 1 N on an undeformed 1 m², stretched twofold: half as much by the second measure.
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

/// A strain tensor that knows its measure.
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

/// A stress tensor (Pa) that knows its measure.
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
        Ok(Self { tensor: M::default().of(deformation)?, measure: PhantomData })
    }
}

impl<M, T: RealField + Copy> Strain<M, T> {
    /// The tensor.
    pub fn tensor(&self) -> &Matrix3<T> {
        &self.tensor
    }
}

impl<M, T: RealField + Copy> Stress<M, T> {
    /// A tensor (Pa) said to be of this measure.
    pub fn new(tensor_pa: Matrix3<T>) -> Self {
        Self { tensor: tensor_pa, measure: PhantomData }
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

/// Conversions. All need det F > 0 and fail with [`ElasticityError::SingularDeformation`] or
/// [`ElasticityError::InvertedDeformation`] otherwise.
impl<T: RealField + Copy> Stress<SecondPiolaKirchhoff, T> {
    /// σ = F S Fᵀ/J.
    ///
    /// # Errors
    /// See the impl.
    ///
    /// ```
    /// use nalgebra::Matrix3;
    /// use tactile_elasticity::{strain::Deformation, stress::{SecondPiolaKirchhoff, Stress}};
    /// let twice = Deformation::from_deformation_gradient(Matrix3::from_diagonal_element(2.0));
    /// let s = Stress::<SecondPiolaKirchhoff, f64>::new(Matrix3::from_diagonal_element(100.0));
    /// assert_eq!(s.to_cauchy(&twice)?.tensor_pa()[(0, 0)], 50.0); // 2·100·2/8
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn to_cauchy(&self, deformation: &Deformation<T>) -> Result<Stress<Cauchy, T>, ElasticityError> {
        let (f, j) = checked(deformation)?;
        Ok(Stress::new(symmetric(&(f * self.tensor * f.transpose() / j))))
    }

    /// P = F S.
    ///
    /// # Errors
    /// See the impl.
    pub fn to_first(
        &self,
        deformation: &Deformation<T>,
    ) -> Result<Stress<FirstPiolaKirchhoff, T>, ElasticityError> {
        Ok(Stress::new(checked(deformation)?.0 * self.tensor))
    }

    /// sym(U S).
    ///
    /// # Errors
    /// See the impl.
    pub fn to_biot(&self, deformation: &Deformation<T>) -> Result<Stress<BiotStress, T>, ElasticityError> {
        let stretch = Biot.of(deformation)? + Matrix3::identity();
        Ok(Stress::new(symmetric(&(stretch * self.tensor))))
    }
}

impl<T: RealField + Copy> Stress<Cauchy, T> {
    /// S = J F⁻¹ σ F⁻ᵀ.
    ///
    /// # Errors
    /// As the conversions of the second Piola–Kirchhoff stress.
    pub fn to_second(
        &self,
        deformation: &Deformation<T>,
    ) -> Result<Stress<SecondPiolaKirchhoff, T>, ElasticityError> {
        let (_, j) = checked(deformation)?;
        let inverse = deformation.inverse().ok_or(ElasticityError::SingularDeformation)?;
        Ok(Stress::new(symmetric(&(inverse * self.tensor * inverse.transpose() * j))))
    }

    /// τ = J σ.
    ///
    /// # Errors
    /// As [`to_second`](Self::to_second).
    pub fn to_kirchhoff(
        &self,
        deformation: &Deformation<T>,
    ) -> Result<Stress<Kirchhoff, T>, ElasticityError> {
        Ok(Stress::new(self.tensor * checked(deformation)?.1))
    }
}

impl<T: RealField + Copy> Stress<Kirchhoff, T> {
    /// σ = τ/J.
    ///
    /// # Errors
    /// As [`Stress::to_second`].
    pub fn to_cauchy(&self, deformation: &Deformation<T>) -> Result<Stress<Cauchy, T>, ElasticityError> {
        Ok(Stress::new(self.tensor / checked(deformation)?.1))
    }
}

impl<T: RealField + Copy> Stress<FirstPiolaKirchhoff, T> {
    /// S = F⁻¹ P.
    ///
    /// # Errors
    /// As [`Stress::to_second`].
    pub fn to_second(
        &self,
        deformation: &Deformation<T>,
    ) -> Result<Stress<SecondPiolaKirchhoff, T>, ElasticityError> {
        upright(deformation)?;
        let inverse = deformation.inverse().ok_or(ElasticityError::SingularDeformation)?;
        Ok(Stress::new(symmetric(&(inverse * self.tensor))))
    }
}

/// S of a bar or block under a force F along axis z: S_zz = F/(λ_z A₀), from the force (N, pressing positive), the undeformed
/// area (m²) and Green–Lagrange e_zz (squeezing positive); in Pa, squeezing positive.
///
/// # Errors
/// [`ElasticityError::NotPositive`] area; [`ElasticityError::OutOfRange`] where e_zz ≥ ½, a block squeezed to nothing.
///
/// ```
/// let s = tactile_elasticity::stress::uniaxial_second_piola_pa(1.0, 1e-4, 0.095)?;
/// assert!((s - 1e4 / 0.9f64).abs() < 1e-9); // λ = 0.9
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn uniaxial_second_piola_pa<T: RealField + Copy>(
    force_n: T,
    area_m2: T,
    squeeze: T,
) -> Result<T, ElasticityError> {
    use crate::error::{Quantity, finite, positive};
    finite(widen(force_n), Quantity::Force)?;
    positive(widen(area_m2), Quantity::ContactArea)?;
    let found = finite(widen(squeeze), Quantity::Strain)?;
    if found >= 0.5 {
        return Err(ElasticityError::OutOfRange { quantity: Quantity::Strain, found, limit: 0.5 });
    }
    Ok(force_n / area_m2 / (T::one() - squeeze - squeeze).sqrt())
}

/// Stress over strain along one axis, equation (31), of a conjugate pair; in Pa.
///
/// # Errors
/// [`ElasticityError::ZeroStrain`], [`ElasticityError::OppositeSigns`].
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{Deformation, GreenLagrange};
/// use tactile_elasticity::stress::{SecondPiolaKirchhoff, Strain, Stress, secant_modulus_pa};
///
/// let squeezed = Deformation::from_displacement_gradient(Matrix3::from_diagonal_element(-0.1));
/// let strain = Strain::<GreenLagrange, f64>::of(&squeezed)?;
/// let stress = Stress::<SecondPiolaKirchhoff, f64>::new(strain.tensor() * 60e3);
/// assert!((secant_modulus_pa(&stress, &strain, 2)? - 60e3).abs() < 1e-9);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn secant_modulus_pa<M: StressMeasure, T: RealField + Copy>(
    stress: &Stress<M, T>,
    strain: &Strain<M::Conjugate, T>,
    axis: usize,
) -> Result<T, ElasticityError> {
    let (s, e) = (stress.tensor[(axis, axis)], strain.tensor[(axis, axis)]);
    if e == T::zero() {
        return Err(ElasticityError::ZeroStrain);
    }
    let ratio = s / e;
    if ratio <= T::zero() {
        return Err(ElasticityError::OppositeSigns { stress_pa: widen(s), strain: widen(e) });
    }
    Ok(ratio)
}

/// S = λ tr(E) I + 2μE of an isotropic (St. Venant–Kirchhoff) solid; in Pa. Incompressible solids have no such law.
///
/// # Errors
/// [`ElasticityError::NotPositive`] modulus, [`ElasticityError::PoissonRatio`] for ν outside (−1, ½).
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{Deformation, GreenLagrange};
/// use tactile_elasticity::stress::{Strain, saint_venant_kirchhoff};
///
/// // The same strain along all axes: 3K e with K = E/(3(1 − 2ν)).
/// let grown = Deformation::from_displacement_gradient(Matrix3::from_diagonal_element(0.01));
/// let strain = Strain::<GreenLagrange, f64>::of(&grown)?;
/// let stress = saint_venant_kirchhoff(&strain, 60e3, 0.25)?;
/// assert!((stress.tensor_pa()[(0, 0)] - 60e3 / 0.5 * strain.tensor()[(0, 0)]).abs() < 1e-9);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn saint_venant_kirchhoff<T: RealField + Copy>(
    strain: &Strain<GreenLagrange, T>,
    youngs_modulus_pa: T,
    poisson_ratio: T,
) -> Result<Stress<SecondPiolaKirchhoff, T>, ElasticityError> {
    use crate::error::{Quantity, poisson, positive};
    positive(widen(youngs_modulus_pa), Quantity::YoungsModulus)?;
    let found = poisson(widen(poisson_ratio))?;
    if found == 0.5 {
        return Err(ElasticityError::PoissonRatio { found });
    }
    let (nu, one) = (poisson_ratio, T::one());
    let twice_mu = youngs_modulus_pa / (one + nu);
    let lambda = twice_mu * nu / (one - nu - nu);
    let e = strain.tensor;
    Ok(Stress::new(Matrix3::from_diagonal_element(lambda * e.trace()) + e * twice_mu))
}

fn checked<T: RealField + Copy>(deformation: &Deformation<T>) -> Result<(Matrix3<T>, T), ElasticityError> {
    upright(deformation)?;
    Ok((deformation.deformation_gradient(), deformation.jacobian()))
}

fn symmetric<T: RealField + Copy>(m: &Matrix3<T>) -> Matrix3<T> {
    (m + m.transpose()) * nalgebra::convert::<f64, T>(0.5)
}
