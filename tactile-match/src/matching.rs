//! What every matcher takes and returns: [`PointMatcher`], [`Matching`] and its [`MatchReport`].

use crate::{MatchError, SoftMatches, WarmStart};
use nalgebra::{Point, SMatrix};
use std::sync::Arc;
use tactile_tps::{Scalar, Warp};

/// Finds which model point is which target point, and the warp that takes the model onto the target.
///
/// Object safe, so that a user picks the method at run time:
/// `let matcher: Box<dyn PointMatcher<f64, 2>> = …`.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{CoherentPointDrift, NearestNeighbour, PointMatcher, AnnealedSoftassign};
/// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2], [0.5, 0.4], [1.8, 0.3]].map(Point2::from);
/// let target = model.map(|p| Point2::new(p.x + 0.05 * p.y, p.y));
/// let matchers: [Box<dyn PointMatcher<f64, 2>>; 3] = [
///     Box::new(NearestNeighbour::default()),
///     Box::new(CoherentPointDrift::default()),
///     Box::new(AnnealedSoftassign::default()),
/// ];
/// for matcher in matchers {
///     let matching = matcher.match_points(&model, &target)?;
///     assert!((0..6).all(|i| matching.assignment[i] == Some(i)));
/// }
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
pub trait PointMatcher<T: Scalar, const D: usize> {
    /// Matches `model` (I points) to `target` (J points); I and J may differ and either may be 1.
    ///
    /// # Errors
    /// [`MatchError`] for empty sets, coordinates that are not finite and options out of range.
    fn match_points(
        &self,
        model: &[Point<T, D>],
        target: &[Point<T, D>],
    ) -> Result<Matching<T, D>, MatchError>;

    /// As [`match_points`](Self::match_points), for the next target of a series: a matcher may begin where its last match of the same
    /// model ended, with what it keeps in `warm` ([`WarmStart`]). By default the match is made anew.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{LinearAssignment, PointMatcher, WarmStart};
    /// let model = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]].map(Point2::from);
    /// let (matcher, mut warm) = (LinearAssignment::default(), WarmStart::default());
    /// for step in [0.1, 0.2] {
    ///     let target = model.map(|p| Point2::new(p.x + step, p.y));
    ///     assert_eq!(matcher.match_next(&mut warm, &model, &target)?.assignment[2], Some(2));
    /// }
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    ///
    /// # Errors
    /// As [`match_points`](Self::match_points).
    fn match_next(
        &self,
        warm: &mut WarmStart,
        model: &[Point<T, D>],
        target: &[Point<T, D>],
    ) -> Result<Matching<T, D>, MatchError> {
        let _ = warm;
        self.match_points(model, target)
    }

    /// As [`match_next`](Self::match_next), for who asks for the pairs alone: a matcher may leave out what else a [`Matching`] holds, and
    /// then allocates nothing once `warm` and `pairs` have grown. By default it is the match's.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{AnnealedSoftassign, MatchedPairs, PointMatcher, WarmStart};
    /// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2], [0.5, 0.4], [1.8, 0.3]].map(Point2::from);
    /// let (matcher, mut warm, mut pairs) = (AnnealedSoftassign::default(), WarmStart::default(), MatchedPairs::default());
    /// for step in [0.1, 0.2] {
    ///     let target = model.map(|p| Point2::new(p.x + step, p.y));
    ///     matcher.match_next_pairs(&mut warm, &model, &target, &mut pairs)?;
    ///     assert!((0..6).all(|i| pairs.assignment[i] == Some(i) && pairs.confidence[i] > 0.9));
    /// }
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    ///
    /// # Errors
    /// As [`match_points`](Self::match_points); `pairs` is then as it was.
    fn match_next_pairs(
        &self,
        warm: &mut WarmStart,
        model: &[Point<T, D>],
        target: &[Point<T, D>],
        pairs: &mut MatchedPairs<T>,
    ) -> Result<(), MatchError> {
        let found = self.match_next(warm, model, target)?;
        (pairs.assignment, pairs.confidence, pairs.report) =
            (found.assignment, found.confidence, found.report);
        Ok(())
    }
}

/// The pairs of a match without its warp, soft matches and covariances: see [`PointMatcher::match_next_pairs`].
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{LinearAssignment, MatchedPairs, PointMatcher, WarmStart};
/// let (model, target) = ([Point2::new(0.0, 0.0)], [Point2::new(0.1, 0.0)]);
/// let (mut warm, mut pairs) = (WarmStart::default(), MatchedPairs::default());
/// LinearAssignment::default().match_next_pairs(&mut warm, &model, &target, &mut pairs)?;
/// assert_eq!(pairs.assignment, [Some(0)]);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MatchedPairs<T> {
    /// Target row of every model point.
    pub assignment: Vec<Option<usize>>,
    /// As [`Matching::confidence`].
    pub confidence: Vec<T>,
    /// How it went.
    pub report: MatchReport<T>,
}

/// Passes the calls on to what a pointer points to, so that a boxed or shared matcher is a matcher.
macro_rules! matcher_behind {
    ($pointer:ident) => {
        impl<T: Scalar, const D: usize, M: PointMatcher<T, D> + ?Sized> PointMatcher<T, D>
            for $pointer<M>
        {
            fn match_points(
                &self,
                model: &[Point<T, D>],
                target: &[Point<T, D>],
            ) -> Result<Matching<T, D>, MatchError> {
                (**self).match_points(model, target)
            }

            fn match_next(
                &self,
                warm: &mut WarmStart,
                model: &[Point<T, D>],
                target: &[Point<T, D>],
            ) -> Result<Matching<T, D>, MatchError> {
                (**self).match_next(warm, model, target)
            }

            fn match_next_pairs(
                &self,
                warm: &mut WarmStart,
                model: &[Point<T, D>],
                target: &[Point<T, D>],
                pairs: &mut MatchedPairs<T>,
            ) -> Result<(), MatchError> {
                (**self).match_next_pairs(warm, model, target, pairs)
            }
        }
    };
}

matcher_behind!(Box);
matcher_behind!(Arc);

/// Why a matcher stopped.
///
/// ```
/// use nalgebra::Point2;
/// use std::ops::ControlFlow;
/// use tactile_match::{AnnealedSoftassign, SoftassignWorkspace, StopReason};
/// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2], [0.5, 0.4], [1.8, 0.3]].map(Point2::from);
/// let target = model.map(|p| Point2::new(1.1 * p.x + 0.1 * p.y, p.y));
/// let (matcher, mut workspace) = (AnnealedSoftassign::default(), SoftassignWorkspace::default());
/// let found = matcher.match_points_with(&mut workspace, &model, &target, |_, _| ControlFlow::Continue(()))?;
/// assert_eq!(found.report.stop, StopReason::Exact); // no noise: every pair fits to rounding
/// let cut = matcher.match_points_with(&mut workspace, &model, &target, |_, _| ControlFlow::Break(()))?;
/// assert_eq!(cut.report.stop, StopReason::Callback);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
pub enum StopReason {
    /// The warp and the assignment stand still.
    #[default]
    Converged,
    /// The temperature fell to its floor, a thousandth of the model's radius, with nearly all points matched: what noise there is cannot
    /// be told from none.
    Exact,
    /// The iteration limit was reached.
    IterationLimit,
    /// The caller's callback asked to stop.
    Callback,
    /// Too few distinct points for more than a rigid or affine answer.
    Degenerate,
}

/// Why the pairs of an answer are not to be relied on.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{AnnealedSoftassign, Doubt, PointMatcher};
/// let scattered = |seed: f64| -> Vec<Point2<f64>> {
///     let place = |i: i32, k: f64| (f64::from(i * i) * k + seed * f64::from(i)).fract();
///     (0..60).map(|i| Point2::new(place(i, 0.618), place(i, 0.755))).collect()
/// };
/// let matcher = AnnealedSoftassign::default();
/// let same = matcher.match_points(&scattered(0.1), &scattered(0.1))?;
/// assert_eq!(same.report.doubt, None);
/// // Two sets that have nothing to do with each other: some points coincide by chance.
/// let other = matcher.match_points(&scattered(0.1), &scattered(0.37))?;
/// assert!(matches!(other.report.doubt, Some(Doubt::FewPairs | Doubt::LargeResiduals | Doubt::Undecided)));
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
pub enum Doubt {
    /// So few points of the smaller set have a partner that the pairs may have met by chance.
    FewPairs,
    /// The residuals are so large that points strewn at random would explain the targets nearly as well; or those of a part of the set are
    /// far larger than the others', which may lie a point aside.
    LargeResiduals,
    /// One pair in twenty or more is wrong, by the pairs' confidences.
    Undecided,
}

/// How a match went.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{CoherentPointDrift, Motion, PointMatcher};
/// let model = [[0.0, 0.0], [3.0, 0.0], [0.0, 3.0], [3.0, 3.0]].map(Point2::from);
/// let target = [[0.0, 0.0], [3.0, 0.0], [0.0, 3.0], [3.2, 3.2]].map(Point2::from); // one corner is drawn out
/// let options = CoherentPointDrift::default().with_motion(Motion::Rigid)?;
/// let report = options.match_points(&model, &target)?.report;
/// assert!(report.iterations > 0 && report.starts == 1);
/// assert!(report.residual > 0.05 && report.residual < 0.2); // what no rigid motion explains, in units of the points
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MatchReport<T> {
    /// Why it stopped.
    pub stop: StopReason,
    /// Outer iterations (match, then warp) of the start that won.
    pub iterations: usize,
    /// Starts that were tried.
    pub starts: usize,
    /// Root mean square distance between warped model points and their partners, in the units of the points.
    pub residual: T,
    /// Estimated standard deviation of the position noise along one axis, in the units of the points.
    pub sigma: T,
    /// Why the pairs are not to be relied on, where the matcher can tell.
    #[cfg_attr(feature = "serde", serde(default))]
    pub doubt: Option<Doubt>,
}

/// The answer of a [`PointMatcher`].
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{NearestNeighbour, PointMatcher};
/// let model = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]].map(Point2::from);
/// let target = [[0.1, 0.0], [2.1, 0.0], [0.1, 2.0], [2.1, 2.0], [9.0, 9.0]].map(Point2::from);
/// let matching = NearestNeighbour::within(1.0)?.match_points(&model, &target)?;
/// assert_eq!(matching.assignment, [Some(0), Some(1), Some(2), Some(3)]);
/// assert_eq!(matching.unmatched_target, [4]);
/// assert!((matching.warp.apply(&Point2::new(1.0, 1.0)) - Point2::new(1.1, 1.0)).norm() < 1e-9);
/// assert!((matching.warped[3] - target[3]).norm() < 1e-9 && matching.confidence[3] > 0.99);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
pub struct Matching<T: Scalar, const D: usize> {
    /// The warp; it takes the model points to [`warped`](Self::warped), of a model of four thousand points and more a sample of them.
    pub warp: Box<dyn Warp<T, D> + Send + Sync>,
    /// The warped model points.
    pub warped: Vec<Point<T, D>>,
    /// Target row of every model point; `None` for a point without a partner. No target row occurs twice.
    pub assignment: Vec<Option<usize>>,
    /// Probability that the assignment (or the lack of one) of each model point is right, in [0, 1]. Of the default matcher and noisy points:
    /// of all pairs given a confidence c, a share c is right, within some five points above 0.6 and thirteen below, over bent, cropped, turned
    /// and stretched scenes that were not tuned on (`--example confidence`).
    pub confidence: Vec<T>,
    /// The soft matches M the assignment was read from.
    pub soft: SoftMatches<T>,
    /// Model rows without a partner, ascending.
    pub unmatched_model: Vec<usize>,
    /// Target rows without a partner, ascending.
    pub unmatched_target: Vec<usize>,
    /// Covariance of each model point's position under the warp, in squared units of the points. Of the default matcher it is the posterior
    /// covariance given that the pairs are right: about 68 % of the true positions lie within one standard deviation along an axis.
    pub displacement_covariance: Vec<SMatrix<T, D, D>>,
    /// The matcher's energy after every outer iteration.
    pub energy: Vec<T>,
    /// How it went.
    pub report: MatchReport<T>,
}

/// Rows without a partner on both sides, `(model, target)`, ascending, for `target_len` target points.
///
/// ```
/// use tactile_match::unmatched_rows;
/// let assignment = [Some(2), None, Some(0)]; // three model points, four targets
/// assert_eq!(unmatched_rows(&assignment, 4), (vec![1], vec![1, 3]));
/// ```
#[must_use]
pub fn unmatched_rows(assignment: &[Option<usize>], target_len: usize) -> (Vec<usize>, Vec<usize>) {
    let mut taken = vec![false; target_len];
    for &row in assignment.iter().flatten() {
        taken[row] = true;
    }
    let model = (0..assignment.len())
        .filter(|&i| assignment[i].is_none())
        .collect();
    (model, (0..target_len).filter(|&j| !taken[j]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unmatched_rows_are_the_complement_of_the_assignment() {
        assert_eq!(
            unmatched_rows(&[Some(2), None, Some(0)], 4),
            (vec![1], vec![1, 3])
        );
        assert_eq!(unmatched_rows(&[], 1), (vec![], vec![0]));
    }

    /// Compiles only while the trait can be made into an object.
    #[test]
    fn matchers_are_objects() {
        fn _takes(_: &dyn PointMatcher<f64, 3>) {}
    }
}
