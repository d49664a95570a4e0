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
//! - Most scenes are easy and end with the first run (`search`). Others get further starts: local
//!   patterns of dense sets (`patterns`), relaxation labelling (19), (20) over the candidates of
//!   shape contexts (`correspond`), the moments, and the affine map on which local tuples of points
//!   agree (`tuples`). The start with the lowest energy is chosen: the negative log-likelihood of
//!   the targets plus that of the warp under its prior.
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
mod confidence;
mod correspond;
mod fine;
mod large;
mod motion;
mod options;
mod patterns;
mod result;
mod rigid;
mod rivals;
mod run;
mod scales;
mod search;
mod starts;

#[cfg_attr(not(feature = "ablation"), allow(unreachable_pub))]
pub use options::Mechanism;
pub use options::{AnnealedSoftassign, Outliers, Rotation, Search, Transformation};
pub use result::SoftassignMatch;

use crate::frame::centre_and_radius;
use crate::{Doubt, MatchError, MatchedPairs, Matching, StopReason, WarmStart, Watch, error};
use confidence::Answer;
use correspond::Correspondence;
use fine::FineFit;
use large::Levels;
use motion::Motions;
use nalgebra::{Point, SVector, Vector3};
use patterns::{Consensus, LocalPatterns};
use result::Series;
use run::{Annealer, State};
use scales::ScaleAverage;
use starts::Tuples;
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
    frame: Frame<D>,
    model: Vec<[f64; D]>,
    target: Vec<[f64; D]>,
    annealer: Annealer<D>,
    state: State<D>,
    best: State<D>,
    /// The result of the block motions.
    followed: State<D>,
    answer: Answer<D>,
    correspondence: Correspondence,
    patterns: LocalPatterns<D>,
    consensus: Consensus<D>,
    tuples: Tuples<D>,
    scales: ScaleAverage<D>,
    fine: FineFit<D>,
    levels: Levels<D>,
    motions: Motions<D>,
    /// Vectors from a model point to its neighbours.
    steps: Vec<SVector<f64, D>>,
    /// Typical distance of a target to its nearest neighbour.
    spacing: f64,
    /// Largest motion allowed.
    farthest: f64,
    /// Fraction of points without a partner expected by the caller.
    expected_share: f64,
    /// Rows of a set, sorted by their coordinates.
    rows: Vec<usize>,
    starts: usize,
    stopped: bool,
    /// Whether a search that is stopped ends at once, without an answer.
    gives_up: bool,
    /// Whether all rotations are allowed and one maps the model onto itself.
    symmetric: bool,
    /// A rival that fits the targets better than the answer but is excluded by the options, and its
    /// gain.
    twin: Option<(f64, Doubt)>,
    /// A step by which the model repeats, if the answer may be off by it.
    repeats: Option<Doubt>,
    /// Number of points matched by the best run before the last one.
    matched_before: f64,
    /// Why the answer is not reliable.
    doubt: Option<Doubt>,
}

impl<const D: usize> SoftassignWorkspace<D> {
    /// Determines the doubt of the answer, and lowers its confidences accordingly.
    fn settle_doubt(&mut self) {
        let smaller = self.model.len().min(self.target.len());
        // An exact answer fits the targets perfectly.
        let gain = self.gain().unwrap_or(f64::INFINITY);
        let share = self.expected_share;
        let doubt = self.answer.doubt(smaller, share, gain, &self.best);
        let symmetric = self.symmetric.then_some(Doubt::Symmetric);
        let twin = self.twin.map(|(_, doubt)| doubt);
        self.doubt = twin.or(self.repeats).or(doubt).or(symmetric);
        if let Some(doubt) = self.doubt {
            self.answer.lower_confidences(doubt, gain);
        }
    }

    /// Log-likelihood gain, per point of the smaller set, of the best answer over points
    /// distributed uniformly in their bounding box. The prior of the warp is included. `None` if an
    /// exact first run was compared with nothing.
    fn gain(&self) -> Option<f64> {
        let smaller = self.model.len().min(self.target.len()) as f64;
        let strewn = self.target.len() as f64 * self.annealer.volume.ln();
        let energy = self.best.energy;
        energy.is_finite().then(|| (strewn - energy) / smaller)
    }

    /// Stores two sets, in the units of the frame.
    fn take(
        &mut self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<(), MatchError> {
        error::point_sets(model, target)?;
        if model.len().min(target.len()) >= large::LARGE {
            error::spread_out("model", model, &mut self.rows)?;
            error::spread_out("target", target, &mut self.rows)?;
        }
        let frame = Frame::new(model, target);
        self.frame = frame;
        self.model.clear();
        self.model.extend(model.iter().map(|p| frame.model(p)));
        self.target.clear();
        self.target.extend(target.iter().map(|p| frame.target(p)));
        Ok(())
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
        workspace.take(model, target)?;
        self.search_in(workspace, &mut watch)?;
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
        let mut workspace = SoftassignWorkspace {
            gives_up: true,
            ..SoftassignWorkspace::default()
        };
        workspace.take(model, target)?;
        self.search_in(&mut workspace, watch)?;
        if workspace.stopped {
            let mut found = Matching::from_pairs(model, target, &[])?;
            found.report.stop = StopReason::Cancelled;
            return Ok(found);
        }
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

/// Coordinates are clamped to this number of radii, which is as good as infinity. The square is
/// still finite in single precision.
const FARTHEST: f64 = 1e12;

/// The centroids and the unit of length inside the matcher.
#[derive(Clone, Copy, Debug)]
struct Frame<const D: usize> {
    model: SVector<f64, D>,
    target: SVector<f64, D>,
    scale: f64,
    /// Radius of the target, relative to the scale.
    target_radius: f64,
}

impl<const D: usize> Default for Frame<D> {
    fn default() -> Self {
        Self {
            model: SVector::zeros(),
            target: SVector::zeros(),
            scale: 1.0,
            target_radius: 1.0,
        }
    }
}

impl<const D: usize> Frame<D> {
    /// The frame of two sets. For a model without extent the radius of `target` is used, or 1 if
    /// the target has no extent either.
    fn new(model: &[Point<f64, D>], target: &[Point<f64, D>]) -> Self {
        let sets = [model, target].map(bulk);
        // A radius below the rounding of the coordinates is noise: such a set counts as one point.
        let extended = |(centre, radius): &(SVector<f64, D>, f64)| {
            *radius > 8.0 * f64::EPSILON * centre.amax()
        };
        let scale = sets
            .iter()
            .find(|set| extended(set))
            .map_or(1.0, |set| set.1);
        Self {
            model: sets[0].0,
            target: sets[1].0,
            scale,
            target_radius: sets[1].1 / scale,
        }
    }

    /// Offset from a model point in the frame to its position among the targets without motion.
    fn still(&self) -> [f64; D] {
        self.inward(self.model - self.target)
    }

    /// Converts a model point into the frame.
    fn model(&self, point: &Point<f64, D>) -> [f64; D] {
        self.inward(point.coords - self.model)
    }

    /// Converts a target point into the frame.
    fn target(&self, point: &Point<f64, D>) -> [f64; D] {
        self.inward(point.coords - self.target)
    }

    fn inward(&self, offset: SVector<f64, D>) -> [f64; D] {
        std::array::from_fn(|k| (offset[k] / self.scale).clamp(-FARTHEST, FARTHEST))
    }

    /// Converts a warped point, given among the targets, into the units of the caller.
    fn outward(&self, point: &[f64; D]) -> Point<f64, D> {
        Point::from(std::array::from_fn(|k| {
            point[k] * self.scale + self.target[k]
        }))
    }
}

/// Points farther from the centre than this multiple of the median do not belong to the bulk of a
/// set. Points that fill a ball, a box or their surfaces have no such outliers.
const BULK: f64 = 6.0;

/// Centroid and root mean square radius of the bulk of a set, so that a point at a thousand times
/// the size of the others does not change them.
fn bulk<const D: usize>(points: &[Point<f64, D>]) -> (SVector<f64, D>, f64) {
    let (mut centre, mut radius) = centre_and_radius(points);
    let mut kept: Vec<Point<f64, D>> = Vec::new();
    // Several rounds, because the farthest outliers hide nearer ones.
    for _ in 0..4 {
        let within = |p: &&Point<f64, D>, limit: f64| (p.coords - centre).norm() <= limit;
        // Half of the points lie farther than the median.
        let limit = BULK * radius / 4.0;
        let near = points.iter().filter(|p| within(p, limit / BULK)).count();
        if !(radius.is_finite() && 2 * near > points.len()) {
            break; // the bulk reaches farther than a quarter of the radius
        }
        kept.clear();
        kept.extend(points.iter().filter(|p| within(p, limit)));
        (centre, radius) = centre_and_radius(&kept);
    }
    (centre, radius)
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
