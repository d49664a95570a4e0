//! Pairing by distance alone: nearest neighbours and linear assignment.

use crate::error::{point_sets, valid_distance};
use crate::frame::{Frame, spread};
use crate::interpolation::fitted;
use crate::{Judgement, MatchError, Matching, PointMatcher, StopReason, linear_assignment};
use nalgebra::{DMatrix, Point, SVector};

/// Both sets in a common frame, with all squared distances between them.
struct Distances<const D: usize> {
    /// The common frame, to convert lengths.
    frame: Frame<D>,
    target: Vec<SVector<f64, D>>,
    /// `|x_i − y_j|²`, `I × J`, in the units of the frame.
    squared: DMatrix<f64>,
}

impl<const D: usize> Distances<D> {
    fn new(model: &[Point<f64, D>], target: &[Point<f64, D>]) -> Self {
        let frame = Frame::of_both(model, target);
        let inside =
            |points: &[Point<f64, D>]| points.iter().map(|p| frame.inside(p)).collect::<Vec<_>>();
        let (model, target) = (inside(model), inside(target));
        let squared = DMatrix::from_fn(model.len(), target.len(), |i, j| {
            (model[i] - target[j]).norm_squared()
        });
        Self {
            frame,
            target,
            squared,
        }
    }

    /// The square of a length of the caller, in the units of the frame. Infinite for `None`.
    fn limit(&self, length: Option<f64>) -> f64 {
        length.map_or(f64::INFINITY, |l| (l / self.frame.scale).powi(2))
    }

    /// Probabilities of the targets for model point `i`, if its displacement has a normal
    /// distribution of variance `variance` along each axis.
    fn posterior(&self, i: usize, variance: f64) -> Vec<f64> {
        let row = self.squared.row(i);
        let least = row.iter().copied().fold(f64::INFINITY, f64::min);
        let mut p: Vec<f64> = row
            .iter()
            .map(|&s| {
                if s > least {
                    (-0.5 * (s - least) / variance.max(f64::MIN_POSITIVE)).exp()
                } else {
                    1.0
                }
            })
            .collect();
        let sum: f64 = p.iter().sum();
        p.iter_mut().for_each(|p| *p /= sum);
        p
    }
}

/// Builds the result from these pairs. The warp is their local field; confidences and covariances
/// follow from the distribution of the displacements.
fn matching<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    distances: &Distances<D>,
    assignment: Vec<Option<usize>>,
) -> Matching<D> {
    let partners = assignment.iter().enumerate();
    let pairs: Vec<_> = partners
        .filter_map(|(i, j)| Some((i, (*j)?, 1.0)))
        .collect();
    let squares = pairs.iter().map(|&(i, j, _)| distances.squared[(i, j)]);
    let total: f64 = squares.sum();
    let variance = total / (pairs.len().max(1) * D) as f64;
    let scale = distances.frame.scale;
    let (warp, warped) = fitted(model, target, &pairs);
    let mut found = Matching::new(target, warp, warped, assignment);
    for (i, partner) in found.assignment.iter().enumerate() {
        let p = distances.posterior(i, variance);
        found.confidence.push(partner.map_or(0.0, |j| p[j]));
        let places = distances.target.iter().copied().zip(p.iter().copied());
        let covariance = spread(places) * (scale * scale);
        found.displacement_covariance.push(covariance);
        // Soft matches below this weight are dropped.
        let kept = p.iter().copied().enumerate();
        let kept = kept.filter(|(_, p)| partner.is_some() && *p > 1e-4);
        found.soft.push_row(kept);
    }
    found.energy = vec![total * scale * scale];
    found.report.judgement = Judgement::of_pairs(model, target, &found.assignment);
    (found.report.stop, found.report.iterations) = (StopReason::Converged, 1);
    found
}

/// Pairs each model point with the nearest target point. If several model points share a nearest
/// target, the closest of them gets it.
///
/// The pairs are correct while displacements are smaller than half the distance between points. The
/// warp is that of [`Matching::from_pairs`]. `O(I J)`.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{NearestNeighbour, PointMatcher};
/// let model = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [9.0, 9.0]].map(Point2::from);
/// let target = [[0.1, 4.2], [0.2, 0.1], [4.1, -0.1]].map(Point2::from);
/// let matching = NearestNeighbour::within(1.0)?.match_points(&model, &target)?;
/// assert_eq!(matching.assignment, [Some(1), Some(2), Some(0), None]);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NearestNeighbour {
    max_distance: Option<f64>,
}

impl NearestNeighbour {
    /// Excludes pairs further apart than `max_distance`, in the units of the points.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] unless the distance is positive and finite.
    pub fn within(max_distance: f64) -> Result<Self, MatchError> {
        let max_distance = Some(valid_distance(max_distance)?);
        Ok(Self { max_distance })
    }
}

impl<const D: usize> PointMatcher<D> for NearestNeighbour {
    fn match_points(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        point_sets(model, target)?;
        let distances = Distances::new(model, target);
        let limit = distances.limit(self.max_distance);
        let mut holder: Vec<Option<(usize, f64)>> = vec![None; target.len()];
        for i in 0..model.len() {
            let (nearest, squared) = nearest(distances.squared.row(i).iter().copied());
            if squared <= limit && holder[nearest].is_none_or(|(_, other)| squared < other) {
                holder[nearest] = Some((i, squared));
            }
        }
        let mut assignment = vec![None; model.len()];
        for (j, held) in holder.iter().enumerate() {
            if let Some((i, _)) = held {
                assignment[*i] = Some(j);
            }
        }
        Ok(matching(model, target, &distances, assignment))
    }
}

/// The smallest of the distances and its index, the first among equals.
pub(crate) fn nearest(distances: impl Iterator<Item = f64>) -> (usize, f64) {
    distances.enumerate().fold(
        (0, f64::INFINITY),
        |best, d| if d.1 < best.1 { d } else { best },
    )
}

/// Pairs the sets so that the sum of squared distances is smallest, by [`linear_assignment`].
///
/// Unlike nearest neighbours, it pairs as many points as possible, and a common translation of two
/// sets of equal size does not change the pairs. The warp is that of [`Matching::from_pairs`].
///
/// ```
/// use nalgebra::{Point2, Vector2};
/// use tactile_match::{LinearAssignment, PointMatcher};
/// let model = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.5], [3.0, 0.0]].map(Point2::from);
/// let target = model.map(|p| p + Vector2::new(1.4, 0.0)); // more than the distance between points
/// let matching = LinearAssignment::default().match_points(&model, &target)?;
/// assert_eq!(matching.assignment, [Some(0), Some(1), Some(2), Some(3)]);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinearAssignment {
    max_distance: Option<f64>,
}

impl LinearAssignment {
    /// Excludes pairs further apart than `max_distance`, in the units of the points. Leaving two
    /// points unpaired costs as much as a pair at that distance.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{LinearAssignment, PointMatcher};
    /// let model = [[0.0, 0.0], [1.0, 0.0]].map(Point2::from);
    /// let target = [[0.1, 0.0], [9.0, 0.0]].map(Point2::from);
    /// assert_eq!(
    ///     LinearAssignment::default()
    ///         .match_points(&model, &target)?
    ///         .assignment,
    ///     [Some(0), Some(1)]
    /// );
    /// assert_eq!(
    ///     LinearAssignment::within(2.0)?
    ///         .match_points(&model, &target)?
    ///         .assignment,
    ///     [Some(0), None]
    /// );
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] unless the distance is positive and finite.
    pub fn within(max_distance: f64) -> Result<Self, MatchError> {
        let max_distance = Some(valid_distance(max_distance)?);
        Ok(Self { max_distance })
    }
}

impl<const D: usize> PointMatcher<D> for LinearAssignment {
    fn match_points(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        point_sets(model, target)?;
        let distances = Distances::new(model, target);
        let limit = distances.limit(self.max_distance);
        let cost = |i, j| distances.squared[(i, j)].min(limit);
        let mut assignment = linear_assignment([model.len(), target.len()], cost)?;
        for (i, partner) in assignment.iter_mut().enumerate() {
            *partner = partner.filter(|&j| distances.squared[(i, j)] <= limit);
        }
        Ok(matching(model, target, &distances, assignment))
    }
}
