//! Spectral decomposition of the projected matrix: any λ at the price of a product, and cross-validation.

use nalgebra::DMatrix;
use pulp::{Arch, Simd, WithSimd};

use crate::cholesky::HEAD;

/// A = V diag(μ) Vᵀ.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spectrum {
    values: Vec<f64>,
    least: f64,
    most: f64,
    /// Eigenvectors, one after the other, each behind `HEAD` places and padded with zeros.
    vectors: Vec<f64>,
    stride: usize,
}

impl Spectrum {
    /// Of the matrix of order `m` whose lower triangle stands in `matrix` behind `HEAD` rows and columns.
    pub(crate) fn new(matrix: &[f64], m: usize, stride: usize) -> Self {
        if m == 0 {
            return Self { stride, ..Self::default() };
        }
        let entry = |i: usize, j: usize| matrix[(HEAD + i.min(j)) * stride + HEAD + i.max(j)];
        let eigen = DMatrix::from_fn(m, m, entry).symmetric_eigen();
        let mut vectors = vec![0.0; m * stride];
        for (k, vector) in vectors.chunks_exact_mut(stride).enumerate() {
            vector[HEAD..HEAD + m].copy_from_slice(eigen.eigenvectors.column(k).as_slice());
        }
        let values = eigen.eigenvalues.as_slice().to_vec();
        let (least, most) = (eigen.eigenvalues.min(), f64::max(eigen.eigenvalues.max(), 0.0));
        Self { values, least, most, vectors, stride }
    }

    /// b ← (A + λI)⁻¹ b for `M` columns of b.
    pub(crate) fn solve<const M: usize>(&self, b: &mut [f64], lambda: f64, scratch: &mut Vec<f64>) {
        scratch.clear();
        scratch.resize(b.len(), 0.0);
        Arch::new().dispatch(Filter::<M> { spectrum: self, lambda, b, x: scratch });
        b.copy_from_slice(scratch);
    }

    /// Least and largest eigenvalue.
    pub(crate) fn range(&self) -> (f64, f64) {
        (self.least, self.most)
    }

    /// 2-norm condition number of A + λI; rounding may leave eigenvalues below zero, and then it is infinite.
    pub(crate) fn condition(&self, lambda: f64) -> f64 {
        let (least, most) = (self.least + lambda, self.most + lambda);
        match self.values.is_empty() {
            true => 1.0,
            false if least > 0.0 => most / least,
            false => f64::INFINITY,
        }
    }

    /// The λ of least generalised cross-validation for `outputs` right-hand sides b = Q₂ᵀW^½y over `n` points.
    ///
    /// V(λ) = (1/n) |W^½(y − f)|² / ((1/n) tr(I − H))², both sums over the eigenvalues: |W^½(y − f)|² =
    /// Σ (λ/(μ + λ))² (vᵀb)² and tr(I − H) = Σ λ/(μ + λ).
    pub(crate) fn cross_validate(&self, b: &[f64], n: usize, energies: &mut Vec<f64>) -> f64 {
        energies.clear();
        energies.extend(self.vectors.chunks_exact(self.stride).map(|v| {
            let products =
                b.chunks_exact(self.stride).map(|b| v.iter().zip(b).map(|(v, b)| v * b).sum::<f64>());
            products.map(|p| p * p).sum::<f64>()
        }));
        let most = f64::max(self.most, f64::MIN_POSITIVE);
        let score = |log: f64| {
            let filter = |mu: f64| 1.0 / (1.0 + mu.max(0.0) / log.exp2());
            let rss: f64 =
                self.values.iter().zip(energies.iter()).map(|(&mu, e)| filter(mu).powi(2) * e).sum();
            let trace: f64 = self.values.iter().map(|&mu| filter(mu)).sum();
            n as f64 * rss / (trace * trace)
        };
        // λ from far below what rounding of A allows to where the spline is affine to single precision.
        let (low, high) = (most.log2() - 50.0, most.log2() + 24.0);
        minimise(low, high, score).exp2()
    }
}

/// The least of a function on a grid, then by golden section around it; the larger argument where values are equal.
fn minimise(low: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
    const STEPS: usize = 148;
    let at = |i: usize| low + (high - low) * i as f64 / STEPS as f64;
    let scores = (0..=STEPS).map(|i| (f(at(i)), i));
    let best = scores.fold((f64::INFINITY, 0), |best, new| if new.0 <= best.0 { new } else { best }).1;
    let (mut a, mut b) = (at(best.saturating_sub(1)), at((best + 1).min(STEPS)));
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    for _ in 0..40 {
        let (c, d) = (b - golden * (b - a), a + golden * (b - a));
        if f(c) < f(d) { b = d } else { a = c }
    }
    0.5 * (a + b)
}

struct Filter<'a, const M: usize> {
    spectrum: &'a Spectrum,
    lambda: f64,
    b: &'a [f64],
    x: &'a mut [f64],
}

impl<const M: usize> WithSimd for Filter<'_, M> {
    type Output = ();

    /// x = Σ v (vᵀb) / (μ + λ): a few eigenvectors at a time, each used twice while it is at hand.
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let count = self.spectrum.values.len();
        let whole = count / 4 * 4;
        (0..whole).step_by(4).for_each(|k| self.group::<S, 4>(simd, k));
        (whole..count).for_each(|k| self.group::<S, 1>(simd, k));
    }
}

impl<const M: usize> Filter<'_, M> {
    /// Adds the terms of `N` eigenvectors from `start` on.
    #[inline(always)]
    fn group<S: Simd, const N: usize>(&mut self, simd: S, start: usize) {
        let Spectrum { values, vectors, stride, .. } = self.spectrum;
        let column = |data, k: usize| lanes::<S>(data, *stride, k);
        let count = column(self.b, 0).len();
        let vs: [&[S::f64s]; N] = core::array::from_fn(|n| &column(vectors, start + n)[..count]);
        let bs: [&[S::f64s]; M] = core::array::from_fn(|m| &column(self.b, m)[..count]);
        let mut sums = [[simd.splat_f64s(0.0); M]; N];
        for i in 0..count {
            for n in 0..N {
                for m in 0..M {
                    sums[n][m] = simd.mul_add_e_f64s(vs[n][i], bs[m][i], sums[n][m]);
                }
            }
        }
        for m in 0..M {
            let factors: [S::f64s; N] = core::array::from_fn(|n| {
                simd.splat_f64s(simd.reduce_sum_f64s(sums[n][m]) / (values[start + n] + self.lambda))
            });
            let x = &mut self.x[m * stride + HEAD..(m + 1) * stride];
            for (i, x) in S::as_mut_simd_f64s(x).0.iter_mut().enumerate().take(count) {
                for n in 0..N {
                    *x = simd.mul_add_e_f64s(factors[n], vs[n][i], *x);
                }
            }
        }
    }
}

/// Vectors of column `k` behind its `HEAD` places.
#[inline(always)]
fn lanes<S: Simd>(data: &[f64], stride: usize, k: usize) -> &[S::f64s] {
    S::as_simd_f64s(&data[k * stride + HEAD..(k + 1) * stride]).0
}
