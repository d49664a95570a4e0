//! Two point sets in, strain with its error out: match, spline, strain.

use super::robust_spline::{self, RobustSpline};
use nalgebra::{Matrix3, Point};
use std::error::Error;
use tactile_imaging::elasticity::field::{StrainField, StrainSummary};
use tactile_imaging::elasticity::strain::StrainMeasure;
use tactile_imaging::matching::PointMatcher;

/// Pairs that a spline and its error need.
const FEWEST_PAIRS: usize = 16;

pub struct Strain<const D: usize> {
    /// Matched positions, before and after.
    pub pairs: Vec<[Point<f64, D>; 2]>,
    /// Weight of every pair in the spline.
    pub weights: Vec<f64>,
    /// Strain at every matched point of the first set.
    pub strains: Vec<Matrix3<f64>>,
    pub summary: StrainSummary<f64>,
    /// Standard error of the mean: the jackknife over the spline's parts, and the response of the spline's weights.
    pub standard_error: Matrix3<f64>,
    /// Of the standard error: parts less one.
    pub degrees_of_freedom: usize,
    /// Noise of one coordinate, in the points' unit.
    pub sigma: f64,
    pub relative_lambda: f64,
}

/// Strain of the first set on its way to the second.
pub fn strain_between<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    matcher: &dyn PointMatcher<f64, D>,
    measure: &dyn StrainMeasure<f64>,
) -> Result<Strain<D>, Box<dyn Error>> {
    let matching = matcher.match_points(before, after)?;
    let first: Vec<_> = matching
        .assignment
        .iter()
        .enumerate()
        .filter_map(|(i, j)| j.map(|j| (i, j)))
        .collect();
    if first.len() < FEWEST_PAIRS {
        return Err(format!("only {} points matched, too few for a spline", first.len()).into());
    }
    let rough = fit(before, after, &first)?;
    // Whoever lies where the spline predicts is a partner, whatever the matcher said.
    let pairs = partners(before, after, &rough);
    let robust = fit(before, after, &pairs)?;
    let sources: Vec<_> = pairs.iter().map(|&(i, _)| before[i]).collect();
    let field = StrainField::from_gradients(
        &RobustSpline::gradients(&robust.spline, &sources),
        None,
        measure,
    )?;
    let mut means = Vec::new();
    for fold in &robust.folds {
        means.push(
            StrainField::from_gradients(&RobustSpline::gradients(fold, &sources), None, measure)?
                .summary()
                .mean,
        );
    }
    Ok(Strain {
        pairs: pairs.iter().map(|&(i, j)| [before[i], after[j]]).collect(),
        strains: field.strains().to_vec(),
        summary: field.summary(),
        standard_error: jackknife(&means) * robust.response,
        degrees_of_freedom: means.len() - 1,
        weights: robust.weights,
        sigma: robust.sigma,
        relative_lambda: robust.relative_lambda,
    })
}

fn fit<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    pairs: &[(usize, usize)],
) -> Result<RobustSpline<D>, Box<dyn Error>> {
    let sources: Vec<_> = pairs.iter().map(|&(i, _)| before[i]).collect();
    let targets: Vec<_> = pairs.iter().map(|&(_, j)| after[j]).collect();
    Ok(robust_spline::fit(&sources, &targets)?)
}

/// Mutual nearest neighbours of prediction and target, within a third of the targets' usual spacing.
fn partners<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    rough: &RobustSpline<D>,
) -> Vec<(usize, usize)> {
    let predicted: Vec<_> = before.iter().map(|p| rough.spline.apply(p)).collect();
    let nearest = |p: &Point<f64, D>, set: &[Point<f64, D>], not: usize| {
        let distance = |k: usize| (set[k] - p).norm_squared();
        (0..set.len())
            .filter(|&k| k != not)
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
    };
    let mut spacing: Vec<f64> = (0..after.len())
        .filter_map(|j| nearest(&after[j], after, j).map(|k| (after[k] - after[j]).norm()))
        .collect();
    spacing.sort_by(f64::total_cmp);
    let reach = spacing.get(spacing.len() / 2).map_or(0.0, |s| s / 3.0);
    (0..before.len())
        .filter_map(|i| nearest(&predicted[i], after, usize::MAX).map(|j| (i, j)))
        .filter(|&(i, j)| (after[j] - predicted[i]).norm() <= reach)
        .filter(|&(i, j)| nearest(&after[j], &predicted, usize::MAX) == Some(i))
        .collect()
}

/// √((K − 1)/K Σ(θₖ − θ̄)²) of the means without one part each.
fn jackknife(means: &[Matrix3<f64>]) -> Matrix3<f64> {
    let k = means.len() as f64;
    let centre: Matrix3<f64> = means.iter().sum::<Matrix3<f64>>() / k;
    let squares = means
        .iter()
        .map(|m| (m - centre).component_mul(&(m - centre)))
        .sum::<Matrix3<f64>>();
    squares.map(|s| (s * (k - 1.0) / k).sqrt())
}
