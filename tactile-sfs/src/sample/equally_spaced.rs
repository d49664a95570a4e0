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
/// cells are measured on some 25 pixels a point; the points are pixels of the full surface, or lie between them.
/// Deterministic; O(count), and O(pixels) for the mask's box.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, EquallySpaced};
/// let tilted = Array2::from_shape_fn((40, 40), |(row, column)| row as f64 + 0.5 * column as f64);
/// let points = EquallySpaced::new().between_pixels().sample(tilted.view(), None, [1.0, 1.0], 20)?;
/// assert!(points.iter().all(|p| (p.z - p.y - 0.5 * p.x).abs() < 1e-9) && points.iter().any(|p| p.x.fract() != 0.0));
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EquallySpaced {
    between_pixels: bool,
}

impl EquallySpaced {
    /// The sampler; points are pixels.
    pub fn new() -> Self {
        Self::default()
    }

    /// Lets points lie between pixels, heights interpolated bilinearly: for surfaces so coarse that a pixel is a good part of the
    /// spacing. Where a point has no four pixels around it, or each has fewer than eight pixels, points stay pixels.
    #[must_use]
    pub fn between_pixels(self) -> Self {
        Self { between_pixels: true }
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
        Ok(spread(&Lattice::sparse(surface, mask, pixel_size_m, count)?, count, self.between_pixels))
    }
}

/// `count` points, each standing for the same weight.
pub(super) fn spread<T: Scalar>(lattice: &Lattice<'_, T>, count: usize, between: bool) -> Vec<Point3<T>> {
    if count == 0 {
        return Vec::new();
    }
    let chosen = strips::cut(lattice, count);
    if lattice.has_room_for(count) {
        let point = |(node, place)| {
            let inner = if between { lattice.between(place) } else { None };
            inner.unwrap_or_else(|| lattice.snapped(node, place))
        };
        relax(lattice, &chosen).into_iter().map(point).collect()
    } else {
        chosen.into_iter().map(|node| lattice.point(lattice.pixel(node))).collect()
    }
}
