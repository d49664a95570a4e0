//! Weights and targets of the distinct centres: merged where points coincide, where targets must agree.

use nalgebra::Point;

use crate::{Scalar, TpsError, centres::Centres, equations::Buffers};

impl<const D: usize> Centres<D> {
    /// Coinciding points must have equal targets where the spline interpolates.
    pub(crate) fn agree<T: Scalar, const M: usize>(
        &self,
        targets: &[Point<T, M>],
        weights: Option<&[T]>,
    ) -> Result<(), TpsError> {
        let counts = |i: usize| weights.is_none_or(|w| w[i] > T::zero());
        for second in (0..self.centre_of.len()).filter(|&i| counts(i)) {
            let centre = self.centre_of[second];
            let same = |&i: &usize| self.centre_of[i] == centre && counts(i);
            let first = (self.first[centre]..second).find(same).unwrap_or(second);
            if targets[first] != targets[second] {
                return Err(TpsError::Conflict { first, second });
            }
        }
        Ok(())
    }

    /// Values at the centres less `origin`: the targets, or their weighted mean where points coincide.
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
            if self.centre_of.is_empty() {
                column
                    .iter_mut()
                    .zip(targets)
                    .for_each(|(v, t)| *v = t[k].widen() - origin[k]);
                continue;
            }
            let totals = &mut buffers.work;
            totals.clear();
            totals.resize(n, 0.0);
            for (target, (i, &centre)) in targets.iter().zip(self.centre_of.iter().enumerate()) {
                let weight = weights.map_or(1.0, |w| w[i].widen());
                totals[centre] += weight;
                if weight > 0.0 {
                    column[centre] += (target[k].widen() - origin[k] - column[centre])
                        * (weight / totals[centre]);
                }
            }
        }
    }

    /// Weight of every centre, none if all are one.
    pub(crate) fn weigh<T: Scalar>(&self, weights: Option<&[T]>, sums: &mut Vec<f64>) {
        sums.clear();
        if weights.is_none() && self.centre_of.is_empty() {
            return;
        }
        sums.resize(self.len(), 0.0);
        for i in 0..self.inputs() {
            sums[self.centre(i)] += weights.map_or(1.0, |w| w[i].widen());
        }
    }
}
