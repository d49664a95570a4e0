//! Spectral decomposition of the projected matrix: a solve with any λ costs a product; cross-validation.

use nalgebra::DMatrix;

use crate::{layout::HEAD, packed::Packed};

/// A = V diag(μ) Vᵀ.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spectrum {
    values: Vec<f64>,
    least: f64,
    most: f64,
    /// V, row by row: its columns are the eigenvectors.
    by_place: Packed,
    /// Vᵀ, row by row.
    by_vector: Packed,
    stride: usize,
}

impl Spectrum {
    /// Of the matrix of order `m` whose lower triangle stands in `matrix` behind `HEAD` rows and columns.
    pub(crate) fn new(matrix: &[f64], m: usize, stride: usize) -> Self {
        if m == 0 {
            return Self {
                stride,
                ..Self::default()
            };
        }
        let entry = |i: usize, j: usize| matrix[(HEAD + i.min(j)) * stride + HEAD + i.max(j)];
        let eigen = DMatrix::from_fn(m, m, entry).symmetric_eigen();
        let vectors = &eigen.eigenvectors;
        let by_place = Packed::new(m, m, |i, k| vectors[(i, k)]);
        let by_vector = Packed::new(m, m, |k, i| vectors[(i, k)]);
        let values = eigen.eigenvalues.as_slice().to_vec();
        let (least, most) = (
            eigen.eigenvalues.min(),
            f64::max(eigen.eigenvalues.max(), 0.0),
        );
        Self {
            values,
            least,
            most,
            by_place,
            by_vector,
            stride,
        }
    }

    /// b ← (A + λI)⁻¹ b for `M` columns of b, behind `HEAD` places each.
    pub(crate) fn solve<const M: usize>(&self, b: &mut [f64], lambda: f64, scratch: &mut Vec<f64>) {
        scratch.clear();
        scratch.resize(M * self.stride, 0.0);
        self.coefficients::<M>(b, scratch);
        self.divide(scratch, lambda);
        self.combine::<M>(scratch, b);
    }

    /// c ← (diag(μ) + λI)⁻¹ c, column by column.
    pub(crate) fn divide(&self, coefficients: &mut [f64], lambda: f64) {
        for column in coefficients.chunks_exact_mut(self.stride) {
            column
                .iter_mut()
                .zip(&self.values)
                .for_each(|(c, mu)| *c /= mu + lambda);
        }
    }

    /// b = Vc for `M` columns of c.
    pub(crate) fn combine<const M: usize>(&self, c: &[f64], b: &mut [f64]) {
        let columns = core::array::from_fn(|m| &c[m * self.stride..(m + 1) * self.stride]);
        self.by_vector.combine::<M>(columns, b, self.stride, HEAD);
    }

    /// Vᵀb for `M` columns of b, behind `HEAD` places each.
    pub(crate) fn coefficients<const M: usize>(&self, b: &[f64], c: &mut [f64]) {
        let columns = core::array::from_fn(|m| &b[m * self.stride + HEAD..(m + 1) * self.stride]);
        self.by_place.combine::<M>(columns, c, self.stride, 0);
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

    /// The λ of least generalised cross-validation for `M` right-hand sides b = Q₂ᵀW^½y over `n` points.
    ///
    /// V(λ) = (1/n) |W^½(y − f)|² / ((1/n) tr(I − H))², both sums over the eigenvalues: |W^½(y − f)|² =
    /// Σ (λ/(μ + λ))² (vᵀb)² and tr(I − H) = Σ λ/(μ + λ).
    pub(crate) fn cross_validate<const M: usize>(
        &self,
        b: &[f64],
        n: usize,
        energies: &mut Vec<f64>,
    ) -> f64 {
        energies.clear();
        energies.resize(M * self.stride, 0.0);
        self.coefficients::<M>(b, energies);
        for k in 0..self.values.len() {
            energies[k] = (0..M).map(|m| energies[m * self.stride + k].powi(2)).sum();
        }
        let most = f64::max(self.most, f64::MIN_POSITIVE);
        let score = |log: f64| {
            let filter = |mu: f64| 1.0 / (1.0 + mu.max(0.0) / log.exp2());
            let rss: f64 = self
                .values
                .iter()
                .zip(energies.iter())
                .map(|(&mu, e)| filter(mu).powi(2) * e)
                .sum();
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
    let best = scores
        .fold(
            (f64::INFINITY, 0),
            |best, new| if new.0 <= best.0 { new } else { best },
        )
        .1;
    let (mut a, mut b) = (at(best.saturating_sub(1)), at((best + 1).min(STEPS)));
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    for _ in 0..40 {
        let (c, d) = (b - golden * (b - a), a + golden * (b - a));
        if f(c) < f(d) { b = d } else { a = c }
    }
    0.5 * (a + b)
}
