//! Twins of an answer: the model turned or mirrored, where that explains the targets better.

use super::confidence::MIN_SIGMA;
use super::search::{ENERGY_RESOLUTION, FAST, bounding_volume};
use super::{AnnealedSoftassign, Cooling, Rotation, SoftassignWorkspace, mean, starts};
use crate::Doubt;
use nalgebra::{SMatrix, SVector};
use std::ops::ControlFlow;

// A jittered grid that was turned by a quarter has a match near by with every point, which leaves
// residuals of the jitter. Nothing in that match alone tells it from noise. So every turn and
// mirror image S that takes the model nearly onto itself is looked at: point i goes where the
// answer w has the model point k next to S pᵢ, at `w_k + A (S pᵢ − p_k)` with the affine part A
// of w. If that lies nearer to the targets than w does, the run from there decides by its energy.

/// Model points that show how far a turned model lies from the targets.
const SAMPLE: usize = 200;
/// A turned grid has a model point so near to each of its points, in spacings. Of random points
/// half have.
const NEAR: f64 = 0.5;
/// Answers that leave less than this, in spacings, are not looked at: a jitter that small does not
/// show in the strain.
const RESOLVED: f64 = 0.01;
/// A start is worth a run where it leaves less than this share of the answer's distances.
const NEARER: f64 = 0.9;

/// As the first run, but no colder than the residuals.
const FOLLOW: Cooling = Cooling {
    least: 1.0,
    patience: 12,
    stuck: 12,
    ..FAST
};

/// The reflection at the first axis.
fn mirror<const D: usize>() -> SMatrix<f64, D, D> {
    let mut mirror = SMatrix::identity();
    mirror[(0, 0)] = -1.0;
    mirror
}

impl AnnealedSoftassign {
    /// Looks for a better answer among the turned and mirrored models. A turned one takes the
    /// answer's place where any rotation is allowed. What else is better is left in `ws.twin`.
    pub(super) fn look_for_twins<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        if ws.model.len().min(ws.target.len()) < 4 * D || ws.best.trace.is_empty() {
            return; // any few points have many nearly equal partners
        }
        let spacing = ws.mean_spacing();
        if ws.best.sigma < RESOLVED * spacing {
            return;
        }
        let linear = ws.prepare_twins(spacing);
        let own = ws.distance_after(&SMatrix::identity(), &linear, spacing, NEAR);
        let Some(own) = own.filter(|&own| own > RESOLVED * spacing) else {
            return;
        };
        for reflection in [SMatrix::identity(), mirror()] {
            let linear = ws.linear_part(); // of the answer, which a turned model may have replaced
            let mut best = (NEARER * own, None);
            for turn in starts::rotations::<D>(Rotation::Any).map(|turn| turn * reflection) {
                let found = ws.distance_after(&turn, &linear, spacing, NEAR);
                if let Some(distance) = found.filter(|&distance| distance < best.0) {
                    best = (distance, Some(turn));
                }
            }
            let Some(turn) = best.1 else { continue };
            ws.start_from_twin(&turn, &linear);
            // Warmer, points would leave the partners that they begin with.
            self.compare_twin(ws, 0.3 * spacing, &turn);
        }
    }

    /// Runs from `ws.state` and compares with the answer.
    fn compare_twin<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        sigma: f64,
        turn: &SMatrix<f64, D, D>,
    ) {
        if ws.annealer.rigid.is_active() {
            let turned = |p: &[f64; D]| <[f64; D]>::from(turn * SVector::from(*p));
            ws.state.base.clear();
            ws.state.base.extend(ws.model.iter().map(turned));
            ws.annealer.rigid.set(self.transformation, &ws.state.base);
        }
        // There is no observer that could stop it.
        let silent = &mut |_, _| ControlFlow::Continue(());
        let _ = self.anneal_only(ws, Cooling { sigma, ..FOLLOW }, silent);
        ws.state.tail = ws.annealer.tail(0.1 * ws.spacing);
        let energy = ws.best.energy;
        for state in [&mut ws.state, &mut ws.best] {
            ws.annealer.evaluate(state, self.share, MIN_SIGMA, 1.0);
        }
        let gain = ws.best.energy - ws.state.energy;
        ws.best.energy = energy;
        // Odds of e⁵ and of a twentieth of a unit a point: chance gives less.
        let least = 5.0 + 0.05 * ws.model.len() as f64;
        if gain > ws.twin.map_or(least, |(last, _)| last) {
            let mirrored = starts::volume(turn) < 0.0;
            ws.twin = match (mirrored, self.rotation) {
                (true, _) => Some((gain, Doubt::Mirrored)),
                (false, Rotation::Limited) => Some((gain, Doubt::Turned)),
                (false, Rotation::Any) => {
                    let state = &mut ws.state;
                    ws.annealer
                        .evaluate(state, self.share, ENERGY_RESOLUTION, 1.0);
                    ws.best.copy_from(state);
                    None
                }
            };
        }
        ws.annealer.rigid.set(self.transformation, &ws.model);
    }
}

impl<const D: usize> SoftassignWorkspace<D> {
    /// Distance between neighbours of a model that fills its bounding box.
    fn mean_spacing(&self) -> f64 {
        (bounding_volume(&self.model) / self.model.len() as f64).powf(1.0 / D as f64)
    }

    /// Whether a turn takes the model onto itself, by what the answer resolves, and lies as near to
    /// the targets. Then the answer may be turned as well.
    pub(super) fn is_symmetric(&mut self) -> bool {
        let spacing = self.mean_spacing();
        let reach = (3.0 * self.best.sigma).min(0.25 * spacing) / spacing;
        let linear = self.prepare_twins(spacing);
        let Some(own) = self.distance_after(&SMatrix::identity(), &linear, spacing, reach) else {
            return false;
        };
        starts::rotations::<D>(Rotation::Any).skip(1).any(|turn| {
            let distance = self.distance_after(&turn, &linear, spacing, reach);
            // Medians of so many distances vary by a tenth. Below a hundredth is rounding.
            distance.is_some_and(|distance| distance <= 1.3 * own + 0.01 * spacing)
        })
    }

    /// Puts model and targets where they are looked up. Returns the affine part of the answer.
    fn prepare_twins(&mut self, spacing: f64) -> SMatrix<f64, D, D> {
        self.patterns.model.build(&self.model, spacing);
        self.patterns.targets.build(&self.target, spacing);
        self.linear_part()
    }

    /// Median distance to the targets of the sample, turned. None where more than one point in
    /// twenty, or five for a reach of half a spacing, has no model point within reach then.
    fn distance_after(
        &mut self,
        turn: &SMatrix<f64, D, D>,
        linear: &SMatrix<f64, D, D>,
        spacing: f64,
        reach: f64,
    ) -> Option<f64> {
        let step = self.model.len().div_ceil(SAMPLE);
        let share = if reach < NEAR { 20 } else { 5 };
        let mut misses = self.model.len() / step / share;
        let distances = &mut self.annealer.sums;
        distances.clear();
        for p in self.model.iter().step_by(step) {
            let turned = turn * SVector::from(*p);
            let near = self.patterns.model.nearest(&turned.into(), reach * spacing);
            let Some(k) = near else {
                misses = misses.checked_sub(1)?;
                continue;
            };
            let place = SVector::from(self.best.warped[k])
                + linear * (turned - SVector::from(self.model[k]));
            let found = self.patterns.targets.nearest(&place.into(), spacing);
            distances
                .push(found.map_or(spacing, |j| (SVector::from(self.target[j]) - place).norm()));
        }
        let middle = distances.len() / 2;
        Some(*distances.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    /// Affine part of the answer.
    fn linear_part(&self) -> SMatrix<f64, D, D> {
        let (from, to) = (mean(&self.model), mean(&self.best.warped));
        let mut gram = SMatrix::<f64, D, D>::identity() * 1e-9;
        let mut cross = SMatrix::<f64, D, D>::zeros();
        for (p, w) in self.model.iter().zip(&self.best.warped) {
            let p = SVector::from(*p) - SVector::from(from);
            let w = SVector::from(*w) - SVector::from(to);
            gram += p * p.transpose();
            cross += w * p.transpose();
        }
        cross * gram.try_inverse().unwrap_or_else(SMatrix::zeros)
    }

    /// Puts `state` where the answer has the turned model.
    fn start_from_twin(&mut self, turn: &SMatrix<f64, D, D>, linear: &SMatrix<f64, D, D>) {
        let spacing = self.mean_spacing();
        let to = SVector::from(mean(&self.best.warped));
        let state = &mut self.state;
        state.base.clear();
        state.warped.clear();
        for p in &self.model {
            let turned = turn * SVector::from(*p);
            let base = linear * turned + to;
            state.base.push(base.into());
            let near = self.patterns.model.nearest(&turned.into(), spacing);
            state.warped.push(near.map_or(base.into(), |k| {
                let offset = linear * (turned - SVector::from(self.model[k]));
                (SVector::from(self.best.warped[k]) + offset).into()
            }));
        }
    }
}
