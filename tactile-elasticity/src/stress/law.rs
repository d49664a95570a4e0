//! Stress and strain of one material: of a bar, along an axis, in every direction.

use super::{SecondPiolaKirchhoff, Strain, Stress, StressMeasure};
use crate::error::ElasticityError;
use crate::scalar::widen;
use crate::strain::GreenLagrange;
use nalgebra::{Matrix3, RealField};

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
        return Err(ElasticityError::OutOfRange {
            quantity: Quantity::Strain,
            found,
            limit: 0.5,
        });
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
        return Err(ElasticityError::OppositeSigns {
            stress_pa: widen(s),
            strain: widen(e),
        });
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
    Ok(Stress::new(
        Matrix3::from_diagonal_element(lambda * e.trace()) + e * twice_mu,
    ))
}
