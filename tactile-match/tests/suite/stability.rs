//! Every matcher far from size one and from the origin, on points that nearly coincide or lie in a
//! plane, and in single precision.

use crate::common::{
    Stream, assert_consistent, bend, largest_step, matchers, reordered, scattered,
};
use nalgebra::{Point, Point3, SVector};
use tactile_match::{Matching, PointMatcher};
use tactile_tps::Scalar;

const POINTS: usize = 40;

/// A model, its deformed copy in another order, and that order.
fn scene<const D: usize>(
    seed: u64,
    size: f64,
) -> (Vec<Point<f64, D>>, Vec<Point<f64, D>>, Vec<usize>) {
    let model = scattered::<D>(POINTS, seed);
    let order = Stream::new(seed).permutation(POINTS);
    let target = reordered(&bend(&model, size), &order);
    (model, target, order)
}

fn run<const D: usize>(
    name: &str,
    matcher: &dyn PointMatcher<D>,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
) -> Matching<D> {
    let matching = matcher
        .match_points(model, target)
        .unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_consistent(name, model, target, &matching);
    matching
}

fn right(assignment: &[Option<usize>], order: &[usize]) -> usize {
    (0..order.len())
        .filter(|&i| assignment[i].is_some_and(|j| order[j] == i))
        .count()
}

/// The answer must scale with the points. Powers of ten round every coordinate: the input differs
/// by the scalar's epsilon, which iterations and ill-conditioned splines enlarge by up to `growth`.
fn check_scale<const D: usize>(growth: f64) {
    let (model, target, _) = scene::<D>(1, 0.03);
    for (name, matcher) in matchers::<D>() {
        let plain = run(name, &*matcher, &model, &target);
        for exponent in [-9, -6, -3, 3, 6, 9] {
            let scale: f64 = 10_f64.powi(exponent);
            let scaled =
                |points: &[Point<f64, D>]| points.iter().map(|p| p * scale).collect::<Vec<_>>();
            let name = format!("{name}, scale 1e{exponent}, {}-D", D);
            let other = run(&name, &*matcher, &scaled(&model), &scaled(&target));
            assert_eq!(other.assignment, plain.assignment, "{name}");
            let error = largest_step(&other.warped, &scaled(&plain.warped)) / 10_f64.powi(exponent);
            assert!(error <= growth * f64::UNIT_ROUNDOFF, "{name}: {error:e}");
        }
    }
}

#[test]
fn the_scale_does_not_matter_in_double_precision() {
    check_scale::<2>(1e8);
    check_scale::<3>(1e8);
}

#[test]
fn an_offset_of_a_million_diameters_does_not_matter() {
    fn check<const D: usize>() {
        let (model, target, order) = scene::<D>(2, 0.03);
        // A power of two keeps what is lost to rounding at 2⁻³³ of the diameter.
        let offset = SVector::<f64, D>::repeat(f64::from(1 << 20));
        let moved =
            |points: &[Point<f64, D>]| points.iter().map(|p| p + offset).collect::<Vec<_>>();
        for (name, matcher) in matchers::<D>() {
            let plain = run(name, &*matcher, &model, &target);
            let other = run(name, &*matcher, &moved(&model), &moved(&target));
            assert_eq!(
                right(&other.assignment, &order),
                right(&plain.assignment, &order),
                "{name}, {D}-D"
            );
            let error = largest_step(&other.warped, &moved(&plain.warped));
            assert!(error <= 1e-5, "{name}, {D}-D: {error:e}"); // rounding 1e-10, enlarged as above
        }
    }
    check::<2>();
    check::<3>();
}

#[test]
fn sets_far_apart_are_matched() {
    let (model, target, order) = scene::<3>(3, 0.03);
    let far: Vec<_> = target
        .iter()
        .map(|p| p + SVector::<f64, 3>::repeat(1e5))
        .collect();
    for (name, matcher) in matchers::<3>() {
        let matching = run(name, &*matcher, &model, &far);
        // Nearest neighbours are the only matcher that goes by where the sets lie.
        if name != "nearest neighbour" {
            assert!(
                right(&matching.assignment, &order) >= POINTS - 2,
                "{name}: {}",
                right(&matching.assignment, &order)
            );
        }
    }
}

#[test]
fn a_nearly_flat_set_is_matched() {
    let (model, target, order) = scene::<3>(4, 0.03);
    for thickness in [1e-3, 1e-6, 1e-9, 1e-12, 0.0] {
        let flat = |points: &[Point3<f64>]| {
            points
                .iter()
                .map(|p| Point3::new(p.x, p.y, 5.0 + thickness * p.z))
                .collect::<Vec<_>>()
        };
        let (model, target) = (flat(&model), flat(&target));
        for (name, matcher) in matchers::<3>() {
            let name = format!("{name}, thickness {thickness}");
            let matching = run(&name, &*matcher, &model, &target);
            // Projecting a jittered cube brings points close to one another; most are still told
            // apart by their plane positions.
            assert!(
                right(&matching.assignment, &order) >= POINTS / 2,
                "{name}: {}",
                right(&matching.assignment, &order)
            );
            let off_plane = matching
                .warped
                .iter()
                .map(|p| (p.z - 5.0).abs())
                .fold(0.0, f64::max);
            assert!(
                off_plane <= 2.0 * thickness + 1e-6,
                "{name}: {off_plane:e} off the plane"
            );
        }
    }
}

#[test]
fn near_duplicates_are_answered() {
    let (model, target, order) = scene::<2>(5, 0.02);
    for distance in [1e-3, 1e-6, 1e-9, 1e-12, 1e-15] {
        let doubled = |points: &[Point<f64, 2>]| {
            let near = points
                .iter()
                .map(|p| p + SVector::<f64, 2>::repeat(distance));
            points.iter().copied().chain(near).collect::<Vec<_>>()
        };
        for (name, matcher) in matchers::<2>() {
            let name = format!("{name}, duplicates at {distance:e}");
            let matching = run(&name, &*matcher, &doubled(&model), &doubled(&target));
            let right = (0..2 * POINTS)
                .filter(|&i| {
                    matching.assignment[i].is_some_and(|j| order[j % POINTS] == i % POINTS)
                })
                .count();
            // Which of the two is no question of right or wrong.
            assert!(right >= POINTS, "{name}: {right} of {}", 2 * POINTS);
        }
    }
}
