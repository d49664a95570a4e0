//! The directions that the points span.

use crate::{
    centres::Centres,
    double_double::DoubleDouble,
    layout::layout,
    null_space::{MAX, NullSpace},
    real::Real,
};

/// The directions points extend in, decided by the singular values of their centred coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Span<const D: usize> {
    /// Number of spanned directions.
    pub(crate) directions: usize,
    /// Orthonormal directions, spanned ones first; `None` if all are, and the coordinate axes serve.
    basis: Option<[[f64; D]; D]>,
    /// Root mean square extent along each direction relative to the largest, falling.
    pub(crate) extents: [f64; D],
}

impl<const D: usize> Default for Span<D> {
    fn default() -> Self {
        Self {
            directions: 0,
            basis: None,
            extents: [0.0; D],
        }
    }
}

impl<const D: usize> Span<D> {
    /// The span of the `active` centres. `tolerance` is the share of the largest extent below which a direction counts
    /// as not spanned; `scratch` is overwritten.
    pub(crate) fn new(
        centres: &Centres<D>,
        active: &[usize],
        tolerance: f64,
        scratch: &mut NullSpace,
    ) -> Self {
        let n = active.len();
        let mean = |k: usize| active.iter().map(|&i| centres.axes[k][i]).sum::<f64>() / n as f64;
        let means: [f64; D] = core::array::from_fn(mean);
        let mut rows = [[0.0; D]; D];
        if n >= D {
            scratch.factor(n, D, layout(n, D), |k, column| {
                column
                    .iter_mut()
                    .zip(active)
                    .for_each(|(v, &i)| *v = centres.axes[k][i] - means[k]);
            });
            rows = core::array::from_fn(|j| core::array::from_fn(|i| scratch.triangle(i, j)));
        } else {
            for (i, &centre) in active.iter().enumerate() {
                (0..D).for_each(|k| rows[k][i] = centres.axes[k][centre] - means[k]);
            }
        }
        Self::of_columns(rows, n, centres.grain, tolerance)
    }

    fn of_columns(columns: [[f64; D]; D], n: usize, grain: f64, tolerance: f64) -> Self {
        let (sizes, vectors) = singular(columns);
        let noise = f64::max(
            8.0 * (grain + f64::EPSILON) * (n as f64).sqrt(),
            tolerance * sizes[0],
        );
        let directions = sizes.iter().filter(|size| **size > noise).count();
        let extents = sizes.map(|size| if sizes[0] > 0.0 { size / sizes[0] } else { 0.0 });
        Self {
            directions,
            basis: (directions < D).then_some(vectors),
            extents,
        }
    }

    /// Writes affine function `c` of [1, x·b₁, …] at the centres `active`, each value times its `scale`.
    pub(crate) fn fill(
        &self,
        centres: &Centres<D>,
        active: &[usize],
        scales: &[f64],
        c: usize,
        column: &mut [f64],
    ) {
        for (value, &centre) in column.iter_mut().zip(active) {
            *value = match (c, &self.basis) {
                (0, _) => 1.0,
                (c, None) => centres.axes[c - 1][centre],
                (c, Some(basis)) => (0..D)
                    .map(|k| basis[c - 1][k] * centres.axes[k][centre])
                    .sum(),
            };
        }
        column
            .iter_mut()
            .zip(scales)
            .for_each(|(value, scale)| *value *= scale);
    }

    /// Σ aₖ pₖ(x) for the coordinates `x`.
    pub(crate) fn polynomial(&self, a: &[f64], x: impl Fn(usize) -> f64) -> f64 {
        let along = |c: usize| match &self.basis {
            None => x(c),
            Some(basis) => (0..D).map(|k| basis[c][k] * x(k)).sum(),
        };
        a[0] + (0..self.directions)
            .map(|c| a[c + 1] * along(c))
            .sum::<f64>()
    }

    /// Affine function `c` at a point.
    pub(crate) fn value(&self, c: usize, point: &[f64; D]) -> f64 {
        match (c, &self.basis) {
            (0, _) => 1.0,
            (c, None) => point[c - 1],
            (c, Some(basis)) => (0..D).map(|k| basis[c - 1][k] * point[k]).sum(),
        }
    }

    /// Derivative of affine function `c` along an axis.
    pub(crate) fn slope(&self, c: usize, axis: usize) -> f64 {
        match (c, &self.basis) {
            (0, _) => 0.0,
            (c, None) => f64::from(u8::from(c - 1 == axis)),
            (c, Some(basis)) => basis[c - 1][axis],
        }
    }

    /// Affine function `c` at a point, in twice the working precision.
    pub(crate) fn precise(&self, c: usize, point: &[DoubleDouble; D]) -> DoubleDouble {
        match (c, &self.basis) {
            (0, _) => DoubleDouble::from_f64(1.0),
            (c, None) => point[c - 1],
            (c, Some(basis)) => (0..D).fold(DoubleDouble::ZERO, |sum, k| {
                sum + point[k] * DoubleDouble::from_f64(basis[c - 1][k])
            }),
        }
    }

    /// The gradient in coordinates of an affine function with these coefficients.
    pub(crate) fn gradient(&self, a: &[f64; MAX]) -> [f64; D] {
        match &self.basis {
            None => core::array::from_fn(|k| a[k + 1]),
            Some(basis) => {
                core::array::from_fn(|k| (0..self.directions).map(|c| a[c + 1] * basis[c][k]).sum())
            }
        }
    }
}

/// Singular values, falling, and right singular vectors by one-sided rotations (Hestenes 1958), which keep small
/// singular values to their own relative precision.
fn singular<const D: usize>(mut columns: [[f64; D]; D]) -> ([f64; D], [[f64; D]; D]) {
    let mut vectors =
        core::array::from_fn(|j| core::array::from_fn(|i| if i == j { 1.0 } else { 0.0 }));
    // Three columns need a handful of sweeps; convergence is quadratic.
    for _ in 0..20 {
        let mut turned = false;
        for p in 0..D {
            for q in p + 1..D {
                if let Some((cosine, sine)) = rotation(&columns[p], &columns[q]) {
                    turned = true;
                    rotate(&mut columns, p, q, cosine, sine);
                    rotate(&mut vectors, p, q, cosine, sine);
                }
            }
        }
        if !turned {
            break;
        }
    }
    let sizes = columns.map(|c| inner(&c, &c).sqrt());
    let mut order: [usize; D] = core::array::from_fn(|k| k);
    order.sort_unstable_by(|&i, &j| sizes[j].total_cmp(&sizes[i]));
    (order.map(|k| sizes[k]), order.map(|k| vectors[k]))
}

/// Cosine and sine of the rotation that makes two columns orthogonal, `None` if they are.
fn rotation<const D: usize>(p: &[f64; D], q: &[f64; D]) -> Option<(f64, f64)> {
    let (a, b, c) = (inner(p, p), inner(q, q), inner(p, q));
    if c.abs() > f64::EPSILON * (a * b).sqrt() {
        let zeta = (b - a) / (2.0 * c);
        let tangent = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
        let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
        Some((cosine, cosine * tangent))
    } else {
        None
    }
}

fn inner<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|i| a[i] * b[i]).sum()
}

fn rotate<const D: usize>(columns: &mut [[f64; D]; D], p: usize, q: usize, cosine: f64, sine: f64) {
    for i in 0..D {
        let (x, y) = (columns[p][i], columns[q][i]);
        columns[p][i] = cosine * x - sine * y;
        columns[q][i] = sine * x + cosine * y;
    }
}

#[cfg(test)]
mod tests {
    use super::singular;

    /// Columns of known lengths turned by a known rotation: sizes to rounding, a small one to its own precision.
    #[test]
    fn singular_values_come_to_their_own_precision() {
        let (c, s) = (0.8, 0.6);
        let (sizes, vectors) = singular([
            [3.0 * c, -2e-9 * s, 0.0],
            [3.0 * s, 2e-9 * c, 0.0],
            [0.0, 0.0, 1.0],
        ]);
        for (found, expected) in sizes.iter().zip([3.0, 1.0, 2e-9]) {
            assert!((found / expected - 1.0f64).abs() < 1e-15 * 100.0, "{found}");
        }
        assert!((vectors[0][0].abs() - c).abs() < 1e-15 && (vectors[0][1].abs() - s).abs() < 1e-15);
    }
}
