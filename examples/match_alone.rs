//! The crate tactile-match alone: two sets of points, their pairs, and the warp between them.
#![allow(clippy::print_stdout)]
use nalgebra::Point2;
use tactile_match::{AnnealedSoftassign, MatchError, NearestNeighbour, PointMatcher};

fn main() -> Result<(), MatchError> {
    let model: Vec<Point2<f64>> = (0..60)
        .map(|k| f64::from(k) / 60.0 * std::f64::consts::TAU)
        .map(|turn| Point2::new(turn.cos() + 0.3 * (3.0 * turn).cos(), turn.sin()))
        .collect();
    // Moved, sheared, in the opposite order and without some of the points.
    let moved = |p: &Point2<f64>| Point2::new(1.2 * p.x + 0.3 * p.y + 0.4, p.y - 0.1 * p.x * p.x);
    let target: Vec<Point2<f64>> = model.iter().rev().skip(5).map(moved).collect();
    let matchers: [(&str, &dyn PointMatcher<2>); 2] = [
        ("default matcher", &AnnealedSoftassign::default()),
        ("nearest neighbours", &NearestNeighbour::default()),
    ];
    for (name, matcher) in matchers {
        let found = matcher.match_points(&model, &target)?;
        let pairs = found.assignment.iter().enumerate();
        let right = pairs
            .filter(|(i, j)| *j == &59_usize.checked_sub(i + 5))
            .count();
        println!(
            "{name}: {right} of 60 right, {} without a partner",
            found.unmatched_model.len()
        );
    }
    Ok(())
}
