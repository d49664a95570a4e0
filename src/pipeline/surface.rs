//! From a frame's contact to its surface and the control points on it.
use super::contact::{FrameContact, resize};
use super::stages::Stages;
use crate::force::{BoundingBox, Polarity};
use crate::sfs::{Domain, Frame, SfsError, Surface, Workspace};
use nalgebra::Point3;
use ndarray::{Array2, ArrayView2, Axis};

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

/// Reconstructs the surface of a contact into `surface`. `signal`, `smoothed` and `column` are scratch.
#[allow(clippy::too_many_arguments)]
pub(super) fn reconstruct(
    stages: &dyn Stages,
    workspace: &mut Workspace<f64>,
    signal: &mut Array2<f64>,
    (smoothed, column): (&mut Array2<f64>, &mut Vec<f64>),
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
    let ceiling = if stages.settings().surface_input == SurfaceInput::Shading { 1.0 } else { 255.0 };
    resize(signal, (region.rows(), region.columns()));
    let pairs = region.of(frame).into_iter().zip(region.of(reference));
    for (out, (&i, &r)) in signal.iter_mut().zip(pairs) {
        *out = scale * (f64::from(i) - f64::from(r));
    }
    let width = stages.settings().smoothing_px;
    if width > 1 {
        smoothed.clone_from(signal);
        smooth(smoothed, column, width);
        signal
            .zip_mut_with(smoothed, |sharp, level| *sharp += levelness(*level / ceiling) * (*level - *sharp));
    }
    signal.mapv_inplace(|v| v.clamp(0.0, ceiling));
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

/// How far a pixel is to be smoothed: not at all on slopes above 60°, where smoothing would round off the rim and noise does
/// little harm, wholly on slopes below 37°.
fn levelness(shading: f64) -> f64 {
    ((shading - 0.5) / 0.3).clamp(0.0, 1.0)
}

/// Two passes of a box of `width` pixels (odd; 1 does nothing) along both axes: nearly a Gaussian of standard deviation
/// √((width² − 1)/6). Beyond the edge the last pixel goes on. O(pixels) whatever the width.
fn smooth(image: &mut Array2<f64>, line: &mut Vec<f64>, width: usize) {
    if width < 2 {
        return;
    }
    for _ in 0..2 {
        for axis in [Axis(1), Axis(0)] {
            for mut lane in image.lanes_mut(axis) {
                line.clear();
                line.extend(lane.iter());
                box_mean(line, width / 2, |i, v| lane[i] = v);
            }
        }
    }
}

/// Means over 2 × half + 1 neighbours.
fn box_mean(line: &[f64], half: usize, mut set: impl FnMut(usize, f64)) {
    let Some(last) = line.len().checked_sub(1) else { return };
    let at = |i: isize| line[i.clamp(0, last as isize) as usize];
    let half = half as isize;
    let mut sum: f64 = (-half..=half).map(at).sum();
    let width = (2 * half + 1) as f64;
    for i in 0..=last as isize {
        set(i as usize, sum / width);
        sum += at(i + half + 1) - at(i - half);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_keeps_constants_and_lines_and_quietens_noise() {
        let plane = Array2::from_shape_fn((20, 30), |(r, c)| r as f64 + 2.0 * c as f64);
        let mut smoothed = plane.clone();
        smooth(&mut smoothed, &mut Vec::new(), 5);
        // Away from the edge a box mean of a linear function is the function, to rounding.
        assert!((smoothed[[10, 15]] - plane[[10, 15]]).abs() < 1e-12);
        let mut impulse = Array2::zeros((21, 21));
        impulse[[10, 10]] = 1.0;
        smooth(&mut impulse, &mut Vec::new(), 5);
        assert!((impulse.sum() - 1.0).abs() < 1e-12);
        assert!((impulse[[10, 10]] - 0.04).abs() < 1e-12, "(1/5)² in the middle of two passes");
    }
}
