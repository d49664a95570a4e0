//! Properties of the fast matcher.
use crate::common;
use nalgebra::{Point, Point2, Point3, Rotation2};
use std::ops::ControlFlow;
use tactile_match::{
    AnnealedSoftassign, MatchError, Outliers, PointMatcher, PointSet, Rotation, SoftassignOptions,
    SoftassignWorkspace, StopReason,
};

/// Fractional part of a multiple of the golden ratio: points without pattern, the same on every machine.
fn scatter(i: usize, k: usize) -> f64 {
    ((i * 7 + k * 131 + i * i * 3 + 1) as f64
        * [0.618_033_988_75, 0.754_877_666_25, 0.569_840_291][k])
        .fract()
}

fn cloud<const D: usize>(n: usize) -> Vec<Point<f64, D>> {
    (0..n)
        .map(|i| Point::from(std::array::from_fn(|k| scatter(i, k))))
        .collect()
}

/// A smooth warp without folds.
fn bend<const D: usize>(p: &Point<f64, D>) -> Point<f64, D> {
    let bump: f64 = (-p.coords.norm_squared() / 0.3).exp();
    Point::from(std::array::from_fn(|k| {
        1.1 * p[k] + 0.12 * p[(k + 1) % D] + 0.08 * bump - 0.3
    }))
}

/// Row `i` of the model is row `(5 i + 3) mod n` of the target; 5 and n have no common factor.
fn shuffled<const D: usize>(points: &[Point<f64, D>]) -> (Vec<Point<f64, D>>, Vec<usize>) {
    let n = points.len();
    let partner: Vec<usize> = (0..n).map(|i| (5 * i + 3) % n).collect();
    let mut target = vec![Point::origin(); n];
    partner
        .iter()
        .zip(points)
        .for_each(|(&j, p)| target[j] = bend(p));
    (target, partner)
}

fn all_right<const D: usize>(n: usize) {
    let model = cloud::<D>(n);
    let (target, partner) = shuffled(&model);
    let found = AnnealedSoftassign::default()
        .match_points(&model, &target)
        .unwrap();
    assert_eq!(
        found.assignment,
        partner.iter().map(|&j| Some(j)).collect::<Vec<_>>()
    );
    assert_eq!(found.report.stop, StopReason::Exact);
    for (i, p) in model.iter().enumerate() {
        // Interpolation of clean pairs: rounding of the spline's solution alone.
        assert!((found.warp.apply(p) - bend(p)).norm() < 1e-9);
        assert!((found.warped[i] - bend(p)).norm() < 1e-12 && found.confidence[i] > 0.9);
    }
    assert!(found.unmatched_model.is_empty() && found.unmatched_target.is_empty());
    // Exact says that the points returned lie on their partners.
    assert!(found.report.residual < 1e-12);
}

#[test]
fn clean_warps_of_plane_and_space_are_found_exactly() {
    all_right::<2>(52);
    all_right::<3>(61);
}

/// Where noise is well below the spacing, the first run ends at the noise: it does not fall below it, where points lose their partners and a second start
/// has to find them again.
#[test]
fn noise_below_the_spacing_rarely_takes_a_second_start() {
    /// A tenth of the spacing, (1/105)^⅓ of the cube's side, to either side.
    const NOISE: f64 = 0.02;
    let mut of_one_start = 0;
    for seed in 0..8 {
        let mut stream = common::Stream::new(seed);
        let model = common::scattered::<f64, 3>(105, seed);
        let truth = common::bend(&model, 0.06);
        let order = stream.permutation(105);
        let mut noisy = |p: &Point3<f64>| p.map(|x| x + NOISE * (2.0 * stream.next() - 1.0));
        let target: Vec<_> = common::reordered(&truth, &order)
            .iter()
            .map(&mut noisy)
            .collect();
        let found = AnnealedSoftassign::default()
            .match_points(&model, &target)
            .unwrap();
        of_one_start += usize::from(found.report.starts == 1);
        let right = (order.iter().enumerate())
            .filter(|&(j, &i)| found.assignment[i] == Some(j))
            .count();
        assert!(right >= 104, "{seed}: {right}");
        // The field is smooth: its points are nearer to the truth than the noise, of standard deviation NOISE/√3 along an axis, puts one.
        let squares = (found.warped.iter().zip(&truth)).map(|(w, t)| (w - t).norm_squared());
        let error = (squares.sum::<f64>() / 105.0).sqrt();
        assert!(error < 0.8 * NOISE, "{seed}: {error}");
    }
    // Where a point of the eight sets has strayed too far to be called matched, a second start looks for it; without a sign of noise all take two.
    assert!(of_one_start >= 4, "{of_one_start}");
}

#[test]
fn the_warp_goes_through_every_point_of_a_large_set() {
    all_right::<2>(502);
}

/// A jittered sunflower: nearly regular, so that a whole part may settle one point aside and support itself there.
#[test]
fn a_dense_nearly_regular_set_does_not_slip() {
    let n = 842;
    let model: Vec<Point2<f64>> = (0..n)
        .map(|i| {
            let (r, angle) = (((i as f64 + 0.5) / n as f64).sqrt(), 2.399_963 * i as f64);
            let jitter = |k: usize| 0.5 * (scatter(i, k) - 0.5) / (n as f64).sqrt();
            Point2::new(r * angle.cos() + jitter(0), r * angle.sin() + jitter(1))
        })
        .collect();
    let bulge = |p: &Point2<f64>| {
        let pull = |x: f64, y: f64| (-((p.x - x).powi(2) + (p.y - y).powi(2)) / 1.28).exp();
        Point2::new(
            p.x + 0.15 * pull(0.5, 0.2) - 0.1 * pull(-0.6, 0.4),
            p.y - 0.2 * pull(-0.2, -0.6),
        )
    };
    let partner: Vec<usize> = (0..n).map(|i| (5 * i + 3) % n).collect();
    let mut target = vec![Point2::origin(); n];
    partner
        .iter()
        .zip(&model)
        .for_each(|(&j, p)| target[j] = bulge(p));
    let found = AnnealedSoftassign::default()
        .match_points(&model, &target)
        .unwrap();
    assert!(
        found
            .assignment
            .iter()
            .zip(&partner)
            .all(|(a, &j)| *a == Some(j))
    );
}

#[test]
fn units_and_origin_do_not_matter() {
    let model = cloud::<2>(52);
    let (target, partner) = shuffled(&model);
    for (scale, offset) in [(1e-6, 0.0), (1e6, 3e6), (1.0, -40.0)] {
        let change = |points: &[Point2<f64>]| -> Vec<Point2<f64>> {
            points
                .iter()
                .map(|p| Point2::new(p.x * scale + offset, p.y * scale - offset))
                .collect()
        };
        let found = AnnealedSoftassign::default()
            .match_points(&change(&model), &change(&target))
            .unwrap();
        assert!(
            found
                .assignment
                .iter()
                .zip(&partner)
                .all(|(a, &j)| *a == Some(j)),
            "{scale} {offset}"
        );
    }
}

#[test]
fn any_rotation_is_found_when_asked_for() {
    let model = cloud::<2>(52);
    let (target, partner) = shuffled(&model);
    let matcher =
        AnnealedSoftassign::new(SoftassignOptions::default().with_rotation(Rotation::Any));
    for degrees in [75.0_f64, 180.0, -120.0] {
        let turn = Rotation2::new(degrees.to_radians());
        let turned: Vec<Point2<f64>> = target.iter().map(|p| turn * p).collect();
        let found = matcher.match_points(&model, &turned).unwrap();
        assert!(
            found
                .assignment
                .iter()
                .zip(&partner)
                .all(|(a, &j)| *a == Some(j)),
            "{degrees}"
        );
    }
}

#[test]
fn outliers_stay_without_partner() {
    let model = cloud::<3>(61);
    let (mut target, partner) = shuffled(&model);
    target.extend([[3.0, 0.2, 0.1], [-2.0, 0.3, 0.3], [0.1, 2.5, -1.0]].map(Point3::from));
    let found = AnnealedSoftassign::default()
        .match_points(&model, &target)
        .unwrap();
    assert!(
        found
            .assignment
            .iter()
            .zip(&partner)
            .all(|(a, &j)| *a == Some(j))
    );
    assert_eq!(found.unmatched_target, [61, 62, 63]);
}

#[test]
fn single_precision_gives_the_same_matches() {
    let model = cloud::<2>(52);
    let (target, partner) = shuffled(&model);
    let narrow =
        |points: &[Point2<f64>]| points.iter().map(|p| p.cast::<f32>()).collect::<Vec<_>>();
    let found = AnnealedSoftassign::default()
        .match_points(&narrow(&model), &narrow(&target))
        .unwrap();
    assert!(
        found
            .assignment
            .iter()
            .zip(&partner)
            .all(|(a, &j)| *a == Some(j))
    );
}

/// An answer for every odd input: as many rows as model points, all of them finite, no target twice.
fn is_sound<const D: usize>(model: &[Point<f64, D>], target: &[Point<f64, D>]) {
    let matcher =
        AnnealedSoftassign::new(SoftassignOptions::default().with_rotation(Rotation::Any));
    let found = matcher.match_points(model, target).unwrap();
    assert_eq!(found.warped.len(), model.len());
    assert!(found.warped.iter().all(|p| p.iter().all(|v| v.is_finite())));
    assert!(found.confidence.iter().all(|c| (0.0..=1.0).contains(c)));
    assert!(
        found
            .displacement_covariance
            .iter()
            .all(|c| c.iter().all(|v| v.is_finite()))
    );
    let mut rows: Vec<usize> = found.assignment.iter().flatten().copied().collect();
    let matched = rows.len();
    rows.sort_unstable();
    rows.dedup();
    assert_eq!(rows.len(), matched);
    assert_eq!(matched + found.unmatched_model.len(), model.len());
    assert_eq!(matched + found.unmatched_target.len(), target.len());
}

#[test]
fn degenerate_sets_have_answers() {
    let (one, few) = (cloud::<2>(1), cloud::<2>(3));
    let many = cloud::<2>(40);
    for (a, b) in [
        (&one, &one),
        (&one, &many),
        (&many, &one),
        (&few, &many),
        (&many, &few),
        (&many, &many),
    ] {
        is_sound(a, b);
    }
    let same = vec![Point3::new(1.0, 2.0, 3.0); 7];
    is_sound(&same, &same);
    is_sound(&same, &cloud::<3>(9));
    is_sound(&cloud::<3>(9), &same);
    let line: Vec<Point2<f64>> = (0..20)
        .map(|i| Point2::new(f64::from(i), 2.0 * f64::from(i)))
        .collect();
    is_sound(&line, &line);
    let grid: Vec<Point2<f64>> = (0..49)
        .map(|i| Point2::new(f64::from(i % 7), f64::from(i / 7)))
        .collect();
    is_sound(&grid, &grid);
    let found = AnnealedSoftassign::default()
        .match_points(&grid, &grid)
        .unwrap();
    assert!(
        found
            .assignment
            .iter()
            .enumerate()
            .all(|(i, a)| *a == Some(i)),
        "a set is matched to itself"
    );
}

#[test]
fn bad_input_is_a_typed_error() {
    let good = cloud::<2>(5);
    let mut bad = good.clone();
    bad[3].y = f64::NAN;
    let error = |a: &[Point2<f64>], b: &[Point2<f64>]| {
        AnnealedSoftassign::default()
            .match_points(a, b)
            .err()
            .unwrap()
    };
    assert_eq!(
        error(&bad, &good),
        MatchError::NotFinite {
            set: PointSet::Model,
            row: 3
        }
    );
    assert_eq!(
        error(&good, &[]),
        MatchError::Empty {
            set: PointSet::Target
        }
    );
    for slack in [f64::NAN, 0.0, 1.0, -1.0] {
        assert!(
            SoftassignOptions::default()
                .with_outlier_ratio(slack)
                .is_err()
        );
    }
    assert!(SoftassignOptions::default().with_max_iterations(0).is_err());
}

#[test]
fn the_callback_hears_every_iteration_and_stops_the_search() {
    let model = cloud::<2>(52);
    let (target, _) = shuffled(&model);
    let mut heard = 0;
    let mut workspace = SoftassignWorkspace::new();
    let found = AnnealedSoftassign::default()
        .match_points_with(&mut workspace, &model, &target, |_, energy| {
            assert!(energy.is_finite());
            heard += 1;
            if heard == 4 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })
        .unwrap();
    assert_eq!(
        (heard, found.report().stop, found.report().iterations),
        (4, StopReason::Callback, 4)
    );
}

#[test]
fn a_used_workspace_gives_the_same_bits() {
    let (a, b) = (cloud::<2>(52), cloud::<2>(37));
    let (target_a, target_b) = (shuffled(&a).0, shuffled(&b).0);
    let matcher = AnnealedSoftassign::default();
    let go = |_, _| ControlFlow::Continue(());
    let mut workspace = SoftassignWorkspace::new();
    matcher
        .match_points_with(&mut workspace, &b, &target_b, go)
        .unwrap();
    let again = matcher
        .match_points_with(&mut workspace, &a, &target_a, go)
        .unwrap();
    let fresh = matcher.match_points(&a, &target_a).unwrap();
    assert_eq!(again.warped::<f64>().collect::<Vec<_>>(), fresh.warped);
    assert_eq!(again.assignment(), fresh.assignment);
}

/// Clean, noisy and unusable pairs of different sizes: a workspace that has seen one must not colour the next.
#[test]
fn a_batch_gives_the_bits_of_single_matches() {
    let models = [cloud::<2>(31), cloud::<2>(24), Vec::new(), cloud::<2>(37)];
    let targets: Vec<Vec<Point2<f64>>> = models
        .iter()
        .enumerate()
        .map(|(k, model)| {
            let noise = if k == 1 { 0.02 } else { 0.0 };
            model
                .iter()
                .enumerate()
                .map(|(i, p)| bend(p).map(|c| c + noise * (7.3 * i as f64).sin()))
                .collect()
        })
        .collect();
    let pairs: Vec<_> = models
        .iter()
        .zip(&targets)
        .map(|(m, t)| (&m[..], &t[..]))
        .collect();
    let matcher = AnnealedSoftassign::default();
    let check = |batch: Vec<Result<tactile_match::Matching<f64, 2>, MatchError>>| {
        assert_eq!(batch.len(), pairs.len());
        for (found, (model, target)) in batch.into_iter().zip(&pairs) {
            match (found, matcher.match_points(model, target)) {
                (Ok(found), Ok(single)) => {
                    assert_eq!(found.warped, single.warped);
                    assert_eq!(
                        (found.assignment, found.confidence),
                        (single.assignment, single.confidence)
                    );
                    assert_eq!((found.energy, found.report), (single.energy, single.report));
                }
                (found, single) => assert!(found.is_err() && single.is_err() && model.is_empty()),
            }
        }
    };
    check(matcher.match_all(&pairs));
    #[cfg(feature = "rayon")]
    check(matcher.match_all_in_parallel(&pairs));
}

/// Where no outliers are expected every point gets a partner; where they are, a far point is left without.
#[test]
fn the_outliers_option_says_which_side_may_stay_alone() {
    let model = cloud::<2>(31);
    let (mut target, partner) = shuffled(&model);
    target.push(Point2::new(2.5, 2.5));
    for side in [Outliers::Both, Outliers::Target] {
        let options = SoftassignOptions::default().with_outliers(side);
        let found = AnnealedSoftassign::new(options)
            .match_points(&model, &target)
            .unwrap();
        assert_eq!(
            found.assignment,
            partner.iter().map(|&j| Some(j)).collect::<Vec<_>>()
        );
        assert_eq!(found.unmatched_target, [31]);
        // The sides change places: now it is a model point that has no partner.
        let other = if side == Outliers::Target {
            Outliers::Model
        } else {
            side
        };
        let options = SoftassignOptions::default().with_outliers(other);
        let found = AnnealedSoftassign::new(options)
            .match_points(&target, &model)
            .unwrap();
        assert_eq!(
            (found.unmatched_model, found.unmatched_target),
            (vec![31], vec![])
        );
    }
}
