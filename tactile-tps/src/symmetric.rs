//! Products with a symmetric matrix of which only the lower triangle is kept, column by column.

use pulp::{Arch, Simd, WithSimd};

/// y ← K x for `C` columns of x and y, all of length `stride` and zero beyond the order of K.
///
/// Each entry of the triangle is read once and serves both sides of the diagonal.
pub(crate) fn multiply<const C: usize>(k: &[f64], stride: usize, x: &[f64], y: &mut [f64]) {
    y.fill(0.0);
    Arch::new().dispatch(Multiply::<C> { k, stride, x, y });
}

struct Multiply<'a, const C: usize> {
    k: &'a [f64],
    stride: usize,
    x: &'a [f64],
    y: &'a mut [f64],
}

impl<const C: usize> WithSimd for Multiply<'_, C> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { k, stride, x, y } = self;
        for (j, column) in k.chunks_exact(stride).enumerate() {
            // Whole vectors from the one that holds the diagonal; what lies above it is zero.
            let start = j / S::F64_LANES * S::F64_LANES;
            let diagonal = column[j];
            let column = S::as_simd_f64s(&column[start..]).0;
            let own: [f64; C] = core::array::from_fn(|c| x[c * stride + j]);
            let splat = own.map(|x| simd.splat_f64s(x));
            let mut sums = [simd.splat_f64s(0.0); C];
            for (i, &k) in column.iter().enumerate() {
                let at = start + i * S::F64_LANES;
                for c in 0..C {
                    let range = c * stride + at..c * stride + at + S::F64_LANES;
                    let x = S::as_simd_f64s(&x[range.clone()]).0[0];
                    sums[c] = simd.mul_add_e_f64s(k, x, sums[c]);
                    let y = &mut S::as_mut_simd_f64s(&mut y[range]).0[0];
                    *y = simd.mul_add_e_f64s(k, splat[c], *y);
                }
            }
            for c in 0..C {
                y[c * stride + j] += simd.reduce_sum_f64s(sums[c]) - diagonal * own[c];
            }
        }
    }
}

/// Columns v and x of the update K − V Xᵀ − X Vᵀ.
pub(crate) struct Update<'a, const C: usize> {
    pub(crate) v: &'a [f64],
    pub(crate) x: &'a [f64],
    pub(crate) stride: usize,
    pub(crate) n: usize,
}

impl<const C: usize> Update<'_, C> {
    /// Writes rows `j..n` of column `j` of the updated matrix to `target`.
    #[inline(always)]
    fn column<S: Simd>(&self, simd: S, k: &[f64], j: usize, target: &mut [f64]) {
        let Self { v, x, stride, n } = *self;
        let (vj, xj): ([f64; C], [f64; C]) =
            (core::array::from_fn(|c| -v[c * stride + j]), core::array::from_fn(|c| -x[c * stride + j]));
        let (vs, xs) = (vj.map(|v| simd.splat_f64s(v)), xj.map(|x| simd.splat_f64s(x)));
        let (from, rest) = S::as_simd_f64s(&k[j * stride + j..j * stride + n]);
        let (to, end) = S::as_mut_simd_f64s(&mut target[..n - j]);
        for (i, (from, to)) in from.iter().zip(to).enumerate() {
            let at = j + i * S::F64_LANES;
            let mut value = *from;
            for c in 0..C {
                let range = c * stride + at..c * stride + at + S::F64_LANES;
                value = simd.mul_add_e_f64s(S::as_simd_f64s(&v[range.clone()]).0[0], xs[c], value);
                value = simd.mul_add_e_f64s(S::as_simd_f64s(&x[range]).0[0], vs[c], value);
            }
            *to = value;
        }
        let tail = n - rest.len();
        for (i, (from, to)) in rest.iter().zip(end).enumerate() {
            let at = |c: usize| c * stride + tail + i;
            *to = *from + (0..C).map(|c| v[at(c)] * xj[c] + x[at(c)] * vj[c]).sum::<f64>();
        }
    }
}

/// The updated matrix, its first q columns apart from the rest.
pub(crate) struct Split<'a, const C: usize> {
    pub(crate) update: Update<'a, C>,
    pub(crate) k: &'a [f64],
    pub(crate) q: usize,
    /// Rows `q..` of columns `..q`, one after the other.
    pub(crate) coupling: &'a mut [f64],
    /// Lower triangle of the rest.
    pub(crate) rest: &'a mut [f64],
    pub(crate) rest_stride: usize,
    /// A column's worth of scratch.
    pub(crate) scratch: &'a mut [f64],
}

impl<const C: usize> Split<'_, C> {
    pub(crate) fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl<const C: usize> WithSimd for Split<'_, C> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { update, k, q, coupling, rest, rest_stride, scratch } = self;
        let below = update.n - q;
        for j in 0..q {
            update.column(simd, k, j, scratch);
            coupling[j * below..(j + 1) * below].copy_from_slice(&scratch[q - j..update.n - j]);
        }
        for j in q..update.n {
            let start = (j - q) * rest_stride + (j - q);
            update.column(simd, k, j, &mut rest[start..]);
        }
    }
}
