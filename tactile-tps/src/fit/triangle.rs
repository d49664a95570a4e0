//! The lower triangle of a symmetric matrix and its Cholesky factor.

use core::{mem::MaybeUninit, ops::ControlFlow};

use faer::{
    Accum, MatMut, MatRef, Par, Spec,
    dyn_stack::{MemStack, StackReq},
    linalg::{cholesky::llt, matmul::matmul, triangular_solve::solve_lower_triangular_in_place},
};

use crate::{TpsError, lanes::dot};

/// Number of columns that are factored at once, and of earlier columns that are subtracted from them
/// at once. For 3,000 points each step takes less than a twentieth of a second, after which a
/// caller can stop the factorisation.
const BLOCK: usize = 512;
const STEP: usize = 256;

/// The lower triangle of a symmetric matrix, by columns, and its Cholesky factor in the same
/// memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Triangle {
    pub(super) n: usize,
    /// Offset from one column to the next.
    pub(super) stride: usize,
    pub(super) data: Vec<f64>,
    pub(super) stack: Vec<MaybeUninit<u8>>,
}

impl Triangle {
    /// Makes room for a matrix of order n.
    pub(super) fn resize(&mut self, n: usize) {
        self.n = n;
        self.stride = n.next_multiple_of(8);
        // Columns at multiples of 512 bytes would map to the same few cache sets.
        if self.stride.is_multiple_of(64) {
            self.stride += 8;
        }
        let length = n * self.stride;
        if self.data.capacity() < length {
            // A new allocation is zeroed by the system, page by page on first access.
            self.data = vec![0.0; length];
        } else {
            self.data.resize(length, 0.0);
        }
    }

    pub(super) fn trace(&self) -> f64 {
        (0..self.n).map(|j| self.data[j * self.stride + j]).sum()
    }

    pub(super) fn add_to_diagonal(&mut self, lambda: f64) {
        (0..self.n).for_each(|j| self.data[j * self.stride + j] += lambda);
    }

    /// The entries of column `j` from the diagonal on.
    #[inline(always)]
    pub(super) fn column(&mut self, j: usize) -> &mut [f64] {
        &mut self.data[j * self.stride + j..j * self.stride + self.n]
    }

    pub(super) fn view(&self) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice_with_stride(&self.data, self.n, self.n, self.stride)
    }

    /// Factors in place, block by block. On failure returns the column whose pivot is not positive.
    /// `watch` receives the number of factored columns.
    pub(super) fn factor(
        &mut self,
        watch: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> Result<(), TpsError> {
        let (n, stride) = (self.n, self.stride);
        let mut go_on = |done| match watch(done) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(TpsError::Stopped),
        };
        for first in (0..n).step_by(BLOCK) {
            let (width, rows) = (BLOCK.min(n - first), n - first);
            let (earlier, later) = self.data.split_at_mut(first * stride);
            let mut block = MatMut::from_column_major_slice_with_stride_mut(
                &mut later[first..],
                rows,
                width,
                stride,
            );
            for k in (0..first).step_by(STEP) {
                go_on(first)?;
                let left = MatRef::from_column_major_slice_with_stride(
                    &earlier[k * stride + first..],
                    rows,
                    STEP,
                    stride,
                );
                let top = left.subrows(0, width).transpose();
                matmul(block.as_mut(), Accum::Add, left, top, -1.0, Par::Seq);
            }
            let (mut corner, below) = block.split_at_row_mut(width);
            let scratch =
                llt::factor::cholesky_in_place_scratch::<f64>(width, Par::Seq, Spec::default());
            let factored = llt::factor::cholesky_in_place(
                corner.as_mut(),
                Default::default(),
                Par::Seq,
                memory(&mut self.stack, scratch),
                Spec::default(),
            );
            if let Err(llt::factor::LltError::NonPositivePivot { index }) = factored {
                let column = first + index;
                return Err(TpsError::NotDefinite { column });
            }
            solve_lower_triangular_in_place(corner.as_ref(), below.transpose_mut(), Par::Seq);
        }
        // An infinite entry gives pivots that are NaN.
        let bad = (0..n).find(|&j| !self.data[j * stride + j].is_finite());
        bad.map_or(Ok(()), |column| Err(TpsError::NotDefinite { column }))
    }

    /// b ← A⁻¹b for columns of n entries, using the factor.
    pub(super) fn solve(&self, b: &mut [f64]) {
        let columns = b.len() / self.n;
        let b = MatMut::from_column_major_slice_mut(b, self.n, columns);
        llt::solve::solve_in_place(self.view(), b, Par::Seq, MemStack::new(&mut []));
    }

    /// An estimate of the 2-norm of A⁻¹: two steps of inverse iteration, starting from the column
    /// with the smallest pivot.
    pub(super) fn inverse_norm(&self, x: &mut Vec<f64>) -> f64 {
        let pivot = |j: usize| self.data[j * self.stride + j];
        // The column of the smallest pivot tends to be close to the direction that the inverse
        // amplifies most.
        let start = (1..self.n).fold(
            0,
            |least, j| if pivot(j) < pivot(least) { j } else { least },
        );
        x.clear();
        x.resize(self.n, 0.0);
        x[start] = 1.0;
        let mut norm = 1.0;
        for _ in 0..2 {
            self.solve(x);
            norm = dot(x, x).sqrt();
            x.iter_mut().for_each(|x| *x /= norm);
        }
        norm
    }
}

/// A stack of at least the requested size, in reusable memory.
pub(super) fn memory(kept: &mut Vec<MaybeUninit<u8>>, size: StackReq) -> &mut MemStack {
    kept.resize(size.unaligned_bytes_required(), MaybeUninit::uninit());
    MemStack::new(kept)
}
