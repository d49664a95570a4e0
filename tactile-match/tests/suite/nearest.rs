//! Nearest neighbours: the largest distance of a pair.

use nalgebra::{Point2, Vector2};
use tactile_match::{
    CoherentPointDrift, LinearAssignment, MatchError, Matching, NearestNeighbour, PointMatcher,
    RelaxationLabelling,
};

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

/// Two sets of this size have more pairs than a table in memory may hold.
#[test]
fn large_sets_are_paired_by_distance_or_refused() {
    // An even cover of the square, by powers of the plastic number.
    let model: Vec<_> = (0..20_000)
        .map(f64::from)
        .map(|k| Point2::new((0.754_877_666 * k).fract(), (0.569_840_291 * k).fract()))
        .collect();
    // The spacing is 0.007, and the shift is too small for another point to come nearer.
    let target: Vec<_> = model
        .iter()
        .rev()
        .map(|p| p + Vector2::new(1e-6, 0.0))
        .collect();
    let found = NearestNeighbour::default()
        .match_points(&model, &target)
        .unwrap();
    let right = |(i, j): (usize, &Option<usize>)| *j == Some(19_999 - i);
    let right = found
        .assignment
        .iter()
        .enumerate()
        .filter(|&pair| right(pair))
        .count();
    assert_eq!(right, 20_000);
    assert!(found.confidence.iter().all(|c| *c > 0.999));
    let dense: [&dyn PointMatcher<2>; 3] = [
        &LinearAssignment::default(),
        &CoherentPointDrift::default(),
        &RelaxationLabelling::default(),
    ];
    for method in dense {
        let error = method.match_points(&model, &target).err().expect("refused");
        assert!(matches!(error, MatchError::TooManyPairs { .. }), "{error}");
    }
}
