//! Rivals of an answer: the model turned, mirrored or moved by a step of its lattice.

use super::run::{Cooling, State};
use super::search::{FAST, bounding_volume};
use super::{AnnealedSoftassign, Mechanism, Rotation, SoftassignWorkspace};
use super::{difference, mean, squared, squared_distance, starts};
use crate::Doubt;
use nalgebra::{SMatrix, SVector};
use std::ops::ControlFlow;

// A jittered grid that was turned by a quarter has a match near by with every point, which leaves
// residuals of the jitter. Nothing in that match alone tells it from noise. And a lattice that goes
// on beyond the view has as many answers as steps. So every map S (a turn, a mirror image, a step)
// that takes the model nearly onto itself is looked at: point i goes where the answer w has the
// model point k next to S pᵢ, at `w_k + A (S pᵢ − p_k)` with the affine part A of w. If that lies
// nearer to the targets than w does, or as near with less motion, the run from there decides by its
// energy. What explains the targets as well and cannot be told is named.

/// Model points that show how far a turned model lies from the targets.
const SAMPLE: usize = 200;
/// A turned grid has a model point so near to each of its points, in spacings. Of random points
/// half have.
const NEAR: f64 = 0.5;
/// The same for a step of a lattice.
const NEAR_STEP: f64 = 0.25;
/// Answers that leave less than this, in spacings, are not looked at: a jitter that small does not
/// show in the strain.
const RESOLVED: f64 = 0.01;
/// A start is worth a run where it leaves less than this share of the answer's distances.
const NEARER: f64 = 0.9;
/// The same for a turn or a mirror image that is not allowed: where the model is its own image up
/// to noise, chance alone often leaves nine tenths.
const CLEARLY_NEARER: f64 = 0.75;
/// What an allowed turn has to gain: odds of e⁵, and of a twentieth of a unit a point.
const CLEAR_GAIN: [f64; 2] = [5.0, 0.05];
/// What one that is not allowed has to gain beside e⁵, in square roots of the number of coordinates:
/// by chance the noise of either answer is less by one of them.
const CLEAR_CHANCE: f64 = 4.0;
/// A step of the lattice explains the targets as well if it leaves so many times the distances.
const AS_NEAR: f64 = 1.5;
/// And so much more, in spacings: less is rounding.
const ROUNDING: f64 = 0.02;
/// Points nearer than this, in spacings, are no step apart.
const SHORTEST_STEP: f64 = 0.6;
/// Steps up to so many times the shortest are looked at: the diagonal of a square.
const LONGEST_STEP: f64 = 1.6;
/// A rival with so many times the motion is out of reach: the points moved by less than a sixth of
/// a step, or by more than five sixths the other way.
const REACH: f64 = 5.0;
/// Sets of which such a share is matched are the same points, not two views of more.
const COMPLETE: f64 = 0.995;
/// Unless both fill the same box, up to this share of a step and so many deviations of the noise.
const SAME_BOX: [f64; 2] = [0.25, 4.0];

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
    /// Looks for a better answer among the turned, mirrored and moved models. Where it is allowed
    /// it takes the answer's place. What else is better or as good is left in `ws.twin` and
    /// `ws.repeats`.
    pub(super) fn look_for_rivals<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        let few = ws.model.len().min(ws.target.len()) < 4 * D;
        if few || ws.best.trace.is_empty() || !self.has(Mechanism::Rivals) {
            return; // any few points have many nearly equal partners
        }
        let spacing = ws.mean_spacing();
        ws.put_where_looked_up(spacing);
        if ws.best.sigma >= RESOLVED * spacing {
            self.look_for_turns(ws, spacing);
        }
        if ws.twin.is_none() {
            self.look_for_steps(ws, spacing);
        }
    }

    /// Looks for a better answer among the turned and mirrored models.
    fn look_for_turns<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>, spacing: f64) {
        let still = Moved::by_turn(SMatrix::identity());
        let own = ws.distance_after(&still, &ws.linear_part(), spacing, NEAR);
        let Some(own) = own.filter(|&own| own > RESOLVED * spacing) else {
            return;
        };
        for (mirrored, reflection) in [(false, SMatrix::identity()), (true, mirror())] {
            let linear = ws.linear_part(); // of the answer, which a turned model may have replaced
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
            // Warmer, points would leave the partners that they begin with.
            let gain = self.run_rival(ws, 0.3 * spacing, &moved);
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
    }

    /// Looks for steps of a lattice: the answer of least motion takes the place of one that
    /// explains the targets no better. Leaves in `ws.repeats` what is as good and within reach.
    fn look_for_steps<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>, spacing: f64) {
        ws.find_steps(spacing);
        // Each round takes the answer a step nearer to where the model lies.
        for _ in 0..4 {
            let linear = ws.linear_part();
            let still = Moved::by_turn(SMatrix::identity());
            let Some(own) = ws.distance_after(&still, &linear, spacing, NEAR_STEP) else {
                return;
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
            let Some((motion, moved)) = least else { return };
            let own = ws.motion_after(&SVector::zeros());
            if motion < own {
                ws.start_from(&moved, &linear);
                let gain = self.run_rival(ws, 0.2 * spacing, &moved);
                // Edges of a view cost either answer some points.
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
            return;
        }
    }

    /// Runs from `ws.state`. What it gains on the answer.
    fn run_rival<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        sigma: f64,
        moved: &Moved<D>,
    ) -> f64 {
        if ws.annealer.rigid.is_active() {
            let turned = |p: &[f64; D]| <[f64; D]>::from(moved.apply(p));
            ws.state.base.clear();
            ws.state.base.extend(ws.model.iter().map(turned));
            ws.annealer.rigid.set(self.transformation, &ws.state.base);
        }
        // There is no observer that could stop it.
        let silent = &mut |_, _| ControlFlow::Continue(());
        let _ = self.anneal_only(ws, Cooling { sigma, ..FOLLOW }, silent);
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
        gain
    }

    /// The last run becomes the answer.
    fn accept<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        let state = &mut ws.state;
        ws.annealer
            .evaluate(state, self.share, ws.annealer.resolution);
        ws.best.copy_from(state);
    }
}

/// A map that may take a model onto itself: a turn or a mirror image about the centre, or a step.
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

    /// Share of the model that may have no point within reach after it: edges, and more where half
    /// a spacing is reach.
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

    /// Whether a turn takes the model onto itself, by what the answer resolves, and lies as near to
    /// the targets. Then the answer may be turned as well.
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
            // Medians of so many distances vary by a tenth. Below a hundredth is rounding.
            distance_after(turn).is_some_and(|distance| distance <= 1.3 * own + 0.01 * spacing)
        })
    }

    /// Puts model and targets where they are looked up.
    fn put_where_looked_up(&mut self, spacing: f64) {
        self.patterns.model.build(&self.model, spacing);
        self.patterns.targets.build(&self.target, spacing);
    }

    /// Median distance to the targets of the sample after the map. `None` where too many points
    /// have no model point within reach then.
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

    /// Sets `steps` to those from the model point next to the centre to its neighbours.
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

    /// Root mean square motion of the model under the answer, moved on by a step.
    fn motion_after(&self, step: &SVector<f64, D>) -> f64 {
        let still = SVector::from(self.frame.still());
        let rows = self.model.iter().zip(&self.best.warped);
        let motion = |(p, w): (&[f64; D], &[f64; D])| {
            let motion = SVector::from(*w) - SVector::from(*p) - still + step;
            motion.norm_squared()
        };
        (rows.map(motion).sum::<f64>() / self.model.len() as f64).sqrt()
    }

    /// Whether more than a tenth of the points moves farther than is allowed.
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

    /// Whether the sets are the same points, all in view: nearly all are matched, and the box they
    /// fill has changed, as that of two views of more points would not.
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

    /// Puts `state` where the answer has the moved model.
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
