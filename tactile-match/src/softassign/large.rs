//! Large sets, coarse to fine.
//!
//! One annealing run from a warm start costs `O(I J)`, which is too much for tens of thousands of points. A well-spread sample of either set
//! (every 8ᵏ-th point in the order of a k-d tree) is registered first: its points are not each other's partners, but the field that takes
//! one density onto the other is the whole set's [Hirose, *Acceleration of non-rigid point set registration with downsampling and Gaussian
//! process regression*, IEEE TPAMI 43 (2021)]. The field is extended to a sample eight times as large, which starts no warmer than the
//! coarser sample was dense, and so on to all points. There only targets within a few spacings are looked at: time `O(I r²)` an
//! iteration with r ≤ 64 modes of the prior, memory `O(I r)`.

use super::levels::{Levels, STEP};
use super::schedule::Schedule;
use super::search::{FAST, NOTICED, RESOLUTION, SCALES, bounding_volume};
use super::{AnnealedSoftassign, Rotation, SoftassignWorkspace, finish, starts};
use std::ops::ControlFlow;

/// Sets of which both have so many points are matched coarse to fine.
pub(super) const LARGE: usize = 4000;
/// The coarsest sample has at least so many points: fewer show too little of a set's shape.
const COARSEST: usize = 500;
/// A sample is annealed down to so many of its spacings: its points are no partners, and nearer than that there is nothing to see. Half as
/// much takes twice the time and leaves noisy sets below their noise (`--example large_sets`).
const SAMPLED: f64 = 1.0;
/// First temperature of a level in spacings of the coarser one.
const FIRST: f64 = 1.0;
/// Gaussians fainter than this are left out in large sets: the positions move by a thousandth of the temperature.
const FAINTEST: f64 = 1e-4;
/// Rounds in which warp and noise level follow each other at the end of noisy sets.
const SETTLING: usize = 4;

/// Points whose local patterns are compared first, and how far away their candidates may be: in spacings, so many times farther where those
/// do not agree on a field, and at most in radii of the model.
const SEEDS: usize = 120;
const SEED_SPACINGS: f64 = 8.0;
const SEED_GROWTH: f64 = 2.5;
const SEED_REACH: f64 = 0.25;
/// Points and reach, in spacings, of the patterns that make the seeds' field exact.
const GROWN: usize = 1000;
const GROWN_SPACINGS: f64 = 4.0;
/// Patterns are believed where so large a share of them lies within a spacing of one field: of wrong candidates a sixteenth does.
const AGREED: f64 = 0.3;
/// First temperature after the patterns, in spacings.
const NEAR_BY: f64 = 0.4;
/// Where noise hides the patterns, all points are annealed as the residuals decide, until residuals and temperature, as variances, differ by less
/// than this share. A tenth of it takes a tenth more time for the same errors; ten iterations alone leave volumes three noise widths from
/// the truth (`--example large_sets -- 20000 volume 0.01 0.2`).
const NOISY_STILL: f64 = 1e-3;

impl AnnealedSoftassign {
    /// Whether sets of these sizes are matched coarse to fine.
    pub(super) fn is_large<const D: usize>(ws: &SoftassignWorkspace<D>) -> bool {
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
        while smaller / (stride * STEP) >= COARSEST {
            stride *= STEP;
        }
        ws.annealer.volume = bounding_volume(&ws.target);
        let mut levels = std::mem::take(&mut ws.levels);
        levels.model_order.build(&ws.model);
        levels.target_order.build(&ws.target);
        let mut flow = self.coarsest(ws, &mut levels, stride, observe);
        while stride > 1 {
            let sigma = FIRST * ws.spacing;
            stride /= STEP;
            levels.coarse.copy_from(&ws.state);
            self.enter(ws, &mut levels, stride);
            levels.extend(&mut ws.annealer, stride, STEP, &mut ws.state);
            let run = if stride > 1 {
                self.sampled(ws, sigma)
            } else if self.follow_sampled_patterns(ws, &mut levels) {
                Schedule {
                    sigma: NEAR_BY * ws.spacing,
                    ..self.schedule(FAST)
                }
            } else {
                Schedule {
                    sigma,
                    least: 1.0,
                    still: NOISY_STILL,
                    ..self.schedule(FAST)
                }
            };
            flow = refine(ws, run, flow, observe);
        }
        let schedule = self.schedule(FAST);
        let noisy = ws.state.sigma > finish::CLEAN || ws.annealer.soft.errors.differ();
        if flow.is_continue() && noisy {
            ws.annealer.settle(&mut ws.state, &schedule, SETTLING);
        }
        ws.levels = levels;
        ws.starts = 1;
        ws.state.energy = f64::INFINITY;
        ws.state.tail = ws.annealer.tail(NOTICED * ws.spacing);
        ws.best.copy_from(&ws.state);
        if !self.is_exact(ws) {
            ws.annealer.evaluate(&mut ws.state, self.share, RESOLUTION);
            ws.best.copy_from(&ws.state);
        }
        flow
    }

    /// Puts `ws.state` where local patterns agree it belongs: first those of a few points with candidates far away, then those of many
    /// with candidates near the field found. False, and no change, where they do not agree.
    fn follow_sampled_patterns<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        levels: &mut Levels<D>,
    ) -> bool {
        let mut reach = SEED_SPACINGS * ws.spacing;
        while !follow_patterns_of(ws, levels, SEEDS, reach.min(SEED_REACH)) {
            if reach >= SEED_REACH {
                return false;
            }
            reach *= SEED_GROWTH;
        }
        follow_patterns_of(ws, levels, GROWN, GROWN_SPACINGS * ws.spacing)
    }

    /// Sets up targets, prior and spacing of a level.
    fn enter<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        levels: &mut Levels<D>,
        stride: usize,
    ) {
        levels.sample(
            &ws.model,
            (&ws.target, &ws.deviations),
            stride,
            &mut ws.state,
        );
        ws.annealer.prior.build(&levels.model, SCALES);
        ws.annealer
            .soft
            .set_targets(&levels.target, &levels.deviations);
        ws.annealer.rigid.set(self.transformation, &levels.model);
        // Rows of samples are others: landmarks count at all points alone.
        ws.annealer.known.clear();
        if stride == 1 {
            ws.annealer.known.extend_from_slice(&ws.known);
        }
        ws.spacing = ws.patterns.typical_spacing(&levels.target);
    }

    /// The coarsest level, from the centroids; where any rotation is allowed the best of several starts.
    fn coarsest<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        levels: &mut Levels<D>,
        stride: usize,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        starts::centred(&ws.model, &ws.target, &mut levels.base);
        self.enter(ws, levels, stride);
        ws.state.warped.clone_from(&ws.state.base);
        let run = self.sampled(ws, FAST.sigma);
        refine(ws, run, ControlFlow::Continue(()), observe)?;
        if self.rotation == Rotation::Limited {
            return ControlFlow::Continue(());
        }
        ws.annealer.evaluate(&mut ws.state, self.share, RESOLUTION);
        ws.best.copy_from(&ws.state);
        let mut base = levels.base.clone();
        for rotation in starts::rotations::<D>(starts::ANY) {
            starts::moments(&ws.model, &ws.target, &rotation, &mut levels.base);
            levels.sample(
                &ws.model,
                (&ws.target, &ws.deviations),
                stride,
                &mut ws.state,
            );
            ws.state.warped.clone_from(&ws.state.base);
            let run = self.sampled(ws, FAST.sigma);
            refine(ws, run, ControlFlow::Continue(()), observe)?;
            ws.annealer.evaluate(&mut ws.state, self.share, RESOLUTION);
            if ws.state.energy < ws.best.energy {
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
            sigma,
            floor: SAMPLED * ws.spacing,
            ..self.schedule(FAST)
        }
    }
}

/// One annealing run of a level; a single silent iteration where the caller has had enough.
fn refine<const D: usize>(
    ws: &mut SoftassignWorkspace<D>,
    schedule: Schedule,
    flow: ControlFlow<()>,
    observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
) -> ControlFlow<()> {
    ws.state.trace.clear();
    ws.state.iterations = 0;
    ws.annealer.soft.faintest = FAINTEST;
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

/// Puts `ws.state` onto the field that the local patterns of about `points` model points agree on; candidates lie up to `reach` away.
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
    if !ws.patterns.propose_for(rows.clone(), warped, target, reach) {
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
    let agreed = agreement(target, pairs, &coarse.warped, ws.spacing) >= AGREED;
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
        let square: f64 = (0..D).map(|k| (target[*j][k] - w[k]).powi(2)).sum();
        square < distance * distance
    };
    let agreeing = pairs.iter().zip(warped).filter(near).count();
    agreeing as f64 / pairs.len().max(1) as f64
}
