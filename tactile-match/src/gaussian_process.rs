//! A Gaussian process prior on displacements as a low-rank factor, and regression under this prior.

use crate::kernels::{LANES, Stripe, TOGETHER, cholesky, combine, normal_equations, solve, whiten};
use tactile_core::vectorised;

// The prior on warps is a Gaussian process, stored as a low-rank factor.
//
// A displacement field is a priori an affine field plus a smooth one,
// `cov(u(x), u(x')) = τ² exp(−|x − x'|²/2ℓ²) + τₐ² (1 + x·x')` for each axis. Smooth kernels have
// few modes: the pivoted Cholesky factor `K ≈ L Lᵀ` reaches the required accuracy with 20 to 40
// columns for any number of points, so that a weighted fit costs `O(I r²)`.

/// Scales of the prior, in root mean square radii of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PriorScales {
    /// Correlation length ℓ of the bending.
    pub length: f64,
    /// Standard deviation τ of the bending displacement.
    pub bending: f64,
    /// Standard deviation τₐ of the entries of the affine part.
    pub affine: f64,
}

/// Maximum number of columns kept.
const MAX_RANK: usize = 64;

/// Variance neglected by the factor for sets of up to [`DENSE`] points, relative to the largest
/// variance: the deviation is a thousandth of a radius.
const LEFT_OUT: f64 = 1e-6;
/// Sets above this number of points need more accuracy: a sixtieth of their spacing.
const DENSE: f64 = 1700.0;
/// Neglected variance that the noise hides, relative to the variance of the noise.
const HIDDEN: f64 = 0.01;

/// The factor `L` of the prior covariance at the model points, column by column.
#[derive(Clone, Debug, Default)]
pub(crate) struct Prior {
    /// Length of a column: the number of points plus padding.
    pub stride: usize,
    columns: Vec<f64>,
    /// Largest remaining variance before each column.
    left: Vec<f64>,
    pub pivots: Vec<usize>,
    diagonal: Vec<f64>,
    /// Points of the last factorisation: a repeated call with them costs nothing.
    points: Vec<f64>,
    scales: PriorScales,
    detail: Detail,
}

/// Accuracy of the factor of a covariance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Detail {
    /// Maximum number of columns kept.
    pub rank: usize,
    /// Neglected variance, relative to the largest.
    pub left_out: f64,
    /// A fit omits the columns whose variance is below this fraction of the noise variance.
    pub hidden: f64,
}

impl Prior {
    /// Factors the covariance at `points` (in the units of the frame), to an accuracy that depends
    /// on the spacing of the points: `O(I r²)`.
    pub(crate) fn build<const D: usize>(&mut self, points: &[[f64; D]], scales: PriorScales) {
        let denser = (DENSE / points.len() as f64).powf(2.0 / D as f64).min(1.0);
        let detail = Detail {
            rank: MAX_RANK,
            left_out: LEFT_OUT * denser,
            hidden: HIDDEN,
        };
        self.factor(points, scales, detail);
    }

    /// Factors the covariance at `points`: `O(I r²)`.
    pub(crate) fn factor<const D: usize>(
        &mut self,
        points: &[[f64; D]],
        scales: PriorScales,
        detail: Detail,
    ) {
        let n = points.len();
        let same = (self.scales, self.detail) == (scales, detail);
        if same && self.points == points.as_flattened() {
            return;
        }
        self.detail = detail;
        self.scales = scales;
        self.points.clear();
        self.points.extend_from_slice(points.as_flattened());
        let gaussian = -0.5 / scales.length.powi(2);
        let (bending, affine) = (scales.bending.powi(2), scales.affine.powi(2));
        let covariance = |a: &[f64; D], b: &[f64; D]| {
            let (mut square, mut dot) = (0.0, 1.0);
            for k in 0..D {
                square += (a[k] - b[k]).powi(2);
                dot += a[k] * b[k];
            }
            bending * (gaussian * square).exp() + affine * dot
        };
        self.diagonal.clear();
        self.diagonal
            .extend(points.iter().map(|p| covariance(p, p)));
        self.columns.clear();
        self.stride = n.next_multiple_of(LANES);
        self.columns.reserve(detail.rank.min(n) * self.stride);
        self.pivots.clear();
        self.left.clear();
        let floor = detail.left_out * self.diagonal.iter().fold(0.0_f64, |m, &d| m.max(d));
        while self.pivots.len() < detail.rank.min(n) {
            let pivot = largest(&self.diagonal);
            if self.diagonal[pivot] <= floor {
                break;
            }
            self.left.push(self.diagonal[pivot]);
            self.append_column(points, pivot, &covariance);
        }
    }

    fn append_column<const D: usize>(
        &mut self,
        points: &[[f64; D]],
        pivot: usize,
        covariance: &impl Fn(&[f64; D], &[f64; D]) -> f64,
    ) {
        let root = self.diagonal[pivot].sqrt();
        let start = self.columns.len();
        self.columns
            .extend(points.iter().map(|p| covariance(p, &points[pivot])));
        self.columns.resize(start + self.stride, 0.0);
        let (earlier, new) = self.columns.split_at_mut(start);
        let diagonal = &mut self.diagonal;
        let stride = self.stride;
        vectorised(
            #[inline(always)]
            || {
                for column in earlier.chunks_exact(stride) {
                    let f = column[pivot];
                    for (v, c) in new.iter_mut().zip(column) {
                        *v -= f * c;
                    }
                }
                for (value, left) in new.iter_mut().zip(diagonal.iter_mut()) {
                    *value /= root;
                    *left = (*left - *value * *value).max(0.0);
                }
            },
        );
        self.diagonal[pivot] = 0.0;
        self.pivots.push(pivot);
    }

    /// Number of columns that matter for noise of variance `noise`.
    pub(crate) fn rank_beside(&self, noise: f64) -> usize {
        self.left
            .partition_point(|&left| left > self.detail.hidden * noise)
    }

    /// Column `p` of the factor.
    pub(crate) fn column(&self, p: usize) -> &[f64] {
        &self.columns[p * self.stride..(p + 1) * self.stride]
    }
}

/// Index of the largest value, the first among equals.
fn largest(values: &[f64]) -> usize {
    (1..values.len()).fold(0, |best, i| if values[i] > values[best] { i } else { best })
}

// Coordinates, stored as one padded array per axis.

/// One array per axis.
#[derive(Clone, Debug)]
pub(crate) struct Axes<const D: usize>(pub(crate) [Vec<f64>; D]);

impl<const D: usize> Default for Axes<D> {
    fn default() -> Self {
        Self(std::array::from_fn(|_| Vec::new()))
    }
}

impl<const D: usize> Axes<D> {
    /// Stores `rows`, padded to `stride`.
    pub(crate) fn fill(&mut self, stride: usize, rows: impl Iterator<Item = [f64; D]>) {
        self.0.iter_mut().for_each(Vec::clear);
        for row in rows {
            self.0
                .iter_mut()
                .zip(row)
                .for_each(|(axis, value)| axis.push(value));
        }
        self.0.iter_mut().for_each(|axis| axis.resize(stride, 0.0));
    }
}

// Weighted regression under the prior.
//
// With targets `zᵢ`, weights `wᵢ` and noise variance σ², the displacement is `u = L c`,
// `(Lᵀ W L + σ² 1) c = Lᵀ W z`, and its variance at point i is `vᵢ = σ² Lᵢ (Lᵀ W L + σ² 1)⁻¹ Lᵢᵀ`.
// The leave-one-out prediction of point i needs no second fit: with the leverage `hᵢ = wᵢ vᵢ/σ²` it
// is `(uᵢ − hᵢ zᵢ)/(1 − hᵢ)`.

/// Target displacements of the model points and their weights, both padded with zeros.
#[derive(Clone, Copy)]
pub(crate) struct Request<'a, const D: usize> {
    pub weights: &'a [f64],
    pub displacements: &'a Axes<D>,
}

/// Working memory and result of a regression.
#[derive(Clone, Debug, Default)]
pub(crate) struct Regression<const D: usize> {
    gram: Vec<f64>,
    pub solution: Vec<[f64; D]>,
    weighted: Vec<f64>,
    /// Whitened columns, ordered by stripe of rows, then by column.
    whitened: Vec<Stripe>,
    /// `ln det(1 + LᵀWL/σ²)`.
    pub log_det: f64,
    /// Displacements, one array per axis, padded like the columns of the prior.
    pub displacement: Axes<D>,
    /// Variances of the displacements along one axis, set by [`variances`](Self::variances).
    pub variance: Vec<f64>,
    noise: f64,
    rank: usize,
}

impl<const D: usize> Regression<D> {
    /// Fits `targets` (displacements, one array per axis) with `weights`, both padded with zeros,
    /// at the noise variance `noise`. Modes hidden by the noise are omitted. `O(I r² + r³)`.
    pub(crate) fn fit(&mut self, prior: &Prior, weights: &[f64], targets: &Axes<D>, noise: f64) {
        let r = prior.rank_beside(noise);
        (self.rank, self.noise) = (r, noise);
        self.gram.resize(r * r, 0.0);
        self.weighted.resize(prior.stride, 0.0);
        let column = |p: usize| prior.column(p);
        vectorised(
            #[inline(always)]
            || {
                normal_equations(
                    column,
                    r,
                    weights,
                    &targets.0,
                    &mut self.weighted,
                    &mut self.gram,
                    &mut self.solution,
                );
                for p in 0..r {
                    self.gram[p * r + p] += noise;
                }
                cholesky(&mut self.gram, r);
                solve(&self.gram, r, &mut self.solution);
                combine(
                    column,
                    &self.solution,
                    &mut self.displacement.0,
                    prior.stride,
                );
            },
        );
        self.log_det = (0..r)
            .map(|p| 2.0 * self.gram[p * r + p].ln() - noise.ln())
            .sum();
    }

    /// Sets displacement and variance of each padded row, for fits without penalty or determinant.
    pub(crate) fn set(&mut self, padded: usize, row: impl Fn(usize) -> ([f64; D], f64)) {
        self.solution.clear();
        self.whitened.clear();
        self.log_det = 0.0;
        self.variance.clear();
        self.displacement.0.iter_mut().for_each(Vec::clear);
        for i in 0..padded {
            let (displacement, variance) = row(i);
            self.variance.push(variance);
            for (axis, value) in self.displacement.0.iter_mut().zip(displacement) {
                axis.push(value);
            }
        }
    }

    /// Computes the variances of the last fit: `O(I r²)`. If `with_covariances`, keeps what
    /// [`covariance`](Self::covariance) needs.
    pub(crate) fn variances(&mut self, prior: &Prior, with_covariances: bool) {
        let (r, stride, noise) = (self.rank, prior.stride, self.noise);
        let blocks = stride / LANES;
        let stripes = blocks.div_ceil(TOGETHER);
        let kept = if with_covariances { stripes } else { 1 };
        self.variance.clear();
        self.variance.resize(stride, 0.0);
        self.whitened.resize(kept * r, Stripe::default());
        let Self {
            gram,
            whitened,
            variance,
            ..
        } = self;
        let columns = &prior.columns.as_chunks::<LANES>().0[..r * blocks];
        vectorised(
            #[inline(always)]
            || {
                for (s, sums) in variance.chunks_mut(TOGETHER * LANES).enumerate() {
                    let place = if with_covariances { s * r } else { 0 };
                    let stripe = &mut whitened[place..place + r];
                    whiten(columns, blocks, gram, r, stripe, s * TOGETHER);
                    for column in stripe {
                        for (v, sum) in column.as_flattened().iter().zip(&mut *sums) {
                            *sum += v * v * noise;
                        }
                    }
                }
            },
        );
    }

    /// Covariance of the displacements of two points along one axis: `O(r)`. Requires a call of
    /// [`variances`](Self::variances) with covariances. Rigid fits have no such covariance.
    pub(crate) fn covariance(&self, a: usize, b: usize) -> f64 {
        let rows = |i: usize| {
            let first = i / (TOGETHER * LANES) * self.rank;
            let stripe = self.whitened.iter().skip(first).take(self.rank);
            stripe.map(move |column| column.as_flattened()[i % (TOGETHER * LANES)])
        };
        self.noise * rows(a).zip(rows(b)).map(|(a, b)| a * b).sum::<f64>()
    }

    /// `Σ |c|²`, twice the prior energy of the warp.
    pub(crate) fn penalty(&self) -> f64 {
        self.solution.iter().flatten().map(|c| c * c).sum()
    }
}

#[cfg(test)]
mod tests;
