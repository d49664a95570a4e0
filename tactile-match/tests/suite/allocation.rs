//! A batch with one workspace does not allocate after its first match.
use nalgebra::Point2;
use std::ops::ControlFlow;
use tactile_match::{
    AnnealedSoftassign, MatchedPairs, PointMatcher, SoftassignWorkspace, WarmStart,
};

#[test]
fn a_batch_of_small_matches_allocates_nothing_after_the_first() {
    let model: Vec<Point2<f64>> = (0..24)
        .map(|i| {
            Point2::new(
                (0.618 * f64::from(i * i + 1)).fract(),
                (0.755 * f64::from(3 * i + 1)).fract(),
            )
        })
        .collect();
    // Every other target is noisy, so that the full search with all starts is also covered.
    let target = |shift: f64, noise: f64| -> Vec<Point2<f64>> {
        let wobble = |i: usize| noise * (12.9 * i as f64).sin();
        model
            .iter()
            .enumerate()
            .map(|(i, p)| Point2::new(1.05 * p.x + shift + wobble(i), p.y - wobble(i + 9)))
            .collect()
    };
    let targets = [target(0.1, 0.0), target(0.1, 0.05)];
    let matcher = AnnealedSoftassign::default();
    let mut workspace = SoftassignWorkspace::default();
    let mut run = |k: usize| {
        let go = || ControlFlow::Continue(());
        let found = matcher
            .match_points_with(&mut workspace, &model, &targets[k % 2], go)
            .expect("finite points");
        assert_eq!(found.assignment.len(), 24);
    };
    (0..2).for_each(&mut run);
    let info = allocation_counter::measure(|| (0..1000).for_each(&mut run));
    assert_eq!(info.count_total, 0);
}

#[test]
fn pairs_along_a_series_allocate_nothing() {
    let place = |i: u32, stretch: f64| {
        let (r, turn) = (0.1 * f64::from(i).sqrt(), 2.4 * f64::from(i));
        Point2::new(stretch * r * turn.cos(), r * turn.sin())
    };
    let model: Vec<_> = (0..80).map(|i| place(i, 1.0)).collect();
    // Steps over which the last result is followed, and a jump that requires the full search.
    let targets = [1.02, 1.04, 1.06, 1.6, 1.04]
        .map(|stretch| (0..80).map(|i| place(i, stretch)).collect::<Vec<_>>());
    let matcher = AnnealedSoftassign::default();
    let (mut warm, mut pairs) = (WarmStart::default(), MatchedPairs::default());
    let (mut other, mut whole) = (WarmStart::default(), Vec::new());
    for _ in 0..2 {
        for target in &targets {
            matcher
                .match_next_pairs(&mut warm, &model, target, &mut pairs)
                .expect("finite points");
            let matching = matcher
                .match_next(&mut other, &model, target)
                .expect("finite points");
            assert_eq!(
                (&pairs.assignment, &pairs.report),
                (&matching.assignment, &matching.report)
            );
            assert_eq!(pairs.confidence, matching.confidence);
            whole.push(matching.report.iterations);
        }
    }
    assert!(whole[1] < whole[0], "followed, not searched: {whole:?}");
    let counted = allocation_counter::measure(|| {
        for target in &targets {
            matcher
                .match_next_pairs(&mut warm, &model, target, &mut pairs)
                .expect("finite points");
        }
    });
    assert_eq!(counted.count_total, 0);
}
