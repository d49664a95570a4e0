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
    /// The input points in the order of their coordinates.
    order: Vec<usize>,
}

impl<const D: usize> Default for Centres<D> {
    fn default() -> Self {
        Self {
            frame: Frame {
                centre: [0.0; D],
                scale: 1.0,
            },
            axes: [const { Vec::new() }; D],
            low: [const { Vec::new() }; D],
            first: Vec::new(),
            centre_of: Vec::new(),
            grain: 0.0,
            inputs: 0,
            order: Vec::new(),
        }
    }
}

impl<const D: usize> Centres<D> {
    /// Takes over points, reusing memory where it suffices.
    pub(crate) fn take<T: Scalar>(
        &mut self,
        points: &[Point<T, D>],
        rescale: bool,
    ) -> Result<(), TpsError> {
        if points.is_empty() {
            return Err(TpsError::Empty("source points"));
        }
        finite(points, "source points")?;
        self.frame = Frame::around(points, rescale);
        self.merge(points);
        let (centre, scale) = (self.frame.centre, self.frame.scale);
        for (k, (axis, low)) in self.axes.iter_mut().zip(&mut self.low).enumerate() {
            axis.clear();
            low.clear();
            for &i in &self.first {
                let exact = two_sum(points[i][k].widen(), -centre[k]);
                axis.push(exact.high / scale);
                low.push(exact.low / scale);
            }
        }
        let largest = points
            .iter()
            .flat_map(|p| p.iter())
            .fold(0.0, |m, x| f64::max(m, x.widen().abs()));
        self.grain = largest / scale * T::UNIT_ROUNDOFF;
        self.inputs = points.len();
        Ok(())
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

    /// Finds the first point of every group of equal ones, and the group of each point.
    fn merge<T: Scalar>(&mut self, points: &[Point<T, D>]) {
        let Self {
            first,
            centre_of,
            order,
            ..
        } = self;
        for list in [&mut *first, &mut *order] {
            list.clear();
            list.extend(0..points.len());
        }
        centre_of.clear();
        let compare = |&i: &usize, &j: &usize| {
            let differ = (0..D).map(|k| points[i][k].widen().partial_cmp(&points[j][k].widen()));
            differ.flatten().find(|o| o.is_ne()).unwrap_or(i.cmp(&j))
        };
        order.sort_unstable_by(compare);
        if order.windows(2).all(|w| points[w[0]] != points[w[1]]) {
            return;
        }
        // The first point of every point's group, then the group's number.
        centre_of.extend(0..points.len());
        for pair in order.windows(2) {
            if points[pair[0]] == points[pair[1]] {
                centre_of[pair[1]] = centre_of[pair[0]];
            }
        }
        first.retain(|&i| centre_of[i] == i);
        for leader in centre_of {
            *leader = first.partition_point(|&i| i < *leader);
        }
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
