//! The interface of every matcher: [`PointMatcher`], [`Matching`] and its [`MatchReport`].

use crate::error::{option_within, point_sets};
use crate::interpolation::fitted;
use crate::{Doubt, FittedTransformation, Judgement, LatticeStep, MatchError};
use nalgebra::{Point, SMatrix};
use std::ops::{ControlFlow, Deref};
use tactile_core::StopReason;
use tactile_tps::{SeriesMemory, Warp};

/// Finds which model point corresponds to which target point, and the warp that maps the model onto
/// the target.
///
/// The trait is object safe, so that the method can be chosen at run time:
/// `let matcher: Box<dyn PointMatcher<2>> = …`.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{
///     AnnealedSoftassign, CoherentPointDrift, NearestNeighbour, PointMatcher,
/// };
/// let model = [
///     [0.0, 0.0],
///     [1.0, 0.1],
///     [0.2, 1.0],
///     [1.1, 1.2],
///     [0.5, 0.4],
///     [1.8, 0.3],
/// ]
/// .map(Point2::from);
/// let target = model.map(|p| Point2::new(p.x + 0.05 * p.y, p.y));
/// let matchers: [Box<dyn PointMatcher<2>>; 3] = [
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
pub trait PointMatcher<const D: usize>: Send + Sync {
    /// Matches `model` (I points) to `target` (J points). I and J may differ and either may be 1.
    ///
    /// # Errors
    /// [`MatchError`] for empty sets, coordinates that are not finite and options out of range.
    fn match_points(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError>;

    /// Like [`match_points`](Self::match_points). A slow matcher calls `watch` many times a second.
    /// If it returns `Break`, the matcher returns its current result with
    /// [`StopReason::Cancelled`]. The default implementation does not call it.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use std::ops::ControlFlow;
    /// use tactile_match::{PointMatcher, RelaxationLabelling, StopReason};
    /// let points = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [3.0, 3.0]].map(Point2::from);
    /// let mut stop = || ControlFlow::Break(());
    /// let found = RelaxationLabelling::default().match_watched(&points, &points, &mut stop)?;
    /// assert_eq!(found.report.stop, StopReason::Cancelled);
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    ///
    /// # Errors
    /// As [`match_points`](Self::match_points).
    fn match_watched(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Matching<D>, MatchError> {
        let _ = watch;
        self.match_points(model, target)
    }

    /// Like [`match_points`](Self::match_points), for the next target of a series. A matcher may
    /// start from its last match of the same model, with the state in `warm` ([`WarmStart`]). The
    /// default implementation starts anew.
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
    /// Those of [`match_points`](Self::match_points).
    fn match_next(
        &self,
        warm: &mut WarmStart,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        let _ = warm;
        self.match_points(model, target)
    }

    /// Like [`match_next`](Self::match_next), for callers that need only the pairs. A matcher may
    /// skip the other parts of a [`Matching`]; it then allocates nothing once `warm` and `pairs`
    /// have grown. The default implementation calls `match_next`.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{AnnealedSoftassign, MatchedPairs, PointMatcher, WarmStart};
    /// let model = [
    ///     [0.0, 0.0],
    ///     [1.0, 0.1],
    ///     [0.2, 1.0],
    ///     [1.1, 1.2],
    ///     [0.5, 0.4],
    ///     [1.8, 0.3],
    /// ]
    /// .map(Point2::from);
    /// let (matcher, mut warm, mut pairs) = (
    ///     AnnealedSoftassign::default(),
    ///     WarmStart::default(),
    ///     MatchedPairs::default(),
    /// );
    /// for step in [0.1, 0.2] {
    ///     let target = model.map(|p| Point2::new(p.x + step, p.y));
    ///     matcher.match_next_pairs(&mut warm, &model, &target, &mut pairs)?;
    ///     assert!((0..6).all(|i| pairs.assignment[i] == Some(i) && pairs.confidence[i] > 0.9));
    /// }
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`match_points`](Self::match_points). `pairs` is then unchanged.
    fn match_next_pairs(
        &self,
        warm: &mut WarmStart,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        pairs: &mut MatchedPairs,
    ) -> Result<(), MatchError> {
        let found = self.match_next(warm, model, target)?;
        (pairs.assignment, pairs.confidence, pairs.report) =
            (found.assignment, found.confidence, found.report);
        Ok(())
    }
}

/// The pairs of a match without its warp, soft matches and covariances: see
/// [`PointMatcher::match_next_pairs`].
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
#[non_exhaustive]
pub struct MatchedPairs {
    /// Target row of each model point.
    pub assignment: Vec<Option<usize>>,
    /// Confidence of each model point, see [`Matching::confidence`].
    pub confidence: Vec<f64>,
    /// Report of the match.
    pub report: MatchReport,
}

/// Implements the trait for boxed, shared and borrowed matchers.
impl<const D: usize, P: Deref<Target: PointMatcher<D>> + Send + Sync> PointMatcher<D> for P {
    fn match_points(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        (**self).match_points(model, target)
    }

    fn match_watched(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Matching<D>, MatchError> {
        (**self).match_watched(model, target, watch)
    }

    fn match_next(
        &self,
        warm: &mut WarmStart,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        (**self).match_next(warm, model, target)
    }

    fn match_next_pairs(
        &self,
        warm: &mut WarmStart,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        pairs: &mut MatchedPairs,
    ) -> Result<(), MatchError> {
        (**self).match_next_pairs(warm, model, target, pairs)
    }
}

/// Report of a match.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{AnnealedSoftassign, Judgement, PointMatcher};
/// let model = [[0.0, 0.0], [3.0, 0.0], [0.0, 3.0], [3.0, 3.5], [1.2, 1.0]].map(Point2::from);
/// let target = model.map(|p| Point2::new(p.x + 0.1 * p.y, p.y));
/// let report = AnnealedSoftassign::default().match_points(&model, &target)?.report;
/// assert!(report.iterations > 0 && report.starts > 0);
/// assert!(report.residual < 1e-9 && report.judgement == Judgement::Sure);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct MatchReport {
    /// Why the matcher stopped.
    pub stop: StopReason,
    /// Outer iterations (match, then warp) of the start with the best energy.
    pub iterations: usize,
    /// Number of starts that were tried.
    pub starts: usize,
    /// Root mean square distance between warped model points and their partners, in the units of
    /// the points.
    pub residual: f64,
    /// Estimated standard deviation of the position noise along one axis, in the units of the
    /// points.
    pub sigma: f64,
    /// Whether the pairs are reliable.
    #[cfg_attr(feature = "serde", serde(default))]
    pub judgement: Judgement,
    /// A step of a lattice that both sets may continue outside the view: shifted by it, the answer
    /// fits the targets equally well. The smallest motion is assumed. If the shifted one is
    /// likely as well, the doubt is [`Doubt::Repeats`].
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{AnnealedSoftassign, PointMatcher};
    /// let grid: Vec<_> = (0..63)
    ///     .map(|k| Point2::new(f64::from(k % 9), f64::from(k / 9)))
    ///     .collect();
    /// // Or by 0.95 the other way: no one can tell.
    /// let moved: Vec<_> = grid.iter().map(|p| Point2::new(p.x + 0.05, p.y)).collect();
    /// let report = AnnealedSoftassign::default().match_points(&grid, &moved)?.report;
    /// assert_eq!(report.doubt(), None);
    /// let period = report.period.expect("a lattice");
    /// assert!((period.length() - 1.0).abs() < 1e-6);
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    #[cfg_attr(feature = "serde", serde(default))]
    pub period: Option<LatticeStep>,
}

impl MatchReport {
    /// Why the pairs are not reliable. `None` if no check raised a doubt or the matcher does not
    /// judge its pairs: see [`judgement`](Self::judgement).
    #[must_use]
    pub fn doubt(&self) -> Option<Doubt> {
        match self.judgement {
            Judgement::Doubtful(doubt) => Some(doubt),
            Judgement::NotJudged | Judgement::Sure => None,
        }
    }
}

/// The result of a [`PointMatcher`].
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
#[non_exhaustive]
pub struct Matching<const D: usize> {
    /// The warp. It maps the model points to [`warped`](Self::warped); for models of four thousand
    /// points and more this holds for a sample of them.
    pub warp: Box<dyn Warp<D> + Send + Sync>,
    /// The warped model points.
    pub warped: Vec<Point<f64, D>>,
    /// Target row of each model point. `None` for a point without a partner. No target row occurs
    /// twice.
    pub assignment: Vec<Option<usize>>,
    /// Probability in [0, 1] that the assignment of each model point (or its lack of one) is
    /// correct. For the default matcher and noisy points: of all pairs with confidence c, a
    /// fraction c is correct, within about five percentage points above 0.6 and thirteen below.
    /// This was measured on bent, cropped, rotated and stretched scenes that were not used for
    /// tuning (`--example confidence`).
    pub confidence: Vec<f64>,
    /// The soft matches M from which the assignment was derived.
    pub soft: SoftMatches,
    /// Model rows without a partner, ascending.
    pub unmatched_model: Vec<usize>,
    /// Target rows without a partner, ascending.
    pub unmatched_target: Vec<usize>,
    /// Covariance of each model point's position under the warp, in squared units of the points.
    /// For the default matcher it is the posterior covariance if the pairs are correct: about 68 %
    /// of the true positions lie within one standard deviation along an axis.
    pub displacement_covariance: Vec<SMatrix<f64, D, D>>,
    /// The fitted map, if the matcher was configured for one of a few parameters.
    pub transformation: Option<FittedTransformation<D>>,
    /// Energy of the matcher after each outer iteration.
    pub energy: Vec<f64>,
    /// Report of the match.
    pub report: MatchReport,
}

impl<const D: usize> Matching<D> {
    /// The match of an assignment whose warp maps the model to `warped`. Soft matches, confidences
    /// and covariances are still empty.
    pub(crate) fn new(
        target: &[Point<f64, D>],
        warp: Box<dyn Warp<D> + Send + Sync>,
        warped: Vec<Point<f64, D>>,
        assignment: Vec<Option<usize>>,
    ) -> Self {
        let mut taken = vec![false; target.len()];
        let mut squares = Vec::new();
        for (i, j) in assignment.iter().enumerate() {
            let Some(j) = *j else { continue };
            taken[j] = true;
            squares.push((warped[i] - target[j]).norm_squared());
        }
        let residual = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        let unmatched = (0..assignment.len()).filter(|&i| assignment[i].is_none());
        Self {
            warp,
            warped,
            confidence: Vec::new(),
            soft: SoftMatches::default(),
            unmatched_model: unmatched.collect(),
            unmatched_target: (0..target.len()).filter(|&j| !taken[j]).collect(),
            displacement_covariance: Vec::new(),
            transformation: None,
            energy: Vec::new(),
            report: MatchReport {
                starts: 1,
                residual,
                sigma: residual / (D as f64).sqrt(),
                ..MatchReport::default()
            },
            assignment,
        }
    }

    /// Builds the match from pairs of (model row, target row, confidence in [0, 1]), for example in
    /// a user-defined matcher.
    ///
    /// The warp is the [`LocalField`](tactile_tps::LocalField) of the pairs with a confidence of at
    /// least 0.5, if there are at least 16. With fewer it is an affine map of all pairs, weighted by
    /// their confidences, and with D or fewer a rigid motion. The covariance of each warped point is
    /// estimated from the weighted residuals of the pairs. Model points without a pair have confidence
    /// zero. Time and memory are linear in the number of pairs.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::Matching;
    /// let model = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]].map(Point2::from);
    /// let target = [[2.1, 0.0], [0.1, 2.0], [0.1, 0.0]].map(Point2::from);
    /// let found =
    ///     Matching::from_pairs(&model, &target, &[(0, 2, 1.0), (1, 0, 1.0), (2, 1, 0.9)])?;
    /// assert_eq!(found.pairs().nth(1), Some((1, 0, 1.0)));
    /// assert_eq!(found.unmatched_model, [3]);
    /// assert!((found.warped[3] - Point2::new(2.1, 2.0)).norm() < 1e-12);
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    ///
    /// # Errors
    /// [`MatchError`] for empty sets, coordinates that are not finite, rows that do not exist or
    /// occur twice, and confidences outside [0, 1].
    pub fn from_pairs(
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        pairs: &[(usize, usize, f64)],
    ) -> Result<Self, MatchError> {
        point_sets(model, target)?;
        let (mut assignment, mut confidence) = (vec![None; model.len()], vec![0.0; model.len()]);
        let mut taken = vec![false; target.len()];
        let mut rows = vec![Vec::new(); model.len()];
        for (pair, &(i, j, probability)) in pairs.iter().enumerate() {
            let invalid = |set, row| MatchError::PairRow { pair, set, row };
            if assignment.get(i) != Some(&None) {
                return Err(invalid("model", i));
            }
            if taken.get(j) != Some(&false) {
                return Err(invalid("target", j));
            }
            option_within("confidence", probability, 0.0, 1.0, "[0, 1]")?;
            (assignment[i], confidence[i], taken[j]) = (Some(j), probability, true);
            rows[i].push((j, probability));
        }
        let (warp, warped) = fitted(model, target, pairs);
        let (mut scatter, mut weights) = (SMatrix::zeros(), f64::MIN_POSITIVE);
        for &(i, j, weight) in pairs {
            let residual = target[j] - warped[i];
            scatter += residual * residual.transpose() * weight;
            weights += weight;
        }
        let covariance = scatter / weights;
        let mut found = Self::new(target, warp, warped, assignment);
        (found.confidence, found.soft) = (confidence, rows.into_iter().collect());
        found.displacement_covariance = vec![covariance; model.len()];
        found.report.stop = StopReason::Direct;
        Ok(found)
    }

    /// The pairs as (model row, target row, confidence), in ascending order of the model row.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{NearestNeighbour, PointMatcher};
    /// let model = [[0.0, 0.0], [2.0, 0.0]].map(Point2::from);
    /// let found = NearestNeighbour::default().match_points(&model, &[Point2::new(2.1, 0.0)])?;
    /// assert!(found.pairs().all(|(i, j, confidence)| (i, j) == (1, 0) && confidence > 0.9));
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let rows = self.assignment.iter().zip(&self.confidence).enumerate();
        rows.filter_map(|(i, (j, &confidence))| Some((i, (*j)?, confidence)))
    }
}

/// The match matrix `M` without its slack row and column, in compressed rows: each model point has
/// the target points with non-negligible probability, and these probabilities. One minus the sum of
/// a row is the probability that the point has no partner.
///
/// ```
/// use tactile_match::SoftMatches;
/// // Model point 0: target 3 or 1, or with probability 0.25 none; model point 1: none.
/// let soft: SoftMatches = [vec![(3, 0.5), (1, 0.25)], vec![]].into_iter().collect();
/// assert_eq!(soft.rows(), 2);
/// assert_eq!(1.0 - soft.row(0).map(|(_, p)| p).sum::<f64>(), 0.25);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct SoftMatches {
    starts: Vec<usize>,
    columns: Vec<usize>,
    weights: Vec<f64>,
}

impl Default for SoftMatches {
    fn default() -> Self {
        Self {
            starts: vec![0],
            columns: Vec::new(),
            weights: Vec::new(),
        }
    }
}

impl<R: IntoIterator<Item = (usize, f64)>> FromIterator<R> for SoftMatches {
    /// Builds the matrix from its rows, each with the target points of one model point and their
    /// weights.
    fn from_iter<I: IntoIterator<Item = R>>(rows: I) -> Self {
        let mut soft = Self::default();
        rows.into_iter().for_each(|row| soft.push_row(row));
        soft
    }
}

impl SoftMatches {
    /// Appends the row of the next model point.
    pub(crate) fn push_row(&mut self, row: impl IntoIterator<Item = (usize, f64)>) {
        for (column, weight) in row {
            self.columns.push(column);
            self.weights.push(weight);
        }
        self.starts.push(self.columns.len());
    }

    /// Number of rows (model points).
    #[must_use]
    pub fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// The target rows and weights of model point `row`. Empty for a row that does not exist.
    pub fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = match (self.starts.get(row), self.starts.get(row + 1)) {
            (Some(&start), Some(&end)) => start..end,
            _ => 0..0,
        };
        self.columns[range.clone()]
            .iter()
            .copied()
            .zip(self.weights[range].iter().copied())
    }
}

/// State of one matcher along a series of targets of one model, for
/// [`PointMatcher::match_next`](crate::PointMatcher::match_next).
///
/// The content belongs to the matcher: a user-defined matcher gets a value of its own type from
/// [`state`](Self::state). A matcher that finds the state of another type starts anew.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_match::{PointMatcher, AnnealedSoftassign, Search, WarmStart};
/// # fn main() -> Result<(), tactile_match::MatchError> {
/// let model: Vec<Point3<f64>> = (0..60)
///     .map(|i| (0.13 * f64::from(i).sqrt(), 2.4 * f64::from(i)))
///     .map(|(r, angle)| Point3::new(r * angle.cos(), r * angle.sin(), 1.0 - 0.5 * r * r))
///     .collect();
/// let matcher = AnnealedSoftassign::default().with_search(Search::Near);
/// let mut warm = WarmStart::default();
/// // The load rises: the surface grows by a hundredth from frame to frame.
/// let mut iterations = Vec::new();
/// for frame in 1..=4 {
///     let target: Vec<_> = model.iter().map(|p| p * (1.1 + 0.01 * f64::from(frame))).collect();
///     let found = matcher.match_next(&mut warm, &model, &target)?;
///     assert!(found.assignment.iter().enumerate().all(|(i, &j)| j == Some(i)));
///     iterations.push(found.report.iterations);
/// }
/// assert!(iterations[3] < iterations[0]);
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Default)]
pub struct WarmStart(SeriesMemory);

impl WarmStart {
    /// The state of type `S` that the last match left here. Returns the default if there is none,
    /// or if it has another type.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{MatchError, Matching, NearestNeighbour, PointMatcher, WarmStart};
    /// /// Nearest neighbours of the model's last positions.
    /// struct Follower;
    /// impl PointMatcher<2> for Follower {
    ///     fn match_points(
    ///         &self,
    ///         model: &[Point2<f64>],
    ///         target: &[Point2<f64>],
    ///     ) -> Result<Matching<2>, MatchError> {
    ///         NearestNeighbour::default().match_points(model, target)
    ///     }
    ///     fn match_next(
    ///         &self,
    ///         warm: &mut WarmStart,
    ///         model: &[Point2<f64>],
    ///         target: &[Point2<f64>],
    ///     ) -> Result<Matching<2>, MatchError> {
    ///         let last: &mut Vec<Point2<f64>> = warm.state();
    ///         let found = self.match_points(
    ///             if last.len() == model.len() {
    ///                 last
    ///             } else {
    ///                 model
    ///             },
    ///             target,
    ///         )?;
    ///         last.clone_from(&found.warped);
    ///         Ok(found)
    ///     }
    /// }
    /// let model = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]].map(Point2::from);
    /// let mut warm = WarmStart::default();
    /// for frame in 1..5 {
    ///     // the sets end 1.6 apart, more than their spacing
    ///     let target = model.map(|p| Point2::new(p.x + 0.4 * f64::from(frame), p.y));
    ///     assert_eq!(
    ///         Follower.match_next(&mut warm, &model, &target)?.assignment,
    ///         [Some(0), Some(1), Some(2)]
    ///     );
    /// }
    /// # Ok::<(), MatchError>(())
    /// ```
    pub fn state<S: Default + Send + Sync + 'static>(&mut self) -> &mut S {
        self.0.state()
    }
}
