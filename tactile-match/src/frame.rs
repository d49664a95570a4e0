//! A frame to work in: centre and size taken out, so that no parameter depends on the units of the points and no square
//! under- or overflows.

use nalgebra::{Point, SVector};

/// `x ↦ (x − centre) / scale`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame<const D: usize> {
    pub(crate) centre: SVector<f64, D>,
    pub(crate) scale: f64,
}

impl<const D: usize> Default for Frame<D> {
    fn default() -> Self {
        Self {
            centre: SVector::zeros(),
            scale: 1.0,
        }
    }
}

/// The point in double precision.
pub(crate) fn widened<const D: usize>(point: &Point<f64, D>) -> SVector<f64, D> {
    point.coords.map(|c| c)
}

impl<const D: usize> Frame<D> {
    /// Centre and root mean square radius of a set; scale one where all points coincide.
    pub(crate) fn of(points: &[Point<f64, D>]) -> Self {
        let (centre, radius) = centre_and_radius(points);
        Self {
            centre,
            scale: if radius > 0.0 { radius } else { 1.0 },
        }
    }

    /// The model's centre and the largest distance from it along an axis in either set: for sets compared as they lie.
    pub(crate) fn of_both(model: &[Point<f64, D>], target: &[Point<f64, D>]) -> Self {
        let centre = Self::of(model).centre;
        let largest = model
            .iter()
            .chain(target)
            .map(|p| (widened(p) - centre).amax())
            .fold(0.0, f64::max);
        Self {
            centre,
            scale: if largest > 0.0 { largest } else { 1.0 },
        }
    }

    /// A point in this frame.
    pub(crate) fn inside(&self, point: &Point<f64, D>) -> SVector<f64, D> {
        (widened(point) - self.centre) / self.scale
    }

    /// All points in this frame.
    pub(crate) fn enter(&self, points: &[Point<f64, D>], columns: &mut [Vec<f64>; D]) {
        columns.iter_mut().for_each(Vec::clear);
        for point in points {
            columns
                .iter_mut()
                .zip(self.inside(point).iter())
                .for_each(|(column, &c)| column.push(c));
        }
    }

    /// A point of this frame in the units of the caller.
    pub(crate) fn leave(&self, inside: SVector<f64, D>) -> Point<f64, D> {
        Point::from(inside * self.scale + self.centre)
    }
}

/// Centroid of a set and its root mean square radius, zero where all points coincide.
pub(crate) fn centre_and_radius<const D: usize>(
    points: &[Point<f64, D>],
) -> (SVector<f64, D>, f64) {
    let n = points.len() as f64;
    let origin = widened(&points[0]); // sums of differences keep the digits of sets far from the origin
    let centre = origin
        + points
            .iter()
            .map(|p| widened(p) - origin)
            .sum::<SVector<f64, D>>()
            / n;
    // The largest radius taken out first: no square under- or overflows.
    let largest = points
        .iter()
        .map(|p| (widened(p) - centre).amax())
        .fold(0.0, f64::max);
    if !(largest > 0.0 && largest.is_finite()) {
        return (centre, 0.0);
    }
    let squares: f64 = points
        .iter()
        .map(|p| ((widened(p) - centre) / largest).norm_squared())
        .sum();
    (centre, largest * (squares / n).sqrt())
}
