//! Distinct points in their frame.

use nalgebra::Point;

use super::buffers::Buffers;
use crate::{TpsError, error::finite, frame::Frame};

/// Distinct points in their frame, and the centre of each input point.
#[derive(Clone, Debug)]
pub(super) struct Centres<const D: usize> {
    pub(super) frame: Frame<D>,
    /// Coordinates in the frame, by axes.
    pub(super) axes: [Vec<f64>; D],
    /// First input point of each centre, ascending.
    pub(super) first: Vec<usize>,
    /// Centre of each input point. Empty if all points are distinct.
    pub(super) centre_of: Vec<usize>,
    /// Rounding error of the coordinates, relative to the frame.
    pub(super) grain: f64,
    pub(super) inputs: usize,
    /// The input points sorted by their coordinates.
    pub(super) order: Vec<usize>,
}

impl<const D: usize> Default for Centres<D> {
    fn default() -> Self {
        Self {
            frame: Frame::default(),
            axes: [const { Vec::new() }; D],
            first: Vec::new(),
            centre_of: Vec::new(),
            grain: 0.0,
            inputs: 0,
            order: Vec::new(),
        }
    }
}

impl<const D: usize> Centres<D> {
    /// Stores points, reusing memory if possible.
    pub(super) fn take(&mut self, points: &[Point<f64, D>], rescale: bool) -> Result<(), TpsError> {
        if points.is_empty() {
            return Err(TpsError::Empty("source points"));
        }
        finite(points, "source points")?;
        // The frame comes first, because grain and coordinates are relative to it.
        self.frame = Frame::around(points, rescale);
        self.merge(points);
        for (k, axis) in self.axes.iter_mut().enumerate() {
            axis.clear();
            axis.extend(self.first.iter().map(|&i| self.frame.inside(&points[i])[k]));
        }
        self.grain = self.frame.grain(points);
        self.inputs = points.len();
        Ok(())
    }

    /// Finds the first point of each group of equal points, and the group of each point.
    pub(super) fn merge(&mut self, points: &[Point<f64, D>]) {
        let Self {
            first,
            centre_of,
            order,
            ..
        } = self;
        for list in [&mut *first, &mut *order] {
            list.clear();
            list.extend(0..points.len());
        }
        centre_of.clear();
        let compare = |&i: &usize, &j: &usize| {
            let differ = (0..D).map(|k| points[i][k].partial_cmp(&points[j][k]));
            differ.flatten().find(|o| o.is_ne()).unwrap_or(i.cmp(&j))
        };
        // After sorting by coordinates, equal points are adjacent, with the first one in front.
        order.sort_unstable_by(compare);
        if order.windows(2).all(|w| points[w[0]] != points[w[1]]) {
            return;
        }
        // First the index of each group's first point, then the number of the group.
        centre_of.extend(0..points.len());
        for pair in order.windows(2) {
            if points[pair[0]] == points[pair[1]] {
                centre_of[pair[1]] = centre_of[pair[0]];
            }
        }
        first.retain(|&i| centre_of[i] == i);
        for leader in centre_of {
            *leader = first.partition_point(|&i| i < *leader);
        }
    }

    /// Replaces `local` by only these centres, in the same frame.
    pub(super) fn select(&self, centres: impl Iterator<Item = usize> + Clone, local: &mut Self) {
        for (axis, all) in local.axes.iter_mut().zip(&self.axes) {
            axis.clear();
            axis.extend(centres.clone().map(|i| all[i]));
        }
        local.first.clear();
        local.first.extend(centres.map(|i| self.first[i]));
    }

    /// Number of distinct points.
    pub(super) fn len(&self) -> usize {
        self.first.len()
    }

    /// Centre of input point `i`.
    pub(super) fn centre(&self, i: usize) -> usize {
        self.centre_of.get(i).copied().unwrap_or(i)
    }

    /// Checks that coincident points have equal targets if the spline interpolates.
    pub(super) fn agree<const M: usize>(
        &self,
        targets: &[Point<f64, M>],
        weights: Option<&[f64]>,
    ) -> Result<(), TpsError> {
        let counts = |i: usize| weights.is_none_or(|w| w[i] > 0.0);
        for second in (0..self.centre_of.len()).filter(|&i| counts(i)) {
            let centre = self.centre_of[second];
            let same = |&i: &usize| self.centre_of[i] == centre && counts(i);
            // Points of weight 0 are skipped. They may disagree with the others.
            let first = (self.first[centre]..second).find(same).unwrap_or(second);
            if targets[first] != targets[second] {
                return Err(TpsError::Conflict { first, second });
            }
        }
        Ok(())
    }

    /// Targets at the centres minus `origin`, by outputs. For coincident points it is the weighted
    /// mean.
    pub(super) fn gather<const M: usize>(
        &self,
        targets: &[Point<f64, M>],
        weights: Option<&[f64]>,
        origin: &[f64; M],
        buffers: &mut Buffers,
    ) {
        let n = self.len();
        buffers.targets.clear();
        buffers.targets.resize(n * M, 0.0);
        for (k, column) in buffers.targets.chunks_exact_mut(n).enumerate() {
            let totals = &mut buffers.work;
            totals.clear();
            totals.resize(n, 0.0);
            for (i, target) in targets.iter().enumerate() {
                let (centre, weight) = (self.centre(i), weights.map_or(1.0, |w| w[i]));
                let value = target[k] - origin[k];
                totals[centre] += weight;
                // All preceding points have weight 0, so their targets are ignored.
                if totals[centre] == weight {
                    column[centre] = value;
                } else if weight > 0.0 {
                    column[centre] += (value - column[centre]) * (weight / totals[centre]);
                }
            }
        }
    }

    /// Weight of each centre. Empty if all are one.
    pub(super) fn weigh(&self, weights: Option<&[f64]>, sums: &mut Vec<f64>) {
        sums.clear();
        if weights.is_none() && self.centre_of.is_empty() {
            return;
        }
        sums.resize(self.len(), 0.0);
        for i in 0..self.inputs {
            sums[self.centre(i)] += weights.map_or(1.0, |w| w[i]);
        }
    }
}
