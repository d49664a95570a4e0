//! Units of the work: either set relative to its own centroid, divided by the model's root mean square radius.
//!
//! Two origins, so that sets far from each other lose no digits.

use crate::frame::{centre_and_radius, widened};
use nalgebra::{Point, SVector};

/// Beyond this many radii a coordinate is as good as at infinity, and its square is still finite in single precision.
const FARTHEST: f64 = 1e12;

/// The centroids, and the length that is one inside the matcher.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame<const D: usize> {
    model: SVector<f64, D>,
    target: SVector<f64, D>,
    pub(crate) scale: f64,
}

impl<const D: usize> Default for Frame<D> {
    fn default() -> Self {
        Self {
            model: SVector::zeros(),
            target: SVector::zeros(),
            scale: 1.0,
        }
    }
}

impl<const D: usize> Frame<D> {
    /// The frame of two sets; the radius of `target` stands in for a model without extent, 1 if that has none either.
    pub(crate) fn new(model: &[Point<f64, D>], target: &[Point<f64, D>]) -> Self {
        let sets = [model, target].map(centre_and_radius);
        // Below the rounding of the coordinates the radius is noise: such a set is one point.
        let extended = |(centre, radius): &(SVector<f64, D>, f64)| {
            *radius > 8.0 * f64::EPSILON * centre.amax()
        };
        let scale = sets
            .iter()
            .find(|set| extended(set))
            .map_or(1.0, |set| set.1);
        Self {
            model: sets[0].0,
            target: sets[1].0,
            scale,
        }
    }

    /// A model point in the frame.
    pub(crate) fn model(&self, point: &Point<f64, D>) -> [f64; D] {
        self.inward(widened(point) - self.model)
    }

    /// A target point in the frame.
    pub(crate) fn target(&self, point: &Point<f64, D>) -> [f64; D] {
        self.inward(widened(point) - self.target)
    }

    fn inward(&self, offset: SVector<f64, D>) -> [f64; D] {
        std::array::from_fn(|k| (offset[k] / self.scale).clamp(-FARTHEST, FARTHEST))
    }

    /// A warped point, which lies among the targets, in the units of the caller.
    pub(crate) fn outward(&self, point: &[f64; D]) -> Point<f64, D> {
        Point::from(std::array::from_fn(|k| {
            point[k] * self.scale + self.target[k]
        }))
    }
}

/// Mean of points already in the frame.
pub(crate) fn mean<const D: usize>(points: &[[f64; D]]) -> [f64; D] {
    let mut centre = [0.0; D];
    for point in points {
        (0..D).for_each(|k| centre[k] += point[k]);
    }
    centre.map(|c| c / points.len() as f64)
}
