//! Solves of a factored system, from targets to weights: Qᵀ, the factor or the spectrum, then Q.

use crate::{
    layout::HEAD,
    null_space::{MAX, dot},
    reweight::Reweighting,
    system::System,
};

impl<const D: usize> System<D> {
    /// The λ of least generalised cross-validation for the values `y`; the system must be spectral.
    pub(crate) fn cross_validate<const M: usize>(
        &self,
        y: &[f64],
        centres: usize,
        work: &mut Vec<f64>,
        spare: &mut Vec<f64>,
    ) -> Option<f64> {
        let (n, stride) = (self.active.len(), self.null.stride);
        work.clear();
        work.resize(M * stride, 0.0);
        for (m, column) in work.chunks_exact_mut(stride).enumerate() {
            self.scaled(
                &y[m * centres..(m + 1) * centres],
                &mut column[self.null.rows()],
            );
            self.null.apply_transpose(column);
        }
        self.spectrum
            .as_ref()
            .map(|spectrum| spectrum.cross_validate::<M>(work, n, spare))
    }

    /// Solves for `M` outputs: `y` holds the values at all centres and receives the weights w; returns the affine parts.
    ///
    /// `lambda` is what to add to a spectral system; a factored one has its own.
    pub(crate) fn solve<const M: usize>(
        &self,
        y: &mut [f64],
        centres: usize,
        lambda: f64,
        work: &mut Vec<f64>,
        spare: &mut Vec<f64>,
    ) -> [[f64; MAX]; M] {
        let mut heads = self.rotate::<M>(y, centres, work);
        match &self.spectrum {
            Some(spectrum) => spectrum.solve::<M>(work, lambda, spare),
            None => self.cholesky.solve::<M>(work),
        }
        self.lift(y, centres, work, &mut heads);
        heads
    }

    /// Prepares a solve with other weights by this system's spectrum; `weights` are those of the centres, all positive.
    pub(crate) fn reweighting(
        &self,
        lambda: f64,
        weights: &[f64],
        excess: &mut Vec<f64>,
    ) -> Option<Reweighting<'_>> {
        Reweighting::new(self.spectrum.as_ref()?, &self.null, lambda, weights, excess)
    }

    /// As [`solve`](Self::solve) with other weights: the affine parts and the steps taken, `None` if they did not suffice.
    pub(crate) fn resolve<const M: usize>(
        &self,
        y: &mut [f64],
        reweighting: &Reweighting<'_>,
        excess: &[f64],
        [columns, work, spare]: [&mut Vec<f64>; 3],
    ) -> Option<([[f64; MAX]; M], usize)> {
        let (centres, q, stride) = (excess.len(), self.null.q, self.null.stride);
        let mut heads = self.rotate::<M>(y, centres, columns);
        let steps = reweighting.solve::<M>(columns, excess, work, spare)?;
        for (head, column) in heads.iter_mut().zip(work.chunks_exact(stride)) {
            head.iter_mut()
                .zip(&column[HEAD - q..HEAD])
                .for_each(|(h, e)| *h -= e);
        }
        self.lift(y, centres, &mut work[..M * stride], &mut heads);
        Some((heads, steps))
    }

    /// Qᵀ W^½ y in `work`; returns its first q places, output by output.
    fn rotate<const M: usize>(
        &self,
        y: &[f64],
        centres: usize,
        work: &mut Vec<f64>,
    ) -> [[f64; MAX]; M] {
        let (q, stride) = (self.null.q, self.null.stride);
        work.clear();
        work.resize(M * stride, 0.0);
        let mut heads = [[0.0; MAX]; M];
        for (m, column) in work.chunks_exact_mut(stride).enumerate() {
            self.scaled(
                &y[m * centres..(m + 1) * centres],
                &mut column[self.null.rows()],
            );
            self.null.apply_transpose(column);
            heads[m][..q].copy_from_slice(&column[HEAD - q..HEAD]);
        }
        heads
    }

    /// Turns z in `work` into the weights w, and `heads` into the affine parts.
    fn lift<const M: usize>(
        &self,
        y: &mut [f64],
        centres: usize,
        work: &mut [f64],
        heads: &mut [[f64; MAX]; M],
    ) {
        let (n, q, stride) = (self.active.len(), self.null.q, self.null.stride);
        y.fill(0.0);
        for (m, column) in work.chunks_exact_mut(stride).enumerate() {
            column[..HEAD].fill(0.0);
            for (k, head) in heads[m].iter_mut().enumerate().take(q) {
                *head -= dot(self.coupling(k), &column[HEAD..HEAD + n - q]);
            }
            self.null.apply(column);
            self.scatter(
                &column[self.null.rows()],
                &mut y[m * centres..(m + 1) * centres],
            );
            heads[m] = self.null.solve_upper(&heads[m][..q]);
        }
    }

    /// Solves for the weights alone, with side conditions: (K + λW⁻¹)w + P a = y, Pᵀw = p for each column of `y`.
    ///
    /// With W^{-½}w = Q₁h + Q₂z the conditions give h, which moves to the right-hand side of the equations for z.
    pub(crate) fn solve_adjoint<const R: usize>(
        &self,
        y: &mut [f64],
        centres: usize,
        p: [&[f64; MAX]; R],
        work: &mut Vec<f64>,
    ) {
        let (n, q, stride) = (self.active.len(), self.null.q, self.null.stride);
        self.rotate::<R>(y, centres, work);
        let heads = p.map(|p| self.null.solve_transpose(p));
        for (column, head) in work.chunks_exact_mut(stride).zip(&heads) {
            for (k, head) in head.iter().enumerate().take(q) {
                let tail = column[HEAD..HEAD + n - q].iter_mut();
                tail.zip(self.coupling(k))
                    .for_each(|(b, coupling)| *b -= head * coupling);
            }
        }
        self.cholesky.solve::<R>(work);
        y.fill(0.0);
        for (r, column) in work.chunks_exact_mut(stride).enumerate() {
            column[..HEAD].fill(0.0);
            column[HEAD - q..HEAD].copy_from_slice(&heads[r][..q]);
            self.null.apply(column);
            self.scatter(
                &column[self.null.rows()],
                &mut y[r * centres..(r + 1) * centres],
            );
        }
    }

    /// Row `k` of Q₁ᵀSQ₂.
    pub(crate) fn coupling(&self, k: usize) -> &[f64] {
        let (n, q, stride) = (self.active.len(), self.null.q, self.null.stride);
        &self.cholesky.l[(HEAD - q + k) * stride + HEAD..][..n - q]
    }

    /// Spreads the rows, each times its scale, over the centres.
    fn scatter(&self, rows: &[f64], y: &mut [f64]) {
        let scale = |i: usize| {
            if self.scales.is_empty() {
                1.0
            } else {
                self.scales[i]
            }
        };
        self.active
            .iter()
            .enumerate()
            .for_each(|(i, &centre)| y[centre] = rows[i] * scale(i));
    }

    /// The values at the active centres, each times its scale.
    pub(crate) fn scaled(&self, y: &[f64], column: &mut [f64]) {
        self.active
            .iter()
            .zip(column.iter_mut())
            .for_each(|(&centre, value)| *value = y[centre]);
        column
            .iter_mut()
            .zip(&self.scales)
            .for_each(|(value, scale)| *value *= scale);
    }
}
