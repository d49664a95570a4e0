//! Force and contact of one frame.

use ndarray::{Array2, ArrayView2};
use tactile_core::{BoundingBox, Estimate, Polarity, Source, Uncertain};

use crate::calibration::{ForceReading, GreyHistogram, LocalCalibration, StressCalibration};
use crate::contact::{Contact, ContactDetector, ContactOptions, Detection, DetectorWorkspace};
use crate::drift::IlluminationDrift;
use crate::error::ForceError;
use crate::frame::ReferenceFrame;
use crate::lens::LensGeometry;
use crate::noise::DifferenceNoise;
use crate::profile::{HertzFit, HertzFitter, PixelVariance, Rings, Start, VARIANCE_LEVELS};
use crate::region::Region;
use crate::runs::Run;

/// Measures forces with one sensor. Options are validated and tables are built once.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{
///     CalibrationPair, ForceMeter, ForceWorkspace, LinearCalibration, ReferenceFrame,
/// };
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs)?;
/// let mut frame = Array2::from_elem((64, 64), 12_u8);
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![20..40, 20..40]).fill(112);
///
/// let (meter, mut workspace) = (
///     ForceMeter::new([20e-6; 2], &Default::default())?,
///     ForceWorkspace::default(),
/// );
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
    lens: LensGeometry,
}

impl ForceMeter {
    /// Creates a meter for pixels of the given size [x, y].
    ///
    /// # Errors
    /// An error for a pixel size that is not positive and finite.
    pub fn new(pixel_size_m: [f64; 2], options: &ForceOptions) -> Result<Self, ForceError> {
        Ok(Self {
            detector: ContactDetector {
                options: options.contact,
            },
            fitter: HertzFitter::new(),
            skip_profile: options.skip_profile,
            lens: LensGeometry::new(pixel_size_m)?,
        })
    }

    /// Adds a distorting lens: contour and centre of the contact are undistorted, and areas and
    /// stresses use the mean pixel size over the contact.
    ///
    /// ```
    /// use tactile_force::{ForceMeter, LensGeometry};
    ///
    /// let plain = LensGeometry::new([21.6e-6, 22e-6])?;
    /// let lens = plain.with_distortion([695.5, 520.5], 869.0, [0.03, 0.0])?;
    /// let meter = ForceMeter::new(lens.pixel_size_m(), &Default::default())?.with_lens(lens);
    /// # let _ = meter;
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn with_lens(mut self, lens: LensGeometry) -> Self {
        self.lens = lens;
        self
    }

    /// Switches off the fit of Hertz's profile, see [`ForceOptions::without_profile`]. Use it for
    /// contacts that are not those of a ball.
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

    /// Finds the contact of one frame without measuring its force. `None` if there is none.
    ///
    /// # Errors
    /// Those of [`measure_with`](Self::measure_with).
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::{ForceMeter, ForceWorkspace, ReferenceFrame};
    ///
    /// let reference = ReferenceFrame::new(Array2::from_elem((64, 64), 10).view())?;
    /// let mut frame = Array2::from_elem((64, 64), 10);
    /// frame.slice_mut(ndarray::s![20..30, 30..44]).fill(90);
    /// let (meter, mut workspace) =
    ///     (ForceMeter::new([20e-6; 2], &Default::default())?, ForceWorkspace::default());
    /// let contact = meter.detect_with(&mut workspace, frame.view(), &reference)?;
    /// let contact = contact.expect("a bright patch");
    /// assert_eq!((contact.area_px, contact.centroid_px[0].value), (140, 36.5));
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn detect_with(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<Option<Contact>, ForceError> {
        workspace.local.clear();
        let detector = &mut workspace.detector;
        let found = self.detector.detect_with(detector, frame, reference)?;
        Ok(found.contact)
    }

    /// Measures one frame. A calibration with a [local curve](StressCalibration::local) converts
    /// the grey levels of the contact into pressures: the force is their integral, and the profile
    /// is fitted to them.
    ///
    /// # Errors
    /// An error if the size of the frame differs from that of the reference, or if too much of the
    /// contact is saturated.
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
                    // Converted back to grey levels, the unit of the fields of the fit.
                    Some(per_grey) => fit.with_levels_scaled(per_grey.recip()),
                    None => fit,
                });
        }
        // A partial or noisy outline does not reveal its shape.
        let whole = !contact.touches_edge && contact.other_contacts == 0;
        // Ratio of peak to pixel noise above which the outline of a contact is sharp to one pixel.
        let clear = contact.peak > 20.0 * noise.background.sqrt();
        let elongation = (whole && clear)
            .then(|| elongation(&workspace.detector.region.mask, self.jacobian(&contact)))
            .flatten();
        Ok(ForceMeasurement {
            elongation,
            ..self.combine(found, contact, profile, stress, pixel)
        })
    }

    /// Displacements [x, y] in metres for a step of one pixel along x and along y at a contact, by
    /// rows.
    fn jacobian(&self, contact: &Contact) -> [[f64; 2]; 2] {
        let [x, y] = contact.centroid_px.map(|c| c.value);
        let step = |from: [f64; 2], to: [f64; 2]| {
            let (from, to) = (self.lens.to_metres(from), self.lens.to_metres(to));
            [to[0] - from[0], to[1] - from[1]]
        };
        let along_x = step([x - 0.5, y], [x + 0.5, y]);
        let along_y = step([x, y - 0.5], [x, y + 0.5]);
        [[along_x[0], along_y[0]], [along_x[1], along_y[1]]]
    }

    /// The size of a pixel at a contact.
    fn pixel_at(&self, contact: &Contact) -> PixelSize {
        let place = contact.centroid_px.map(|c| c.value);
        PixelSize {
            step: self.lens.pixel_step_m(place),
            area: self
                .lens
                .mean_pixel_area_m2(place, contact.equivalent_radius_px),
        }
    }

    /// Start values for the fit of the profile, in pixels of the region. `integral` is in the units
    /// of the region's levels.
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
            // Converts the radius of equal area from pixels to pixel widths.
            radius: contact.equivalent_radius_px * (hy / hx).sqrt(),
            integral,
        })
    }

    fn combine(
        &self,
        found: Detection,
        contact: Contact,
        mut profile: Option<HertzFit>,
        stress: Stress,
        pixel: PixelSize,
    ) -> ForceMeasurement {
        let centre = contact.centroid_px.map(|c| c.value);
        let aspect = pixel.step[1] / pixel.step[0];
        let seen = profile.map_or(contact.equivalent_radius_px, |p| p.radius_px.value);
        let (place, radius_m) = self.lens.contact_m(centre, seen, aspect);
        let mut centroid_m = [0, 1].map(|k| contact.centroid_px[k] * pixel.step[k]);
        (centroid_m[0].value, centroid_m[1].value) = (place[0], place[1]);
        if let Some(profile) = &mut profile {
            let undistorted = radius_m / profile.radius_m.value;
            profile.radius_m = profile.radius_m * undistorted;
        }
        // Without a profile, the radius of the mask has an error of half a pixel, and the brightest
        // pixel gives the peak with an error of one grey level.
        let side = pixel.area.sqrt();
        let of_mask = Estimate::new(contact.equivalent_radius_px * side, 0.5 * side);
        let radius = profile.map_or(of_mask.into(), |p| p.radius_m);
        let brightest = Estimate::new(contact.peak, 1.0);
        let peak = profile.map_or(brightest, |p| p.peak);
        let force_n = stress.reading.force_n;
        ForceMeasurement {
            force_n,
            reading: Some(stress.reading),
            centroid_m: Some(centroid_m),
            contact_area_m2: Some((contact.area_px as f64) * pixel.area),
            contact_radius_m: Some(radius),
            mean_stress_pa: Some(force_n / (radius.powf(2.0) * std::f64::consts::PI)),
            peak_stress_pa: Some(Uncertain::from(peak) * stress.per_grey()),
            contact: Some(contact),
            profile,
            noise: found.noise,
            ..ForceMeasurement::without_contact(found)
        }
    }
}

/// Pixel steps [x, y] in metres, and the pixel area.
#[derive(Clone, Copy, Debug)]
struct PixelSize {
    step: [f64; 2],
    area: f64,
}

/// Measures the force of one frame against one reference frame. For many frames, keep a
/// [`ForceMeter`], a [`ReferenceFrame`] and a [`ForceWorkspace`].
///
/// # Errors
/// An error for images of different size or without pixels, a pixel size that is not positive, or a
/// contact that is too saturated.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{CalibrationPair, LinearCalibration, measure_force};
///
/// let pairs: Vec<_> = (0..5)
///     .map(|k| CalibrationPair::loading(1e5 * k as f64, 0.5 * k as f64))
///     .collect();
/// let calibration = LinearCalibration::fit(&pairs)?;
/// let reference = Array2::from_elem((200, 200), 12_u8);
/// let frame = Array2::from_shape_fn((200, 200), |(y, x)| {
///     let r2 = (x as f64 - 90.3).powi(2) + (y as f64 - 104.8).powi(2);
///     12 + (150.0 * (1.0 - r2 / 1600.0).max(0.0).sqrt()).round() as u8
/// });
/// let measured = measure_force(
///     frame.view(),
///     reference.view(),
///     [20e-6, 20e-6],
///     &calibration,
///     &Default::default(),
/// )?;
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

/// Options of a force measurement.
///
/// ```
/// use tactile_force::{ContactOptions, ForceMeter, ForceOptions, Polarity};
///
/// // Only force and centroid, at one false alarm in a million frames.
/// let contact = ContactOptions::default().with_false_alarm_rate(1e-6)?;
/// let options = ForceOptions::default().with_contact(contact).without_profile();
/// assert_eq!(options.polarity(), Polarity::Brighter);
/// assert!(ForceMeter::new([20e-6; 2], &options).is_ok());
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ForceOptions {
    contact: ContactOptions,
    skip_profile: bool,
}

impl ForceOptions {
    /// Sets the options of contact detection.
    pub fn with_contact(mut self, contact: ContactOptions) -> Self {
        self.contact = contact;
        self
    }

    /// Switches off the fit of the profile. Radius and peak stress then come from the mask.
    pub fn without_profile(mut self) -> Self {
        self.skip_profile = true;
        self
    }

    /// Whether a contact is brighter or darker than the reference.
    pub fn polarity(&self) -> Polarity {
        self.contact.polarity
    }
}

/// Force, contact and stress measured in one frame.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{CalibrationPair, ForceMeasurement, LinearCalibration, measure_force};
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs)?;
/// let at_rest = Array2::from_elem((64, 64), 12_u8);
/// let m: ForceMeasurement = measure_force(
///     at_rest.view(),
///     at_rest.view(),
///     [20e-6; 2],
///     &calibration,
///     &Default::default(),
/// )?;
/// // The absence of contact is a result, not an error.
/// assert_eq!((m.force_n.value, m.contact, m.mean_stress_pa), (0.0, None, None));
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct ForceMeasurement {
    /// Normal force in newtons, equation (6). Zero without contact.
    pub force_n: Uncertain,
    /// The reading of the force, which also states whether the calibration was used outside its
    /// range. `None` without contact.
    pub reading: Option<ForceReading>,
    /// The contact. `None` if there is none.
    pub contact: Option<Contact>,
    /// The fitted Hertz profile. `None` if it was not requested or could not be fitted.
    pub profile: Option<HertzFit>,
    /// Centroid [x, y] in metres from the centre of the first pixel, equations (7) and (8).
    pub centroid_m: Option<[Estimate; 2]>,
    /// Area of the mask in square metres.
    pub contact_area_m2: Option<f64>,
    /// Contact radius in metres: that of the profile, or otherwise the equivalent radius of the
    /// mask with an error of half a pixel.
    pub contact_radius_m: Option<Uncertain>,
    /// F/(π a²) in pascals.
    pub mean_stress_pa: Option<Uncertain>,
    /// Stress at the centre in pascals: the calibrated peak of the profile, or otherwise the
    /// calibrated largest difference.
    pub peak_stress_pa: Option<Uncertain>,
    /// Longer over shorter half axis of the contact's outline, minus one. `None` unless it exceeds
    /// 0.5 % and the effect of pixel discretisation. Possible reasons are misstated pixel sizes, a
    /// distorting lens, or an object that is not round.
    pub elongation: Option<f64>,
    /// Σ (frame − reference) over the whole frame, in grey levels.
    pub difference_sum: i64,
    /// The correction of illumination and stray light.
    pub drift: IlluminationDrift,
    /// The noise from which the errors are computed. `None` without contact.
    pub noise: Option<DifferenceNoise>,
}

impl ForceMeasurement {
    fn without_contact(found: Detection) -> Self {
        Self {
            force_n: Uncertain::default(),
            reading: None,
            contact: None,
            profile: None,
            centroid_m: None,
            contact_area_m2: None,
            contact_radius_m: None,
            mean_stress_pa: None,
            peak_stress_pa: None,
            elongation: None,
            difference_sum: found.statistics.sum,
            drift: found.drift,
            noise: None,
        }
    }
}

/// Buffers that measurements reuse from frame to frame. After the first frames nothing is
/// allocated.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{
///     CalibrationPair, ForceMeter, ForceWorkspace, LinearCalibration, ReferenceFrame,
/// };
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs)?;
/// let mut frame = Array2::from_elem((64, 64), 12_u8);
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![20..40, 24..48]).fill(90);
/// let mut workspace = ForceWorkspace::default();
/// let meter = ForceMeter::new([20e-6; 2], &Default::default())?;
/// meter.measure_with(&mut workspace, frame.view(), &reference, &calibration)?;
/// let (place, mask) = workspace.mask().expect("contact");
/// assert_eq!(mask.iter().filter(|inside| **inside == 1).count(), 20 * 24);
/// assert!(place.row_start <= 20 && place.row_end >= 40);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct ForceWorkspace {
    detector: DetectorWorkspace,
    rings: Rings,
    local: Local,
}

impl ForceWorkspace {
    /// The mask of the last frame's contact (1 inside, 0 outside) over a region, with the position
    /// of the region in the frame. `None` if there was no contact.
    pub fn mask(&self) -> Option<(BoundingBox, ArrayView2<'_, u8>)> {
        let region = &self.detector.region;
        let place = region.place?;
        let view = ArrayView2::from_shape((place.rows(), place.columns()), &region.pixels).ok()?;
        Some((place, view))
    }

    /// The grey histogram of the contact found last by [`ForceMeter::detect_with`], over its
    /// aperture, with `pixel_area_m2` per pixel: a row in the fit of a
    /// [`PressureCurve`](crate::PressureCurve). `None` if there was no contact, or if its grey
    /// levels were converted into pressures.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::{ForceMeter, ForceWorkspace, ReferenceFrame};
    ///
    /// let mut frame = Array2::from_elem((64, 64), 12_u8);
    /// let reference = ReferenceFrame::new(frame.view())?;
    /// frame.slice_mut(ndarray::s![20..40, 20..40]).fill(90);
    /// let (meter, mut workspace) =
    ///     (ForceMeter::new([20e-6; 2], &Default::default())?, ForceWorkspace::default());
    /// let contact = meter.detect_with(&mut workspace, frame.view(), &reference)?;
    /// let histogram = workspace.grey_histogram(4e-10).expect("a contact");
    /// let sum = contact.expect("a contact").integrated_pixel_value.value;
    /// assert!((histogram.integral(|grey| grey) / (4e-10 * sum) - 1.0).abs() < 1e-12);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn grey_histogram(&self, pixel_area_m2: f64) -> Option<GreyHistogram> {
        let region = &self.detector.region;
        region.place.filter(|_| self.local.converted.is_none())?;
        let columns = region.columns();
        let runs = region.aperture.iter();
        let differences = runs.flat_map(|run| &region.difference[run.span(columns)]);
        Some(GreyHistogram::from_differences(
            differences.copied(),
            pixel_area_m2,
        ))
    }

    /// The pressure of the last contact in pascals over its region (zero outside the aperture), and
    /// the position of the region in the frame. `None` without contact, or if the calibration had
    /// no [local curve](crate::StressCalibration::local). O(pixels of the region).
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::{
    ///     Branch, CalibrationFrame, ForceMeter, ForceWorkspace, GreyHistogram, PressureCurve,
    ///     ReferenceFrame,
    /// };
    ///
    /// // 2 kPa per grey level.
    /// let pixels = |grey: f32| std::iter::repeat_n(grey, 1000);
    /// let disc = |grey: f32| GreyHistogram::from_differences(pixels(grey), 4e-10);
    /// let frames: Vec<_> = [20.0_f32, 40.0, 60.0, 80.0, 100.0]
    ///     .map(|grey| {
    ///         CalibrationFrame::new(disc(grey), f64::from(grey) * 2e3 * 4e-7, Branch::Loading)
    ///     })
    ///     .into_iter()
    ///     .collect::<Result<_, _>>()?;
    /// let curve = PressureCurve::fit(&frames, &Default::default())?;
    /// let mut frame = Array2::from_elem((64, 64), 12_u8);
    /// let reference = ReferenceFrame::new(frame.view())?;
    /// frame.slice_mut(ndarray::s![20..40, 20..40]).fill(62);
    /// let mut workspace = ForceWorkspace::default();
    /// let meter = ForceMeter::new([20e-6; 2], &Default::default())?;
    /// let measured = meter.measure_with(&mut workspace, frame.view(), &reference, &curve)?;
    /// let (_, pressure) = workspace.pressure_pa().expect("a contact");
    /// assert!(
    ///     (f64::from(pressure[[pressure.nrows() / 2, pressure.ncols() / 2]]) / 1e5 - 1.0).abs()
    ///         < 1e-3
    /// );
    /// let force = pressure.iter().map(|p| f64::from(*p) * 4e-10).sum::<f64>();
    /// assert!((force / measured.force_n.value - 1.0).abs() < 1e-5);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn pressure_pa(&self) -> Option<(BoundingBox, Array2<f32>)> {
        self.local.per_grey_pa()?;
        let region = &self.detector.region;
        let place = region.place?;
        let columns = region.columns();
        let mut image = vec![0.0; region.difference.len()];
        for run in &region.aperture {
            let span = run.span(columns);
            image[span.clone()].copy_from_slice(&region.difference[span]);
        }
        let image = Array2::from_shape_vec((place.rows(), place.columns()), image).ok()?;
        Some((place, image))
    }
}

/// Fraction of a grey level at which the curve is tabulated and pixels are counted. Rounding to a
/// sixteenth adds 2 % to the smallest possible variance of a grey level, that of rounding to
/// integers.
const STEPS: usize = 16;
/// Number of entries of the table, starting at −256 grey levels.
const TABLE: usize = 512 * STEPS + 1;
const LEAST: f32 = -256.0;
/// Number of pixels whose table indices are computed together with SIMD instructions.
const BLOCK: usize = 64;

/// Force of a contact, and the pascals per grey level of its integrated pixel value.
#[derive(Clone, Copy, Debug)]
struct Stress {
    reading: ForceReading,
    per_grey_pa: f64,
}

impl Stress {
    /// Pascals per grey level, with the error of the force from the calibration. The noise of the
    /// sum does not apply to the peak.
    fn per_grey(&self) -> Uncertain {
        let force_n = self.reading.force_n.without(Source::Noise);
        if force_n.value == 0.0 {
            return Uncertain::exact(self.per_grey_pa);
        }
        force_n.map(|_| self.per_grey_pa, |force_n| self.per_grey_pa / force_n)
    }
}

/// Buffers of the conversion, with the result for the last contact.
#[derive(Clone, Debug, Default)]
struct Local {
    histogram: GreyHistogram,
    /// f at each table step.
    table: Vec<f32>,
    /// Number of aperture pixels at each table step.
    counts: Vec<u32>,
    converted: Option<Converted>,
}

#[derive(Clone, Debug)]
struct Converted {
    per_grey_pa: f64,
    /// Variance of a pixel's pressure, at even steps of the pressure.
    variance: [f64; VARIANCE_LEVELS],
    step: f64,
}

impl Local {
    fn clear(&mut self) {
        self.converted = None;
    }

    /// Pascals per grey level over the last contact. `None` if it was not converted.
    fn per_grey_pa(&self) -> Option<f64> {
        self.converted.as_ref().map(|c| c.per_grey_pa)
    }

    /// The variance of the pixels to which the profile is fitted.
    fn variance<'a>(&'a self, noise: &'a DifferenceNoise) -> PixelVariance<'a> {
        match &self.converted {
            Some(c) => PixelVariance::Pressure {
                values: &c.variance,
                step: c.step,
            },
            None => PixelVariance::Grey(noise),
        }
    }

    /// Computes the force from the histogram of the aperture, and converts the differences of the
    /// aperture into pressures.
    fn convert(
        &mut self,
        curve: &dyn LocalCalibration,
        region: &mut Region,
        contact: &Contact,
        noise: DifferenceNoise,
        pixel_area_m2: f64,
    ) -> Result<Stress, ForceError> {
        self.tabulate(curve);
        self.counts.clear();
        self.counts.resize(TABLE, 0);
        let columns = region.columns();
        for run in &region.aperture {
            let differences = &mut region.difference[run.span(columns)];
            for block in differences.chunks_mut(BLOCK) {
                let mut places = [0_u32; BLOCK];
                for (place, d) in places.iter_mut().zip(&*block) {
                    *place = place_of(*d);
                }
                for (d, place) in block.iter_mut().zip(places) {
                    let place = (place as usize).min(TABLE - 1);
                    self.counts[place] += 1;
                    *d = self.table[place];
                }
            }
        }
        self.histogram.clear(pixel_area_m2);
        for (k, count) in self.counts.iter().enumerate().filter(|(_, c)| **c > 0) {
            self.histogram
                .add_many(grey_at(k) as f32, f64::from(*count));
        }
        let reading = curve.read(&self.histogram, &noise)?;
        let integral = contact.integrated_pixel_value.value;
        let per_grey_pa = reading.force_n.value / (integral * pixel_area_m2);
        self.converted = Some(self.variances(noise, contact.peak, per_grey_pa));
        Ok(Stress {
            reading,
            per_grey_pa,
        })
    }

    /// f at each table step, linear between integer grey levels as in a histogram.
    fn tabulate(&mut self, curve: &dyn LocalCalibration) {
        self.table.clear();
        let whole = |grey: usize| curve.value_pa(f64::from(LEAST) + grey as f64);
        let mut below = whole(0);
        for grey in 0..512 {
            let above = whole(grey + 1);
            let step = (above - below) / STEPS as f64;
            self.table
                .extend((0..STEPS).map(|k| (below + step * k as f64) as f32));
            below = above;
        }
        self.table.push(below as f32);
    }

    /// Variance of a pressure, (secant slope)² σ², from zero to a fifth above the peak of the
    /// contact.
    fn variances(&self, noise: DifferenceNoise, peak: f64, per_grey_pa: f64) -> Converted {
        let pressure = |grey: f64| {
            let place = (place_of(grey as f32) as usize).min(TABLE - 1);
            f64::from(self.table[place])
        };
        let highest = pressure(1.2 * peak).max(f64::MIN_POSITIVE);
        let step = highest / (VARIANCE_LEVELS - 1) as f64;
        let mut grey = 0.0;
        let variance = std::array::from_fn(|k| {
            // The levels are ascending, and so are the corresponding grey levels.
            while pressure(grey) < step * k as f64 && grey < 256.0 {
                grey += 0.25;
            }
            let variance = noise.background + noise.gain * grey;
            let sd = variance.sqrt();
            // A secant over the noise instead of the tangent, because the curve may bend within the
            // noise of a pixel.
            let slope = (pressure(grey + sd) - pressure(grey - sd)) / (2.0 * sd);
            // If the curve is flat over the noise, the slope is at least a thousandth of the mean
            // slope.
            slope.max(1e-3 * per_grey_pa).powi(2) * variance
        });
        Converted {
            per_grey_pa,
            variance,
            step,
        }
    }
}

/// The table step nearest to a grey-level difference.
#[inline]
fn place_of(difference: f32) -> u32 {
    ((difference.clamp(-255.0, 255.0) - LEAST) * STEPS as f32 + 0.5) as i32 as u32
}

/// The grey level of a table step.
fn grey_at(place: usize) -> f64 {
    f64::from(LEAST) + place as f64 / STEPS as f64
}

/// Ratio of the longer to the shorter half axis of the mask's ellipse of inertia, minus one. `None`
/// if it does not exceed the effect of pixel discretisation. The Jacobian maps a step [x, y] in
/// pixels to metres: [∂x, ∂y] in rows.
///
/// An outline with N = 2πa points, each with an independent error σ, has a second harmonic of σ
/// √(2/N), and an elongation of twice that over a. O(rows of the mask).
fn elongation(mask: &[Run], jacobian: [[f64; 2]; 2]) -> Option<f64> {
    let (mut n, mut x, mut y) = (0.0, 0.0, 0.0);
    for run in mask {
        let (len, middle) = pixels(run);
        n += len;
        x += len * middle;
        y += len * f64::from(run.row);
    }
    let (x, y) = (x / n, y / n);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for run in mask {
        let (len, middle) = pixels(run);
        let (u, v) = (middle - x, f64::from(run.row) - y);
        // Pixels are squares rather than points: a run has the second moment of a bar of its
        // length.
        xx += len * (u * u + len * len / 12.0);
        xy += len * u * v;
        yy += len * (v * v + 1.0 / 12.0);
    }
    let [[a, b], [c, d]] = jacobian;
    // J C Jᵀ, its trace and half the difference of its eigenvalues.
    let moved_xx = a * a * xx + 2.0 * a * b * xy + b * b * yy;
    let moved_yy = c * c * xx + 2.0 * c * d * xy + d * d * yy;
    let moved_xy = a * c * xx + (a * d + b * c) * xy + b * d * yy;
    let mean = 0.5 * (moved_xx + moved_yy);
    let half = (0.5 * (moved_xx - moved_yy)).hypot(moved_xy);
    let elongation = ((mean + half) / (mean - half)).sqrt() - 1.0;
    let radius_px = (n / std::f64::consts::PI).sqrt();
    // Standard deviation of the outline's position in pixels: 1/√12 of a step of one pixel.
    let error = 2.0 * 0.29 / (radius_px * (std::f64::consts::PI * radius_px).sqrt());
    // An outline counts as a circle below this elongation (pixels that deviate from squares by half
    // a per cent change a ball's modulus by less than one per cent), or if the elongation is below
    // this number of standard errors.
    (elongation > 5e-3_f64.max(4.0 * error)).then_some(elongation)
}

/// Number of pixels of a run, and its centre.
fn pixels(run: &Run) -> (f64, f64) {
    (
        run.len() as f64,
        0.5 * (f64::from(run.start) + f64::from(run.end) - 1.0),
    )
}

#[cfg(test)]
#[path = "measure_tests.rs"]
mod tests;
