//! Points that a caller may pass by mistake, for every matcher: a consistent result or a typed
//! error, never a panic and never NaN.

use crate::common::hostile_points;
use crate::corpus::points::every_matcher;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn in_the_plane(model in hostile_points::<2>(9), target in hostile_points::<2>(9)) {
        every_matcher(&model, &target);
    }

    #[test]
    fn in_space(model in hostile_points::<3>(9), target in hostile_points::<3>(9)) {
        every_matcher(&model, &target);
    }

    #[test]
    fn against_itself(model in hostile_points::<3>(12)) {
        every_matcher(&model, &model);
    }
}
