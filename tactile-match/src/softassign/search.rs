//! The search: runs from a list of starts, compared by evidence, until an answer leaves no doubt.
//!
//! Most scenes are easy and end with the first, fast run. If its answer does not fit exactly and
//! noise does not explain its residuals, further starts follow, from the cheapest to the most
//! expensive. The run with the lowest energy wins. For noisy scenes the scales of the prior are then
//! averaged.

use super::problem::{MIN_TELLING_GAIN, are_unequal};
use super::race::{Outcome, Race, Rivals, Runner};
use super::run::{Cooling, Run, SCALES};
use super::starts::{FAST, MOVED, NEAR, OPEN, Start, further_starts};
use super::{Mechanism, Rotation, Search};
use std::ops::ControlFlow;

/// If soft partners spread more than this, relative to the temperature, the evidence of a warp is
/// hidden by that of its matches.
const MOST_SPREAD: f64 = 0.3;

impl<const D: usize> Race<'_, D> {
    /// Searches for the best run, which stays in `best`. Returns its rivals.
    pub(super) fn go(&mut self) -> ControlFlow<(), Rivals> {
        if self.problem.is_large() {
            return self.coarse_to_fine();
        }
        self.runner.prepare(self.problem);
        match self.problem.options.search {
            Search::Near => self
                .run(Start::Centred, NEAR)
                .map_continue(|()| Rivals::default()),
            Search::Thorough => self.search(),
        }
    }

    /// One short run from `start`. Its first temperature is `sigma`, limited to the range between
    /// the lowest at which points still change partners and that of sets near each other.
    pub(super) fn go_from(&mut self, start: &[[f64; D]], sigma: f64) -> ControlFlow<(), Rivals> {
        self.runner.prepare(self.problem);
        let run = &mut self.runner.run;
        run.base.clone_from(&self.problem.model);
        run.warped.clear();
        run.warped.extend_from_slice(start);
        let sigma = sigma.clamp(0.03, NEAR.sigma);
        self.anneal(Cooling { sigma, ..NEAR })
            .map_continue(|()| Rivals::default())
    }

    /// Prepares the reading of the answer: soft matches and regression become those of the best run.
    /// `rivals` is `None` if the search was stopped.
    pub(super) fn outcome(mut self, rivals: Option<Rivals>) -> Outcome {
        let stopped = rivals.is_none();
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
            rivals: rivals.unwrap_or_default(),
            symmetric: any && self.is_symmetric(),
        }
    }

    /// Tries the starts in turn until the best run leaves no doubt, then averages over the scales of
    /// the prior. Returns the rivals of the answer.
    fn search(&mut self) -> ControlFlow<(), Rivals> {
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
        let rivals = self.look_for_rivals()?;
        let noisy = self.best.sigma > self.problem.limits.clean;
        if noisy && !self.best.noisy && self.has(Mechanism::Scales) && self.problem.bends() {
            self.average_scales()?;
        }
        ControlFlow::Continue(rivals)
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
        let unequal = are_unequal(problem.model.len(), problem.target.len());
        let least = if unequal { 1.2 } else { MIN_TELLING_GAIN };
        // Soft partners that spread less than this, relative to the temperature, are decided. For
        // well separated points the spread is 0.05; if a part is displaced it is 0.12 to 0.6.
        problem.gain(best).is_some_and(|gain| gain >= least)
            && matched >= 0.9
            && best.tail <= 0.03
            && best.ambiguity <= 0.1
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
}
