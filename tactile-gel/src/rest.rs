//! The rest level of the face: the level far away, outside the frame.
//!
//! Along the border the face is not at rest. A point force displaces the free face of a half-space
//! by f dA/2πr, with f = 2p/E*. On a bonded layer of thickness h the displacement is f dA g(r/h)/h,
//! which decays sooner and changes its sign. The free face in a frame may not determine the
//! thickness of the gel. The level is therefore the mean over likely thicknesses, and their scatter
//! is part of its error.

use ndarray::Array2;

use crate::contacts::quantile;
use crate::layer::GelLayer;
use crate::plane::{LayerShape, bessel_j0};

/// Thicknesses in units of the frame's longer side, and a half-space.
const THICKNESSES: [f64; 9] = [0.06, 0.09, 0.13, 0.19, 0.28, 0.41, 0.6, 0.9, f64::INFINITY];
/// The tail is tabulated up to this distance in thicknesses, and zero from there.
const REACH: f64 = 8.0;
const STEPS_PER_THICKNESS: usize = 20;
/// Number of positions along both sides of the frame together.
const PLACES: usize = 28;
/// Number of pressure blocks along the longer side.
const SOURCES: usize = 80;
/// Neighbouring rises share part of their error: this number counts as one. This constant, the next
/// two and the last two determine how often the interval of the depth fails
/// (`--example exact_worlds`, "below far").
const SHARED: f64 = 24.0;
/// Fraction of the root mean square rise that no thickness explains.
const FAMILY_ERROR: f64 = 0.08;
/// Weight of the half-space, in thicknesses: it stands for all gels much thicker than the frame is
/// wide.
const HALF_SPACES: f64 = 4.0;
/// Factor between the pressures of a layer and of a half-space, for which the pressure was
/// computed.
const STRENGTHS: [f64; 2] = [0.7, 2.5];
/// Error of the level in pixels: the noise of the slopes accumulates over the frame.
const NOISE_PX: f64 = 0.03;
/// Error of the level as a fraction of the positions' mean distance from it.
const UNEVEN: f64 = 0.3;
/// Error of the level as a fraction of the tail, for effects outside the family of layers.
const SHAPE_ERROR: f64 = 0.15;

/// Number of distance steps along the longer side, and of distances up to the diagonal of the
/// frame.
const STEPS: usize = 1024;
const DISTANCES: usize = 1450;

/// The tails of layers with a Poisson ratio of 0.48: r/h times g(r/h) for each thickness, at
/// distances in steps of the frame's longer side.
pub(crate) struct Tails(Vec<[f64; THICKNESSES.len()]>);

/// ρ g(ρ) of a layer, tabulated.
struct LayerTail(Vec<f64>);

impl Tails {
    pub(crate) fn new() -> Self {
        let tail = LayerTail::new();
        let at = |k: usize| THICKNESSES.map(|h| tail.at(k as f64 / STEPS as f64 / h));
        Self((0..=DISTANCES).map(at).collect())
    }

    /// Adds `strength` times the tails at a distance, in units of the longer side.
    fn add(&self, distance: f64, strength: f64, tails: &mut [f64; THICKNESSES.len()]) {
        let at = distance * STEPS as f64;
        let low = (at as usize).min(DISTANCES - 1);
        let (far, [a, b]) = (at - low as f64, [&self.0[low], &self.0[low + 1]]);
        for ((tail, a), b) in tails.iter_mut().zip(a).zip(b) {
            *tail += strength * (a + far * (b - a));
        }
    }
}

impl LayerTail {
    fn new() -> Self {
        let layer = LayerShape {
            thickness: 1.0,
            poisson_ratio: GelLayer::DEFAULT_POISSON_RATIO,
        };
        // 2πg = ∫ L(s) J₀(sρ) ds. The part L = 1 gives 1/ρ, and L − 1 decays as e^(−2s).
        let (last, steps) = (12.0, 480_usize);
        let step = last / steps as f64;
        let less: Vec<f64> = (0..=steps)
            .map(|i| layer.yields(i as f64 * step) - 1.0)
            .collect();
        let at = |k: usize| {
            let rho = k as f64 / STEPS_PER_THICKNESS as f64;
            let sum: f64 = less
                .iter()
                .enumerate()
                .map(|(i, less)| {
                    // Simpson's rule.
                    let weight = match i {
                        0 => 1.0,
                        i if i == steps => 1.0,
                        i if i.is_multiple_of(2) => 2.0,
                        _ => 4.0,
                    };
                    weight * less * bessel_j0(i as f64 * step * rho)
                })
                .sum();
            (1.0 + rho * sum * step / 3.0) / core::f64::consts::TAU
        };
        Self((0..=STEPS_PER_THICKNESS * REACH as usize).map(at).collect())
    }

    /// r/h times g(r/h).
    fn at(&self, thicknesses: f64) -> f64 {
        let at = thicknesses * STEPS_PER_THICKNESS as f64;
        let low = at as usize;
        match self.0.get(low..low + 2) {
            Some([a, b]) => a + (at - low as f64) * (b - a),
            _ => 0.0,
        }
    }
}

/// The level of the face far away with its standard error, in metres.
pub(crate) fn rest(
    tails: &Tails,
    depth: &Array2<f64>,
    labels: &Array2<u16>,
    pressure: &Array2<f32>,
    size: f64,
) -> (f64, f64) {
    let (rows, columns) = depth.dim();
    let sources = sources(labels, pressure);
    let step = ((rows + columns) / PLACES).max(1);
    let near = 2.0 * rows.max(columns) as f64 / SOURCES as f64;
    let longer = rows.max(columns) as f64;
    let place = |(r, c): (usize, usize)| {
        let (row, column) = (r * step, c * step);
        if labels[[row, column]] > 0 {
            return None;
        }
        let mut tail = [0.0; THICKNESSES.len()];
        for [f, x, y] in &sources {
            let r = ((column as f64 - x).powi(2) + (row as f64 - y).powi(2)).sqrt();
            if r < near {
                return None;
            }
            tails.add(r / longer, size * f / r, &mut tail);
        }
        Some(Place {
            depth: depth[[row, column]],
            tail,
        })
    };
    let grid = Array2::from_shape_fn((rows.div_ceil(step), columns.div_ceil(step)), place);
    let places: Vec<&Place> = grid.iter().flatten().collect();
    if places.is_empty() {
        return (depth.iter().sum::<f64>() / depth.len() as f64, 0.0);
    }
    // Rises between neighbouring positions hardly contain the noise that accumulates over the
    // frame.
    let beside = |(r, c): (usize, usize)| [grid.get((r, c + 1)), grid.get((r + 1, c))];
    let rises = grid.indexed_iter().flat_map(|(at, here)| {
        let pairs = beside(at)
            .into_iter()
            .flatten()
            .map(move |there| (here, there));
        pairs.filter_map(|(here, there)| Some((here.as_ref()?, there.as_ref()?)))
    });
    let rises: Vec<(&Place, &Place)> = rises.collect();
    let fits =
        core::array::from_fn::<Level, { THICKNESSES.len() }, _>(|k| Level::of(k, &places, &rises));
    let least = fits
        .iter()
        .map(|fit| fit.left)
        .fold(f64::INFINITY, f64::min);
    let all: f64 = rises.iter().map(|(a, b)| (b.depth - a.depth).powi(2)).sum();
    let count = (rises.len() as f64 / SHARED).max(1.0);
    // Likelihoods with the variance estimated from the best fit.
    let variance = least + FAMILY_ERROR * FAMILY_ERROR * all + f64::MIN_POSITIVE;
    let weight = |k: usize| {
        let prior = if THICKNESSES[k].is_finite() {
            1.0
        } else {
            HALF_SPACES
        };
        prior * (-0.5 * count * (fits[k].left - least) / variance).exp()
    };
    let total: f64 = (0..fits.len()).map(weight).sum();
    let mean = |value: &dyn Fn(&Level) -> f64| {
        let each = fits.iter().enumerate();
        each.map(|(k, fit)| weight(k) * value(fit)).sum::<f64>() / total
    };
    let rest = mean(&|fit| fit.level);
    let scatter = mean(&|fit| (fit.level - rest).powi(2)).sqrt();
    let tail = mean(&|fit| fit.tail.abs());
    let noise = (NOISE_PX * size).hypot(UNEVEN * mean(&|fit| fit.spread));
    (rest, scatter.hypot(SHAPE_ERROR * tail).hypot(noise))
}

/// A position on the free face: its depth, and the tail of each thickness there.
struct Place {
    depth: f64,
    tail: [f64; THICKNESSES.len()],
}

/// Pressure of the contacts in blocks: f dA in square pixels, with column and row.
fn sources(labels: &Array2<u16>, pressure: &Array2<f32>) -> Vec<[f64; 3]> {
    let mut sources = Vec::new();
    let (rows, columns) = pressure.dim();
    let block = (2 * rows.max(columns)).div_ceil(SOURCES).div_ceil(2).max(1);
    for top in (0..rows).step_by(block) {
        for left in (0..columns).step_by(block) {
            let mut sums = [0.0; 3];
            for r in top..(top + block).min(rows) {
                for c in left..(left + block).min(columns) {
                    if labels[[2 * r, 2 * c]] > 0 {
                        let f = f64::from(pressure[[r, c]].max(0.0));
                        let more = [f, f * 2.0 * c as f64, f * 2.0 * r as f64];
                        sums.iter_mut().zip(more).for_each(|(s, v)| *s += v);
                    }
                }
            }
            if sums[0] > 0.0 {
                sources.push([4.0 * sums[0], sums[1] / sums[0], sums[2] / sums[0]]);
            }
        }
    }
    sources
}

/// A fitted level with the tail of one thickness.
struct Level {
    level: f64,
    /// Residual sum of squares of the rises.
    left: f64,
    /// Means over the positions of the tail and of the distance from the level.
    tail: f64,
    spread: f64,
}

impl Level {
    fn of(k: usize, places: &[&Place], rises: &[(&Place, &Place)]) -> Self {
        let rise = |(a, b): &(&Place, &Place)| [b.tail[k] - a.tail[k], b.depth - a.depth];
        let sums = rises
            .iter()
            .map(rise)
            .fold([0.0; 2], |[tt, tz], [t, z]| [tt + t * t, tz + t * z]);
        let strength = match sums[0] > 0.0 {
            true => (sums[1] / sums[0]).clamp(STRENGTHS[0], STRENGTHS[1]),
            false => 1.0,
        };
        let left = rises.iter().map(rise);
        let left = left.map(|[t, z]| (z - strength * t).powi(2)).sum();
        let n = places.len() as f64;
        let mut levels: Vec<f32> = places
            .iter()
            .map(|place| (place.depth - strength * place.tail[k]) as f32)
            .collect();
        // Unlike a mean, the median is not affected by an undetected contact.
        let level = f64::from(quantile(&mut levels, 0.5));
        let spread = levels.iter().map(|z| (f64::from(*z) - level).abs());
        Self {
            level,
            left,
            tail: strength * places.iter().map(|place| place.tail[k]).sum::<f64>() / n,
            spread: spread.sum::<f64>() / n,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At a small distance a layer acts as a half-space. The longest wave gives its mean
    /// displacement: 4(κ − 1)/(1 + κ)² thicknesses.
    #[test]
    fn tails_of_layers_begin_as_those_of_half_spaces() {
        let tails = LayerTail::new();
        assert!((tails.at(0.0) - 1.0 / core::f64::consts::TAU).abs() < 1e-12);
        let step = 1.0 / STEPS_PER_THICKNESS as f64;
        let rings = (0..tails.0.len()).map(|k| tails.at(k as f64 * step));
        let mean = core::f64::consts::TAU * step * (rings.sum::<f64>() - 0.5 * tails.at(0.0));
        let kappa = 3.0 - 4.0 * GelLayer::DEFAULT_POISSON_RATIO;
        let expected = 4.0 * (kappa - 1.0) / (1.0 + kappa).powi(2);
        assert!((mean - expected).abs() < 0.01, "{mean} {expected}");
    }
}
