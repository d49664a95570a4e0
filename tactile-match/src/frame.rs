//! Normalised coordinates: centre and size are removed, so that no parameter depends on the units
//! of the points and no square underflows or overflows.

use nalgebra::{Point, SMatrix, SVector};

/// Coordinates are clamped to this number of radii, which is as good as infinity. The square is
/// still finite in single precision.
pub(crate) const FARTHEST: f64 = 1e12;

/// The map `x ↦ (x − centre) / scale`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame<const D: usize> {
    pub centre: SVector<f64, D>,
    pub scale: f64,
}

impl<const D: usize> Default for Frame<D> {
    fn default() -> Self {
        Self {
            centre: SVector::zeros(),
            scale: 1.0,
        }
    }
}

impl<const D: usize> Frame<D> {
    /// Centroid and root mean square radius of a set. The scale is one if all points coincide.
    pub(crate) fn of(points: &[Point<f64, D>]) -> Self {
        let (centre, radius) = centre_and_radius(points);
        Self {
            centre,
            scale: if radius > 0.0 { radius } else { 1.0 },
        }
    }

    /// The model's centroid and the largest distance from it along an axis in either set. This
    /// frame is for sets that are compared in place.
    pub(crate) fn of_both(model: &[Point<f64, D>], target: &[Point<f64, D>]) -> Self {
        let centre = Self::of(model).centre;
        let largest = model
            .iter()
            .chain(target)
            .map(|p| (p.coords - centre).amax())
            .fold(0.0, f64::max);
        Self {
            centre,
            scale: if largest > 0.0 { largest } else { 1.0 },
        }
    }

    /// Converts a point into this frame.
    pub(crate) fn inside(&self, point: &Point<f64, D>) -> SVector<f64, D> {
        (point.coords - self.centre) / self.scale
    }

    /// Converts a point of this frame into the units of the caller.
    pub(crate) fn leave(&self, inside: SVector<f64, D>) -> Point<f64, D> {
        Point::from(inside * self.scale + self.centre)
    }
}

/// Centroid of a set and its root mean square radius, which is zero if all points coincide.
pub(crate) fn centre_and_radius<const D: usize>(
    points: &[Point<f64, D>],
) -> (SVector<f64, D>, f64) {
    let n = points.len() as f64;
    // Differences from a point of the set preserve precision far from the origin.
    let origin = points[0].coords;
    let centre = origin
        + points
            .iter()
            .map(|p| p.coords - origin)
            .sum::<SVector<f64, D>>()
            / n;
    // Dividing by the largest radius first keeps the squares from underflow and overflow.
    let largest = points
        .iter()
        .map(|p| (p.coords - centre).amax())
        .fold(0.0, f64::max);
    if !(largest > 0.0 && largest.is_finite()) {
        return (centre, 0.0);
    }
    let squares: f64 = points
        .iter()
        .map(|p| ((p.coords - centre) / largest).norm_squared())
        .sum();
    (centre, largest * (squares / n).sqrt())
}

/// Median nearest-neighbour distance of about `sample` points of a set. Zero for a single point.
/// `distances` is working memory. `O(n)` for each point of the sample.
pub(crate) fn typical_spacing<const D: usize>(
    points: &[[f64; D]],
    sample: usize,
    distances: &mut Vec<f64>,
) -> f64 {
    let square =
        |a: &[f64; D], b: &[f64; D]| (SVector::from(*a) - SVector::from(*b)).norm_squared();
    distances.clear();
    let step = points.len().div_ceil(sample);
    distances.extend((0..points.len()).step_by(step).map(|i| {
        let others = points[..i].iter().chain(&points[i + 1..]);
        let squares = others.map(|p| square(p, &points[i]));
        squares.fold(f64::INFINITY, f64::min)
    }));
    let middle = distances.len() / 2;
    let spacing = *distances.select_nth_unstable_by(middle, f64::total_cmp).1;
    if spacing.is_finite() {
        spacing.sqrt()
    } else {
        0.0
    }
}

/// Covariance of a position drawn from these points with their weights. Zero if the weights sum to
/// zero.
pub(crate) fn spread<const D: usize>(
    places: impl Iterator<Item = (SVector<f64, D>, f64)> + Clone,
) -> SMatrix<f64, D, D> {
    let mass: f64 = places.clone().map(|(_, weight)| weight).sum();
    if mass <= 0.0 {
        return SMatrix::zeros();
    }
    let shares = places.map(|(place, weight)| (place, weight / mass));
    let mean: SVector<f64, D> = shares.clone().map(|(place, share)| place * share).sum();
    shares.fold(SMatrix::zeros(), |sum, (place, share)| {
        let step = place - mean;
        sum + step * step.transpose() * share
    })
}
