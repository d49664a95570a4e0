//! First probabilities: how alike the surroundings of two points are, by shape contexts written out plainly.
//!
//! The shape context of a point is the histogram of the relative positions of all others, log-polar in the plane (5 radii × 12
//! angles) and log-spherical in space (5 radii × 12 azimuths × 6 equal steps of the sine of the elevation). Radii run from an eighth of
//! the set's mean pairwise distance to its double; nearer points count with the first, farther ones not at all. [Belongie, Malik &
//! Puzicha, IEEE PAMI 24, 509–522, 2002; the first probabilities after Zheng & Doermann, IEEE PAMI 28, 643–649, 2006].

use super::MatchMatrix;
use nalgebra::{Point, RealField, SVector};

const RADII: usize = 5;
const ANGLES: usize = 12;
const ELEVATIONS: usize = 6;
const INNER: f64 = 0.125;
const OUTER: f64 = 2.0;

/// A histogram of sum one (or empty) for every point; `O(n²)`.
fn histograms<T: RealField + Copy, const D: usize>(points: &[Point<T, D>]) -> Vec<Vec<f64>> {
    let distances = || points.iter().flat_map(|p| points.iter().map(move |q| (q - p).norm()));
    let pairs = points.len() * points.len().saturating_sub(1);
    let sum = distances().fold(T::zero(), |sum, d| sum + d);
    let mean = sum / nalgebra::convert(pairs.max(1) as f64);
    let bins = RADII * ANGLES * if D == 2 { 1 } else { ELEVATIONS };
    points
        .iter()
        .map(|p| {
            let mut histogram = vec![0.0; bins];
            for q in points {
                if let Some(bin) = bin(&((q - p) / mean)) {
                    histogram[bin] += 1.0;
                }
            }
            let count: f64 = histogram.iter().sum();
            histogram.iter_mut().for_each(|h| *h /= count.max(1.0));
            histogram
        })
        .collect()
}

/// The bin of a relative position in units of the mean distance; none for the point itself and those too far.
fn bin<T: RealField + Copy, const D: usize>(step: &SVector<T, D>) -> Option<usize> {
    let step = step.map(|c| nalgebra::convert_unchecked::<T, f64>(c));
    let radius = step.norm();
    if !(radius > 0.0 && radius < OUTER) {
        return None;
    }
    let at = |fraction: f64, bins: usize| ((fraction * bins as f64) as usize).min(bins - 1);
    let ring = at((radius / INNER).log2().max(0.0) / (OUTER / INNER).log2(), RADII);
    let angle = step.get(1).copied().unwrap_or(0.0).atan2(step[0]) / std::f64::consts::TAU;
    let sector = at(angle + 0.5, ANGLES);
    let slice = if D == 2 { 0 } else { at(0.5 * (step[D - 1] / radius + 1.0), ELEVATIONS) };
    Some((slice * RADII + ring) * ANGLES + sector)
}

/// `½ Σ (g − h)² / (g + h)`, from nought (alike) to one.
fn chi_squared(g: &[f64], h: &[f64]) -> f64 {
    let term = |(&g, &h): (&f64, &f64)| if g + h > 0.0 { (g - h) * (g - h) / (g + h) } else { 0.0 };
    0.5 * g.iter().zip(h).map(term).sum::<f64>()
}

/// The first match matrix: `exp(−C_ij / temperature)` of the shape-context distances `C`, `slack` relative to the likeliest partner
/// in the slack entries, every row and column scaled to sum one by one division; `O(I J)` times the number of bins.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::dense::first_matches;
/// let points = [[0.0, 0.0], [1.0, 0.1], [2.5, 0.0], [0.3, 2.0]].map(Point2::from);
/// let m = first_matches(&points, &points, 0.1, 0.2);
/// assert!((0..4).all(|i| (0..4).all(|j| m[(i, i)] >= m[(i, j)])));
/// ```
#[must_use]
pub fn first_matches<T: RealField + Copy, const D: usize>(
    model: &[Point<T, D>],
    target: &[Point<T, D>],
    temperature: f64,
    slack: f64,
) -> MatchMatrix<T> {
    let (g, h) = (histograms(model), histograms(target));
    let costs: Vec<Vec<f64>> = g.iter().map(|g| h.iter().map(|h| chi_squared(g, h)).collect()).collect();
    let least = |row: &[f64]| row.iter().copied().fold(f64::INFINITY, f64::min);
    let columns = target.len();
    let mut m = MatchMatrix::from_fn(model.len(), columns, |i, j| {
        let weight = match costs.get(i) {
            Some(row) if j < columns => (-(row[j] - least(row)) / temperature).exp(),
            _ => slack,
        };
        nalgebra::convert(weight)
    });
    super::sinkhorn(&mut m, 1, T::zero());
    m
}
