//! A race of runs: their shared memory, the starts put in place, and what a run that ended shows.

use super::cells::LookUp;
use super::consensus::Consensus;
use super::correspond::Correspondence;
use super::fine::{FineFit, MAX_WHOLE, PATCH};
use super::levels::Levels;
use super::motion::Motions;
use super::patterns::{LocalPatterns, MAX_PATTERN_REACH};
use super::problem::{MIN_TELLING_GAIN, Problem};
use super::run::{Annealer, Cooling, Run, SCALES, Schedule};
use super::scales::ScaleAverage;
use super::starts::{MOVED, REHEAT, SLOW, Start};
use super::tuples::Tuples;
use super::{Mechanism, Rotation, Search, starts};
use crate::{Doubt, LatticeStep, Watch};
use nalgebra::SVector;
use std::ops::ControlFlow;

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
    pub followed: Run<D>,
    correspondence: Correspondence<D>,
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
    pub(super) fn prepare(&mut self, problem: &Problem<D>) {
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

/// Other answers that fit as well, or better but are excluded by the options.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rivals {
    pub doubt: Option<Doubt>,
    /// A lattice step by which the answer can be shifted, whatever the motion.
    pub period: Option<LatticeStep>,
}

/// What a search has found, beside its best run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outcome {
    /// Number of runs.
    pub starts: usize,
    /// Whether the caller stopped it.
    pub stopped: bool,
    pub rivals: Rivals,
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
    pub matched_before: f64,
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

    pub(super) fn has(&self, mechanism: Mechanism) -> bool {
        self.problem.options.has(mechanism)
    }

    /// Runs from a start. Does nothing if the sets have no such start.
    pub(super) fn run(&mut self, start: Start<D>, cooling: Cooling) -> ControlFlow<()> {
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
    pub(super) fn anneal(&mut self, cooling: Cooling) -> ControlFlow<()> {
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
    pub(super) fn schedule_at_end(&self) -> Schedule {
        self.problem.schedule(Cooling {
            sigma: self.best.sigma,
            ..SLOW
        })
    }

    /// Whether the residuals of decided pairs are noise. If so, the best run gets the noise and the
    /// positions.
    pub(super) fn resolve(&mut self) -> bool {
        let problem = self.problem;
        self.runner.fine.forget();
        // A dense fit takes many times as long as the single run of a nearby search.
        let thorough = problem.options.search == Search::Thorough;
        let small = self.best.sigma <= problem.limits.clean || self.is_cold();
        if !(thorough && problem.bends() && self.has(Mechanism::Fine) && small) {
            return false;
        }
        // Decided partners are at most this far from their targets.
        let reach = if self.is_exact() {
            0.0
        } else {
            0.3 * problem.spacing
        };
        let whole = problem.model.len() <= MAX_WHOLE;
        let (fine, best) = (&mut self.runner.fine, &mut *self.best);
        let (model, target) = (&*problem.model, &*problem.target);
        fine.pair(model, &best.warped, target, reach);
        let sets = (model, &*best.base, target);
        let most = if whole { f64::INFINITY } else { PATCH as f64 };
        let enough = 0.9 * most.min(problem.smaller() as f64);
        let are_enough = |fine: &FineFit<D>| fine.pairs.len() as f64 >= enough;
        let noisy = are_enough(fine) && fine.are_noisy(sets) && are_enough(fine);
        // Chance partners within that reach look like noise of at least twice this size.
        let small = reach == 0.0 || fine.sigma.is_some_and(|sigma| sigma < 0.25 * reach);
        if !(noisy && small && whole) {
            return false;
        }
        fine.place(model, best);
        if best.sigma > problem.limits.clean {
            // The annealing resolves this noise, and its average over scales is more accurate.
            best.noisy = false;
            fine.forget();
        }
        true
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
    pub(super) fn wanted_share(&self) -> f64 {
        // Smaller changes of the number come from the temperature.
        let grows = self.best.matched > 1.005 * self.matched_before;
        if self.problem.is_dense() && self.starts >= 3 && !grows {
            0.8
        } else {
            0.98
        }
    }
}
