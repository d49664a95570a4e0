//! Green–Lagrange strain of many gradients at once.

use super::deformation::{cancels, green_lagrange_plain};
use super::{GreenLagrange, StrainMeasure};
use crate::error::{ElasticityError, Quantity};
use nalgebra::Matrix3;

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
pub fn green_lagrange_into(
    gradients: &[Matrix3<f64>],
    strains: &mut [Matrix3<f64>],
) -> Result<(), ElasticityError> {
    same_length(gradients, strains)?;
    fill(gradients, strains);
    Ok(())
}

/// [`green_lagrange_into`] over rayon's threads: the same bits.
///
/// # Errors
/// As [`green_lagrange_into`].
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{green_lagrange_into, green_lagrange_par_into};
///
/// let gradients = vec![Matrix3::from_diagonal_element(0.1_f64); 10_000];
/// let (mut serial, mut parallel) = (vec![Matrix3::zeros(); 10_000], vec![Matrix3::zeros(); 10_000]);
/// green_lagrange_into(&gradients, &mut serial)?;
/// green_lagrange_par_into(&gradients, &mut parallel)?;
/// assert_eq!(serial, parallel);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[cfg(feature = "rayon")]
pub fn green_lagrange_par_into(
    gradients: &[Matrix3<f64>],
    strains: &mut [Matrix3<f64>],
) -> Result<(), ElasticityError> {
    use rayon::prelude::*;
    const CHUNK: usize = 4096;
    same_length(gradients, strains)?;
    gradients
        .par_chunks(CHUNK)
        .zip(strains.par_chunks_mut(CHUNK))
        .for_each(|(h, e)| fill(h, e));
    Ok(())
}

fn same_length<A, B>(gradients: &[A], strains: &[B]) -> Result<(), ElasticityError> {
    let (expected, found) = (gradients.len(), strains.len());
    if expected == found {
        return Ok(());
    }
    Err(ElasticityError::LengthMismatch {
        quantity: Quantity::Strain,
        expected,
        found,
    })
}

fn fill(gradients: &[Matrix3<f64>], strains: &mut [Matrix3<f64>]) {
    for (h, strain) in gradients.iter().zip(strains) {
        let plain = green_lagrange_plain(h);
        *strain = if cancels(h, &plain) {
            careful(h)
        } else {
            plain
        };
    }
}

#[cold]
fn careful(h: &Matrix3<f64>) -> Matrix3<f64> {
    GreenLagrange
        .strain(h)
        .unwrap_or_else(|_| Matrix3::repeat(f64::NAN))
}
