//! The default matcher: annealed softassign with a Gaussian-process prior on the warp and leave-one-out prediction.
//!
//! Given where the warp puts the model points, the soft assignment `m_ij ∝ exp(−|yᵢ − tⱼ|²/2σ²)`, made doubly stochastic with slack, says
//! how likely every pair is; given the pairs, the warp is the posterior mean of a smooth random field through the soft partners. The two
//! steps alternate while the temperature σ falls [Gold, Rangarajan et al., *New algorithms for 2-D and 3-D point matching*, Pattern
//! Recognition 31 (1998); Chui & Rangarajan, *A new point matching algorithm for non-rigid registration*, CVIU 89 (2003)].
//!
//! - Distances are taken from the *leave-one-out* prediction of the warp, so that a wrong match does not confirm itself.
//! - The field's covariance has few modes: a fit costs `O(I r²)` with r near 30, and its leverages come with it.
//! - Most scenes are easy and end with the first run (`search`). Others get further starts: local patterns of dense sets (`patterns`),
//!   relaxation labelling (19), (20) over the candidates that shape contexts propose (`correspond`), the moments, and the affine map that
//!   local tuples of points agree on (`tuples`).
//!   The start of least energy wins: minus the logarithm of the targets' likelihood and of the warp's prior.
//!
//! Where the residuals are rounding the data are clean, and matched points go exactly onto their partners. Where they are
//! noise the warp is averaged over the scales of the prior by their evidence (`scales`), unless the matches themselves are undecided. The
//! final warp is the thin-plate spline through the estimated positions.
//!
//! An iteration costs the pairs within reach of the temperature, at most `O(I J)`, in time and in memory. Sets of four thousand points and
//! more are matched coarse to fine (`large`), where those pairs are a few hundred a point. Everything else is computed in double precision, whatever the type of the points.

mod anneal;
mod axes;
#[cfg(feature = "rayon")]
mod batch;
mod blocks;
mod candidate_labels;
mod cells;
mod columns;
mod confidence;
mod consensus;
mod correspond;
mod extrapolate;
mod finish;
mod found;
mod frame;
mod gated;
mod known;
mod landmarks;
mod lanes;
mod large;
mod levels;
mod locality;
mod moments;
mod next;
mod options;
mod patterns;
mod prior;
mod regression;
mod rigid;
mod row_sums;
mod scales;
mod schedule;
mod search;
mod series;
mod soft_assign;
mod spline;
mod spread;
mod starts;
mod target_errors;
mod tuples;

pub use found::SoftassignMatch;
pub use landmarks::Landmark;
pub use options::{AnnealedSoftassign, Outliers, Rotation, Search, Transformation};

use crate::{Doubt, MatchError, MatchedPairs, Matching, PointMatcher, WarmStart, validate};
use anneal::Annealer;
use consensus::Consensus;
use correspond::Correspondence;
use finish::Answer;
use frame::Frame;
use known::Known;
use levels::Levels;
use nalgebra::Point;
use patterns::LocalPatterns;
use scales::ScaleAverage;
use schedule::State;
use series::Series;
use std::ops::ControlFlow;
use tuples::Tuples;

/// Memory that matches use again and again.
///
/// ```
/// use nalgebra::Point2;
/// use std::ops::ControlFlow;
/// use tactile_match::{AnnealedSoftassign, SoftassignWorkspace};
/// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2], [0.5, 0.4], [1.8, 0.3]].map(Point2::from);
/// let mut workspace = SoftassignWorkspace::default();
/// for load in [0.02, 0.05, 0.1] { // a sequence of frames: memory is taken once
///     let target = model.map(|p| Point2::new(p.x + load * p.y, p.y));
///     let matcher = AnnealedSoftassign::default();
///     let found = matcher.match_points_with(&mut workspace, &model, &target, |_, _| ControlFlow::Continue(()))?;
///     assert!((0..6).all(|i| found.assignment[i] == Some(i)));
/// }
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct SoftassignWorkspace<const D: usize> {
    frame: Frame<D>,
    model: Vec<[f64; D]>,
    target: Vec<[f64; D]>,
    annealer: Annealer<D>,
    state: State<D>,
    best: State<D>,
    answer: Answer<D>,
    correspondence: Correspondence,
    patterns: LocalPatterns<D>,
    consensus: Consensus<D>,
    tuples: Tuples<D>,
    scales: ScaleAverage<D>,
    levels: Levels<D>,
    known: Vec<Known<D>>,
    /// Standard deviations of the targets; empty where the caller did not tell them.
    deviations: Vec<f64>,
    /// Typical distance of a target from the next, once the search asks for it.
    spacing: f64,
    /// Share of points without a partner that the caller expects.
    expected_share: f64,
    starts: usize,
    /// Whether a slow run from the centroids has ended in the best answer before it, whose soft partners spread no farther than noise makes
    /// them.
    confirmed: bool,
    stopped: bool,
}

/// A larger share of residuals that the noise of the others does not explain is that of a part of the set that lies aside.
const PART_ASIDE: f64 = 0.08;

/// Where one set is partly out of sight, answers with more gain than this show no part aside, nor do those with pairs as sure as this and
/// surroundings as even as this. Chosen to flag all of ten cropped and stretched scenes that were wrong without a doubt, at the cost of a doubt
/// about one scene in ten that is right (`--example confidence`).
const PLAIN: f64 = 1.4;
const SURE: f64 = 0.965;
const UNEVEN: f64 = 1.75;

impl<const D: usize> SoftassignWorkspace<D> {
    /// Why the answer is not to be relied on.
    fn doubt(&self) -> Option<Doubt> {
        let smaller = self.model.len().min(self.target.len());
        let doubt = self.answer.doubt(smaller, self.expected_share);
        let by_chance = self.gain().is_some_and(|gain| gain < finish::TELLING);
        let misfit = by_chance || self.best.tail > PART_ASIDE || self.may_lie_aside();
        doubt.or(misfit.then_some(Doubt::LargeResiduals))
    }

    /// Whether a part of one set that is partly out of sight may lie a point aside: the answer is not much likelier than chance, and its
    /// pairs are not all sure, or a surrounding fits far worse than the others.
    fn may_lie_aside(&self) -> bool {
        let unequal = finish::are_unequal(self.model.len(), self.target.len());
        let plain = self.gain().is_none_or(|gain| gain >= PLAIN);
        unequal && !plain && (self.answer.sureness() < SURE || self.answer.contrast() > UNEVEN)
    }

    /// How much more likely the best answer makes the targets than points strewn over their bounding box, warp and all, as a logarithm
    /// a point of the smaller set; `None` where an exact first run had nothing to be compared with.
    fn gain(&self) -> Option<f64> {
        let smaller = self.model.len().min(self.target.len()) as f64;
        let strewn = self.target.len() as f64 * self.annealer.volume.ln();
        let energy = self.best.energy;
        energy.is_finite().then(|| (strewn - energy) / smaller)
    }

    /// Takes two sets, in the frame's units.
    fn take(
        &mut self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<(), MatchError> {
        validate::point_sets(model, target)?;
        let frame = Frame::new(model, target);
        self.frame = frame;
        self.model.clear();
        self.model.extend(model.iter().map(|p| frame.model(p)));
        self.target.clear();
        self.target.extend(target.iter().map(|p| frame.target(p)));
        self.known.clear();
        self.deviations.clear();
        Ok(())
    }
}

impl AnnealedSoftassign {
    /// As [`PointMatcher::match_points`] in the caller's workspace; nothing is allocated once that has grown.
    ///
    /// `observe` hears the iteration and the energy after every outer iteration and may stop the search: the best answer
    /// so far is then returned.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use std::ops::ControlFlow;
    /// use tactile_match::{AnnealedSoftassign, SoftassignWorkspace};
    /// # fn main() -> Result<(), tactile_match::MatchError> {
    /// let model: Vec<Point2<f64>> =
    ///     (0..30).map(|i| Point2::new(f64::from(i % 6) + 0.1 * f64::from(i * i % 7), f64::from(i / 6))).collect();
    /// let target: Vec<Point2<f64>> = model.iter().rev().map(|p| Point2::new(1.1 * p.x + 0.1 * p.y, p.y)).collect();
    /// let mut workspace = SoftassignWorkspace::default();
    /// let found = AnnealedSoftassign::default()
    ///     .match_points_with(&mut workspace, &model, &target, |_, _| ControlFlow::Continue(()))?;
    /// assert_eq!(found.assignment[3], Some(26));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`PointMatcher::match_points`].
    pub fn match_points_with<'w, const D: usize>(
        &self,
        workspace: &'w mut SoftassignWorkspace<D>,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        mut observe: impl FnMut(usize, f64) -> ControlFlow<()>,
    ) -> Result<SoftassignMatch<'w, D>, MatchError> {
        workspace.take(model, target)?;
        self.solve(workspace, &mut observe);
        Ok(SoftassignMatch::of(workspace))
    }
}

impl<const D: usize> PointMatcher<D> for AnnealedSoftassign {
    fn match_points(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        let mut workspace = SoftassignWorkspace::default();
        let found = self.match_points_with(&mut workspace, model, target, |_, _| {
            ControlFlow::Continue(())
        })?;
        Ok(found.to_matching(model))
    }

    fn match_next(
        &self,
        warm: &mut WarmStart,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        let series: &mut Series<D> = warm.state();
        self.follow(series, model, target)?;
        Ok(series.matching())
    }

    fn match_next_pairs(
        &self,
        warm: &mut WarmStart,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        pairs: &mut MatchedPairs,
    ) -> Result<(), MatchError> {
        let series: &mut Series<D> = warm.state();
        self.follow(series, model, target)?;
        series.pairs(pairs);
        Ok(())
    }
}
