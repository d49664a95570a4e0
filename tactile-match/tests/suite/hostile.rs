//! Points a caller may come with by mistake, to every matcher: an answer that is consistent or a typed error, never a panic and never
//! NaN.

use crate::common::{assert_consistent, hostile_points, matchers};
use nalgebra::Point;
use proptest::prelude::*;
use tactile_match::MatchError;
use tactile_tps::Scalar;

fn answer<T: Scalar, const D: usize>(model: &[Point<T, D>], target: &[Point<T, D>]) {
    for (name, matcher) in matchers::<T, D>() {
        match matcher.match_points(model, target) {
            Ok(matching) => assert_consistent(name, model, target, &matching),
            Err(MatchError::NotFinite { .. }) => {}
            Err(error) => panic!("{name}: {error}"),
        }
    }
}

fn single<const D: usize>(points: &[Point<f64, D>]) -> Vec<Point<f32, D>> {
    points.iter().map(|p| p.map(|c| c as f32)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn in_the_plane(model in hostile_points::<2>(9), target in hostile_points::<2>(9)) {
        answer(&model, &target);
        answer(&single(&model), &single(&target));
    }

    #[test]
    fn in_space(model in hostile_points::<3>(9), target in hostile_points::<3>(9)) {
        answer(&model, &target);
        answer(&single(&model), &single(&target));
    }

    #[test]
    fn against_itself(model in hostile_points::<3>(12)) {
        answer(&model, &model);
    }
}
