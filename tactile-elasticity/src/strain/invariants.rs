//! Scalars of a symmetric tensor that do not depend on the axes.

use super::stretch::symmetric_eigen;
use nalgebra::Matrix3;

/// Principal values, largest first, and their directions.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::PrincipalValues;
/// let shear = Matrix3::new(0.0, 0.5, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0);
/// assert_eq!(PrincipalValues::from(&shear).values, [0.5, 0.0, -0.5]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PrincipalValues {
    /// The eigenvalues, largest first.
    pub values: [f64; 3],
    /// Column i is the direction of value i, of length 1.
    pub directions: Matrix3<f64>,
}

impl From<&Matrix3<f64>> for PrincipalValues {
    /// Of a symmetric tensor.
    fn from(tensor: &Matrix3<f64>) -> Self {
        let (values, directions) = symmetric_eigen(tensor);
        Self { values, directions }
    }
}

/// I₁ = tr A, I₂ = ½(tr² A − tr A²), I₃ = det A.
///
/// ```
/// use nalgebra::{Matrix3, Vector3};
/// use tactile_elasticity::strain::Invariants;
/// let i = Invariants::from(&Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 3.0)));
/// assert_eq!((i.first, i.second, i.third), (6.0, 11.0, 6.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Invariants {
    /// I₁, for a small strain the relative change of volume.
    pub first: f64,
    /// I₂.
    pub second: f64,
    /// I₃.
    pub third: f64,
}

impl From<&Matrix3<f64>> for Invariants {
    /// Of a tensor.
    fn from(a: &Matrix3<f64>) -> Self {
        let minor = |i: usize, j: usize| a[(i, i)] * a[(j, j)] - a[(i, j)] * a[(j, i)];
        Self {
            first: a.trace(),
            second: minor(0, 1) + minor(0, 2) + minor(1, 2),
            third: a.determinant(),
        }
    }
}

/// Equivalent strain √(⅔ dev A : dev A), dev A = A − ⅓ tr A I.
///
/// The form conjugate to the von Mises stress of an incompressible solid; the other one in use,
/// √(3⁄2 e:e)/(1 + ν), is the same at ν = ½ only.
///
/// ```
/// use nalgebra::{Matrix3, Vector3};
/// use tactile_elasticity::strain::von_mises_strain;
/// let isochoric = Matrix3::from_diagonal(&Vector3::new(0.02, -0.01, -0.01));
/// assert!((von_mises_strain(&isochoric) - 0.02f64).abs() < 1e-17);
/// ```
pub fn von_mises_strain(a: &Matrix3<f64>) -> f64 {
    scaled_norm(&deviator(a), 2.0 / 3.0)
}

/// A − ⅓ tr A I.
pub(crate) fn deviator(a: &Matrix3<f64>) -> Matrix3<f64> {
    // Differences of the diagonal: exact where its entries are close, and zero for c·I.
    let third: f64 = 1.0 / 3.0;
    let (x, y, z) = (a[(0, 0)], a[(1, 1)], a[(2, 2)]);
    let mut dev = *a;
    dev[(0, 0)] = ((x - y) + (x - z)) * third;
    dev[(1, 1)] = ((y - x) + (y - z)) * third;
    dev[(2, 2)] = ((z - x) + (z - y)) * third;
    dev
}

/// √(factor · a:a), scaled so that squares neither underflow nor overflow.
pub(crate) fn scaled_norm(a: &Matrix3<f64>, factor: f64) -> f64 {
    let scale = a.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    if scale == 0.0 {
        return scale;
    }
    (a / scale).norm() * factor.sqrt() * scale
}
