//! Nearest neighbours: the largest distance of a pair.

use nalgebra::Point2;
use tactile_match::{Matching, NearestNeighbour, PointMatcher};

fn partners(matcher: NearestNeighbour) -> Vec<Option<usize>> {
    let model = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [9.0, 9.0]].map(Point2::from);
    // Distances of 0.5, 2 and 3.5 from the first three model points.
    let target = [[0.3, 0.4], [4.0, -2.0], [0.0, 7.5]].map(Point2::from);
    let matching: Matching<2> = matcher.match_points(&model, &target).unwrap();
    matching.assignment
}

#[test]
fn no_pair_is_further_apart_than_the_limit() {
    let all = [Some(0), Some(1), Some(2)];
    for (limit, paired) in [(0.4, 0), (0.6, 1), (2.1, 2), (3.6, 3)] {
        let within = partners(NearestNeighbour::within(limit).unwrap());
        for (k, partner) in all.into_iter().enumerate() {
            assert_eq!(within[k], partner.filter(|_| k < paired), "{limit}: {k}");
        }
        assert_eq!(within[3], None, "its nearest has a nearer one");
    }
    assert_eq!(partners(NearestNeighbour::default())[..3], all);
}
