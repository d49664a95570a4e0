//! From a frame's contact to its surface and the control points on it.
use super::contact::{FrameContact, resize};
use super::stages::Stages;
use crate::force::{BoundingBox, Polarity};
use crate::sfs::{Domain, Frame, SfsError, Surface, Workspace};
use nalgebra::Point3;
use ndarray::{Array2, ArrayView2};

/// What of the frame the surface stage looks at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SurfaceInput {
    /// Signal over its greatest value, from 0 to 1: the cosine of the slope under frontal light.
    #[default]
    Shading,
    /// The signal itself: grey levels above (or, for sensors that darken, below) the reference.
    Signal,
}

/// A reconstructed surface and its place in the frame.
#[derive(Clone, Debug)]
pub struct ContactSurface {
    /// Heights over the box, in metres.
    pub surface: Surface<f64>,
    /// The box, in pixels of the frame.
    pub region: BoundingBox,
    /// The size of a pixel in metres, x and y.
    pub pixel_size_m: [f64; 2],
}

impl ContactSurface {
    /// Position (x, y) in metres of the box's first pixel.
    pub fn origin_m(&self) -> [f64; 2] {
        let [hx, hy] = self.pixel_size_m;
        [self.region.column_start as f64 * hx, self.region.row_start as f64 * hy]
    }
}

/// Reconstructs the surface of a contact into `surface`. `signal` is scratch.
pub(super) fn reconstruct(
    stages: &dyn Stages,
    workspace: &mut Workspace<f64>,
    signal: &mut Array2<f64>,
    frame: ArrayView2<'_, u8>,
    reference: ArrayView2<'_, u8>,
    contact: &FrameContact,
    surface: &mut ContactSurface,
) -> Result<(), SfsError> {
    let (Some(region), Some(reading)) = (contact.region, contact.reading) else {
        return Err(SfsError::EmptyMask);
    };
    let scale = match stages.settings().surface_input {
        SurfaceInput::Shading => 1.0 / reading.peak_grey,
        SurfaceInput::Signal => 1.0,
    };
    let scale = if stages.contact().polarity() == Polarity::Darker { -scale } else { scale };
    let limit = if stages.settings().surface_input == SurfaceInput::Shading { 1.0 } else { 255.0 };
    resize(signal, (region.rows(), region.columns()));
    let pairs = region.of(frame).into_iter().zip(region.of(reference));
    for (out, (&i, &r)) in signal.iter_mut().zip(pairs) {
        *out = (scale * (f64::from(i) - f64::from(r))).clamp(0.0, limit);
    }
    surface.region = region;
    surface.pixel_size_m = stages.contact().pixel_size_m();
    let domain = Domain::new(surface.pixel_size_m)?.with_mask(contact.mask.view());
    stages.surface().reconstruct_with(workspace, Frame::Real(signal.view()), &domain, &mut surface.surface)
}

/// Control points on a surface, in metres from the frame's first pixel.
pub(super) fn sample(stages: &dyn Stages, surface: &ContactSurface) -> Result<Vec<Point3<f64>>, SfsError> {
    let (heights, mask) = (&surface.surface.heights, &surface.surface.mask);
    let usable = mask.iter().filter(|m| **m).count();
    let count = stages.settings().control_points.min(usable);
    let size = surface.pixel_size_m;
    let mut points = stages.sampler().sample(heights.view(), Some(mask.view()), size, count)?;
    let [x, y] = surface.origin_m();
    for p in &mut points {
        p.x += x;
        p.y += y;
    }
    Ok(points)
}
