//! What the input points bring to their sites: weights, and targets that must agree where points coincide.

use nalgebra::Point;

use crate::{Scalar, TpsError, refine::Buffers, sites::Sites};

impl<const D: usize> Sites<D> {
    /// Coinciding points must have equal targets where the spline interpolates.
    pub(crate) fn agree<T: Scalar, const M: usize>(
        &self,
        targets: &[Point<T, M>],
        weights: Option<&[T]>,
    ) -> Result<(), TpsError> {
        let counts = |i: usize| weights.is_none_or(|w| w[i] > T::zero());
        for second in (0..self.site_of.len()).filter(|&i| counts(i)) {
            let site = self.site_of[second];
            let same = |&i: &usize| self.site_of[i] == site && counts(i);
            let first = (self.first[site]..second).find(same).unwrap_or(second);
            if targets[first] != targets[second] {
                return Err(TpsError::Conflict { first, second });
            }
        }
        Ok(())
    }

    /// Values at the sites less `origin`: the targets, or their weighted mean where points coincide.
    pub(crate) fn gather<T: Scalar, const M: usize>(
        &self,
        targets: &[Point<T, M>],
        weights: Option<&[T]>,
        origin: &[f64; M],
        buffers: &mut Buffers,
    ) {
        let n = self.len();
        buffers.targets.clear();
        buffers.targets.resize(n * M, 0.0);
        for (k, column) in buffers.targets.chunks_exact_mut(n).enumerate() {
            if self.site_of.is_empty() {
                column
                    .iter_mut()
                    .zip(targets)
                    .for_each(|(v, t)| *v = t[k].widen() - origin[k]);
                continue;
            }
            let totals = &mut buffers.work;
            totals.clear();
            totals.resize(n, 0.0);
            for (target, (i, &site)) in targets.iter().zip(self.site_of.iter().enumerate()) {
                let weight = weights.map_or(1.0, |w| w[i].widen());
                totals[site] += weight;
                if weight > 0.0 {
                    column[site] +=
                        (target[k].widen() - origin[k] - column[site]) * (weight / totals[site]);
                }
            }
        }
    }

    /// Weight of every site, none if all are one.
    pub(crate) fn weigh<T: Scalar>(&self, weights: Option<&[T]>, sums: &mut Vec<f64>) {
        sums.clear();
        if weights.is_none() && self.site_of.is_empty() {
            return;
        }
        sums.resize(self.len(), 0.0);
        for i in 0..self.inputs() {
            sums[self.site(i)] += weights.map_or(1.0, |w| w[i].widen());
        }
    }
}
