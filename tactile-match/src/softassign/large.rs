//! Matching of large sets, from coarse to fine.

use super::assign::Blocks;
use super::run::{Annealer, Cooling, Schedule, State};
use super::search::{FAST, MAX_PATTERN_REACH, SCALES, warmth};
use super::{
    AnnealedSoftassign, Mechanism, Rotation, SoftassignWorkspace, squared_distance, starts,
};
use crate::Watch;
use crate::gaussian_process::{Axes, Prior};
use std::ops::ControlFlow;

// Large sets are matched from coarse to fine.
//
// One annealing run from a warm start costs `O(I J)`, which is too much for tens of thousands of
// points. So a well-spread sample of either set (every 8ᵏ-th point in the order of a k-d tree) is
// registered first. The points of the samples are not partners of each other, but the field that
// maps one density onto the other is that of the whole sets [Hirose, *Acceleration of non-rigid
// point set registration with downsampling and Gaussian process regression*, IEEE TPAMI 43 (2021)].
// The field is extended to a sample eight times as large, whose first temperature is at most the
// spacing of the coarser sample, and so on to all points. There only targets within a few spacings
// are candidates: the time is `O(I r²)` per iteration with r ≤ 64 modes of the prior, the memory
// `O(I r)`.

/// If both sets have at least this many points, they are matched coarse to fine.
pub(super) const LARGE: usize = 4000;

/// A run cooled by its residuals ends when the variances of residuals and temperature differ by
/// less than this fraction. A tenth of it takes a tenth more time for equal errors. A limit of ten
/// iterations alone leaves volumes three noise widths from the truth
/// (`--example large_sets -- 20000 volume 0.01 0.2`).
const STILL: f64 = 1e-3;

impl AnnealedSoftassign {
    /// Whether sets of these sizes are matched coarse to fine.
    pub(super) fn is_large<const D: usize>(&self, ws: &SoftassignWorkspace<D>) -> bool {
        ws.model.len().min(ws.target.len()) >= LARGE
    }

    /// Matches the samples in turn, each from the result of the coarser one.
    pub(super) fn solve_coarse_to_fine<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        let smaller = ws.model.len().min(ws.target.len());
        let mut stride = 1;
        // Minimum size of the coarsest sample: fewer points represent the shape of a set poorly.
        while smaller / (stride * STEP) >= 500 {
            stride *= STEP;
        }
        let mut levels = std::mem::take(&mut ws.levels);
        levels.model_order.build(&ws.model);
        levels.target_order.build(&ws.target);
        let mut flow = ControlFlow::Continue(());
        if self.has(Mechanism::Motions) {
            levels.base.clone_from(&ws.model);
            self.enter(ws, &mut levels, 1);
            std::mem::swap(&mut ws.levels, &mut levels);
            let follows = or_stop(self.place_by_motions(ws, watch), &mut flow);
            std::mem::swap(&mut ws.levels, &mut levels);
            if follows {
                let run = self.schedule(Cooling {
                    sigma: warmth(ws),
                    least: 1.0,
                    still: STILL,
                    ..FAST
                });
                flow = refine(ws, run, flow, watch);
                if ws.gives_up {
                    flow?;
                }
                ws.state.tail = ws.annealer.tail(0.1 * ws.spacing);
                ws.best.copy_from(&ws.state);
                ws.annealer
                    .evaluate(&mut ws.best, self.share, ws.annealer.resolution);
                if ws.is_likely() {
                    stride = 0;
                }
            }
        }
        if stride > 0 {
            flow = self.coarsest(ws, &mut levels, stride, watch);
            if ws.gives_up {
                flow?;
            }
        }
        while stride > 1 {
            // First temperature of a level, in spacings of the coarser level.
            let sigma = 1.0 * ws.spacing;
            stride /= STEP;
            levels.coarse.copy_from(&ws.state);
            self.enter(ws, &mut levels, stride);
            levels.extend(&mut ws.annealer, stride, STEP, &mut ws.state);
            let run = if stride > 1 {
                self.sampled(ws, sigma)
            } else if self.has(Mechanism::LargePatterns)
                && flow.is_continue()
                && or_stop(
                    self.follow_sampled_patterns(ws, &mut levels, watch),
                    &mut flow,
                )
            {
                self.schedule(Cooling {
                    // First temperature after the block patterns, in spacings.
                    sigma: 0.4 * ws.spacing,
                    ..FAST
                })
            } else {
                self.schedule(Cooling {
                    sigma,
                    least: 1.0,
                    // If noise hides the patterns, all points are annealed with the temperature set
                    // by the residuals.
                    still: STILL,
                    ..FAST
                })
            };
            flow = refine(ws, run, flow, watch);
            if ws.gives_up {
                flow?;
            }
        }
        // A run below the noise temperature has lost pairs: repeat it with the temperature set by
        // the residuals.
        let cold =
            ws.state.sigma <= ws.annealer.clean_sigma && ws.state.matched < 0.98 * smaller as f64;
        if cold && stride > 0 {
            let run = self.schedule(Cooling {
                sigma: 0.4 * ws.spacing,
                least: 1.0,
                still: STILL,
                ..FAST
            });
            flow = refine(ws, run, flow, watch);
            if ws.gives_up {
                flow?;
            }
        }
        let schedule = self.schedule(FAST);
        let noisy = ws.state.sigma > ws.annealer.clean_sigma;
        if flow.is_continue() && noisy {
            // Number of rounds in which warp and noise level are updated in turn at the end of
            // noisy sets.
            ws.annealer.settle(&mut ws.state, &schedule, 4);
        }
        ws.levels = levels;
        ws.starts = 1;
        ws.state.energy = f64::INFINITY;
        ws.state.tail = ws.annealer.tail(0.1 * ws.spacing);
        ws.best.copy_from(&ws.state);
        if !self.is_exact(ws) {
            ws.annealer
                .evaluate(&mut ws.state, self.share, ws.annealer.resolution);
            ws.best.copy_from(&ws.state);
        }
        flow?;
        self.look_for_rivals(ws, watch)
    }

    /// Moves `ws.state` onto the field on which the local patterns agree: first the patterns of a
    /// few points with distant candidates, then those of many points with candidates near that
    /// field. Returns `false` and changes nothing if they do not agree.
    fn follow_sampled_patterns<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        levels: &mut Levels<D>,
        watch: Watch<'_>,
    ) -> ControlFlow<(), bool> {
        let mut reach = 8.0 * ws.spacing;
        // First stage: number of points whose local patterns are compared, and the distance of
        // their candidates. The distance is in spacings and grows by this factor while the patterns
        // do not agree on a field; its limit is in radii of the model.
        while !follow_patterns_of(ws, levels, 120, reach.min(MAX_PATTERN_REACH), watch)? {
            if reach >= MAX_PATTERN_REACH {
                return ControlFlow::Continue(false);
            }
            reach *= 2.5;
        }
        // Second stage: number of points and reach, in spacings, of the patterns that refine this
        // field.
        follow_patterns_of(ws, levels, 1000, 4.0 * ws.spacing, watch)
    }

    /// Sets targets, prior and spacing of a level.
    fn enter<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        levels: &mut Levels<D>,
        stride: usize,
    ) {
        levels.sample(&ws.model, &ws.target, stride, &mut ws.state);
        ws.annealer.prior.build(&levels.model, SCALES);
        ws.annealer.soft.set_targets(&levels.target);
        ws.annealer.rigid.set(self.transformation, &levels.model);
        ws.spacing = ws.patterns.typical_spacing(&levels.target);
    }

    /// Matches the coarsest level from the centroids. If all rotations are allowed, the best of
    /// several starts is taken.
    fn coarsest<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        levels: &mut Levels<D>,
        stride: usize,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        let mut base = Vec::new();
        let rotations = starts::rotations::<D>(self.rotation).map(Some);
        for rotation in std::iter::once(None).chain(rotations) {
            let sets = (&*ws.model, &*ws.target);
            match rotation {
                None => levels.base.clone_from(&ws.model),
                Some(turn) => starts::moments(sets.0, sets.1, &turn, &mut levels.base),
            }
            self.enter(ws, levels, stride);
            ws.state.warped.clone_from(&ws.state.base);
            let run = self.sampled(ws, FAST.sigma);
            refine(ws, run, ControlFlow::Continue(()), watch)?;
            if self.rotation == Rotation::Limited {
                return ControlFlow::Continue(());
            }
            ws.annealer
                .evaluate(&mut ws.state, self.share, ws.annealer.resolution);
            if base.is_empty() || ws.state.energy < ws.best.energy {
                ws.best.copy_from(&ws.state);
                base.clone_from(&levels.base);
            }
        }
        levels.base = base;
        ws.state.copy_from(&ws.best);
        ControlFlow::Continue(())
    }

    /// The annealing schedule of a sample.
    fn sampled<const D: usize>(&self, ws: &SoftassignWorkspace<D>, sigma: f64) -> Schedule {
        Schedule {
            // The final temperature of a sample, in its spacings. The points of samples are not
            // partners, so a lower temperature resolves nothing. Half as much takes twice the time
            // and cools noisy sets below their noise (`--example large_sets`).
            floor: 1.0 * ws.spacing,
            ..self.schedule(Cooling { sigma, ..FAST })
        }
    }
}

/// One annealing run of a level. If the caller has stopped the search, a single iteration that is not
/// watched.
fn refine<const D: usize>(
    ws: &mut SoftassignWorkspace<D>,
    schedule: Schedule,
    flow: ControlFlow<()>,
    watch: Watch<'_>,
) -> ControlFlow<()> {
    ws.state.trace.clear();
    ws.state.iterations = 0;
    // In large sets smaller Gaussians are dropped. This changes the positions by a thousandth of
    // the temperature.
    ws.annealer.soft.faintest = 1e-4;
    if flow.is_continue() {
        return ws.annealer.run(&mut ws.state, &schedule, watch);
    }
    let once = Schedule {
        limit: 1,
        ..schedule
    };
    let silent = &mut || ControlFlow::Continue(());
    // The silent watch cannot stop the run.
    let _ = ws.annealer.run(&mut ws.state, &once, silent);
    flow
}

/// Moves `ws.state` onto the field that the local patterns of about `points` model points agree on.
/// Candidates are at most `reach` away.
fn follow_patterns_of<const D: usize>(
    ws: &mut SoftassignWorkspace<D>,
    levels: &mut Levels<D>,
    points: usize,
    reach: f64,
    watch: Watch<'_>,
) -> ControlFlow<(), bool> {
    let step = (ws.model.len() / points).max(1);
    let order = &levels.model_order.order;
    let rows = order.iter().step_by(step).copied();
    let (warped, target) = (&ws.state.warped, &*ws.target);
    if !ws
        .patterns
        .propose(rows.clone(), warped, target, reach, watch)?
    {
        return ControlFlow::Continue(false);
    }
    levels.model.clear();
    levels.model.extend(rows.clone().map(|i| ws.model[i]));
    let coarse = &mut levels.coarse;
    coarse.base.clear();
    coarse.base.extend(rows.map(|i| ws.state.base[i]));
    coarse.warped.clone_from(&coarse.base);
    levels.sampled.build(&levels.model, SCALES);
    let pairs = &ws.patterns.pairs;
    std::mem::swap(&mut ws.annealer.prior, &mut levels.sampled);
    let sets = (&*levels.model, target);
    ws.consensus
        .fit(&mut ws.annealer, SCALES, sets, pairs, coarse);
    std::mem::swap(&mut ws.annealer.prior, &mut levels.sampled);
    // The patterns are accepted if at least this fraction of them lies within a spacing of one
    // field. For wrong candidates the fraction is a sixteenth.
    let agreed = agreement(target, pairs, &coarse.warped, ws.spacing) >= 0.3;
    if agreed {
        levels.extend(&mut ws.annealer, 1, step, &mut ws.state);
    }
    ControlFlow::Continue(agreed)
}

/// Whether a start was found. Notes in `flow` that the caller has stopped the search.
fn or_stop(found: ControlFlow<(), bool>, flow: &mut ControlFlow<()>) -> bool {
    match found {
        ControlFlow::Continue(found) => found,
        ControlFlow::Break(()) => {
            *flow = ControlFlow::Break(());
            false
        }
    }
}

/// Fraction of the pairs whose targets lie within `distance` of the model points' positions.
fn agreement<const D: usize>(
    target: &[[f64; D]],
    pairs: &[(usize, f64)],
    warped: &[[f64; D]],
    distance: f64,
) -> f64 {
    let near = |((j, _), w): &(&(usize, f64), &[f64; D])| {
        squared_distance(&target[*j], w) < distance * distance
    };
    let agreeing = pairs.iter().zip(warped).filter(near).count();
    agreeing as f64 / pairs.len().max(1) as f64
}

// Samples of large sets, and the extension of fields from one sample to the next.

/// Number of points of a level per point of the next coarser level.
const STEP: usize = 8;

/// Samples of both sets, and the positions found by the coarser level.
#[derive(Clone, Debug, Default)]
pub(super) struct Levels<const D: usize> {
    pub(super) model_order: Blocks<D>,
    target_order: Blocks<D>,
    model: Vec<[f64; D]>,
    target: Vec<[f64; D]>,
    /// Positions of all model points under the start.
    base: Vec<[f64; D]>,
    coarse: State<D>,
    weights: Vec<f64>,
    wanted: Axes<D>,
    /// The prior at the points whose patterns are compared.
    sampled: Prior,
}

impl<const D: usize> Levels<D> {
    /// Takes the sample of every `stride`-th point (all points in their own order for a stride of
    /// 1). Also sets the base positions of the sample in `state`.
    fn sample(
        &mut self,
        model: &[[f64; D]],
        target: &[[f64; D]],
        stride: usize,
        state: &mut State<D>,
    ) {
        state.base.clear();
        self.model.clear();
        self.target.clear();
        if stride == 1 {
            state.base.extend_from_slice(&self.base);
            self.model.extend_from_slice(model);
            self.target.extend_from_slice(target);
            return;
        }
        let rows = self.model_order.order.iter().step_by(stride);
        state.base.extend(rows.clone().map(|&i| self.base[i]));
        self.model.extend(rows.map(|&i| model[i]));
        let rows = self.target_order.order.iter().step_by(stride);
        self.target.extend(rows.map(|&j| target[j]));
    }

    /// Extends the field of `coarse`, every `step`-th point of the level of this stride, to all
    /// points of that level. The result is in `state.warped`.
    fn extend(
        &mut self,
        annealer: &mut Annealer<D>,
        stride: usize,
        step: usize,
        state: &mut State<D>,
    ) {
        let padded = annealer.prior.stride;
        let order = &self.model_order.order;
        let row_of = |coarse: usize| match stride {
            1 => order[coarse * step],
            _ => coarse * step,
        };
        self.weights.clear();
        self.weights.resize(padded, 0.0);
        self.wanted
            .fill(padded, state.base.iter().map(|_| [0.0; D]));
        for (k, (warped, base)) in self.coarse.warped.iter().zip(&self.coarse.base).enumerate() {
            let row = row_of(k);
            self.weights[row] = 1.0;
            for d in 0..D {
                self.wanted.0[d][row] = warped[d] - base[d];
            }
        }
        // Variance of the coarse field's values during the extension: the truncation error of its
        // factor.
        annealer
            .regression
            .fit(&annealer.prior, &self.weights, &self.wanted, 1e-6);
        let field = &annealer.regression.displacement;
        state.warped.clear();
        let rows = state.base.iter().enumerate();
        state
            .warped
            .extend(rows.map(|(i, b)| std::array::from_fn(|d| b[d] + field.0[d][i])));
    }
}
