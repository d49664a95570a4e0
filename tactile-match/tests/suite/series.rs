//! Matches that start from the last result agree with new matches.

use nalgebra::{Point2, Point3, Vector3};
use tactile_match::{
    AnnealedSoftassign, CoherentPointDrift, LinearAssignment, MatchError, Matching, PointMatcher,
    Search, WarmStart,
};

/// A pseudo-random number in (−1, 1), the same on every machine.
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

/// Frame `k` of an increasing load: larger, slightly displaced, and with noise of up to `noise` per
/// point.
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

fn near() -> AnnealedSoftassign {
    AnnealedSoftassign::default().with_search(Search::Near)
}

fn agree(one: &Matching<3>, other: &Matching<3>, tolerance: f64) {
    assert_eq!(one.assignment, other.assignment);
    for (a, b) in one.warped.iter().zip(&other.warped) {
        assert!((a - b).norm() < tolerance, "{}", (a - b).norm());
    }
}

#[test]
fn a_series_agrees_with_matches_made_anew() {
    let model = dome(150);
    for noise in [0.0, 0.01] {
        let (mut warm, mut saved) = (WarmStart::default(), 0);
        for k in 1..8 {
            let target = frame(&model, k, noise);
            let next = near().match_next(&mut warm, &model, &target).unwrap();
            let anew = near().match_points(&model, &target).unwrap();
            // Both stop when the temperature changes by a ten-thousandth. The remaining difference
            // is a small fraction of the noise.
            agree(&next, &anew, 1e-12 + 0.03 * noise);

            saved += anew
                .report
                .iterations
                .saturating_sub(next.report.iterations);
        }
        // There are six runs of about eleven iterations. Each needs four fewer than a new match.
        assert!(saved >= 18, "{saved} iterations saved");
    }
}

/// `Near` omits the other starts and the average over scales. On suitable sets it finds every
/// partner and the warp of the thorough search.
#[test]
fn a_near_search_finds_what_a_thorough_one_finds() {
    let model = dome(150);
    for noise in [0.0, 0.003, 0.01] {
        for k in [1, 4, 8] {
            let target = frame(&model, k, noise);
            let found = near().match_points(&model, &target).unwrap();
            let thorough = AnnealedSoftassign::default()
                .match_points(&model, &target)
                .unwrap();
            assert_eq!(found.assignment, (0..150).map(Some).collect::<Vec<_>>());
            // The thorough search is more cautious: it may leave one of a hundred noisy points
            // without a partner.
            let pairs = found.assignment.iter().zip(&thorough.assignment);
            assert!(pairs.filter(|(a, b)| a != b).count() <= 2);
            for (a, b) in found.warped.iter().zip(&thorough.warped) {
                // Each is within the noise cube, √3 of its half side.
                assert!(
                    (a - b).norm() < 1e-12 + 2.0 * 3_f64.sqrt() * noise,
                    "{a} {b}"
                );
            }
            assert_eq!(found.report.starts, 1);
        }
    }
}

#[test]
fn a_target_far_from_the_last_is_matched_all_the_same() {
    let (model, mut warm) = (dome(120), WarmStart::default());
    for (k, grown) in [(1, 1.0), (2, 1.25), (1, 0.85)] {
        let squeezed = |p: Point3<f64>| Point3::new(grown * p.x, p.y / grown, p.z);
        let target: Vec<_> = frame(&model, k, 0.0).into_iter().map(squeezed).collect();
        let next = AnnealedSoftassign::default()
            .match_next(&mut warm, &model, &target)
            .unwrap();
        agree(
            &next,
            &AnnealedSoftassign::default()
                .match_points(&model, &target)
                .unwrap(),
            1e-12,
        );
        assert_eq!(next.assignment, (0..120).map(Some).collect::<Vec<_>>());
    }
}

#[test]
fn another_model_has_no_past() {
    let (one, other, mut warm) = (dome(60), dome(70), WarmStart::default());
    let target = frame(&one, 3, 0.0);
    let first = near().match_next(&mut warm, &one, &target).unwrap();
    let target = frame(&other, 2, 0.0);
    let next = near().match_next(&mut warm, &other, &target).unwrap();
    let anew = near().match_points(&other, &target).unwrap();
    agree(&next, &anew, f64::MIN_POSITIVE);
    // The first model is forgotten: its match needs the iterations of a cold one.
    let target = frame(&one, 3, 0.0);
    let again = near().match_next(&mut warm, &one, &target).unwrap();
    assert_eq!(again.report, first.report);
}

#[test]
fn an_error_leaves_the_state_as_it_was() {
    let (model, mut warm) = (dome(60), WarmStart::default());
    let target = frame(&model, 1, 0.0);
    let first = near().match_next(&mut warm, &model, &target).unwrap();
    assert!(near().match_next(&mut warm, &model, &[]).is_err());
    let nan = [Point3::new(f64::NAN, 0.0, 0.0)];
    assert!(near().match_next(&mut warm, &model, &nan).is_err());
    // Another model that cannot be matched leaves no trace either.
    assert!(near().match_next(&mut warm, &dome(70), &[]).is_err());
    let next = near().match_next(&mut warm, &model, &target).unwrap();
    assert!(next.report.iterations < first.report.iterations);
    agree(&next, &near().match_points(&model, &target).unwrap(), 1e-12);
    assert!(
        (next.warp.apply(&model[5]) - target[5]).norm() < 1e-9,
        "the spline is that of its own model"
    );
}

/// Counts the matches of a series.
struct Counting;

impl PointMatcher<2> for Counting {
    fn match_points(
        &self,
        model: &[Point2<f64>],
        target: &[Point2<f64>],
    ) -> Result<Matching<2>, MatchError> {
        LinearAssignment::default().match_points(model, target)
    }

    fn match_next(
        &self,
        warm: &mut WarmStart,
        model: &[Point2<f64>],
        target: &[Point2<f64>],
    ) -> Result<Matching<2>, MatchError> {
        *warm.state::<usize>() += 1;
        self.match_points(model, target)
    }
}

#[test]
fn every_matcher_keeps_its_own_state() {
    let model: Vec<Point2<f64>> = dome(40).iter().map(|p| Point2::new(p.x, p.y)).collect();
    let target: Vec<_> = model.iter().map(|p| Point2::new(1.02 * p.x, p.y)).collect();
    let boxed: Box<dyn PointMatcher<2> + Send + Sync> = Box::new(Counting);
    let mut warm = WarmStart::default();
    for _ in 0..3 {
        boxed.match_next(&mut warm, &model, &target).unwrap();
    }
    assert_eq!(*warm.state::<usize>(), 3);
    // Matchers without a state match anew and do not affect the state of another matcher.
    let matchers: [&dyn PointMatcher<2>; 2] =
        [&LinearAssignment::default(), &CoherentPointDrift::default()];
    for matcher in matchers {
        let next = matcher.match_next(&mut warm, &model, &target).unwrap();
        let anew = matcher.match_points(&model, &target).unwrap();
        assert_eq!(next.warped, anew.warped);
    }
    assert_eq!(*warm.state::<usize>(), 3);
    // Another matcher with a state starts cold.
    let found = AnnealedSoftassign::default().match_next(&mut warm, &model, &target);
    assert!(found.is_ok() && *warm.state::<usize>() == 0);
}
