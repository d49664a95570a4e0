//! A rising curve without a formula: isotonic regression, joined by monotone cubics.

use super::StressCalibration;
use super::curve::{extremes, invert};
use super::least_squares::{Fit, robust_weight};
use super::options::{CalibrationOptions, Robustness};
use super::pair::{CalibrationPair, check_pairs};
use super::report::{self, CalibrationReport, Parameters, Shape};
use super::stop::StopReason;
use crate::error::ForceError;
use crate::estimate::Real;

/// A rising curve through the pairs: least squares among all rising functions (isotonic regression, pool adjacent
/// violators; Barlow et al. 1972), its levels joined by monotone cubics (Fritsch & Carlson 1980).
///
/// The noise is taken from how far each pair lies from the line through its neighbours, so that it does not depend on the curve. The
/// standard error at a pixel value is that of the pairs pooled there.
///
/// ```
/// use tactile_force::{CalibrationPair, MonotoneCalibration, StressCalibration};
/// let pairs: Vec<_> = (0..20).map(|k| k as f64).map(|k| CalibrationPair::loading(k * k, k)).collect();
/// let curve = MonotoneCalibration::fit(&pairs, &Default::default())?;
/// assert!((curve.force_n(100.0) - 10.0).abs() < 1e-12);
/// assert!((curve.force_n(110.0) - 110.0_f64.sqrt()).abs() < 1e-3);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MonotoneCalibration<T> {
    knots: Vec<Knot<T>>,
    range: [T; 2],
    report: CalibrationReport<T>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Knot<T> {
    value: T,
    force: T,
    slope: T,
    error: T,
}

/// Pairs pooled to one level.
#[derive(Clone, Copy, Debug)]
struct Block {
    value: f64,
    force: f64,
    weight: f64,
    count: usize,
}

/// Weight of the origin among the pairs when the curve must pass through it.
const ANCHOR: f64 = 1e12;
const SWEEPS: usize = 50;

impl<T: Real> MonotoneCalibration<T> {
    /// Fits the curve.
    ///
    /// # Errors
    /// Fewer than three pairs, a pair that is not finite, all at one pixel value, or forces that fall where the pixel value
    /// rises throughout, so that nothing but a constant is left.
    pub fn fit(
        pairs: &[CalibrationPair<T>],
        options: &CalibrationOptions,
    ) -> Result<Self, ForceError> {
        check_pairs(pairs, 2)?;
        let points = sorted(pairs);
        let values: Vec<f64> = points.iter().map(|p| p.0).collect();
        let [low, high] = extremes(&values);
        if low == high {
            return Err(ForceError::DegeneratePairs { span: 0.0 });
        }
        let scale = neighbour_noise(&points, options.robustness);
        let (blocks, iterations, stop) = reweighted(&points, scale, options);
        if blocks.len() < 2 {
            return Err(ForceError::NotMonotone {
                from: low,
                to: high,
            });
        }
        let knots = knots(&blocks, scale);
        let curve = |v: f64| evaluate(&knots, v).0;
        let residual =
            |p: &CalibrationPair<T>| p.force_n.as_f64() - curve(p.integrated_pixel_value.as_f64());
        let residuals: Vec<f64> = pairs.iter().map(residual).collect();
        let weights = residuals
            .iter()
            .map(|r| robust_weight(options.robustness, *r, scale))
            .collect();
        let fit = Fit {
            iterations,
            stop,
            ..Fit::without_coefficients(residuals, weights, scale)
        };
        let shape = shape(&points, &knots)?;
        let levels: Vec<_> = blocks.iter().map(|b| (b.force, scale, b.count)).collect();
        let parameters = Parameters::levels(&levels, pairs.len());
        Ok(Self {
            report: report::build(pairs, &fit, parameters, shape),
            knots: knots.iter().map(Knot::cast).collect(),
            range: [T::nearest(low), T::nearest(high)],
        })
    }
}

/// (pixel value, force), in order.
fn sorted<T: Real>(pairs: &[CalibrationPair<T>]) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = pairs
        .iter()
        .map(|p| (p.integrated_pixel_value.as_f64(), p.force_n.as_f64()))
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    points
}

/// Properties of the joined cubics for the report.
fn shape(points: &[(f64, f64)], knots: &[Knot<f64>]) -> Result<Shape, ForceError> {
    let (values, forces): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
    let [low, high] = extremes(&values);
    let curve = |v: f64| evaluate(knots, v).0;
    let grid: Vec<f64> = (0..=256)
        .map(|k| low + (high - low) * f64::from(k) / 256.0)
        .collect();
    Ok(Shape {
        linearity_error: report::linearity_error(&values, &forces, &grid, curve)?,
        sensitivity: (curve(high) - curve(low)) / (high - low),
        monotone: true,
    })
}

/// Pools, with the weights of outliers lowered until they settle; also the number of solves and why they stopped.
fn reweighted(
    points: &[(f64, f64)],
    scale: f64,
    options: &CalibrationOptions,
) -> (Vec<Block>, usize, StopReason) {
    let mut weights = vec![1.0; points.len()];
    let mut blocks = pool(points, &weights, options.through_origin);
    if options.robustness == Robustness::None {
        return (blocks, 1, StopReason::Direct);
    }
    for sweep in 1..=SWEEPS {
        let before = weights.clone();
        for (w, (v, f)) in weights.iter_mut().zip(points) {
            *w = robust_weight(options.robustness, f - level(&blocks, *v), scale);
        }
        blocks = pool(points, &weights, options.through_origin);
        if before
            .iter()
            .zip(&weights)
            .all(|(a, b)| (a - b).abs() < 1e-9)
        {
            return (blocks, sweep + 1, StopReason::Converged);
        }
    }
    (blocks, SWEEPS + 1, StopReason::IterationLimit)
}

/// Standard deviation of one pair from its distance to the line through its neighbours: mean of e²/(1 + a² + b²)
/// (Gasser, Sroka & Jennen-Steinmetz 1986), or the median's equivalent where outliers are expected.
fn neighbour_noise(points: &[(f64, f64)], robustness: Robustness) -> f64 {
    let mut squares: Vec<f64> = points
        .windows(3)
        .map(|w| {
            let span = w[2].0 - w[0].0;
            let b = if span > 0.0 {
                (w[1].0 - w[0].0) / span
            } else {
                0.5
            };
            let a = 1.0 - b;
            (a * w[0].1 + b * w[2].1 - w[1].1).powi(2) / (1.0 + a * a + b * b)
        })
        .collect();
    if robustness == Robustness::None {
        return (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    }
    squares.sort_by(f64::total_cmp);
    1.4826 * squares[squares.len() / 2].sqrt()
}

/// Pool adjacent violators on points sorted by value.
fn pool(points: &[(f64, f64)], weights: &[f64], through_origin: bool) -> Vec<Block> {
    let origin = through_origin.then_some(Block {
        value: 0.0,
        force: 0.0,
        weight: ANCHOR,
        count: 1,
    });
    let mut blocks: Vec<Block> = points
        .iter()
        .zip(weights)
        .filter(|(_, w)| **w > 0.0)
        .map(|(&(value, force), &weight)| Block {
            value,
            force,
            weight,
            count: 1,
        })
        .chain(origin)
        .collect();
    blocks.sort_by(|a, b| a.value.total_cmp(&b.value));
    let mut pooled: Vec<Block> = Vec::with_capacity(blocks.len());
    for mut block in blocks {
        while let Some(last) = pooled
            .last()
            .filter(|l| l.force >= block.force || l.value == block.value)
        {
            let weight = last.weight + block.weight;
            block = Block {
                value: (last.weight * last.value + block.weight * block.value) / weight,
                force: (last.weight * last.force + block.weight * block.force) / weight,
                weight,
                count: last.count + block.count,
            };
            pooled.pop();
        }
        pooled.push(block);
    }
    pooled
}

/// Piecewise linear through the blocks, level beyond them: for the weights only.
fn level(blocks: &[Block], v: f64) -> f64 {
    let after = blocks.partition_point(|b| b.value < v);
    match (after.checked_sub(1).map(|k| blocks[k]), blocks.get(after)) {
        (Some(a), Some(b)) => a.force + (b.force - a.force) * (v - a.value) / (b.value - a.value),
        (Some(a), None) => a.force,
        (None, b) => b.map_or(0.0, |b| b.force),
    }
}

/// Slopes after Fritsch & Carlson, by the harmonic mean of Fritsch & Butland (1984).
fn knots(blocks: &[Block], scale: f64) -> Vec<Knot<f64>> {
    let secant = |k: usize| {
        (blocks[k + 1].force - blocks[k].force) / (blocks[k + 1].value - blocks[k].value)
    };
    let width = |k: usize| blocks[k + 1].value - blocks[k].value;
    let last = blocks.len() - 1;
    let slope = |k: usize| match k {
        0 => end_slope(
            secant(0),
            (last > 1).then(|| (secant(1), width(0), width(1))),
        ),
        k if k == last => end_slope(
            secant(last - 1),
            (last > 1).then(|| (secant(last - 2), width(last - 1), width(last - 2))),
        ),
        k => {
            let (h0, h1) = (width(k - 1), width(k));
            let (w0, w1) = (2.0 * h1 + h0, h1 + 2.0 * h0);
            (w0 + w1) / (w0 / secant(k - 1) + w1 / secant(k))
        }
    };
    let knot = |(k, b): (usize, &Block)| Knot {
        value: b.value,
        force: b.force,
        slope: slope(k),
        error: scale / (b.count as f64).sqrt(),
    };
    blocks.iter().enumerate().map(knot).collect()
}

/// Three-point slope at an end, kept between zero and three secants.
fn end_slope(secant: f64, next: Option<(f64, f64, f64)>) -> f64 {
    let Some((other, h0, h1)) = next else {
        return secant;
    };
    (((2.0 * h0 + h1) * secant - h0 * other) / (h0 + h1)).clamp(0.0, 3.0 * secant)
}

impl Knot<f64> {
    fn cast<T: Real>(&self) -> Knot<T> {
        Knot {
            value: T::nearest(self.value),
            force: T::nearest(self.force),
            slope: T::nearest(self.slope),
            error: T::nearest(self.error),
        }
    }
}

/// Force, slope and standard error; straight on beyond the outer knots.
fn evaluate<T: Real>(knots: &[Knot<T>], v: T) -> (T, T, T) {
    let after = knots.partition_point(|k| k.value < v);
    let straight = |k: &Knot<T>| (k.force + k.slope * (v - k.value), k.slope, k.error);
    match (after.checked_sub(1).map(|k| &knots[k]), knots.get(after)) {
        (Some(a), Some(b)) => hermite(a, b, v),
        (Some(end), None) | (None, Some(end)) => straight(end),
        (None, None) => (T::nan(), T::nan(), T::nan()),
    }
}

fn hermite<T: Real>(a: &Knot<T>, b: &Knot<T>, v: T) -> (T, T, T) {
    let (one, two, three) = (T::one(), T::nearest(2.0), T::nearest(3.0));
    let h = b.value - a.value;
    let t = (v - a.value) / h;
    let s = one - t;
    let rise = b.force - a.force;
    let force =
        a.force + rise * t * t * (three - two * t) + h * t * s * (a.slope * s - b.slope * t);
    let slope = T::nearest(6.0) * t * s * rise / h
        + a.slope * s * (one - three * t)
        + b.slope * t * (three * t - two);
    (force, slope, a.error * s + b.error * t)
}

impl<T: Real> StressCalibration<T> for MonotoneCalibration<T> {
    fn force_n(&self, integrated_pixel_value: T) -> T {
        evaluate(&self.knots, integrated_pixel_value).0
    }

    fn sensitivity_n(&self, integrated_pixel_value: T) -> T {
        evaluate(&self.knots, integrated_pixel_value).1
    }

    fn standard_error_n(&self, integrated_pixel_value: T) -> T {
        evaluate(&self.knots, integrated_pixel_value)
            .2
            .hypot(self.report.branch_error_n())
    }

    fn integrated_pixel_value(&self, force_n: T) -> Option<T> {
        let [low, high] = self.range.map(T::as_f64);
        let curve = |v: f64| self.force_n(T::nearest(v)).as_f64();
        invert(low, high, force_n.as_f64(), curve).map(T::nearest)
    }

    fn range(&self) -> [T; 2] {
        self.range
    }

    fn report(&self) -> &CalibrationReport<T> {
        &self.report
    }
}
