//! Linear assignment as a matcher: all pairs at once, each point used once.

use crate::hard::{self, Distances};
use crate::validate::{point_sets, valid_distance};
use crate::{MatchError, Matching, PointMatcher, linear_assignment};
use nalgebra::Point;

/// Pairs the sets so that the sum of squared distances is least, by [`linear_assignment`].
///
/// Unlike nearest neighbours it never leaves a point without a partner for another's sake, and a common translation of
/// two sets of one size makes no difference. The warp interpolates the pairs.
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
    /// No pair further apart than `max_distance`, in the units of the points; leaving two points without partner costs as
    /// much as a pair at that distance.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{LinearAssignment, PointMatcher};
    /// let model = [[0.0, 0.0], [1.0, 0.0]].map(Point2::from);
    /// let target = [[0.1, 0.0], [9.0, 0.0]].map(Point2::from);
    /// assert_eq!(LinearAssignment::default().match_points(&model, &target)?.assignment, [Some(0), Some(1)]);
    /// assert_eq!(LinearAssignment::within(2.0)?.match_points(&model, &target)?.assignment, [Some(0), None]);
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
        // nalgebra is column-major: the transpose in memory is row-major.
        let costs: Vec<f64> = distances
            .squared
            .transpose()
            .iter()
            .map(|s| s.min(limit))
            .collect();
        let mut assignment = linear_assignment(&costs, model.len(), target.len())?;
        for (i, partner) in assignment.iter_mut().enumerate() {
            *partner = partner.filter(|&j| distances.squared[(i, j)] <= limit);
        }
        Ok(hard::matching(model, target, &distances, assignment))
    }
}
