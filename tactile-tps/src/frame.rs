//! The internal units of points.

use nalgebra::Point;

use crate::lanes::UNIT_ROUNDOFF;

/// The shift and scale that bring points to unit size: x̂ = (x − centre) / scale, with a power of
/// two as the scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame<const D: usize> {
    pub(crate) centre: [f64; D],
    pub(crate) scale: f64,
}

impl<const D: usize> Default for Frame<D> {
    fn default() -> Self {
        Self {
            centre: [0.0; D],
            scale: 1.0,
        }
    }
}

impl<const D: usize> Frame<D> {
    /// Centre of the bounding box, and the power of two next to half its longest side (one without
    /// `rescale`).
    pub(crate) fn around(points: &[Point<f64, D>], rescale: bool) -> Self {
        let mut low = [f64::INFINITY; D];
        let mut high = [f64::NEG_INFINITY; D];
        for point in points {
            for k in 0..D {
                low[k] = low[k].min(point[k]);
                high[k] = high[k].max(point[k]);
            }
        }
        // Halved before the subtraction, which could overflow.
        let halves = (0..D).map(|k| 0.5 * high[k] - 0.5 * low[k]);
        let half = halves.fold(0.0, f64::max);
        // Only the bits of the exponent: the power of two that brings `half` into [1, 2).
        let power = f64::from_bits(half.to_bits() & 0x7ff0_0000_0000_0000);
        let usable = rescale && power > 0.0 && power.is_finite();
        Self {
            centre: core::array::from_fn(|k| 0.5 * low[k] + 0.5 * high[k]),
            scale: if usable { power } else { 1.0 },
        }
    }

    #[inline(always)]
    pub(crate) fn inside(&self, point: &Point<f64, D>) -> [f64; D] {
        // Division by a power of two is exact.
        core::array::from_fn(|k| (point[k] - self.centre[k]) / self.scale)
    }

    /// Rounding error of the points' coordinates, in the units of the frame.
    pub(crate) fn grain(&self, points: &[Point<f64, D>]) -> f64 {
        let numbers = points.iter().flat_map(|p| p.iter());
        numbers.fold(0.0, |m, x| f64::max(m, x.abs())) / self.scale * UNIT_ROUNDOFF
    }
}
