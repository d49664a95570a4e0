//! Points spread evenly over the surface's own area.

use nalgebra::Point3;
use ndarray::ArrayView2;

use super::lattice::Lattice;
use super::strips::Weights;
use super::{ControlPointSampler, SampleBuffers, crowded};
use crate::{Scalar, SfsError, Workspace};

/// Equally spaced control points: each stands for the same area of the surface (not of its projection). Ground steeper than
/// 2 (63°) counts as that steep: the area of a rim depends on the pixels it falls on.
///
/// The surface is cut into strips of rows and the strips into cells of equal area, with a point in the centroid of each.
/// Cuts and centroids are to a fraction of a pixel: the same surface, larger or shifted, gives the same points of it, so
/// that the points of two loads correspond. Areas are measured on 100 pixels a point or more, where there are as many.
/// Deterministic; O(count), and O(pixels) for the mask's box.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, EquallySpaced};
/// // Level on the left, a roof of slope √3 on the right: twice the area, hence twice the points.
/// let z = Array2::from_shape_fn((60, 120), |(_, c)| 3.0_f64.sqrt() * (c as f64 - 60.0).max(0.0));
/// let points = EquallySpaced.sample(z.view(), None, [1.0, 1.0], 90)?;
/// let level = points.iter().filter(|point| point.x < 60.0).count();
/// assert!((27..=33).contains(&level));
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EquallySpaced;

impl<T: Scalar> ControlPointSampler<T> for EquallySpaced {
    fn sample_with(
        &self,
        workspace: &mut Workspace<T>,
        surface: ArrayView2<'_, T>,
        mask: Option<ArrayView2<'_, bool>>,
        pixel_size_m: [T; 2],
        count: usize,
        points: &mut Vec<Point3<T>>,
    ) -> Result<(), SfsError> {
        points.clear();
        let buffers = &mut workspace.points;
        let weight = core::mem::take(&mut buffers.weight);
        let lattice = Lattice::sparse(surface, mask, pixel_size_m, count, weight)?;
        spread(&lattice, count, buffers, points);
        buffers.weight = lattice.weight;
        Ok(())
    }
}

/// Adds `count` points, each standing for the same weight.
pub(super) fn spread<T: Scalar>(
    lattice: &Lattice<'_, T>,
    count: usize,
    buffers: &mut SampleBuffers,
    points: &mut Vec<Point3<T>>,
) {
    if count == 0 || lattice.has_room_for(count) && at_centroids(lattice, count, buffers, points) {
        return;
    }
    let SampleBuffers { nodes, chosen, .. } = buffers;
    crowded::cut(lattice, count, nodes, chosen);
    points.clear();
    points.extend(
        chosen
            .iter()
            .map(|&node| lattice.point(lattice.pixel(node))),
    );
}

/// Adds the centroids of the cells; false if two of them share a pixel.
fn at_centroids<T: Scalar>(
    lattice: &Lattice<'_, T>,
    count: usize,
    buffers: &mut SampleBuffers,
    points: &mut Vec<Point3<T>>,
) -> bool {
    let SampleBuffers { strips, pixels, .. } = buffers;
    let grid = Weights {
        weight: &lattice.weight,
        columns: lattice.columns,
        rows: lattice.rows,
        count: lattice.count as f64,
        aspect: lattice.aspect(),
    };
    strips.find(&grid, count);
    pixels.clear();
    for &place in &strips.places {
        let (pixel, point) = lattice.point_near(place);
        pixels.push(pixel);
        points.push(point);
    }
    pixels.sort_unstable();
    pixels.windows(2).all(|pair| pair[0] != pair[1])
}
