//! The affine functions at the centres, and the orthogonal complement the kernel is definite on.
//!
//! P = [1 X] (rows scaled by √weight) is factored P Π = Q [R; 0] by Householder reflectors with column pivoting. With
//! Q = [Q₁ Q₂] the side condition Pᵀw = 0 reads w = Q₂z, and Q₂ᵀKQ₂ is positive definite. Q is kept in the
//! compact form I − V T Vᵀ (Schreiber & Van Loan 1989), so that one pass over K projects it.
//!
//! Columns are laid out so that the complement starts on a vector: row i of n stands at place HEAD − q + i, and the
//! places around the n rows are zero.

use crate::{
    layout::HEAD,
    symmetric::{Columns, Reflect, Update},
};

/// At most D + 1 columns.
pub(crate) const MAX: usize = 4;

/// Householder factorisation of the n × q matrix of affine functions.
#[derive(Clone, Debug, Default)]
pub(crate) struct NullSpace {
    /// Number of centres.
    pub(crate) n: usize,
    /// Number of affine functions, the rank of [1 X].
    pub(crate) q: usize,
    /// Places of a column.
    pub(crate) stride: usize,
    /// Reflectors, column by column; zero beyond the q-th.
    v: Vec<f64>,
    /// Upper triangle of the compact form.
    t: [[f64; MAX]; MAX],
    /// `r[i][j]`, upper triangle in pivoted order.
    r: [[f64; MAX]; MAX],
    /// Original column of each pivoted one.
    order: [usize; MAX],
}

impl NullSpace {
    /// Factors the q columns of length n, n ≥ q, that `fill` writes one by one.
    pub(crate) fn factor(
        &mut self,
        n: usize,
        q: usize,
        stride: usize,
        fill: impl Fn(usize, &mut [f64]),
    ) {
        (self.n, self.q, self.stride) = (n, q, stride);
        self.v.clear();
        self.v.resize(stride * MAX, 0.0);
        let rows = self.rows();
        for (c, column) in self.v.chunks_exact_mut(stride).enumerate().take(q) {
            fill(c, &mut column[rows.clone()]);
        }
        self.order = core::array::from_fn(|k| k);
        let mut tau = [0.0; MAX];
        for k in 0..q {
            self.pivot(k);
            tau[k] = self.reflect(k);
        }
        self.compact(&tau);
    }

    /// The places of the n rows.
    pub(crate) fn rows(&self) -> core::ops::Range<usize> {
        HEAD - self.q..HEAD - self.q + self.n
    }

    /// Entry of the triangle R Πᵀ, columns in their original order.
    pub(crate) fn triangle(&self, row: usize, column: usize) -> f64 {
        let place = self.order[..self.q].iter().position(|&c| c == column);
        place
            .filter(|&place| place >= row)
            .map_or(0.0, |place| self.r[row][place])
    }

    /// The reflectors, padded to `MAX` columns.
    pub(crate) fn reflectors(&self) -> Columns<'_, MAX> {
        Columns {
            data: &self.v,
            stride: self.stride,
        }
    }

    fn column(&self, k: usize) -> &[f64] {
        &self.v[k * self.stride..(k + 1) * self.stride]
    }

    /// Brings the column of largest remaining norm to place `k`.
    fn pivot(&mut self, k: usize) {
        let head = self.rows().start + k;
        let norm = |j: usize| dot(&self.column(j)[head..], &self.column(j)[head..]);
        let best = (k..self.q)
            .fold((k, -1.0), |best, j| {
                if norm(j) > best.1 { (j, norm(j)) } else { best }
            })
            .0;
        if best != k {
            let (left, right) = self.v.split_at_mut(best * self.stride);
            left[k * self.stride..(k + 1) * self.stride].swap_with_slice(&mut right[..self.stride]);
            self.order.swap(k, best);
            for row in &mut self.r[..k] {
                row.swap(k, best);
            }
        }
    }

    /// Makes column `k` a reflector with unit head, applies it to the later columns and returns its factor.
    fn reflect(&mut self, k: usize) -> f64 {
        let (stride, head, later) = (self.stride, self.rows().start + k, self.q - k - 1);
        let (left, right) = self.v.split_at_mut((k + 1) * stride);
        let column = &mut left[k * stride..];
        let norm = dot(&column[head..], &column[head..]).sqrt();
        let top = column[head];
        let beta = if top > 0.0 { -norm } else { norm };
        self.r[k][k] = beta;
        if norm == 0.0 {
            column.fill(0.0);
            return 0.0;
        }
        column[..head].fill(0.0);
        column[head] = 1.0;
        column[head + 1..].iter_mut().for_each(|x| *x /= top - beta);
        let tau = (beta - top) / beta;
        for (j, other) in right.chunks_exact_mut(stride).take(later).enumerate() {
            let dot = tau * dot(&column[head..], &other[head..]);
            other[head..]
                .iter_mut()
                .zip(&column[head..])
                .for_each(|(o, v)| *o -= dot * v);
            self.r[k][k + 1 + j] = other[head];
        }
        tau
    }

    fn compact(&mut self, tau: &[f64; MAX]) {
        let mut t = [[0.0; MAX]; MAX];
        for k in 0..self.q {
            t[k][k] = tau[k];
            let mut z = [0.0; MAX];
            for (i, z) in z.iter_mut().enumerate().take(k) {
                *z = dot(self.column(i), self.column(k));
            }
            for i in 0..k {
                t[i][k] = -tau[k] * (i..k).map(|j| t[i][j] * z[j]).sum::<f64>();
            }
        }
        self.t = t;
    }

    /// b ← Qᵀb for one column.
    pub(crate) fn apply_transpose(&self, b: &mut [f64]) {
        self.apply_compact(b, true);
    }

    /// b ← Qb for one column.
    pub(crate) fn apply(&self, b: &mut [f64]) {
        self.apply_compact(b, false);
    }

    fn apply_compact(&self, b: &mut [f64], transpose: bool) {
        let t = |i: usize, j: usize| {
            if transpose {
                self.t[j][i]
            } else {
                self.t[i][j]
            }
        };
        let t = core::array::from_fn(|i| core::array::from_fn(|j| t(i, j)));
        Reflect {
            v: self.reflectors(),
            t,
            b,
        }
        .apply();
    }

    /// Turns the lower triangle of K into that of QᵀKQ, given Y = K V for the reflectors V in `x`; returns the
    /// Frobenius norm of the part below and right of the first q rows.
    ///
    /// With Y = KVT and X = Y − ½ V(TᵀVᵀY): QᵀKQ = K − VXᵀ − XVᵀ.
    pub(crate) fn project(&self, k: &mut [f64], x: &mut [f64]) -> f64 {
        let (q, stride) = (self.q, self.stride);
        self.times_compact(x);
        let mut s = [[0.0; MAX]; MAX];
        for (c, y) in x.chunks_exact(stride).enumerate() {
            let z: [f64; MAX] = core::array::from_fn(|i| dot(self.column(i), y));
            for i in 0..q {
                s[i][c] = 0.5 * (0..q).map(|l| self.t[l][i] * z[l]).sum::<f64>();
            }
        }
        for (c, y) in x.chunks_exact_mut(stride).enumerate() {
            for i in 0..q {
                y.iter_mut()
                    .zip(self.column(i))
                    .for_each(|(y, v)| *y -= s[i][c] * v);
            }
        }
        let mut squares = 0.0;
        for j in self.rows() {
            let column = &mut k[j * stride..(j + 1) * stride];
            let below = Update {
                column,
                j,
                v: self.reflectors(),
                x: Columns { data: x, stride },
            }
            .subtract();
            if j >= HEAD {
                squares += 2.0 * below + k[j * stride + j].powi(2);
            }
        }
        squares.sqrt()
    }

    /// x ← x T for the columns x.
    fn times_compact(&self, x: &mut [f64]) {
        let stride = self.stride;
        for i in 0..stride {
            let row: [f64; MAX] = core::array::from_fn(|c| x[c * stride + i]);
            for c in 0..MAX {
                x[c * stride + i] = (0..=c).map(|l| row[l] * self.t[l][c]).sum();
            }
        }
    }

    /// Solves R Πᵀ a = b: the coefficients of the columns in their original order.
    pub(crate) fn solve_upper(&self, b: &[f64]) -> [f64; MAX] {
        let mut pivoted = [0.0; MAX];
        for i in (0..self.q).rev() {
            let rest: f64 = (i + 1..self.q).map(|j| self.r[i][j] * pivoted[j]).sum();
            pivoted[i] = (b[i] - rest) / self.r[i][i];
        }
        let mut a = [0.0; MAX];
        (0..self.q).for_each(|i| a[self.order[i]] = pivoted[i]);
        a
    }

    /// Solves (R Πᵀ)ᵀ h = p: what the side conditions Pᵀw = p leave of w = Q₁h + Q₂z.
    pub(crate) fn solve_transpose(&self, p: &[f64; MAX]) -> [f64; MAX] {
        let mut h = [0.0; MAX];
        for i in 0..self.q {
            let rest: f64 = (0..i).map(|j| self.r[j][i] * h[j]).sum();
            h[i] = (p[self.order[i]] - rest) / self.r[i][i];
        }
        h
    }
}

/// a / b, zero where b is zero or not finite: to conjugate gradients an output that has converged or not begun.
pub(crate) fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 && b.is_finite() { a / b } else { 0.0 }
}

/// Inner product in eight partial sums, which the compiler turns into vectors.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (lanes, others) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = lanes
        .remainder()
        .iter()
        .zip(others.remainder())
        .map(|(a, b)| a * b)
        .sum();
    for (a, b) in lanes.zip(others) {
        for l in 0..8 {
            sums[l] += a[l] * b[l];
        }
    }
    sums.iter().sum::<f64>() + tail
}
