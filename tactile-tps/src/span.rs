//! Which directions the points span.

use nalgebra::DMatrix;

use crate::{cholesky::layout, null_space::NullSpace, real::Real, sites::Sites, twofold::Twofold};

/// The directions points extend in, decided by the singular values of their centred coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Span<const D: usize> {
    /// Number of spanned directions.
    pub(crate) directions: usize,
    /// Orthonormal directions, spanned ones first; `None` if all are, and the coordinate axes serve.
    pub(crate) basis: Option<[[f64; D]; D]>,
    /// Root mean square extent along each direction relative to the largest, falling.
    pub(crate) extents: [f64; D],
}

impl<const D: usize> Span<D> {
    /// `tolerance` is the share of the largest extent below which a direction counts as not spanned.
    pub(crate) fn new(sites: &Sites<D>, tolerance: f64) -> Self {
        let n = sites.len();
        let means: [f64; D] = core::array::from_fn(|k| sites.axes[k].iter().sum::<f64>() / n as f64);
        let mut columns = NullSpace::default();
        columns.factor(n, D.min(n), layout(n, D.min(n)), |k, column| {
            column.iter_mut().zip(&sites.axes[k]).for_each(|(v, x)| *v = x - means[k]);
        });
        if n < D {
            return Self::of_few(sites, &means, tolerance);
        }
        let triangle = DMatrix::from_fn(D, D, |i, j| columns.triangle(i, j));
        Self::of_matrix(triangle, n, sites.grain, tolerance)
    }

    /// Fewer points than dimensions: the singular vectors of the points themselves.
    fn of_few(sites: &Sites<D>, means: &[f64; D], tolerance: f64) -> Self {
        let n = sites.len();
        let rows = DMatrix::from_fn(D, D, |i, j| if i < n { sites.axes[j][i] - means[j] } else { 0.0 });
        Self::of_matrix(rows, n, sites.grain, tolerance)
    }

    fn of_matrix(matrix: DMatrix<f64>, n: usize, grain: f64, tolerance: f64) -> Self {
        let svd = matrix.svd(false, true);
        let mut sizes: Vec<(f64, usize)> = svd.singular_values.iter().copied().zip(0..).collect();
        sizes.sort_by(|a, b| b.0.total_cmp(&a.0));
        let root = (n as f64).sqrt();
        let largest = sizes[0].0;
        let noise = f64::max(8.0 * (grain + f64::EPSILON) * root, tolerance * largest);
        let directions = sizes.iter().filter(|s| s.0 > noise).count();
        let vectors = svd.v_t.unwrap_or_else(|| DMatrix::identity(D, D));
        let basis = core::array::from_fn(|k| core::array::from_fn(|i| vectors[(sizes[k].1, i)]));
        let extents = core::array::from_fn(|k| if largest > 0.0 { sizes[k].0 / largest } else { 0.0 });
        Self { directions, basis: (directions < D).then_some(basis), extents }
    }

    /// Writes affine function `c` of [1, x·b₁, …] at the sites `active`, each value times its `scale`.
    pub(crate) fn fill(
        &self,
        sites: &Sites<D>,
        active: &[usize],
        scales: &[f64],
        c: usize,
        column: &mut [f64],
    ) {
        for (value, &site) in column.iter_mut().zip(active) {
            *value = match (c, &self.basis) {
                (0, _) => 1.0,
                (c, None) => sites.axes[c - 1][site],
                (c, Some(basis)) => (0..D).map(|k| basis[c - 1][k] * sites.axes[k][site]).sum(),
            };
        }
        column.iter_mut().zip(scales).for_each(|(value, scale)| *value *= scale);
    }

    /// Σ aₖ pₖ(x) for the coordinates `x`.
    pub(crate) fn polynomial(&self, a: &[f64], x: impl Fn(usize) -> f64) -> f64 {
        let along = |c: usize| match &self.basis {
            None => x(c),
            Some(basis) => (0..D).map(|k| basis[c][k] * x(k)).sum(),
        };
        a[0] + (0..self.directions).map(|c| a[c + 1] * along(c)).sum::<f64>()
    }

    /// Affine function `c` at a point.
    pub(crate) fn precise(&self, c: usize, point: &[Twofold; D]) -> Twofold {
        match (c, &self.basis) {
            (0, _) => Twofold::from_f64(1.0),
            (c, None) => point[c - 1],
            (c, Some(basis)) => {
                (0..D).fold(Twofold::ZERO, |sum, k| sum + point[k] * Twofold::from_f64(basis[c - 1][k]))
            }
        }
    }

    /// The gradient in coordinates of one along the directions.
    pub(crate) fn gradient(&self, along: &[f64]) -> [f64; D] {
        match &self.basis {
            None => core::array::from_fn(|k| along[k]),
            Some(basis) => {
                core::array::from_fn(|k| (0..self.directions).map(|c| along[c] * basis[c][k]).sum())
            }
        }
    }
}
