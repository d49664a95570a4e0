//! Points spread evenly over the surface's own area.

use nalgebra::Point3;
use ndarray::ArrayView2;

use super::lattice::Lattice;
use super::relax::relax;
use super::{ControlPointSampler, strips};
use crate::{Scalar, SfsError};

/// Equally spaced control points: each stands for the same area of the surface (not of its projection).
///
/// The surface is cut into strips of rows and the strips into cells of equal area; then a few of Lloyd's steps (every
/// point to the middle of the part of the surface nearest to it, distances in space) even the spacing out. Areas and
/// cells are measured on some 25 pixels a point; the points are pixels of the full surface.
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
    let chosen = strips::cut(lattice, count);
    if lattice.has_room_for(count) {
        relax(lattice, &chosen).into_iter().map(|pixel| lattice.point(pixel)).collect()
    } else {
        chosen.into_iter().map(|node| lattice.point(lattice.pixel(node))).collect()
    }
}
