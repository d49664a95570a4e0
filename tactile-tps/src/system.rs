//! The linear system of a spline for given weights and λ, factored.

use crate::{TpsError, cholesky::Cholesky, null_space::NullSpace, sites::Sites, span::Span};

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
    /// Factors for site weights (empty: all one) and λ ≥ 0. `kernel` is the full matrix over all sites.
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
        self.null.factor(n, q.min(n), |v| span.fill(sites, active, scales, v));
        self.gather(sites.len(), kernel);
        self.null.project(&mut self.work, &mut self.scratch);
        let q = self.null.q;
        self.coupling.clear();
        (0..q).for_each(|c| self.coupling.extend_from_slice(&self.work[c * n + q..(c + 1) * n]));
        let work = &self.work;
        let fill = |l: &mut [f64]| {
            for (j, column) in l.chunks_exact_mut((n - q).max(1)).enumerate() {
                column.copy_from_slice(&work[(j + q) * n + q..(j + q + 1) * n]);
                column[j] += lambda;
            }
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

    fn gather(&mut self, sites: usize, kernel: &[f64]) {
        self.work.clear();
        for (j, &column) in self.active.iter().enumerate() {
            let column = &kernel[column * sites..(column + 1) * sites];
            if self.scales.is_empty() {
                self.work.extend(self.active.iter().map(|&i| column[i]));
            } else {
                let scaled =
                    self.active.iter().zip(&self.scales).map(|(&i, s)| column[i] * s * self.scales[j]);
                self.work.extend(scaled);
            }
        }
    }

    /// Solves for one output: `y` holds the values at all sites and receives the weights w; returns the affine part.
    pub(crate) fn solve(&self, y: &mut [f64], scratch: &mut Vec<f64>) -> [f64; 4] {
        let (n, q) = (self.active.len(), self.null.q);
        let scale = |i: usize| if self.scales.is_empty() { 1.0 } else { self.scales[i] };
        scratch.clear();
        scratch.extend(self.active.iter().enumerate().map(|(i, &site)| y[site] * scale(i)));
        self.null.apply_transpose(scratch);
        let mut head = [0.0; 4];
        head[..q].copy_from_slice(&scratch[..q]);
        self.cholesky.solve(&mut scratch[q..]);
        for (head, coupling) in head.iter_mut().zip(self.coupling.chunks_exact((n - q).max(1))) {
            *head -= coupling.iter().zip(&scratch[q..]).map(|(c, z)| c * z).sum::<f64>();
        }
        scratch[..q].fill(0.0);
        self.null.apply(scratch);
        y.fill(0.0);
        self.active.iter().enumerate().for_each(|(i, &site)| y[site] = scratch[i] * scale(i));
        self.null.solve_upper(&head[..q])
    }
}
