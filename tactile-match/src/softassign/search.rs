//! The search: a list of starts, each annealed on its own schedule and compared by evidence, until
//! an answer leaves no doubt.
//!
//! Most scenes are easy and end with the first, fast run. If its answer does not fit exactly and
//! noise does not explain its residuals, further starts follow, from the cheapest to the most
//! expensive. The answer with the lowest energy is chosen. For noisy scenes the scales of the prior
//! are then averaged.

use super::confidence::{self, MIN_TELLING_GAIN};
use super::run::{Cooling, Schedule};
use super::{
    AnnealedSoftassign, BULK, Mechanism, Rotation, Search, SoftassignWorkspace, Transformation,
    starts,
};
use crate::Watch;
use crate::gaussian_process::PriorScales;
use nalgebra::{SMatrix, SVector};
use std::ops::ControlFlow;

/// Scales of the prior in the search.
pub(super) const SCALES: PriorScales = PriorScales {
    length: 1.2,
    bending: 0.35,
    affine: 0.5,
};
/// A set of this many points is dense: an exact answer need not be complete, and local tuples are
/// tried first.
const MIN_DENSE_POINTS: usize = 500;

/// Largest distance of targets with which the pattern of a point is compared, in radii of the
/// model.
pub(super) const MAX_PATTERN_REACH: f64 = 0.25;

/// Cooling of the first run. Its temperature falls independently of the residuals.
pub(super) const FAST: Cooling = Cooling {
    sigma: 0.3,
    rate: 0.75,
    least: 0.9,
    patience: usize::MAX,
    stuck: usize::MAX,
    sweeps: 3,
    still: 1e-4,
    open: false,
};
/// Cooling of further runs, which follow the residuals. They end when the temperature has not
/// fallen for `patience` iterations: matches that are still unsettled can drift for hundreds of
/// iterations.
const SLOW: Cooling = Cooling {
    rate: 0.93,
    least: 1.0,
    patience: 20,
    stuck: 8,
    sweeps: 5,
    // A tenth of this changes no mean of the ablation study and takes a fifth more time under
    // noise.
    still: 1e-3,
    ..FAST
};
/// Cooling if a few points have lost their partners below the noise.
const OPEN: Cooling = Cooling {
    rate: FAST.rate,
    open: true,
    ..SLOW
};
/// Cooling from the best answer so far.
const REHEAT: Cooling = Cooling {
    sigma: 0.1,
    rate: 0.9,
    ..SLOW
};
/// Cooling from the motions of blocks. The temperature is their error, in mean spacings.
const MOVED: Cooling = Cooling {
    sigma: 0.4,
    rate: FAST.rate,
    sweeps: FAST.sweeps,
    ..SLOW
};
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
/// Cooling after relaxation labelling, whose pairs are more reliable than a first guess.
const LABELLED: Cooling = Cooling {
    sigma: 0.15,
    ..SLOW
};
/// Cooling of the only run between sets that are near each other.
const NEAR: Cooling = Cooling {
    sigma: 0.2,
    rate: 0.8,
    least: 1.0,
    patience: 12,
    stuck: 12,
    ..FAST
};

/// Cooling from the patterns or tuples of points. A higher temperature would contract a cropped set
/// at its edges.
fn seeded(spacing: f64) -> Cooling {
    Cooling {
        sigma: 0.3 * spacing,
        ..REHEAT
    }
}

/// Start of a run.
#[derive(Clone, Copy, Debug)]
enum Start<const D: usize> {
    /// The centroids are aligned.
    Centred,
    /// The best answer so far.
    Best,
    /// The best answer so far, corrected by the local patterns of a dense set.
    Patterns,
    /// The pairs of relaxation labelling.
    Labelling,
    /// The unmoved sets, corrected by the motions of blocks.
    Moved,
    /// The second moments are aligned, after a rotation.
    Moments(SMatrix<f64, D, D>),
    /// The affine map on which local tuples of points agree.
    Tuples,
}

impl AnnealedSoftassign {
    pub(crate) fn solve<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>, watch: Watch<'_>) {
        self.begin(ws);
        let flow = if self.is_large(ws) {
            self.solve_coarse_to_fine(ws, watch)
        } else {
            self.prepare(ws);
            match self.search {
                Search::Near => self.run(ws, Start::Centred, NEAR, watch),
                Search::Thorough => self.search(ws, watch),
            }
        };
        ws.stopped = flow.is_break();
        if ws.stopped && ws.gives_up {
            return;
        }
        if ws.stopped && ws.starts == 0 {
            // Stopped before the first iteration, which is then the answer.
            let _ = self.run(ws, Start::Centred, NEAR, &mut || ControlFlow::Break(()));
        }
        self.conclude(ws);
    }

    /// One short run from `start`. Its first temperature is `sigma`, limited to the range between
    /// the lowest at which points still change partners and that of sets near each other.
    pub(super) fn solve_from<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        start: &[[f64; D]],
        sigma: f64,
    ) {
        self.begin(ws);
        self.prepare(ws);
        ws.state.base.clone_from(&ws.model);
        ws.state.warped.clear();
        ws.state.warped.extend_from_slice(start);
        let cooling = Cooling {
            sigma: sigma.clamp(0.03, NEAR.sigma),
            ..NEAR
        };
        // The silent watch cannot stop the run.
        let _ = self.anneal(ws, cooling, &mut || ControlFlow::Continue(()));
        self.conclude(ws);
    }

    /// Resets the results.
    fn begin<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        ws.annealer.soft.faintest = 1e-6;
        ws.annealer.volume = bounding_volume(&ws.target, ws.frame.target_radius);
        let sparser = if ws.model.len() < ws.target.len() {
            mean_spacing(ws.annealer.volume, &ws.model)
        } else {
            mean_spacing(ws.annealer.volume, &ws.target)
        };
        ws.annealer.set_resolution(sparser);
        ws.spacing = ws.patterns.typical_spacing(&ws.target);
        ws.farthest = self.largest_motion / ws.frame.scale;
        (ws.best.matched, ws.twin, ws.repeats) = (0.0, None, None);
        ws.scales.spread.clear();
        (ws.best.noisy, ws.best.far) = (false, false);
        (ws.starts, ws.stopped) = (0, false);
        ws.best.energy = f64::INFINITY;
    }

    /// Prepares prior and targets for all points.
    fn prepare<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        ws.annealer.prior.build(&ws.model, SCALES);
        ws.annealer.soft.set_targets(&ws.target);
        ws.annealer.rigid.set(self.transformation, &ws.model);
    }

    /// Reads the answer from the best run.
    fn conclude<const D: usize>(&self, ws: &mut SoftassignWorkspace<D>) {
        ws.expected_share = self.share;
        let noisy = ws.best.noisy || self.resolve(ws);
        if ws.starts > 1 || noisy || !self.is_exact(ws) {
            // Soft matches and regression are those of the last run, which may not be the best run.
            let schedule = self.schedule(Cooling {
                sigma: ws.best.sigma,
                ..SLOW
            });
            ws.annealer.restore(&ws.best, &mut ws.state, &schedule);
        }
        let slack = self.slack();
        let spread = &ws.scales.spread;
        ws.answer.read(
            &mut ws.annealer,
            &ws.best,
            &ws.target,
            slack,
            spread,
            self.without,
        );
        ws.answer.finish(
            self.outliers,
            &ws.target,
            &ws.model,
            (ws.frame.still(), ws.farthest),
        );
        if ws.best.noisy {
            ws.answer.variance.clone_from(&ws.fine.variance);
        }
        ws.symmetric = self.rotation == Rotation::Any && ws.is_symmetric();
        ws.settle_doubt();
    }

    /// Tries the starts in turn until the best answer leaves no doubt, then averages over the
    /// scales of the prior.
    fn search<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        let dense = ws.model.len().min(ws.target.len()) >= MIN_DENSE_POINTS;
        let follows = dense && self.has(Mechanism::Motions);
        if follows {
            self.run(ws, Start::Moved, MOVED, watch)?;
        }
        if ws.starts == 0 || !self.is_followed(ws, watch)? {
            // Further starts would continue from this answer even if it is wrong.
            std::mem::swap(&mut ws.followed, &mut ws.best);
            (ws.best.energy, ws.best.matched) = (f64::INFINITY, 0.0);
            let runs = std::mem::take(&mut ws.starts);
            self.try_starts(ws, watch)?;
            if runs > 0 && !self.is_exact(ws) && ws.followed.energy < ws.best.energy {
                std::mem::swap(&mut ws.followed, &mut ws.best);
            }
            ws.starts += runs;
        }
        self.look_for_rivals(ws, watch)?;
        let noisy = ws.best.sigma > ws.annealer.clean_sigma;
        if noisy && !ws.best.noisy && self.has(Mechanism::Scales) && !ws.annealer.rigid.is_active()
        {
            self.average_scales(ws, watch)?;
        }
        ControlFlow::Continue(())
    }

    /// Whether a run from the motions of blocks is the answer. It is if it is exact, or if the set
    /// is dense, the answer is likely, and the local patterns of the points do not lead to a better
    /// one.
    fn is_followed<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        watch: Watch<'_>,
    ) -> ControlFlow<(), bool> {
        if self.is_exact(ws) || !ws.is_likely() {
            return ControlFlow::Continue(self.is_exact(ws));
        }
        let energy = ws.best.energy;
        let seeded = seeded(ws.spacing);
        self.run(ws, Start::Patterns, seeded, watch)?;
        // Swaps of a few close points change the energy by less than this per point.
        let least = energy - 0.01 * ws.model.len() as f64;
        ControlFlow::Continue(ws.best.energy >= least && ws.is_likely())
    }

    /// Tries the starts that do not use the unmoved sets, until an answer leaves no doubt.
    fn try_starts<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        self.run(ws, Start::Centred, FAST, watch)?;
        if !ws.best.settled && ws.best.iterations >= self.max_iterations {
            return ControlFlow::Continue(()); // the limit would stop every further start as well
        }
        let dense = ws.model.len().min(ws.target.len()) >= MIN_DENSE_POINTS;
        let limited = self.rotation == Rotation::Limited;
        let seeded = seeded(ws.spacing);
        let patterns =
            (dense && self.has(Mechanism::Patterns)).then_some((Start::Patterns, seeded));
        // Repeats from the improved field as long as more points are matched.
        let patterns = [patterns; 6].into_iter();
        let first = [
            (!dense && self.has(Mechanism::Motions)).then_some((Start::Moved, MOVED)),
            (dense && self.has(Mechanism::Tuples)).then_some((Start::Tuples, seeded)),
            self.has(Mechanism::Reheat).then_some((Start::Best, REHEAT)),
            self.has(Mechanism::Slow).then_some((Start::Centred, SLOW)),
            (!dense && self.has(Mechanism::Tuples)).then_some((Start::Tuples, seeded)),
            (limited && self.has(Mechanism::Labelling)).then_some((Start::Labelling, LABELLED)),
        ];
        let rotations = starts::rotations::<D>(self.rotation)
            .filter(|_| self.has(Mechanism::Moments))
            .map(|rotation| (Start::Moments(rotation), SLOW));
        let last = self
            .has(Mechanism::LastReheat)
            .then_some((Start::Best, REHEAT));
        let first = patterns.chain(first).flatten();
        for (start, cooling) in first.chain(rotations).chain(last) {
            if self.is_done(ws) || self.resolve(ws) {
                break;
            }
            self.run(ws, start, cooling, watch)?;
        }
        let open = !dense && self.has(Mechanism::Open);
        if open && is_cold(ws) && !self.is_done(ws) && !self.resolve(ws) {
            let near = Cooling {
                sigma: 0.3 * ws.spacing,
                ..OPEN
            };
            self.run(ws, Start::Best, near, watch)?;
            if is_cold(ws) {
                self.run(ws, Start::Centred, OPEN, watch)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Runs from a start. Does nothing if the sets have no such start.
    fn run<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        start: Start<D>,
        cooling: Cooling,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        if !self.place(ws, start, watch)? {
            return ControlFlow::Continue(());
        }
        let sigma = match start {
            Start::Moved => warmth(ws),
            _ => cooling.sigma,
        };
        self.anneal(ws, Cooling { sigma, ..cooling }, watch)
    }

    /// Sets `ws.state` to a start: base and warped positions. Returns `false` if the sets have no
    /// such start.
    fn place<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        start: Start<D>,
        watch: Watch<'_>,
    ) -> ControlFlow<(), bool> {
        const NO_START: ControlFlow<(), bool> = ControlFlow::Continue(false);
        let (model, target) = (&*ws.model, &*ws.target);
        let state = &mut ws.state;
        match start {
            Start::Best => {
                state.copy_from(&ws.best);
                return ControlFlow::Continue(true);
            }
            Start::Patterns => {
                state.copy_from(&ws.best);
                let rows = 0..model.len();
                if !ws
                    .patterns
                    .propose(rows, &state.warped, target, MAX_PATTERN_REACH, watch)?
                {
                    return NO_START;
                }
                let pairs = &ws.patterns.pairs;
                ws.consensus
                    .fit(&mut ws.annealer, SCALES, (model, target), pairs, state);
                return ControlFlow::Continue(true);
            }
            Start::Moved => {
                if model.len() >= MIN_DENSE_POINTS {
                    ws.levels.model_order.build(model);
                }
                return self.place_by_motions(ws, watch);
            }
            Start::Centred => state.base.clone_from(&ws.model),
            Start::Moments(rotation) => {
                starts::moments(model, target, &rotation, &mut state.base);
            }
            Start::Tuples => {
                let limited = self.rotation == Rotation::Limited;
                let base = &mut state.base;
                let still = ws.frame.still();
                if !ws
                    .tuples
                    .find((model, target), ws.spacing, limited, &still, base, watch)?
                {
                    return NO_START;
                }
            }
            Start::Labelling => {
                // If noise hides the correspondence, the surroundings of the points hold no
                // information.
                let hidden = ws.best.ambiguity >= 0.8 && ws.best.sigma >= 0.999 * REHEAT.sigma;
                if hidden && !ws.annealer.rigid.is_active() {
                    return NO_START;
                }
                state.base.clone_from(&ws.model);
                ws.correspondence.find(&state.base, target, watch)?;
                let pairs = &ws.correspondence.pairs;
                ws.consensus
                    .fit(&mut ws.annealer, SCALES, (model, target), pairs, state);
                return ControlFlow::Continue(true);
            }
        }
        state.warped.clone_from(&state.base);
        ControlFlow::Continue(true)
    }

    /// Moves `ws.state` by the motions of the blocks. Returns `false` if they do not agree on a
    /// field.
    pub(super) fn place_by_motions<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        watch: Watch<'_>,
    ) -> ControlFlow<(), bool> {
        let still = ws.frame.still();
        let state = &mut ws.state;
        let as_it_lies = |p: &[f64; D]| std::array::from_fn(|k| p[k] + still[k]);
        state.base.clear();
        state.base.extend(ws.model.iter().map(as_it_lies));
        let spacing = mean_spacing(ws.annealer.volume, &ws.target);
        let sets = (&*state.base, &*ws.target);
        let order = &ws.levels.model_order.order;
        if !ws.motions.find(sets, order, spacing, ws.farthest, watch)? {
            return ControlFlow::Continue(false);
        }
        let seeds = &ws.motions.seeds;
        let mean = SVector::from(ws.motions.mean());
        for p in &mut state.base {
            *p = (SVector::from(*p) + mean).into();
        }
        let annealer = &mut ws.annealer;
        let stride = annealer.prior.stride;
        annealer.weights.clear();
        annealer.weights.resize(stride, 0.0);
        let nothing = state.base.iter().map(|_| [0.0; D]);
        annealer.residuals.fill(stride, nothing);
        for (row, motion) in seeds
            .iter()
            .filter_map(|seed| Some((seed.row, seed.value()?)))
        {
            annealer.weights[row] = 1.0;
            for k in 0..D {
                annealer.residuals.0[k][row] = motion[k] - mean[k];
            }
        }
        let (weights, wanted) = (&annealer.weights, &annealer.residuals);
        let variance = (MOTION_ERROR * spacing).powi(2);
        let (regression, prior) = (&mut annealer.regression, &annealer.prior);
        if annealer.rigid.is_active() {
            annealer
                .rigid
                .fit(weights, &state.base, wanted, variance, regression);
        } else {
            regression.fit(prior, weights, wanted, variance);
        }
        let field = &regression.displacement.0;
        state.warped.clear();
        let rows = state.base.iter().enumerate();
        let moved = rows.map(|(i, b)| std::array::from_fn(|k| b[k] + field[k][i]));
        state.warped.extend(moved);
        ControlFlow::Continue(true)
    }

    /// Anneals `ws.state` from its current positions, and keeps it if it is the best so far.
    fn anneal<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        cooling: Cooling,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        ws.matched_before = ws.best.matched;
        (ws.state.energy, ws.state.tail) = (f64::INFINITY, 0.0);
        let flow = self.anneal_only(ws, cooling, watch);
        ws.state.far = ws.is_far(&ws.state);
        if ws.starts == 1 {
            ws.best.copy_from(&ws.state);
            if self.is_exact(ws) {
                return flow; // no other run follows to compare it with
            }
        }
        ws.state.tail = ws.annealer.tail(0.1 * ws.spacing);
        ws.annealer
            .evaluate(&mut ws.state, self.share, ws.annealer.resolution);
        if ws.state.far {
            ws.state.energy = f64::INFINITY;
        }
        if ws.state.energy < ws.best.energy || ws.starts == 1 {
            ws.best.copy_from(&ws.state);
        }
        flow
    }

    /// Anneals `ws.state` from its current positions.
    pub(super) fn anneal_only<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        cooling: Cooling,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        let smaller = ws.model.len().min(ws.target.len()) as f64;
        let schedule = Schedule {
            collapse: 0.5 * smaller,
            partners: smaller,
            ..self.schedule(cooling)
        };
        ws.starts += 1;
        ws.state.trace.clear();
        (ws.state.iterations, ws.state.noisy) = (0, false);
        ws.annealer.run(&mut ws.state, &schedule, watch)
    }

    /// Averages over the scales of the prior by their evidence, twice: the first average changes
    /// matches and noise level, from which the second starts.
    fn average_scales<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        let schedule = self.schedule(Cooling {
            sigma: ws.best.sigma,
            ..SLOW
        });
        let ambiguity = ws.annealer.restore(&ws.best, &mut ws.state, &schedule);
        if ambiguity > MOST_SPREAD {
            return ControlFlow::Continue(());
        }
        let mut average = |ws: &mut SoftassignWorkspace<D>, likely: bool| {
            let variance = ws.best.sigma * ws.best.sigma;
            let request = ws.annealer.request();
            let (model, best) = (&ws.model, &mut ws.best);
            ws.scales.average(
                request,
                model,
                best,
                (variance, SCALES.affine),
                likely,
                watch,
            )
        };
        let likeliest = average(ws, false)?;
        ws.annealer.prior.build(&ws.model, likeliest);
        ws.state.copy_from(&ws.best);
        // A third round moves the warp by only a hundredth of the noise.
        ws.annealer.settle(&mut ws.state, &schedule, 2);
        ws.best.sigma = ws.state.sigma;
        average(ws, true)?;
        ControlFlow::Continue(())
    }

    pub(super) fn schedule(&self, mut cooling: Cooling) -> Schedule {
        if self.transformation != Transformation::Smooth {
            // A motion without bending can stall while it rotates into place.
            cooling.stuck = cooling.patience;
        }
        Schedule {
            cooling,
            floor: 0.0,
            limit: self.max_iterations,
            collapse: 0.0,
            partners: f64::INFINITY,
            slack: self.slack(),
        }
    }

    /// Whether no further start can do better. The result is exact, or the residuals of a dense set
    /// are so far below its spacing that no part can be displaced, or noise explains residuals and
    /// soft partners.
    fn is_done<const D: usize>(&self, ws: &SoftassignWorkspace<D>) -> bool {
        let points = ws.model.len().min(ws.target.len());
        let (best, matched) = (&ws.best, ws.best.matched / points as f64);
        if best.far {
            return false;
        }
        if self.is_exact(ws) {
            return true;
        }
        if points >= MIN_DENSE_POINTS {
            let complete = matched >= wanted_share(ws);
            return best.sigma <= 0.15 * ws.spacing && complete && best.tail <= 0.01;
        }
        let unequal = confidence::are_unequal(ws.model.len(), ws.target.len());
        let gain = if unequal { 1.2 } else { MIN_TELLING_GAIN };
        // Soft partners that spread less than this, relative to the temperature, are decided. For
        // well separated points the spread is 0.05; if a part is displaced it is 0.12 to 0.6.
        ws.gain().is_some_and(|found| found >= gain)
            && matched >= 0.9
            && best.tail <= 0.03
            && best.ambiguity <= 0.1
    }

    /// Whether the best run so far fits nearly all points of the smaller set to rounding.
    pub(super) fn is_exact<const D: usize>(&self, ws: &SoftassignWorkspace<D>) -> bool {
        let points = ws.model.len().min(ws.target.len());
        let dense = points >= MIN_DENSE_POINTS;
        !ws.best.far
            && ws.best.sigma <= ws.annealer.clean_sigma
            && ws.best.matched >= wanted_share(ws) * points as f64
            && (ws.best.tail <= 0.01 || !dense)
    }
}

impl<const D: usize> SoftassignWorkspace<D> {
    /// Whether a run from the motions of blocks kept their matches. If so, nearly all points within
    /// the box of the targets have a partner, and the pairs make the targets likelier than chance.
    pub(super) fn is_likely(&self) -> bool {
        let dense = self.model.len().min(self.target.len()) >= MIN_DENSE_POINTS;
        let sides: [_; D] = std::array::from_fn(|k| {
            let values = self.target.iter().map(|t| t[k]);
            values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)))
        });
        let inside = |w: &&[f64; D]| (0..D).all(|k| sides[k].0 <= w[k] && w[k] <= sides[k].1);
        let inside = self.best.warped.iter().filter(inside).count() as f64;
        let gain = self.gain().unwrap_or(f64::INFINITY);
        // A surface that slipped along itself leaves residuals of a fifth of a spacing, as noise
        // does.
        let near = D == 2 || self.best.sigma <= SLIPPED * self.spacing;
        dense
            && near
            && !self.best.far
            && self.best.matched >= FOLLOWED * inside
            && 2.0 * inside > self.model.len().min(self.target.len()) as f64
            && gain >= MIN_TELLING_GAIN
            && self.best.tail <= LEAST_ASIDE
    }
}

/// Temperature of a start from the motions of blocks: at most their error. At a higher temperature,
/// sets that already coincide would drift along a lattice.
pub(super) fn warmth<const D: usize>(ws: &mut SoftassignWorkspace<D>) -> f64 {
    let spacing = mean_spacing(ws.annealer.volume, &ws.target);
    let miss = ws.motions.miss(&ws.state.warped, &ws.target, spacing);
    (MISSES * miss).clamp(COLDEST * spacing, MOVED.sigma * spacing)
}

/// Mean nearest-neighbour distance of points that fill a volume.
fn mean_spacing<const D: usize>(volume: f64, points: &[[f64; D]]) -> f64 {
    (volume / points.len() as f64).powf(1.0 / D as f64)
}

/// Whether the best run so far ended below the noise and so lost some of its pairs.
pub(super) fn is_cold<const D: usize>(ws: &SoftassignWorkspace<D>) -> bool {
    let smaller = ws.model.len().min(ws.target.len()) as f64;
    ws.best.sigma < 0.1 * ws.spacing && ws.best.matched < 0.95 * smaller
}

/// Fraction of the smaller set that a complete answer matches. Dense sets may hold points that
/// occur in one of them only. This is accepted once a further start from the patterns matches no
/// more points, because the first such start leaves the edges of a cropped set shifted by one
/// point.
fn wanted_share<const D: usize>(ws: &SoftassignWorkspace<D>) -> f64 {
    let dense = ws.model.len().min(ws.target.len()) >= MIN_DENSE_POINTS;
    // Smaller changes of the number come from the temperature.
    let grows = ws.best.matched > 1.005 * ws.matched_before;
    if dense && ws.starts >= 3 && !grows {
        0.8
    } else {
        0.98
    }
}

/// Volume of the bounding box of the bulk of points of this radius. Thin sides count as a tenth of
/// the radius of the model.
pub(super) fn bounding_volume<const D: usize>(points: &[[f64; D]], radius: f64) -> f64 {
    let limit = (BULK * radius).max(f64::MIN_POSITIVE);
    let side = |k: usize| {
        let bulk = points.iter().filter(|p| p.iter().all(|c| c.abs() <= limit));
        let (low, high) = bulk.fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[k]), h.max(p[k])));
        (high - low).max(0.1)
    };
    (0..D).map(side).product()
}
