//! The deformation gradient F = I + H, kept in the form in which it was given so that no digits are lost.

use super::double_double::DoubleDouble;
use nalgebra::Matrix3;

/// F = I + H at a point, given by either, and the other rounded.
///
/// Strains of 10⁻¹² and below live in H and are lost when F is formed; stretches of 10⁻⁸ live in F and
/// are lost when H is. Every measure asks for whichever keeps its digits.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::Deformation;
/// let stretch = Deformation::from_displacement_gradient(Matrix3::from_diagonal_element(1e-20));
/// assert!((stretch.volume_change() / 3e-20f64 - 1.0).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deformation {
    f: Matrix3<f64>,
    h: Matrix3<f64>,
    given: Given,
}

/// Which of the two is exact.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Given {
    F,
    H,
}

impl Deformation {
    /// From H = ∂u/∂X, row = component of u, column = direction of the derivative.
    pub fn from_displacement_gradient(h: Matrix3<f64>) -> Self {
        Self {
            f: h + Matrix3::identity(),
            h,
            given: Given::H,
        }
    }

    /// From F = ∂x/∂X, the Jacobian of a map of positions.
    ///
    /// ```
    /// use nalgebra::Matrix3;
    /// use tactile_elasticity::strain::Deformation;
    ///
    /// let twice = Deformation::from_deformation_gradient(Matrix3::from_diagonal_element(2.0_f64));
    /// assert_eq!(twice.jacobian(), 8.0);
    /// assert_eq!(twice.displacement_gradient(), Matrix3::identity());
    /// assert_eq!(twice.deformation_gradient()[(2, 2)], 2.0);
    /// ```
    pub fn from_deformation_gradient(f: Matrix3<f64>) -> Self {
        Self {
            f,
            h: f - Matrix3::identity(),
            given: Given::F,
        }
    }

    /// F.
    pub fn deformation_gradient(&self) -> Matrix3<f64> {
        self.f
    }

    /// H = F − I.
    pub fn displacement_gradient(&self) -> Matrix3<f64> {
        self.h
    }

    /// True when every entry is a finite number.
    pub(crate) fn is_finite(&self) -> bool {
        self.h.iter().all(|x| x.is_finite())
    }

    /// J − 1 = tr H + II(H) + det H, the relative change of volume, without cancellation.
    pub fn volume_change(&self) -> f64 {
        match self.given {
            Given::F => determinant(&self.f).add(-1.0).value(),
            Given::H => self.volume_change_from_h(),
        }
    }

    /// J = det F; negative where the material is turned inside out.
    pub fn jacobian(&self) -> f64 {
        match self.given {
            Given::F => determinant(&self.f).value(),
            Given::H => 1.0 + self.volume_change_from_h(),
        }
    }

    fn volume_change_from_h(&self) -> f64 {
        let h = &self.h;
        let mut sum = determinant(h);
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            sum = sum
                .add_product(h[(j, j)], h[(k, k)])
                .add_product(-h[(j, k)], h[(k, j)]);
        }
        sum.add(h[(0, 0)]).add(h[(1, 1)]).add(h[(2, 2)]).value()
    }

    /// F⁻¹ by cofactors whose differences of products are summed in double-double; None where det F = 0.
    pub(crate) fn inverse(&self) -> Option<Matrix3<f64>> {
        let f = &self.f;
        let det = determinant(f).value();
        if det == 0.0 {
            return None;
        }
        Some(Matrix3::from_fn(|i, j| {
            let (r, s) = ((j + 1) % 3, (j + 2) % 3);
            let (p, q) = ((i + 1) % 3, (i + 2) % 3);
            let minor = DoubleDouble::zero().add_product(f[(r, p)], f[(s, q)]);
            minor.add_product(-f[(r, q)], f[(s, p)]).value() / det
        }))
    }

    /// E = ½(H + Hᵀ + HᵀH), summed in double-double where the terms cancel (large rotation, little strain).
    pub(crate) fn green_lagrange(&self) -> Matrix3<f64> {
        let plain = green_lagrange_plain(&self.h);
        if cancels(&self.h, &plain) {
            self.green_lagrange_double_double()
        } else {
            plain
        }
    }

    fn green_lagrange_double_double(&self) -> Matrix3<f64> {
        let half: f64 = 0.5;
        let mut e = Matrix3::zeros();
        for i in 0..3 {
            for j in i..3 {
                let m = if self.given == Given::F {
                    &self.f
                } else {
                    &self.h
                };
                let mut sum = DoubleDouble::zero();
                for k in 0..3 {
                    sum = sum.add_product(m[(k, i)], m[(k, j)]);
                }
                sum = match self.given {
                    Given::H => sum.add(m[(i, j)]).add(m[(j, i)]),
                    Given::F if i == j => sum.add(-1.0),
                    Given::F => sum,
                };
                e[(i, j)] = half * sum.value();
                e[(j, i)] = e[(i, j)];
            }
        }
        e
    }
}

/// ½(H + Hᵀ + HᵀH) in working precision.
#[inline(always)]
pub(crate) fn green_lagrange_plain(h: &Matrix3<f64>) -> Matrix3<f64> {
    let half: f64 = 0.5;
    let term = |i: usize, j: usize| {
        let product = h[(0, i)] * h[(0, j)] + h[(1, i)] * h[(1, j)] + h[(2, i)] * h[(2, j)];
        half * ((h[(i, j)] + h[(j, i)]) + product)
    };
    let (xx, yy, zz) = (term(0, 0), term(1, 1), term(2, 2));
    let (xy, xz, yz) = (term(0, 1), term(0, 2), term(1, 2));
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// Whether E is so much smaller than what it was summed from that more than two digits are gone.
#[inline(always)]
pub(crate) fn cancels(h: &Matrix3<f64>, e: &Matrix3<f64>) -> bool {
    // Summed as trees: a chain of additions would take longer than the strain itself.
    let of_h = ((h[(0, 0)].abs() + h[(1, 1)].abs()) + (h[(2, 2)].abs() + h[(0, 1)].abs()))
        + ((h[(1, 0)].abs() + h[(0, 2)].abs())
            + (h[(2, 0)].abs() + (h[(1, 2)].abs() + h[(2, 1)].abs())));
    let diagonal = (e[(0, 0)].abs() + e[(1, 1)].abs()) + e[(2, 2)].abs();
    let shear = (e[(0, 1)].abs() + e[(0, 2)].abs()) + e[(1, 2)].abs();
    let many: f64 = 128.0;
    (diagonal + shear) * many < of_h
}

fn determinant(m: &Matrix3<f64>) -> DoubleDouble {
    let mut sum = DoubleDouble::zero();
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        sum = sum.add_triple(m[(0, i)], m[(1, j)], m[(2, k)]);
        sum = sum.add_triple(-m[(0, i)], m[(1, k)], m[(2, j)]);
    }
    sum
}
