//! The dense solution of a spline's equations, its residual and its refinement.

use super::{buffers::Buffers, centres::Centres, system::System};
use crate::{
    FitReport, Kernel, StopReason,
    kernel_sum::{BLOCK, KernelSum},
    lanes::{largest, relative},
    span::Coefficients,
};

/// The equations of a spline without the targets.
pub(super) struct Equations<'a, K, const D: usize> {
    pub(super) kernel: &'a K,
    pub(super) centres: &'a Centres<D>,
    pub(super) system: &'a System<D>,
    /// λ in the units of the frame.
    pub(super) lambda: f64,
}

impl<K: Kernel, const D: usize> Equations<'_, K, D> {
    /// Solves for the targets in `buffers`, and refines the solution if the condition number is
    /// large.
    ///
    /// If `careful`, measures the residual and refines from a lower condition number on.
    pub(super) fn solve<const M: usize>(
        &self,
        buffers: &mut Buffers,
        report: &mut FitReport,
        careful: bool,
    ) -> [Coefficients; M] {
        let Buffers {
            targets,
            weights,
            work,
            spare,
            ..
        } = &mut *buffers;
        // The solver works in place, and refinement needs the targets again.
        weights.clone_from(targets);
        let mut affine = self.system.solve(weights, self.lambda, work, spare);
        report.condition = self.system.condition(self.lambda);
        (report.residual, report.refinements) = (None, 0);
        (report.iterations, report.stop) = (0, StopReason::Direct);
        let n = self.centres.len();
        // For a few points a refinement step is cheap, so the threshold is lower.
        let threshold = match careful {
            true if n <= 128 => 10.0 * n as f64,
            true => 1e6,
            false => 1e8,
        };
        if report.condition > threshold {
            self.refine(buffers, &mut affine, report);
        }
        if careful && report.refinements == 0 {
            report.residual = Some(self.sampled_residual(&affine, buffers));
        }
        affine
    }

    /// Iterative refinement with at most four steps.
    fn refine<const M: usize>(
        &self,
        buffers: &mut Buffers,
        affine: &mut [Coefficients; M],
        report: &mut FitReport,
    ) {
        let mut last = f64::INFINITY;
        for _ in 0..4 {
            report.residual = Some(self.residual(affine, buffers));
            let Buffers {
                weights,
                residuals,
                work,
                spare,
                ..
            } = &mut *buffers;
            let more: [Coefficients; M] = self.system.solve(residuals, self.lambda, work, spare);
            let step = largest(residuals) / largest(weights).max(f64::MIN_POSITIVE);
            // A step that is not shorter than half the previous one is rounding.
            if step.is_nan() || step > 0.5 * last {
                return;
            }
            let pairs = weights.iter_mut().zip(residuals.iter());
            pairs.for_each(|(w, r)| *w += r);
            let pairs = affine.iter_mut().flatten().zip(more.iter().flatten());
            pairs.for_each(|(a, d)| *a += d);
            report.refinements += 1;
            if step < 1e-8 {
                return;
            }
            last = step;
        }
    }

    /// Computes y − K w − λ W⁻¹ w − P a at the centres. Returns its largest entry relative to the
    /// largest target.
    fn residual<const M: usize>(&self, affine: &[Coefficients; M], buffers: &mut Buffers) -> f64 {
        let n = self.centres.len();
        let Buffers {
            targets,
            weights,
            residuals,
            ..
        } = buffers;
        residuals.clone_from(targets);
        let sum = self.sum::<M>(weights);
        let places = sum.centres;
        sum.subtract(places, 0..n, residuals);
        let mut size = 0.0;
        for (i, &centre) in self.system.active.iter().enumerate() {
            for m in 0..M {
                let residual = &mut residuals[m * n + centre];
                *residual -= self.rest(&affine[m], &weights[m * n..], i);
                size = f64::max(size, residual.abs());
            }
        }
        relative(size, targets)
    }

    /// The largest residual at up to one block of evenly distributed centres.
    fn sampled_residual<const M: usize>(
        &self,
        affine: &[Coefficients; M],
        buffers: &mut Buffers,
    ) -> f64 {
        let (n, active) = (self.centres.len(), &self.system.active);
        let count = active.len().min(BLOCK);
        // All residuals would cost O(n²), as much as the solve. One block costs O(n).
        let pick = |i: usize| i * active.len() / count;
        let Buffers {
            targets,
            weights,
            residuals,
            ..
        } = buffers;
        residuals.clear();
        residuals.resize(M * count, 0.0);
        let mut places = [[0.0; BLOCK]; D];
        for (k, axis) in places.iter_mut().enumerate() {
            (0..count).for_each(|i| axis[i] = self.centres.axes[k][active[pick(i)]]);
        }
        let places = places.each_ref().map(|axis| &axis[..count]);
        self.sum::<M>(weights).subtract(places, 0..count, residuals);
        let mut size = 0.0;
        for i in 0..count {
            for m in 0..M {
                let target = targets[m * n + active[pick(i)]];
                let rest = self.rest(&affine[m], &weights[m * n..], pick(i));
                size = f64::max(size, (target - rest + residuals[m * count + i]).abs());
            }
        }
        relative(size, targets)
    }

    /// λ W⁻¹ w + P a at an active centre.
    fn rest(&self, affine: &Coefficients, weights: &[f64], i: usize) -> f64 {
        let centre = self.system.active[i];
        let scale = self.system.scales.get(i).copied().unwrap_or(1.0);
        let point = core::array::from_fn(|k| self.centres.axes[k][centre]);
        let smooth = self.lambda * (weights[centre] / scale / scale);
        smooth + self.system.span.polynomial(affine, &point)
    }

    fn sum<'b, const M: usize>(&'b self, weights: &'b [f64]) -> KernelSum<'b, K, D, M> {
        let n = self.centres.len();
        KernelSum {
            kernel: self.kernel,
            centres: self.centres.axes.each_ref().map(|axis| &axis[..]),
            weights: core::array::from_fn(|m| &weights[m * n..(m + 1) * n]),
        }
    }
}
