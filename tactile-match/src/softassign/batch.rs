//! Many matches: one after another through one workspace, or spread over threads.

use super::{AnnealedSoftassign, SoftassignWorkspace};
use crate::{MatchError, Matching};
use nalgebra::Point;
use std::ops::ControlFlow;
use tactile_tps::Scalar;

/// A model and its target.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{PointSets, AnnealedSoftassign};
/// let points = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0]].map(Point2::from);
/// let pair: PointSets<'_, f64, 2> = (&points, &points);
/// assert_eq!(AnnealedSoftassign::default().match_all(&[pair])[0].as_ref().unwrap().assignment, [Some(0), Some(1), Some(2)]);
/// ```
pub type PointSets<'a, T, const D: usize> = (&'a [Point<T, D>], &'a [Point<T, D>]);

impl AnnealedSoftassign {
    /// Matches every `(model, target)` through one workspace; a set that cannot be matched does not hinder the others.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::AnnealedSoftassign;
    /// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2]].map(Point2::from);
    /// let target = [[1.1, 1.2], [0.2, 1.0], [1.0, 0.1], [0.0, 0.0]].map(Point2::from);
    /// let found = AnnealedSoftassign::default().match_all(&[(&model[..], &target[..]), (&model[..], &[])]);
    /// assert_eq!(found[0].as_ref().unwrap().assignment[0], Some(3));
    /// assert!(found[1].is_err());
    /// ```
    pub fn match_all<T: Scalar, const D: usize>(
        &self,
        pairs: &[PointSets<'_, T, D>],
    ) -> Vec<Result<Matching<T, D>, MatchError>> {
        let mut workspace = SoftassignWorkspace::new();
        pairs
            .iter()
            .map(|pair| self.match_one(&mut workspace, pair))
            .collect()
    }

    /// As [`match_all`](Self::match_all) on all threads of the current pool, with the same bits.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::AnnealedSoftassign;
    /// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2]].map(Point2::from);
    /// let target = model.map(|p| Point2::new(1.1 * p.x, p.y));
    /// let (matcher, pairs) = (AnnealedSoftassign::default(), [(&model[..], &target[..]); 3]);
    /// let (serial, parallel) = (matcher.match_all(&pairs), matcher.match_all_in_parallel(&pairs));
    /// assert_eq!(serial[2].as_ref().unwrap().warped, parallel[2].as_ref().unwrap().warped);
    /// ```
    #[cfg(feature = "rayon")]
    pub fn match_all_in_parallel<T: Scalar, const D: usize>(
        &self,
        pairs: &[PointSets<'_, T, D>],
    ) -> Vec<Result<Matching<T, D>, MatchError>> {
        use rayon::prelude::*;
        let one = |workspace: &mut _, pair: &_| self.match_one(workspace, pair);
        pairs
            .par_iter()
            .map_init(SoftassignWorkspace::new, one)
            .collect()
    }

    fn match_one<T: Scalar, const D: usize>(
        &self,
        workspace: &mut SoftassignWorkspace<D>,
        &(model, target): &PointSets<'_, T, D>,
    ) -> Result<Matching<T, D>, MatchError> {
        let go = |_, _| ControlFlow::Continue(());
        Ok(self
            .match_points_with(workspace, model, target, go)?
            .to_matching(model))
    }
}
