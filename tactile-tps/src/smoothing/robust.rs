//! Smoothing and weights that a few wrong or badly placed pairs do not bend.

use nalgebra::{Point, SMatrix, SVector};

use crate::{
    Factorization, FitOptions, Smoothing, SplineWorkspace, ThinPlateSpline, TpsError, Warp,
    WarpModel, error::validate_pairs,
};

/// λ that are tried, in units of the squared radius of the points. The last one is affine.
const LAMBDAS: [f64; 9] = [1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e8];

/// The model of a smoothing spline (kernel r² ln r) that wrong pairs do not bend: [`RobustFit`] as
/// a [`WarpModel`].
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{RobustSpline, Warp, WarpModel};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<Point2<f64>> =
///     (0..64).map(|i| Point2::new(f64::from(i % 8), f64::from(i / 8))).collect();
/// let mut targets: Vec<_> = sources.iter().map(|p| Point2::new(1.1 * p.x, p.y)).collect();
/// targets[20].y += 5.0; // a wrong match
/// let warp = RobustSpline.fit(&sources, &targets, None)?;
/// assert!((warp.apply(&sources[20]).y - sources[20].y).abs() < 1e-6);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RobustSpline;

impl<const D: usize> WarpModel<D> for RobustSpline {
    fn fit(
        &self,
        sources: &[Point<f64, D>],
        targets: &[Point<f64, D>],
        weights: Option<&[f64]>,
    ) -> Result<Box<dyn Warp<D> + Send + Sync>, TpsError> {
        Ok(Box::new(RobustFit::new(sources, targets, weights)?))
    }
}

/// A smoothing spline through matched points, its weights, and what its error is estimated from.
///
/// Every residual is that of a point that was held out of the fit.
/// The reason: a point on the border of the set pulls a spline towards itself and has a small own
/// residual whatever its error.
/// λ is the largest whose held-out loss (Tukey's, bounded) is within one standard error of the
/// least.
/// The same predictions give every pair its weight (Tukey's biweight).
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::RobustFit;
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<Point2<f64>> =
///     (0..64).map(|i| Point2::new(f64::from(i % 8), f64::from(i / 8))).collect();
/// let noise = |i: usize| 0.01 * ((i * 7919 % 101) as f64 / 50.0 - 1.0);
/// let mut targets: Vec<_> =
///     sources.iter().enumerate().map(|(i, p)| Point2::new(1.1 * p.x + noise(i), p.y)).collect();
/// targets[20].y += 5.0; // a wrong match
/// let fit = RobustFit::new(&sources, &targets, None)?;
/// assert!(fit.weights[20] == 0.0 && fit.weights[21] > 0.5);
/// assert!(fit.sigma < 0.02);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RobustFit<const D: usize> {
    /// The spline through all pairs with their weights.
    pub spline: ThinPlateSpline<D>,
    /// Splines without one part of the pairs each, for the jackknife.
    pub folds: Vec<ThinPlateSpline<D>>,
    /// Factor from an error computed with fixed weights to that with weights that follow the data.
    pub response: f64,
    /// Weight of every pair, 0 to 1.
    pub weights: Vec<f64>,
    /// Standard deviation of one coordinate's noise, from the held-out residuals.
    pub sigma: f64,
    /// λ over the squared radius of the points. At 10⁸ the spline is affine.
    pub relative_lambda: f64,
}

impl<const D: usize> RobustFit<D> {
    /// Fits `sources` to `targets`. Prior weights, where given, multiply those that are found.
    ///
    /// With n points below 300 every spline is fitted to 31/32 of them, 32 times for each of nine
    /// λ.
    /// From 300 on there are 12 parts, and λ is chosen on at most 700 points. O(n³) time.
    ///
    /// # Errors
    /// [`TpsError`] for no points, lengths that differ, numbers that are not finite, weights that
    /// are negative.
    pub fn new(
        sources: &[Point<f64, D>],
        targets: &[Point<f64, D>],
        weights: Option<&[f64]>,
    ) -> Result<Self, TpsError> {
        validate_pairs(sources, targets, weights)?;
        let prior = weights.map_or_else(|| vec![1.0; sources.len()], <[f64]>::to_vec);
        let square = squared_radius(sources);
        let relative_lambda = one_standard_error_lambda(sources, targets, &prior, square)?;
        let lambda = relative_lambda * square;
        // Noise below this is rounding: pairs that miss their prediction by so little are not
        // misplaced.
        let rounding = 1e-12 * square.sqrt();
        let mut weights = vec![1.0; sources.len()];
        // All pairs count fully at first. The held-out residuals of a wrong pair are large all the
        // same.
        let (mut folds, mut sigma, mut response) = (Vec::new(), 0.0, 1.0);
        // Weights and scale determine each other. λ stays fixed meanwhile.
        for _ in 0..3 {
            let product: Vec<f64> = weights.iter().zip(&prior).map(|(w, p)| w * p).collect();
            let held_out = hold_out(sources, targets, &product, lambda, true)?;
            // From the median of the distances, which stays bounded while less than half of the
            // pairs are wrong.
            sigma = noise::<D>(&held_out.distances).max(rounding);
            let scaled: Vec<f64> = (held_out.distances.iter())
                .map(|d| d / (sigma * cutoff::<D>()))
                .collect();
            weights = scaled.iter().map(|&u| biweight(u)).collect();
            response = weights.iter().sum::<f64>()
                / scaled.iter().map(|&u| biweight_slope::<D>(u)).sum::<f64>();
            folds = held_out.splines;
        }
        let product: Vec<f64> = weights.iter().zip(&prior).map(|(w, p)| w * p).collect();
        Ok(Self {
            spline: weighted(sources, targets, &product, lambda)?,
            folds,
            response,
            weights,
            sigma,
            relative_lambda,
        })
    }
}

impl<const D: usize> Warp<D> for RobustFit<D> {
    fn apply(&self, point: &Point<f64, D>) -> Point<f64, D> {
        self.spline.apply(point)
    }
    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D> {
        self.spline.jacobian(point)
    }
}

struct HeldOut<const D: usize> {
    distances: Vec<f64>,
    splines: Vec<ThinPlateSpline<D>>,
}

/// The largest λ whose loss exceeds the least by no more than one standard error of the difference.
fn one_standard_error_lambda<const D: usize>(
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
    prior: &[f64],
    square: f64,
) -> Result<f64, TpsError> {
    // λ is a ratio of noise to signal: it does not depend on the number of pairs.
    let step = sources.len().div_ceil(700);
    let (sources, targets) = (thinned(sources, step), thinned(targets, step));
    let prior = thinned(prior, step);
    let mut distances = Vec::new();
    for lambda in LAMBDAS {
        distances.push(hold_out(&sources, &targets, &prior, lambda * square, false)?.distances);
    }
    // One scale for all λ, so that their losses compare. The least is that of the best prediction.
    let sigma = distances
        .iter()
        .map(|d| noise::<D>(d))
        .fold(f64::INFINITY, f64::min);
    let loss = |d: &f64| tukey_loss(d / (sigma * cutoff::<D>()));
    let losses: Vec<Vec<f64>> = distances
        .iter()
        .map(|distances| distances.iter().map(loss).collect())
        .collect();
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
        let squares: Vec<f64> = gaps.iter().map(|g| (g - centre).powi(2)).collect();
        // The error of the paired difference: what both λ share of a point's noise cancels.
        centre <= mean(&squares).sqrt() / (gaps.len() as f64).sqrt()
    };
    Ok(LAMBDAS[(best..LAMBDAS.len()).rev().find(as_good).unwrap_or(best)])
}

/// Every `step`-th value.
fn thinned<V: Clone>(values: &[V], step: usize) -> Vec<V> {
    values
        .iter()
        // Half a step in, so that neither end of the series is favoured.
        .skip(step / 2)
        .step_by(step)
        .cloned()
        .collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Predicts every point from a spline of the other parts. With `all_splines` those of all parts are
/// kept, else only distances.
fn hold_out<const D: usize>(
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
    weights: &[f64],
    lambda: f64,
    all_splines: bool,
) -> Result<HeldOut<D>, TpsError> {
    // A few points can afford many parts, which make the jackknife's error more certain.
    let parts = if sources.len() < 300 { 32 } else { 12 };
    let kept = Kept::new(sources, targets, weights);
    let mut members = vec![Vec::new(); parts];
    for (row, &i) in kept.rows.iter().enumerate() {
        members[part_of(i, parts)].push(row);
    }
    // One factor for all parts, as long as each can be left out of it.
    // Left out of one inverse, all parts cost as much as one factorisation more, not one each.
    let factorization = Factorization::new(&kept.sources, &kept.options(lambda)?)?;
    let misses = factorization.left_out(&kept.targets, &members);
    let (mut workspace, mut shifted) = (SplineWorkspace::default(), kept.targets.clone());
    let mut held_out = HeldOut {
        distances: vec![0.0; sources.len()],
        splines: Vec::new(),
    };
    if let Some(misses) = &misses {
        for (&i, miss) in kept.rows.iter().zip(misses) {
            held_out.distances[i] = miss.norm();
        }
    }
    for (part, members) in members.iter().enumerate() {
        let own = (0..sources.len()).filter(|&i| part_of(i, parts) == part);
        // Pairs without weight are in no factor. They are predicted by the spline of the other
        // parts.
        let predicted = misses.is_some() && own.clone().all(|i| weights[i] > LEAST_WEIGHT);
        if predicted && !all_splines {
            continue;
        }
        let mut spline = ThinPlateSpline::default();
        if let Some(misses) = &misses {
            // Targets that the spline meets without them do not bend it.
            members.iter().for_each(|&row| shifted[row] -= misses[row]);
            factorization.refit_with(&mut workspace, &shifted, None, None, &mut spline)?;
            members
                .iter()
                .for_each(|&row| shifted[row] = kept.targets[row]);
        } else {
            let without = |i: usize| {
                if part_of(i, parts) == part {
                    0.0
                } else {
                    weights[i]
                }
            };
            let without: Vec<f64> = (0..sources.len()).map(without).collect();
            spline = weighted(sources, targets, &without, lambda)?;
        }
        if !predicted {
            own.for_each(|i| {
                held_out.distances[i] = (spline.apply(&sources[i]) - targets[i]).norm()
            });
        }
        held_out.splines.push(spline);
    }
    Ok(held_out)
}

/// The part of a point, scrambled, so that parts do not follow the order of the points.
fn part_of(i: usize, parts: usize) -> usize {
    ((i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as usize % parts
}

/// Pairs of less weight do not count.
const LEAST_WEIGHT: f64 = 1e-3;

/// The pairs whose weight matters.
struct Kept<const D: usize> {
    rows: Vec<usize>,
    sources: Vec<Point<f64, D>>,
    targets: Vec<Point<f64, D>>,
    weights: Vec<f64>,
}

impl<const D: usize> Kept<D> {
    fn new(sources: &[Point<f64, D>], targets: &[Point<f64, D>], weights: &[f64]) -> Self {
        let rows: Vec<usize> = (0..sources.len())
            .filter(|&i| weights[i] > LEAST_WEIGHT)
            .collect();
        let pick = |p: &[Point<f64, D>]| rows.iter().map(|&i| p[i]).collect();
        let (sources, targets) = (pick(sources), pick(targets));
        let weights = rows.iter().map(|&i| weights[i]).collect();
        Self {
            rows,
            sources,
            targets,
            weights,
        }
    }

    fn options(&self, lambda: f64) -> Result<FitOptions, TpsError> {
        let options = FitOptions::default().with_smoothing(Smoothing::Lambda(lambda))?;
        options.with_weights(self.weights.clone())
    }
}

/// The spline through the pairs whose weight matters.
fn weighted<const D: usize>(
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
    weights: &[f64],
    lambda: f64,
) -> Result<ThinPlateSpline<D>, TpsError> {
    let kept = Kept::new(sources, targets, weights);
    ThinPlateSpline::fit(&kept.sources, &kept.targets, &kept.options(lambda)?)
}

fn squared_radius<const D: usize>(points: &[Point<f64, D>]) -> f64 {
    let n = points.len() as f64;
    let centre = points
        .iter()
        .fold(SVector::<f64, D>::zeros(), |c, p| c + p.coords / n);
    let squares = points.iter().map(|p| (p.coords - centre).norm_squared());
    squares.sum::<f64>() / n
}

/// Held-out distances beyond this many standard deviations have no weight: the 0.9999 quantile of χ
/// with `D` degrees.
fn cutoff<const D: usize>() -> f64 {
    [3.9, 4.3, 4.6][D.clamp(1, 3) - 1]
}

/// Standard deviation of one coordinate, from the median distance and the median of χ with `D`
/// degrees.
fn noise<const D: usize>(distances: &[f64]) -> f64 {
    let mut sorted = distances.to_vec();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    // Medians of χ with one to three degrees. The floor keeps distances over it finite.
    (median / [0.674_5, 1.177_4, 1.538_2][D.clamp(1, 3) - 1]).max(f64::MIN_POSITIVE)
}

fn biweight(u: f64) -> f64 {
    if u < 1.0 { (1.0 - u * u).powi(2) } else { 0.0 }
}

/// Derivative of the pull w(u)u of a point by its own residual, averaged over directions: w + u
/// w'/D.
///
/// An M-estimator's error is that of its pulls over the mean of this, not over the mean weight
/// (Huber 1981, 7.6). On clean data in the plane the ratio of the two is 1.26.
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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;

    /// Points left out of one factor, against splines fitted without them, also where weights
    /// differ and a point counts not at all.
    #[test]
    fn parts_left_out_are_those_of_their_own_fits() {
        let point = |i: usize| Point2::new((i % 9) as f64 + (i as f64).sin(), (i / 9) as f64);
        let sources: Vec<_> = (0..80).map(point).collect();
        let bent = |p: &Point2<f64>| Point2::new(p.x + 0.2 * (p.y + p.x).sin(), 1.1 * p.y);
        let targets: Vec<_> = sources.iter().map(bent).collect();
        let uneven = |i: usize| {
            if i == 7 {
                0.0
            } else {
                1.0 / (1 + i % 4) as f64
            }
        };
        let weights: Vec<f64> = (0..80).map(uneven).collect();
        for lambda in LAMBDAS {
            let found = hold_out(&sources, &targets, &weights, lambda, true).unwrap();
            let kept = Kept::new(&sources, &targets, &weights);
            let factorization =
                Factorization::new(&kept.sources, &kept.options(lambda).unwrap()).unwrap();
            let alone: Vec<_> = (0..kept.rows.len()).map(|row| vec![row]).collect();
            assert!(
                factorization.left_out(&kept.targets, &alone).is_some(),
                "{lambda}"
            );
            for (part, spline) in found.splines.iter().enumerate() {
                let own: Vec<usize> = (0..80).filter(|&i| part_of(i, 32) == part).collect();
                let without = |i: usize| if own.contains(&i) { 0.0 } else { weights[i] };
                let without: Vec<f64> = (0..80).map(without).collect();
                let alone = weighted(&sources, &targets, &without, lambda).unwrap();
                // Rounding of systems whose condition number is 10⁵.
                let place = Point2::new(3.3, 4.4);
                assert!(
                    (spline.apply(&place) - alone.apply(&place)).norm() < 1e-9,
                    "{lambda}"
                );
                for i in own {
                    let miss = (alone.apply(&sources[i]) - targets[i]).norm();
                    assert!((miss - found.distances[i]).abs() < 1e-9, "{lambda} {i}");
                }
            }
        }
    }
}
