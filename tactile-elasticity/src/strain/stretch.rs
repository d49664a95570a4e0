//! Principal stretches and their directions: F = R U, U = Σ λᵢ vᵢ vᵢᵀ.

use super::deformation::Deformation;
use nalgebra::{Matrix3, Vector3};

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
pub struct PrincipalStretches {
    /// λᵢ, the singular values of F.
    pub stretches: [f64; 3],
    /// λᵢ − 1, without cancellation where the strain is small.
    pub elongations: [f64; 3],
    /// ln λᵢ, likewise; −∞ where λᵢ = 0.
    pub logarithms: [f64; 3],
    /// Column i is the material direction vᵢ, of length 1.
    pub directions: Matrix3<f64>,
}

impl From<&Deformation> for PrincipalStretches {
    /// Of a deformation; needs finite entries.
    ///
    /// Near the identity they come from the eigenvalues 2E of C − I, which keeps every digit of a tiny strain;
    /// elsewhere from the singular values of F by one-sided Jacobi, which keeps every digit of a tiny stretch.
    fn from(deformation: &Deformation) -> Self {
        let e = deformation.green_lagrange();
        let quarter: f64 = 0.25;
        let largest = e.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        // |eigenvalue| ≤ 3 max |e|: within this bound C is between ½I and 3⁄2 I.
        if largest * 3.0 <= quarter {
            Self::from_small_strain(&e)
        } else {
            Self::from_singular_values(deformation)
        }
    }
}

impl PrincipalStretches {
    fn from_small_strain(e: &Matrix3<f64>) -> Self {
        let (values, directions) = symmetric_eigen(e);
        let two: f64 = 2.0;
        let elongation = |x: f64| two * x / (1.0 + (1.0 + two * x).sqrt());
        let elongations = values.map(elongation);
        Self {
            stretches: elongations.map(|x| 1.0 + x),
            elongations,
            logarithms: values.map(|x| (two * x).ln_1p() / two),
            directions,
        }
    }

    fn from_singular_values(deformation: &Deformation) -> Self {
        let (mut s, directions) = one_sided_jacobi(&deformation.deformation_gradient());
        let thousandth: f64 = 1e-3;
        if s[2] < s[0] * thousandth && s[1] > 0.0 {
            // λ₁λ₂λ₃ = |J|, and J is accurate to its last digit.
            s[2] = deformation.jacobian().abs() / s[0] / s[1];
        }
        Self {
            stretches: s,
            elongations: s.map(|x| x - 1.0),
            logarithms: s.map(|x| if x > 0.0 { x.ln() } else { f64::MIN }),
            directions,
        }
    }

    /// Σ gᵢ vᵢ vᵢᵀ.
    pub(crate) fn compose(&self, g: [f64; 3]) -> Matrix3<f64> {
        let mut sum = Matrix3::zeros();
        for (i, &gi) in g.iter().enumerate() {
            let v: Vector3<f64> = self.directions.column(i).into();
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
fn jacobi_rotation(app: f64, aqq: f64, apq: f64) -> (f64, f64, f64) {
    let two: f64 = 2.0;
    let theta = (aqq - app) / (two * apq);
    let t = 1.0 / (theta.abs() + (theta * theta + 1.0).sqrt());
    let t = if theta < 0.0 { -t } else { t };
    let c = 1.0 / (t * t + 1.0).sqrt();
    (c, t * c, t)
}

/// Eigenvalues (largest first) and eigenvectors of a symmetric matrix by cyclic Jacobi rotations.
pub(crate) fn symmetric_eigen(m: &Matrix3<f64>) -> ([f64; 3], Matrix3<f64>) {
    let mut a = *m;
    let mut v = Matrix3::identity();
    for _ in 0..32 {
        let mut done = true;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let apq = a[(p, q)];
            let scale = a[(p, p)].abs().max(a[(q, q)].abs());
            if apq == 0.0 || (scale + apq.abs() == scale && apq.abs() < scale * f64::EPSILON) {
                continue;
            }
            done = false;
            let (c, s, t) = jacobi_rotation(a[(p, p)], a[(q, q)], apq);
            let r = 3 - p - q;
            a[(p, p)] -= t * apq;
            a[(q, q)] += t * apq;
            (a[(p, q)], a[(q, p)]) = (0.0, 0.0);
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
fn one_sided_jacobi(f: &Matrix3<f64>) -> ([f64; 3], Matrix3<f64>) {
    let scale = f.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    if scale == 0.0 {
        return ([0.0; 3], Matrix3::identity());
    }
    let mut w = f / scale;
    let mut v = Matrix3::identity();
    for _ in 0..32 {
        let mut done = true;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (app, aqq) = (w.column(p).norm_squared(), w.column(q).norm_squared());
            let apq = w.column(p).dot(&w.column(q));
            if apq.abs() <= f64::EPSILON * (app * aqq).sqrt() {
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

fn rotate_columns(m: &mut Matrix3<f64>, p: usize, q: usize, c: f64, s: f64) {
    for r in 0..3 {
        let (a, b) = (m[(r, p)], m[(r, q)]);
        (m[(r, p)], m[(r, q)]) = (c * a - s * b, s * a + c * b);
    }
}

fn sorted(values: [f64; 3], v: Matrix3<f64>) -> ([f64; 3], Matrix3<f64>) {
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| {
        values[j]
            .partial_cmp(&values[i])
            .unwrap_or(core::cmp::Ordering::Equal)
    });
    let columns = order.map(|i| v.column(i).into_owned());
    (order.map(|i| values[i]), Matrix3::from_columns(&columns))
}
