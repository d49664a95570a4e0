//! The linear system of a spline for given weights and λ, factored.

use crate::{
    TpsError,
    cholesky::{Cholesky, padded},
    null_space::{MAX, NullSpace, dot},
    sites::Sites,
    span::Span,
};

/// QᵀSQ factored, S = W^½ K W^½ + λI over the sites of positive weight.
///
/// With v = W^{-½}w the equations K w + λ W⁻¹ w + P a = y, Pᵀw = 0 become S v + W^½P a = W^½y, (W^½P)ᵀv = 0: row
/// scaling that keeps weights over many decades apart.
#[derive(Clone, Debug, Default)]
pub(crate) struct System {
    /// λ in the frame's units.
    pub(crate) lambda: f64,
    /// Sites of positive weight.
    pub(crate) active: Vec<usize>,
    /// √weight of each; empty if all are one.
    pub(crate) scales: Vec<f64>,
    pub(crate) null: NullSpace,
    pub(crate) cholesky: Cholesky,
    /// First q columns of QᵀSQ, the rows below q.
    coupling: Vec<f64>,
    pub(crate) condition: f64,
    work: Vec<f64>,
    scratch: Vec<f64>,
}

impl System {
    /// Factors for site weights (empty: all one) and λ ≥ 0. `kernel` is the lower triangle over all sites.
    pub(crate) fn factor<const D: usize>(
        &mut self,
        sites: &Sites<D>,
        span: &Span<D>,
        kernel: &[f64],
        weights: &[f64],
        lambda: f64,
    ) -> Result<(), TpsError> {
        self.lambda = lambda;
        self.choose(sites.len(), weights);
        let (n, q) = (self.active.len(), 1 + span.directions);
        let (active, scales) = (&self.active, &self.scales);
        self.null.factor(n, q.min(n), |c, column| span.fill(sites, active, scales, c, column));
        let plain = self.scales.is_empty() && n == sites.len();
        if !plain {
            self.gather(kernel, padded(sites.len()));
        }
        let (q, work) = (self.null.q, if plain { kernel } else { &self.work });
        self.coupling.clear();
        self.coupling.resize(q * (n - q), 0.0);
        let Self { null, coupling, scratch, .. } = self;
        let fill = |rest: &mut [f64], stride: usize| {
            null.project(work, coupling, (rest, stride), scratch);
            (0..n - q).for_each(|j| rest[j * stride + j] += lambda);
        };
        self.cholesky.factor(n - q, fill).map_err(|column| TpsError::NotDefinite { column })?;
        self.condition = self.cholesky.condition(&mut self.scratch);
        Ok(())
    }

    /// Sites of positive weight, heaviest first so that the reflectors keep light rows apart.
    fn choose(&mut self, n: usize, weights: &[f64]) {
        self.active.clear();
        self.scales.clear();
        if weights.is_empty() {
            self.active.extend(0..n);
            return;
        }
        self.active.extend((0..n).filter(|&i| weights[i] > 0.0));
        if self.lambda > 0.0 {
            self.active.sort_by(|&i, &j| weights[j].total_cmp(&weights[i]));
            self.scales.extend(self.active.iter().map(|&i| weights[i].sqrt()));
        }
    }

    /// Lower triangle of the kernel matrix over the active sites, scaled.
    fn gather(&mut self, kernel: &[f64], from: usize) {
        let n = self.active.len();
        let stride = padded(n);
        self.work.clear();
        self.work.resize(n * stride, 0.0);
        for (j, column) in self.work.chunks_exact_mut(stride).enumerate() {
            let own = self.active[j];
            for (value, &i) in column[j..n].iter_mut().zip(&self.active[j..]) {
                *value = kernel[own.min(i) * from + own.max(i)];
            }
            if !self.scales.is_empty() {
                let scale = self.scales[j];
                column[j..n].iter_mut().zip(&self.scales[j..]).for_each(|(value, s)| *value *= s * scale);
            }
        }
    }

    /// Solves for `M` outputs: `y` holds the values at the `sites` and receives the weights w; returns the affine parts.
    pub(crate) fn solve<const M: usize>(
        &self,
        y: &mut [f64],
        sites: usize,
        work: &mut Vec<f64>,
    ) -> [[f64; MAX]; M] {
        let (n, q, rows, stride) = (self.active.len(), self.null.q, self.cholesky.rows(), self.null.stride);
        work.clear();
        work.resize(M * rows + stride, 0.0);
        let (inner, column) = work.split_at_mut(M * rows);
        let mut heads = [[0.0; MAX]; M];
        for (m, head) in heads.iter_mut().enumerate() {
            self.scaled(&y[m * sites..(m + 1) * sites], column);
            self.null.apply_transpose(column);
            head[..q].copy_from_slice(&column[..q]);
            inner[m * rows..m * rows + n - q].copy_from_slice(&column[q..n]);
        }
        self.cholesky.solve::<M>(inner);
        y.fill(0.0);
        for (m, head) in heads.iter_mut().enumerate() {
            let z = &inner[m * rows..m * rows + n - q];
            for (head, coupling) in head.iter_mut().zip(self.coupling.chunks_exact((n - q).max(1))) {
                *head -= dot(coupling, z);
            }
            column.fill(0.0);
            column[q..n].copy_from_slice(z);
            self.null.apply(column);
            let scale = |i: usize| if self.scales.is_empty() { 1.0 } else { self.scales[i] };
            self.active.iter().enumerate().for_each(|(i, &site)| y[m * sites + site] = column[i] * scale(i));
            *head = self.null.solve_upper(&head[..q]);
        }
        heads
    }

    /// The values at the active sites, each times its scale.
    fn scaled(&self, y: &[f64], column: &mut [f64]) {
        column.fill(0.0);
        self.active.iter().zip(column.iter_mut()).for_each(|(&site, value)| *value = y[site]);
        column.iter_mut().zip(&self.scales).for_each(|(value, scale)| *value *= scale);
    }
}
