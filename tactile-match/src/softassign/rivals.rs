//! Rivals of an answer: the model rotated, mirrored or shifted by a step of its lattice.

use super::race::{Race, Rivals, Runner};
use super::run::Cooling;
use super::starts::FAST;
use super::{Mechanism, Rotation, difference, mean, squared, starts};
use crate::{Doubt, LatticeStep};
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

impl<const D: usize> Race<'_, D> {
    /// Searches for a better answer among the rotated, mirrored and shifted models. An allowed
    /// rival replaces the best run. Returns another that is better or equally good.
    pub(super) fn look_for_rivals(&mut self) -> ControlFlow<(), Rivals> {
        let few = self.problem.smaller() < 4 * D;
        if few || self.best.trace.is_empty() || !self.has(Mechanism::Rivals) {
            // Any few points have many nearly equal partners.
            return ControlFlow::Continue(Rivals::default());
        }
        let spacing = self.problem.model_spacing();
        self.put_where_looked_up(spacing);
        if self.best.sigma >= RESOLVED * spacing {
            let twin = self.look_for_turns(spacing)?;
            if twin.is_some() {
                return ControlFlow::Continue(Rivals {
                    doubt: twin,
                    ..Rivals::default()
                });
            }
        }
        self.look_for_steps(spacing)
    }

    /// Searches for a better answer among the rotated and mirrored models.
    fn look_for_turns(&mut self, spacing: f64) -> ControlFlow<(), Option<Doubt>> {
        let still = Moved::by_turn(SMatrix::identity());
        let own = self.distance_after(&still, &self.linear_part(), spacing, NEAR);
        let Some(own) = own.filter(|&own| own > RESOLVED * spacing) else {
            return ControlFlow::Continue(None);
        };
        let mut twin: Option<(f64, Doubt)> = None;
        for (mirrored, reflection) in [(false, SMatrix::identity()), (true, mirror())] {
            let linear = self.linear_part(); // of the answer, which a rotated model may have replaced
            let allowed = self.problem.options.rotation == Rotation::Any && !mirrored;
            let nearer = if allowed { NEARER } else { CLEARLY_NEARER };
            let mut best = (nearer * own, None);
            for turn in starts::rotations::<D>(Rotation::Any).map(|turn| turn * reflection) {
                let moved = Moved::by_turn(turn);
                let found = self.distance_after(&moved, &linear, spacing, NEAR);
                if let Some(distance) = found.filter(|&distance| distance < best.0) {
                    best = (distance, Some(moved));
                }
            }
            let Some(moved) = best.1 else { continue };
            self.start_from(&moved, &linear);
            // At a higher temperature points would leave their first partners.
            let gain = self.run_rival(0.3 * spacing, &moved)?;
            let points = self.problem.model.len() as f64;
            let chance = if allowed {
                CLEAR_GAIN[1] * points
            } else {
                CLEAR_CHANCE * (D as f64 * points).sqrt()
            };
            let least = CLEAR_GAIN[0] + chance;
            if gain > twin.map_or(least, |(last, _)| last) {
                twin = match (mirrored, allowed) {
                    (true, _) => Some((gain, Doubt::Mirrored)),
                    (false, false) => Some((gain, Doubt::Turned)),
                    (false, true) => {
                        self.accept();
                        None
                    }
                };
            }
        }
        ControlFlow::Continue(twin.map(|(_, doubt)| doubt))
    }

    /// Searches for lattice steps: the answer of least motion replaces one that fits the targets no
    /// better. Returns a step that fits equally well, and a doubt if it is within reach.
    fn look_for_steps(&mut self, spacing: f64) -> ControlFlow<(), Rivals> {
        let problem = self.problem;
        self.find_steps(spacing);
        // Each round shifts the answer by one step towards the unmoved model.
        for _ in 0..4 {
            let linear = self.linear_part();
            let still = Moved::by_turn(SMatrix::identity());
            let Some(own) = self.distance_after(&still, &linear, spacing, NEAR_STEP) else {
                break;
            };
            let most = AS_NEAR * own + ROUNDING * spacing;
            let mut least: Option<(f64, Moved<D>)> = None;
            for at in 0..self.runner.steps.len() {
                let step = self.runner.steps[at];
                let moved = Moved::by_step(step);
                let found = self.distance_after(&moved, &linear, spacing, NEAR_STEP);
                if found.is_none_or(|distance| distance > most) {
                    continue;
                }
                let motion = self.motion_after(&(linear * step));
                if least.as_ref().is_none_or(|(other, _)| motion < *other) {
                    least = Some((motion, moved));
                }
            }
            let Some((motion, moved)) = least else { break };
            let own = self.motion_after(&SVector::zeros());
            if motion < own {
                self.start_from(&moved, &linear);
                let gain = self.run_rival(0.2 * spacing, &moved)?;
                // The edges of a view cost each answer some points.
                if gain > -CLEAR_GAIN[0] && !self.runner.run.far {
                    self.accept();
                    continue;
                }
            }
            let step = linear * moved.step;
            if motion <= problem.farthest && !self.is_whole(&step) {
                let mut outward = [0.0; 3];
                (0..D).for_each(|k| outward[k] = step[k] * problem.frame.scale);
                let step = LatticeStep(outward);
                return ControlFlow::Continue(Rivals {
                    doubt: (motion < REACH * own).then_some(Doubt::Repeats { step }),
                    period: Some(step),
                });
            }
            break;
        }
        ControlFlow::Continue(Rivals::default())
    }

    /// Anneals the current run. Returns its gain over the best one.
    fn run_rival(&mut self, sigma: f64, moved: &Moved<D>) -> ControlFlow<(), f64> {
        let problem = self.problem;
        let (limits, transformation) = (problem.limits, problem.options.transformation);
        if !problem.bends() {
            let Runner { run, annealer, .. } = &mut *self.runner;
            let turned = |p: &[f64; D]| <[f64; D]>::from(moved.apply(p));
            run.base.clear();
            run.base.extend(problem.model.iter().map(turned));
            annealer.rigid.set(transformation, &run.base);
        }
        let flow = self.anneal_only(Cooling { sigma, ..FOLLOW });
        let Runner { run, annealer, .. } = &mut *self.runner;
        run.tail = annealer.tail(0.1 * problem.spacing);
        run.far = problem.is_far(&run.warped);
        let energy = self.best.energy;
        let resolution = if self.best.sigma.max(run.sigma) <= limits.clean {
            limits.clean
        } else {
            limits.least
        };
        for either in [&mut *run, &mut *self.best] {
            annealer.evaluate(either, problem.slack(), resolution);
        }
        let gain = self.best.energy - run.energy;
        self.best.energy = energy;
        annealer.rigid.set(transformation, &problem.model);
        flow?;
        ControlFlow::Continue(gain)
    }

    /// Accepts the current run as the best.
    fn accept(&mut self) {
        let problem = self.problem;
        let Runner { run, annealer, .. } = &mut *self.runner;
        annealer.evaluate(run, problem.slack(), problem.limits.resolution);
        self.best.copy_from(run);
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

impl<const D: usize> Race<'_, D> {
    /// Whether a rotation maps the model onto itself, within the resolution of the answer, and fits
    /// the targets equally well. The answer may then be off by this rotation.
    pub(super) fn is_symmetric(&mut self) -> bool {
        let spacing = self.problem.model_spacing();
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
        self.runner.lookup.model.build(&self.problem.model, spacing);
        self.runner
            .lookup
            .targets
            .build(&self.problem.target, spacing);
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
        let step = self.problem.model.len().div_ceil(SAMPLE);
        let sampled = self.problem.model.len() / step;
        let mut misses = (moved.misses(reach) * sampled as f64) as usize;
        let distances = &mut self.runner.annealer.sums;
        distances.clear();
        for p in self.problem.model.iter().step_by(step) {
            let turned = moved.apply(p);
            let near = self
                .runner
                .lookup
                .model
                .nearest(&turned.into(), reach * spacing);
            let Some(k) = near else {
                misses = misses.checked_sub(1)?;
                continue;
            };
            let place = SVector::from(self.best.warped[k])
                + linear * (turned - SVector::from(self.problem.model[k]));
            let found = self.runner.lookup.targets.nearest(&place.into(), spacing);
            distances.push(found.map_or(spacing, |j| {
                (SVector::from(self.problem.target[j]) - place).norm()
            }));
        }
        let middle = distances.len() / 2;
        Some(*distances.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    /// Sets `steps` to the offsets from the most central model point to its neighbours.
    fn find_steps(&mut self, spacing: f64) {
        let square = |p: &[f64; D]| squared(p);
        let from = self
            .problem
            .model
            .iter()
            .min_by(|a, b| square(a).total_cmp(&square(b)));
        let from = from.copied().unwrap_or([0.0; D]);
        let offsets = self.problem.model.iter().map(|p| difference(p, &from));
        let others = offsets.filter(|o| squared(o) > (SHORTEST_STEP * spacing).powi(2));
        let shortest = others
            .clone()
            .map(|o| squared(&o))
            .fold(f64::INFINITY, f64::min);
        let near = others.filter(|o| squared(o) <= LONGEST_STEP * LONGEST_STEP * shortest);
        self.runner.steps.clear();
        self.runner.steps.extend(near.map(SVector::from));
    }

    /// Root mean square motion of the model under the answer, shifted by one more step.
    fn motion_after(&self, step: &SVector<f64, D>) -> f64 {
        let still = SVector::from(self.problem.frame.still());
        let rows = self.problem.model.iter().zip(&self.best.warped);
        let motion = |(p, w): (&[f64; D], &[f64; D])| {
            let motion = SVector::from(*w) - SVector::from(*p) - still + step;
            motion.norm_squared()
        };
        (rows.map(motion).sum::<f64>() / self.problem.model.len() as f64).sqrt()
    }

    /// Whether both sets contain the same points, all in view. If so, nearly all are matched, and
    /// their bounding box has changed in a way that it would not for two views of more points.
    fn is_whole(&self, step: &SVector<f64, D>) -> bool {
        let larger = self.problem.model.len().max(self.problem.target.len()) as f64;
        let sides = |points: &[[f64; D]]| -> [f64; D] {
            std::array::from_fn(|k| {
                let range = points.iter().fold((f64::MAX, f64::MIN), |(low, high), p| {
                    (low.min(p[k]), high.max(p[k]))
                });
                range.1 - range.0
            })
        };
        let (model, target) = (sides(&self.problem.model), sides(&self.problem.target));
        let least = SAME_BOX[0] * step.norm() + SAME_BOX[1] * self.best.sigma;
        let changed = (0..D).any(|k| (model[k] - target[k]).abs() > least);
        self.best.matched >= COMPLETE * larger && changed
    }

    /// Affine part of the answer.
    fn linear_part(&self) -> SMatrix<f64, D, D> {
        let (from, to) = (mean(&self.problem.model), mean(&self.best.warped));
        let mut gram = SMatrix::<f64, D, D>::identity() * 1e-9;
        let mut cross = SMatrix::<f64, D, D>::zeros();
        for (p, w) in self.problem.model.iter().zip(&self.best.warped) {
            let p = SVector::from(*p) - SVector::from(from);
            let w = SVector::from(*w) - SVector::from(to);
            gram += p * p.transpose();
            cross += w * p.transpose();
        }
        cross * gram.try_inverse().unwrap_or_else(SMatrix::zeros)
    }

    /// Moves the current run to the answer for the mapped model.
    fn start_from(&mut self, moved: &Moved<D>, linear: &SMatrix<f64, D, D>) {
        let spacing = self.problem.model_spacing();
        let (from, to) = (mean(&self.problem.model), mean(&self.best.warped));
        let to = SVector::from(to) - linear * SVector::from(from);
        let run = &mut self.runner.run;
        run.base.clear();
        run.warped.clear();
        for p in &self.problem.model {
            let turned = moved.apply(p);
            let base = linear * turned + to;
            run.base.push(base.into());
            let near = self.runner.lookup.model.nearest(&turned.into(), spacing);
            run.warped.push(near.map_or(base.into(), |k| {
                let offset = linear * (turned - SVector::from(self.problem.model[k]));
                (SVector::from(self.best.warped[k]) + offset).into()
            }));
        }
    }
}
