//! The search: which starts are tried, and in which order.
//!
//! Most scenes are easy and end with the first, fast run. Where the answer is not exact and complete, further starts
//! follow: from the patterns of a dense set, warmer and slower, from shape contexts and relaxation labelling, from the
//! moments. The start with the least energy wins; noisy scenes then choose the scales of the prior by their evidence.
mod complete;
mod refine;

use super::anneal::Schedule;
use super::prior::PriorScales;
use super::{AnnealedSoftassign, Rotation, Search, SoftassignWorkspace, finish, starts};
use std::ops::ControlFlow;

/// Scales of the prior in the search.
const SCALES: PriorScales = PriorScales {
    length: 1.2,
    bending: 0.35,
    affine: 0.5,
};
/// Where a run starts and how fast it cools.
#[derive(Clone, Copy, Debug)]
struct Pace {
    sigma: f64,
    rate: f64,
    least: f64,
    patience: usize,
    sweeps: usize,
}

/// The first try: most scenes are easy.
const FAST: Pace = Pace {
    sigma: 0.3,
    rate: 0.75,
    least: 0.9,
    patience: usize::MAX,
    sweeps: 3,
};
/// From the best answer so far.
const REHEAT: Pace = Pace {
    sigma: 0.1,
    rate: 0.9,
    least: 1.0,
    patience: usize::MAX,
    sweeps: 5,
};
/// The only try between sets that lie near each other. Residuals that stay above the temperature, whatever else moves, end it.
const NEAR: Pace = Pace {
    sigma: 0.2,
    rate: 0.8,
    least: 1.0,
    patience: 12,
    sweeps: 3,
};
/// Least first temperature of a run from the last answer of a series.
const COOLEST: f64 = 0.03;
/// Further tries.
const SLOW: Pace = Pace {
    sigma: 0.3,
    rate: 0.93,
    least: 1.0,
    patience: usize::MAX,
    sweeps: 5,
};
/// Residuals are judged no finer than this.
const RESOLUTION: f64 = 0.01;

/// Soft partners spread more than this: the evidence of a warp cannot be told from that of its matches.
const UNDECIDED: f64 = 0.3;

impl AnnealedSoftassign {
    pub(super) fn solve<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) {
        begin(ws);
        let flow = match self.options.search {
            Search::Near => self.attempt(ws, NEAR, observe),
            Search::Thorough => {
                let flow = self.attempt(ws, FAST, observe);
                self.try_further(ws, flow, observe)
            }
        };
        ws.stopped = flow.is_break();
        self.conclude(ws);
    }

    /// One short run from `start`, at first as warm as `sigma`, between the coldest that lets points change their partners and
    /// that of sets near each other.
    pub(super) fn solve_from<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        start: &[[f64; D]],
        sigma: f64,
    ) {
        begin(ws);
        ws.state.warped.clear();
        ws.state.warped.extend_from_slice(start);
        let pace = Pace {
            sigma: sigma.clamp(COOLEST, NEAR.sigma),
            ..NEAR
        };
        // Nobody listens, so nobody breaks off.
        let _ = self.refine(ws, pace, &mut |_, _| ControlFlow::Continue(()));
        self.conclude(ws);
    }

    /// Reads the answer from the best run.
    fn conclude<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        if ws.starts > 1 || !self.is_exact(ws) {
            // Later runs have left their own fit behind.
            let schedule = self.schedule(Pace {
                sigma: ws.best.sigma,
                ..SLOW
            });
            ws.annealer.restore(&ws.best, &mut ws.state, &schedule);
        }
        ws.answer
            .read(&mut ws.annealer, &ws.best, &ws.target, self.options.slack());
    }

    /// What follows the first run where its answer is not exact and complete.
    fn try_further<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        mut flow: ControlFlow<()>,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if flow.is_continue() && !self.is_done(ws) {
            flow = self.mend(ws, observe);
        }
        if flow.is_continue() && !self.is_done(ws) {
            starts::centred(&ws.model, &ws.target, &mut ws.state.base);
            flow = self.attempt(ws, SLOW, observe);
        }
        if self.options.rotation == Rotation::Limited && flow.is_continue() && !self.is_done(ws) {
            starts::centred(&ws.model, &ws.target, &mut ws.state.base);
            ws.state.warped.clone_from(&ws.state.base);
            ws.correspondence.find(&ws.state.base, &ws.target);
            let sets = (&*ws.model, &*ws.target);
            ws.consensus.fit(
                &mut ws.annealer,
                SCALES,
                sets,
                &ws.correspondence.pairs,
                &mut ws.state,
            );
            flow = self.refine(
                ws,
                Pace {
                    sigma: 0.15,
                    ..SLOW
                },
                observe,
            );
        }
        let rotations = match self.options.rotation {
            Rotation::Any => starts::ANY,
            Rotation::Limited => starts::LIMITED,
        };
        for rotation in starts::rotations::<D>(rotations) {
            if flow.is_break() || self.is_done(ws) {
                break;
            }
            starts::moments(&ws.model, &ws.target, &rotation, &mut ws.state.base);
            flow = self.attempt(ws, SLOW, observe);
        }
        if flow.is_continue() && !self.is_done(ws) && ws.starts > 2 {
            flow = self.reheat(ws, REHEAT.sigma, observe);
        }
        if flow.is_continue() && ws.best.sigma > finish::CLEAN {
            self.fit_scales(ws);
        }
        flow
    }

    /// The last stage on noisy data: the prior's scales by their evidence, each with the noise level that fits it.
    fn fit_scales<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        let schedule = self.schedule(Pace {
            sigma: ws.best.sigma,
            ..SLOW
        });
        if ws.annealer.restore(&ws.best, &mut ws.state, &schedule) > UNDECIDED {
            return;
        }
        ws.best.energy = f64::INFINITY;
        let mut winner = SCALES;
        ws.start.copy_from(&ws.best);
        ws.mean.clear();
        ws.mean.resize(ws.model.len(), [0.0; D]);
        let mut total = 0.0;
        for length in [1.2, 1.7, 2.4, 3.4] {
            for bending in [0.35, 0.2, 0.1, 0.05, 0.025] {
                let scales = PriorScales {
                    length,
                    bending: bending * length / 1.2,
                    ..SCALES
                };
                ws.annealer.prior.build(&ws.model, scales);
                ws.state.copy_from(&ws.start);
                ws.annealer.settle(&mut ws.state, &schedule, 4);
                ws.annealer
                    .evaluate(&mut ws.state, self.options.share, RESOLUTION);
                let old = if total > 0.0 {
                    ws.best.energy
                } else {
                    ws.state.energy
                };
                if ws.state.energy < ws.best.energy {
                    let f = (ws.state.energy - old).exp();
                    total *= f;
                    ws.mean.iter_mut().for_each(|p| *p = p.map(|v| v * f));
                    winner = scales;
                    ws.best.copy_from(&ws.state);
                }
                let w = (ws.best.energy - ws.state.energy).exp();
                total += w;
                for (p, q) in ws.mean.iter_mut().zip(&ws.state.warped) {
                    (0..D).for_each(|k| p[k] += w * q[k]);
                }
            }
        }
        ws.annealer.prior.build(&ws.model, winner);
        ws.best
            .warped
            .iter_mut()
            .zip(&ws.mean)
            .for_each(|(p, s)| *p = s.map(|v| v / total));
    }

    fn schedule(&self, pace: Pace) -> Schedule {
        Schedule {
            sigma: pace.sigma,
            floor: 1e-3,
            rate: pace.rate,
            least: pace.least,
            patience: pace.patience,
            limit: self.options.max_iterations,
            sweeps: pace.sweeps,
            slack: self.options.slack(),
        }
    }

    /// A run from `ws.state.base` itself.
    fn attempt<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        pace: Pace,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        ws.state.warped.clone_from(&ws.state.base);
        self.refine(ws, pace, observe)
    }

    /// A run from `ws.state.warped`; kept if it is the best so far.
    fn refine<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        pace: Pace,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let schedule = self.schedule(pace);
        ws.starts += 1;
        ws.state.trace.clear();
        ws.state.iterations = 0;
        let flow = ws.annealer.run(&mut ws.state, &schedule, observe);
        if ws.starts == 1 {
            ws.best.copy_from(&ws.state);
            if self.is_exact(ws) {
                return flow; // there will be nothing to compare it with
            }
        }
        ws.annealer
            .evaluate(&mut ws.state, self.options.share, RESOLUTION);
        if ws.state.energy < ws.best.energy || ws.starts == 1 {
            ws.best.copy_from(&ws.state);
        }
        flow
    }
}

/// Prepares a search: nothing is found yet, the sets lie with their centroids on each other.
fn begin<const D: usize>(ws: &mut SoftassignWorkspace<D>) {
    ws.annealer.volume = bounding_volume(&ws.target);
    ws.annealer.prior.build(&ws.model, SCALES);
    ws.annealer.soft.set_targets(&ws.target);
    ws.patterns.spacing = 0.0;
    (ws.starts, ws.stopped) = (0, false);
    ws.best.energy = f64::INFINITY;
    starts::centred(&ws.model, &ws.target, &mut ws.state.base);
}

/// Volume of the bounding box; thin sides count as a tenth of the model's radius.
fn bounding_volume<const D: usize>(points: &[[f64; D]]) -> f64 {
    let side = |k: usize| {
        let (low, high) = points
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[k]), h.max(p[k])));
        (high - low).max(0.1)
    };
    (0..D).map(side).product()
}
