//! Cholesky factorisation of a dense symmetric positive definite matrix, and its triangular solves.
//!
//! Blocked and left-looking: a block of columns gathers all that earlier columns subtract from it in registers, tile by
//! tile, then panels of eight columns are finished within the block. The matrix is padded to a multiple of eight
//! with the identity, so that every loop runs over whole vectors.

use pulp::{Arch, Simd, WithSimd};

/// Columns of a panel, and the multiple the matrix is padded to.
pub(crate) const PANEL: usize = 8;
/// Columns of a block.
const BLOCK: usize = 64;

/// The factor L of A = L Lᵀ, column by column.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cholesky {
    m: usize,
    stride: usize,
    l: Vec<f64>,
    /// Reciprocals of the diagonal.
    reciprocal: Vec<f64>,
}

/// `m` rounded up to whole panels.
pub(crate) fn padded(m: usize) -> usize {
    m.div_ceil(PANEL) * PANEL
}

impl Cholesky {
    /// Rows of a right-hand side, padding included.
    pub(crate) fn rows(&self) -> usize {
        self.stride
    }

    /// Factors the m × m matrix whose lower triangle `fill` writes, given its columns and their stride.
    ///
    /// Fails with the column whose pivot is not positive.
    pub(crate) fn factor(&mut self, m: usize, fill: impl FnOnce(&mut [f64], usize)) -> Result<(), usize> {
        (self.m, self.stride) = (m, padded(m));
        self.l.clear();
        self.l.resize(self.stride * self.stride, 0.0);
        self.reciprocal.clear();
        self.reciprocal.resize(self.stride, 1.0);
        fill(&mut self.l, self.stride);
        (m..self.stride).for_each(|k| self.l[k * self.stride + k] = 1.0);
        Arch::new().dispatch(Factor { l: &mut self.l, stride: self.stride, reciprocal: &mut self.reciprocal })
    }

    /// b ← A⁻¹b for the `R` columns of b, each padded with zeros to [`rows`](Self::rows).
    pub(crate) fn solve<const R: usize>(&self, b: &mut [f64]) {
        Arch::new().dispatch(Solve::<R> { l: &self.l, stride: self.stride, reciprocal: &self.reciprocal, b });
    }

    /// An estimate of the 2-norm condition number: a few steps of power and inverse iteration.
    pub(crate) fn condition(&self, scratch: &mut Vec<f64>) -> f64 {
        if self.m == 0 {
            return 1.0;
        }
        let pivot = |i: &usize| self.l[i * self.stride + i];
        let extreme = |better: fn(f64, f64) -> bool| {
            (1..self.m).fold(0, |best, i| if better(pivot(&i), pivot(&best)) { i } else { best })
        };
        let largest = self.iterate(extreme(|a, b| a > b), scratch, |this, x| this.multiply(x));
        let smallest = self.iterate(extreme(|a, b| a < b), scratch, |this, x| this.solve::<1>(x));
        f64::max(largest * smallest, 1.0)
    }

    /// Norm growth of an operator after three steps from the `start`-th unit vector.
    fn iterate(&self, start: usize, x: &mut Vec<f64>, step: impl Fn(&Self, &mut [f64])) -> f64 {
        x.clear();
        x.resize(self.stride, 0.0);
        x[start] = 1.0;
        let mut norm = 1.0;
        for _ in 0..3 {
            step(self, x);
            norm = x.iter().map(|x| x * x).sum::<f64>().sqrt();
            x.iter_mut().for_each(|x| *x /= norm);
        }
        norm
    }

    /// b ← A b for one column.
    fn multiply(&self, b: &mut [f64]) {
        Arch::new().dispatch(Multiply { l: &self.l, stride: self.stride, m: self.m, b });
    }
}

/// `V` vectors of `simd` from `column[row..]`.
#[inline(always)]
fn load<S: Simd, const V: usize>(column: &[f64], row: usize) -> [S::f64s; V] {
    let vectors = S::as_simd_f64s(&column[row..row + V * S::F64_LANES]).0;
    core::array::from_fn(|v| vectors[v])
}

struct Factor<'a> {
    l: &'a mut [f64],
    stride: usize,
    reciprocal: &'a mut [f64],
}

impl WithSimd for Factor<'_> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { l, stride, reciprocal } = self;
        for block in (0..stride).step_by(BLOCK) {
            let end = stride.min(block + BLOCK);
            for column in (block..end).step_by(PANEL) {
                update(simd, l, stride, 0..block, column);
            }
            for column in (block..end).step_by(PANEL) {
                update(simd, l, stride, block..column, column);
                diagonal(&mut l[column * stride..], stride, column, reciprocal).map_err(|k| column + k)?;
                panel(simd, &mut l[column * stride..], stride, column, reciprocal);
            }
        }
        Ok(())
    }
}

/// Subtracts what the columns `earlier` contribute to the panel at `column`.
#[inline(always)]
fn update<S: Simd>(simd: S, l: &mut [f64], stride: usize, earlier: core::ops::Range<usize>, column: usize) {
    let (left, right) = l.split_at_mut(column * stride);
    let left = &left[earlier.start * stride..earlier.end * stride];
    if left.is_empty() {
        return;
    }
    let right = &mut right[..PANEL * stride];
    let tall = 3 * S::F64_LANES;
    let mut row = column;
    while row + tall <= stride {
        strip::<S, 3>(simd, left, right, stride, row, column);
        row += tall;
    }
    while row < stride {
        strip::<S, 1>(simd, left, right, stride, row, column);
        row += S::F64_LANES;
    }
}

/// One strip of rows of a panel: as wide a tile as the registers hold.
#[inline(always)]
fn strip<S: Simd, const V: usize>(
    simd: S,
    left: &[f64],
    right: &mut [f64],
    stride: usize,
    row: usize,
    column: usize,
) {
    if S::F64_LANES >= 8 {
        tile::<S, V, 8>(simd, left, right, stride, row, column);
    } else {
        let (first, second) = right.split_at_mut(4 * stride);
        tile::<S, V, 4>(simd, left, first, stride, row, column);
        tile::<S, V, 4>(simd, left, second, stride, row, column + 4);
    }
}

#[inline(always)]
fn tile<S: Simd, const V: usize, const N: usize>(
    simd: S,
    left: &[f64],
    right: &mut [f64],
    stride: usize,
    row: usize,
    column: usize,
) {
    let mut sum = [[simd.splat_f64s(0.0); V]; N];
    for earlier in left.chunks_exact(stride) {
        let a = load::<S, V>(earlier, row);
        let b = &earlier[column..column + N];
        for j in 0..N {
            let b = simd.splat_f64s(b[j]);
            for v in 0..V {
                sum[j][v] = simd.mul_add_e_f64s(a[v], b, sum[j][v]);
            }
        }
    }
    for (j, target) in right.chunks_exact_mut(stride).enumerate().take(N) {
        let target = S::as_mut_simd_f64s(&mut target[row..row + V * S::F64_LANES]).0;
        for v in 0..V {
            target[v] = simd.sub_f64s(target[v], sum[j][v]);
        }
    }
}

/// Factors the 8 × 8 block on the diagonal, fails with the place of a bad pivot.
#[inline(always)]
fn diagonal(columns: &mut [f64], stride: usize, start: usize, reciprocal: &mut [f64]) -> Result<(), usize> {
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
fn panel<S: Simd>(simd: S, columns: &mut [f64], stride: usize, start: usize, reciprocal: &[f64]) {
    let mut factor = [[0.0; PANEL]; PANEL];
    for d in 0..PANEL {
        factor[d].copy_from_slice(&columns[d * stride + start..d * stride + start + PANEL]);
        factor[d][d] = reciprocal[start + d];
    }
    for row in (start + PANEL..stride).step_by(S::F64_LANES) {
        let mut x = [simd.splat_f64s(0.0); PANEL];
        for c in 0..PANEL {
            let mut sum = load::<S, 1>(&columns[c * stride..], row)[0];
            for d in 0..c {
                sum = simd.mul_add_e_f64s(simd.splat_f64s(-factor[d][c]), x[d], sum);
            }
            x[c] = simd.mul_f64s(sum, simd.splat_f64s(factor[c][c]));
            S::as_mut_simd_f64s(&mut columns[c * stride + row..c * stride + row + S::F64_LANES]).0[0] = x[c];
        }
    }
}

struct Solve<'a, const R: usize> {
    l: &'a [f64],
    stride: usize,
    reciprocal: &'a [f64],
    b: &'a mut [f64],
}

impl<const R: usize> WithSimd for Solve<'_, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for start in (0..self.stride).step_by(PANEL) {
            self.forward(simd, start);
        }
        for start in (0..self.stride).step_by(PANEL).rev() {
            self.backward(simd, start);
        }
    }
}

impl<const R: usize> Solve<'_, R> {
    /// Solves one panel of L z = b and subtracts it from the rows below.
    #[inline(always)]
    fn forward<S: Simd>(&mut self, simd: S, start: usize) {
        let Self { l, stride, reciprocal, .. } = *self;
        let columns = &l[start * stride..(start + PANEL) * stride];
        let mut x = [[0.0; PANEL]; R];
        for (r, b) in self.b.chunks_exact_mut(stride).enumerate().take(R) {
            for c in 0..PANEL {
                let done: f64 =
                    (0..c).fold(b[start + c], |sum, d| sum - columns[d * stride + start + c] * x[r][d]);
                x[r][c] = done * reciprocal[start + c];
            }
            b[start..start + PANEL].copy_from_slice(&x[r]);
        }
        let x: [[S::f64s; PANEL]; R] = x.map(|x| x.map(|x| simd.splat_f64s(-x)));
        for row in (start + PANEL..stride).step_by(S::F64_LANES) {
            let l: [S::f64s; PANEL] = core::array::from_fn(|c| load::<S, 1>(&columns[c * stride..], row)[0]);
            for (r, b) in self.b.chunks_exact_mut(stride).enumerate().take(R) {
                let b = &mut S::as_mut_simd_f64s(&mut b[row..row + S::F64_LANES]).0[0];
                for c in 0..PANEL {
                    *b = simd.mul_add_e_f64s(l[c], x[r][c], *b);
                }
            }
        }
    }

    /// Solves one panel of Lᵀx = z from the rows below.
    #[inline(always)]
    fn backward<S: Simd>(&mut self, simd: S, start: usize) {
        let Self { l, stride, reciprocal, .. } = *self;
        let columns = &l[start * stride..(start + PANEL) * stride];
        let mut known = [[0.0; PANEL]; R];
        for half in [0, PANEL / 2] {
            let mut sum = [[simd.splat_f64s(0.0); PANEL / 2]; R];
            for row in (start + PANEL..stride).step_by(S::F64_LANES) {
                let l: [S::f64s; PANEL / 2] =
                    core::array::from_fn(|c| load::<S, 1>(&columns[(half + c) * stride..], row)[0]);
                for (r, b) in self.b.chunks_exact(stride).enumerate().take(R) {
                    let b = load::<S, 1>(b, row)[0];
                    for c in 0..PANEL / 2 {
                        sum[r][c] = simd.mul_add_e_f64s(l[c], b, sum[r][c]);
                    }
                }
            }
            for r in 0..R {
                for c in 0..PANEL / 2 {
                    known[r][half + c] = simd.reduce_sum_f64s(sum[r][c]);
                }
            }
        }
        for (r, b) in self.b.chunks_exact_mut(stride).enumerate().take(R) {
            for c in (0..PANEL).rev() {
                let own = &columns[c * stride + start..c * stride + start + PANEL];
                let rest =
                    (c + 1..PANEL).fold(b[start + c] - known[r][c], |sum, d| sum - own[d] * b[start + d]);
                b[start + c] = rest * reciprocal[start + c];
            }
        }
    }
}

struct Multiply<'a> {
    l: &'a [f64],
    stride: usize,
    m: usize,
    b: &'a mut [f64],
}

impl WithSimd for Multiply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { l, stride, m, b } = self;
        let columns = || l.chunks_exact(stride).enumerate().take(m);
        for (k, column) in columns() {
            let (lanes, tail) = S::as_simd_f64s(&column[k..]);
            let (others, rest) = S::as_simd_f64s(&b[k..]);
            let add = |sum, (l, b): (&S::f64s, &S::f64s)| simd.mul_add_e_f64s(*l, *b, sum);
            let sum = lanes.iter().zip(others).fold(simd.splat_f64s(0.0), add);
            b[k] = simd.reduce_sum_f64s(sum) + tail.iter().zip(rest).map(|(l, b)| l * b).sum::<f64>();
        }
        for (k, column) in columns().rev() {
            let x = b[k];
            b[k + 1..].iter_mut().zip(&column[k + 1..]).for_each(|(b, l)| *b += l * x);
            b[k] = column[k] * x;
        }
    }
}
