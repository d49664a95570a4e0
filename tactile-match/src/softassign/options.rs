//! What a caller knows of a scene: the options of the matcher.

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

/// Points without a partner: their expected share, and how far each side may have them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slack {
    pub share: f64,
    pub model: f64,
    pub target: f64,
}

/// Weight of the slack on a side where no outliers are expected.
const RARE: f64 = 0.01;

/// What the ablation study switches off.
#[doc(hidden)]
#[allow(missing_docs)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// How far the target may be turned against the model.
///
/// ```
/// use nalgebra::{Point2, Rotation2};
/// use tactile_match::{AnnealedSoftassign, PointMatcher, Rotation};
/// let model: Vec<_> = (0..12)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 4.0 + 0.3 * k.sin(), (k / 4.0).floor()))
///     .collect();
/// let target: Vec<_> = model.iter().map(|p| Rotation2::new(2.5) * p).collect(); // turned by 143°
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
pub enum Rotation {
    /// By up to about half a right angle.
    #[default]
    Limited,
    /// By any angle.
    Any,
}

/// On which side points without a partner are expected.
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
pub enum Outliers {
    /// Every point may lack its partner.
    #[default]
    Both,
    /// Only model points: parts of the object are out of sight.
    Model,
    /// Only target points: clutter.
    Target,
    /// The sets are the same points.
    None,
}

/// How far the search for the right start goes.
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
pub enum Search {
    /// Start after start, until an answer is exact or noise explains its residuals. Noisy answers
    /// are averaged over the scales of the prior: any scene. Sets of four thousand points and more
    /// are matched coarse to fine, from one start, whichever search is asked for.
    #[default]
    Thorough,
    /// One annealing run from the sets as they lie, centred: for sets known to be near each other,
    /// such as those of one contact at two loads. A fixed, small number of iterations. Noise far
    /// below the spacing is not told from clean data.
    Near,
}

/// What the model may do on its way to the target.
///
/// ```
/// use nalgebra::{Point2, Rotation2};
/// use tactile_match::{AnnealedSoftassign, PointMatcher, Transformation};
/// let model: Vec<_> = (0..12)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 4.0 + 0.3 * k.sin(), (k / 4.0).floor()))
///     .collect();
/// let mut target: Vec<_> = model.iter().map(|p| Rotation2::new(0.3) * p).collect();
/// target[5].x += 0.1; // a point that has moved against the others
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
pub enum Transformation {
    /// Bend smoothly.
    #[default]
    Smooth,
    /// Follow any affine map: `x ↦ A x + b`.
    Affine,
    /// Turn, move and change its size: `x ↦ s R x + b`.
    Similarity,
    /// Turn and move: `x ↦ R x + b`.
    Rigid,
}

/// The default matcher: annealed softassign, with a Gaussian-process prior on the warp and
/// leave-one-out prediction.
///
/// One default setting serves deformation, noise, outliers and missing points. Say
/// [`Rotation::Any`] where the target may be turned by more than half a right angle. Two and three
/// dimensions.
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
/// All of them have defaults that suit every scene tried.
///
/// ```
/// use tactile_match::{
///     AnnealedSoftassign, MatchError, Outliers, Rotation, Search, Transformation,
/// };
/// let options = AnnealedSoftassign::default()
///     .with_transformation(Transformation::Similarity) // the set only moves, turns and grows
///     .with_rotation(Rotation::Any)
///     .with_outliers(Outliers::Model)
///     .with_search(Search::Thorough)
///     .with_outlier_ratio(0.3)? // three in ten points are out of sight
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
    /// In the units of the points.
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
    /// Says how far the target may be turned.
    #[must_use]
    pub fn with_rotation(mut self, rotation: Rotation) -> Self {
        self.rotation = rotation;
        self
    }

    /// Says where points without a partner are expected.
    #[must_use]
    pub fn with_outliers(mut self, outliers: Outliers) -> Self {
        self.outliers = outliers;
        self
    }

    /// Says how far to search.
    #[must_use]
    pub fn with_search(mut self, search: Search) -> Self {
        self.search = search;
        self
    }

    /// Says what the model may do: bend (the default), or only move rigidly, as a similarity or as an affine map.
    /// Those leave residuals where the pairs do not fit to rounding, and no warped point is put
    /// onto its partner.
    #[must_use]
    pub fn with_transformation(mut self, transformation: Transformation) -> Self {
        self.transformation = transformation;
        self
    }

    /// Sets the expected share of points without a partner, in [10⁻⁶, 0.9] (default 0.1).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] outside that range.
    pub fn with_outlier_ratio(mut self, share: f64) -> Result<Self, MatchError> {
        option_within("outlier_ratio", share, 1e-6, 0.9, "[1e-6, 0.9]")?;
        self.share = share;
        Ok(self)
    }

    /// Sets the largest motion of a point from the model to the target, in the units of the points
    /// (default: none). It bounds the search: pairs that are farther apart are no pairs, and an
    /// answer of a lattice that repeats beyond it is no rival.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{AnnealedSoftassign, Doubt, PointMatcher};
    /// // Part of a lattice of spacing 10, moved by 4: or by −6, which shows the same points.
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

    /// Sets the most outer iterations of one start, at least 1 (default 200). Where the limit ends
    /// the first start there is no other.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for 0.
    pub fn with_max_iterations(mut self, limit: usize) -> Result<Self, MatchError> {
        at_least_one("max_iterations", limit)?;
        self.max_iterations = limit;
        Ok(self)
    }

    /// Switches one mechanism off, for the ablation study.
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

    pub(super) fn slack(&self) -> Slack {
        let (model, target) = match self.outliers {
            Outliers::Both => (1.0, 1.0),
            Outliers::Model => (1.0, RARE),
            Outliers::Target => (RARE, 1.0),
            Outliers::None => (RARE, RARE),
        };
        Slack {
            share: self.share,
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
    /// Matches every `(model, target)` on all threads of the current pool, with the bits of
    /// [`PointMatcher::match_points`](crate::PointMatcher::match_points). A pair that cannot be
    /// matched does not hinder the others.
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
        let go = |_, _| ControlFlow::Continue(());
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
