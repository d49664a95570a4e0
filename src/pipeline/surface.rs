//! From a frame's contact to its surface and control points.
use super::contact::FrameContact;
use super::pipeline::Pipeline;
use super::settings::{Settings, SurfaceInput};
use crate::force::{BoundingBox, LensGeometry, LocalCalibration};
use crate::sfs::{self, BallFit, BinnedContact, Domain, Frame, Image, SfsError, Surface};
use nalgebra::Point3;
use ndarray::ArrayView2;

/// A reconstructed surface with its position in the frame.
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::pipeline::{DarkContact, Object, Pipeline, SurfaceInput};
/// // A grey level is 5 µm, a pixel 0.1 mm; a ball of 4 mm radius is 0.8 mm deep around pixel
/// // (32, 32).
/// let table = [(0.0, 0.0), (200.0, 1e-3)];
/// let depth_mm = |x: f64, y: f64| (16.0 - 0.01 * (x * x + y * y)).sqrt() - 3.2;
/// let grey = |(r, c): (usize, usize)| {
///     220 - (depth_mm(c as f64 - 32.0, r as f64 - 32.0) / 5e-3).round() as u8
/// };
/// let (reference, frame) =
///     (Array2::from_elem((64, 64), 220_u8), Array2::from_shape_fn((64, 64), grey));
/// let pipeline = Pipeline::new(DarkContact::new(&table, [1e-4; 2])?, Object::sphere(4e-3))?
///     .with_surface(DarkContact::depth_table(&table)?, SurfaceInput::Signal);
/// let mut press = pipeline.press(reference.view())?;
/// press.add_frame(frame.view());
/// let surface = press.surface(0)?;
/// let ball = surface.fit_ball(4e-3).expect("a cap");
/// assert!((ball.contact_radius_m - 2.4e-3).abs() < 5e-6);
/// assert!((ball.centre_m[0] - 3.2e-3).abs() < 5e-6 && surface.origin_m[0] < 0.9e-3);
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ContactSurface {
    /// Heights over the box, in metres.
    pub surface: Surface<f64>,
    /// The box, in pixels of the frame.
    pub region: BoundingBox,
    /// Frame pixels along the side of a pixel of the grid.
    pub binning: usize,
    /// Size of a pixel of the grid in metres, x and y.
    pub pixel_size_m: [f64; 2],
    /// Position (x, y) in metres of the centre of the grid's first pixel, from the centre of the
    /// frame's first pixel.
    pub origin_m: [f64; 2],
    /// Whether the surface is *apparent*: the pressure interpreted as shading. The face of the
    /// sensor has another shape.
    pub apparent: bool,
}

impl Default for ContactSurface {
    /// An empty value to be filled.
    fn default() -> Self {
        Self {
            surface: Surface::default(),
            region: BoundingBox::whole((0, 0)),
            binning: 1,
            pixel_size_m: [1.0; 2],
            origin_m: [0.0; 2],
            apparent: false,
        }
    }
}

impl ContactSurface {
    /// Fits a ball of radius `radius_m`. Its centre is in metres from the frame's first pixel.
    ///
    /// `None` if the surface has fewer than 16 pixels, is wider than the ball, or no cap fits.
    pub fn fit_ball(&self, radius_m: f64) -> Option<BallFit> {
        self.fit(|heights, domain| BallFit::of_radius(heights, domain, radius_m))
    }

    /// Fits a ball, with the radius of the smallest mean absolute error. `None` as for
    /// [`fit_ball`](Self::fit_ball).
    pub fn fit_any_ball(&self) -> Option<BallFit> {
        self.fit(BallFit::of_any_radius)
    }

    fn fit(
        &self,
        by: impl FnOnce(ArrayView2<'_, f64>, &Domain<'_, f64>) -> Option<BallFit>,
    ) -> Option<BallFit> {
        let domain = Domain::new(self.pixel_size_m).ok()?;
        let domain = domain.with_mask(self.surface.mask.view());
        let mut fit = by(self.surface.heights.view(), &domain)?;
        for (centre, origin) in fit.centre_m.iter_mut().zip(self.origin_m) {
            *centre += origin;
        }
        Some(fit)
    }
}

/// The box of whole blocks that covers a contact's box: extended to the right and downwards, and
/// cut at the end of the frame.
fn whole_blocks(region: BoundingBox, side: usize, (rows, columns): (usize, usize)) -> BoundingBox {
    let end = |start: usize, end: usize, limit: usize| {
        let blocks = (end - start).div_ceil(side).min((limit - start) / side);
        start + blocks * side
    };
    BoundingBox {
        row_end: end(region.row_start, region.row_end, rows),
        column_end: end(region.column_start, region.column_end, columns),
        ..region
    }
}

/// Position (x, y) in metres of the grid's first pixel.
fn origin_m(region: &BoundingBox, binning: usize, pixel_size_m: [f64; 2]) -> [f64; 2] {
    let side = binning as f64;
    let middle = 0.5 * (side - 1.0);
    let first = [
        region.column_start as f64 + middle,
        region.row_start as f64 + middle,
    ];
    [
        first[0] * pixel_size_m[0] / side,
        first[1] * pixel_size_m[1] / side,
    ]
}

/// Working memory of the surface stage.
#[derive(Debug, Default)]
pub(super) struct ContactSurfaceWorkspace {
    sfs: sfs::SurfaceWorkspace<f64>,
    grid: BinnedContact,
}

impl ContactSurfaceWorkspace {
    /// Computes signal and mask on the grid. Returns the box of the grid. With a pressure curve the
    /// signal is the pressure relative to its peak.
    fn load(
        &mut self,
        settings: &Settings,
        images: [ArrayView2<'_, u8>; 2],
        contact: &FrameContact,
        (region, scale, side): (BoundingBox, f64, usize),
        pressure: Option<(&dyn LocalCalibration, f64)>,
    ) -> BoundingBox {
        let [frame, reference] = images;
        let whole = whole_blocks(region, side, frame.dim());
        let images = [whole.of(frame), whole.of(reference)];
        self.grid.load(images, side, scale);
        // A change of one level may be rounding.
        let step = contact.background_step_grey.unwrap_or(0.0);
        if settings.surface_input == SurfaceInput::Signal && step.abs() > 1.0 {
            self.grid.signal.mapv_inplace(|v| v - scale * step);
        }
        if let Some((curve, peak_pa)) = pressure {
            let pressure = |grey| curve.value_pa(grey) / peak_pa;
            self.grid.signal.mapv_inplace(pressure);
        }
        self.grid.load_mask(mask_over(contact, region), side);
        if side == 1 && settings.surface_input == SurfaceInput::Shading {
            self.grid.trim_rim();
        }
        let ceiling = ceiling(settings.surface_input);
        // The width is that in the frame, because blocks already smooth.
        let width = (settings.smoothing_px / side) | 1;
        self.grid.smooth(width, |level| levelness(level / ceiling));
        self.grid.signal.mapv_inplace(|v| v.clamp(0.0, ceiling));
        whole
    }
}

/// Largest value of the input.
fn ceiling(input: SurfaceInput) -> f64 {
    match input {
        SurfaceInput::Shading => 1.0,
        SurfaceInput::Signal => 255.0,
    }
}

/// Number of blocks around a contact on which its surface depends, in addition to those reached by
/// smoothing. The profile is extrapolated over a ring of up to three blocks, and one has a known
/// height.
const AROUND: usize = 4;

/// The part of a contact's region on which its surface depends, in the same blocks, because
/// detection uses a wide margin. Two passes of the smoothing reach as far as its width.
fn trimmed(
    region: BoundingBox,
    contact: BoundingBox,
    side: usize,
    smoothing: usize,
) -> BoundingBox {
    let margin = (AROUND + smoothing) * side;
    let start = |region: usize, contact: usize| {
        let blocks = (contact - region).saturating_sub(margin) / side;
        region + blocks * side
    };
    BoundingBox {
        row_start: start(region.row_start, contact.row_start),
        row_end: region.row_end.min(contact.row_end + margin),
        column_start: start(region.column_start, contact.column_start),
        column_end: region.column_end.min(contact.column_end + margin),
    }
}

/// A contact's mask on a part of its region.
fn mask_over(contact: &FrameContact, part: BoundingBox) -> ArrayView2<'_, bool> {
    let whole = contact.region.unwrap_or(part);
    let within = BoundingBox {
        row_start: part.row_start - whole.row_start,
        row_end: part.row_end - whole.row_start,
        column_start: part.column_start - whole.column_start,
        column_end: part.column_end - whole.column_start,
    };
    within.of(contact.mask.view())
}

/// Reconstructs the surface of a contact on the grid that suits a contact of `pixels` pixels.
pub(super) fn reconstruct(
    pipeline: &Pipeline,
    workspace: &mut ContactSurfaceWorkspace,
    images: [ArrayView2<'_, u8>; 2],
    contact: &FrameContact,
    pixels: usize,
    surface: &mut ContactSurface,
) -> Result<(), SfsError> {
    let (Some(region), Some(reading)) = (contact.region, contact.reading) else {
        return Err(SfsError::EmptyMask);
    };
    let settings = pipeline.settings();
    let curve = pipeline
        .contact()
        .pressure_curve()
        .filter(|_| settings.surface_input == SurfaceInput::Shading);
    let scale = match (settings.surface_input, curve) {
        (SurfaceInput::Shading, None) => 1.0 / reading.peak_grey,
        (SurfaceInput::Shading, Some(_)) | (SurfaceInput::Signal, _) => 1.0,
    };
    let peak = curve.map(|curve| (curve, curve.value_pa(reading.peak_grey)));
    let scale = scale * f64::from(pipeline.contact().polarity().sign());
    let side = settings.binning.side(pixels, settings.control_points);
    let bounds = contact.bounds().unwrap_or(region);
    let region = trimmed(region, bounds, side, settings.smoothing_px / side);
    let region = workspace.load(settings, images, contact, (region, scale, side), peak);
    let pixel_size_m = pipeline
        .contact()
        .pixel_size_m()
        .map(|size| size * side as f64);
    let domain = Domain::new(pixel_size_m)?.with_mask(workspace.grid.mask.view());
    let frame = Frame::Real(workspace.grid.signal.view());
    pipeline.surface().reconstruct_with(
        &mut workspace.sfs,
        Image::new(frame, domain),
        &mut surface.surface,
    )?;
    surface.origin_m = origin_m(&region, side, pixel_size_m);
    (surface.region, surface.binning, surface.pixel_size_m) = (region, side, pixel_size_m);
    surface.apparent = settings.surface_input == SurfaceInput::Shading;
    Ok(())
}

/// Control points on a surface.
#[derive(Debug, Default)]
pub(super) struct ControlPoints {
    /// Points in metres from the frame's first pixel.
    pub points: Vec<Point3<f64>>,
    /// The longer side of a surface pixel in metres.
    pub grid_m: f64,
}

/// Samples the control points of a surface.
pub(super) fn sample(
    pipeline: &Pipeline,
    workspace: &mut ContactSurfaceWorkspace,
    surface: &ContactSurface,
    sampled: &mut ControlPoints,
) -> Result<(), SfsError> {
    let (heights, mask) = (&surface.surface.heights, &surface.surface.mask);
    let usable = mask.iter().filter(|m| **m).count();
    let count = pipeline.settings().control_points.min(usable);
    let size = surface.pixel_size_m;
    let points = &mut sampled.points;
    let domain = Domain::new(size)?.with_mask(mask.view());
    pipeline
        .sampler()
        .sample_with(&mut workspace.sfs, heights.view(), &domain, count, points)?;
    let [x, y] = surface.origin_m;
    for p in points {
        p.x += x;
        p.y += y;
        if let Some(lens) = pipeline.contact().lens() {
            *p = undistorted(lens, *p);
        }
    }
    sampled.grid_m = size[0].max(size[1]);
    Ok(())
}

/// Undistorts a point of a surface that was computed as if all pixels had the size at the centre of
/// distortion. Its height scales with the local pixel size.
fn undistorted(lens: &LensGeometry, p: Point3<f64>) -> Point3<f64> {
    let [hx, hy] = lens.pixel_size_m();
    let pixel = [p.x / hx, p.y / hy];
    let [x, y] = lens.to_metres(pixel);
    let growth = (lens.pixel_area_m2(pixel) / (hx * hy)).sqrt();
    Point3::new(x, y, p.z * growth)
}

/// Weight of smoothing at a pixel: zero on slopes above 60°, where smoothing would round off the
/// rim and noise does little harm, and one on slopes below 37°.
fn levelness(shading: f64) -> f64 {
    ((shading - 0.5) / 0.3).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_blocks_end_with_the_frame() {
        let contact = BoundingBox {
            row_start: 1,
            row_end: 8,
            column_start: 2,
            column_end: 9,
        };
        let region = whole_blocks(contact, 3, (9, 11));
        // Two blocks down to the end of the frame, three across.
        assert_eq!((region.row_end, region.column_end), (7, 11));
    }

    #[test]
    fn what_is_trimmed_away_leaves_the_blocks_where_they_were() {
        let region = BoundingBox {
            row_start: 10,
            row_end: 200,
            column_start: 0,
            column_end: 90,
        };
        let contact = BoundingBox {
            row_start: 95,
            row_end: 120,
            column_start: 5,
            column_end: 70,
        };
        for (side, smoothing) in [(1, 5), (3, 1), (4, 0)] {
            let part = trimmed(region, contact, side, smoothing);
            let margin = (AROUND + smoothing) * side;
            assert_eq!((part.row_start - region.row_start) % side, 0);
            assert!(part.row_start + margin <= 95 && part.row_start + margin + side > 95);
            assert_eq!(part.row_end, 120 + margin);
            // No further than the region.
            assert_eq!(
                (part.column_start, part.column_end),
                (0, 90.min(70 + margin))
            );
        }
    }
}
