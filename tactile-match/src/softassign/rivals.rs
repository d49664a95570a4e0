//! Rivals of an answer: the model rotated, mirrored or shifted by a step of its lattice.

use super::run::{Cooling, State};
use super::search::{FAST, bounding_volume};
use super::{AnnealedSoftassign, Mechanism, Rotation, SoftassignWorkspace};
use super::{difference, mean, squared, squared_distance, starts};
use crate::{Doubt, Watch};
use nalgebra::{SMatrix, SVector};
use std::ops::ControlFlow;

// If a jittered grid is rotated by a quarter turn, each point has a nearby partner, with the jitter
// as residual. Such a match cannot be distinguished from a noisy one by itself. Similarly, a
// lattice that continues outside the view has as many answers as steps. So each map S (a rotation,
// a mirror image, a step) that maps the model nearly onto itself is examined: point i moves to the
// warped position of the model point k nearest to S pᵢ, at `w_k + A (S pᵢ − p_k)` with the affine
// part A of the warp w. If the result lies nearer to the targets than w does, or equally near with
// less motion, a run from there decides by its energy. A rival that fits equally well and cannot be
// excluded becomes a named doubt.

/// Number of model points that measure the distance of a rotated model from the targets.
const SAMPLE: usize = 200;
/// Maximum distance, in spacings, from the points of a rotated grid to the nearest model points.
/// Half of all random points meet it.
const NEAR: f64 = 0.5;
/// Corresponding distance for a lattice step.
const NEAR_STEP: f64 = 0.25;
/// Answers with residuals below this, in spacings, have no rivals to examine: so small a jitter
/// does not affect the strain.
const RESOLVED: f64 = 0.01;
/// A start is run if its distances are less than this fraction of those of the answer.
const NEARER: f64 = 0.9;
/// Corresponding fraction for a rotation or mirror image that is not allowed. If the model is its
/// own image up to noise, chance alone often gives nine tenths.
const CLEARLY_NEARER: f64 = 0.75;
/// Minimum gain of an allowed rotation: odds of e⁵, plus a twentieth of a log unit per point.
const CLEAR_GAIN: [f64; 2] = [5.0, 0.05];
/// Minimum gain of a rotation that is not allowed, beyond e⁵, in square roots of the number of
/// coordinates: the noise of either answer varies by one of them.
const CLEAR_CHANCE: f64 = 4.0;
/// A lattice step fits the targets equally well if its distances are below this multiple of those
/// without it, plus [`ROUNDING`].
const AS_NEAR: f64 = 1.5;
/// Allowance for rounding in spacings.
const ROUNDING: f64 = 0.02;
/// Points closer than this, in spacings, are not one step apart.
const SHORTEST_STEP: f64 = 0.6;
/// Steps up to this multiple of the shortest are examined, which includes the diagonal of a square.
const LONGEST_STEP: f64 = 1.6;
/// A rival whose motion exceeds this multiple is out of reach: the points moved by less than a
/// sixth of a step, or by more than five sixths the other way.
const REACH: f64 = 5.0;
/// Two sets hold the same points, rather than two views of more, if at least this fraction is
/// matched
const COMPLETE: f64 = 0.995;
/// and their bounding box has changed: by more than this fraction of a step and this number of
/// standard deviations of the noise.
const SAME_BOX: [f64; 2] = [0.25, 4.0];

/// Like the first run, but never below the temperature of the residuals.
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
    /// Searches for a better answer among the rotated, mirrored and shifted models. An allowed
    /// rival replaces the answer. Others that are better or equally good are stored in `ws.twin`
    /// and `ws.repeats`.
    pub(super) fn look_for_rivals<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        let few = ws.model.len().min(ws.target.len()) < 4 * D;
        if few || ws.best.trace.is_empty() || !self.has(Mechanism::Rivals) {
            return ControlFlow::Continue(()); // any few points have many nearly equal partners
        }
        let spacing = ws.mean_spacing();
        ws.put_where_looked_up(spacing);
        if ws.best.sigma >= RESOLVED * spacing {
            self.look_for_turns(ws, spacing, watch)?;
        }
        if ws.twin.is_none() {
            self.look_for_steps(ws, spacing, watch)?;
        }
        ControlFlow::Continue(())
    }

    /// Searches for a better answer among the rotated and mirrored models.
    fn look_for_turns<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        spacing: f64,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        let still = Moved::by_turn(SMatrix::identity());
        let own = ws.distance_after(&still, &ws.linear_part(), spacing, NEAR);
        let Some(own) = own.filter(|&own| own > RESOLVED * spacing) else {
            return ControlFlow::Continue(());
        };
        for (mirrored, reflection) in [(false, SMatrix::identity()), (true, mirror())] {
            let linear = ws.linear_part(); // of the answer, which a rotated model may have replaced
            let allowed = self.rotation == Rotation::Any && !mirrored;
            let nearer = if allowed { NEARER } else { CLEARLY_NEARER };
            let mut best = (nearer * own, None);
            for turn in starts::rotations::<D>(Rotation::Any).map(|turn| turn * reflection) {
                let moved = Moved::by_turn(turn);
                let found = ws.distance_after(&moved, &linear, spacing, NEAR);
                if let Some(distance) = found.filter(|&distance| distance < best.0) {
                    best = (distance, Some(moved));
                }
            }
            let Some(moved) = best.1 else { continue };
            ws.start_from(&moved, &linear);
            // At a higher temperature points would leave their first partners.
            let gain = self.run_rival(ws, 0.3 * spacing, &moved, watch)?;
            let points = ws.model.len() as f64;
            let chance = if allowed {
                CLEAR_GAIN[1] * points
            } else {
                CLEAR_CHANCE * (D as f64 * points).sqrt()
            };
            let least = CLEAR_GAIN[0] + chance;
            if gain > ws.twin.map_or(least, |(last, _)| last) {
                ws.twin = match (mirrored, allowed) {
                    (true, _) => Some((gain, Doubt::Mirrored)),
                    (false, false) => Some((gain, Doubt::Turned)),
                    (false, true) => {
                        self.accept(ws);
                        None
                    }
                };
            }
        }
        ControlFlow::Continue(())
    }

    /// Searches for lattice steps: the answer of least motion replaces one that fits the targets no
    /// better. Stores in `ws.repeats` a step that fits equally well and is within reach.
    fn look_for_steps<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        spacing: f64,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        ws.find_steps(spacing);
        // Each round shifts the answer by one step towards the unmoved model.
        for _ in 0..4 {
            let linear = ws.linear_part();
            let still = Moved::by_turn(SMatrix::identity());
            let Some(own) = ws.distance_after(&still, &linear, spacing, NEAR_STEP) else {
                break;
            };
            let most = AS_NEAR * own + ROUNDING * spacing;
            let mut least: Option<(f64, Moved<D>)> = None;
            for at in 0..ws.steps.len() {
                let step = ws.steps[at];
                let moved = Moved::by_step(step);
                let found = ws.distance_after(&moved, &linear, spacing, NEAR_STEP);
                if found.is_none_or(|distance| distance > most) {
                    continue;
                }
                let motion = ws.motion_after(&(linear * step));
                if least.as_ref().is_none_or(|(other, _)| motion < *other) {
                    least = Some((motion, moved));
                }
            }
            let Some((motion, moved)) = least else { break };
            let own = ws.motion_after(&SVector::zeros());
            if motion < own {
                ws.start_from(&moved, &linear);
                let gain = self.run_rival(ws, 0.2 * spacing, &moved, watch)?;
                // The edges of a view cost each answer some points.
                if gain > -CLEAR_GAIN[0] && !ws.state.far {
                    self.accept(ws);
                    continue;
                }
            }
            let step = linear * moved.step;
            if motion < REACH * own && motion <= ws.farthest && !ws.is_whole(&step) {
                let mut outward = [0.0; 3];
                (0..D).for_each(|k| outward[k] = step[k] * ws.frame.scale);
                ws.repeats = Some(Doubt::Repeats { step: outward });
            }
            break;
        }
        ControlFlow::Continue(())
    }

    /// Runs from `ws.state`. Returns its gain over the answer.
    fn run_rival<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        sigma: f64,
        moved: &Moved<D>,
        watch: Watch<'_>,
    ) -> ControlFlow<(), f64> {
        if ws.annealer.rigid.is_active() {
            let turned = |p: &[f64; D]| <[f64; D]>::from(moved.apply(p));
            ws.state.base.clear();
            ws.state.base.extend(ws.model.iter().map(turned));
            ws.annealer.rigid.set(self.transformation, &ws.state.base);
        }
        let flow = self.anneal_only(ws, Cooling { sigma, ..FOLLOW }, watch);
        ws.state.tail = ws.annealer.tail(0.1 * ws.spacing);
        ws.state.far = ws.is_far(&ws.state);
        let energy = ws.best.energy;
        let clean = ws.annealer.clean_sigma;
        let resolution = if ws.best.sigma.max(ws.state.sigma) <= clean {
            clean
        } else {
            ws.annealer.least_sigma
        };
        for state in [&mut ws.state, &mut ws.best] {
            ws.annealer.evaluate(state, self.share, resolution);
        }
        let gain = ws.best.energy - ws.state.energy;
        ws.best.energy = energy;
        ws.annealer.rigid.set(self.transformation, &ws.model);
        flow?;
        ControlFlow::Continue(gain)
    }

    /// Accepts the last run as the answer.
    fn accept<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        let state = &mut ws.state;
        ws.annealer
            .evaluate(state, self.share, ws.annealer.resolution);
        ws.best.copy_from(state);
    }
}

/// A map that may take the model onto itself: a rotation or mirror image about the centre, or a
/// step.
struct Moved<const D: usize> {
    turn: SMatrix<f64, D, D>,
    step: SVector<f64, D>,
}

impl<const D: usize> Moved<D> {
    fn by_turn(turn: SMatrix<f64, D, D>) -> Self {
        Self {
            turn,
            step: SVector::zeros(),
        }
    }

    fn by_step(step: SVector<f64, D>) -> Self {
        Self {
            turn: SMatrix::identity(),
            step,
        }
    }

    fn apply(&self, p: &[f64; D]) -> SVector<f64, D> {
        self.turn * SVector::from(*p) + self.step
    }

    /// Fraction of the model that may have no point within reach after the map: the edges, and more
    /// if the reach is half a spacing.
    fn misses(&self, reach: f64) -> f64 {
        match () {
            () if self.step.norm_squared() > 0.0 => 0.35,
            () if reach < NEAR => 0.05,
            () => 0.2,
        }
    }
}

impl<const D: usize> SoftassignWorkspace<D> {
    /// Distance between neighbours of a model that fills its bounding box.
    pub(super) fn mean_spacing(&self) -> f64 {
        (bounding_volume(&self.model, 1.0) / self.model.len() as f64).powf(1.0 / D as f64)
    }

    /// Whether a rotation maps the model onto itself, within the resolution of the answer, and fits
    /// the targets equally well. The answer may then be off by this rotation.
    pub(super) fn is_symmetric(&mut self) -> bool {
        let spacing = self.mean_spacing();
        let reach = (3.0 * self.best.sigma).min(0.25 * spacing) / spacing;
        self.put_where_looked_up(spacing);
        let linear = self.linear_part();
        let mut distance_after = |turn| {
            let moved = Moved::by_turn(turn);
            self.distance_after(&moved, &linear, spacing, reach)
        };
        let Some(own) = distance_after(SMatrix::identity()) else {
            return false;
        };
        starts::rotations::<D>(Rotation::Any).skip(1).any(|turn| {
            // The median of this many distances varies by a tenth; a hundredth of a spacing covers
            // rounding.
            distance_after(turn).is_some_and(|distance| distance <= 1.3 * own + 0.01 * spacing)
        })
    }

    /// Builds the look-up cells of model and targets.
    fn put_where_looked_up(&mut self, spacing: f64) {
        self.patterns.model.build(&self.model, spacing);
        self.patterns.targets.build(&self.target, spacing);
    }

    /// Median distance from the sample to the targets after the map. `None` if too many points then
    /// have no model point within reach.
    fn distance_after(
        &mut self,
        moved: &Moved<D>,
        linear: &SMatrix<f64, D, D>,
        spacing: f64,
        reach: f64,
    ) -> Option<f64> {
        let step = self.model.len().div_ceil(SAMPLE);
        let sampled = self.model.len() / step;
        let mut misses = (moved.misses(reach) * sampled as f64) as usize;
        let distances = &mut self.annealer.sums;
        distances.clear();
        for p in self.model.iter().step_by(step) {
            let turned = moved.apply(p);
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

    /// Sets `steps` to the offsets from the most central model point to its neighbours.
    fn find_steps(&mut self, spacing: f64) {
        let square = |p: &[f64; D]| squared(p);
        let from = self
            .model
            .iter()
            .min_by(|a, b| square(a).total_cmp(&square(b)));
        let from = from.copied().unwrap_or([0.0; D]);
        let offsets = self.model.iter().map(|p| difference(p, &from));
        let others = offsets.filter(|o| squared(o) > (SHORTEST_STEP * spacing).powi(2));
        let shortest = others
            .clone()
            .map(|o| squared(&o))
            .fold(f64::INFINITY, f64::min);
        let near = others.filter(|o| squared(o) <= LONGEST_STEP * LONGEST_STEP * shortest);
        self.steps.clear();
        self.steps.extend(near.map(SVector::from));
    }

    /// Root mean square motion of the model under the answer, shifted by one more step.
    fn motion_after(&self, step: &SVector<f64, D>) -> f64 {
        let still = SVector::from(self.frame.still());
        let rows = self.model.iter().zip(&self.best.warped);
        let motion = |(p, w): (&[f64; D], &[f64; D])| {
            let motion = SVector::from(*w) - SVector::from(*p) - still + step;
            motion.norm_squared()
        };
        (rows.map(motion).sum::<f64>() / self.model.len() as f64).sqrt()
    }

    /// Whether more than a tenth of the points moves farther than allowed.
    pub(super) fn is_far(&self, state: &State<D>) -> bool {
        if self.farthest.is_infinite() {
            return false;
        }
        let still = self.frame.still();
        let rows = self.model.iter().zip(&state.warped);
        let square = |(p, w): &(&[f64; D], &[f64; D])| {
            squared_distance(w, &std::array::from_fn(|k| p[k] + still[k]))
        };
        let far = rows.filter(|row| square(row) > self.farthest * self.farthest);
        10 * far.count() > self.model.len()
    }

    /// Whether both sets contain the same points, all in view. If so, nearly all are matched, and
    /// their bounding box has changed in a way that it would not for two views of more points.
    fn is_whole(&self, step: &SVector<f64, D>) -> bool {
        let larger = self.model.len().max(self.target.len()) as f64;
        let sides = |points: &[[f64; D]]| -> [f64; D] {
            std::array::from_fn(|k| {
                let range = points.iter().fold((f64::MAX, f64::MIN), |(low, high), p| {
                    (low.min(p[k]), high.max(p[k]))
                });
                range.1 - range.0
            })
        };
        let (model, target) = (sides(&self.model), sides(&self.target));
        let least = SAME_BOX[0] * step.norm() + SAME_BOX[1] * self.best.sigma;
        let changed = (0..D).any(|k| (model[k] - target[k]).abs() > least);
        self.best.matched >= COMPLETE * larger && changed
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

    /// Moves `state` to the answer for the mapped model.
    fn start_from(&mut self, moved: &Moved<D>, linear: &SMatrix<f64, D, D>) {
        let spacing = self.mean_spacing();
        let (from, to) = (mean(&self.model), mean(&self.best.warped));
        let to = SVector::from(to) - linear * SVector::from(from);
        let state = &mut self.state;
        state.base.clear();
        state.warped.clear();
        for p in &self.model {
            let turned = moved.apply(p);
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
