//! Matching of large sets, from coarse to fine.

use super::levels::STEP;
use super::patterns::MAX_PATTERN_REACH;
use super::problem::Problem;
use super::race::{Race, Rivals, Runner};
use super::run::{Cooling, SCALES, Schedule};
use super::starts::FAST;
use super::{Mechanism, Rotation, squared_distance, starts};
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

/// A run cooled by its residuals ends when the variances of residuals and temperature differ by
/// less than this fraction. A tenth of it takes a tenth more time for equal errors. A limit of ten
/// iterations alone leaves volumes three noise widths from the truth
/// (`--example large_sets -- 20000 volume 0.01 0.2`).
const STILL: f64 = 1e-3;

/// Minimum number of points of the coarsest sample: fewer represent the shape of a set poorly.
const COARSEST: usize = 500;

/// First temperature after motions or patterns that agree, in spacings.
const SEEDED: f64 = 0.4;

impl<const D: usize> Race<'_, D> {
    /// Matches the samples in turn, each from the result of the coarser one, unless the motions of
    /// blocks lead to a likely answer. Returns the rivals of the answer.
    pub(super) fn coarse_to_fine(&mut self) -> ControlFlow<(), Rivals> {
        let problem = self.problem;
        let smaller = problem.smaller();
        let levels = &mut self.runner.levels;
        levels.model_order.build(&problem.model);
        levels.target_order.build(&problem.target);
        if !self.follow_motions()? {
            self.refine_samples()?;
            // A run below the noise temperature has lost pairs: repeat it with the temperature set
            // by the residuals.
            let run = &self.runner.run;
            if run.sigma <= problem.limits.clean && run.matched < 0.98 * smaller as f64 {
                self.refine(following(problem, SEEDED * problem.spacing))?;
            }
        }
        let Runner { run, annealer, .. } = &mut *self.runner;
        if run.sigma > problem.limits.clean {
            // Number of rounds in which warp and noise level are updated in turn at the end of
            // noisy sets.
            annealer.settle(run, &problem.schedule(FAST), 4);
        }
        self.starts = 1;
        run.energy = f64::INFINITY;
        run.tail = annealer.tail(0.1 * problem.spacing);
        self.best.copy_from(run);
        if !self.is_exact() {
            let annealer = &mut self.runner.annealer;
            annealer.evaluate(self.best, problem.slack(), problem.limits.resolution);
        }
        self.look_for_rivals()
    }

    /// A run of all points from the motions of blocks. Returns whether its answer is likely.
    fn follow_motions(&mut self) -> ControlFlow<(), bool> {
        let problem = self.problem;
        if !self.has(Mechanism::Motions) {
            return ControlFlow::Continue(false);
        }
        self.runner.levels.base.clone_from(&problem.model);
        self.enter_level(1);
        if !self.place_by_motions()? {
            return ControlFlow::Continue(false);
        }
        let sigma = self.warmth();
        self.refine(following(problem, sigma))?;
        let Runner { run, annealer, .. } = &mut *self.runner;
        run.tail = annealer.tail(0.1 * problem.spacing);
        self.best.copy_from(run);
        annealer.evaluate(self.best, problem.slack(), problem.limits.resolution);
        ControlFlow::Continue(self.is_likely())
    }

    /// Runs of samples that grow to all points.
    fn refine_samples(&mut self) -> ControlFlow<()> {
        let problem = self.problem;
        let mut stride = 1;
        while problem.smaller() / (stride * STEP) >= COARSEST {
            stride *= STEP;
        }
        self.coarsest(stride)?;
        while stride > 1 {
            // First temperature of a level: the spacing of the coarser level.
            let sigma = self.runner.levels.spacing;
            stride /= STEP;
            let Runner { run, levels, .. } = &mut *self.runner;
            levels.coarse.copy_from(run);
            self.enter_level(stride);
            let Runner {
                annealer,
                run,
                levels,
                ..
            } = &mut *self.runner;
            levels.extend(annealer, stride, STEP, run);
            let schedule = if stride > 1 {
                self.sampled(sigma)
            } else if self.has(Mechanism::LargePatterns) && self.follow_sampled_patterns()? {
                problem.schedule(Cooling {
                    sigma: SEEDED * problem.spacing,
                    ..FAST
                })
            } else {
                // If noise hides the patterns, all points are annealed with the temperature set by
                // the residuals.
                following(problem, sigma)
            };
            self.refine(schedule)?;
        }
        ControlFlow::Continue(())
    }

    /// Moves the current run onto the field on which the local patterns agree: first the patterns of
    /// a few points with distant candidates, then those of many points with candidates near that
    /// field. Returns `false` and changes nothing if they do not agree.
    fn follow_sampled_patterns(&mut self) -> ControlFlow<(), bool> {
        let spacing = self.problem.spacing;
        let mut reach = 8.0 * spacing;
        // First stage: number of points whose local patterns are compared, and the distance of
        // their candidates. The distance is in spacings and grows by this factor while the patterns
        // do not agree on a field; its limit is in radii of the model.
        while !self.follow_patterns_of(120, reach.min(MAX_PATTERN_REACH))? {
            if reach >= MAX_PATTERN_REACH {
                return ControlFlow::Continue(false);
            }
            reach *= 2.5;
        }
        // Second stage: number of points and reach, in spacings, of the patterns that refine this
        // field.
        self.follow_patterns_of(1000, 4.0 * spacing)
    }

    /// Moves the current run onto the field that the local patterns of about `points` model points
    /// agree on. Candidates are at most `reach` away.
    fn follow_patterns_of(&mut self, points: usize, reach: f64) -> ControlFlow<(), bool> {
        let problem = self.problem;
        let Runner {
            annealer,
            run,
            levels,
            patterns,
            consensus,
            ..
        } = &mut *self.runner;
        let step = (problem.model.len() / points).max(1);
        let rows = levels.model_order.order.iter().step_by(step).copied();
        let sets = (&*run.warped, &*problem.target);
        if !patterns.propose(rows.clone(), sets, problem.spacing, reach, self.watch)? {
            return ControlFlow::Continue(false);
        }
        levels.model.clear();
        levels.model.extend(rows.clone().map(|i| problem.model[i]));
        let coarse = &mut levels.coarse;
        coarse.base.clear();
        coarse.base.extend(rows.map(|i| run.base[i]));
        coarse.warped.clone_from(&coarse.base);
        levels.sampled.build(&levels.model, SCALES);
        std::mem::swap(&mut annealer.prior, &mut levels.sampled);
        consensus.fit(annealer, problem, &levels.model, &patterns.pairs, coarse);
        std::mem::swap(&mut annealer.prior, &mut levels.sampled);
        // The patterns are accepted if at least this fraction of them lies within a spacing of one
        // field. For wrong candidates the fraction is a sixteenth.
        let (pairs, warped) = (&patterns.pairs, &coarse.warped);
        let agreed = agreement(&problem.target, pairs, warped, problem.spacing) >= 0.3;
        if agreed {
            levels.extend(annealer, 1, step, run);
        }
        ControlFlow::Continue(agreed)
    }

    /// Sets targets, prior and spacing of a level.
    fn enter_level(&mut self, stride: usize) {
        let Runner {
            annealer,
            run,
            levels,
            ..
        } = &mut *self.runner;
        levels.sample(self.problem, stride, run);
        annealer.enter(self.problem, &levels.model, &levels.target);
    }

    /// Matches the coarsest level from the centroids. If all rotations are allowed, the best of
    /// several starts is taken.
    fn coarsest(&mut self, stride: usize) -> ControlFlow<()> {
        let problem = self.problem;
        let mut base = Vec::new();
        let rotations = starts::rotations::<D>(problem.options.rotation).map(Some);
        for rotation in std::iter::once(None).chain(rotations) {
            let levels = &mut self.runner.levels;
            match rotation {
                None => levels.base.clone_from(&problem.model),
                Some(turn) => {
                    starts::moments(&problem.model, &problem.target, &turn, &mut levels.base);
                }
            }
            self.enter_level(stride);
            let run = &mut self.runner.run;
            run.warped.clone_from(&run.base);
            self.refine(self.sampled(FAST.sigma))?;
            if problem.options.rotation == Rotation::Limited {
                return ControlFlow::Continue(());
            }
            let Runner {
                annealer,
                run,
                levels,
                ..
            } = &mut *self.runner;
            annealer.evaluate(run, problem.slack(), problem.limits.resolution);
            if base.is_empty() || run.energy < self.best.energy {
                self.best.copy_from(run);
                base.clone_from(&levels.base);
            }
        }
        let Runner { run, levels, .. } = &mut *self.runner;
        levels.base = base;
        run.copy_from(self.best);
        ControlFlow::Continue(())
    }

    /// The annealing schedule of a sample.
    fn sampled(&self, sigma: f64) -> Schedule {
        let schedule = self.problem.schedule(Cooling { sigma, ..FAST });
        Schedule {
            // The final temperature of a sample is its spacing. The points of samples are not
            // partners, so a lower temperature resolves nothing. Half as much takes twice the time
            // and cools noisy sets below their noise (`--example large_sets`).
            floor: schedule.floor.max(self.runner.levels.spacing),
            ..schedule
        }
    }

    /// Anneals the current run.
    fn refine(&mut self, schedule: Schedule) -> ControlFlow<()> {
        let Runner { run, annealer, .. } = &mut *self.runner;
        run.trace.clear();
        run.iterations = 0;
        let flow = annealer.run(run, &schedule, self.watch);
        if flow.is_break() && run.base.len() == self.problem.model.len() {
            // The positions of all points so far are the answer of a search that was stopped.
            self.best.copy_from(run);
            self.starts = 1;
        }
        flow
    }
}

/// The schedule of a run of all points whose temperature follows the residuals.
fn following<const D: usize>(problem: &Problem<D>, sigma: f64) -> Schedule {
    problem.schedule(Cooling {
        sigma,
        least: 1.0,
        still: STILL,
        ..FAST
    })
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
