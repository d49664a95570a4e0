//! From one measure of stress to another.

use super::{BiotStress, Cauchy, FirstPiolaKirchhoff, Kirchhoff, SecondPiolaKirchhoff, Stress};
use crate::error::ElasticityError;
use crate::strain::{Biot, Deformation, StrainMeasure, upright};
use nalgebra::{Matrix3, RealField};

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
    pub fn to_cauchy(
        &self,
        deformation: &Deformation<T>,
    ) -> Result<Stress<Cauchy, T>, ElasticityError> {
        let (f, j) = checked(deformation)?;
        Ok(Stress::new(symmetric(
            &(f * self.tensor * f.transpose() / j),
        )))
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
    pub fn to_biot(
        &self,
        deformation: &Deformation<T>,
    ) -> Result<Stress<BiotStress, T>, ElasticityError> {
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
        let inverse = deformation
            .inverse()
            .ok_or(ElasticityError::SingularDeformation)?;
        Ok(Stress::new(symmetric(
            &(inverse * self.tensor * inverse.transpose() * j),
        )))
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
    pub fn to_cauchy(
        &self,
        deformation: &Deformation<T>,
    ) -> Result<Stress<Cauchy, T>, ElasticityError> {
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
        let inverse = deformation
            .inverse()
            .ok_or(ElasticityError::SingularDeformation)?;
        Ok(Stress::new(symmetric(&(inverse * self.tensor))))
    }
}

fn checked<T: RealField + Copy>(
    deformation: &Deformation<T>,
) -> Result<(Matrix3<T>, T), ElasticityError> {
    upright(deformation)?;
    Ok((deformation.deformation_gradient(), deformation.jacobian()))
}

fn symmetric<T: RealField + Copy>(m: &Matrix3<T>) -> Matrix3<T> {
    (m + m.transpose()) * nalgebra::convert::<f64, T>(0.5)
}
