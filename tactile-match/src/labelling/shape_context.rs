//! First probabilities: how alike the surroundings of two points are, by their shape contexts [Belongie, Malik & Puzicha,
//! IEEE PAMI 24, 509–522, 2002; as first probabilities of relaxation: Zheng & Doermann, IEEE PAMI 28, 643–649, 2006].

use super::MatchMatrix;
use crate::ShapeContexts;
use nalgebra::Point;

/// The contexts reach twice the mean distance of two points; none where all coincide.
fn contexts<const D: usize>(points: &[Point<f64, D>]) -> Option<ShapeContexts> {
    let distances = points
        .iter()
        .flat_map(|p| points.iter().map(move |q| (q - p).norm()));
    let sum = distances.fold(0.0, |sum, d| sum + d);
    let pairs = points.len() * points.len().saturating_sub(1);
    let two: f64 = 2.0;
    ShapeContexts::new(points, two * sum / (pairs.max(1) as f64)).ok()
}

/// The first match matrix: `exp(−C_ij / temperature)` of the shape-context distances `C`, `slack` relative to the likeliest partner
/// in the slack entries, after one sweep of [`sinkhorn`](super::sinkhorn()); `O(I J)` times the number of bins.
#[must_use]
pub(crate) fn first_matches<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    temperature: f64,
    slack: f64,
) -> MatchMatrix {
    let contexts = contexts(model).zip(contexts(target));
    let cost = |i, j| {
        contexts
            .as_ref()
            .map_or(0.0, |(g, h)| f64::from(g.cost(i, h, j)))
    };
    let costs: Vec<Vec<f64>> = (0..model.len())
        .map(|i| (0..target.len()).map(|j| cost(i, j)).collect())
        .collect();
    let least = |row: &[f64]| row.iter().copied().fold(f64::INFINITY, f64::min);
    let columns = target.len();
    let mut m = MatchMatrix::from_fn(model.len(), columns, |i, j| {
        let weight = match costs.get(i) {
            Some(row) if j < columns => (-(row[j] - least(row)) / temperature).exp(),
            _ => slack,
        };
        weight
    });
    super::update::sinkhorn(&mut m, 1, 0.0);
    m
}
