//! Pairing by distance alone: nearest neighbours and linear assignment.

use crate::assignment::assigned;
use crate::error::{point_sets, valid_distance};
use crate::frame::{Frame, spread};
use crate::interpolation::fitted;
use crate::{Judgement, MatchError, Matching, PointMatcher, StopReason, Watch};
use nalgebra::Point;
use std::ops::ControlFlow;
use tactile_tps::nearest_rows;

/// Number of nearest targets considered as partners of a model point. If two unrelated sets have
/// the same density, the farthest of them is still seven standard deviations of the displacements
/// away.
const CANDIDATES: usize = 64;
/// Squared distance beyond the nearest target, in variances, from which a target has no weight:
/// exp(−16) is 1e-7 of the nearest target's. All targets are considered if the farthest candidate
/// is nearer.
const FAR: f64 = 32.0;

/// Both sets in a common frame.
struct Sets<const D: usize> {
    /// The common frame, to convert lengths.
    frame: Frame<D>,
    model: Vec<Point<f64, D>>,
    target: Vec<Point<f64, D>>,
}

impl<const D: usize> Sets<D> {
    fn new(model: &[Point<f64, D>], target: &[Point<f64, D>]) -> Self {
        let frame = Frame::of_both(model, target);
        let inside =
            |points: &[Point<f64, D>]| points.iter().map(|p| frame.inside(p).into()).collect();
        Self {
            model: inside(model),
            target: inside(target),
            frame,
        }
    }

    fn squared(&self, i: usize, j: usize) -> f64 {
        (self.model[i] - self.target[j]).norm_squared()
    }

    /// The square of a length of the caller, in the units of the frame. Infinite for `None`.
    fn limit(&self, length: Option<f64>) -> f64 {
        length.map_or(f64::INFINITY, |l| (l / self.frame.scale).powi(2))
    }

    /// Probabilities of the candidates of model point `i`, if its displacement has a normal
    /// distribution of variance `variance` along each axis.
    fn posterior(
        &self,
        i: usize,
        candidates: impl Iterator<Item = usize>,
        variance: f64,
    ) -> Vec<(usize, f64)> {
        let mut p: Vec<_> = candidates.map(|j| (j, self.squared(i, j))).collect();
        let least = p.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        for (_, p) in &mut p {
            *p = match *p > least {
                true => (-0.5 * (*p - least) / variance.max(f64::MIN_POSITIVE)).exp(),
                false => 1.0,
            };
        }
        let sum: f64 = p.iter().map(|p| p.1).sum();
        p.iter_mut().for_each(|p| p.1 /= sum);
        p
    }
}

/// Builds the result from these pairs. The warp is their local field; confidences and covariances
/// follow from the distribution of the displacements. `near` are the nearest targets of each model
/// point, by rising row, or nothing if all targets may be partners.
fn matching<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    sets: &Sets<D>,
    assignment: Vec<Option<usize>>,
    near: &[Vec<usize>],
) -> Matching<D> {
    let partners = assignment.iter().enumerate();
    let pairs: Vec<_> = partners
        .filter_map(|(i, j)| Some((i, (*j)?, 1.0)))
        .collect();
    let total: f64 = pairs.iter().map(|&(i, j, _)| sets.squared(i, j)).sum();
    let variance = total / (pairs.len().max(1) * D) as f64;
    let scale = sets.frame.scale;
    let (warp, warped) = fitted(model, target, &pairs);
    let mut found = Matching::new(target, warp, warped, assignment);
    for (i, partner) in found.assignment.iter().enumerate() {
        let near = near.get(i).filter(|near| {
            let squares = near.iter().map(|&j| sets.squared(i, j));
            let range = squares.fold([f64::MAX, 0.0], |[a, b], s| [a.min(s), b.max(s)]);
            range[1] - range[0] > FAR * variance
        });
        let p = match near {
            Some(near) => sets.posterior(i, near.iter().copied(), variance),
            None => sets.posterior(i, 0..target.len(), variance),
        };
        let of_partner = p.iter().find(|p| Some(p.0) == *partner);
        found.confidence.push(of_partner.map_or(0.0, |p| p.1));
        let places = p.iter().map(|&(j, p)| (sets.target[j].coords, p));
        let covariance = spread(places) * (scale * scale);
        found.displacement_covariance.push(covariance);
        // Soft matches below this weight are dropped.
        let kept = p.into_iter().filter(|p| partner.is_some() && p.1 > 1e-4);
        found.soft.push_row(kept);
    }
    found.energy = vec![total * scale * scale];
    (found.report.judgement, found.report.period) =
        Judgement::of_pairs(model, target, &found.assignment);
    (found.report.stop, found.report.iterations) = (StopReason::Converged, 1);
    found
}

/// Pairs each model point with the nearest target point. If several model points share a nearest
/// target, the closest of them gets it.
///
/// The pairs are correct while displacements are smaller than half the distance between points. The
/// warp is that of [`Matching::from_pairs`]. `O((I + J) log J)`.
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
        let sets = Sets::new(model, target);
        let limit = sets.limit(self.max_distance);
        let mut near = nearest_rows(&sets.target, &sets.model, CANDIDATES);
        let mut holder: Vec<Option<(usize, f64)>> = vec![None; target.len()];
        for (i, near) in near.iter_mut().enumerate() {
            let nearest = near[0];
            near.sort_unstable();
            let squared = sets.squared(i, nearest);
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
        Ok(matching(model, target, &sets, assignment, &near))
    }
}

/// The smallest of the distances and its index, the first among equals.
pub(crate) fn nearest(distances: impl Iterator<Item = f64>) -> (usize, f64) {
    distances.enumerate().fold(
        (0, f64::INFINITY),
        |best, d| if d.1 < best.1 { d } else { best },
    )
}

/// Pairs the sets so that the sum of squared distances is smallest, by [`linear_assignment`](crate::linear_assignment).
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
        self.match_watched(model, target, &mut || ControlFlow::Continue(()))
    }

    fn match_watched(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        watch: Watch<'_>,
    ) -> Result<Matching<D>, MatchError> {
        point_sets(model, target)?;
        let sets = Sets::new(model, target);
        let limit = sets.limit(self.max_distance);
        let cost = |i, j| sets.squared(i, j).min(limit);
        let mut assignment = assigned([model.len(), target.len()], cost, watch)?;
        for (i, partner) in assignment.iter_mut().enumerate() {
            *partner = partner.filter(|&j| sets.squared(i, j) <= limit);
        }
        Ok(matching(model, target, &sets, assignment, &[]))
    }
}
