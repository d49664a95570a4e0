//! Point sets made from any bytes, and requirements for the result of every matcher.
//!
//! Used by the replay of the kept corpus and by the fuzz target `matcher` in `fuzz/`.

use super::contract::{assert_consistent, matchers, modes};
use nalgebra::{Point, SVector};
use tactile_match::MatchError;

/// Largest number of points of a set: enough for every stage of the matchers, and small enough for
/// a thousand inputs per minute.
const MOST: usize = 24;

/// Values at the limits of arithmetic.
const EXTREMES: [f64; 12] = [
    -0.0,
    5e-324,
    f64::MIN_POSITIVE,
    1e-300,
    1e9,
    -1e12,
    1e100,
    1e154,
    f64::MAX,
    f64::MIN,
    f64::INFINITY,
    f64::NAN,
];

/// Reads two sets of points and passes them to every matcher.
///
/// The first byte determines whether the points lie in the plane or in space, and whether the
/// target is the displaced model. The second and the third are the numbers of points. Then come
/// coordinates: a byte below 200 is a multiple of a tenth, a byte above it an extreme value, and
/// 255 precedes the eight bytes of any number. Missing bytes are zero.
pub(crate) fn matcher(bytes: &[u8]) {
    let mut bytes = bytes.iter().copied();
    let mut next = || bytes.next().unwrap_or(0);
    let kind = next();
    let counts = [next(), next()].map(|n| usize::from(n) % MOST + 1);
    let mut coordinate = || match next() {
        255 => f64::from_le_bytes(std::array::from_fn(|_| next())),
        byte if byte < 200 => f64::from(byte) / 10.0 - 10.0,
        byte => EXTREMES[usize::from(byte) % EXTREMES.len()],
    };
    if kind & 1 == 0 {
        either_dimension::<2>(kind, counts, &mut coordinate);
    } else {
        either_dimension::<3>(kind, counts, &mut coordinate);
    }
}

fn either_dimension<const D: usize>(
    kind: u8,
    counts: [usize; 2],
    coordinate: &mut impl FnMut() -> f64,
) {
    let mut point = || Point::from(SVector::from_fn(|_, _| coordinate()));
    let model: Vec<Point<f64, D>> = (0..counts[0]).map(|_| point()).collect();
    let target: Vec<Point<f64, D>> = if kind & 2 == 0 {
        (0..counts[1]).map(|_| point()).collect()
    } else {
        let step = point();
        model.iter().rev().map(|p| p + step.coords).collect()
    };
    every_matcher(&model, &target);
}

/// Every matcher gives a consistent result, or an error if a coordinate is unusable.
pub(crate) fn every_matcher<const D: usize>(model: &[Point<f64, D>], target: &[Point<f64, D>]) {
    // A coordinate is usable if the square of a difference of two such coordinates is finite.
    let sixteen = 16.0;
    let usable = |p: &Point<f64, D>| p.iter().all(|&c| (c * c * sixteen).is_finite());
    let all_usable = model.iter().chain(target).all(usable);
    for (name, matcher) in matchers::<D>().into_iter().chain(modes()) {
        match matcher.match_points(model, target) {
            Ok(matching) => {
                assert!(all_usable, "{name}: an answer to {model:?} and {target:?}");
                assert_consistent(name, model, target, &matching);
            }
            Err(MatchError::NotFinite { .. }) => {
                assert!(!all_usable, "{name}: {model:?} and {target:?} are finite");
            }
            Err(error) => panic!("{name}: {error}"),
        }
    }
}
