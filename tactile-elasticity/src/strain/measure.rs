//! The five measures of strain.

use super::{Deformation, PrincipalStretches};
use crate::error::{ElasticityError, Quantity};
use nalgebra::Matrix3;
use std::sync::Arc;

/// A way to measure strain: a symmetric tensor that vanishes when the material only moves and turns
/// (the infinitesimal one: only moves).
///
/// Object safe, and a boxed or shared one is one too, so that a program can choose at run time. Cost: Green–Lagrange and infinitesimal
/// some 10 ns, the others a small eigenvalue problem.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{GreenLagrange, Hencky, StrainMeasure};
/// let mut h = Matrix3::zeros();
/// h[(0, 0)] = 0.05; // 5 % stretch along x
/// let measures: [&dyn StrainMeasure; 2] = [&GreenLagrange, &Hencky];
/// let exx = measures.map(|m| m.strain(&h).unwrap()[(0, 0)]);
/// assert!((exx[0] - 0.05125).abs() < 1e-15);
/// assert!((exx[1] - 1.05f64.ln()).abs() < 1e-15);
/// ```
pub trait StrainMeasure {
    /// The strain of a deformation.
    ///
    /// # Errors
    /// [`ElasticityError::NotFinite`]; and for the measures that need F⁻¹ or U to exist,
    /// [`ElasticityError::SingularDeformation`] and [`ElasticityError::InvertedDeformation`].
    ///
    /// ```
    /// use nalgebra::Matrix3;
    /// use tactile_elasticity::strain::{Deformation, Hencky, StrainMeasure};
    ///
    /// // Inside out there is no logarithm.
    /// let inverted = Deformation::from_deformation_gradient(Matrix3::from_diagonal_element(-1.0_f64));
    /// assert!(Hencky.of(&inverted).is_err());
    /// ```
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError>;

    /// The measure's name, as the field writes it.
    ///
    /// ```
    /// use tactile_elasticity::strain::{GreenLagrange, Hencky, StrainMeasure};
    ///
    /// let measures: [&dyn StrainMeasure; 2] = [&GreenLagrange, &Hencky];
    /// assert_eq!(measures.map(|m| m.name()), ["Green-Lagrange", "Hencky"]);
    /// ```
    fn name(&self) -> &'static str;

    /// The strain of a displacement gradient H (F = I + H). Errors as [`of`](Self::of).
    fn strain(&self, h: &Matrix3<f64>) -> Result<Matrix3<f64>, ElasticityError> {
        self.of(&Deformation::from_displacement_gradient(*h))
    }
}

impl<M: StrainMeasure + ?Sized> StrainMeasure for Box<M> {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        (**self).of(deformation)
    }

    fn name(&self) -> &'static str {
        (**self).name()
    }

    fn strain(&self, h: &Matrix3<f64>) -> Result<Matrix3<f64>, ElasticityError> {
        (**self).strain(h)
    }
}

impl<M: StrainMeasure + ?Sized> StrainMeasure for Arc<M> {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        (**self).of(deformation)
    }

    fn name(&self) -> &'static str {
        (**self).name()
    }

    fn strain(&self, h: &Matrix3<f64>) -> Result<Matrix3<f64>, ElasticityError> {
        (**self).strain(h)
    }
}

/// E = ½(FᵀF − I) = ½(H + Hᵀ + HᵀH): Lagrangian, conjugate to the second Piola–Kirchhoff stress.
///
/// (26)–(30) of the paper print the exponents 3 for 2, and f for the map of positions, so that ∇u = ∇f − I.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{Deformation, GreenLagrange, StrainMeasure};
///
/// // A stretch of λ: ½(λ² − 1).
/// let stretched = Deformation::from_displacement_gradient(Matrix3::from_diagonal_element(0.1));
/// assert!((GreenLagrange.of(&stretched)?[(0, 0)] - 0.105_f64).abs() < 1e-16);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GreenLagrange;

/// e = ½(I − F⁻ᵀF⁻¹) = F⁻ᵀ E F⁻¹: Eulerian, of the deformed state.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{EulerAlmansi, StrainMeasure};
///
/// // A stretch of λ: ½(1 − λ⁻²).
/// let strain = EulerAlmansi.strain(&Matrix3::from_diagonal_element(1.0))?;
/// assert!((strain[(0, 0)] - 0.375_f64).abs() < 1e-15);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EulerAlmansi;

/// ln U, the logarithmic strain in material axes: its trace is ln J, and coaxial steps add up.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{Hencky, StrainMeasure};
///
/// // Steps that stretch the same axes add up: 10 % twice is 21 % once.
/// let strain = |stretch: f64| Hencky.strain(&Matrix3::from_diagonal_element(stretch)).map(|e| e[(0, 0)]);
/// assert!((2.0 * strain(0.10)? - strain(0.21)?).abs() < 1e-15);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Hencky;

/// U − I: relative elongations along the principal directions, conjugate to the Biot stress.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{Biot, StrainMeasure};
///
/// // A turn by a right angle with 5 % of stretch: the turn does not count.
/// let turned = Matrix3::new(0.0, -1.05, 0.0, 1.05, 0.0, 0.0, 0.0, 0.0, 1.05) - Matrix3::identity();
/// assert!((Biot.strain(&turned)?[(0, 0)] - 0.05_f64).abs() < 1e-15);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Biot;

/// ε = ½(H + Hᵀ): linear in the displacement, wrong by the rotation squared.
///
/// ```
/// use nalgebra::{Matrix3, Rotation3, Vector3};
/// use tactile_elasticity::strain::{Infinitesimal, StrainMeasure};
///
/// // A mere turn by 0.1 rad is taken for a squeeze of 1 − cos 0.1.
/// let turn = Rotation3::new(Vector3::z() * 0.1_f64).into_inner() - Matrix3::identity();
/// assert!((Infinitesimal.strain(&turn)?[(0, 0)] - (0.1_f64.cos() - 1.0)).abs() < 1e-15);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Infinitesimal;

impl StrainMeasure for GreenLagrange {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        finite(deformation).map(Deformation::green_lagrange)
    }

    fn name(&self) -> &'static str {
        "Green-Lagrange"
    }
}

impl StrainMeasure for EulerAlmansi {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        upright(deformation)?;
        let inverse = deformation
            .inverse()
            .ok_or(ElasticityError::SingularDeformation)?;
        let e = deformation.green_lagrange();
        let quarter: f64 = 0.25;
        let small = e.iter().all(|x| x.abs() < quarter);
        let half: f64 = 0.5;
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

impl StrainMeasure for Hencky {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        upright(deformation)?;
        let principal = PrincipalStretches::from(deformation);
        Ok(principal.compose(principal.logarithms))
    }

    fn name(&self) -> &'static str {
        "Hencky"
    }
}

impl StrainMeasure for Biot {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        upright(deformation)?;
        let principal = PrincipalStretches::from(deformation);
        Ok(principal.compose(principal.elongations))
    }

    fn name(&self) -> &'static str {
        "Biot"
    }
}

impl StrainMeasure for Infinitesimal {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        let h = finite(deformation)?.displacement_gradient();
        Ok((h + h.transpose()) * 0.5)
    }

    fn name(&self) -> &'static str {
        "infinitesimal"
    }
}

fn finite(deformation: &Deformation) -> Result<&Deformation, ElasticityError> {
    if deformation.is_finite() {
        Ok(deformation)
    } else {
        Err(ElasticityError::NotFinite {
            quantity: Quantity::DeformationGradient,
        })
    }
}

/// Refuses det F ≤ 0.
pub(crate) fn upright(deformation: &Deformation) -> Result<(), ElasticityError> {
    let determinant = finite(deformation)?.jacobian();
    if determinant > 0.0 {
        Ok(())
    } else if determinant == 0.0 {
        Err(ElasticityError::SingularDeformation)
    } else {
        Err(ElasticityError::InvertedDeformation { determinant })
    }
}
