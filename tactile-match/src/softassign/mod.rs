//! The default matcher: annealed softassign with a Gaussian-process prior on the warp and
//! leave-one-out prediction.
//!
//! Given the warped model points, the soft assignment `m_ij ∝ exp(−|yᵢ − tⱼ|²/2σ²)`, made doubly
//! stochastic with slack, is the probability of each pair. Given the pairs, the warp is the
//! posterior mean of a smooth random field through the soft partners. The two steps alternate while
//! the temperature σ falls [Gold, Rangarajan et al., *New algorithms for 2-D and 3-D point
//! matching*, Pattern Recognition 31 (1998); Chui & Rangarajan, *A new point matching algorithm for
//! non-rigid registration*, CVIU 89 (2003)].
//!
//! - Distances are computed from the *leave-one-out* prediction of the warp, so that a wrong match
//!   does not confirm itself.
//! - The covariance of the field has few modes: a fit costs `O(I r²)` with r near 30, leverages
//!   included.
//!
//! ```text
//! problem ← both sets in one frame, and the options            problem
//! for (start, schedule) in starts:                             search, race
//!     place the model by the start                             starts, motion, patterns, tuples, correspond
//!     while the temperature falls:                             run
//!         M ← soft assignment of the predicted positions       assign
//!         warp ← regression of the soft partners               gaussian_process, rigid
//!     best ← the run of lowest energy
//!     stop if best is exact, or noise explains its residuals   fine
//! look for rivals: turned, mirrored, one lattice step off      rivals
//! average the warp over the scales of the prior                scales
//! answer ← pairs, confidences, covariances and doubts of best  confidence, odds
//! ```
//!
//! Most scenes are easy and end with the first run. Others get further starts: local patterns of
//! dense sets, relaxation labelling (19), (20) over the candidates of shape contexts, the moments,
//! and the affine map on which local tuples of points agree. The energy is the negative
//! log-likelihood of the targets plus that of the warp under its prior.
//!
//! If the residuals are rounding, the data are clean and matched points move exactly onto their
//! partners. If the residuals are noise, the warp is averaged over the scales of the prior by their
//! evidence (`scales`), unless the matches themselves are undecided. The final warp is the
//! thin-plate spline through the estimated positions.
//!
//! An iteration costs time and memory in proportion to the pairs within reach of the temperature,
//! at most `O(I J)`. Sets of four thousand points and more are matched coarse to fine (`large`),
//! with a few hundred such pairs per point. Apart from the soft assignment, everything is computed
//! in double precision, whatever the type of the points.

mod assign;
mod blocks;
mod cells;
mod confidence;
mod consensus;
mod correspond;
mod fine;
mod large;
mod levels;
mod motion;
mod odds;
mod options;
mod patterns;
mod problem;
mod race;
mod result;
mod rigid;
mod rivals;
mod run;
mod scales;
mod search;
mod series;
mod spline;
mod starts;
mod tuples;

#[cfg_attr(not(feature = "ablation"), allow(unreachable_pub))]
pub use options::Mechanism;
pub use options::{AnnealedSoftassign, Outliers, Rotation, Search, Transformation};
pub use result::SoftassignMatch;

use crate::{MatchError, MatchedPairs, Matching, StopReason, WarmStart, Watch};
use confidence::Answer;
use nalgebra::{Point, SVector, Vector3};
use problem::Problem;
use race::{Outcome, Race, Runner};
use run::Run;
use series::Series;
use std::ops::ControlFlow;

/// Reusable memory of matches.
///
/// ```
/// use nalgebra::Point2;
/// use std::ops::ControlFlow;
/// use tactile_match::{AnnealedSoftassign, SoftassignWorkspace};
/// let model = [
///     [0.0, 0.0],
///     [1.0, 0.1],
///     [0.2, 1.0],
///     [1.1, 1.2],
///     [0.5, 0.4],
///     [1.8, 0.3],
/// ]
/// .map(Point2::from);
/// let mut workspace = SoftassignWorkspace::default();
/// for load in [0.02, 0.05, 0.1] {
///     // a sequence of frames: memory is taken once
///     let target = model.map(|p| Point2::new(p.x + load * p.y, p.y));
///     let matcher = AnnealedSoftassign::default();
///     let found = matcher.match_points_with(&mut workspace, &model, &target, || {
///         ControlFlow::Continue(())
///     })?;
///     assert!((0..6).all(|i| found.assignment[i] == Some(i)));
/// }
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct SoftassignWorkspace<const D: usize> {
    problem: Problem<D>,
    runner: Runner<D>,
    /// The best run of the last search, and the answer read from it.
    best: Run<D>,
    answer: Answer<D>,
}

impl<const D: usize> SoftassignWorkspace<D> {
    /// Searches for the answer of the problem. If `watch` stops the search, the answer comes from
    /// its best run so far.
    pub(crate) fn solve(&mut self, watch: Watch<'_>) {
        let mut race = Race::new(&self.problem, &mut self.runner, &mut self.best, watch);
        let rival = race.go().continue_value();
        let outcome = race.outcome(rival);
        self.conclude(outcome);
    }

    /// The answer of one short run, see [`Race::go_from`].
    fn solve_from(&mut self, start: &[[f64; D]], sigma: f64) {
        let mut go = || ControlFlow::Continue(());
        let mut race = Race::new(&self.problem, &mut self.runner, &mut self.best, &mut go);
        let rival = race.go_from(start, sigma).continue_value();
        let outcome = race.outcome(rival);
        self.conclude(outcome);
    }

    fn conclude(&mut self, outcome: Outcome) {
        let (problem, runner, best) = (&self.problem, &mut self.runner, &self.best);
        self.answer.conclude(problem, runner, best, outcome);
    }
}

impl AnnealedSoftassign {
    /// Like [`match_points`](crate::PointMatcher::match_points), in the caller's workspace. It
    /// allocates nothing once the workspace has grown.
    ///
    /// `watch` is called many times a second and may stop the search: the best answer so far is then
    /// returned.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use std::ops::ControlFlow;
    /// use tactile_match::{AnnealedSoftassign, SoftassignWorkspace};
    /// # fn main() -> Result<(), tactile_match::MatchError> {
    /// let model: Vec<Point2<f64>> = (0..30)
    ///     .map(|i| {
    ///         Point2::new(
    ///             f64::from(i % 6) + 0.1 * f64::from(i * i % 7),
    ///             f64::from(i / 6),
    ///         )
    ///     })
    ///     .collect();
    /// let target: Vec<Point2<f64>> = model
    ///     .iter()
    ///     .rev()
    ///     .map(|p| Point2::new(1.1 * p.x + 0.1 * p.y, p.y))
    ///     .collect();
    /// let mut workspace = SoftassignWorkspace::default();
    /// let found = AnnealedSoftassign::default().match_points_with(
    ///     &mut workspace,
    ///     &model,
    ///     &target,
    ///     || ControlFlow::Continue(()),
    /// )?;
    /// assert_eq!(found.assignment[3], Some(26));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Those of [`match_points`](crate::PointMatcher::match_points).
    pub fn match_points_with<'w, const D: usize>(
        &self,
        workspace: &'w mut SoftassignWorkspace<D>,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        mut watch: impl FnMut() -> ControlFlow<()>,
    ) -> Result<SoftassignMatch<'w, D>, MatchError> {
        workspace.problem.take(*self, model, target)?;
        workspace.search(&mut watch)?;
        Ok(SoftassignMatch::of(workspace))
    }
}

// The methods of the matcher that this crate compiles for the plane and for space.

impl AnnealedSoftassign {
    pub(crate) fn once<const D: usize>(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        watch: Watch<'_>,
    ) -> Result<Matching<D>, MatchError> {
        let mut workspace = SoftassignWorkspace::default();
        workspace.problem.take(*self, model, target)?;
        let SoftassignWorkspace {
            problem,
            runner,
            best,
            ..
        } = &mut workspace;
        let mut race = Race::new(problem, runner, best, watch);
        let Some(rival) = race.go().continue_value() else {
            let mut found = Matching::from_pairs(model, target, &[])?;
            found.report.stop = StopReason::Cancelled;
            return Ok(found);
        };
        let outcome = race.outcome(Some(rival));
        workspace.conclude(outcome);
        Ok(SoftassignMatch::of(&workspace).to_matching(model))
    }

    pub(crate) fn next<const D: usize>(
        &self,
        warm: &mut WarmStart,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        let series: &mut Series<D> = warm.state();
        self.follow(series, model, target)?;
        Ok(series.matching())
    }

    pub(crate) fn next_pairs<const D: usize>(
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

/// Mean of points already in the frame.
fn mean<const D: usize>(points: &[[f64; D]]) -> [f64; D] {
    let mut centre = [0.0; D];
    for point in points {
        (0..D).for_each(|k| centre[k] += point[k]);
    }
    centre.map(|c| c / points.len() as f64)
}

fn difference<const D: usize>(a: &[f64; D], b: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn dot<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|k| a[k] * b[k]).sum()
}

fn squared<const D: usize>(v: &[f64; D]) -> f64 {
    dot(v, v)
}

fn squared_distance<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    squared(&difference(a, b))
}

/// Extends the vector with zeros to three dimensions.
fn in_space<const D: usize>(v: &SVector<f64, D>) -> Vector3<f64> {
    Vector3::from_fn(|k, _| if k < D { v[k] } else { 0.0 })
}
