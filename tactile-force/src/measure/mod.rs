//! Measurement of force and contact in one frame.

mod local;
mod options;
mod outcome;
mod outline;
mod workspace;

pub use options::ForceOptions;
pub use outcome::ForceMeasurement;
pub use workspace::ForceWorkspace;

use ndarray::ArrayView2;

use crate::calibration::StressCalibration;
use crate::contact::{Contact, ContactDetector, Detection, Region};
use crate::error::ForceError;
use crate::frame::ReferenceFrame;
use crate::hertz::{HertzFit, HertzFitter, Start};
use crate::lens::LensGeometry;
use local::Stress;
use outcome::{contact_radius, mean_stress};
use tactile_core::Estimate;
use tactile_core::Requirement;

/// Measures forces with one sensor: options checked and tables built once.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{CalibrationPair, ForceMeter, ForceWorkspace, LinearCalibration, ReferenceFrame};
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
/// let mut frame = Array2::from_elem((64, 64), 12_u8);
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![20..40, 20..40]).fill(112);
///
/// let (meter, mut workspace) = (ForceMeter::new([20e-6; 2], &Default::default())?, ForceWorkspace::default());
/// let measured = meter.measure_with(&mut workspace, frame.view(), &reference, &calibration)?;
/// // 400 pixels of 100 grey levels at 10 µN each.
/// assert!((measured.force_n.value - 0.4_f64).abs() < 1e-9);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ForceMeter {
    detector: ContactDetector,
    fitter: HertzFitter,
    skip_profile: bool,
    pixel_size_m: [f64; 2],
    lens: Option<LensGeometry>,
}

impl ForceMeter {
    /// A meter for pixels of the given size [x, y].
    ///
    /// # Errors
    /// A pixel size that is not positive and finite.
    pub fn new(pixel_size_m: [f64; 2], options: &ForceOptions) -> Result<Self, ForceError> {
        for size in pixel_size_m {
            Requirement::Positive.check("pixel_size_m", size)?;
        }
        Ok(Self {
            detector: ContactDetector::new(options.contact),
            fitter: HertzFitter::new(options.hertz),
            skip_profile: options.skip_profile,
            pixel_size_m,
            lens: None,
        })
    }

    /// The same meter behind a lens that distorts: the contact's contour and centre are undistorted, areas and stresses take the
    /// mean size of a pixel over the contact.
    ///
    /// ```
    /// use tactile_force::{ForceMeter, LensGeometry};
    ///
    /// let lens = LensGeometry::new([21.6e-6, 22e-6])?.with_distortion([695.5, 520.5], 869.0, [0.03, 0.0])?;
    /// let meter = ForceMeter::new(lens.pixel_size_m(), &Default::default())?.with_lens(lens);
    /// # let _ = meter;
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn with_lens(mut self, lens: LensGeometry) -> Self {
        self.lens = Some(lens);
        self
    }

    /// The same meter without the fit of Hertz's profile, see [`ForceOptions::without_profile`]: for contacts known to be no ball's.
    ///
    /// ```
    /// use tactile_force::ForceMeter;
    ///
    /// let meter = ForceMeter::new([20e-6; 2], &Default::default())?.without_profile();
    /// # let _ = meter;
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn without_profile(mut self) -> Self {
        self.skip_profile = true;
        self
    }

    /// Measures one frame. A calibration with a [local curve](StressCalibration::local) turns the contact's grey levels into
    /// pressures: the force is their integral, and the profile is fitted to them.
    ///
    /// # Errors
    /// The frame has not the reference's size, or too much of the contact is saturated.
    pub fn measure_with(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        calibration: &(impl StressCalibration + ?Sized),
    ) -> Result<ForceMeasurement, ForceError> {
        let ForceWorkspace {
            detector,
            rings,
            local,
        } = workspace;
        local.clear();
        let found = self.detector.detect_with(detector, frame, reference)?;
        let (Some(contact), Some(noise)) = (found.contact, found.noise) else {
            return Ok(ForceMeasurement::without_contact(found));
        };
        let pixel = self.pixel_at(&contact);
        let region = &mut detector.region;
        let stress = match calibration.local() {
            Some(curve) => local.convert(curve, region, &contact, noise, pixel.area)?,
            None => Stress {
                reading: calibration.read(contact.integrated_pixel_value)?,
                per_grey_pa: calibration
                    .stress_per_grey_level_pa(contact.integrated_pixel_value.value, pixel.area),
            },
        };
        let mut profile = None;
        if !self.skip_profile {
            let integral = contact.integrated_pixel_value.value;
            let levels = local.per_grey_pa().unwrap_or(1.0);
            let start = self.start(region, &contact, pixel, integral * levels);
            let variance = local.variance(&noise);
            let sizes = pixel.step;
            profile = start
                .and_then(|start| self.fitter.fit_with(rings, region, start, variance, sizes))
                .map(|fit: HertzFit| match local.per_grey_pa() {
                    Some(per_grey) => fit.with_levels_scaled(per_grey.recip()),
                    None => fit,
                });
        }
        // A part of an outline, or one that noise has frayed, says nothing of its shape.
        let whole = !contact.touches_edge && contact.other_contacts == 0;
        let clear = contact.peak > CLEAR * noise.background.sqrt();
        let elongation = (whole && clear)
            .then(|| outline::elongation(&workspace.detector.region.mask, self.jacobian(&contact)))
            .flatten();
        Ok(ForceMeasurement {
            elongation: elongation,
            ..self.combine(found, contact, profile, stress, pixel)
        })
    }

    /// Metres [x, y] for a step of one pixel along x and along y at a contact, in rows.
    fn jacobian(&self, contact: &Contact) -> [[f64; 2]; 2] {
        let Some(lens) = &self.lens else {
            let [hx, hy] = self.pixel_size_m;
            return [[hx, 0.0], [0.0, hy]];
        };
        let [x, y] = contact.centroid_px.map(|c| c.value);
        let step = |from: [f64; 2], to: [f64; 2]| {
            let (from, to) = (lens.to_metres(from), lens.to_metres(to));
            [to[0] - from[0], to[1] - from[1]]
        };
        let along_x = step([x - 0.5, y], [x + 0.5, y]);
        let along_y = step([x, y - 0.5], [x, y + 0.5]);
        [[along_x[0], along_y[0]], [along_x[1], along_y[1]]]
    }

    /// The size of a pixel at a contact.
    fn pixel_at(&self, contact: &Contact) -> PixelSize {
        let Some(lens) = &self.lens else {
            let [hx, hy] = self.pixel_size_m;
            return PixelSize {
                step: [hx, hy],
                area: hx * hy,
            };
        };
        let place = contact.centroid_px.map(|c| c.value);
        let area = lens.mean_pixel_area_m2(place, contact.equivalent_radius_px);
        PixelSize {
            step: lens.pixel_step_m(place),
            area: area,
        }
    }

    /// Where the fit of the profile starts, in pixels of the region; `integral` is in the units of its levels.
    fn start(
        &self,
        region: &Region,
        contact: &Contact,
        pixel: PixelSize,
        integral: f64,
    ) -> Option<Start> {
        let place = region.place?;
        let [x, y] = contact.centroid_px.map(|c| c.value);
        let [hx, hy] = pixel.step;
        Some(Start {
            centre: [x - place.column_start as f64, y - place.row_start as f64],
            radius: contact.equivalent_radius_px * (hy / hx).sqrt(),
            integral,
        })
    }

    fn combine(
        &self,
        found: Detection,
        contact: Contact,
        profile: Option<HertzFit>,
        stress: Stress,
        pixel: PixelSize,
    ) -> ForceMeasurement {
        let Stress {
            reading,
            per_grey_pa,
        } = stress;
        let [x, y] = contact.centroid_px;
        let mut centroid_m = [x * pixel.step[0], y * pixel.step[1]];
        let mut profile = profile;
        if let Some(lens) = &self.lens {
            let aspect = pixel.step[1] / pixel.step[0];
            let seen = profile.map_or(contact.equivalent_radius_px, |p| p.radius_px.value);
            let centre = [x.value, y.value];
            let (place, radius_m) = lens.contact_m(centre, seen, aspect);
            centroid_m[0].value = place[0];
            centroid_m[1].value = place[1];
            if let Some(profile) = &mut profile {
                let undistorted = radius_m / profile.radius_m.value;
                profile.radius_m = profile.radius_m * undistorted;
            }
        }
        let radius = contact_radius(&contact, profile, pixel.area.sqrt());
        let brightest = Estimate::new(contact.peak, 1.0);
        let peak = profile.map_or(brightest, |p| p.peak);
        ForceMeasurement {
            force_n: reading.force_n,
            reading: Some(reading),
            centroid_m: Some(centroid_m),
            contact_area_m2: Some((contact.area_px as f64) * pixel.area),
            contact_radius_m: Some(radius),
            mean_stress_pa: Some(mean_stress(reading.force_n, radius)),
            peak_stress_pa: Some(peak * per_grey_pa),
            contact: Some(contact),
            profile,
            elongation: None,
            statistics: found.statistics,
            drift: found.drift,
            noise: found.noise,
        }
    }
}

/// Peak over the noise of one pixel at which a contact's outline is sharp to a pixel.
const CLEAR: f64 = 20.0;

/// Steps [x, y] of a pixel in metres, and its area.
#[derive(Clone, Copy, Debug)]
struct PixelSize {
    step: [f64; 2],
    area: f64,
}

/// Measures the force of one frame against one reference frame. For many frames keep a [`ForceMeter`], a
/// [`ReferenceFrame`] and a [`ForceWorkspace`].
///
/// # Errors
/// Images of different size or without pixels, a pixel size that is not positive, too much of the contact saturated.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{CalibrationPair, LinearCalibration, measure_force};
///
/// let pairs: Vec<_> = (0..5).map(|k| CalibrationPair::loading(1e5 * k as f64, 0.5 * k as f64)).collect();
/// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
/// let reference = Array2::from_elem((200, 200), 12_u8);
/// let frame = Array2::from_shape_fn((200, 200), |(y, x)| {
///     let r2 = (x as f64 - 90.3).powi(2) + (y as f64 - 104.8).powi(2);
///     12 + (150.0 * (1.0 - r2 / 1600.0).max(0.0).sqrt()).round() as u8
/// });
/// let measured = measure_force(frame.view(), reference.view(), [20e-6, 20e-6], &calibration, &Default::default())?;
/// let radius = measured.contact_radius_m.expect("contact");
/// assert!((radius.value / 800e-6 - 1.0).abs() < 1e-3);
/// assert!((measured.force_n.value - 2.51).abs() < 0.01);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
pub fn measure_force(
    frame: ArrayView2<'_, u8>,
    reference: ArrayView2<'_, u8>,
    pixel_size_m: [f64; 2],
    calibration: &(impl StressCalibration + ?Sized),
    options: &ForceOptions,
) -> Result<ForceMeasurement, ForceError> {
    let meter = ForceMeter::new(pixel_size_m, options)?;
    let reference = ReferenceFrame::new(reference)?;
    meter.measure_with(
        &mut ForceWorkspace::default(),
        frame,
        &reference,
        calibration,
    )
}
