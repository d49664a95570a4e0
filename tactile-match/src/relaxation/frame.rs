//! Units of the work: positions relative to the model's centroid, divided by its root mean square radius.

use nalgebra::Point;
use tactile_tps::Scalar;

/// Centroid and root mean square radius of the model; every length inside the matcher is in that radius.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame<const D: usize> {
    pub(crate) centre: [f64; D],
    pub(crate) scale: f64,
}

impl<const D: usize> Default for Frame<D> {
    fn default() -> Self {
        Self { centre: [0.0; D], scale: 1.0 }
    }
}

impl<const D: usize> Frame<D> {
    /// The frame of `model`; the radius of `target` stands in for a model without extent, 1 if that has none either.
    pub(crate) fn new<T: Scalar>(model: &[Point<T, D>], target: &[Point<T, D>]) -> Self {
        let (centre, own) = centroid_and_radius(model);
        let scale = [own, centroid_and_radius(target).1].into_iter().find(|&r| r > 0.0).unwrap_or(1.0);
        Self { centre, scale }
    }

    pub(crate) fn inward<T: Scalar>(&self, point: &Point<T, D>) -> [f64; D] {
        std::array::from_fn(|k| (point[k].widen() - self.centre[k]) / self.scale)
    }

    pub(crate) fn outward<T: Scalar>(&self, point: &[f64; D]) -> Point<T, D> {
        Point::from(std::array::from_fn(|k| T::narrow(point[k] * self.scale + self.centre[k])))
    }
}

fn centroid_and_radius<T: Scalar, const D: usize>(points: &[Point<T, D>]) -> ([f64; D], f64) {
    let count = points.len() as f64;
    let mut centre = [0.0; D];
    for point in points {
        (0..D).for_each(|k| centre[k] += point[k].widen() / count);
    }
    let square = |p: &Point<T, D>| (0..D).map(|k| (p[k].widen() - centre[k]).powi(2)).sum::<f64>();
    let radius = (points.iter().map(square).sum::<f64>() / count).sqrt();
    // Below the rounding of the coordinates the radius is noise: such a set is one point.
    let size = centre.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    (centre, if radius > 8.0 * f64::EPSILON * size { radius } else { 0.0 })
}

/// Mean of points already in the frame.
pub(crate) fn mean<const D: usize>(points: &[[f64; D]]) -> [f64; D] {
    let mut centre = [0.0; D];
    for point in points {
        (0..D).for_each(|k| centre[k] += point[k]);
    }
    centre.map(|c| c / points.len() as f64)
}
