//! The matchers for `f64` in the plane and in space, compiled with this crate.
//!
//! Builds at low optimisation share the instances of generic code that a dependency holds. Without these, every test,
//! example and dependent crate compiles the matchers anew: half of the time a test build takes.

use crate::{
    AnnealedSoftassign, CoherentPointDrift, MatchError, Matching, PointMatcher,
    RelaxationLabelling, WarmStart,
};
use nalgebra::Point;

type Once<M, const D: usize> =
    fn(&M, &[Point<f64, D>], &[Point<f64, D>]) -> Result<Matching<f64, D>, MatchError>;
type Next<M, const D: usize> = fn(
    &M,
    &mut WarmStart,
    &[Point<f64, D>],
    &[Point<f64, D>],
) -> Result<Matching<f64, D>, MatchError>;

/// A matcher's two ways to match.
type Both<M, const D: usize> = (Once<M, D>, Next<M, D>);

const fn both<M: PointMatcher<f64, D>, const D: usize>() -> Both<M, D> {
    (M::match_points, M::match_next)
}

#[used]
static SOFTASSIGN: (Both<AnnealedSoftassign, 2>, Both<AnnealedSoftassign, 3>) = (both(), both());
#[used]
static DRIFT: (Both<CoherentPointDrift, 2>, Both<CoherentPointDrift, 3>) = (both(), both());
#[used]
static LABELLING: (Both<RelaxationLabelling, 2>, Both<RelaxationLabelling, 3>) = (both(), both());
