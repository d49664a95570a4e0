//! The prior on warps: a Gaussian process, kept as a low-rank factor.
//!
//! A displacement field is a priori an affine field plus a smooth one,
//! `cov(u(x), u(x')) = τ² exp(−|x − x'|²/2ℓ²) + τₐ² (1 + x·x')` for each axis. Smooth kernels have few modes: the pivoted
//! Cholesky factor `K ≈ L Lᵀ` reaches the wanted accuracy with 20 to 40 columns whatever the number of points, so that a
//! weighted fit costs `O(I r²)`.

use crate::simd::vectorised;

/// Scales of the prior, in radii of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PriorScales {
    /// Length ℓ over which the warp bends.
    pub(crate) length: f64,
    /// Standard deviation τ of the bending displacement.
    pub(crate) bending: f64,
    /// Standard deviation τₐ of the affine part's entries.
    pub(crate) affine: f64,
}

/// Largest number of columns kept.
const MAX_RANK: usize = 64;
/// Variance left out, relative to the largest.
const TOLERANCE: f64 = 1e-6;

/// Variance left out that the noise hides, relative to the noise's.
const UNSEEN: f64 = 0.01;

/// Columns are padded with zeros to a multiple of this, so that they are whole vectors.
pub(crate) const LANES: usize = 8;

/// The factor `L` of the prior covariance at the model points, column by column.
#[derive(Clone, Debug, Default)]
pub(crate) struct Prior {
    /// Length of a column: the number of points, padded.
    pub(crate) stride: usize,
    pub(crate) columns: Vec<f64>,
    /// Largest variance left out before every column.
    left: Vec<f64>,
    pivots: Vec<usize>,
    diagonal: Vec<f64>,
    /// What it was built for: the same again costs nothing.
    points: Vec<f64>,
    scales: PriorScales,
}

impl Prior {
    /// Factors the covariance at `points` (in the frame's units): `O(I r²)`.
    pub(crate) fn build<const D: usize>(&mut self, points: &[[f64; D]], scales: PriorScales) {
        let n = points.len();
        if self.scales == scales && self.points == points.as_flattened() {
            return;
        }
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
        self.columns.reserve(MAX_RANK.min(n) * self.stride);
        self.pivots.clear();
        self.left.clear();
        let floor = TOLERANCE * self.diagonal.iter().fold(0.0_f64, |m, &d| m.max(d));
        while self.pivots.len() < MAX_RANK.min(n) {
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

    /// Columns that matter beside noise of variance `noise`.
    pub(crate) fn rank_beside(&self, noise: f64) -> usize {
        self.left.partition_point(|&left| left > UNSEEN * noise)
    }

    /// Column `p` of the factor.
    pub(crate) fn column(&self, p: usize) -> &[f64] {
        &self.columns[p * self.stride..(p + 1) * self.stride]
    }
}

/// Index of the first largest value.
fn largest(values: &[f64]) -> usize {
    (1..values.len()).fold(0, |best, i| if values[i] > values[best] { i } else { best })
}
