//! Points a caller may come with by mistake, to every matcher: an answer that is consistent or a
//! typed error, never a panic and never NaN.

use crate::common::{assert_consistent, hostile_points, matchers};
use nalgebra::Point;
use proptest::prelude::*;
use tactile_match::MatchError;

fn answer<const D: usize>(model: &[Point<f64, D>], target: &[Point<f64, D>]) {
    for (name, matcher) in matchers::<D>() {
        match matcher.match_points(model, target) {
            Ok(matching) => assert_consistent(name, model, target, &matching),
            Err(MatchError::NotFinite { .. }) => {}
            Err(error) => panic!("{name}: {error}"),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn in_the_plane(model in hostile_points::<2>(9), target in hostile_points::<2>(9)) {
        answer(&model, &target);
    }

    #[test]
    fn in_space(model in hostile_points::<3>(9), target in hostile_points::<3>(9)) {
        answer(&model, &target);
    }

    #[test]
    fn against_itself(model in hostile_points::<3>(12)) {
        answer(&model, &model);
    }
}
