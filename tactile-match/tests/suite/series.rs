//! Matches that begin where the last one ended find what a match made anew finds.
use nalgebra::{Point2, Point3, Vector3};
use tactile_match::{
    CoherentPointDrift, LinearAssignment, MatchSeries, Matching, PointMatcher, RelaxationMatcher,
    RelaxationOptions, Search,
};

/// A number of (−1, 1), without pattern and the same on every machine.
fn scatter(i: usize, k: usize) -> f64 {
    2.0 * ((i * i) as f64 * 0.618_033_988_75 + (i * (k + 1)) as f64 * 0.754_877_666_25).fract()
        - 1.0
}

/// Points of a dome.
fn dome(n: usize) -> Vec<Point3<f64>> {
    let place = |i: usize| {
        let (r, angle) = (((i as f64 + 0.5) / n as f64).sqrt(), 2.4 * i as f64);
        Point3::new(r * angle.cos(), r * angle.sin(), 0.6 * (1.0 - r * r))
    };
    (0..n).map(place).collect()
}

/// Frame `k` of a rising load: larger, a little moved, every point off by up to `noise`.
fn frame(model: &[Point3<f64>], k: usize, noise: f64) -> Vec<Point3<f64>> {
    let growth = 1.0 + 0.02 * k as f64;
    let shift = Vector3::new(0.01 * k as f64, -0.004 * k as f64, 0.0);
    let off = |i: usize| Vector3::from_fn(|axis, _| noise * scatter(i + 1000 * k, axis));
    model
        .iter()
        .enumerate()
        .map(|(i, p)| p * growth + shift + off(i))
        .collect()
}

fn near() -> RelaxationMatcher {
    RelaxationMatcher::new(RelaxationOptions::default().search(Search::Near))
}

fn agree(one: &Matching<f64, 3>, other: &Matching<f64, 3>, tolerance: f64) {
    assert_eq!(one.assignment, other.assignment);
    for (a, b) in one.warped.iter().zip(&other.warped) {
        assert!((a - b).norm() < tolerance, "{}", (a - b).norm());
    }
}

#[test]
fn a_series_agrees_with_matches_made_anew() {
    let model = dome(150);
    for noise in [0.0, 0.01] {
        let (mut series, mut saved) = (MatchSeries::new(), 0);
        for k in 1..8 {
            let target = frame(&model, k, noise);
            let next = near().match_next(&mut series, &model, &target).unwrap();
            let anew = near().match_points(&model, &target).unwrap();
            // Both stop when the temperature moves by a ten-thousandth; what is left is a small part of the noise.
            agree(&next, &anew, 1e-12 + 0.03 * noise);

            saved += anew
                .report
                .iterations
                .saturating_sub(next.report.iterations);
        }
        // Six runs of about eleven iterations, four fewer each.
        assert!(saved >= 18, "{saved} iterations saved");
    }
}

#[test]
fn a_target_far_from_the_last_is_matched_all_the_same() {
    let (model, mut series) = (dome(120), MatchSeries::new());
    for (k, grown) in [(1, 1.0), (2, 1.25), (1, 0.85)] {
        let squeezed = |p: Point3<f64>| Point3::new(grown * p.x, p.y / grown, p.z);
        let target: Vec<_> = frame(&model, k, 0.0).into_iter().map(squeezed).collect();
        let next = RelaxationMatcher::default()
            .match_next(&mut series, &model, &target)
            .unwrap();
        agree(
            &next,
            &RelaxationMatcher::default()
                .match_points(&model, &target)
                .unwrap(),
            1e-12,
        );
        assert_eq!(next.assignment, (0..120).map(Some).collect::<Vec<_>>());
    }
}

#[test]
fn another_model_has_no_past() {
    let (one, other, mut series) = (dome(60), dome(70), MatchSeries::new());
    near()
        .match_next(&mut series, &one, &frame(&one, 3, 0.0))
        .unwrap();
    assert!(series.last_for(&one).is_some() && series.last_for(&other).is_none());
    let target = frame(&other, 2, 0.0);
    let next = near().match_next(&mut series, &other, &target).unwrap();
    agree(
        &next,
        &near().match_points(&other, &target).unwrap(),
        0.0 + f64::MIN_POSITIVE,
    );
    assert!(series.last_for(&one).is_none());
}

#[test]
fn an_error_leaves_the_series_as_it_was() {
    let (model, mut series) = (dome(60), MatchSeries::new());
    near()
        .match_next(&mut series, &model, &frame(&model, 1, 0.0))
        .unwrap();
    let before = series.last_for(&model).unwrap().to_vec();
    assert!(near().match_next(&mut series, &model, &[]).is_err());
    assert!(
        near()
            .match_next(&mut series, &model, &[Point3::new(f64::NAN, 0.0, 0.0)])
            .is_err()
    );
    // Nor does another model that cannot be matched leave anything of its own.
    assert!(near().match_next(&mut series, &dome(70), &[]).is_err());
    assert_eq!(series.last_for(&model), Some(&*before));
    let target = frame(&model, 1, 0.0);
    let next = near().match_next(&mut series, &model, &target).unwrap();
    agree(&next, &near().match_points(&model, &target).unwrap(), 1e-12);
    assert!(
        (next.warp.apply(&model[5]) - target[5]).norm() < 1e-9,
        "the spline is that of its own model"
    );
}

#[test]
fn matchers_without_a_memory_match_anew() {
    let model: Vec<Point2<f64>> = dome(40).iter().map(|p| Point2::new(p.x, p.y)).collect();
    let target: Vec<_> = model.iter().map(|p| Point2::new(1.02 * p.x, p.y)).collect();
    let matchers: [&dyn PointMatcher<f64, 2>; 2] =
        [&LinearAssignment::new(), &CoherentPointDrift::default()];
    for matcher in matchers {
        let mut series = MatchSeries::new();
        for _ in 0..2 {
            let next = matcher.match_next(&mut series, &model, &target).unwrap();
            assert_eq!(
                next.warped,
                matcher.match_points(&model, &target).unwrap().warped
            );
            assert_eq!(series.last_for(&model), Some(&*next.warped));
        }
    }
}
