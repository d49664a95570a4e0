//! The M-step of non-rigid motion: `y ↦ y + (G W)(y)` with a smooth Gaussian kernel.
//!
//! Myronenko & Song (2010), eq. 22–23: `(diag(P1) G + λσ² I) W = P X − diag(P1) Y`. With `G = L Lᵀ` the motion is
//! `G W = L z`, `(Lᵀ diag(P1) L + λσ² I) z = Lᵀ (P X − diag(P1) Y)`: symmetric, positive definite, `r × r`.

use super::expectation::{Columns, Posterior};
use super::kernel::KernelFactor;
use crate::simd::{Loop, vectorised};
use nalgebra::{Cholesky, DMatrix, Dyn, VecStorage};

/// The coefficients `z`, a row per column of `L`, and the memory of the step.
#[derive(Clone, Debug, Default)]
pub(super) struct NonRigidStep {
    /// `z`, column by column of `r` entries.
    coefficients: Vec<f64>,
    normal: Vec<f64>,
}

impl NonRigidStep {
    /// Row `k` of `z`.
    pub(super) fn coefficient<const D: usize>(&self, k: usize) -> [f64; D] {
        let rank = self.coefficients.len() / D;
        std::array::from_fn(|d| self.coefficients[d * rank + k])
    }

    /// Solves for `z` and moves `model` into `moved`; `O(M r²)`.
    pub(super) fn solve<const D: usize>(
        &mut self,
        kernel: &KernelFactor,
        posterior: &Posterior<D>,
        model: &Columns<D>,
        ridge: f64,
        moved: &mut Columns<D>,
    ) {
        let rank = kernel.rank();
        self.normal.clear();
        self.normal.resize(rank * rank, 0.0);
        self.coefficients.clear();
        self.coefficients.resize(rank * D, 0.0);
        vectorised(Assemble {
            step: self,
            kernel,
            posterior,
            model,
            ridge,
        });
        let storage = VecStorage::new(Dyn(rank), Dyn(rank), std::mem::take(&mut self.normal));
        // Positive definite by construction; were it not, z = 0 leaves the model where it was.
        if let Some(factor) = Cholesky::new(DMatrix::from_data(storage)) {
            let storage =
                VecStorage::new(Dyn(rank), Dyn(D), std::mem::take(&mut self.coefficients));
            let mut coefficients = DMatrix::from_data(storage);
            factor.solve_mut(&mut coefficients);
            self.coefficients = coefficients.data.into();
            self.normal = factor.unpack_dirty().data.into();
        } else {
            self.coefficients.fill(0.0);
        }
        vectorised(Apply {
            coefficients: &self.coefficients,
            kernel,
            model,
            moved,
        });
    }
}

/// `Lᵀ diag(P1) L + ridge I` (lower half) and `Lᵀ (P X − diag(P1) Y)`.
struct Assemble<'a, const D: usize> {
    step: &'a mut NonRigidStep,
    kernel: &'a KernelFactor,
    posterior: &'a Posterior<D>,
    model: &'a Columns<D>,
    ridge: f64,
}

impl<const D: usize> Loop for Assemble<'_, D> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let rank = self.kernel.rank();
        let NonRigidStep {
            coefficients,
            normal,
            ..
        } = self.step;
        let mass = &self.posterior.model_mass;
        for (m, &p) in mass.iter().enumerate() {
            let row = self.kernel.row(m);
            for d in 0..D {
                let residual = self.posterior.weighted[d][m] - p * self.model[d][m];
                add_scaled(&mut coefficients[d * rank..][..rank], row, residual);
            }
        }
        let (blocks, rest) = mass.as_chunks::<4>();
        for (block, p) in blocks.iter().enumerate() {
            let rows: [&[f64]; 4] = std::array::from_fn(|v| self.kernel.row(4 * block + v));
            for k in 0..rank {
                add_four(
                    &mut normal[k * rank..][k..rank],
                    rows.map(|row| &row[k..]),
                    p,
                );
            }
        }
        for (at, p) in rest.iter().enumerate() {
            let row = self.kernel.row(4 * blocks.len() + at);
            for k in 0..rank {
                add_scaled(&mut normal[k * rank..][k..rank], &row[k..], p * row[k]);
            }
        }
        for k in 0..rank {
            normal[k * rank + k] += self.ridge;
        }
    }
}

/// `sum += factor · row`.
#[inline(always)]
fn add_scaled(sum: &mut [f64], row: &[f64], factor: f64) {
    sum.iter_mut().zip(row).for_each(|(s, r)| *s += factor * r);
}

/// `sum += Σ_v p_v row_v[0] · row_v`: four model points at a time, to load and store the sum less often.
#[inline(always)]
fn add_four(sum: &mut [f64], rows: [&[f64]; 4], p: &[f64; 4]) {
    let [a, b, c, d] = rows.map(|row| &row[..sum.len()]);
    let [pa, pb, pc, pd] = [p[0] * a[0], p[1] * b[0], p[2] * c[0], p[3] * d[0]];
    for k in 0..sum.len() {
        sum[k] += (pa * a[k] + pb * b[k]) + (pc * c[k] + pd * d[k]);
    }
}

/// `moved = Y + L z`.
struct Apply<'a, const D: usize> {
    coefficients: &'a [f64],
    kernel: &'a KernelFactor,
    model: &'a Columns<D>,
    moved: &'a mut Columns<D>,
}

impl<const D: usize> Loop for Apply<'_, D> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let rank = self.kernel.rank();
        for d in 0..D {
            self.moved[d].copy_from_slice(&self.model[d]);
            for (k, z) in self.coefficients[d * rank..][..rank].iter().enumerate() {
                self.moved[d]
                    .iter_mut()
                    .zip(self.kernel.column(k))
                    .for_each(|(t, l)| *t += l * z);
            }
        }
    }
}
