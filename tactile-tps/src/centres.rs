//! The distinct source points: duplicates merged, coordinates centred and scaled.

use nalgebra::Point;

use crate::{
    Scalar, TpsError,
    double_double::{DoubleDouble, two_sum},
};

/// The shift and the scale that bring points to unit size: x̂ = (x − centre) / scale, scale a power of two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame<const D: usize> {
    pub(crate) centre: [f64; D],
    pub(crate) scale: f64,
}

impl<const D: usize> Frame<D> {
    /// Centre of the bounding box, and the power of two next to half its longest side (one without `rescale`).
    fn around<T: Scalar>(points: &[Point<T, D>], rescale: bool) -> Self {
        let mut low = [f64::INFINITY; D];
        let mut high = [f64::NEG_INFINITY; D];
        for point in points {
            for k in 0..D {
                low[k] = low[k].min(point[k].widen());
                high[k] = high[k].max(point[k].widen());
            }
        }
        let centre = core::array::from_fn(|k| 0.5 * low[k] + 0.5 * high[k]);
        let half = (0..D)
            .map(|k| 0.5 * high[k] - 0.5 * low[k])
            .fold(0.0, f64::max);
        Self {
            centre,
            scale: if rescale { power_of_two(half) } else { 1.0 },
        }
    }

    #[inline(always)]
    pub(crate) fn inside<T: Scalar>(&self, point: &Point<T, D>) -> [f64; D] {
        core::array::from_fn(|k| (point[k].widen() - self.centre[k]) / self.scale)
    }
}

/// The power of two that brings `x` into [1, 2), one for zero.
fn power_of_two(x: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    let power = f64::from_bits(x.to_bits() & EXPONENT);
    if power > 0.0 && power.is_finite() {
        power
    } else {
        1.0
    }
}

/// Distinct points in their frame, and which input point went where.
#[derive(Clone, Debug)]
pub(crate) struct Centres<const D: usize> {
    pub(crate) frame: Frame<D>,
    /// Coordinates in the frame, axis by axis.
    pub(crate) axes: [Vec<f64>; D],
    /// What rounding took from them.
    low: [Vec<f64>; D],
    /// First input point of every centre, ascending.
    pub(crate) first: Vec<usize>,
    /// Centre of every input point; empty if they are the same.
    pub(crate) centre_of: Vec<usize>,
    /// Rounding of the coordinates, relative to the frame.
    pub(crate) grain: f64,
    inputs: usize,
}

impl<const D: usize> Centres<D> {
    pub(crate) fn new<T: Scalar>(points: &[Point<T, D>], rescale: bool) -> Result<Self, TpsError> {
        if points.is_empty() {
            return Err(TpsError::Empty("source points"));
        }
        finite(points, "source points")?;
        let frame = Frame::around(points, rescale);
        let (first, centre_of) = merge(points);
        let exact = |i: usize, k: usize| two_sum(points[i][k].widen(), -frame.centre[k]);
        let axes = core::array::from_fn(|k| {
            first
                .iter()
                .map(|&i| exact(i, k).high / frame.scale)
                .collect()
        });
        let low = core::array::from_fn(|k| {
            first
                .iter()
                .map(|&i| exact(i, k).low / frame.scale)
                .collect()
        });
        let largest = points
            .iter()
            .flat_map(|p| p.iter())
            .fold(0.0, |m, x| f64::max(m, x.widen().abs()));
        Ok(Self {
            frame,
            axes,
            low,
            first,
            centre_of,
            grain: largest / frame.scale * T::UNIT_ROUNDOFF,
            inputs: points.len(),
        })
    }

    /// Replaces `local` by these centres alone, in the same frame.
    pub(crate) fn select(&self, centres: impl Iterator<Item = usize> + Clone, local: &mut Self) {
        for k in 0..D {
            local.axes[k].clear();
            local.axes[k].extend(centres.clone().map(|i| self.axes[k][i]));
            local.low[k].clear();
            local.low[k].extend(centres.clone().map(|i| self.low[k][i]));
        }
        local.first.clear();
        local.first.extend(centres.map(|i| self.first[i]));
    }

    /// Number of distinct points.
    pub(crate) fn len(&self) -> usize {
        self.first.len()
    }

    /// The exact coordinates of a centre.
    pub(crate) fn precise(&self, centre: usize) -> [DoubleDouble; D] {
        core::array::from_fn(|k| DoubleDouble {
            high: self.axes[k][centre],
            low: self.low[k][centre],
        })
    }

    /// Number of points given.
    pub(crate) fn inputs(&self) -> usize {
        self.inputs
    }

    /// Centre of input point `i`.
    #[inline(always)]
    pub(crate) fn centre(&self, i: usize) -> usize {
        if self.centre_of.is_empty() {
            i
        } else {
            self.centre_of[i]
        }
    }
}

/// Names the first point with a coordinate that is not finite.
pub(crate) fn finite<T: Scalar, const D: usize>(
    points: &[Point<T, D>],
    input: &'static str,
) -> Result<(), TpsError> {
    match points
        .iter()
        .position(|p| p.iter().any(|x| !x.widen().is_finite()))
    {
        Some(index) => Err(TpsError::NotFinite { input, index }),
        None => Ok(()),
    }
}

/// First point of every group of equal ones, and the group of each point (empty if all differ).
fn merge<T: Scalar, const D: usize>(points: &[Point<T, D>]) -> (Vec<usize>, Vec<usize>) {
    let mut order: Vec<usize> = (0..points.len()).collect();
    let compare = |&i: &usize, &j: &usize| {
        let differ = (0..D).map(|k| points[i][k].widen().partial_cmp(&points[j][k].widen()));
        differ.flatten().find(|o| o.is_ne()).unwrap_or(i.cmp(&j))
    };
    order.sort_unstable_by(compare);
    if order.windows(2).all(|w| points[w[0]] != points[w[1]]) {
        return ((0..points.len()).collect(), Vec::new());
    }
    let mut leader: Vec<usize> = (0..points.len()).collect();
    for pair in order.windows(2) {
        if points[pair[0]] == points[pair[1]] {
            leader[pair[1]] = leader[pair[0]];
        }
    }
    let first: Vec<usize> = (0..points.len()).filter(|&i| leader[i] == i).collect();
    let mut centre_of = vec![0; points.len()];
    for (centre, &i) in first.iter().enumerate() {
        centre_of[i] = centre;
    }
    for i in 0..points.len() {
        centre_of[i] = centre_of[leader[i]];
    }
    (first, centre_of)
}
