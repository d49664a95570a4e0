//! Measurement of force and contact in one frame.

use ndarray::ArrayView2;

use crate::calibration::{ForceReading, StressCalibration};
use crate::contact::{
    Contact, ContactDetector, ContactOptions, Detection, DetectorWorkspace, Polarity,
};
use crate::drift::IlluminationDrift;
use crate::error::{ForceError, Requirement};
use crate::estimate::{Estimate, Real};
use crate::frame::{BoundingBox, DifferenceNoise, FrameStatistics, ReferenceFrame};
use crate::hertz::{HertzFit, HertzFitOptions, HertzFitter, Rings, Start};

/// The options of a force measurement.
///
/// ```
/// use tactile_force::{ContactOptions, ForceMeter, ForceOptions, HertzFitOptions, Polarity};
///
/// // Force and centroid only, at one false alarm in a million frames.
/// let contact = ContactOptions::default().with_false_alarm_rate(1e-6)?;
/// let options = ForceOptions::default().with_contact(contact).without_profile();
/// assert_eq!(options.polarity(), Polarity::Brighter);
/// assert!(ForceMeter::<f64>::new([20e-6; 2], &options).is_ok());
/// // The profile over a background that is fitted too.
/// let hertz = HertzFitOptions::default().with_fitted_background();
/// assert_ne!(ForceOptions::default().with_hertz(hertz), ForceOptions::default());
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ForceOptions {
    contact: ContactOptions,
    hertz: HertzFitOptions,
    skip_profile: bool,
}

impl ForceOptions {
    /// Finds the contact with these options.
    pub fn with_contact(mut self, contact: ContactOptions) -> Self {
        self.contact = contact;
        self
    }

    /// Fits the profile with these options.
    pub fn with_hertz(mut self, hertz: HertzFitOptions) -> Self {
        self.hertz = hertz;
        self
    }

    /// Fits no profile: radius and peak stress then come from the mask.
    pub fn without_profile(mut self) -> Self {
        self.skip_profile = true;
        self
    }

    /// Whether contact is brighter or darker than the reference.
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
/// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
/// let at_rest = Array2::from_elem((64, 64), 12_u8);
/// let m: ForceMeasurement<f64> =
///     measure_force(at_rest.view(), at_rest.view(), [20e-6; 2], &calibration, &Default::default())?;
/// // No contact is an answer, not an error.
/// assert_eq!((m.force_n.value, m.contact, m.mean_stress_pa), (0.0, None, None));
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ForceMeasurement<T> {
    /// Normal force in newtons, equation (6); zero without contact.
    pub force_n: Estimate<T>,
    /// The parts of the force's error, and whether the calibration was used outside its range; `None` without contact.
    pub reading: Option<ForceReading<T>>,
    /// The contact; `None` if the frame shows none.
    pub contact: Option<Contact<T>>,
    /// The fitted Hertz profile, if it was asked for and could be fitted.
    pub profile: Option<HertzFit<T>>,
    /// Centroid [x, y] in metres from the centre of the first pixel, equations (7) and (8).
    pub centroid_m: Option<[Estimate<T>; 2]>,
    /// Area of the mask in square metres.
    pub contact_area_m2: Option<T>,
    /// Contact radius in metres: the profile's, else the mask's equivalent radius with half a pixel as its error.
    pub contact_radius_m: Option<Estimate<T>>,
    /// F/(π a²) in pascals.
    pub mean_stress_pa: Option<Estimate<T>>,
    /// Stress at the centre in pascals: the profile's peak, else the greatest difference, through the calibration.
    pub peak_stress_pa: Option<Estimate<T>>,
    /// Sums over the whole frame.
    pub statistics: FrameStatistics,
    /// The correction of illumination and stray light.
    pub drift: IlluminationDrift,
    /// The noise that the errors are computed from; `None` without contact.
    pub noise: Option<DifferenceNoise>,
}

/// Buffers that measurements reuse from frame to frame; after the first frames nothing is allocated.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{CalibrationPair, ForceMeter, ForceWorkspace, LinearCalibration, ReferenceFrame};
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
/// let mut frame = Array2::from_elem((64, 64), 12_u8);
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![20..40, 24..48]).fill(90);
/// let mut workspace = ForceWorkspace::default();
/// let meter = ForceMeter::<f64>::new([20e-6; 2], &Default::default())?;
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
}

impl ForceWorkspace {
    /// The last contact's mask (1 inside) over its region, and the region's place in the frame.
    pub fn mask(&self) -> Option<(BoundingBox, ArrayView2<'_, u8>)> {
        self.detector.mask()
    }
}

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
pub struct ForceMeter<T> {
    detector: ContactDetector,
    fitter: HertzFitter,
    skip_profile: bool,
    pixel_size_m: [T; 2],
}

impl<T: Real> ForceMeter<T> {
    /// A meter for pixels of the given size [x, y].
    ///
    /// # Errors
    /// A pixel size that is not positive and finite.
    pub fn new(pixel_size_m: [T; 2], options: &ForceOptions) -> Result<Self, ForceError> {
        for size in pixel_size_m {
            Requirement::Positive.check("pixel_size_m", size.as_f64())?;
        }
        Ok(Self {
            detector: ContactDetector::new(options.contact),
            fitter: HertzFitter::new(options.hertz),
            skip_profile: options.skip_profile,
            pixel_size_m,
        })
    }

    /// Measures one frame.
    ///
    /// # Errors
    /// The frame has not the reference's size, or too much of the contact is saturated.
    pub fn measure_with(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        calibration: &(impl StressCalibration<T> + ?Sized),
    ) -> Result<ForceMeasurement<T>, ForceError> {
        let found = self
            .detector
            .detect_with(&mut workspace.detector, frame, reference)?;
        let (Some(contact), Some(noise)) = (found.contact, found.noise) else {
            return Ok(ForceMeasurement::without_contact(found));
        };
        let profile = if self.skip_profile {
            None
        } else {
            self.profile(workspace, &contact, noise)
        };
        Ok(self.combine(found, contact, profile, calibration))
    }

    fn profile(
        &self,
        workspace: &mut ForceWorkspace,
        contact: &Contact<T>,
        noise: DifferenceNoise,
    ) -> Option<HertzFit<T>> {
        let place = workspace.detector.region.place?;
        let [x, y] = contact.centroid_px.map(|c| c.value.as_f64());
        let [hx, hy] = self.pixel_size_m.map(T::as_f64);
        let start = Start {
            centre: [x - place.column_start as f64, y - place.row_start as f64],
            radius: contact.equivalent_radius_px.as_f64() * (hy / hx).sqrt(),
            integral: contact.integrated_pixel_value.value.as_f64(),
        };
        self.fitter.fit_with(
            &mut workspace.rings,
            &workspace.detector.region,
            start,
            noise,
            [hx, hy],
        )
    }

    fn combine(
        &self,
        found: Detection<T>,
        contact: Contact<T>,
        profile: Option<HertzFit<T>>,
        calibration: &(impl StressCalibration<T> + ?Sized),
    ) -> ForceMeasurement<T> {
        let [hx, hy] = self.pixel_size_m;
        let pixel_area = hx * hy;
        let reading = calibration.read(contact.integrated_pixel_value);
        let radius = contact_radius(&contact, profile, pixel_area.sqrt());
        let step =
            calibration.stress_per_grey_level_pa(contact.integrated_pixel_value.value, pixel_area);
        let brightest = Estimate {
            value: contact.peak,
            standard_error: T::one(),
        };
        let peak = profile.map_or(brightest, |p| p.peak);
        ForceMeasurement {
            force_n: reading.force_n,
            reading: Some(reading),
            centroid_m: Some([
                contact.centroid_px[0].scaled(hx),
                contact.centroid_px[1].scaled(hy),
            ]),
            contact_area_m2: Some(T::nearest(contact.area_px as f64) * pixel_area),
            contact_radius_m: Some(radius),
            mean_stress_pa: Some(mean_stress(reading.force_n, radius)),
            peak_stress_pa: Some(peak.scaled(step)),
            contact: Some(contact),
            profile,
            statistics: found.statistics,
            drift: found.drift,
            noise: found.noise,
        }
    }
}

/// The profile's radius, else the mask's with half a pixel as its error; `side` is that of a square pixel of equal area.
fn contact_radius<T: Real>(
    contact: &Contact<T>,
    profile: Option<HertzFit<T>>,
    side: T,
) -> Estimate<T> {
    let half = T::nearest(0.5) * side;
    let of_mask = Estimate {
        value: contact.equivalent_radius_px * side,
        standard_error: half,
    };
    profile.map_or(of_mask, |p| p.radius_m)
}

/// F/(π a²) with its standard error.
fn mean_stress<T: Real>(force: Estimate<T>, radius: Estimate<T>) -> Estimate<T> {
    let pi = T::nearest(std::f64::consts::PI);
    let two = T::one() + T::one();
    let value = force.value / (pi * radius.value * radius.value);
    let relative = |e: Estimate<T>| e.standard_error / e.value;
    Estimate {
        value,
        standard_error: value * relative(force).hypot(two * relative(radius)),
    }
}

impl<T: Real> ForceMeasurement<T> {
    fn without_contact(found: Detection<T>) -> Self {
        Self {
            force_n: Estimate::default(),
            reading: None,
            contact: None,
            profile: None,
            centroid_m: None,
            contact_area_m2: None,
            contact_radius_m: None,
            mean_stress_pa: None,
            peak_stress_pa: None,
            statistics: found.statistics,
            drift: found.drift,
            noise: None,
        }
    }
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
pub fn measure_force<T: Real>(
    frame: ArrayView2<'_, u8>,
    reference: ArrayView2<'_, u8>,
    pixel_size_m: [T; 2],
    calibration: &(impl StressCalibration<T> + ?Sized),
    options: &ForceOptions,
) -> Result<ForceMeasurement<T>, ForceError> {
    let meter = ForceMeter::new(pixel_size_m, options)?;
    let reference = ReferenceFrame::new(reference)?;
    meter.measure_with(
        &mut ForceWorkspace::default(),
        frame,
        &reference,
        calibration,
    )
}
