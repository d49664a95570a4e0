//! From the covariance of displacements to that of the mean Green–Lagrange strain.
//!
//! A smoothing spline is linear in its data: H(Xᵢ) = Σⱼ uⱼ aᵢⱼᵀ, with aᵢⱼ the gradient at Xᵢ of the j-th point's share.
//! To first order dE = sym(Fᵀ dH), so that the mean is linear in the data too, and its covariance a sum over the points.

use crate::error::{ElasticityError, Quantity};
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3};

/// Order of the components in covariances of strain: xx, yy, zz, xy, xz, yz.
const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// Covariance of the Green–Lagrange strain (xx, yy, zz, xy, xz, yz) from that of H, whose nine entries are taken column by column.
///
/// ```
/// use nalgebra::{Matrix3, SMatrix};
/// use tactile_elasticity::field::strain_covariance;
///
/// // Small strains: xx follows its own entry, xy the mean of two.
/// let covariance = strain_covariance(&Matrix3::zeros(), &(SMatrix::<f64, 9, 9>::identity() * 1e-8));
/// assert_eq!((covariance[(0, 0)], covariance[(3, 3)]), (1e-8, 0.5e-8));
/// ```
pub fn strain_covariance(gradient: &Matrix3<f64>, covariance: &SMatrix<f64, 9, 9>) -> Matrix6<f64> {
    let f = gradient + Matrix3::identity();
    let half: f64 = 0.5;
    // ∂E_ab/∂H_kl = ½(δ_bl F_ka + δ_al F_kb)
    let jacobian = SMatrix::<f64, 6, 9>::from_fn(|row, column| {
        let ((a, b), (k, l)) = (PAIRS[row], (column % 3, column / 3));
        let first = if b == l { f[(k, a)] } else { 0.0 };
        let second = if a == l { f[(k, b)] } else { 0.0 };
        (first + second) * half
    });
    jacobian * covariance * jacobian.transpose()
}

/// Covariance of the weighted mean Green–Lagrange strain (xx, yy, zz, xy, xz, yz).
///
/// `gradients` and `weights` are those of the sample points i; `influence(i, j)` is aᵢⱼ, how the gradient at sample i follows
/// data point j; `displacement_covariance[j]` is the covariance of data point j's displacement, independent of the others. O(samples · data).
///
/// # Errors
/// [`ElasticityError::LengthMismatch`], [`ElasticityError::NotPositive`] where the weights add up to nothing.
///
/// ```
/// use nalgebra::{Matrix3, Vector3};
/// use tactile_elasticity::field::mean_strain_covariance;
///
/// // A bar of length 1 whose gradient is the difference of its two ends' displacements, each known to 10⁻⁴.
/// let influence = |_, end| Vector3::new(if end == 0 { -1.0 } else { 1.0 }, 0.0, 0.0);
/// let ends = [Matrix3::from_diagonal_element(1e-8); 2];
/// let covariance = mean_strain_covariance(&[Matrix3::zeros()], &[1.0], influence, &ends)?;
/// assert!((covariance[(0, 0)] - 2e-8_f64).abs() < 1e-22);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn mean_strain_covariance(
    gradients: &[Matrix3<f64>],
    weights: &[f64],
    influence: impl Fn(usize, usize) -> Vector3<f64>,
    displacement_covariance: &[Matrix3<f64>],
) -> Result<Matrix6<f64>, ElasticityError> {
    if weights.len() != gradients.len() {
        let (expected, found) = (gradients.len(), weights.len());
        return Err(ElasticityError::LengthMismatch {
            quantity: Quantity::Weight,
            expected,
            found,
        });
    }
    let total = weights.iter().fold(0.0, |s, &w| s + w);
    crate::error::positive(total, Quantity::Weight)?;
    let half: f64 = 0.5;
    let mut sum = Matrix6::zeros();
    for (j, sigma) in displacement_covariance.iter().enumerate() {
        // Row ab: what a displacement of point j adds to the mean E_ab.
        let mut response = SMatrix::<f64, 6, 3>::zeros();
        for (i, h) in gradients.iter().enumerate() {
            let (f, a) = (
                h + Matrix3::identity(),
                influence(i, j) * (weights[i] / total),
            );
            for (row, &(p, q)) in PAIRS.iter().enumerate() {
                for k in 0..3 {
                    response[(row, k)] += (f[(k, p)] * a[q] + f[(k, q)] * a[p]) * half;
                }
            }
        }
        sum += response * sigma * response.transpose();
    }
    Ok(sum)
}
