//! A smoothing spline through matched points that a few wrong or badly placed ones do not bend.
//!
//! Everything is evaluated by predictions of points that were held out: a point that sits on the border of the set pulls
//! a spline towards itself and has a small residual whatever its error. The smoothing is the largest whose held-out
//! loss (Tukey's, bounded) is within one standard error of the least; the same predictions give every point its weight.

use nalgebra::{Matrix3, Point};
use tactile_imaging::tps::{FitOptions, Smoothing, ThinPlateSpline, TpsError};

/// Parts into which the points are divided; each is predicted from the others. A few points can afford many parts, which
/// make the jackknife's error surer.
fn parts(points: usize) -> usize {
    if points < 300 { 32 } else { 12 }
}

/// Held-out distances beyond this many noise standard deviations count nothing, in 1, 2 and 3 dimensions:
/// χ quantiles of 0.9999.
const CUTOFF: [f64; 4] = [0.0, 3.9, 4.3, 4.6];

/// Smoothing parameters tried, in units of the squared radius of the points; the last is affine.
const LAMBDAS: [f64; 9] = [1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e8];

/// Pairs the smoothing is chosen on; the noise-to-signal ratio λ does not depend on their number.
const CHOICE_PAIRS: usize = 700;

/// Noise that is rounding, over the radius of the points: of sets without any, what differs from what is predicted by so little is not misplaced.
const ROUNDING: f64 = 1e-12;

pub struct RobustSpline<const D: usize> {
    pub spline: ThinPlateSpline<f64, D>,
    /// Splines without one part each, for the jackknife.
    pub folds: Vec<ThinPlateSpline<f64, D>>,
    /// By how much a frozen-weight error must grow, because the weights follow the data too.
    pub response: f64,
    /// Weight of every pair, 0 to 1.
    pub weights: Vec<f64>,
    /// Standard deviation of one coordinate's noise, from the held-out residuals.
    pub sigma: f64,
    /// λ over the squared radius of the points; 10⁸ is affine.
    pub relative_lambda: f64,
}

type Points<'a, const D: usize> = &'a [Point<f64, D>];

/// Fits sources to targets.
pub fn fit<const D: usize>(
    sources: Points<'_, D>,
    targets: Points<'_, D>,
) -> Result<RobustSpline<D>, TpsError> {
    let square = squared_radius(sources);
    let relative_lambda = choose(sources, targets, square)?;
    let lambda = relative_lambda * square;
    let mut weights = vec![1.0; sources.len()];
    let (mut folds, mut sigma, mut response) = (Vec::new(), 0.0, 1.0);
    for _ in 0..3 {
        let held_out = hold_out(sources, targets, &weights, lambda)?;
        sigma = noise::<D>(&held_out.distances).max(ROUNDING * square.sqrt());
        let scaled: Vec<f64> = held_out
            .distances
            .iter()
            .map(|d| d / (sigma * CUTOFF[D]))
            .collect();
        weights = scaled.iter().map(|&u| biweight(u)).collect();
        response = weights.iter().sum::<f64>()
            / scaled.iter().map(|&u| biweight_slope::<D>(u)).sum::<f64>();
        folds = held_out.splines;
    }
    Ok(RobustSpline {
        spline: weighted(sources, targets, &weights, lambda)?,
        folds,
        response,
        weights,
        sigma,
        relative_lambda,
    })
}

impl<const D: usize> RobustSpline<D> {
    /// H = ∇f − I at every point, in three dimensions.
    pub fn gradients(spline: &ThinPlateSpline<f64, D>, points: Points<'_, D>) -> Vec<Matrix3<f64>> {
        points
            .iter()
            .map(|p| {
                let mut h = spline.jacobian(p).fixed_resize::<3, 3>(0.0);
                (0..D).for_each(|i| h[(i, i)] -= 1.0);
                h
            })
            .collect()
    }
}

struct HeldOut<const D: usize> {
    distances: Vec<f64>,
    splines: Vec<ThinPlateSpline<f64, D>>,
}

/// The largest λ whose loss is not worse than the least by more than one standard error of the difference.
fn choose<const D: usize>(
    sources: Points<'_, D>,
    targets: Points<'_, D>,
    square: f64,
) -> Result<f64, TpsError> {
    let step = sources.len().div_ceil(CHOICE_PAIRS);
    let pick = |p: Points<'_, D>| {
        p.iter()
            .skip(step / 2)
            .step_by(step)
            .copied()
            .collect::<Vec<_>>()
    };
    let (sources, targets) = (pick(sources), pick(targets));
    let ones = vec![1.0; sources.len()];
    let mut distances = Vec::new();
    for lambda in LAMBDAS {
        distances.push(hold_out(&sources, &targets, &ones, lambda * square)?.distances);
    }
    let sigma = distances
        .iter()
        .map(|d| noise::<D>(d))
        .fold(f64::INFINITY, f64::min);
    let losses: Vec<Vec<f64>> = distances
        .iter()
        .map(|d| {
            d.iter()
                .map(|d| tukey_loss(d / (sigma * CUTOFF[D])))
                .collect()
        })
        .collect();
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let best = (0..LAMBDAS.len())
        .min_by(|&i, &j| mean(&losses[i]).total_cmp(&mean(&losses[j])))
        .unwrap_or(0);
    let as_good = |&k: &usize| {
        let gaps: Vec<f64> = losses[k]
            .iter()
            .zip(&losses[best])
            .map(|(a, b)| a - b)
            .collect();
        let centre = mean(&gaps);
        let spread = mean(
            &gaps
                .iter()
                .map(|g| (g - centre).powi(2))
                .collect::<Vec<_>>(),
        )
        .sqrt();
        centre <= spread / (gaps.len() as f64).sqrt()
    };
    Ok(LAMBDAS[(best..LAMBDAS.len()).rev().find(as_good).unwrap_or(best)])
}

/// Predicts every point from a spline of the other parts.
fn hold_out<const D: usize>(
    sources: Points<'_, D>,
    targets: Points<'_, D>,
    weights: &[f64],
    lambda: f64,
) -> Result<HeldOut<D>, TpsError> {
    let mut distances = vec![0.0; sources.len()];
    let mut splines = Vec::new();
    let parts = parts(sources.len());
    for part in 0..parts {
        let without: Vec<f64> = weights
            .iter()
            .enumerate()
            .map(|(i, &w)| if fold(i, parts) == part { 0.0 } else { w })
            .collect();
        let spline = weighted(sources, targets, &without, lambda)?;
        for i in (0..sources.len()).filter(|&i| fold(i, parts) == part) {
            distances[i] = (spline.apply(&sources[i]) - targets[i]).norm();
        }
        splines.push(spline);
    }
    Ok(HeldOut { distances, splines })
}

/// The part a point belongs to, scrambled so that parts do not follow the order of the file.
fn fold(i: usize, parts: usize) -> usize {
    ((i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as usize % parts
}

fn weighted<const D: usize>(
    sources: Points<'_, D>,
    targets: Points<'_, D>,
    weights: &[f64],
    lambda: f64,
) -> Result<ThinPlateSpline<f64, D>, TpsError> {
    let kept: Vec<usize> = (0..sources.len()).filter(|&i| weights[i] > 1e-3).collect();
    let pick = |p: Points<'_, D>| kept.iter().map(|&i| p[i]).collect::<Vec<_>>();
    let options = FitOptions::default()
        .with_smoothing(Smoothing::Lambda(lambda))?
        .with_weights(kept.iter().map(|&i| weights[i]).collect())?;
    ThinPlateSpline::fit(&pick(sources), &pick(targets), &options)
}

fn squared_radius<const D: usize>(points: Points<'_, D>) -> f64 {
    let n = points.len() as f64;
    let centre = points
        .iter()
        .fold(nalgebra::SVector::<f64, D>::zeros(), |c, p| {
            c + p.coords / n
        });
    points
        .iter()
        .map(|p| (p.coords - centre).norm_squared())
        .sum::<f64>()
        / n
}

/// Standard deviation of one coordinate from the median distance: the medians of χ with 1, 2, 3 degrees.
fn noise<const D: usize>(distances: &[f64]) -> f64 {
    let mut sorted = distances.to_vec();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    (median / [1.0, 0.674_5, 1.177_4, 1.538_2][D]).max(f64::MIN_POSITIVE)
}

fn biweight(u: f64) -> f64 {
    if u < 1.0 { (1.0 - u * u).powi(2) } else { 0.0 }
}

/// How the pull w(u)u of a point follows its own residual, averaged over directions: w + u w'/D.
///
/// An M-estimator's error is that of its pulls over the mean of this, not over the mean weight (Huber 1981, 7.6): on clean data
/// in the plane the ratio of the two is 1.26.
fn biweight_slope<const D: usize>(u: f64) -> f64 {
    if u < 1.0 {
        (1.0 - u * u).powi(2) - 4.0 / D as f64 * u * u * (1.0 - u * u)
    } else {
        0.0
    }
}

fn tukey_loss(u: f64) -> f64 {
    1.0 - if u < 1.0 { (1.0 - u * u).powi(3) } else { 0.0 }
}
