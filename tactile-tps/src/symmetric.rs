//! Symmetric products, low-rank updates and block reflectors, one column at a time.

use pulp::{Arch, Simd, WithSimd};

/// `C` columns of equal length, one after the other.
pub(crate) struct Columns<'a, const C: usize> {
    pub(crate) data: &'a [f64],
    pub(crate) stride: usize,
}

impl<const C: usize> Columns<'_, C> {
    /// Vectors of each column from `start` on.
    #[inline(always)]
    fn vectors<S: Simd>(&self, start: usize) -> [&[S::f64s]; C] {
        core::array::from_fn(|c| {
            S::as_simd_f64s(&self.data[c * self.stride + start..(c + 1) * self.stride]).0
        })
    }

    #[inline(always)]
    fn row(&self, row: usize) -> [f64; C] {
        core::array::from_fn(|c| self.data[c * self.stride + row])
    }
}

/// What column `j` of the lower triangle of K adds to Y = K X, on both sides of the diagonal.
///
/// `column` runs over all rows; the lanes above the diagonal in the vector that holds it are zero.
pub(crate) struct Product<'a, const C: usize> {
    pub(crate) column: &'a [f64],
    pub(crate) j: usize,
    pub(crate) x: Columns<'a, C>,
    pub(crate) y: &'a mut [f64],
}

impl<const C: usize> Product<'_, C> {
    pub(crate) fn add(self) {
        Arch::new().dispatch(self);
    }
}

impl<const C: usize> WithSimd for Product<'_, C> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { column, j, x, y } = self;
        let stride = x.stride;
        let start = j / S::F64_LANES * S::F64_LANES;
        let own = x.row(j);
        let splat = own.map(|x| simd.splat_f64s(x));
        let vectors = S::as_simd_f64s(&column[start..stride]).0;
        let count = vectors.len();
        let xs = x.vectors::<S>(start).map(|x| &x[..count]);
        let mut sums = [simd.splat_f64s(0.0); C];
        for i in 0..count {
            for c in 0..C {
                sums[c] = simd.mul_add_e_f64s(vectors[i], xs[c][i], sums[c]);
            }
        }
        for c in 0..C {
            let y = &mut y[c * stride..(c + 1) * stride];
            for (y, k) in S::as_mut_simd_f64s(&mut y[start..])
                .0
                .iter_mut()
                .zip(vectors)
            {
                *y = simd.mul_add_e_f64s(*k, splat[c], *y);
            }
            y[j] += simd.reduce_sum_f64s(sums[c]) - column[j] * own[c];
        }
    }
}

/// Column `j` of the update K − V Xᵀ − X Vᵀ, from the vector that holds the diagonal on.
///
/// Returns the sum of squares below the diagonal.
pub(crate) struct Update<'a, const C: usize> {
    pub(crate) column: &'a mut [f64],
    pub(crate) j: usize,
    pub(crate) v: Columns<'a, C>,
    pub(crate) x: Columns<'a, C>,
}

impl<const C: usize> Update<'_, C> {
    pub(crate) fn subtract(self) -> f64 {
        Arch::new().dispatch(self)
    }
}

impl<const C: usize> WithSimd for Update<'_, C> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self { column, j, v, x } = self;
        let start = j / S::F64_LANES * S::F64_LANES;
        let vj = v.row(j).map(|v| simd.splat_f64s(-v));
        let xj = x.row(j).map(|x| simd.splat_f64s(-x));
        let stride = v.stride;
        let (above, diagonal) = (start..j, j);
        let vectors = S::as_mut_simd_f64s(&mut column[start..stride]).0;
        let count = vectors.len();
        let vs = v.vectors::<S>(start).map(|v| &v[..count]);
        let xs = x.vectors::<S>(start).map(|x| &x[..count]);
        let mut squares = simd.splat_f64s(0.0);
        for i in 0..count {
            let mut value = vectors[i];
            for c in 0..C {
                value = simd.mul_add_e_f64s(vs[c][i], xj[c], value);
                value = simd.mul_add_e_f64s(xs[c][i], vj[c], value);
            }
            squares = simd.mul_add_e_f64s(value, value, squares);
            vectors[i] = value;
        }
        let upper: f64 = column[above].iter().map(|x| x * x).sum();
        simd.reduce_sum_f64s(squares) - upper - column[diagonal] * column[diagonal]
    }
}

/// b ← (I − V T Vᵀ) b.
pub(crate) struct Reflect<'a, const C: usize> {
    pub(crate) v: Columns<'a, C>,
    pub(crate) t: [[f64; C]; C],
    pub(crate) b: &'a mut [f64],
}

impl<const C: usize> Reflect<'_, C> {
    pub(crate) fn apply(self) {
        Arch::new().dispatch(self);
    }
}

impl<const C: usize> WithSimd for Reflect<'_, C> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { v, t, b } = self;
        let b = S::as_mut_simd_f64s(&mut b[..v.stride]).0;
        let count = b.len();
        let v = v.vectors::<S>(0).map(|v| &v[..count]);
        let mut sums = [simd.splat_f64s(0.0); C];
        for i in 0..count {
            for c in 0..C {
                sums[c] = simd.mul_add_e_f64s(v[c][i], b[i], sums[c]);
            }
        }
        let sums = sums.map(|sum| simd.reduce_sum_f64s(sum));
        let factors: [S::f64s; C] = core::array::from_fn(|i| {
            simd.splat_f64s(-(0..C).map(|j| t[i][j] * sums[j]).sum::<f64>())
        });
        for i in 0..count {
            for c in 0..C {
                b[i] = simd.mul_add_e_f64s(v[c][i], factors[c], b[i]);
            }
        }
    }
}
