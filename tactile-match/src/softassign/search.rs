//! The search: a race of runs from a list of starts, compared by evidence, until an answer leaves
//! no doubt.
//!
//! Most scenes are easy and end with the first, fast run. If its answer does not fit exactly and
//! noise does not explain its residuals, further starts follow, from the cheapest to the most
//! expensive. The run with the lowest energy wins. For noisy scenes the scales of the prior are then
//! averaged.

use super::confidence::{self, MIN_TELLING_GAIN};
use super::consensus::Consensus;
use super::correspond::Correspondence;
use super::fine::FineFit;
use super::large::Levels;
use super::motion::Motions;
use super::patterns::LocalPatterns;
use super::problem::Problem;
use super::rivals::LookUp;
use super::run::{Annealer, Cooling, Run, Schedule};
use super::scales::ScaleAverage;
use super::starts::{FAST, MOVED, NEAR, OPEN, REHEAT, SLOW, Start, further_starts};
use super::tuples::Tuples;
use super::{Mechanism, Rotation, Search, starts};
use crate::gaussian_process::PriorScales;
use crate::{Doubt, Watch};
use nalgebra::SVector;
use std::ops::ControlFlow;

/// Scales of the prior in the search.
pub(super) const SCALES: PriorScales = PriorScales {
    length: 1.2,
    bending: 0.35,
    affine: 0.5,
};
/// Largest distance of targets with which the pattern of a point is compared, in radii of the
/// model.
pub(super) const MAX_PATTERN_REACH: f64 = 0.25;

/// First temperature of a start from the motions, relative to the distance that four in five points
/// do not exceed: the remaining points are twice as far.
const MISSES: f64 = 2.0;
/// Lowest such temperature, in mean spacings: it allows for bending between the blocks.
const COLDEST: f64 = 0.1;
/// Minimum fraction of the points in view that an answer from the block motions matches: more may
/// be missing on either side.
const FOLLOWED: f64 = 0.75;
/// A larger fraction of unexplained residuals comes from a displaced part: noise explains one
/// residual in a thousand, and swaps of random points a few.
const LEAST_ASIDE: f64 = 0.02;
/// If soft partners spread more than this, relative to the temperature, the evidence of a warp is
/// hidden by that of its matches.
const MOST_SPREAD: f64 = 0.3;
/// If an answer in space from the motions of blocks has residuals below this, in spacings, no
/// further start is needed.
const SLIPPED: f64 = 0.15;
/// Error of a block's motion, in spacings.
const MOTION_ERROR: f64 = 0.15;
/// Working memory of the runs. No run depends on what another has left here.
#[derive(Clone, Debug, Default)]
pub(super) struct Runner<const D: usize> {
    pub annealer: Annealer<D>,
    /// The current run.
    pub run: Run<D>,
    /// The best run from the motions of blocks, while the other starts are tried.
    followed: Run<D>,
    correspondence: Correspondence,
    pub patterns: LocalPatterns<D>,
    pub lookup: LookUp<D>,
    pub consensus: Consensus<D>,
    tuples: Tuples<D>,
    pub scales: ScaleAverage<D>,
    pub fine: FineFit<D>,
    pub levels: Levels<D>,
    motions: Motions<D>,
    /// Vectors from a model point to its neighbours.
    pub steps: Vec<SVector<f64, D>>,
}

impl<const D: usize> Runner<D> {
    /// Prepares prior and targets for all points.
    fn prepare(&mut self, problem: &Problem<D>) {
        self.annealer
            .enter(problem, &problem.model, &problem.target);
    }
}

impl<const D: usize> Annealer<D> {
    /// Prepares prior and targets for these points of the sets.
    pub(super) fn enter(&mut self, problem: &Problem<D>, model: &[[f64; D]], target: &[[f64; D]]) {
        // In large sets smaller Gaussians are dropped. This changes the positions by a thousandth of
        // the temperature.
        self.soft.faintest = if problem.is_large() { 1e-4 } else { 1e-6 };
        self.soft.set_targets(target);
        self.prior.build(model, SCALES);
        self.rigid.set(problem.options.transformation, model);
    }
}

/// What a search has found, beside its best run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outcome {
    /// Number of runs.
    pub starts: usize,
    /// Whether the caller stopped it.
    pub stopped: bool,
    /// Another answer that fits as well, or better but is excluded by the options.
    pub rival: Option<Doubt>,
    /// Whether all rotations are allowed and one maps the model onto itself.
    pub symmetric: bool,
}

/// A search: a race of runs. The best so far wins.
pub(super) struct Race<'a, const D: usize> {
    pub problem: &'a Problem<D>,
    pub runner: &'a mut Runner<D>,
    /// The best run so far.
    pub best: &'a mut Run<D>,
    pub watch: Watch<'a>,
    /// Number of runs.
    pub starts: usize,
    /// Number of points matched by the best run before the last one.
    matched_before: f64,
}

impl<'a, const D: usize> Race<'a, D> {
    pub(super) fn new(
        problem: &'a Problem<D>,
        runner: &'a mut Runner<D>,
        best: &'a mut Run<D>,
        watch: Watch<'a>,
    ) -> Self {
        runner.scales.spread.clear();
        (best.matched, best.energy) = (0.0, f64::INFINITY);
        (best.noisy, best.far) = (false, false);
        Self {
            problem,
            runner,
            best,
            watch,
            starts: 0,
            matched_before: 0.0,
        }
    }

    /// Searches for the best run, which stays in `best`. Returns a rival of it.
    pub(super) fn go(&mut self) -> ControlFlow<(), Option<Doubt>> {
        if self.problem.is_large() {
            return self.coarse_to_fine();
        }
        self.runner.prepare(self.problem);
        match self.problem.options.search {
            Search::Near => self.run(Start::Centred, NEAR).map_continue(|()| None),
            Search::Thorough => self.search(),
        }
    }

    /// One short run from `start`. Its first temperature is `sigma`, limited to the range between
    /// the lowest at which points still change partners and that of sets near each other.
    pub(super) fn go_from(
        &mut self,
        start: &[[f64; D]],
        sigma: f64,
    ) -> ControlFlow<(), Option<Doubt>> {
        self.runner.prepare(self.problem);
        let run = &mut self.runner.run;
        run.base.clone_from(&self.problem.model);
        run.warped.clear();
        run.warped.extend_from_slice(start);
        let sigma = sigma.clamp(0.03, NEAR.sigma);
        self.anneal(Cooling { sigma, ..NEAR })
            .map_continue(|()| None)
    }

    /// Prepares the reading of the answer: soft matches and regression become those of the best run.
    /// `rival` is `None` if the search was stopped.
    pub(super) fn outcome(mut self, rival: Option<Option<Doubt>>) -> Outcome {
        let stopped = rival.is_none();
        if stopped && self.starts == 0 {
            // Stopped before a run ended: a single iteration is the answer.
            self.runner.prepare(self.problem);
            let mut stop = || ControlFlow::Break(());
            let mut once = Race::new(self.problem, self.runner, self.best, &mut stop);
            let sigma = NEAR.sigma.min(self.problem.spacing);
            let _ = once.run(Start::Centred, Cooling { sigma, ..NEAR });
            self.starts = 1;
        }
        let noisy = self.best.noisy || self.resolve();
        if self.starts > 1 || noisy || !self.is_exact() {
            // Soft matches and regression are those of the last run, which may not be the best run.
            let schedule = self.schedule_at_end();
            let Runner { annealer, run, .. } = &mut *self.runner;
            annealer.restore(self.best, run, &schedule);
        }
        let any = self.problem.options.rotation == Rotation::Any;
        Outcome {
            starts: self.starts,
            stopped,
            rival: rival.flatten(),
            symmetric: any && self.is_symmetric(),
        }
    }

    /// Tries the starts in turn until the best run leaves no doubt, then averages over the scales of
    /// the prior. Returns a rival of the answer.
    fn search(&mut self) -> ControlFlow<(), Option<Doubt>> {
        let follows = self.problem.is_dense() && self.has(Mechanism::Motions);
        if follows {
            self.run(Start::Moved, MOVED)?;
        }
        if self.starts == 0 || !(self.is_exact() || self.is_likely()) {
            // Further starts would continue from this run even if it is wrong.
            std::mem::swap(&mut self.runner.followed, self.best);
            (self.best.energy, self.best.matched) = (f64::INFINITY, 0.0);
            let runs = std::mem::take(&mut self.starts);
            self.try_starts()?;
            if runs > 0 && !self.is_exact() && self.runner.followed.energy < self.best.energy {
                std::mem::swap(&mut self.runner.followed, self.best);
            }
            self.starts += runs;
        }
        let rival = self.look_for_rivals()?;
        let noisy = self.best.sigma > self.problem.limits.clean;
        if noisy && !self.best.noisy && self.has(Mechanism::Scales) && self.problem.bends() {
            self.average_scales()?;
        }
        ControlFlow::Continue(rival)
    }

    pub(super) fn has(&self, mechanism: Mechanism) -> bool {
        self.problem.options.has(mechanism)
    }

    /// Tries the starts that do not use the unmoved sets, until the best run leaves no doubt.
    fn try_starts(&mut self) -> ControlFlow<()> {
        self.run(Start::Centred, FAST)?;
        if !self.best.settled && self.best.iterations >= self.problem.options.max_iterations {
            return ControlFlow::Continue(()); // the limit would stop every further start as well
        }
        for (start, cooling) in further_starts(self.problem) {
            if self.is_done() || self.resolve() {
                return ControlFlow::Continue(());
            }
            self.run(start, cooling)?;
        }
        let open = !self.problem.is_dense() && self.has(Mechanism::Open);
        if open && self.is_cold() && !self.is_done() && !self.resolve() {
            let sigma = 0.3 * self.problem.spacing;
            self.run(Start::Best, Cooling { sigma, ..OPEN })?;
            if self.is_cold() {
                self.run(Start::Centred, OPEN)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Runs from a start. Does nothing if the sets have no such start.
    fn run(&mut self, start: Start<D>, cooling: Cooling) -> ControlFlow<()> {
        if !self.place(start)? {
            return ControlFlow::Continue(());
        }
        let sigma = match start {
            Start::Moved => self.warmth(),
            _ => cooling.sigma,
        };
        self.anneal(Cooling { sigma, ..cooling })
    }

    /// Sets the current run to a start: base and warped positions. Returns `false` if the sets have
    /// no such start.
    fn place(&mut self, start: Start<D>) -> ControlFlow<(), bool> {
        const NO_START: ControlFlow<(), bool> = ControlFlow::Continue(false);
        let problem = self.problem;
        let (model, target, spacing) = (&*problem.model, &*problem.target, problem.spacing);
        let Runner {
            annealer,
            run,
            patterns,
            consensus,
            tuples,
            correspondence,
            levels,
            ..
        } = &mut *self.runner;
        match start {
            Start::Best => {
                run.copy_from(self.best);
                return ControlFlow::Continue(true);
            }
            Start::Patterns => {
                run.copy_from(self.best);
                let (rows, reach) = (0..model.len(), MAX_PATTERN_REACH);
                let sets = (&*run.warped, target);
                if !patterns.propose(rows, sets, spacing, reach, self.watch)? {
                    return NO_START;
                }
                consensus.fit(annealer, problem, model, &patterns.pairs, run);
                return ControlFlow::Continue(true);
            }
            Start::Moved => {
                if problem.is_dense() {
                    levels.model_order.build(model);
                }
                return self.place_by_motions();
            }
            Start::Centred => run.base.clone_from(&problem.model),
            Start::Moments(rotation) => {
                starts::moments(model, target, &rotation, &mut run.base);
            }
            Start::Tuples => {
                let limited = problem.options.rotation == Rotation::Limited;
                let (base, still) = (&mut run.base, problem.frame.still());
                if !tuples.find((model, target), spacing, limited, &still, base, self.watch)? {
                    return NO_START;
                }
            }
            Start::Labelling => {
                // If noise hides the correspondence, the surroundings of the points hold no
                // information.
                let hidden = self.best.ambiguity >= 0.8 && self.best.sigma >= 0.999 * REHEAT.sigma;
                if hidden && problem.bends() {
                    return NO_START;
                }
                run.base.clone_from(&problem.model);
                correspondence.find(&run.base, target, self.watch)?;
                consensus.fit(annealer, problem, model, &correspondence.pairs, run);
                return ControlFlow::Continue(true);
            }
        }
        run.warped.clone_from(&run.base);
        ControlFlow::Continue(true)
    }

    /// Moves the current run by the motions of the blocks. Returns `false` if they do not agree on a
    /// field.
    pub(super) fn place_by_motions(&mut self) -> ControlFlow<(), bool> {
        let problem = self.problem;
        let Runner {
            annealer,
            run,
            levels,
            motions,
            ..
        } = &mut *self.runner;
        let still = problem.frame.still();
        let as_it_lies = |p: &[f64; D]| std::array::from_fn(|k| p[k] + still[k]);
        run.base.clear();
        run.base.extend(problem.model.iter().map(as_it_lies));
        let spacing = problem.mean_spacing;
        let sets = (&*run.base, &*problem.target);
        let order = &levels.model_order.order;
        if !motions.find(sets, order, spacing, problem.farthest, self.watch)? {
            return ControlFlow::Continue(false);
        }
        let mean = SVector::from(motions.mean());
        for p in &mut run.base {
            *p = (SVector::from(*p) + mean).into();
        }
        let Annealer {
            weights,
            residuals,
            prior,
            regression,
            rigid,
            ..
        } = annealer;
        weights.clear();
        weights.resize(prior.stride, 0.0);
        residuals.fill(prior.stride, run.base.iter().map(|_| [0.0; D]));
        let seeds = motions.seeds.iter();
        for (row, motion) in seeds.filter_map(|seed| Some((seed.row, seed.value()?))) {
            weights[row] = 1.0;
            for k in 0..D {
                residuals.0[k][row] = motion[k] - mean[k];
            }
        }
        let variance = (MOTION_ERROR * spacing).powi(2);
        if problem.bends() {
            regression.fit(prior, weights, residuals, variance);
        } else {
            rigid.fit(weights, &run.base, residuals, variance, regression);
        }
        let field = &regression.displacement.0;
        run.warped.clear();
        let rows = run.base.iter().enumerate();
        let moved = rows.map(|(i, b)| std::array::from_fn(|k| b[k] + field[k][i]));
        run.warped.extend(moved);
        ControlFlow::Continue(true)
    }

    /// Temperature of a start from the motions of blocks: at most their error. At a higher
    /// temperature, sets that already coincide would drift along a lattice.
    pub(super) fn warmth(&mut self) -> f64 {
        let spacing = self.problem.mean_spacing;
        let Runner { motions, run, .. } = &mut *self.runner;
        let miss = motions.miss(&run.warped, &self.problem.target, spacing);
        (MISSES * miss).clamp(COLDEST * spacing, MOVED.sigma * spacing)
    }

    /// Anneals the current run, and keeps it if it is the best so far.
    fn anneal(&mut self, cooling: Cooling) -> ControlFlow<()> {
        self.matched_before = self.best.matched;
        let run = &mut self.runner.run;
        (run.energy, run.tail) = (f64::INFINITY, 0.0);
        let flow = self.anneal_only(cooling);
        let (problem, run) = (self.problem, &mut self.runner.run);
        run.far = problem.is_far(&run.warped);
        if self.starts == 1 {
            self.best.copy_from(run);
            if self.is_exact() {
                return flow; // no other run follows to compare it with
            }
        }
        let Runner { run, annealer, .. } = &mut *self.runner;
        run.tail = annealer.tail(0.1 * problem.spacing);
        annealer.evaluate(run, problem.slack(), problem.limits.resolution);
        if run.far {
            run.energy = f64::INFINITY;
        }
        if run.energy < self.best.energy || self.starts == 1 {
            self.best.copy_from(run);
        }
        flow
    }

    /// Anneals the current run.
    pub(super) fn anneal_only(&mut self, cooling: Cooling) -> ControlFlow<()> {
        let smaller = self.problem.smaller() as f64;
        let schedule = Schedule {
            collapse: 0.5 * smaller,
            partners: smaller,
            ..self.problem.schedule(cooling)
        };
        self.starts += 1;
        let Runner { run, annealer, .. } = &mut *self.runner;
        run.trace.clear();
        (run.iterations, run.noisy) = (0, false);
        annealer.run(run, &schedule, self.watch)
    }

    /// The schedule at the temperature of the best run.
    fn schedule_at_end(&self) -> Schedule {
        self.problem.schedule(Cooling {
            sigma: self.best.sigma,
            ..SLOW
        })
    }

    /// Averages over the scales of the prior by their evidence, twice: the first average changes
    /// matches and noise level, from which the second starts.
    fn average_scales(&mut self) -> ControlFlow<()> {
        let schedule = self.schedule_at_end();
        let Runner {
            annealer,
            run,
            scales,
            ..
        } = &mut *self.runner;
        let (model, best) = (&self.problem.model, &mut *self.best);
        if annealer.restore(best, run, &schedule) > MOST_SPREAD {
            return ControlFlow::Continue(());
        }
        let noise = |best: &Run<D>| (best.sigma * best.sigma, SCALES.affine);
        let scale = noise(best);
        let likeliest =
            scales.average(annealer.request(), model, best, scale, false, self.watch)?;
        annealer.prior.build(model, likeliest);
        run.copy_from(best);
        // A third round moves the warp by only a hundredth of the noise.
        annealer.settle(run, &schedule, 2);
        best.sigma = run.sigma;
        let scale = noise(best);
        scales.average(annealer.request(), model, best, scale, true, self.watch)?;
        ControlFlow::Continue(())
    }

    /// Whether no further start can do better. The best run is exact, or the residuals of a dense
    /// set are so far below its spacing that no part can be displaced, or noise explains residuals
    /// and soft partners.
    fn is_done(&self) -> bool {
        let (problem, best) = (self.problem, &*self.best);
        if best.far || self.is_exact() {
            return !best.far;
        }
        let matched = best.matched / problem.smaller() as f64;
        if problem.is_dense() {
            let complete = matched >= self.wanted_share();
            return best.sigma <= 0.15 * problem.spacing && complete && best.tail <= 0.01;
        }
        let unequal = confidence::are_unequal(problem.model.len(), problem.target.len());
        let least = if unequal { 1.2 } else { MIN_TELLING_GAIN };
        // Soft partners that spread less than this, relative to the temperature, are decided. For
        // well separated points the spread is 0.05; if a part is displaced it is 0.12 to 0.6.
        problem.gain(best).is_some_and(|gain| gain >= least)
            && matched >= 0.9
            && best.tail <= 0.03
            && best.ambiguity <= 0.1
    }

    /// Whether the best run so far fits nearly all points of the smaller set to rounding.
    pub(super) fn is_exact(&self) -> bool {
        let (problem, best) = (self.problem, &*self.best);
        !best.far
            && best.sigma <= problem.limits.clean
            && best.matched >= self.wanted_share() * problem.smaller() as f64
            && (best.tail <= 0.01 || !problem.is_dense())
    }

    /// Whether a run from the motions of blocks kept their matches. If so, nearly all points within
    /// the box of the targets have a partner, and the pairs make the targets likelier than chance.
    pub(super) fn is_likely(&self) -> bool {
        let (problem, best) = (self.problem, &*self.best);
        let sides: [_; D] = std::array::from_fn(|k| {
            let values = problem.target.iter().map(|t| t[k]);
            values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)))
        });
        let inside = |w: &&[f64; D]| (0..D).all(|k| sides[k].0 <= w[k] && w[k] <= sides[k].1);
        let inside = best.warped.iter().filter(inside).count() as f64;
        let gain = problem.gain(best).unwrap_or(f64::INFINITY);
        // A surface that slipped along itself leaves residuals of a fifth of a spacing, as noise
        // does.
        let near = D == 2 || best.sigma <= SLIPPED * problem.spacing;
        problem.is_dense()
            && near
            && !best.far
            && best.matched >= FOLLOWED * inside
            && 2.0 * inside > problem.smaller() as f64
            && gain >= MIN_TELLING_GAIN
            && best.tail <= LEAST_ASIDE
    }

    /// Whether the best run so far ended below the noise and so lost some of its pairs.
    pub(super) fn is_cold(&self) -> bool {
        let smaller = self.problem.smaller() as f64;
        self.best.sigma < 0.1 * self.problem.spacing && self.best.matched < 0.95 * smaller
    }

    /// Fraction of the smaller set that a complete answer matches. Dense sets may hold points that
    /// occur in one of them only. This is accepted once a further start from the patterns matches no
    /// more points, because the first such start leaves the edges of a cropped set shifted by one
    /// point.
    fn wanted_share(&self) -> f64 {
        // Smaller changes of the number come from the temperature.
        let grows = self.best.matched > 1.005 * self.matched_before;
        if self.problem.is_dense() && self.starts >= 3 && !grows {
            0.8
        } else {
            0.98
        }
    }
}
