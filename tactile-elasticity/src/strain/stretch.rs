//! Principal stretches and their directions: F = R U, U = Σ λᵢ vᵢ vᵢᵀ.

use super::deformation::Deformation;
use nalgebra::{Matrix3, RealField, Vector3};

/// The right stretch U in its principal axes, largest stretch first.
///
/// ```
/// use nalgebra::{Matrix3, Vector3};
/// use tactile_elasticity::strain::{Deformation, PrincipalStretches};
///
/// let deformation = Deformation::from_displacement_gradient(Matrix3::from_diagonal(&Vector3::new(0.0, 1e-20, -0.05)));
/// let principal = PrincipalStretches::from(&deformation);
/// assert!((principal.elongations[0] / 1e-20_f64 - 1.0).abs() < 1e-12);
/// assert!((principal.stretches[2] - 0.95).abs() < 1e-15);
/// assert!((principal.directions.column(2)[2].abs() - 1.0).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(serialize = "T: nalgebra::Scalar + serde::Serialize"))
)]
pub struct PrincipalStretches<T> {
    /// λᵢ, the singular values of F.
    pub stretches: [T; 3],
    /// λᵢ − 1, without cancellation where the strain is small.
    pub elongations: [T; 3],
    /// ln λᵢ, likewise; −∞ where λᵢ = 0.
    pub logarithms: [T; 3],
    /// Column i is the material direction vᵢ, of length 1.
    pub directions: Matrix3<T>,
}

impl<T: RealField + Copy> From<&Deformation<T>> for PrincipalStretches<T> {
    /// Of a deformation; needs finite entries.
    ///
    /// Near the identity they come from the eigenvalues 2E of C − I, which keeps every digit of a tiny strain;
    /// elsewhere from the singular values of F by one-sided Jacobi, which keeps every digit of a tiny stretch.
    fn from(deformation: &Deformation<T>) -> Self {
        let e = deformation.green_lagrange();
        let quarter: T = nalgebra::convert(0.25);
        let largest = e.iter().fold(T::zero(), |m, x| m.max(x.abs()));
        // |eigenvalue| ≤ 3 max |e|: within this bound C is between ½I and 3⁄2 I.
        if largest * nalgebra::convert(3.0) <= quarter {
            Self::from_small_strain(&e)
        } else {
            Self::from_singular_values(deformation)
        }
    }
}

impl<T: RealField + Copy> PrincipalStretches<T> {
    fn from_small_strain(e: &Matrix3<T>) -> Self {
        let (values, directions) = symmetric_eigen(e);
        let two: T = nalgebra::convert(2.0);
        let elongation = |x: T| two * x / (T::one() + (T::one() + two * x).sqrt());
        let elongations = values.map(elongation);
        Self {
            stretches: elongations.map(|x| T::one() + x),
            elongations,
            logarithms: values.map(|x| (two * x).ln_1p() / two),
            directions,
        }
    }

    fn from_singular_values(deformation: &Deformation<T>) -> Self {
        let (mut s, directions) = one_sided_jacobi(&deformation.deformation_gradient());
        let thousandth: T = nalgebra::convert(1e-3);
        if s[2] < s[0] * thousandth && s[1] > T::zero() {
            // λ₁λ₂λ₃ = |J|, and J is accurate to its last digit.
            s[2] = deformation.jacobian().abs() / s[0] / s[1];
        }
        Self {
            stretches: s,
            elongations: s.map(|x| x - T::one()),
            logarithms: s.map(|x| {
                if x > T::zero() {
                    x.ln()
                } else {
                    T::min_value().unwrap_or(-x)
                }
            }),
            directions,
        }
    }

    /// Σ gᵢ vᵢ vᵢᵀ.
    pub(crate) fn compose(&self, g: [T; 3]) -> Matrix3<T> {
        let mut sum = Matrix3::zeros();
        for (i, &gi) in g.iter().enumerate() {
            let v: Vector3<T> = self.directions.column(i).into();
            for r in 0..3 {
                for c in r..3 {
                    sum[(r, c)] += gi * v[r] * v[c];
                }
            }
        }
        for r in 0..3 {
            for c in 0..r {
                sum[(r, c)] = sum[(c, r)];
            }
        }
        sum
    }
}

/// Rotation (c, s) that makes the off-diagonal of [[app, apq], [apq, aqq]] vanish.
fn jacobi_rotation<T: RealField + Copy>(app: T, aqq: T, apq: T) -> (T, T, T) {
    let two: T = nalgebra::convert(2.0);
    let theta = (aqq - app) / (two * apq);
    let t = T::one() / (theta.abs() + (theta * theta + T::one()).sqrt());
    let t = if theta < T::zero() { -t } else { t };
    let c = T::one() / (t * t + T::one()).sqrt();
    (c, t * c, t)
}

/// Eigenvalues (largest first) and eigenvectors of a symmetric matrix by cyclic Jacobi rotations.
pub(crate) fn symmetric_eigen<T: RealField + Copy>(m: &Matrix3<T>) -> ([T; 3], Matrix3<T>) {
    let mut a = *m;
    let mut v = Matrix3::identity();
    for _ in 0..32 {
        let mut done = true;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let apq = a[(p, q)];
            let scale = a[(p, p)].abs().max(a[(q, q)].abs());
            if apq == T::zero()
                || (scale + apq.abs() == scale && apq.abs() < scale * T::default_epsilon())
            {
                continue;
            }
            done = false;
            let (c, s, t) = jacobi_rotation(a[(p, p)], a[(q, q)], apq);
            let r = 3 - p - q;
            a[(p, p)] -= t * apq;
            a[(q, q)] += t * apq;
            (a[(p, q)], a[(q, p)]) = (T::zero(), T::zero());
            let (arp, arq) = (a[(r, p)], a[(r, q)]);
            (a[(r, p)], a[(r, q)]) = (c * arp - s * arq, s * arp + c * arq);
            (a[(p, r)], a[(q, r)]) = (a[(r, p)], a[(r, q)]);
            rotate_columns(&mut v, p, q, c, s);
        }
        if done {
            break;
        }
    }
    sorted([a[(0, 0)], a[(1, 1)], a[(2, 2)]], v)
}

/// Singular values (largest first) and right singular vectors of `f` by one-sided Jacobi (Hestenes).
fn one_sided_jacobi<T: RealField + Copy>(f: &Matrix3<T>) -> ([T; 3], Matrix3<T>) {
    let scale = f.iter().fold(T::zero(), |m, x| m.max(x.abs()));
    if scale == T::zero() {
        return ([T::zero(); 3], Matrix3::identity());
    }
    let mut w = f / scale;
    let mut v = Matrix3::identity();
    for _ in 0..32 {
        let mut done = true;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (app, aqq) = (w.column(p).norm_squared(), w.column(q).norm_squared());
            let apq = w.column(p).dot(&w.column(q));
            if apq.abs() <= T::default_epsilon() * (app * aqq).sqrt() {
                continue;
            }
            done = false;
            let (c, s, _) = jacobi_rotation(app, aqq, apq);
            rotate_columns(&mut w, p, q, c, s);
            rotate_columns(&mut v, p, q, c, s);
        }
        if done {
            break;
        }
    }
    sorted([0, 1, 2].map(|i| w.column(i).norm() * scale), v)
}

fn rotate_columns<T: RealField + Copy>(m: &mut Matrix3<T>, p: usize, q: usize, c: T, s: T) {
    for r in 0..3 {
        let (a, b) = (m[(r, p)], m[(r, q)]);
        (m[(r, p)], m[(r, q)]) = (c * a - s * b, s * a + c * b);
    }
}

fn sorted<T: RealField + Copy>(values: [T; 3], v: Matrix3<T>) -> ([T; 3], Matrix3<T>) {
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| {
        values[j]
            .partial_cmp(&values[i])
            .unwrap_or(core::cmp::Ordering::Equal)
    });
    let columns = order.map(|i| v.column(i).into_owned());
    (order.map(|i| values[i]), Matrix3::from_columns(&columns))
}
