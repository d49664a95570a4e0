//! The search: a list of starts, each run on its own schedule, until an answer leaves no doubt.
//!
//! A run is determined by its start and its schedule: [`place`](AnnealedSoftassign::place) sets all that it reads. Most scenes are
//! easy and end with the first, fast run. Where its answer neither fits exactly nor leaves residuals that noise explains, the further
//! starts follow, from what costs least to what costs most. The answer of least energy wins; noisy scenes then average over the
//! scales of the prior.
mod cooling;
mod place;
mod progress;

use super::prior::PriorScales;
use super::schedule::Schedule;
use super::{
    AnnealedSoftassign, Rotation, Search, SoftassignWorkspace, Transformation, finish, starts,
};
use cooling::{COOLEST, LABELLED, NEAR, REHEAT, SLOW, TURNED};
pub(super) use cooling::{Cooling, FAST};
use nalgebra::SMatrix;
use place::Start;
use progress::{COMPLETE, MANY};
use std::ops::ControlFlow;

/// Scales of the prior in the search.
pub(super) const SCALES: PriorScales = PriorScales {
    length: 1.2,
    bending: 0.35,
    affine: 0.5,
};

/// A cold run with partners for less than this share of the smaller set has collapsed.
const COLLAPSED: f64 = 0.5;
/// Residuals are compared no finer than this.
pub(super) const RESOLUTION: f64 = 0.01;
/// Soft partners spread more than this: the evidence of a warp cannot be told from that of its matches.
const UNDECIDED: f64 = 0.3;
/// Residuals below so many spacings are no sign that a part lies aside.
pub(super) const NOTICED: f64 = 0.1;
/// Runs whose energies differ by less have ended in the same answer.
const AGREEING: f64 = 0.5;
/// Gaussians fainter than this are left out.
const FAINTEST: f64 = 1e-6;
/// Rounds in which matches and noise level follow the averaged warp; a third one moves it by a hundredth of the noise.
const SETTLING: usize = 2;
/// In sets of so many points a part may lie one point aside though the residuals are small; fewer have too few inner points for patterns.
const PATTERNED: usize = 150;
/// Most runs from local patterns, and their first temperature in spacings.
const PATTERN_RUNS: usize = 3;
const PATTERN_SIGMA: f64 = 0.3;

type Observer<'a> = &'a mut dyn FnMut(usize, f64) -> ControlFlow<()>;

impl AnnealedSoftassign {
    pub(super) fn solve<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        observe: Observer<'_>,
    ) {
        let flow = if Self::is_large(ws) {
            reset(ws);
            self.solve_coarse_to_fine(ws, observe)
        } else {
            self.begin(ws);
            match self.search {
                Search::Near => self.run(ws, Start::Centred, NEAR, observe),
                Search::Thorough => self.search(ws, observe),
            }
        };
        ws.stopped = flow.is_break();
        self.conclude(ws);
    }

    /// Prepares a search over all points.
    fn begin<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        reset(ws);
        ws.annealer.volume = bounding_volume(&ws.target);
        ws.annealer.prior.build(&ws.model, SCALES);
        ws.annealer.soft.set_targets(&ws.target, &ws.deviations);
        ws.annealer.rigid.set(self.transformation, &ws.model);
        ws.annealer.known.clone_from(&ws.known);
    }

    /// One short run from `start`, at first as warm as `sigma`, between the coldest that lets points change their partners and
    /// that of sets near each other.
    pub(super) fn solve_from<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        start: &[[f64; D]],
        sigma: f64,
    ) {
        self.begin(ws);
        starts::centred(&ws.model, &ws.target, &mut ws.state.base);
        ws.state.warped.clear();
        ws.state.warped.extend_from_slice(start);
        let cooling = Cooling {
            sigma: sigma.clamp(COOLEST, NEAR.sigma),
            ..NEAR
        };
        // Nobody listens, so nobody breaks off.
        let _ = self.anneal(ws, cooling, &mut |_, _| ControlFlow::Continue(()));
        self.conclude(ws);
    }

    /// Reads the answer from the best run.
    fn conclude<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        ws.expected_share = self.share;
        if ws.starts > 1 || !self.is_exact(ws) {
            // Later runs have left their own fit behind.
            let schedule = self.schedule(Cooling {
                sigma: ws.best.sigma,
                ..SLOW
            });
            ws.annealer.restore(&ws.best, &mut ws.state, &schedule);
        }
        let slack = self.slack();
        let gain = ws.gain().unwrap_or(f64::INFINITY);
        let spread = &ws.scales.spread;
        ws.answer
            .read(&mut ws.annealer, &ws.best, &ws.target, slack, spread, gain);
    }

    /// All starts in turn, as long as the best answer leaves doubt; then the scales of the prior.
    fn search<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        observe: Observer<'_>,
    ) -> ControlFlow<()> {
        self.run(ws, Start::Centred, FAST, observe)?;
        self.try_further(ws, observe)?;
        let smaller = ws.model.len().min(ws.target.len());
        if smaller >= PATTERNED
            && ws.best.matched >= COLLAPSED * smaller as f64
            && !self.is_certain(ws)
            && !self.is_evident(ws)
        {
            self.follow_patterns(ws, observe)?;
        }
        let noisy = ws.best.sigma > finish::CLEAN || ws.annealer.soft.errors.differ();
        if noisy && !ws.annealer.rigid.is_active() {
            self.average_scales(ws);
        }
        ControlFlow::Continue(())
    }

    fn try_further<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        observe: Observer<'_>,
    ) -> ControlFlow<()> {
        let dense = ws.model.len().min(ws.target.len()) >= MANY;
        if dense && !self.is_done(ws) {
            self.follow_patterns(ws, observe)?;
        }
        let limited = self.rotation == Rotation::Limited;
        let rotations = if limited {
            starts::LIMITED
        } else {
            starts::ANY
        };
        // Warmer, the edges of a cropped set would draw it together again.
        let seeded = Cooling {
            sigma: PATTERN_SIGMA * ws.spacing,
            ..REHEAT
        };
        let first = [
            dense.then_some((Start::Tuples, seeded)),
            Some((Start::Best, REHEAT)),
            Some((Start::Centred, SLOW)),
            (!dense).then_some((Start::Tuples, seeded)),
            limited.then_some((Start::Labelling, LABELLED)),
        ];
        // A motion without bending has its basins far apart, and no prior that tells how likely it is.
        let bends = !ws.annealer.rigid.is_active();
        let moments = starts::rotations::<D>(rotations).map(|rotation| {
            let turned = limited && bends && rotation != SMatrix::<f64, D, D>::identity();
            (Start::Moments(rotation), if turned { TURNED } else { SLOW })
        });
        for (start, cooling) in first.into_iter().flatten().chain(moments) {
            if self.is_done(ws) {
                return ControlFlow::Continue(());
            }
            if matches!(start, Start::Labelling) && bends && self.is_hidden(ws) {
                continue;
            }
            let before = ws.best.energy;
            self.run(ws, start, cooling, observe)?;
            if matches!(start, Start::Centred) && (ws.state.energy - before).abs() < AGREEING {
                self.confirm(ws);
            }
        }
        if !self.is_done(ws) {
            self.run(ws, Start::Best, REHEAT, observe)?;
        }
        ControlFlow::Continue(())
    }

    /// Two runs have ended in the best answer: whether noise explains how far its soft partners spread.
    fn confirm<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        let variance = ws.best.sigma * ws.best.sigma;
        let slack = self.slack();
        ws.confirmed = ws.best.ambiguity <= ws.annealer.spread_of(&ws.target, variance, slack);
    }

    /// Short runs from where the patterns of a dense set put it, as long as each matches more points.
    fn follow_patterns<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        observe: Observer<'_>,
    ) -> ControlFlow<()> {
        let points = ws.model.len().min(ws.target.len()) as f64;
        for _ in 0..PATTERN_RUNS {
            let before = (ws.best.matched, ws.best.sigma);
            // The temperature follows from the spacing, which the patterns measure.
            let sigma = PATTERN_SIGMA * ws.spacing;
            let cooling = Cooling { sigma, ..REHEAT };
            if !self.place(ws, Start::Patterns) {
                break;
            }
            self.anneal(ws, cooling, observe)?;
            let (matched, sigma) = (ws.best.matched, ws.best.sigma);
            if matched >= COMPLETE * points
                || (matched < 1.01 * before.0 && sigma > 0.99 * before.1)
            {
                break;
            }
        }
        ControlFlow::Continue(())
    }

    /// A run from a start; skipped where the sets do not have such a start.
    fn run<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        start: Start<D>,
        cooling: Cooling,
        observe: Observer<'_>,
    ) -> ControlFlow<()> {
        if self.place(ws, start) {
            self.anneal(ws, cooling, observe)
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Anneals `ws.state` from where it was put; kept if it is the best so far.
    fn anneal<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        cooling: Cooling,
        observe: Observer<'_>,
    ) -> ControlFlow<()> {
        let schedule = self.schedule(cooling);
        let smaller = ws.model.len().min(ws.target.len());
        let schedule = Schedule {
            collapse: COLLAPSED * smaller as f64,
            partners: smaller as f64,
            ..schedule
        };
        ws.starts += 1;
        ws.state.trace.clear();
        ws.state.iterations = 0;
        (ws.state.energy, ws.state.tail) = (f64::INFINITY, 0.0);
        let flow = ws.annealer.run(&mut ws.state, &schedule, observe);
        if ws.starts == 1 {
            ws.best.copy_from(&ws.state);
            if self.is_exact(ws) {
                return flow; // there will be nothing to compare it with
            }
            ws.spacing = ws.patterns.typical_spacing(&ws.target);
        }
        ws.state.tail = ws.annealer.tail(NOTICED * ws.spacing);
        ws.annealer.evaluate(&mut ws.state, self.share, RESOLUTION);
        if ws.state.energy + cooling.margin < ws.best.energy || ws.starts == 1 {
            ws.best.copy_from(&ws.state);
        }
        flow
    }

    /// The last stage on noisy data: the mean over the prior's scales, by their evidence, twice: the first changes matches and noise.
    fn average_scales<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        let schedule = self.schedule(Cooling {
            sigma: ws.best.sigma,
            ..SLOW
        });
        if ws.annealer.restore(&ws.best, &mut ws.state, &schedule) > UNDECIDED {
            return;
        }
        let average = |ws: &mut SoftassignWorkspace<D>, likely: bool| {
            let variance = ws.best.sigma * ws.best.sigma;
            let request = ws.annealer.request();
            ws.scales.average(
                request,
                &ws.model,
                &mut ws.best,
                variance,
                SCALES.affine,
                likely,
            )
        };
        // The first average improves the matches and the noise level that the second one starts from.
        let likeliest = average(ws, false);
        ws.annealer.prior.build(&ws.model, likeliest);
        ws.state.copy_from(&ws.best);
        ws.annealer.settle(&mut ws.state, &schedule, SETTLING);
        ws.best.sigma = ws.state.sigma;
        average(ws, true);
    }

    pub(super) fn schedule(&self, cooling: Cooling) -> Schedule {
        // A motion without bending stands still while it turns into place.
        let bends = self.transformation == Transformation::NonRigid;
        Schedule {
            sigma: cooling.sigma,
            floor: finish::FLOOR,
            rate: cooling.rate,
            least: cooling.least,
            extrapolates: cooling.extrapolates && bends,
            patience: cooling.patience,
            stuck: if bends {
                cooling.stuck
            } else {
                cooling.patience
            },
            limit: self.max_iterations,
            sweeps: cooling.sweeps,
            still: cooling.still,
            collapse: 0.0,
            partners: f64::INFINITY,
            slack: self.slack(),
        }
    }
}

/// Nothing is found yet.
fn reset<const D: usize>(ws: &mut SoftassignWorkspace<D>) {
    ws.annealer.soft.faintest = FAINTEST;
    ws.patterns.spacing = 0.0;
    ws.spacing = 0.0;
    ws.scales.spread.clear();
    (ws.starts, ws.stopped, ws.confirmed) = (0, false, false);
    ws.best.energy = f64::INFINITY;
}

/// Volume of the bounding box; thin sides count as a tenth of the model's radius.
pub(super) fn bounding_volume<const D: usize>(points: &[[f64; D]]) -> f64 {
    let side = |k: usize| {
        let (low, high) = points
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[k]), h.max(p[k])));
        (high - low).max(0.1)
    };
    (0..D).map(side).product()
}
