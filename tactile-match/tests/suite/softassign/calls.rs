//! Calls: invalid options, the callback, reused workspaces, batches.
use crate::common::{Scene, bend, scattered};
use nalgebra::Point2;
use std::ops::ControlFlow;
use tactile_match::{
    AnnealedSoftassign, MatchError, PointMatcher, SoftassignWorkspace, StopReason,
};

#[test]
fn options_out_of_range_are_errors() {
    let good = AnnealedSoftassign::default();
    for slack in [f64::NAN, 0.0, 1.0, -1.0] {
        assert!(good.with_outlier_ratio(slack).is_err());
    }
    assert!(good.with_max_iterations(0).is_err());
}

#[test]
fn the_callback_stops_the_search() {
    let scene = Scene::<2>::bent(52, 0.06, 23);
    let mut heard = 0;
    let mut workspace = SoftassignWorkspace::default();
    let found = AnnealedSoftassign::default()
        .match_points_with(&mut workspace, &scene.model, &scene.target, || {
            heard += 1;
            if heard == 4 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })
        .unwrap();
    assert_eq!((heard, found.report.stop), (4, StopReason::Cancelled));
    assert!(found.report.iterations <= 4);
}

#[test]
fn a_match_that_is_stopped_has_no_pairs() {
    // The larger sets are matched coarse to fine.
    for points in [60, 4100] {
        let scene = Scene::<2>::bent(points, 0.06, 23);
        for last in [1, 3] {
            let mut heard = 0;
            let mut watch = || {
                heard += 1;
                match heard >= last {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            let matcher = AnnealedSoftassign::default();
            let found = matcher.match_watched(&scene.model, &scene.target, &mut watch);
            let found = found.unwrap();
            assert_eq!(found.report.stop, StopReason::Cancelled);
            assert!(found.assignment == vec![None; points] && found.warped.len() == points);
            assert!(heard <= last + 1, "{heard} {last}");
        }
    }
}

/// Clean, noisy and unusable pairs of different sizes: the use of a workspace for one of them must
/// not affect the next.
#[test]
fn a_batch_gives_the_bits_of_single_matches() {
    let models = [31, 24, 0, 37].map(|n| scattered::<2>(n, 24));
    let targets: Vec<Vec<Point2<f64>>> = models
        .iter()
        .enumerate()
        .map(|(k, model)| {
            let noise = if k == 1 { 0.02 } else { 0.0 };
            let moved = bend(model, 0.06).into_iter().enumerate();
            moved
                .map(|(i, p)| p.map(|c| c + noise * (7.3 * i as f64).sin()))
                .collect()
        })
        .collect();
    let pairs: Vec<_> = models
        .iter()
        .zip(&targets)
        .map(|(m, t)| (&m[..], &t[..]))
        .collect();
    let matcher = AnnealedSoftassign::default();
    let check = |batch: Vec<Result<tactile_match::Matching<2>, MatchError>>| {
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
    let go = || ControlFlow::Continue(());
    let mut workspace = SoftassignWorkspace::default();
    let one = |&(model, target): &_| {
        let found = matcher.match_points_with(&mut workspace, model, target, go)?;
        Ok(found.to_matching(model))
    };
    check(pairs.iter().map(one).collect());
    #[cfg(feature = "rayon")]
    check(matcher.match_all_in_parallel(&pairs));
}
