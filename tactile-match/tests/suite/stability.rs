//! Every matcher with sizes far from one, far from the origin, on points that nearly coincide or
//! lie in a plane, and in single precision.

use crate::common::{Scene, largest_step, matched, matchers};
use nalgebra::{Point, Point3, SVector};

const POINTS: usize = 40;

/// The result must scale with the points. Powers of ten round every coordinate: the input differs
/// by the scalar's epsilon, which iterations and ill-conditioned splines amplify by up to `growth`.
fn check_scale<const D: usize>(growth: f64) {
    let scene = Scene::<D>::bent(POINTS, 0.03, 1);
    for (name, matcher) in matchers::<D>() {
        let plain = matched(name, &*matcher, &scene.model, &scene.target);
        for exponent in [-9, -6, -3, 3, 6, 9] {
            let scale: f64 = 10_f64.powi(exponent);
            let scaled =
                |points: &[Point<f64, D>]| points.iter().map(|p| p * scale).collect::<Vec<_>>();
            let name = format!("{name}, scale 1e{exponent}, {}-D", D);
            let other = matched(
                &name,
                &*matcher,
                &scaled(&scene.model),
                &scaled(&scene.target),
            );
            assert_eq!(other.assignment, plain.assignment, "{name}");
            let error = largest_step(&other.warped, &scaled(&plain.warped)) / 10_f64.powi(exponent);
            assert!(error <= growth * (0.5 * f64::EPSILON), "{name}: {error:e}");
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
        let scene = Scene::<D>::bent(POINTS, 0.03, 2);
        // A power of two keeps the rounding errors at 2⁻³³ of the diameter.
        let offset = SVector::<f64, D>::repeat(f64::from(1 << 20));
        let moved =
            |points: &[Point<f64, D>]| points.iter().map(|p| p + offset).collect::<Vec<_>>();
        for (name, matcher) in matchers::<D>() {
            let plain = matched(name, &*matcher, &scene.model, &scene.target);
            let other = matched(name, &*matcher, &moved(&scene.model), &moved(&scene.target));
            assert_eq!(
                scene.right(&other.assignment),
                scene.right(&plain.assignment),
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
    let scene = Scene::<3>::bent(POINTS, 0.03, 3);
    let far: Vec<_> = scene
        .target
        .iter()
        .map(|p| p + SVector::<f64, 3>::repeat(1e5))
        .collect();
    for (name, matcher) in matchers::<3>() {
        let matching = matched(name, &*matcher, &scene.model, &far);
        // Only nearest neighbours depend on the positions of the sets.
        if name != "nearest neighbour" {
            assert!(
                scene.right(&matching.assignment) >= POINTS - 2,
                "{name}: {}",
                scene.right(&matching.assignment)
            );
        }
    }
}

#[test]
fn a_nearly_flat_set_is_matched() {
    let scene = Scene::<3>::bent(POINTS, 0.03, 4);
    for thickness in [1e-3, 1e-6, 1e-9, 1e-12, 0.0] {
        let flat = |points: &[Point3<f64>]| {
            points
                .iter()
                .map(|p| Point3::new(p.x, p.y, 5.0 + thickness * p.z))
                .collect::<Vec<_>>()
        };
        let (model, target) = (flat(&scene.model), flat(&scene.target));
        for (name, matcher) in matchers::<3>() {
            let name = format!("{name}, thickness {thickness}");
            let matching = matched(&name, &*matcher, &model, &target);
            // The projection of a jittered cube moves points close together. Most are still
            // distinguished by their positions in the plane.
            assert!(
                scene.right(&matching.assignment) >= POINTS / 2,
                "{name}: {}",
                scene.right(&matching.assignment)
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
    let scene = Scene::<2>::bent(POINTS, 0.02, 5);
    for distance in [1e-3, 1e-6, 1e-9, 1e-12, 1e-15] {
        let doubled = |points: &[Point<f64, 2>]| {
            let near = points
                .iter()
                .map(|p| p + SVector::<f64, 2>::repeat(distance));
            points.iter().copied().chain(near).collect::<Vec<_>>()
        };
        for (name, matcher) in matchers::<2>() {
            let name = format!("{name}, duplicates at {distance:e}");
            let matching = matched(
                &name,
                &*matcher,
                &doubled(&scene.model),
                &doubled(&scene.target),
            );
            let right = (0..2 * POINTS)
                .filter(|&i| {
                    matching.assignment[i].is_some_and(|j| scene.order[j % POINTS] == i % POINTS)
                })
                .count();
            // Which of the two is chosen does not matter.
            assert!(right >= POINTS, "{name}: {right} of {}", 2 * POINTS);
        }
    }
}
