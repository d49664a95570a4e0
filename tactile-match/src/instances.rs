//! The matchers in the plane and in space, compiled with this crate.
//!
//! Generic code is compiled again in every crate that calls it, and the matchers are the largest
//! part of what the program, the Python package and a test compile. The generic methods therefore
//! look up the compiled function for their dimension in a table.

use crate::softassign::SoftassignWorkspace;
use crate::{
    AnnealedSoftassign, CoherentPointDrift, MatchError, MatchedPairs, Matching, PointMatcher,
    RelaxationLabelling, WarmStart, Watch,
};
use nalgebra::Point;
use std::any::Any;
use std::ops::ControlFlow;

/// A pair of functions, one for points of the plane and one for points in space.
struct Instances<F2, F3>(F2, F3);

impl<F2: 'static, F3: 'static> Instances<F2, F3> {
    /// The function for `dimension`.
    fn of<F: Copy + 'static>(&self, dimension: usize) -> Result<F, MatchError> {
        let all: [&dyn Any; 2] = [&self.0, &self.1];
        let found = all.iter().find_map(|instance| instance.downcast_ref());
        found.copied().ok_or(MatchError::Dimension { dimension })
    }
}

type Found<const D: usize> = Result<Matching<D>, MatchError>;
type Once<M, const D: usize> = fn(&M, &[Point<f64, D>], &[Point<f64, D>], Watch<'_>) -> Found<D>;
type Next<const D: usize> =
    fn(&AnnealedSoftassign, &mut WarmStart, &[Point<f64, D>], &[Point<f64, D>]) -> Found<D>;
type NextPairs<const D: usize> = fn(
    &AnnealedSoftassign,
    &mut WarmStart,
    &[Point<f64, D>],
    &[Point<f64, D>],
    &mut MatchedPairs,
) -> Result<(), MatchError>;
type Search<const D: usize> = fn(&mut SoftassignWorkspace<D>, Watch<'_>);

type Both<M> = Instances<Once<M, 2>, Once<M, 3>>;
static SOFTASSIGN: Both<AnnealedSoftassign> =
    Instances(AnnealedSoftassign::once, AnnealedSoftassign::once);
static NEXT: Instances<Next<2>, Next<3>> =
    Instances(AnnealedSoftassign::next, AnnealedSoftassign::next);
static NEXT_PAIRS: Instances<NextPairs<2>, NextPairs<3>> = Instances(
    AnnealedSoftassign::next_pairs,
    AnnealedSoftassign::next_pairs,
);
static SEARCH: Instances<Search<2>, Search<3>> =
    Instances(SoftassignWorkspace::solve, SoftassignWorkspace::solve);
static DRIFT: Both<CoherentPointDrift> =
    Instances(CoherentPointDrift::once, CoherentPointDrift::once);
static LABELLING: Both<RelaxationLabelling> =
    Instances(RelaxationLabelling::once, RelaxationLabelling::once);

impl<const D: usize> SoftassignWorkspace<D> {
    /// [`solve`](Self::solve), instantiated in this crate.
    pub(crate) fn search(&mut self, watch: Watch<'_>) -> Result<(), MatchError> {
        SEARCH.of::<Search<D>>(D)?(self, watch);
        Ok(())
    }
}

/// The first two methods of a matcher, which its table has the functions of.
macro_rules! matched {
    ($table:ident) => {
        fn match_points(&self, model: &[Point<f64, D>], target: &[Point<f64, D>]) -> Found<D> {
            self.match_watched(model, target, &mut || ControlFlow::Continue(()))
        }

        fn match_watched(
            &self,
            model: &[Point<f64, D>],
            target: &[Point<f64, D>],
            watch: Watch<'_>,
        ) -> Found<D> {
            $table.of::<Once<Self, D>>(D)?(self, model, target, watch)
        }
    };
}

impl<const D: usize> PointMatcher<D> for AnnealedSoftassign {
    matched!(SOFTASSIGN);

    fn match_next(
        &self,
        warm: &mut WarmStart,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Found<D> {
        NEXT.of::<Next<D>>(D)?(self, warm, model, target)
    }

    fn match_next_pairs(
        &self,
        warm: &mut WarmStart,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        pairs: &mut MatchedPairs,
    ) -> Result<(), MatchError> {
        NEXT_PAIRS.of::<NextPairs<D>>(D)?(self, warm, model, target, pairs)
    }
}

impl<const D: usize> PointMatcher<D> for CoherentPointDrift {
    matched!(DRIFT);
}

impl<const D: usize> PointMatcher<D> for RelaxationLabelling {
    matched!(LABELLING);
}
