//! Requirements for every [`PointMatcher`], in 2-D and 3-D.

use crate::common::{
    Scene, Stream, bend, grid, largest_step, matched, matchers, reordered, scattered,
};
use nalgebra::{Point, SVector};
use tactile_match::{MatchError, PointMatcher};

/// Runs a check for every matcher and dimension.
macro_rules! for_all {
    ($check:ident) => {
        for_all!(@one $check, 2);
        for_all!(@one $check, 3);
    };
    (@one $check:ident, $d:literal) => {
        for (name, matcher) in matchers::<$d>() {
            $check::<$d>(&format!("{name}, {}-D", $d), &*matcher);
        }
    };
}

/// Scattered points, and a regular grid with many equally near neighbours.
#[test]
fn identical_sets_match_themselves() {
    fn check<const D: usize>(name: &str, matcher: &dyn PointMatcher<D>) {
        let side = if D == 2 { 6 } else { 4 };
        for (points, spacing) in [(scattered(40, 1), 0.14), (grid(side), 1.0)] {
            let matching = matched(name, matcher, &points, &points);
            let expected: Vec<_> = (0..points.len()).map(Some).collect();
            assert_eq!(matching.assignment, expected, "{name}");
            // A tenth of the spacing: the possible error of a registration that stops early.
            assert!(
                largest_step(&matching.warped, &points) < 0.1 * spacing,
                "{name}"
            );
        }
    }
    for_all!(check);
}

#[test]
fn the_order_of_the_points_does_not_matter() {
    fn check<const D: usize>(name: &str, matcher: &dyn PointMatcher<D>) {
        let model = scattered::<D>(40, 2);
        let target = bend(&model, 0.02);
        let plain = matched(name, matcher, &model, &target);
        let mut stream = Stream::new(3);
        let (rows, columns) = (stream.permutation(40), stream.permutation(40));
        let shuffled = matched(
            name,
            matcher,
            &reordered(&model, &rows),
            &reordered(&target, &columns),
        );
        let place: Vec<_> = (0..40)
            .map(|j| columns.iter().position(|&c| c == j))
            .collect();
        let expected: Vec<_> = rows
            .iter()
            .map(|&i| plain.assignment[i].and_then(|j| place[j]))
            .collect();
        assert_eq!(shuffled.assignment, expected, "{name}");
        // Sums in another order differ by rounding, which iterations may amplify.
        assert!(
            largest_step(&shuffled.warped, &reordered(&plain.warped, &rows)) < 1e-6,
            "{name}"
        );
    }
    for_all!(check);
}

#[test]
fn a_small_deformation_is_found() {
    fn check<const D: usize>(name: &str, matcher: &dyn PointMatcher<D>) {
        let scene = Scene::<D>::bent(60, 0.02, 4);
        let matching = matched(name, matcher, &scene.model, &scene.target);
        assert_eq!(scene.right(&matching.assignment), 60, "{name}");
    }
    for_all!(check);
}

#[test]
fn sets_of_different_size_are_matched() {
    fn check<const D: usize>(name: &str, matcher: &dyn PointMatcher<D>) {
        let points = scattered::<D>(50, 6);
        for (model, target) in [(&points[..], &points[..45]), (&points[..45], &points[..])] {
            let matching = matched(name, matcher, model, target);
            let right = (0..45)
                .filter(|&i| matching.assignment[i] == Some(i))
                .count();
            // The positions of the remaining points have no unique result; nine tenths of the
            // others must be correct.
            assert!(right >= 41, "{name}: {right} of 45");
        }
    }
    for_all!(check);
}

#[test]
fn coincident_and_collinear_points_are_answered() {
    fn check<const D: usize>(name: &str, matcher: &dyn PointMatcher<D>) {
        let all = scattered::<D>(12, 8);
        let same = vec![all[0]; 12];
        let line: Vec<_> = (0..12)
            .map(|k| all[0] + (all[1] - all[0]) * (f64::from(k)))
            .collect();
        let twice = [&all[..6], &all[..6]].concat();
        let sets = [
            ("scattered", &all),
            ("coincident", &same),
            ("collinear", &line),
            ("twice", &twice),
        ];
        for (a, model) in sets {
            for (b, target) in sets {
                matched(&format!("{name}, {a} to {b}"), matcher, model, target);
            }
        }
    }
    for_all!(check);
}

#[test]
fn empty_sets_and_numbers_that_are_none_are_typed_errors() {
    fn check<const D: usize>(name: &str, matcher: &dyn PointMatcher<D>) {
        let good = scattered::<D>(5, 9);
        let empty = |set| MatchError::Empty { set };
        assert_eq!(
            matcher.match_points(&[], &good).err(),
            Some(empty("model")),
            "{name}"
        );
        assert_eq!(
            matcher.match_points(&good, &[]).err(),
            Some(empty("target")),
            "{name}"
        );
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut points = good.clone();
            points[3] = Point::from(SVector::from_element(bad));
            let not_finite = |set| MatchError::NotFinite { set, row: 3 };
            assert_eq!(
                matcher.match_points(&points, &good).err(),
                Some(not_finite("model")),
                "{name}"
            );
            assert_eq!(
                matcher.match_points(&good, &points).err(),
                Some(not_finite("target")),
                "{name}"
            );
        }
    }
    for_all!(check);
}

#[test]
fn the_same_input_gives_the_same_bits() {
    fn check<const D: usize>(name: &str, matcher: &dyn PointMatcher<D>) {
        let model = scattered::<D>(30, 10);
        let target = bend(&model, 0.05);
        let (a, b) = (
            matched(name, matcher, &model, &target),
            matched(name, matcher, &model, &target),
        );
        assert_eq!(a.warped, b.warped, "{name}");
        assert_eq!(
            (a.assignment, a.confidence, a.energy),
            (b.assignment, b.confidence, b.energy),
            "{name}"
        );
    }
    for_all!(check);
}
