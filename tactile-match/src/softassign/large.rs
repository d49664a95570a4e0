//! Large sets, coarse to fine.

use super::assign::Blocks;
use super::run::{Annealer, Cooling, Schedule, State};
use super::search::{FAST, MAX_PATTERN_REACH, SCALES, warmth};
use super::{
    AnnealedSoftassign, Mechanism, Rotation, SoftassignWorkspace, squared_distance, starts,
};
use crate::gaussian_process::{Axes, Prior};
use std::ops::ControlFlow;

// Large sets, coarse to fine.
//
// One annealing run from a warm start costs `O(I J)`, which is too much for tens of thousands of
// points. A well-spread sample of either set (every 8ᵏ-th point in the order of a k-d tree) is
// registered first: its points are not each other's partners, but the field that takes one density
// onto the other is the whole set's [Hirose, *Acceleration of non-rigid point set registration with
// downsampling and Gaussian process regression*, IEEE TPAMI 43 (2021)]. The field is extended to a
// sample eight times as large, which starts no warmer than the coarser sample was dense, and so on
// to all points. There only targets within a few spacings are looked at: time `O(I r²)` an
// iteration with r ≤ 64 modes of the prior, memory `O(I r)`.

/// Sets of which both have so many points are matched coarse to fine.
pub(super) const LARGE: usize = 4000;

/// Runs that the residuals cool end where residuals and temperature, as variances, differ by less
/// than this share. A tenth of it takes a tenth more time for the same errors. Ten iterations alone
/// leave volumes three noise widths from the truth
/// (`--example large_sets -- 20000 volume 0.01 0.2`).
const STILL: f64 = 1e-3;

impl AnnealedSoftassign {
    /// Whether sets of these sizes are matched coarse to fine.
    pub(super) fn is_large<const D: usize>(&self, ws: &SoftassignWorkspace<D>) -> bool {
        ws.model.len().min(ws.target.len()) >= LARGE
    }

    /// Matches sample after sample, each from where the coarser one put it.
    pub(super) fn solve_coarse_to_fine<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let smaller = ws.model.len().min(ws.target.len());
        let mut stride = 1;
        // The coarsest sample has at least so many points: fewer show too little of a set's shape.
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
            let follows = self.place_by_motions(ws);
            std::mem::swap(&mut ws.levels, &mut levels);
            if follows {
                let run = self.schedule(Cooling {
                    sigma: warmth(ws),
                    least: 1.0,
                    still: STILL,
                    ..FAST
                });
                flow = refine(ws, run, flow, observe);
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
            flow = self.coarsest(ws, &mut levels, stride, observe);
        }
        while stride > 1 {
            // First temperature of a level in spacings of the coarser one.
            let sigma = 1.0 * ws.spacing;
            stride /= STEP;
            levels.coarse.copy_from(&ws.state);
            self.enter(ws, &mut levels, stride);
            levels.extend(&mut ws.annealer, stride, STEP, &mut ws.state);
            let run = if stride > 1 {
                self.sampled(ws, sigma)
            } else if self.has(Mechanism::LargePatterns)
                && self.follow_sampled_patterns(ws, &mut levels)
            {
                self.schedule(Cooling {
                    // First temperature after the patterns, in spacings.
                    sigma: 0.4 * ws.spacing,
                    ..FAST
                })
            } else {
                self.schedule(Cooling {
                    sigma,
                    least: 1.0,
                    // Where noise hides the patterns, all points are annealed as the residuals
                    // decide.
                    still: STILL,
                    ..FAST
                })
            };
            flow = refine(ws, run, flow, observe);
        }
        // A run colder than the noise has lost pairs: again, as far as the residuals let it cool.
        let cold =
            ws.state.sigma <= ws.annealer.clean_sigma && ws.state.matched < 0.98 * smaller as f64;
        if cold && stride > 0 {
            let run = self.schedule(Cooling {
                sigma: 0.4 * ws.spacing,
                least: 1.0,
                still: STILL,
                ..FAST
            });
            flow = refine(ws, run, flow, observe);
        }
        let schedule = self.schedule(FAST);
        let noisy = ws.state.sigma > ws.annealer.clean_sigma;
        if flow.is_continue() && noisy {
            // Rounds in which warp and noise level follow each other at the end of noisy sets.
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
        if flow.is_continue() {
            self.look_for_rivals(ws);
        }
        flow
    }

    /// Puts `ws.state` where local patterns agree it belongs: first those of a few points with
    /// candidates far away, then those of many with candidates near the field found. False, and no
    /// change, where they do not agree.
    fn follow_sampled_patterns<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        levels: &mut Levels<D>,
    ) -> bool {
        let mut reach = 8.0 * ws.spacing;
        // Points whose local patterns are compared first, and how far away their candidates may be:
        // in spacings, so many times farther where those do not agree on a field, and at most in
        // radii of the model.
        while !follow_patterns_of(ws, levels, 120, reach.min(MAX_PATTERN_REACH)) {
            if reach >= MAX_PATTERN_REACH {
                return false;
            }
            reach *= 2.5;
        }
        // Points and reach, in spacings, of the patterns that make the seeds' field exact.
        follow_patterns_of(ws, levels, 1000, 4.0 * ws.spacing)
    }

    /// Sets up targets, prior and spacing of a level.
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

    /// The coarsest level, from the centroids. Where any rotation is allowed the best of several
    /// starts.
    fn coarsest<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        levels: &mut Levels<D>,
        stride: usize,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
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
            refine(ws, run, ControlFlow::Continue(()), observe)?;
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

    /// How a sample is annealed.
    fn sampled<const D: usize>(&self, ws: &SoftassignWorkspace<D>, sigma: f64) -> Schedule {
        Schedule {
            // A sample is annealed down to so many of its spacings: its points are no partners, and
            // nearer than that there is nothing to see. Half as much takes twice the time and
            // leaves noisy sets below their noise (`--example large_sets`).
            floor: 1.0 * ws.spacing,
            ..self.schedule(Cooling { sigma, ..FAST })
        }
    }
}

/// One annealing run of a level. A single silent iteration where the caller has had enough.
fn refine<const D: usize>(
    ws: &mut SoftassignWorkspace<D>,
    schedule: Schedule,
    flow: ControlFlow<()>,
    observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
) -> ControlFlow<()> {
    ws.state.trace.clear();
    ws.state.iterations = 0;
    // Gaussians fainter than this are left out in large sets: the positions move by a thousandth of
    // the temperature.
    ws.annealer.soft.faintest = 1e-4;
    if flow.is_continue() {
        return ws.annealer.run(&mut ws.state, &schedule, observe);
    }
    let once = Schedule {
        limit: 1,
        ..schedule
    };
    let silent = &mut |_, _| ControlFlow::Continue(());
    // Nobody listens, so nobody breaks off.
    let _ = ws.annealer.run(&mut ws.state, &once, silent);
    flow
}

/// Puts `ws.state` onto the field that the local patterns of about `points` model points agree on.
/// Candidates lie up to `reach` away.
fn follow_patterns_of<const D: usize>(
    ws: &mut SoftassignWorkspace<D>,
    levels: &mut Levels<D>,
    points: usize,
    reach: f64,
) -> bool {
    let step = (ws.model.len() / points).max(1);
    let order = &levels.model_order.order;
    let rows = order.iter().step_by(step).copied();
    let (warped, target) = (&ws.state.warped, &*ws.target);
    if !ws.patterns.propose(rows.clone(), warped, target, reach) {
        return false;
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
    // Patterns are believed where so large a share of them lies within a spacing of one field: of
    // wrong candidates a sixteenth does.
    let agreed = agreement(target, pairs, &coarse.warped, ws.spacing) >= 0.3;
    if agreed {
        levels.extend(&mut ws.annealer, 1, step, &mut ws.state);
    }
    agreed
}

/// Share of the pairs whose targets lie within `distance` of where their model points were put.
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

// Samples of large sets, and fields that are extended from one to the next.

/// Points of a level for one of the next coarser level.
const STEP: usize = 8;

/// Samples of both sets, and where the coarser level put its points.
#[derive(Clone, Debug, Default)]
pub(super) struct Levels<const D: usize> {
    pub(super) model_order: Blocks<D>,
    target_order: Blocks<D>,
    model: Vec<[f64; D]>,
    target: Vec<[f64; D]>,
    /// Where the start puts all model points.
    base: Vec<[f64; D]>,
    coarse: State<D>,
    weights: Vec<f64>,
    wanted: Axes<D>,
    /// The prior at the points whose patterns are compared.
    sampled: Prior,
}

impl<const D: usize> Levels<D> {
    /// The sample of every `stride`-th point. All points in their own order for 1. Also sets the
    /// sample's base in `state`.
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

    /// The field of `coarse`, every `step`-th point of the level of this stride, at all points of
    /// that level, in `state.warped`.
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
        // Variance of a coarse field's values when it is extended: what its factor left out.
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
