//! The Gaussian kernel `G` of the non-rigid motion, as a product `L Lᵀ` of low rank.
//!
//! `G_mk = exp(−|y_m − y_k|² / 2β²)` of smooth motion (β about the size of the set) has few eigenvalues above rounding, so that a
//! pivoted Cholesky factor `L` of `r ≪ M` columns holds all of it that double precision can use. With it one M-step costs `O(M r²)`
//! instead of `O(M³)`, and needs no difference of large terms.

use super::exp::exp_of_negative;
use super::expectation::Columns;
use crate::simd::{Loop, vectorised};

/// `G ≈ L Lᵀ`, and what evaluates the motion at other points.
#[derive(Clone, Debug, Default)]
pub(super) struct KernelFactor {
    /// `L`, column after column of `M` entries.
    columns: Vec<f64>,
    /// `L`, row after row of `r` entries.
    rows: Vec<f64>,
    /// The model points the columns stem from.
    pub(super) pivots: Vec<usize>,
    /// What is left of the diagonal of `G − L Lᵀ`.
    residual: Vec<f64>,
    len: usize,
}

impl KernelFactor {
    /// Rank of the factor.
    #[inline(always)]
    pub(super) fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// Column `k` of `L`.
    #[inline(always)]
    pub(super) fn column(&self, k: usize) -> &[f64] {
        &self.columns[k * self.len..][..self.len]
    }

    /// Row `m` of `L`.
    #[inline(always)]
    pub(super) fn row(&self, m: usize) -> &[f64] {
        &self.rows[m * self.rank()..][..self.rank()]
    }

    /// Factorises the kernel of `model`: columns are added, largest remainder first, until none exceeds `tolerance` or there are
    /// `rank` of them. `O(M r²)`.
    pub(super) fn build<const D: usize>(
        &mut self,
        model: &Columns<D>,
        beta: f64,
        rank: usize,
        tolerance: f64,
    ) {
        self.len = model[0].len();
        self.columns.clear();
        self.pivots.clear();
        self.residual.clear();
        self.residual.resize(self.len, 1.0);
        while self.rank() < rank.min(self.len) {
            let (pivot, &largest) = match self
                .residual
                .iter()
                .enumerate()
                .max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0)))
            {
                Some(found) if *found.1 > tolerance => found,
                _ => break,
            };
            self.append(model, beta, pivot, largest.sqrt());
        }
        self.rows.clear();
        let (columns, len, rank) = (&self.columns, self.len, self.pivots.len());
        self.rows
            .extend((0..len).flat_map(|m| (0..rank).map(move |k| columns[k * len + m])));
    }

    fn append<const D: usize>(&mut self, model: &Columns<D>, beta: f64, pivot: usize, root: f64) {
        let done = self.columns.len();
        self.columns.resize(done + self.len, 0.0);
        let (before, column) = self.columns.split_at_mut(done);
        vectorised(NextColumn {
            before,
            column,
            model,
            beta,
            pivot,
            root,
        });
        for (rest, c) in self.residual.iter_mut().zip(column.iter()) {
            *rest -= c * c;
        }
        for &earlier in &self.pivots {
            column[earlier] = 0.0; // exactly, so that the pivots' rows are triangular
        }
        column[pivot] = root;
        self.residual[pivot] = 0.0;
        self.pivots.push(pivot);
    }

    /// Weights `w` at the pivots with `Σ_k G(x, y_k) w_k = (L z)(x)`: solves `Cᵀ w = z`, `C` the pivots' rows of `L`.
    pub(super) fn pivot_weights<const D: usize>(&self, coefficients: &[[f64; D]]) -> Vec<[f64; D]> {
        let mut weights = coefficients.to_vec();
        for k in (0..self.rank()).rev() {
            let column = self.column(k);
            let mut w = weights[k];
            for (later, weight) in weights.iter().enumerate().skip(k + 1) {
                let factor = column[self.pivots[later]];
                (0..D).for_each(|d| w[d] -= factor * weight[d]);
            }
            weights[k] = w.map(|w| w / column[self.pivots[k]]);
        }
        weights
    }
}

/// A new column of the factor: that of the kernel, less what the columns before it hold.
struct NextColumn<'a, const D: usize> {
    before: &'a [f64],
    column: &'a mut [f64],
    model: &'a Columns<D>,
    beta: f64,
    pivot: usize,
    root: f64,
}

impl<const D: usize> Loop for NextColumn<'_, D> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let len = self.column.len();
        let scale = -0.5 / (self.beta * self.beta);
        let model: [&[f64]; D] = std::array::from_fn(|d| &self.model[d][..len]);
        for m in 0..len {
            let mut squared = 0.0;
            for axis in model {
                let step = axis[self.pivot] - axis[m];
                squared += step * step;
            }
            self.column[m] = exp_of_negative(squared * scale);
        }
        for earlier in self.before.chunks_exact(len) {
            let factor = earlier[self.pivot];
            self.column
                .iter_mut()
                .zip(earlier)
                .for_each(|(c, e)| *c -= factor * e);
        }
        self.column.iter_mut().for_each(|c| *c /= self.root);
    }
}
