//! Triangular solves with a Cholesky factor, several right-hand sides at once, panel by panel.

use pulp::{Simd, WithSimd};

use crate::{layout::PANEL, tiles::load};

/// b ← (L Lᵀ)⁻¹ b for `R` columns of b, `stride` apart as those of L; the first `order` places of each count.
pub(crate) struct Solve<'a, const R: usize> {
    pub(crate) l: &'a [f64],
    pub(crate) stride: usize,
    pub(crate) order: usize,
    pub(crate) reciprocal: &'a [f64],
    pub(crate) b: &'a mut [f64],
}

impl<const R: usize> WithSimd for Solve<'_, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for start in (0..self.order).step_by(PANEL) {
            self.forward(simd, start);
        }
        for start in (0..self.order).step_by(PANEL).rev() {
            self.backward(simd, start);
        }
    }
}

impl<const R: usize> Solve<'_, R> {
    /// Solves one panel of L z = b and subtracts it from the rows below.
    #[inline(always)]
    fn forward<S: Simd>(&mut self, simd: S, start: usize) {
        let Self {
            l,
            stride,
            order,
            reciprocal,
            ..
        } = *self;
        let columns = &l[start * stride..];
        let mut x = [[0.0; PANEL]; R];
        for r in 0..R {
            let b = &mut self.b[r * stride..];
            for c in 0..PANEL {
                let done: f64 = (0..c).fold(b[start + c], |sum, d| {
                    sum - columns[d * stride + start + c] * x[r][d]
                });
                x[r][c] = done * reciprocal[start + c];
            }
            b[start..start + PANEL].copy_from_slice(&x[r]);
        }
        let x: [[S::f64s; PANEL]; R] = x.map(|x| x.map(|x| simd.splat_f64s(-x)));
        for row in (start + PANEL..order).step_by(S::F64_LANES) {
            let l: [S::f64s; PANEL] =
                core::array::from_fn(|c| load::<S, 1>(&columns[c * stride..], row)[0]);
            for r in 0..R {
                let at = r * stride + row;
                let b = &mut S::as_mut_simd_f64s(&mut self.b[at..at + S::F64_LANES]).0[0];
                for c in 0..PANEL {
                    *b = simd.mul_add_e_f64s(l[c], x[r][c], *b);
                }
            }
        }
    }

    /// Solves one panel of Lᵀx = z from the rows below.
    #[inline(always)]
    fn backward<S: Simd>(&mut self, simd: S, start: usize) {
        let Self {
            l,
            stride,
            reciprocal,
            ..
        } = *self;
        let columns = &l[start * stride..];
        let mut known = [[0.0; PANEL]; R];
        for half in [0, PANEL / 2] {
            self.below(simd, start, half, &mut known);
        }
        for r in 0..R {
            let b = &mut self.b[r * stride..];
            for c in (0..PANEL).rev() {
                let own = &columns[c * stride + start..c * stride + start + PANEL];
                let rest = (c + 1..PANEL).fold(b[start + c] - known[r][c], |sum, d| {
                    sum - own[d] * b[start + d]
                });
                b[start + c] = rest * reciprocal[start + c];
            }
        }
    }

    /// What the rows below a panel contribute to half of its columns, from column `half` of the panel on, into `known`.
    #[inline(always)]
    fn below<S: Simd>(&self, simd: S, start: usize, half: usize, known: &mut [[f64; PANEL]; R]) {
        let columns = &self.l[(start + half) * self.stride..];
        let mut sum = [[simd.splat_f64s(0.0); PANEL / 2]; R];
        for row in (start + PANEL..self.order).step_by(S::F64_LANES) {
            let l: [S::f64s; PANEL / 2] =
                core::array::from_fn(|c| load::<S, 1>(&columns[c * self.stride..], row)[0]);
            for r in 0..R {
                let b = load::<S, 1>(self.b, r * self.stride + row)[0];
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
}
