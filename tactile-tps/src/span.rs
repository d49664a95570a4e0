//! The directions that points span.

use crate::lanes::dot;

/// Number of affine functions in three dimensions: 1, x, y and z.
pub(crate) const MAX: usize = 4;

/// Coefficients of an affine function.
pub(crate) type Coefficients = [f64; MAX];

/// Maximum number of sweeps of rotations. Three columns need a few, because convergence is
/// quadratic.
const SWEEPS: usize = 20;

/// The directions in which points extend, from the singular values of their centred coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Span<const D: usize> {
    /// Number of spanned directions.
    pub(crate) directions: usize,
    /// Orthonormal directions, spanned ones first. The coordinate axes if all are spanned.
    pub(crate) basis: [[f64; D]; D],
    /// Root mean square extent along each direction, relative to the largest, in descending order.
    pub(crate) extents: [f64; D],
}

impl<const D: usize> Default for Span<D> {
    fn default() -> Self {
        Self {
            directions: 0,
            basis: [[0.0; D]; D],
            extents: [0.0; D],
        }
    }
}

impl<const D: usize> Span<D> {
    /// The span of n points. Their coordinates are in `columns`, by axes, which are overwritten.
    ///
    /// A direction counts if its extent exceeds the rounding error `grain` and the fraction
    /// `tolerance` of the largest extent.
    pub(crate) fn new(columns: &mut [f64], grain: f64, tolerance: f64) -> Self {
        let n = columns.len() / D;
        // Centred, so that a common offset does not count as extent.
        for column in columns.chunks_exact_mut(n) {
            let mean = column.iter().sum::<f64>() / n as f64;
            column.iter_mut().for_each(|x| *x -= mean);
        }
        let vectors = principal_axes::<D>(columns);
        let size = |k: usize| {
            let column = &columns[k * n..(k + 1) * n];
            dot(column, column).sqrt()
        };
        let mut order: [usize; D] = core::array::from_fn(|k| k);
        order.sort_unstable_by(|&i, &j| size(j).total_cmp(&size(i)));
        let sizes = order.map(size);
        let noise = f64::max(rounding(n, grain), tolerance * sizes[0]);
        let directions = sizes.iter().filter(|size| **size > noise).count();
        Self {
            directions,
            // The coordinate axes if all directions are spanned: the coefficients then are the
            // gradient.
            basis: if directions < D {
                order.map(|k| vectors[k])
            } else {
                core::array::from_fn(|j| core::array::from_fn(|i| f64::from(i == j)))
            },
            extents: sizes.map(|size| if sizes[0] > 0.0 { size / sizes[0] } else { 0.0 }),
        }
    }

    /// Affine function `c` of [1, x·b₁, …] at a point.
    pub(crate) fn value(&self, c: usize, point: &[f64; D]) -> f64 {
        if c == 0 {
            return 1.0;
        }
        (0..D).map(|k| self.basis[c - 1][k] * point[k]).sum()
    }

    /// Derivative of affine function `c` along an axis.
    pub(crate) fn slope(&self, c: usize, axis: usize) -> f64 {
        if c == 0 { 0.0 } else { self.basis[c - 1][axis] }
    }

    /// The affine function with coefficients `a` at a point.
    pub(crate) fn polynomial(&self, a: &Coefficients, point: &[f64; D]) -> f64 {
        (0..=self.directions)
            .map(|c| a[c] * self.value(c, point))
            .sum()
    }

    /// The identity on the directions that are not spanned: N = Σ b bᵀ over them.
    pub(crate) fn across(&self) -> [[f64; D]; D] {
        let entry = |i: usize, k: usize| {
            let others = &self.basis[self.directions..];
            others.iter().map(|b| b[i] * b[k]).sum()
        };
        core::array::from_fn(|i| core::array::from_fn(|k| entry(i, k)))
    }

    /// The gradient of an affine function in coordinates.
    pub(crate) fn gradient(&self, a: &Coefficients) -> [f64; D] {
        core::array::from_fn(|k| (1..=self.directions).map(|c| a[c] * self.slope(c, k)).sum())
    }
}

/// Size of a column of n coordinates that could come from rounding errors `grain` alone.
pub(crate) fn rounding(n: usize, grain: f64) -> f64 {
    // Rounding errors of n coordinates add up to √n times that of one. The factor 8 covers several
    // such sums.
    8.0 * (grain + f64::EPSILON) * (n as f64).sqrt()
}

/// Rotates the `D` columns until they are orthogonal. Returns the directions along which they then
/// point: the right singular vectors, in any order.
///
/// One-sided rotations (Hestenes 1958) compute small singular values to their own relative
/// precision.
pub(crate) fn principal_axes<const D: usize>(columns: &mut [f64]) -> [[f64; D]; D] {
    let n = columns.len() / D;
    let mut vectors = core::array::from_fn(|j| core::array::from_fn(|i| f64::from(i == j)));
    for _ in 0..SWEEPS {
        let mut turned = false;
        for q in 1..D {
            for p in 0..q {
                turned |= orthogonalise(columns, n, p, q, &mut vectors);
            }
        }
        if !turned {
            break;
        }
    }
    vectors
}

/// Rotates columns `p` and `q` of length `n` until they are orthogonal, and `vectors` with them.
/// Returns `false` if they already are.
fn orthogonalise<const D: usize>(
    columns: &mut [f64],
    n: usize,
    p: usize,
    q: usize,
    vectors: &mut [[f64; D]; D],
) -> bool {
    let (left, right) = columns.split_at_mut(q * n);
    let (left, right) = (&mut left[p * n..(p + 1) * n], &mut right[..n]);
    let (a, b, c) = (dot(left, left), dot(right, right), dot(left, right));
    // Rounding error of the sums. If the product is below it, the columns are orthogonal.
    if c.abs() <= f64::EPSILON * (n as f64).sqrt() * (a * b).sqrt() {
        return false;
    }
    let zeta = (b - a) / (2.0 * c);
    // The smaller of the two angles, in a form without cancellation.
    let tangent = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
    let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
    let sine = cosine * tangent;
    let turn = |x: &mut f64, y: &mut f64| {
        (*x, *y) = (cosine * *x - sine * *y, sine * *x + cosine * *y);
    };
    left.iter_mut().zip(right).for_each(|(x, y)| turn(x, y));
    let (head, tail) = vectors.split_at_mut(q);
    head[p]
        .iter_mut()
        .zip(&mut tail[0])
        .for_each(|(x, y)| turn(x, y));
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of known lengths are rotated by a known rotation. Their sizes must be recovered to
    /// rounding, and a small one to its own precision.
    #[test]
    fn extents_come_to_their_own_precision() {
        let (c, s) = (0.8, 0.6);
        let columns = [
            3.0 * c,
            -2e-9 * s,
            0.0,
            3.0 * s,
            2e-9 * c,
            0.0,
            0.0,
            0.0,
            1.0,
        ];
        // Each point with its mirror image, so that the mean is zero.
        let mut both: Vec<f64> = columns
            .chunks_exact(3)
            .flat_map(|column| column.iter().copied().chain(column.iter().map(|x| -x)))
            .collect();
        let span = Span::<3>::new(&mut both, 0.0, 1e-8);
        for (found, expected) in span.extents.iter().zip([1.0, 1.0 / 3.0, 2e-9 / 3.0]) {
            assert!((found / expected - 1.0).abs() < 1e-13, "{found}");
        }
        assert_eq!(span.directions, 2);
        assert!((span.basis[0][0].abs() - c).abs() < 1e-15);
    }
}
