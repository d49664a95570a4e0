//! Cholesky factorisation of a dense symmetric positive definite matrix.
//!
//! Blocked and left-looking: a block of columns gathers all that earlier columns subtract from it in registers, tile by
//! tile, then panels of eight columns are finished within the block. The matrix is padded to a multiple of eight
//! with the identity, so that every loop runs over whole vectors.

use pulp::{Arch, Simd, WithSimd};

use crate::{
    layout::{HEAD, PANEL},
    tiles::{BLOCK, DEPTH, Strips, load, tile},
    triangular::Solve,
};

/// The factor L of A = L Lᵀ, column by column, behind `HEAD` rows and columns.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cholesky {
    /// Order of the matrix proper.
    pub(crate) m: usize,
    /// Places in a column.
    pub(crate) stride: usize,
    /// `stride` columns of `stride` places, and `HEAD` more.
    pub(crate) l: Vec<f64>,
    /// Reciprocals of the diagonal.
    reciprocal: Vec<f64>,
}

impl Cholesky {
    /// Makes room for a matrix of order `m`; what lies below the diagonal is then the caller's to write.
    pub(crate) fn prepare(&mut self, m: usize, stride: usize) {
        if (self.m, self.stride) != (m, stride) || self.l.is_empty() {
            (self.m, self.stride) = (m, stride);
            // A new allocation comes zeroed from the system, page by page as it is touched.
            let length = stride * stride + HEAD;
            if self.l.capacity() < length {
                self.l = vec![0.0; length];
            } else {
                self.l.clear();
                self.l.resize(length, 0.0);
            }
            self.reciprocal.clear();
            self.reciprocal.resize(stride, 1.0);
        }
        (HEAD + m..stride).for_each(|k| self.l[k * stride + k] = 1.0);
    }

    /// Factors the matrix in place. Fails with the column whose pivot is not positive.
    pub(crate) fn factor(&mut self) -> Result<(), usize> {
        let stride = self.stride;
        let l = &mut self.l[HEAD * stride + HEAD..];
        Arch::new().dispatch(Factor {
            l,
            stride,
            order: stride - HEAD,
            reciprocal: &mut self.reciprocal,
        })
    }

    /// b ← A⁻¹b for `R` columns of `stride` places each, of which those from `HEAD` on count.
    pub(crate) fn solve<const R: usize>(&self, b: &mut [f64]) {
        if self.m > 0 {
            let (l, b) = (&self.l[HEAD * self.stride + HEAD..], &mut b[HEAD..]);
            let order = self.stride - HEAD;
            Arch::new().dispatch(Solve::<R> {
                l,
                stride: self.stride,
                order,
                reciprocal: &self.reciprocal,
                b,
            });
        }
    }

    /// An estimate of the 2-norm of A⁻¹: two steps of inverse iteration from the column of the least pivot.
    pub(crate) fn inverse_norm(&self, x: &mut Vec<f64>) -> f64 {
        let pivot = |i: usize| self.reciprocal[i];
        let start = (1..self.m).fold(0, |best, i| if pivot(i) > pivot(best) { i } else { best });
        x.clear();
        x.resize(self.stride, 0.0);
        x[HEAD + start] = 1.0;
        let mut norm = 1.0;
        for _ in 0..2 {
            self.solve::<1>(x);
            norm = x[HEAD..].iter().map(|x| x * x).sum::<f64>().sqrt();
            x.iter_mut().for_each(|x| *x /= norm);
        }
        norm
    }
}

struct Factor<'a> {
    l: &'a mut [f64],
    stride: usize,
    order: usize,
    reciprocal: &'a mut [f64],
}

impl WithSimd for Factor<'_> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self {
            l,
            stride,
            order,
            reciprocal,
        } = self;
        let mut packed = Strips::new();
        for block in (0..order).step_by(BLOCK) {
            let end = order.min(block + BLOCK);
            for depth in (0..block).step_by(DEPTH) {
                packed.update(
                    simd,
                    l,
                    stride,
                    order,
                    depth..block.min(depth + DEPTH),
                    block..end,
                );
            }
            for column in (block..end).step_by(PANEL) {
                update(simd, l, stride, order, block..column, column);
                diagonal(&mut l[column * stride..], stride, column, reciprocal)
                    .map_err(|k| column + k)?;
                panel(
                    simd,
                    &mut l[column * stride..],
                    stride,
                    column..order,
                    reciprocal,
                );
            }
        }
        Ok(())
    }
}

/// Subtracts what the columns `earlier` of the same block contribute to the panel at `column`; they are at hand.
#[inline(always)]
fn update<S: Simd>(
    simd: S,
    l: &mut [f64],
    stride: usize,
    order: usize,
    earlier: core::ops::Range<usize>,
    column: usize,
) {
    let (left, panel) = l.split_at_mut(column * stride);
    let left = &left[earlier.start * stride..earlier.end * stride];
    if left.is_empty() {
        return;
    }
    let tall = 3 * S::F64_LANES;
    let mut row = column;
    while row < order {
        if row + tall <= order {
            strip::<S, 3>(simd, left, panel, stride, row, column);
            row += tall;
        } else {
            strip::<S, 1>(simd, left, panel, stride, row, column);
            row += S::F64_LANES;
        }
    }
}

/// One strip of one panel, read where it stands.
#[inline(always)]
fn strip<S: Simd, const V: usize>(
    simd: S,
    left: &[f64],
    panel: &mut [f64],
    stride: usize,
    row: usize,
    column: usize,
) {
    let height = V * S::F64_LANES;
    let steps = |offset: usize, width: usize| {
        let at = column + offset;
        left.chunks_exact(stride)
            .map(move |l| (&l[row..row + height], &l[at..at + width]))
    };
    if S::F64_LANES >= 8 {
        tile::<S, V, 8>(simd, steps(0, 8), panel, stride, row);
    } else {
        tile::<S, V, 4>(simd, steps(0, 4), panel, stride, row);
        tile::<S, V, 4>(simd, steps(4, 4), &mut panel[4 * stride..], stride, row);
    }
}

/// Factors the 8 × 8 block on the diagonal, fails with the place of a bad pivot.
#[inline(always)]
fn diagonal(
    columns: &mut [f64],
    stride: usize,
    start: usize,
    reciprocal: &mut [f64],
) -> Result<(), usize> {
    let mut a: [[f64; PANEL]; PANEL] =
        core::array::from_fn(|j| core::array::from_fn(|i| columns[j * stride + start + i]));
    for k in 0..PANEL {
        let pivot = a[k][k];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return Err(k);
        }
        let root = pivot.sqrt();
        let inverse = 1.0 / root;
        reciprocal[start + k] = inverse;
        a[k][k] = root;
        for i in k + 1..PANEL {
            a[k][i] *= inverse;
        }
        for j in k + 1..PANEL {
            for i in j..PANEL {
                a[j][i] -= a[k][i] * a[k][j];
            }
        }
    }
    for j in 0..PANEL {
        columns[j * stride + start + j..j * stride + start + PANEL].copy_from_slice(&a[j][j..]);
    }
    Ok(())
}

/// Divides the rows below the diagonal block by its factor.
#[inline(always)]
fn panel<S: Simd>(
    simd: S,
    columns: &mut [f64],
    stride: usize,
    rows: core::ops::Range<usize>,
    reciprocal: &[f64],
) {
    let start = rows.start;
    let mut factor = [[0.0; PANEL]; PANEL];
    for d in 0..PANEL {
        factor[d].copy_from_slice(&columns[d * stride + start..d * stride + start + PANEL]);
        factor[d][d] = reciprocal[start + d];
    }
    for row in (start + PANEL..rows.end).step_by(S::F64_LANES) {
        let mut x = [simd.splat_f64s(0.0); PANEL];
        for c in 0..PANEL {
            let mut sum = load::<S, 1>(&columns[c * stride..], row)[0];
            for d in 0..c {
                sum = simd.mul_add_e_f64s(simd.splat_f64s(-factor[d][c]), x[d], sum);
            }
            x[c] = simd.mul_f64s(sum, simd.splat_f64s(factor[c][c]));
            S::as_mut_simd_f64s(&mut columns[c * stride + row..c * stride + row + S::F64_LANES])
                .0[0] = x[c];
        }
    }
}
