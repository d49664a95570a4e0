//! Evenly distributed sets whose displacements are many times their spacing: annealing alone leaves
//! parts displaced by one point.
use nalgebra::{Point, Point2, Point3};
use std::ops::ControlFlow;
use tactile_match::{AnnealedSoftassign, PointMatcher, SoftassignMatch, SoftassignWorkspace};

/// A pseudo-random number in (−1, 1), the same on every machine.
fn scatter(i: usize, k: usize) -> f64 {
    let square = (i * i) as f64;
    2.0 * (square * [0.618_033_988_75, 0.754_877_666_25][k] + i as f64 * 0.569_840_291).fract()
        - 1.0
}

/// A sunflower disc of radius 1, with points displaced by up to an eighth of their spacing.
fn sunflower(n: usize) -> Vec<Point2<f64>> {
    let place = |i: usize| {
        let (r, angle) = (((i as f64 + 0.5) / n as f64).sqrt(), 2.399_963 * i as f64);
        let jitter = 0.22 / (n as f64).sqrt();
        Point2::new(
            r * angle.cos() + jitter * scatter(i, 0),
            r * angle.sin() + jitter * scatter(i, 1),
        )
    };
    (0..n).map(place).collect()
}

/// Rotated by `angle`, which is not visible in an even disc, and displaced by up to a tenth of its
/// radius.
fn warp(p: &Point2<f64>, angle: f64) -> Point2<f64> {
    let bump = |x: f64, y: f64| (-((p.x - x).powi(2) + (p.y - y).powi(2)) / 0.8).exp();
    let (a, b) = (bump(0.5, 0.3), bump(-0.6, -0.2));
    let (sin, cos) = angle.sin_cos();
    Point2::new(
        cos * p.x - sin * p.y + 0.1 * a,
        sin * p.x + cos * p.y - 0.08 * b,
    )
}

/// Matches, and counts correct and wrong pairs.
fn score<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    outliers: usize,
) -> (usize, usize) {
    let n = model.len();
    // Row i of the model is row (7 i + 3) mod n of the target, followed by outliers.
    assert!(target.len() == n + outliers && !n.is_multiple_of(7));
    let mut shuffled = target.to_vec();
    (0..n).for_each(|i| shuffled[(7 * i + 3) % n] = target[i]);
    let found = AnnealedSoftassign::default()
        .match_points(model, &shuffled)
        .unwrap();
    let right = (0..n)
        .filter(|&i| found.assignment[i] == Some((7 * i + 3) % n))
        .count();
    (right, found.assignment.iter().flatten().count() - right)
}

#[test]
fn no_part_of_a_turned_disc_lies_one_point_aside() {
    for (n, angle) in [(600, 0.12), (1000, -0.1), (1681, 0.08)] {
        let model = sunflower(n);
        let target: Vec<_> = model.iter().map(|p| warp(p, angle)).collect();
        assert_eq!(
            score(&model, &target, 0),
            (n, 0),
            "{n} points turned by {angle}"
        );
    }
}

#[test]
fn outliers_and_a_little_noise_do_not_mislead_the_patterns() {
    let model = sunflower(1000);
    // A fiftieth of the spacing, and one outlier per twenty points.
    let noisy = |(i, p): (usize, &Point2<f64>)| {
        warp(p, 0.1) + 0.001 * Point2::new(scatter(i + 7, 0), scatter(i + 7, 1)).coords
    };
    let mut target: Vec<_> = model.iter().enumerate().map(noisy).collect();
    target.extend((0..50).map(|i| Point2::new(1.1 * scatter(i + 3, 1), 1.1 * scatter(i + 3, 0))));
    let (right, wrong) = score(&model, &target, 50);
    // An outlier that is closer to a position than the noise is a valid partner, as far as a
    // matcher can determine.
    assert!(right >= 998 && wrong <= 2, "{right} right, {wrong} wrong");
}

#[test]
fn a_dense_surface_in_space_is_matched() {
    let lift = |p: Point2<f64>, height: f64| {
        Point3::new(p.x, p.y, height * (-p.coords.norm_squared() / 0.4).exp())
    };
    let model: Vec<_> = sunflower(1000).into_iter().map(|p| lift(p, 0.5)).collect();
    let target: Vec<_> = sunflower(1000)
        .iter()
        .map(|p| lift(warp(p, 0.12), 0.6))
        .collect();
    assert_eq!(score(&model, &target, 0), (1000, 0));
}

#[test]
fn what_a_workspace_did_before_changes_no_answer_and_saves_the_memory() {
    let scene = |n: usize, noise: f64, angle: f64| {
        let model = sunflower(n);
        let off = |i: usize| noise * Point2::new(scatter(i + 7, 0), scatter(i + 7, 1)).coords;
        let target: Vec<_> = model
            .iter()
            .enumerate()
            .map(|(i, p)| warp(p, angle) + off(i))
            .collect();
        (model, target)
    };
    let check = |workspace: &mut SoftassignWorkspace<2>,
                 (model, target): &(Vec<Point2<f64>>, Vec<Point2<f64>>),
                 seen: &mut dyn FnMut(SoftassignMatch<'_, 2>)| {
        let go = || ControlFlow::Continue(());
        let found = AnnealedSoftassign::default().match_points_with(workspace, model, target, go);
        seen(found.unwrap());
    };
    // The rotation of the first scene requires a comparison of patterns, with a wider spacing than
    // that of the second scene, whose first run is nearly correct.
    let (coarse, dense) = (scene(700, 0.0, 0.15), scene(900, 0.006, 0.0));
    let mut used = SoftassignWorkspace::default();
    check(&mut used, &coarse, &mut |found| {
        assert!(found.report.starts > 1)
    });
    check(&mut used, &dense, &mut |found| {
        check(&mut SoftassignWorkspace::default(), &dense, &mut |fresh| {
            assert_eq!(
                (&found.report, found.assignment),
                (&fresh.report, fresh.assignment)
            );
        });
    });
    let counted = allocation_counter::measure(|| {
        check(&mut used, &coarse, &mut |_| {});
        check(&mut used, &dense, &mut |_| {});
    });
    assert_eq!(counted.count_total, 0);
}
