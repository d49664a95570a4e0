//! Nearest neighbours: the baseline for small displacements.

use crate::hard::{self, Distances};
use crate::validate::{point_sets, valid_distance};
use crate::{MatchError, Matching, PointMatcher};
use nalgebra::Point;

/// Gives every model point the target point nearest to it; of several model points that want one target, the nearest has it.
///
/// Right while displacements are smaller than half the distance between points. The warp interpolates the pairs. `O(I J)`.
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
    /// No pair further apart than `max_distance`, in the units of the points.
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
        Ok(hard::matching(model, target, &distances, assignment))
    }
}

/// The least of some distances, the first of equals.
fn nearest(distances: impl Iterator<Item = f64>) -> (usize, f64) {
    distances.enumerate().fold(
        (0, f64::INFINITY),
        |best, d| if d.1 < best.1 { d } else { best },
    )
}
