//! The matchers for `f64` in the plane and in space, compiled with this crate.
//!
//! Builds at low optimisation share the instances of generic code that a dependency holds. Without
//! these, every test, example and dependent crate compiles the matchers anew: half of the time a
//! test build takes.

use crate::{
    AnnealedSoftassign, CoherentPointDrift, MatchError, MatchedPairs, Matching, PointMatcher,
    RelaxationLabelling, WarmStart,
};
use nalgebra::Point;

type Once<M, const D: usize> =
    fn(&M, &[Point<f64, D>], &[Point<f64, D>]) -> Result<Matching<D>, MatchError>;
type Next<M, const D: usize> =
    fn(&M, &mut WarmStart, &[Point<f64, D>], &[Point<f64, D>]) -> Result<Matching<D>, MatchError>;

type NextPairs<M, const D: usize> = fn(
    &M,
    &mut WarmStart,
    &[Point<f64, D>],
    &[Point<f64, D>],
    &mut MatchedPairs,
) -> Result<(), MatchError>;

/// A matcher's ways to match.
type Ways<M, const D: usize> = (Once<M, D>, Next<M, D>, NextPairs<M, D>);

const fn ways<M: PointMatcher<D>, const D: usize>() -> Ways<M, D> {
    (M::match_points, M::match_next, M::match_next_pairs)
}

#[used]
static SOFTASSIGN: (Ways<AnnealedSoftassign, 2>, Ways<AnnealedSoftassign, 3>) = (ways(), ways());
#[used]
static DRIFT: (Ways<CoherentPointDrift, 2>, Ways<CoherentPointDrift, 3>) = (ways(), ways());
#[used]
static LABELLING: (Ways<RelaxationLabelling, 2>, Ways<RelaxationLabelling, 3>) = (ways(), ways());
