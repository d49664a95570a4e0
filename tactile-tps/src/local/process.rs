//! Gaussian processes in addition to affine fields, and their likelihoods.

use super::{Matrix4, Matrix4x3, RowVector4, SVector};
use core::mem::MaybeUninit;
use faer::{
    MatMut, MatRef, Par, Spec,
    dyn_stack::{MemStack, StackReq},
    linalg::{cholesky::llt, triangular_inverse, triangular_solve},
};

// With `C = K + λ 1`, the affine functions P and the displacements Z, the restricted likelihood is
//
// `−ln p = ½ [M ln τ² + S/τ² + D (ln det C + ln det PᵀC⁻¹P)]`, `S = tr ZᵀBZ`,
// `M = D (n − rank − 1)`, `B = C⁻¹ − C⁻¹P (PᵀC⁻¹P)⁻¹ PᵀC⁻¹`.
//
// It is largest at `τ² = S/M`, or where the noise equals that of the grain of the numbers. The
// leave-one-out residual of pair i is `(BZ)ᵢ/Bᵢᵢ`, with the variance `τ²/Bᵢᵢ`.

/// Covariances by distance: none for affine fields, Gaussian for fields that are smooth over
/// several spacings, and Matérn with two derivatives or one for rougher fields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    Affine,
    Gaussian(f64),
    Matern5(f64),
    Matern3(f64),
}

impl Shape {
    /// k(r) and k'(r)/r, which is k''(0) at r = 0.
    #[inline(always)]
    pub(super) fn of(self, square: f64) -> (f64, f64) {
        match self {
            Self::Affine => (0.0, 0.0),
            Self::Gaussian(length) => {
                let s = 1.0 / (length * length);
                let value = (-0.5 * square * s).exp();
                (value, -value * s)
            }
            Self::Matern5(length) => {
                let s = 5.0 / (length * length);
                let a = (square * s).sqrt();
                let decay = (-a).exp();
                let value = (1.0 + a + a * a / 3.0) * decay;
                (value, -s / 3.0 * (1.0 + a) * decay)
            }
            Self::Matern3(length) => {
                let s = 3.0 / (length * length);
                let a = (square * s).sqrt();
                let decay = (-a).exp();
                ((1.0 + a) * decay, -s * decay)
            }
        }
    }

    /// Derivative of k'(r)/r over r, from which the covariance of gradients follows:
    /// `cov ∂ₐf(x) ∂ᵦf(y) = −δₐᵦ k'/r − dₐ dᵦ (k'/r)'/r` with `d = x − y`.
    ///
    /// For Matérn with one derivative it is infinite at r = 0, where its product with d dᵀ
    /// vanishes: the value there is zero.
    pub(super) fn bend(self, square: f64) -> f64 {
        match self {
            Self::Affine => 0.0,
            _ if square == 0.0 => 0.0,
            Self::Gaussian(length) => {
                let s = 1.0 / (length * length);
                s * s * (-0.5 * square * s).exp()
            }
            Self::Matern5(length) => {
                let s = 5.0 / (length * length);
                s * s / 3.0 * (-(square * s).sqrt()).exp()
            }
            Self::Matern3(length) => {
                let s = 3.0 / (length * length);
                let a = (square * s).sqrt();
                s * s * (-a).exp() / a
            }
        }
    }
}

/// Pairs in the form that a process uses.
#[derive(Clone, Debug)]
pub(super) struct Data<const D: usize> {
    pub(super) points: Vec<SVector<f64, D>>,
    /// Affine functions at the points.
    pub(super) bases: Vec<RowVector4<f64>>,
    pub(super) displacements: Vec<SVector<f64, D>>,
    /// Directions that the points span.
    pub(super) rank: usize,
    /// The minimum noise variance of a coordinate.
    pub(super) floor: f64,
}

impl<const D: usize> Data<D> {
    /// Degrees of freedom M.
    pub(super) fn degrees(&self) -> usize {
        D * self.points.len().saturating_sub(self.rank + 1)
    }
}

/// A process through the pairs: covariance, noise and coefficients of the mean.
#[derive(Clone, Debug)]
pub(super) struct Process<const D: usize> {
    pub(super) shape: Shape,
    pub(super) lambda: f64,
    /// Negative logarithm of the restricted likelihood.
    pub(super) energy: f64,
    /// τ².
    pub(super) scale: f64,
    /// BZ.
    pub(super) weights: Vec<SVector<f64, D>>,
    pub(super) affine: Matrix4x3<f64>,
}

impl<const D: usize> Default for Process<D> {
    fn default() -> Self {
        Self {
            shape: Shape::Affine,
            lambda: 1.0,
            energy: f64::INFINITY,
            scale: 0.0,
            weights: Vec::new(),
            affine: Matrix4x3::zeros(),
        }
    }
}

/// The factor of a process, with reusable memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Factor {
    n: usize,
    /// K, as lower triangle by columns.
    kernel: Vec<f64>,
    /// L of `C = LLᵀ`.
    lower: Vec<f64>,
    inverse: Vec<f64>,
    /// L⁻¹[P Z], by columns.
    white: Vec<f64>,
    /// (PᵀC⁻¹P)⁻¹.
    normal: Matrix4<f64>,
    stack: Vec<MaybeUninit<u8>>,
}

/// Working memory for a step of a factorisation.
fn memory(kept: &mut Vec<MaybeUninit<u8>>, size: StackReq) -> &mut MemStack {
    let bytes = size.unaligned_bytes_required();
    if kept.len() < bytes {
        kept.resize(bytes, MaybeUninit::uninit());
    }
    MemStack::new(kept)
}

impl Factor {
    fn matrix<'a>(&self, data: &'a [f64]) -> MatRef<'a, f64> {
        MatRef::from_column_major_slice(data, self.n, self.n)
    }

    /// Computes the covariances of a shape.
    pub(super) fn cover<const D: usize>(&mut self, points: &[SVector<f64, D>], shape: Shape) {
        let n = points.len();
        self.n = n;
        self.kernel.resize(n * n, 0.0);
        for (j, column) in self.kernel.chunks_exact_mut(n.max(1)).enumerate() {
            for (value, point) in column[j..].iter_mut().zip(&points[j..]) {
                *value = shape.of((point - points[j]).norm_squared()).0;
            }
        }
    }

    /// Computes scale, energy and affine part of the process with the stored covariances. Leaves
    /// its factor.
    pub(super) fn weigh<const D: usize>(&mut self, data: &Data<D>, process: &mut Process<D>) {
        let n = self.n;
        process.energy = f64::INFINITY;
        self.lower.clone_from(&self.kernel);
        (0..n).for_each(|i| self.lower[i * n + i] += process.lambda);
        let size = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Spec::default());
        let factored = llt::factor::cholesky_in_place(
            MatMut::from_column_major_slice_mut(&mut self.lower, n, n),
            Default::default(),
            Par::Seq,
            memory(&mut self.stack, size),
            Spec::default(),
        );
        if factored.is_err() {
            return;
        }
        let terms = data.rank + 1;
        self.white.clear();
        for c in 0..terms {
            self.white.extend(data.bases.iter().map(|basis| basis[c]));
        }
        for d in 0..D {
            self.white.extend(data.displacements.iter().map(|z| z[d]));
        }
        triangular_solve::solve_lower_triangular_in_place(
            MatRef::from_column_major_slice(&self.lower, n, n),
            MatMut::from_column_major_slice_mut(&mut self.white, n, terms + D),
            Par::Seq,
        );
        let column = |c: usize| &self.white[c * n..(c + 1) * n];
        let dot = |a: usize, b: usize| -> f64 {
            column(a).iter().zip(column(b)).map(|(a, b)| a * b).sum()
        };
        let (mut normal, mut moments, mut squares) = (Matrix4::identity(), Matrix4x3::zeros(), 0.0);
        for a in 0..terms {
            for b in 0..=a {
                normal[(a, b)] = dot(a, b);
                normal[(b, a)] = normal[(a, b)];
            }
            (0..D).for_each(|d| moments[(a, d)] = dot(a, terms + d));
        }
        (0..D).for_each(|d| squares += dot(terms + d, terms + d));
        let Some(root) = normal.cholesky() else {
            return;
        };
        self.normal = root.inverse();
        // Directions that are not spanned are not used.
        for a in terms..4 {
            self.normal[(a, a)] = 0.0;
        }
        process.affine = self.normal * moments;
        let rest = (squares - moments.dot(&process.affine)).max(0.0);
        let degrees = data.degrees() as f64;
        process.scale = (rest / degrees.max(1.0)).max(data.floor / process.lambda);
        let log_det: f64 = (0..n).map(|i| self.lower[i * n + i].ln()).sum();
        let log_normal: f64 = (0..4).map(|i| root.l_dirty()[(i, i)].ln()).sum();
        process.energy = 0.5 * (degrees * process.scale.ln() + rest / process.scale)
            + D as f64 * (log_det + log_normal);
    }

    /// BZ of the process evaluated last.
    pub(super) fn solve<const D: usize>(&mut self, data: &Data<D>, process: &mut Process<D>) {
        let (n, terms) = (self.n, data.rank + 1);
        let (bases, rest) = self.white.split_at_mut(terms * n);
        for d in 0..D {
            let column = &mut rest[d * n..(d + 1) * n];
            for c in 0..terms {
                let factor = process.affine[(c, d)];
                let basis = &bases[c * n..(c + 1) * n];
                column
                    .iter_mut()
                    .zip(basis)
                    .for_each(|(z, p)| *z -= factor * p);
            }
        }
        triangular_solve::solve_upper_triangular_in_place(
            MatRef::from_column_major_slice(&self.lower, n, n).transpose(),
            MatMut::from_column_major_slice_mut(rest, n, D),
            Par::Seq,
        );
        process.weights.clear();
        let weight = |i: usize| SVector::from_fn(|d, _| rest[d * n + i]);
        process.weights.extend((0..n).map(weight));
    }

    /// Multiplies columns by L⁻¹.
    pub(super) fn whiten(&self, columns: &mut [f64]) {
        let count = columns.len() / self.n.max(1);
        triangular_solve::solve_lower_triangular_in_place(
            self.matrix(&self.lower),
            MatMut::from_column_major_slice_mut(columns, self.n, count),
            Par::Seq,
        );
    }

    /// Part of the affine functions `basis` that the pairs do not explain. `column` must be
    /// whitened.
    pub(super) fn unexplained(
        &self,
        basis: RowVector4<f64>,
        column: &[f64],
        rank: usize,
    ) -> RowVector4<f64> {
        let mut basis = basis;
        for (c, white) in self.white.chunks_exact(self.n).take(rank + 1).enumerate() {
            basis[c] -= white.iter().zip(column).map(|(a, b)| a * b).sum::<f64>();
        }
        basis
    }

    /// The covariance contributed by the coefficients of the affine functions.
    pub(super) fn of_affine(&self, a: &RowVector4<f64>, b: &RowVector4<f64>) -> f64 {
        (a * self.normal * b.transpose())[0]
    }

    /// Bᵢᵢ of all pairs.
    pub(super) fn precisions(&mut self, rank: usize, found: &mut Vec<f64>) {
        let n = self.n;
        self.inverse.clear();
        self.inverse.resize(n * n, 0.0);
        triangular_inverse::invert_lower_triangular(
            MatMut::from_column_major_slice_mut(&mut self.inverse, n, n),
            MatRef::from_column_major_slice(&self.lower, n, n),
            Par::Seq,
        );
        found.clear();
        for (i, column) in self.inverse.chunks_exact(n.max(1)).enumerate() {
            let column = &column[i..];
            let square: f64 = column.iter().map(|c| c * c).sum();
            let mut basis = RowVector4::zeros();
            for (c, white) in self.white.chunks_exact(n).take(rank + 1).enumerate() {
                basis[c] = white[i..]
                    .iter()
                    .zip(column)
                    .map(|(a, b)| a * b)
                    .sum::<f64>();
            }
            found.push((square - self.of_affine(&basis, &basis)).max(0.0));
        }
    }
}
