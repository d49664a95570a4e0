//! Green–Lagrange strain of many gradients at once.

use super::deformation::{cancels, green_lagrange_plain};
use super::{GreenLagrange, StrainMeasure};
use crate::error::{ElasticityError, Quantity};
use nalgebra::{Matrix3, RealField};

/// The Green–Lagrange strain of every displacement gradient, written to `strains`; allocates nothing.
///
/// The same bits as [`GreenLagrange`] one at a time; a gradient that is not finite gives NaN there
/// and leaves its neighbours alone.
///
/// # Errors
/// [`ElasticityError::LengthMismatch`] where the slices differ in length.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::green_lagrange_into;
/// let gradients = vec![Matrix3::from_diagonal_element(0.1); 100];
/// let mut strains = vec![Matrix3::zeros(); 100];
/// green_lagrange_into(&gradients, &mut strains)?;
/// assert!((strains[99][(0, 0)] - 0.105f64).abs() < 1e-16);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn green_lagrange_into<T: RealField + Copy>(
    gradients: &[Matrix3<T>],
    strains: &mut [Matrix3<T>],
) -> Result<(), ElasticityError> {
    if gradients.len() != strains.len() {
        let (expected, found) = (gradients.len(), strains.len());
        return Err(ElasticityError::LengthMismatch { quantity: Quantity::Strain, expected, found });
    }
    for (h, strain) in gradients.iter().zip(strains) {
        let plain = green_lagrange_plain(h);
        *strain = if cancels(h, &plain) { careful(h) } else { plain };
    }
    Ok(())
}

#[cold]
fn careful<T: RealField + Copy>(h: &Matrix3<T>) -> Matrix3<T> {
    GreenLagrange.strain(h).unwrap_or_else(|_| Matrix3::repeat(nalgebra::convert(f64::NAN)))
}
