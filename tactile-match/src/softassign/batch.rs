//! Many matches spread over threads.

use super::{AnnealedSoftassign, SoftassignWorkspace};
#[cfg(doc)]
use crate::PointMatcher;
use crate::{MatchError, Matching};
use nalgebra::Point;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// A model and a target.
type Pair<'a, const D: usize> = (&'a [Point<f64, D>], &'a [Point<f64, D>]);

impl AnnealedSoftassign {
    /// Matches every `(model, target)` on all threads of the current pool, with the bits of [`PointMatcher::match_points`]; a pair that cannot be
    /// matched does not hinder the others.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{AnnealedSoftassign, PointMatcher};
    /// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2]].map(Point2::from);
    /// let target = model.map(|p| Point2::new(1.1 * p.x, p.y));
    /// let (matcher, pairs) = (AnnealedSoftassign::default(), [(&model[..], &target[..]); 3]);
    /// let (serial, parallel) = (matcher.match_points(&model, &target)?, matcher.match_all_in_parallel(&pairs));
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
