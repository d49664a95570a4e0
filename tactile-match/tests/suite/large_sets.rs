//! Sets of thousands of points, which are matched from coarse to fine.

use crate::common::{Scene, Stream, bend, scattered};
use nalgebra::Point;
use std::ops::ControlFlow;
use tactile_match::{
    AnnealedSoftassign, MatchError, PointMatcher, SoftassignWorkspace, StopReason,
};

/// Enough for two levels, and few enough for a debug build.
const POINTS: usize = 4500;

/// A bent set, shuffled, with outliers.
fn scene<const D: usize>(noise: f64, outliers: usize) -> Scene<D> {
    let mut stream = Stream::new(31);
    let model = scattered::<D>(POINTS, 32);
    let (truth, order) = (bend(&model, 0.08), stream.permutation(POINTS));
    Scene::new(model, truth, order, |_| noise, outliers, &mut stream)
}

/// Fraction of the model points that are matched to their own partner.
fn right<const D: usize>(scene: &Scene<D>, assignment: &[Option<usize>]) -> f64 {
    scene.right(assignment) as f64 / POINTS as f64
}

fn check_clean<const D: usize>() {
    for outliers in [0, POINTS / 10] {
        let scene = scene::<D>(0.0, outliers);
        let found = AnnealedSoftassign::default()
            .match_points(&scene.model, &scene.target)
            .expect("good points");
        let right = right(&scene, &found.assignment);
        // An outlier may replace a point with which it nearly coincides.
        assert!(right > 0.99, "{D}-D, {outliers} outliers: {right} right");
        assert_eq!(found.report.doubt(), None, "{D}-D, {outliers} outliers");
        // The spline interpolates every third point. Between them the field is smooth on the scale
        // of their spacing.
        let between = scene.model.iter().zip(&scene.truth);
        let close = between.filter(|(p, t)| (found.warp.apply(p) - *t).norm() < 2e-3);
        assert!(close.count() as f64 > 0.99 * POINTS as f64, "{D}-D");
    }
}

#[test]
fn clean_sets_are_matched() {
    check_clean::<2>();
    check_clean::<3>();
}

/// A bell over a nearly regular disc, displaced by four broad bumps by a fifth of its radius: a
/// slip along the surface is nearly as good an explanation.
#[test]
fn surfaces_in_space_do_not_slip() {
    for n in [2000, 5000] {
        let mut stream = Stream::new(41);
        let model: Vec<_> = (0..n)
            .map(|i| {
                let (r, angle) = (((i as f64 + 0.5) / n as f64).sqrt(), 2.399_963 * i as f64);
                let step = 0.15 * (std::f64::consts::PI / n as f64).sqrt();
                let [x, y] = [angle.cos(), angle.sin()].map(|c| r * c + step * stream.normal());
                Point::from([x, y, 0.6 * (-(x * x + y * y).min(1.0) / 0.405).exp()])
            })
            .collect();
        let bump = |p: &Point<f64, 3>, x: f64, y: f64| {
            (-((p[0] - x).powi(2) + (p[1] - y).powi(2) + p[2] * p[2]) / 1.28).exp()
        };
        let truth: Vec<_> = model
            .iter()
            .map(|p| {
                let [a, b, c, d] = [(0.7, 0.2), (-0.5, 0.6), (0.1, -0.9), (-0.8, -0.5)]
                    .map(|(x, y)| 0.3 * bump(p, x, y));
                Point::from([p[0] + a - c, p[1] + b - d, p[2] + d - a])
            })
            .collect();
        let order = stream.permutation(n);
        let scene = Scene::new(model, truth, order, |_| 0.0, 0, &mut stream);
        let found = AnnealedSoftassign::default()
            .match_points(&scene.model, &scene.target)
            .expect("good points");
        let right = scene.right(&found.assignment) as f64 / n as f64;
        assert!(right > 0.99, "{n} points: {right} right");
        assert_eq!(found.report.doubt(), None, "{n} points");
    }
}

/// Every point of a cluster is a candidate for every other: a million points would need terabytes.
#[test]
fn a_heap_in_one_place_is_refused() {
    let mut heap = scattered::<2>(POINTS, 33);
    heap[500..1501].fill(Point::from([0.5, 0.25]));
    let spread = scattered::<2>(POINTS, 34);
    let matcher = AnnealedSoftassign::default();
    assert!(matches!(
        matcher.match_points(&spread, &heap),
        Err(MatchError::Coincident {
            set: "target",
            count: 1001,
            limit: 1000
        })
    ));
}

/// Noise of a spacing hides the pairs, and only the density determines the field. Displacements
/// that do not change the density are invisible, so that not all points lie within three noise
/// widths.
#[test]
fn noise_of_a_spacing_leaves_the_field() {
    let noise = 0.015;
    let scene = scene::<2>(noise, POINTS / 10);
    let found = AnnealedSoftassign::default()
        .match_points(&scene.model, &scene.target)
        .expect("good points");
    let rows = found.warped.iter().zip(&scene.truth);
    let within = rows.filter(|(w, t)| (*w - *t).norm() < 3.0 * noise).count();
    assert!(within as f64 > 0.85 * POINTS as f64, "{within} within");
    // Pairs cannot be determined, and the report contains a doubt.
    assert!(found.report.doubt().is_some());
}

/// With noise of a tenth of the spacing, below the limit for patterns of clean sets, nearly all
/// points have a partner. Some random points have a neighbour within three noise widths and are
/// exchanged with it.
#[test]
fn noise_of_a_tenth_of_the_spacing_loses_no_pairs() {
    let noise = 0.1 * (POINTS as f64).powf(-1.0 / 3.0);
    let scene = scene::<3>(noise, 0);
    let matcher = AnnealedSoftassign::default();
    let found = matcher
        .match_points(&scene.model, &scene.target)
        .expect("good points");
    let matched = found.assignment.iter().flatten().count() as f64 / POINTS as f64;
    let (right, sigma) = (right(&scene, &found.assignment), found.report.sigma / noise);
    assert!(
        matched > 0.97 && right > 0.93,
        "{matched} matched, {right} right"
    );
    assert!((0.9..1.1).contains(&sigma), "{sigma}");
    assert_eq!(found.report.doubt(), None);
}

#[test]
fn a_caller_who_stops_has_an_answer_for_every_point() {
    let scene = scene::<2>(0.0, 0);
    let mut workspace = SoftassignWorkspace::default();
    let found = AnnealedSoftassign::default()
        .match_points_with(&mut workspace, &scene.model, &scene.target, || {
            ControlFlow::Break(())
        })
        .expect("good points");
    assert_eq!(found.report.stop, StopReason::Cancelled);
    assert_eq!(found.assignment.len(), POINTS);
    assert!(found.warped().all(|p| p.coords.norm() < 10.0));
}

/// A search that is stopped while it anneals all points keeps the motions that it has found.
#[test]
fn a_caller_who_stops_late_has_the_best_answer_so_far() {
    let scene = scene::<2>(0.0, 0);
    let matcher = AnnealedSoftassign::default();
    let mut workspace = SoftassignWorkspace::default();
    let mut stopped_at = |last: usize| {
        let mut heard = 0;
        let watch = || {
            heard += 1;
            match heard >= last {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        let found = matcher
            .match_points_with(&mut workspace, &scene.model, &scene.target, watch)
            .expect("good points");
        let share = right(&scene, found.assignment);
        (heard, found.report.stop, share)
    };
    let (all, _, complete) = stopped_at(usize::MAX);
    let (_, stop, share) = stopped_at(all - 2);
    assert_eq!(stop, StopReason::Cancelled);
    // Two calls before its end the search has annealed to a fraction of the spacing.
    assert!(complete > 0.99 && share > 0.9, "{complete} {share}");
}

#[test]
fn a_grown_workspace_allocates_nothing_and_gives_the_same_bits() {
    let scene = scene::<3>(0.0, 0);
    let mut workspace = SoftassignWorkspace::default();
    let matcher = AnnealedSoftassign::default();
    let go = || ControlFlow::Continue(());
    let first: Vec<Point<f64, 3>> = matcher
        .match_points_with(&mut workspace, &scene.model, &scene.target, go)
        .expect("good points")
        .warped()
        .collect();
    let allocated = allocation_counter::measure(|| {
        let found = matcher
            .match_points_with(&mut workspace, &scene.model, &scene.target, go)
            .expect("good points");
        assert!(found.warped().eq(first.iter().copied()));
    });
    assert_eq!(allocated.count_total, 0);
}
