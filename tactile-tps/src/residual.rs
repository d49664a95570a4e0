//! Residuals of the spline's equations: at all centres, or at a sample of them.

use crate::{
    Kernel,
    equations::{Buffers, Equations},
    evaluate::{BLOCK, Sum},
    null_space::MAX,
    product::Subtract,
    simd::dispatch,
};

impl<K: Kernel, const D: usize> Equations<'_, K, D> {
    /// y − K w − λ W⁻¹ w − P a at the centres, and its largest entry relative to the largest target.
    pub(crate) fn residual<const M: usize>(
        &self,
        affine: &[[f64; MAX]; M],
        buffers: &mut Buffers,
    ) -> f64 {
        let n = self.centres.len();
        let Buffers {
            targets,
            weights,
            residuals,
            ..
        } = buffers;
        residuals.clone_from(targets);
        let sum = self.sum::<M>(weights);
        dispatch(Subtract {
            places: sum.centres,
            range: 0..n,
            sum,
            residuals,
        });
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

    /// The largest residual at up to one block of centres, spread evenly.
    pub(crate) fn sampled_residual<const M: usize>(
        &self,
        affine: &[[f64; MAX]; M],
        buffers: &mut Buffers,
    ) -> f64 {
        let (n, active) = (self.centres.len(), &self.system.active);
        let count = active.len().min(BLOCK);
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
        let sum = self.sum::<M>(weights);
        dispatch(Subtract {
            sum,
            places: places.each_ref().map(|axis| &axis[..count]),
            range: 0..count,
            residuals,
        });
        let mut size = 0.0;
        for i in 0..count {
            for m in 0..M {
                let known = targets[m * n + active[pick(i)]]
                    - self.rest(&affine[m], &weights[m * n..], pick(i));
                size = f64::max(size, (known + residuals[m * count + i]).abs());
            }
        }
        relative(size, targets)
    }

    /// λ W⁻¹ w + P a at an active centre.
    fn rest(&self, affine: &[f64; MAX], weights: &[f64], i: usize) -> f64 {
        let (centre, scale) = (
            self.system.active[i],
            self.system.scales.get(i).copied().unwrap_or(1.0),
        );
        let smooth = self.lambda * (weights[centre] / scale / scale);
        smooth
            + self
                .system
                .span
                .polynomial(affine, |k| self.centres.axes[k][centre])
    }

    fn sum<'b, const M: usize>(&'b self, weights: &'b [f64]) -> Sum<'b, f64, K, D, M> {
        let n = self.centres.len();
        Sum {
            kernel: self.kernel,
            centres: core::array::from_fn(|k| &self.centres.axes[k][..]),
            weights: core::array::from_fn(|m| &weights[m * n..(m + 1) * n]),
        }
    }
}

/// The size relative to the largest target.
pub(crate) fn relative(size: f64, targets: &[f64]) -> f64 {
    let target = largest(targets);
    if target > 0.0 { size / target } else { size }
}

/// Largest magnitude.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, x| f64::max(m, x.abs()))
}
