//! The affine functions at the points, as an orthonormal basis.

use crate::{
    lanes::dot,
    span::{Coefficients, MAX},
};

/// The affine functions at n points: P = QR with orthonormal Q.
#[derive(Clone, Debug, Default)]
pub(super) struct AffineBasis {
    pub(super) n: usize,
    /// Number of affine functions.
    pub(super) q: usize,
    /// Q by columns, padded with zero columns to four, so that loops over them have a fixed length.
    pub(super) columns: Vec<f64>,
    pub(super) r: [[f64; MAX]; MAX],
}

impl AffineBasis {
    /// Orthonormalises the q columns of length n that `fill` writes, by Gram–Schmidt.
    ///
    /// Two passes give orthogonality to rounding. Rows keep their own relative precision, which
    /// very different weights require.
    pub(super) fn factor(&mut self, n: usize, q: usize, fill: impl Fn(usize, &mut [f64])) {
        (self.n, self.q) = (n, q);
        self.columns.clear();
        self.columns.resize(n * MAX, 0.0);
        self.r = [[0.0; MAX]; MAX];
        for k in 0..q {
            let (done, rest) = self.columns.split_at_mut(k * n);
            let column = &mut rest[..n];
            fill(k, column);
            for _ in 0..2 {
                for (i, earlier) in done.chunks_exact(n).enumerate() {
                    // Modified Gram–Schmidt: each projection is taken from the remainder, not from
                    // the original column.
                    let share = dot(earlier, column);
                    self.r[i][k] += share;
                    subtract(share, earlier, column);
                }
            }
            let norm = dot(column, column).sqrt();
            self.r[k][k] = norm;
            column.iter_mut().for_each(|x| *x /= norm);
        }
    }

    pub(super) fn column(&self, k: usize) -> &[f64] {
        &self.columns[k * self.n..(k + 1) * self.n]
    }

    /// b ← Πb. Returns Qᵀb.
    pub(super) fn remove(&self, b: &mut [f64]) -> Coefficients {
        let mut heads = [0.0; MAX];
        for k in 0..self.q {
            heads[k] = dot(self.column(k), b);
        }
        for k in 0..self.q {
            subtract(heads[k], self.column(k), b);
        }
        heads
    }

    /// Solves R a = c.
    pub(super) fn coefficients(&self, c: &Coefficients) -> Coefficients {
        let mut a = [0.0; MAX];
        for i in (0..self.q).rev() {
            let rest: f64 = (i + 1..self.q).map(|j| self.r[i][j] * a[j]).sum();
            a[i] = (c[i] - rest) / self.r[i][i];
        }
        a
    }
}

/// b ← b − factor · a.
pub(super) fn subtract(factor: f64, a: &[f64], b: &mut [f64]) {
    b.iter_mut().zip(a).for_each(|(b, a)| *b -= factor * a);
}
