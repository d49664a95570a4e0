//! The first stage: from a frame to contact, force, centroid and radius.
use super::error::PipelineError;
use crate::core::StopReason;
use crate::force::{
    BoundingBox, Estimate, FaceReading, ForceError, ForceMeasurement, ForceWorkspace, LensGeometry,
    LineDoubt, LocalCalibration, Polarity, ProfileShape, ReferenceFrame, Uncertain,
};
use ndarray::{Array2, ArrayView2};
use std::f64::consts::PI;
use std::ops::Deref;
use std::sync::Arc;

/// A misfit below this fraction of the peak is that of a ball: blur, rounding to grey levels and the
/// depth of a guide give 0.2 %.
const LEAST_MISFIT: f64 = 0.01;

/// Relative error of the radius over the elongation. Misstated pixel sizes would make it one half,
/// but they contradict their stated error, and the caution names them. With one half the interval of
/// the modulus of an ellipsoid of 1.05 is seven times as wide as that of a ball
/// (`evidence/bench_faults.py PROGRAM ellipse`).
const OF_ELONGATION: f64 = 0.1;

/// Finds contact and force in one frame.
///
/// ```
/// use ndarray::ArrayView2;
/// use tactile_imaging::force::CalibrationPair;
/// use tactile_imaging::force::{Estimate, ForceError, ReferenceFrame};
/// use tactile_imaging::pipeline::{ContactStage, FrameContact, LightContact, Object, Pipeline};
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let hertz = |peak: f64| {
///     ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
///         let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
///         10 + (peak * (1.0 - d * d).sqrt()).round() as u8
///     })
/// };
/// /// The contact from its light, and a force of 0.98 N read from a spring scale.
/// struct OnScale(LightContact);
/// impl ContactStage for OnScale {
///     fn measure(
///         &self,
///         frame: ArrayView2<'_, u8>,
///         reference: &ReferenceFrame,
///     ) -> Result<FrameContact, ForceError> {
///         let mut contact = self.0.measure(frame, reference)?;
///         if let Some(reading) = &mut contact.reading {
///             reading.force_n = Some(Estimate::new(0.98, 1e-3).into());
///         }
///         Ok(contact)
///     }
///     fn pixel_size_m(&self) -> [f64; 2] {
///         self.0.pixel_size_m()
///     }
/// }
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// let stage = OnScale(LightContact::from_pairs(&pairs, [50e-6; 2])?);
/// // There is neither a lens nor a local curve: coordinates stay as they are, and shading is
/// // taken from the light.
/// assert!(stage.lens().is_none() && stage.pressure_curve().is_none());
/// let pipeline = Pipeline::new(stage, Object::sphere(3e-3))?;
/// let mut press = pipeline.press(reference.view())?;
/// press.add_frame(frame.view());
/// let force = press.contact(0)?.and_then(|c| c.force_n).expect("the scale's");
/// assert!(force.value == 0.98 && (force.standard_error() - 1e-3).abs() < 1e-15, "as given");
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
pub trait ContactStage: Send + Sync {
    /// The contact in `frame`, compared with `reference`. If the reading has no force, a gauge
    /// reading takes its place.
    ///
    /// # Errors
    /// [`ForceError`], such as a frame of another size or a saturated contact.
    fn measure(
        &self,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<FrameContact, ForceError>;

    /// The size of a pixel in metres, x and y. With a [`lens`](Self::lens) it is the size at the
    /// centre of distortion.
    fn pixel_size_m(&self) -> [f64; 2];

    /// Like [`measure`](Self::measure), with memory that a stream reuses from frame to frame.
    ///
    /// # Errors
    /// Those of [`measure`](Self::measure).
    fn measure_into(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        contact: &mut FrameContact,
    ) -> Result<(), ForceError> {
        let _ = workspace;
        *contact = self.measure(frame, reference)?;
        Ok(())
    }

    /// Whether forces are read from light, whose gain has errors beside those of the readings:
    /// [`Source::Gain`] and [`Source::Coupling`]. Forces of other stages have the errors that the
    /// stage gives them, and those of the two sources if they are stated.
    ///
    /// [`Source::Gain`]: crate::core::Source::Gain
    /// [`Source::Coupling`]: crate::core::Source::Coupling
    fn reads_light(&self) -> bool {
        false
    }

    /// Doubts about the pairs from which the forces follow.
    fn doubts(&self) -> &[LineDoubt] {
        &[]
    }

    /// See [`StressCalibration::unknown_hysteresis`](crate::force::StressCalibration::unknown_hysteresis).
    fn unknown_hysteresis(&self) -> f64 {
        0.0
    }

    /// Whether a contact is brighter or darker than the reference.
    fn polarity(&self) -> Polarity {
        Polarity::Brighter
    }

    /// The distorting lens, if there is one. It is used to undistort control points.
    fn lens(&self) -> Option<&LensGeometry> {
        None
    }

    /// The local curve from grey level to pressure, if there is one. Shading is then taken from
    /// pressures instead of light.
    fn pressure_curve(&self) -> Option<&dyn LocalCalibration> {
        None
    }

    /// A variant of the stage for objects with a flat face, if it saves work that only a ball's
    /// contact needs, such as the fit of its profile. The contact radius then follows from the area
    /// of the face.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{ContactStage, LightContact};
    /// let light = LightContact::gauged([50e-6; 2], &Default::default())?;
    /// assert!(light.for_flat_faces().is_some(), "without the fit of Hertz's profile");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    fn for_flat_faces(&self) -> Option<Arc<dyn ContactStage>> {
        None
    }
}

/// Implements the trait for boxed, shared and borrowed stages.
impl<P: Deref<Target: ContactStage> + Send + Sync> ContactStage for P {
    fn measure(
        &self,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<FrameContact, ForceError> {
        (**self).measure(frame, reference)
    }

    fn pixel_size_m(&self) -> [f64; 2] {
        (**self).pixel_size_m()
    }

    fn measure_into(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        contact: &mut FrameContact,
    ) -> Result<(), ForceError> {
        (**self).measure_into(workspace, frame, reference, contact)
    }

    fn reads_light(&self) -> bool {
        (**self).reads_light()
    }

    fn doubts(&self) -> &[LineDoubt] {
        (**self).doubts()
    }

    fn unknown_hysteresis(&self) -> f64 {
        (**self).unknown_hysteresis()
    }

    fn polarity(&self) -> Polarity {
        (**self).polarity()
    }

    fn lens(&self) -> Option<&LensGeometry> {
        (**self).lens()
    }

    fn pressure_curve(&self) -> Option<&dyn LocalCalibration> {
        (**self).pressure_curve()
    }

    fn for_flat_faces(&self) -> Option<Arc<dyn ContactStage>> {
        (**self).for_flat_faces()
    }
}

/// The contact of one frame.
///
/// ```
/// use tactile_imaging::pipeline::{ContactReading, Object, Pipeline};
/// use tactile_imaging::force::CalibrationPair;
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
///     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
///     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// });
/// // 1.005 N over a disc of 1 mm radius.
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// let mut press = pipeline.press(reference.view())?;
/// press.add_frame(frame.view());
/// let contact: ContactReading = *press.contact(0)?.expect("a contact");
/// assert!((contact.contact_radius_m.value / 1e-3 - 1.0).abs() < 0.01);
/// let force = contact.force_n.expect("a calibrated sensor");
/// assert!((force.value / 1.005 - 1.0).abs() < 0.01);
/// assert_eq!(contact.flags(0).count(), 0, "no caution");
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct ContactReading {
    /// Normal force in newtons. `None` if neither calibration nor gauge gives it.
    pub force_n: Option<Uncertain>,
    /// Contact radius in metres. For a flat face it is √(A/π), the radius of a disc of equal area.
    pub contact_radius_m: Uncertain,
    /// Indentation in metres. `None` if the sensor does not measure depth.
    pub indentation_m: Option<Estimate>,
    /// Centroid (x, y) in pixels.
    pub centroid_px: [Estimate; 2],
    /// Area of the contact in square metres.
    pub area_m2: f64,
    /// Largest signal: grey levels above (or below) the reference.
    pub peak_grey: f64,
    /// Stress at the centre of the contact in pascals. `None` without a calibration.
    pub peak_stress_pa: Option<Uncertain>,
    /// Whether an earlier frame of the press had a larger force, on a sensor that was calibrated
    /// with rising forces alone. The error of the force then contains the hysteresis.
    pub unknown_hysteresis: bool,
    /// Fraction of the contact's pixels that are saturated.
    pub saturated_share: f64,
    /// Whether the signal is outside the range of the calibration.
    pub out_of_calibration: bool,
    /// Whether the contact reaches the edge of the frame, so that part of it may be missing.
    pub touches_edge: bool,
    /// Number of other contacts in the frame. This one is the largest.
    pub other_contacts: usize,
    /// Whether the fit of the contact's profile converged. `true` without a fit.
    pub converged: bool,
    /// Misfit of the pressure profile, as a fraction of its peak. `None` if it is the profile of a
    /// ball's contact.
    pub profile_misfit: Option<f64>,
    /// Relative error of the radius from this misfit. A deviation along the radius moves the radius
    /// by about the same fraction. One around the centre, as under a slant, moves it in second
    /// order.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(super) misfit_doubt: f64,
    /// The contact as a flat face. `None` if the object cannot have one or the contact is too
    /// small.
    pub face: Option<FaceReading>,
    /// Longer over shorter half axis of the outline, minus one. `None` if the outline is round.
    pub elongation: Option<f64>,
    /// Deviation of the calibration pairs from a line at half scale, as a fraction of the full
    /// scale. `None` if it is not significant.
    pub calibration_bend: Option<f64>,
}

impl ContactReading {
    /// A round contact of this radius under this force, without cautions. The errors count as noise
    /// of the frame, and the peak is one grey level.
    ///
    /// ```
    /// use tactile_imaging::force::{Estimate, Source};
    /// use tactile_imaging::pipeline::ContactReading;
    /// let mut contact =
    ///     ContactReading::new(Some(Estimate::new(0.7, 2e-3)), Estimate::new(1e-3, 2e-6));
    /// contact.centroid_px = [Estimate::exact(120.0), Estimate::exact(80.0)];
    /// let force = contact.force_n.expect("as given");
    /// assert_eq!((force.part(Source::Noise), contact.touches_edge), (2e-3, false));
    /// ```
    #[must_use]
    pub fn new(force_n: Option<Estimate>, contact_radius_m: Estimate) -> Self {
        Self {
            force_n: force_n.map(Uncertain::from),
            contact_radius_m: contact_radius_m.into(),
            indentation_m: None,
            centroid_px: [Estimate::exact(0.0); 2],
            area_m2: PI * contact_radius_m.value.powi(2),
            peak_grey: 1.0,
            peak_stress_pa: None,
            unknown_hysteresis: false,
            saturated_share: 0.0,
            out_of_calibration: false,
            touches_edge: false,
            other_contacts: 0,
            converged: true,
            profile_misfit: None,
            misfit_doubt: 0.0,
            face: None,
            elongation: None,
            calibration_bend: None,
        }
    }

    /// F/(π a²) in pascals. `None` if the force is unknown.
    ///
    /// ```
    /// use tactile_imaging::{force::Estimate, pipeline::ContactReading};
    /// let contact = ContactReading::new(Some(Estimate::exact(0.5)), Estimate::exact(1e-3));
    /// let stress = contact.mean_stress_pa().expect("a force");
    /// assert!((stress.value / 159_155.0 - 1.0).abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn mean_stress_pa(&self) -> Option<Uncertain> {
        Some(self.force_n? / (self.contact_radius_m.powf(2.0) * PI))
    }

    /// The force that exceeds this contact's by two standard errors, if the force is below its
    /// error. The contact is then no load, and nothing else about it is worth a caution.
    ///
    /// ```
    /// use tactile_imaging::{force::Estimate, pipeline::ContactReading};
    /// let contact = |force| {
    ///     ContactReading::new(Some(Estimate::new(force, 1e-3)), Estimate::exact(1e-3))
    /// };
    /// assert_eq!(contact(-0.2e-3).no_force_n(), Some(1.8e-3));
    /// assert_eq!(contact(5e-3).no_force_n(), None);
    /// ```
    #[must_use]
    pub fn no_force_n(&self) -> Option<f64> {
        let force = self.force_n?.total();
        let below = force.value < force.standard_error;
        below.then_some(force.value + 2.0 * force.standard_error)
    }

    /// Relative changes of force and contact radius if the lens displaces the corners of a frame of
    /// this size (rows, columns) by 1 % of their distance, outwards to the middle, and this is not
    /// stated. A single frame does not show it. Sums that were calibrated under equal contacts have
    /// no change of the force. `None` for a contact whose frame or pixels have no size.
    ///
    /// ```
    /// use tactile_imaging::{force::Estimate, pipeline::ContactReading};
    /// let mut contact = ContactReading::new(Some(Estimate::exact(0.5)), Estimate::exact(1e-3));
    /// contact.centroid_px = [Estimate::exact(86.5), Estimate::exact(64.5)];
    /// // A contact that reaches half way to the corners, 108 pixels of 18.5 µm.
    /// let [force, radius] = contact.per_distortion((130, 174), [18.5e-6; 2]).expect("a frame");
    /// // r + 0.01 r³/S² has this slope and area.
    /// assert!((radius - 0.01 * 0.25).abs() < 1e-4);
    /// assert!((force - 0.01 * 4.0 * 0.4 * 0.25).abs() < 1e-4);
    /// ```
    #[must_use]
    pub fn per_distortion(
        &self,
        (rows, columns): (usize, usize),
        pixel_size_m: [f64; 2],
    ) -> Option<[f64; 2]> {
        let middle = [columns, rows].map(|n| 0.5 * (n as f64 - 1.0));
        let plain = LensGeometry::new(pixel_size_m).ok()?;
        let corner_px = middle[0].hypot(middle[1]);
        let lens = plain.with_distortion(middle, corner_px, [0.01, 0.0]).ok()?;
        let centre = self.centroid_px.map(|c| c.value);
        let [width, height] = pixel_size_m;
        let radius_px = self.contact_radius_m.value / (width * height).sqrt();
        let force = lens.mean_pixel_area_m2(centre, radius_px) / (width * height) - 1.0;
        let rim = lens.to_metres([centre[0] + radius_px, centre[1]]);
        let other = lens.to_metres([centre[0] - radius_px, centre[1]]);
        let radius = (rim[0] - other[0]) / (2.0 * radius_px * width) - 1.0;
        Some([force, radius])
    }

    /// The relative error of lengths that corresponds to a caution about the shape. An ellipse has
    /// the radius of a ball's contact to second order in its elongation.
    pub(super) fn shape_doubt(&self) -> f64 {
        let elongation = OF_ELONGATION * self.elongation.unwrap_or(0.0);
        let bend = self.calibration_bend.unwrap_or(0.0);
        elongation.hypot(self.misfit_doubt).hypot(bend)
    }

    /// Sets the radius to that of a disc with the area of the flat face.
    pub(super) fn take_area(&mut self, area_m2: Estimate) {
        self.area_m2 = area_m2.value;
        let area = Uncertain::from(area_m2) * PI.recip();
        self.contact_radius_m = area.powf(0.5);
    }

    /// The reading from a measured force. `None` without contact.
    pub(super) fn of_light(force: &ForceMeasurement) -> Option<Self> {
        let (contact, reading, radius) = (force.contact?, force.reading?, force.contact_radius_m?);
        let profile = force.profile;
        // An ellipse explains what varies around the centre.
        let round = force.elongation.is_none();
        let misfit = profile
            .filter(|p| p.shape == ProfileShape::NotHertz)
            .map(|p| {
                let around = if round { p.azimuthal_misfit } else { 0.0 };
                [p.radial_misfit, around]
            })
            .filter(|[along, around]| along.hypot(*around) > LEAST_MISFIT);
        Some(Self {
            force_n: Some(force.force_n),
            contact_radius_m: radius,
            centroid_px: contact.centroid_px,
            area_m2: force.contact_area_m2?,
            peak_grey: profile.map_or(contact.peak, |p| p.peak.value),
            peak_stress_pa: force.peak_stress_pa,
            saturated_share: contact.saturated_px as f64 / contact.area_px as f64,
            out_of_calibration: reading.out_of_range,
            touches_edge: contact.touches_edge,
            other_contacts: contact.other_contacts,
            converged: profile.is_none_or(|p| p.stop == StopReason::Converged),
            profile_misfit: misfit.map(|[along, around]| along.hypot(around)),
            misfit_doubt: misfit.map_or(0.0, |[along, around]| along.hypot(around * around)),
            elongation: force.elongation,
            ..Self::new(None, radius.total())
        })
    }
}

/// Result of the first stage: the reading, and the position of the contact in the frame.
///
/// ```
/// use tactile_imaging::force::ReferenceFrame;
/// use tactile_imaging::pipeline::{ContactStage, LightContact};
/// use tactile_imaging::force::CalibrationPair;
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
///     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
///     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// });
/// let stage = LightContact::from_pairs(&pairs, [50e-6; 2])?;
/// let reference = ReferenceFrame::new(hertz(0.0).view())?;
/// let contact = stage.measure(hertz(120.0).view(), &reference)?;
/// let region = contact.region.expect("a contact");
/// assert_eq!(contact.mask.dim(), (region.rows(), region.columns()));
/// assert!(region.row_start <= 12 && region.row_end >= 52, "20 pixels around row 32");
/// // Without contact: the difference of the light from the reference.
/// let contact = stage.measure(hertz(0.0).view(), &reference)?;
/// assert_eq!((contact.reading, contact.background_step_grey), (None, Some(0.0)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct FrameContact {
    /// The reading. `None` without contact.
    pub reading: Option<ContactReading>,
    /// The processed box: the contact with a margin of at least one pixel, except at the edge of
    /// the frame.
    pub region: Option<BoundingBox>,
    /// The contact's pixels within the box.
    pub mask: Array2<bool>,
    /// Frame minus reference in grey levels outside contacts: the mean of a frame without contact,
    /// otherwise the median outside the contact. `None` if it is unknown.
    pub background_step_grey: Option<f64>,
}

impl FrameContact {
    /// A contact whose pixels are the true ones of `mask`, an image as large as the frame. An empty
    /// mask means no contact.
    ///
    /// ```
    /// use tactile_imaging::{
    ///     force::Estimate,
    ///     pipeline::{ContactReading, FrameContact},
    /// };
    /// let mask =
    ///     ndarray::Array2::from_shape_fn((64, 64), |(r, c)| (20..40).contains(&r) && c > 50);
    /// let reading = ContactReading::new(None, Estimate::exact(1e-3));
    /// let contact = FrameContact::new(reading, mask.view());
    /// // A margin of one pixel.
    /// assert_eq!(contact.mask.dim(), (22, 14));
    /// assert!(FrameContact::new(reading, mask.mapv(|_| false).view()).reading.is_none());
    /// ```
    #[must_use]
    pub fn new(reading: ContactReading, mask: ArrayView2<'_, bool>) -> Self {
        let Some(bounds) = BoundingBox::of_mask(mask) else {
            return Self::default();
        };
        let region = bounds.grown(1, mask.dim());
        Self {
            reading: Some(reading),
            region: Some(region),
            mask: region.of(mask).to_owned(),
            background_step_grey: None,
        }
    }

    /// Number of pixels in the contact.
    pub(super) fn pixels(&self) -> usize {
        let count = |pixels: &[bool]| {
            // Sums over short runs fit in a byte, so that they vectorise well.
            let sum = |run: &[bool]| run.iter().map(|inside| u8::from(*inside)).sum::<u8>();
            pixels.chunks(128).map(|run| usize::from(sum(run))).sum()
        };
        match self.mask.as_slice() {
            Some(pixels) => count(pixels),
            None => self.mask.iter().filter(|inside| **inside).count(),
        }
    }

    /// The smallest box of the frame that contains the contact's pixels. `region` may be larger.
    pub(super) fn bounds(&self) -> Option<BoundingBox> {
        let region = self.region?;
        let bounds = BoundingBox::of_mask(self.mask.view())?;
        Some(BoundingBox {
            row_start: region.row_start + bounds.row_start,
            row_end: region.row_start + bounds.row_end,
            column_start: region.column_start + bounds.column_start,
            column_end: region.column_start + bounds.column_end,
        })
    }

    /// Rejects a mask that does not match its region, and a region that is not inside the frame,
    /// because a stage may be user-defined.
    pub(super) fn check(&self, frame: usize, image: (usize, usize)) -> Result<(), PipelineError> {
        let Some(at) = self.region else {
            return Ok(());
        };
        let ordered = at.row_start <= at.row_end && at.column_start <= at.column_end;
        let inside = ordered && at.row_end <= image.0 && at.column_end <= image.1;
        let mask = self.mask.dim();
        if inside && mask == (at.rows(), at.columns()) {
            return Ok(());
        }
        let region = (
            at.row_end.saturating_sub(at.row_start),
            at.column_end.saturating_sub(at.column_start),
        );
        Err(PipelineError::ContactMask {
            frame,
            mask,
            region,
            image,
        })
    }
}

/// Changes the shape of an array, reusing its memory if possible.
pub(super) fn resize<T: Clone + Default>(array: &mut Array2<T>, shape: (usize, usize)) {
    if array.dim() != shape {
        let (mut memory, _) = std::mem::take(array).into_raw_vec_and_offset();
        memory.clear();
        memory.resize(shape.0 * shape.1, T::default());
        if let Ok(resized) = Array2::from_shape_vec(shape, memory) {
            *array = resized;
        }
    }
}
