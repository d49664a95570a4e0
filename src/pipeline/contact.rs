//! The first stage: one frame to contact, force, centroid and radius.
use super::error::PipelineError;
use crate::force::{
    BoundingBox, CalibrationOptions, CalibrationPair, Estimate, ForceError, ForceMeasurement,
    ForceMeter, ForceOptions, ForceWorkspace, LinearCalibration, Polarity, ReferenceFrame,
    StopReason, StressCalibration,
};
use ndarray::{Array2, ArrayView2};
use std::sync::Arc;

/// What a frame says of its contact.
///
/// ```
/// use tactile_imaging::pipeline::{ContactReading, Object, Pipeline};
/// # use tactile_imaging::force::CalibrationPair;
/// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
/// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
/// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// # });
/// // 1.005 N over a disc of 1 mm radius.
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// let mut press = pipeline.press(reference.view())?;
/// press.add_frame(frame.view());
/// let contact: ContactReading = *press.contact(0)?.expect("a contact");
/// assert!((contact.contact_radius_m.value / 1e-3 - 1.0).abs() < 0.01);
/// let stress = contact.mean_stress_pa().expect("a force");
/// assert!((stress.value / 320e3 - 1.0).abs() < 0.02, "F/(π a²)");
/// assert_eq!(contact.flags(0).count(), 0, "nothing to caution of");
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ContactReading {
    /// Normal force in newtons; `None` where neither calibration nor gauge gives it.
    pub force_n: Option<Estimate<f64>>,
    /// The part of the force's error that comes from noise in the frames, in newtons.
    pub force_noise_n: f64,
    /// The part that comes from the calibration and is common to all frames, in newtons.
    pub force_calibration_n: f64,
    /// Contact radius in metres.
    pub contact_radius_m: Estimate<f64>,
    /// Indentation in metres, where the sensor measures depth.
    pub indentation_m: Option<Estimate<f64>>,
    /// Centroid (x, y) in pixels.
    pub centroid_px: [Estimate<f64>; 2],
    /// Area of the contact in square metres.
    pub area_m2: f64,
    /// Greatest signal: grey levels above (or below) the reference.
    pub peak_grey: f64,
    /// Share of the contact's pixels that are saturated.
    pub saturated_share: f64,
    /// The signal lies outside the range of the calibration.
    pub out_of_calibration: bool,
    /// The contact reaches the frame's edge: part of it may be missing.
    pub touches_edge: bool,
    /// Other contacts in the frame: this one is the largest.
    pub other_contacts: usize,
    /// Whether the fit of the contact's profile converged (no fit counts as converged).
    pub converged: bool,
}

impl ContactReading {
    /// F/(π a²) in pascals.
    pub fn mean_stress_pa(&self) -> Option<Estimate<f64>> {
        let (force, radius) = (self.force_n?, self.contact_radius_m);
        let value = force.value / (std::f64::consts::PI * radius.value * radius.value);
        let relative =
            (force.standard_error / force.value).hypot(2.0 * radius.standard_error / radius.value);
        Some(Estimate {
            value,
            standard_error: value.abs() * relative,
        })
    }

    /// The force is the gauge's.
    fn take_gauge(&mut self, gauge: Option<Estimate<f64>>) {
        self.force_n = gauge;
        self.force_noise_n = gauge.map_or(0.0, |gauge| gauge.standard_error);
        self.force_calibration_n = 0.0;
        self.out_of_calibration = false;
    }

    fn of_light(force: &ForceMeasurement<f64>) -> Option<Self> {
        let (contact, reading, radius) = (force.contact?, force.reading?, force.contact_radius_m?);
        Some(Self {
            force_n: Some(force.force_n),
            force_noise_n: reading.noise_n,
            force_calibration_n: reading.calibration_n,
            contact_radius_m: radius,
            indentation_m: None,
            centroid_px: contact.centroid_px,
            area_m2: force.contact_area_m2?,
            peak_grey: force.profile.map_or(contact.peak, |p| p.peak.value),
            saturated_share: contact.saturated_share(),
            out_of_calibration: reading.out_of_range,
            touches_edge: contact.touches_edge,
            other_contacts: contact.other_contacts,
            converged: force
                .profile
                .is_none_or(|p| p.stop == StopReason::Converged),
        })
    }
}

/// What the first stage leaves behind: the reading, and where in the frame the contact is.
///
/// ```
/// use tactile_imaging::force::{ForceWorkspace, ReferenceFrame};
/// use tactile_imaging::pipeline::{ContactStage, FrameContact, LightContact};
/// # use tactile_imaging::force::CalibrationPair;
/// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
/// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
/// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// # });
/// let stage = LightContact::from_pairs(&pairs, [50e-6; 2])?;
/// let reference = ReferenceFrame::new(hertz(0.0).view())?;
/// let (mut workspace, mut contact) = (ForceWorkspace::default(), FrameContact::default());
/// stage.measure(&mut workspace, hertz(120.0).view(), &reference, None, &mut contact)?;
/// let region = contact.region.expect("a contact");
/// assert_eq!(contact.mask.dim(), (region.rows(), region.columns()));
/// assert!(region.row_start <= 12 && region.row_end >= 52, "20 pixels around row 32");
/// // Without contact: how far the light is from the reference's.
/// stage.measure(&mut workspace, hertz(0.0).view(), &reference, None, &mut contact)?;
/// assert_eq!((contact.reading, contact.background_step_grey), (None, Some(0.0)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct FrameContact {
    /// The reading; `None` without contact.
    pub reading: Option<ContactReading>,
    /// The box worked on: the contact's, with a margin of at least one pixel (but at the frame's edge).
    pub region: Option<BoundingBox>,
    /// The contact's pixels within the box.
    pub mask: Array2<bool>,
    /// Mean of frame minus reference in grey levels, of a frame without contact; `None` with one, or where it is not known.
    pub background_step_grey: Option<f64>,
}

impl FrameContact {
    /// Number of the contact's pixels.
    pub(super) fn pixels(&self) -> usize {
        self.mask.iter().filter(|inside| **inside).count()
    }

    /// Gives up the saving of the contact's box: the mask is laid out over the whole frame.
    pub(super) fn widened(&self, (rows, columns): (usize, usize)) -> Self {
        let Some(region) = self.region else {
            return self.clone();
        };
        let mut mask = Array2::from_elem((rows, columns), false);
        for ((row, column), inside) in self.mask.indexed_iter() {
            mask[[region.row_start + row, region.column_start + column]] = *inside;
        }
        let region = Some(BoundingBox {
            row_start: 0,
            row_end: rows,
            column_start: 0,
            column_end: columns,
        });
        Self {
            reading: self.reading,
            region,
            mask,
            background_step_grey: self.background_step_grey,
        }
    }
}

/// One frame to contact and force.
///
/// ```
/// use ndarray::ArrayView2;
/// use tactile_imaging::force::{Estimate, ForceError, ForceWorkspace, Polarity, ReferenceFrame};
/// use tactile_imaging::pipeline::{ContactStage, FrameContact, LightContact, Object, Pipeline};
/// # use tactile_imaging::force::CalibrationPair;
/// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
/// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
/// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// # });
/// /// The contact by its light, the force by a gauge.
/// struct Gauged(LightContact);
/// impl ContactStage for Gauged {
///     fn measure(
///         &self, workspace: &mut ForceWorkspace, frame: ArrayView2<'_, u8>, reference: &ReferenceFrame,
///         gauge: Option<Estimate<f64>>, contact: &mut FrameContact,
///     ) -> Result<(), ForceError> {
///         self.0.measure(workspace, frame, reference, gauge, contact)?;
///         if let Some(reading) = &mut contact.reading {
///             reading.force_n = gauge;
///         }
///         Ok(())
///     }
///     fn polarity(&self) -> Polarity { self.0.polarity() }
///     fn pixel_size_m(&self) -> [f64; 2] { self.0.pixel_size_m() }
/// }
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// let pipeline = Pipeline::new(Gauged(LightContact::from_pairs(&pairs, [50e-6; 2])?), Object::sphere(3e-3))?;
/// let mut press = pipeline.press(reference.view())?;
/// press.add_gauged_frame(frame.view(), Some(Estimate { value: 0.98, standard_error: 1e-3 }));
/// assert_eq!(press.contact(0)?.and_then(|c| c.force_n).map(|f| f.value), Some(0.98));
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
pub trait ContactStage: Send + Sync {
    /// Measures `frame` against `reference`. `gauge` is a gauge's reading of the force, if there was one.
    ///
    /// # Errors
    /// [`ForceError`], such as a frame of another size or a saturated contact.
    fn measure(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        gauge: Option<Estimate<f64>>,
        contact: &mut FrameContact,
    ) -> Result<(), ForceError>;

    /// Whether contact makes the frame brighter or darker.
    fn polarity(&self) -> Polarity;

    /// The size of a pixel in metres, x and y.
    fn pixel_size_m(&self) -> [f64; 2];
}

impl<C: ContactStage + ?Sized> ContactStage for Box<C> {
    fn measure(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        gauge: Option<Estimate<f64>>,
        contact: &mut FrameContact,
    ) -> Result<(), ForceError> {
        (**self).measure(workspace, frame, reference, gauge, contact)
    }

    fn polarity(&self) -> Polarity {
        (**self).polarity()
    }

    fn pixel_size_m(&self) -> [f64; 2] {
        (**self).pixel_size_m()
    }
}

impl<C: ContactStage + ?Sized> ContactStage for Arc<C> {
    fn measure(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        gauge: Option<Estimate<f64>>,
        contact: &mut FrameContact,
    ) -> Result<(), ForceError> {
        (**self).measure(workspace, frame, reference, gauge, contact)
    }

    fn polarity(&self) -> Polarity {
        (**self).polarity()
    }

    fn pixel_size_m(&self) -> [f64; 2] {
        (**self).pixel_size_m()
    }
}

/// Light that leaks where an object presses: brightness is force, through a calibration, or the force is a gauge's.
///
/// ```
/// use tactile_imaging::force::{CalibrationOptions, CalibrationPair, Estimate, ForceOptions, LinearCalibration};
/// use tactile_imaging::pipeline::{LightContact, Object, Pipeline};
/// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
/// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
/// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// # });
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let line = LightContact::from_pairs(&pairs, [50e-6; 2])?;
/// // The same, with the contact's radius read off its mask instead of fitted.
/// let calibration = LinearCalibration::fit(&pairs, &CalibrationOptions::default())?;
/// let options = ForceOptions::default().without_profile();
/// let quick = LightContact::new(calibration, [50e-6; 2], &options)?;
/// // No calibration: a gauge is enough for force, contact and modulus.
/// let gauged = LightContact::gauged([50e-6; 2], &ForceOptions::default())?;
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// let mut moduli = Vec::new();
/// for contact in [line, quick, gauged] {
///     let mut press = Pipeline::new(contact, Object::sphere(3e-3))?.press(reference.view())?;
///     press.add_gauged_frame(frame.view(), Some(Estimate { value: 1.005, standard_error: 2e-3 }));
///     moduli.push(press.modulus()?.youngs_modulus_pa);
/// }
/// // A radius read off the mask is uncertain by half a pixel in twenty: E, which goes as a⁻³, by 8 %.
/// assert!(moduli.iter().all(|e| (e / moduli[0] - 1.0).abs() < 0.08));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct LightContact {
    meter: ForceMeter<f64>,
    calibration: Arc<dyn StressCalibration<f64>>,
    force_from: ForceFrom,
    pixel_size_m: [f64; 2],
    polarity: Polarity,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum ForceFrom {
    Calibration,
    Gauge,
}

impl LightContact {
    /// Fits a linear calibration to pairs.
    ///
    /// # Errors
    /// [`PipelineError::Calibration`] and [`PipelineError::Sensor`].
    pub fn from_pairs(
        pairs: &[CalibrationPair<f64>],
        pixel_size_m: [f64; 2],
    ) -> Result<Self, PipelineError> {
        let calibration = LinearCalibration::fit(pairs, &CalibrationOptions::default())
            .map_err(PipelineError::Calibration)?;
        Self::new(calibration, pixel_size_m, &ForceOptions::default())
    }

    /// With any calibration and options.
    ///
    /// # Errors
    /// [`PipelineError::Sensor`].
    pub fn new(
        calibration: impl StressCalibration<f64> + 'static,
        pixel_size_m: [f64; 2],
        options: &ForceOptions,
    ) -> Result<Self, PipelineError> {
        let meter = ForceMeter::new(pixel_size_m, options).map_err(PipelineError::Sensor)?;
        Ok(Self {
            meter,
            calibration: Arc::new(calibration),
            force_from: ForceFrom::Calibration,
            pixel_size_m,
            polarity: options.polarity(),
        })
    }

    /// Without a calibration: the contact from the light, its force from the gauge
    /// ([`Press::add_gauged_frame`](super::Press::add_gauged_frame)).
    ///
    /// # Errors
    /// [`PipelineError::Sensor`].
    pub fn gauged(pixel_size_m: [f64; 2], options: &ForceOptions) -> Result<Self, PipelineError> {
        // Contact, radius and centroid do not depend on the calibration: any line serves.
        let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(n, n));
        let any = LinearCalibration::fit(&pairs, &CalibrationOptions::default())
            .map_err(PipelineError::Calibration)?;
        Ok(Self {
            force_from: ForceFrom::Gauge,
            ..Self::new(any, pixel_size_m, options)?
        })
    }
}

impl ContactStage for LightContact {
    fn measure(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        gauge: Option<Estimate<f64>>,
        contact: &mut FrameContact,
    ) -> Result<(), ForceError> {
        let force =
            self.meter
                .measure_with(workspace, frame, reference, self.calibration.as_ref())?;
        contact.reading = ContactReading::of_light(&force);
        if let Some(reading) = &mut contact.reading
            && self.force_from == ForceFrom::Gauge
        {
            reading.take_gauge(gauge);
        }
        contact.region = None;
        let pixels = frame.len().max(1) as f64;
        contact.background_step_grey = force
            .contact
            .is_none()
            .then_some(force.statistics.sum as f64 / pixels);
        if contact.reading.is_some()
            && let Some((region, mask)) = workspace.mask()
        {
            contact.region = Some(region);
            resize(&mut contact.mask, mask.dim());
            contact
                .mask
                .zip_mut_with(&mask, |to, from| *to = *from == 1);
        }
        Ok(())
    }

    fn polarity(&self) -> Polarity {
        self.polarity
    }

    fn pixel_size_m(&self) -> [f64; 2] {
        self.pixel_size_m
    }
}

/// Gives an array a shape, keeping its memory where it is large enough.
pub(crate) fn resize<T: Clone + Default>(array: &mut Array2<T>, shape: (usize, usize)) {
    if array.dim() != shape {
        let (mut memory, _) = std::mem::take(array).into_raw_vec_and_offset();
        memory.clear();
        memory.resize(shape.0 * shape.1, T::default());
        if let Ok(resized) = Array2::from_shape_vec(shape, memory) {
            *array = resized;
        }
    }
}
