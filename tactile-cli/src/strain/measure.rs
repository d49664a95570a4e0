//! Two point sets in, strain with its error out: match, spline, strain.

use nalgebra::{Matrix3, Point};
use std::error::Error;
use tactile_imaging::elasticity::field::{StrainField, StrainSummary};
use tactile_imaging::elasticity::strain::StrainMeasure;
use tactile_imaging::matching::PointMatcher;
use tactile_imaging::tps::{RobustFit, ThinPlateSpline};

/// Pairs that a spline and its error need.
const FEWEST_PAIRS: usize = 16;

pub struct Strain<const D: usize> {
    /// Rows of the matched points, before and after.
    pub rows: Vec<(usize, usize)>,
    /// Matched positions, before and after.
    pub pairs: Vec<[Point<f64, D>; 2]>,
    /// Weight of every pair in the spline.
    pub weights: Vec<f64>,
    /// Strain at every matched point of the first set.
    pub strains: Vec<Matrix3<f64>>,
    /// Standard error of the strain at every matched point, as that of the mean.
    pub standard_errors: Vec<Matrix3<f64>>,
    pub summary: StrainSummary,
    /// Standard error of the mean: the jackknife over the spline's parts, and the response of the spline's weights.
    pub standard_error: Matrix3<f64>,
    /// Of the standard error: parts less one.
    pub degrees_of_freedom: usize,
    /// Noise of one coordinate, in the points' unit.
    pub sigma: f64,
    pub relative_lambda: f64,
}

/// Strain of the first set on its way to the second: the match, and [`strain_of`] its pairs.
#[allow(
    dead_code,
    reason = "the program does both steps one by one, the tests at once"
)]
pub fn strain_between<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    matcher: &dyn PointMatcher<D>,
    measure: &dyn StrainMeasure,
) -> Result<Strain<D>, Box<dyn Error>> {
    let matching = matcher.match_points(before, after)?;
    strain_of(before, after, &assigned(&matching.assignment), measure)
}

/// Rows that belong together.
pub fn assigned(assignment: &[Option<usize>]) -> Vec<(usize, usize)> {
    let partner = |(i, j): (usize, &Option<usize>)| j.map(|j| (i, j));
    assignment.iter().enumerate().filter_map(partner).collect()
}

/// Strain from the pairs of a match, whose wrong ones do not count and whose missing ones are found by the spline.
pub fn strain_of<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    matched: &[(usize, usize)],
    measure: &dyn StrainMeasure,
) -> Result<Strain<D>, Box<dyn Error>> {
    if matched.len() < FEWEST_PAIRS {
        let found = matched.len();
        return Err(format!(
            "{found} matched points are too few for a smoothing spline and its error, which need {FEWEST_PAIRS}"
        )
        .into());
    }
    let rough = fit(before, after, matched)?;
    // Whoever lies where the spline predicts is a partner, whatever the matcher said.
    let rows = partners(before, after, &rough);
    if rows.len() < FEWEST_PAIRS {
        return Err("the matched points do not lie on any smooth deformation".into());
    }
    let robust = fit(before, after, &rows)?;
    let sources: Vec<_> = rows.iter().map(|&(i, _)| before[i]).collect();
    let strained = |spline| {
        let gradients = gradients(spline, &sources);
        StrainField::from_gradients(&gradients, None, measure)
    };
    let field = strained(&robust.spline)?;
    let folds = (robust.folds.iter())
        .map(strained)
        .collect::<Result<Vec<_>, _>>()?;
    let means: Vec<_> = folds.iter().map(|fold| fold.summary().mean).collect();
    let errors_at = |k: usize| {
        let without: Vec<_> = folds.iter().map(|fold| fold.strains[k]).collect();
        jackknife(&without) * robust.response
    };
    Ok(Strain {
        pairs: rows.iter().map(|&(i, j)| [before[i], after[j]]).collect(),
        standard_errors: (0..rows.len()).map(errors_at).collect(),
        rows,
        strains: field.strains.to_vec(),
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
) -> Result<RobustFit<D>, Box<dyn Error>> {
    let sources: Vec<_> = pairs.iter().map(|&(i, _)| before[i]).collect();
    let targets: Vec<_> = pairs.iter().map(|&(_, j)| after[j]).collect();
    Ok(RobustFit::new(&sources, &targets, None)?)
}

/// H = ∇f − I at every point, in three dimensions.
fn gradients<const D: usize>(
    spline: &ThinPlateSpline<f64, D>,
    points: &[Point<f64, D>],
) -> Vec<Matrix3<f64>> {
    points
        .iter()
        .map(|p| {
            let mut h = spline.jacobian(p).fixed_resize::<3, 3>(0.0);
            (0..D).for_each(|i| h[(i, i)] -= 1.0);
            h
        })
        .collect()
}

/// Mutual nearest neighbours of prediction and target, within a third of the targets' usual spacing.
fn partners<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    rough: &RobustFit<D>,
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
