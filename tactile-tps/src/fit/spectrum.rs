//! The eigenvalues and eigenvectors of a symmetric matrix, with which any λ costs two products.

use faer::{
    Accum, Mat, MatMut, MatRef, Par, Spec,
    diag::DiagMut,
    linalg::{evd, matmul::matmul},
};

use super::triangle::{Triangle, memory};

/// A = V diag(μ) Vᵀ.
#[derive(Clone, Debug)]
pub(super) struct Spectrum {
    /// μ, ascending.
    pub(super) values: Vec<f64>,
    pub(super) vectors: Mat<f64>,
}

impl Default for Spectrum {
    fn default() -> Self {
        Self {
            values: Vec::new(),
            vectors: Mat::new(),
        }
    }
}

impl Spectrum {
    pub(super) fn decompose(&mut self, matrix: &mut Triangle) {
        let n = matrix.n;
        let parameters = Spec::default();
        let scratch = evd::self_adjoint_evd_scratch::<f64>(
            n,
            evd::ComputeEigenvectors::Yes,
            Par::Seq,
            parameters,
        );
        let mut stack = core::mem::take(&mut matrix.stack);
        self.values.clear();
        self.values.resize(n, 0.0);
        self.vectors.resize_with(n, n, |_, _| 0.0);
        let done = evd::self_adjoint_evd(
            matrix.view(),
            DiagMut::from_slice_mut(&mut self.values),
            Some(self.vectors.as_mut()),
            Par::Seq,
            memory(&mut stack, scratch),
            parameters,
        );
        // If the solver does not converge, which does not happen for finite symmetric matrices, the
        // spectrum counts as singular.
        if done.is_err() {
            self.values.fill(0.0);
        }
        matrix.stack = stack;
    }

    /// c = Vᵀb, column by column.
    pub(super) fn coefficients(&self, b: &[f64], c: &mut [f64]) {
        self.product(self.vectors.transpose(), b, c);
    }

    /// c = factor · b, column by column.
    pub(super) fn product(&self, factor: MatRef<'_, f64>, b: &[f64], c: &mut [f64]) {
        let n = self.values.len();
        let columns = b.len() / n;
        let b = MatRef::from_column_major_slice(b, n, columns);
        let c = MatMut::from_column_major_slice_mut(c, n, columns);
        matmul(c, Accum::Replace, factor, b, 1.0, Par::Seq);
    }

    /// b ← (A + λI)⁻¹ b, column by column.
    pub(super) fn solve(&self, b: &mut [f64], lambda: f64, spare: &mut Vec<f64>) {
        spare.clear();
        spare.resize(b.len(), 0.0);
        self.coefficients(b, spare);
        for column in spare.chunks_exact_mut(self.values.len()) {
            let pairs = column.iter_mut().zip(&self.values);
            // In the basis of eigenvectors λ is a shift of the eigenvalues, so any λ costs two
            // products.
            pairs.for_each(|(c, mu)| *c /= mu + lambda);
        }
        self.product(self.vectors.as_ref(), spare, b);
    }

    /// 2-norm condition number of A + λI. Infinite if rounding leaves eigenvalues that are not
    /// positive.
    pub(super) fn condition(&self, lambda: f64) -> f64 {
        let ends = self.values.first().zip(self.values.last());
        match ends {
            None => 1.0,
            Some((least, most)) if least + lambda > 0.0 => (most + lambda) / (least + lambda),
            Some(_) => f64::INFINITY,
        }
    }
}
