//! Options of the matcher: the caller's prior knowledge of a scene.

use crate::MatchError;
use crate::error::{at_least_one, option_within};
#[cfg(feature = "rayon")]
use crate::{Matching, SoftassignWorkspace};
#[cfg(feature = "rayon")]
use nalgebra::Point;
#[cfg(feature = "rayon")]
use rayon::prelude::*;
#[cfg(feature = "rayon")]
use std::ops::ControlFlow;

/// Points without a partner: their expected fraction, the volume they fill, and a factor for each
/// side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slack {
    pub share: f64,
    pub volume: f64,
    pub model: f64,
    pub target: f64,
}

/// Weight of the slack on a side without expected outliers.
const RARE: f64 = 0.01;

/// Parts that the ablation study switches off. Public with the feature `ablation` only.
#[doc(hidden)]
#[allow(missing_docs)]
#[cfg_attr(not(feature = "ablation"), allow(unreachable_pub))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Mechanism {
    Patterns,
    Reheat,
    Slow,
    Tuples,
    Labelling,
    Moments,
    LastReheat,
    Scales,
    PairOdds,
    LargePatterns,
    Motions,
    Rivals,
    Open,
    Fine,
}

/// Limits the rotation between model and target.
///
/// ```
/// use nalgebra::{Point2, Rotation2};
/// use tactile_match::{AnnealedSoftassign, PointMatcher, Rotation};
/// let model: Vec<_> = (0..12)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 4.0 + 0.3 * k.sin(), (k / 4.0).floor()))
///     .collect();
/// let target: Vec<_> = model.iter().map(|p| Rotation2::new(2.5) * p).collect(); // rotated by 143°
/// let matcher = AnnealedSoftassign::default().with_rotation(Rotation::Any);
/// let matching = matcher.match_points(&model, &target)?;
/// assert!((0..12).all(|i| matching.assignment[i] == Some(i)));
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Rotation {
    /// Up to about 45°.
    #[default]
    Limited,
    /// Any angle.
    Any,
}

/// The side on which points without a partner are expected.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{AnnealedSoftassign, Outliers, PointMatcher};
/// let model = [
///     [0.0, 0.0],
///     [1.0, 0.1],
///     [0.2, 1.0],
///     [1.1, 1.2],
///     [0.5, 0.4],
///     [1.8, 0.3],
/// ]
/// .map(Point2::from);
/// let mut target = model.map(|p| Point2::new(1.05 * p.x, p.y)).to_vec();
/// target.push(Point2::new(6.0, 5.0)); // clutter
/// let matcher = AnnealedSoftassign::default().with_outliers(Outliers::Target);
/// let matching = matcher.match_points(&model, &target)?;
/// assert!(matching.unmatched_model.is_empty());
/// assert_eq!(matching.unmatched_target, [6]);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Outliers {
    /// Points of both sets may lack a partner.
    #[default]
    Both,
    /// Only model points may: parts of the object are occluded.
    Model,
    /// Only target points may: there is clutter.
    Target,
    /// Both sets hold the same points.
    None,
}

/// How thoroughly starts are searched.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{AnnealedSoftassign, PointMatcher, Search};
/// // The same contact at a higher load.
/// let loaded = |p: &Point2<f64>| Point2::new(1.02 * p.x, p.y + 0.01 * p.x * p.x);
/// let model: Vec<_> = (0..12)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 4.0 + 0.3 * k.sin(), (k / 4.0).floor()))
///     .collect();
/// let target: Vec<_> = model.iter().map(loaded).collect();
/// let matcher = AnnealedSoftassign::default().with_search(Search::Near);
/// let matching = matcher.match_points(&model, &target)?;
/// assert!((0..12).all(|i| matching.assignment[i] == Some(i)));
/// assert_eq!(matching.report.starts, 1);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Search {
    /// Tries further starts until an answer is exact or noise explains its residuals. Noisy answers
    /// are averaged over the scales of the prior. This suits any scene. Sets of four thousand
    /// points and more are always matched coarse to fine, from one start.
    #[default]
    Thorough,
    /// One annealing run from the centred sets, with a small, fixed number of iterations. This
    /// suits sets that are known to be near each other, such as those of one contact at two loads.
    /// Noise far below the spacing is not distinguished from clean data.
    Near,
}

/// The class of maps that the model may follow.
///
/// ```
/// use nalgebra::{Point2, Rotation2};
/// use tactile_match::{AnnealedSoftassign, PointMatcher, Transformation};
/// let model: Vec<_> = (0..12)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 4.0 + 0.3 * k.sin(), (k / 4.0).floor()))
///     .collect();
/// let mut target: Vec<_> = model.iter().map(|p| Rotation2::new(0.3) * p).collect();
/// target[5].x += 0.1; // a point that has moved relative to the others
/// let options = AnnealedSoftassign::default().with_transformation(Transformation::Rigid);
/// let matching = options.match_points(&model, &target)?;
/// assert!(
///     (0..12)
///         .filter(|&i| i != 5)
///         .all(|i| matching.assignment[i] == Some(i)),
///     "{:?}",
///     matching.assignment
/// );
/// let distance = |points: &[Point2<f64>]| (points[0] - points[11]).norm();
/// assert!((distance(&matching.warped) - distance(&model)).abs() < 1e-9);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Transformation {
    /// A smooth deformation.
    #[default]
    Smooth,
    /// An affine map: `x ↦ A x + b`.
    Affine,
    /// Rotation, translation and scaling: `x ↦ s R x + b`.
    Similarity,
    /// Rotation and translation: `x ↦ R x + b`.
    Rigid,
}

/// The default matcher: annealed softassign, with a Gaussian-process prior on the warp and
/// leave-one-out prediction.
///
/// The default settings handle deformation, noise, outliers and missing points, in two and three
/// dimensions. Use [`Rotation::Any`] if the target may be rotated by more than 45°.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{AnnealedSoftassign, PointMatcher};
/// # fn main() -> Result<(), tactile_match::MatchError> {
/// let model = [
///     [0.0, 0.0],
///     [1.0, 0.1],
///     [0.2, 1.0],
///     [1.1, 1.2],
///     [0.5, 0.4],
///     [1.8, 0.3],
/// ]
/// .map(Point2::from);
/// let mut target = model.map(|p| Point2::new(1.1 * p.x + 0.1 * p.y, p.y + 0.05 * p.x));
/// target.reverse();
/// let found = AnnealedSoftassign::default().match_points(&model, &target)?;
/// assert_eq!(found.assignment[0], Some(5));
/// assert!((found.warp.apply(&model[2]) - target[3]).norm() < 1e-9);
/// # Ok(())
/// # }
/// ```
///
/// # Options
/// All options have defaults that suit every scene tried.
///
/// ```
/// use tactile_match::{
///     AnnealedSoftassign, MatchError, Outliers, Rotation, Search, Transformation,
/// };
/// let options = AnnealedSoftassign::default()
///     .with_transformation(Transformation::Similarity) // the set only moves, rotates and grows
///     .with_rotation(Rotation::Any)
///     .with_outliers(Outliers::Model)
///     .with_search(Search::Thorough)
///     .with_outlier_ratio(0.3)? // three in ten points are occluded
///     .with_max_iterations(100)?;
/// assert_ne!(options, AnnealedSoftassign::default());
/// assert!(matches!(
///     options.with_outlier_ratio(0.95),
///     Err(MatchError::InvalidOption {
///         option: "outlier_ratio",
///         ..
///     })
/// ));
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnnealedSoftassign {
    pub(super) without: Option<Mechanism>,
    pub(super) rotation: Rotation,
    pub(super) outliers: Outliers,
    pub(super) search: Search,
    pub(super) transformation: Transformation,
    pub(super) share: f64,
    /// Limit in the units of the points.
    pub(super) largest_motion: f64,
    pub(super) max_iterations: usize,
}

impl Default for AnnealedSoftassign {
    fn default() -> Self {
        Self {
            without: None,
            rotation: Rotation::Limited,
            outliers: Outliers::Both,
            search: Search::Thorough,
            transformation: Transformation::Smooth,
            share: 0.1,
            largest_motion: f64::INFINITY,
            max_iterations: 200,
        }
    }
}

impl AnnealedSoftassign {
    /// Sets the range of rotations of the target.
    #[must_use]
    pub fn with_rotation(mut self, rotation: Rotation) -> Self {
        self.rotation = rotation;
        self
    }

    /// Sets the side on which points without a partner are expected.
    #[must_use]
    pub fn with_outliers(mut self, outliers: Outliers) -> Self {
        self.outliers = outliers;
        self
    }

    /// Sets how thoroughly starts are searched.
    #[must_use]
    pub fn with_search(mut self, search: Search) -> Self {
        self.search = search;
        self
    }

    /// Sets the class of maps: smooth (the default), rigid, similarity or affine. The latter three
    /// leave residuals if the pairs do not fit to rounding, and no warped point is moved onto its
    /// partner.
    #[must_use]
    pub fn with_transformation(mut self, transformation: Transformation) -> Self {
        self.transformation = transformation;
        self
    }

    /// Sets the expected fraction of points without a partner, in [10⁻⁶, 0.9] (default 0.1).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] outside that range.
    pub fn with_outlier_ratio(mut self, share: f64) -> Result<Self, MatchError> {
        option_within("outlier_ratio", share, 1e-6, 0.9, "[1e-6, 0.9]")?;
        self.share = share;
        Ok(self)
    }

    /// Sets the largest motion of a point from the model to the target, in the units of the points
    /// (default: unlimited). It bounds the search: points farther apart do not form pairs, and a
    /// lattice rival beyond this motion raises no doubt.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{AnnealedSoftassign, Doubt, PointMatcher};
    /// // Part of a lattice of spacing 10, moved by 4. A motion of −6 would show the same points.
    /// let lattice = |shift: f64| -> Vec<Point2<f64>> {
    ///     (0..144)
    ///         .map(|k| Point2::new(f64::from(k % 12) * 10.0 + shift, f64::from(k / 12) * 10.0))
    ///         .collect()
    /// };
    /// let matcher = AnnealedSoftassign::default();
    /// let found = matcher.match_points(&lattice(0.0), &lattice(4.0))?;
    /// assert!(matches!(found.report.doubt(), Some(Doubt::Repeats { .. })));
    /// let bounded = matcher.with_largest_motion(5.0)?;
    /// let found = bounded.match_points(&lattice(0.0), &lattice(4.0))?;
    /// assert_eq!((found.report.doubt(), found.assignment[50]), (None, Some(50)));
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for a motion that is not positive and finite.
    pub fn with_largest_motion(mut self, motion: f64) -> Result<Self, MatchError> {
        let (least, most) = (f64::MIN_POSITIVE, f64::MAX);
        option_within("largest_motion", motion, least, most, "(0, ∞)")?;
        self.largest_motion = motion;
        Ok(self)
    }

    /// Sets the maximum number of outer iterations of one start, at least 1 (default 200). If the
    /// first start reaches the limit, no other start follows.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for 0.
    pub fn with_max_iterations(mut self, limit: usize) -> Result<Self, MatchError> {
        at_least_one("max_iterations", limit)?;
        self.max_iterations = limit;
        Ok(self)
    }

    /// Switches off one mechanism, for the ablation study.
    #[cfg(feature = "ablation")]
    #[doc(hidden)]
    #[must_use]
    pub fn without(mut self, mechanism: Mechanism) -> Self {
        self.without = Some(mechanism);
        self
    }

    pub(super) fn has(&self, mechanism: Mechanism) -> bool {
        self.without != Some(mechanism)
    }

    pub(super) fn slack(&self, volume: f64) -> Slack {
        let (model, target) = match self.outliers {
            Outliers::Both => (1.0, 1.0),
            Outliers::Model => (1.0, RARE),
            Outliers::Target => (RARE, 1.0),
            Outliers::None => (RARE, RARE),
        };
        Slack {
            share: self.share,
            volume,
            model,
            target,
        }
    }
}

/// A model and a target.
#[cfg(feature = "rayon")]
type Pair<'a, const D: usize> = (&'a [Point<f64, D>], &'a [Point<f64, D>]);

#[cfg(feature = "rayon")]
impl AnnealedSoftassign {
    /// Matches every `(model, target)` on all threads of the current pool. The results equal those
    /// of [`PointMatcher::match_points`](crate::PointMatcher::match_points) bit by bit. A pair that
    /// cannot be matched does not affect the others.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{AnnealedSoftassign, PointMatcher};
    /// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2]].map(Point2::from);
    /// let target = model.map(|p| Point2::new(1.1 * p.x, p.y));
    /// let (matcher, pairs) = (
    ///     AnnealedSoftassign::default(),
    ///     [(&model[..], &target[..]); 3],
    /// );
    /// let (serial, parallel) = (
    ///     matcher.match_points(&model, &target)?,
    ///     matcher.match_all_in_parallel(&pairs),
    /// );
    /// assert_eq!(serial.warped, parallel[2].as_ref().unwrap().warped);
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    pub fn match_all_in_parallel<const D: usize>(
        &self,
        pairs: &[Pair<'_, D>],
    ) -> Vec<Result<Matching<D>, MatchError>> {
        let go = || ControlFlow::Continue(());
        let one = |workspace: &mut _, &(model, target): &_| {
            Ok(self
                .match_points_with(workspace, model, target, go)?
                .to_matching(model))
        };
        pairs
            .par_iter()
            .map_init(SoftassignWorkspace::default, one)
            .collect()
    }
}
