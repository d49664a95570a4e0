//! The five measures of strain.

use super::{Deformation, PrincipalStretches};
use crate::error::{ElasticityError, Quantity};
use nalgebra::{Matrix3, RealField};

/// A way to measure strain: a symmetric tensor that vanishes when the material only moves and turns
/// (the infinitesimal one: only moves).
///
/// Object safe, so that a program can choose at run time. Cost: Green–Lagrange and infinitesimal
/// some 10 ns, the others a small eigenvalue problem.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{GreenLagrange, Hencky, StrainMeasure};
/// let mut h = Matrix3::zeros();
/// h[(0, 0)] = 0.05; // 5 % stretch along x
/// let measures: [&dyn StrainMeasure<f64>; 2] = [&GreenLagrange, &Hencky];
/// let exx = measures.map(|m| m.strain(&h).unwrap()[(0, 0)]);
/// assert!((exx[0] - 0.05125).abs() < 1e-15);
/// assert!((exx[1] - 1.05f64.ln()).abs() < 1e-15);
/// ```
pub trait StrainMeasure<T: RealField + Copy> {
    /// The strain of a deformation.
    ///
    /// # Errors
    /// [`ElasticityError::NotFinite`]; and for the measures that need F⁻¹ or U to exist,
    /// [`ElasticityError::SingularDeformation`] and [`ElasticityError::InvertedDeformation`].
    fn of(&self, deformation: &Deformation<T>) -> Result<Matrix3<T>, ElasticityError>;

    /// The measure's name, as the field writes it.
    fn name(&self) -> &'static str;

    /// The strain of a displacement gradient H (F = I + H). Errors as [`of`](Self::of).
    fn strain(&self, h: &Matrix3<T>) -> Result<Matrix3<T>, ElasticityError> {
        self.of(&Deformation::from_displacement_gradient(*h))
    }
}

/// E = ½(FᵀF − I) = ½(H + Hᵀ + HᵀH): Lagrangian, conjugate to the second Piola–Kirchhoff stress.
///
/// (26)–(30) of the paper print the exponents 3 for 2, and f for the map of positions, so that ∇u = ∇f − I.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GreenLagrange;

/// e = ½(I − F⁻ᵀF⁻¹) = F⁻ᵀ E F⁻¹: Eulerian, of the deformed state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EulerAlmansi;

/// ln U, the logarithmic strain in material axes: its trace is ln J, and coaxial steps add up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Hencky;

/// U − I: relative elongations along the principal directions, conjugate to the Biot stress.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Biot;

/// ε = ½(H + Hᵀ): linear in the displacement, wrong by the rotation squared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Infinitesimal;

impl<T: RealField + Copy> StrainMeasure<T> for GreenLagrange {
    fn of(&self, deformation: &Deformation<T>) -> Result<Matrix3<T>, ElasticityError> {
        finite(deformation).map(Deformation::green_lagrange)
    }

    fn name(&self) -> &'static str {
        "Green-Lagrange"
    }
}

impl<T: RealField + Copy> StrainMeasure<T> for EulerAlmansi {
    fn of(&self, deformation: &Deformation<T>) -> Result<Matrix3<T>, ElasticityError> {
        upright(deformation)?;
        let inverse = deformation.inverse().ok_or(ElasticityError::SingularDeformation)?;
        let e = deformation.green_lagrange();
        let quarter: T = nalgebra::convert(0.25);
        let small = e.iter().all(|x| x.abs() < quarter);
        let half: T = nalgebra::convert(0.5);
        let strain = if small {
            inverse.transpose() * e * inverse
        } else {
            (Matrix3::identity() - inverse.transpose() * inverse) * half
        };
        Ok((strain + strain.transpose()) * half)
    }

    fn name(&self) -> &'static str {
        "Euler-Almansi"
    }
}

impl<T: RealField + Copy> StrainMeasure<T> for Hencky {
    fn of(&self, deformation: &Deformation<T>) -> Result<Matrix3<T>, ElasticityError> {
        upright(deformation)?;
        let principal = PrincipalStretches::of(deformation);
        Ok(principal.compose(principal.logarithms))
    }

    fn name(&self) -> &'static str {
        "Hencky"
    }
}

impl<T: RealField + Copy> StrainMeasure<T> for Biot {
    fn of(&self, deformation: &Deformation<T>) -> Result<Matrix3<T>, ElasticityError> {
        upright(deformation)?;
        let principal = PrincipalStretches::of(deformation);
        Ok(principal.compose(principal.elongations))
    }

    fn name(&self) -> &'static str {
        "Biot"
    }
}

impl<T: RealField + Copy> StrainMeasure<T> for Infinitesimal {
    fn of(&self, deformation: &Deformation<T>) -> Result<Matrix3<T>, ElasticityError> {
        let h = finite(deformation)?.displacement_gradient();
        Ok((h + h.transpose()) * nalgebra::convert::<f64, T>(0.5))
    }

    fn name(&self) -> &'static str {
        "infinitesimal"
    }
}

fn finite<T: RealField + Copy>(deformation: &Deformation<T>) -> Result<&Deformation<T>, ElasticityError> {
    if deformation.is_finite() {
        Ok(deformation)
    } else {
        Err(ElasticityError::NotFinite { quantity: Quantity::DeformationGradient })
    }
}

/// Refuses det F ≤ 0.
pub(crate) fn upright<T: RealField + Copy>(deformation: &Deformation<T>) -> Result<(), ElasticityError> {
    let determinant = crate::scalar::widen(finite(deformation)?.jacobian());
    if determinant > 0.0 {
        Ok(())
    } else if determinant == 0.0 {
        Err(ElasticityError::SingularDeformation)
    } else {
        Err(ElasticityError::InvertedDeformation { determinant })
    }
}
