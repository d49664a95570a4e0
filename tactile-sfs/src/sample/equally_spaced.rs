//! Points spread evenly over the surface's own area.

use nalgebra::Point3;
use ndarray::ArrayView2;

use super::lattice::Lattice;
use super::{ControlPointSampler, crowded, strips};
use crate::{Scalar, SfsError};

/// Equally spaced control points: each stands for the same area of the surface (not of its projection).
///
/// The surface is cut into strips of rows and the strips into cells of equal area, with a point in the centroid of each.
/// Cuts and centroids are to a fraction of a pixel: the same surface, larger or shifted, gives the same points of it, so
/// that the points of two loads correspond. Areas are measured on 100 pixels a point or more, where there are as many.
/// Deterministic; O(count), and O(pixels) for the mask's box.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EquallySpaced;

impl EquallySpaced {
    /// The sampler; it has no options.
    pub fn new() -> Self {
        Self
    }
}

impl<T: Scalar> ControlPointSampler<T> for EquallySpaced {
    fn sample(
        &self,
        surface: ArrayView2<'_, T>,
        mask: Option<ArrayView2<'_, bool>>,
        pixel_size_m: [T; 2],
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError> {
        Ok(spread(&Lattice::sparse(surface, mask, pixel_size_m, count)?, count))
    }
}

/// `count` points, each standing for the same weight.
pub(super) fn spread<T: Scalar>(lattice: &Lattice<'_, T>, count: usize) -> Vec<Point3<T>> {
    if count == 0 {
        return Vec::new();
    }
    let even = if lattice.has_room_for(count) { at_centroids(lattice, count) } else { None };
    even.unwrap_or_else(|| {
        crowded::cut(lattice, count).into_iter().map(|node| lattice.point(lattice.pixel(node))).collect()
    })
}

/// The centroids of the cells; `None` if two of them share a pixel.
fn at_centroids<T: Scalar>(lattice: &Lattice<'_, T>, count: usize) -> Option<Vec<Point3<T>>> {
    let places = strips::centroids(lattice, count);
    let (mut pixels, points): (Vec<_>, Vec<_>) =
        places.into_iter().map(|place| lattice.point_near(place)).unzip();
    pixels.sort_unstable();
    pixels.windows(2).all(|pair| pair[0] != pair[1]).then_some(points)
}
