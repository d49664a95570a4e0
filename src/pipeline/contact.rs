//! The first stage: one frame to contact, force, centroid and radius.
use super::error::PipelineError;
use crate::force::{
    BoundingBox, CalibrationOptions, CalibrationPair, Estimate, ForceError, ForceMeasurement, ForceMeter,
    ForceOptions, ForceWorkspace, LinearCalibration, Polarity, ReferenceFrame, StopReason, StressCalibration,
};
use ndarray::{Array2, ArrayView2};

/// What a frame says of its contact.
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
        let relative = (force.standard_error / force.value).hypot(2.0 * radius.standard_error / radius.value);
        Some(Estimate { value, standard_error: value.abs() * relative })
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
            converged: force.profile.is_none_or(|p| p.stop == StopReason::Converged),
        })
    }
}

/// What the first stage leaves behind: the reading, and where in the frame the contact is.
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

/// One frame to contact and force.
pub trait ContactStage: Send + Sync {
    /// Measures `frame` against `reference`. `gauge_n` is a gauge's reading of the force, if there was one.
    ///
    /// # Errors
    /// [`ForceError`], such as a frame of another size or a saturated contact.
    fn measure(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        gauge_n: Option<f64>,
        contact: &mut FrameContact,
    ) -> Result<(), ForceError>;

    /// Whether contact makes the frame brighter or darker.
    fn polarity(&self) -> Polarity;

    /// The size of a pixel in metres, x and y.
    fn pixel_size_m(&self) -> [f64; 2];
}

/// Light that leaks where an object presses: brightness is force, through a calibration.
#[derive(Clone, Debug)]
pub struct LightContact<C = LinearCalibration<f64>> {
    meter: ForceMeter<f64>,
    calibration: C,
    pixel_size_m: [f64; 2],
    polarity: Polarity,
}

impl LightContact {
    /// Fits a linear calibration to pairs.
    ///
    /// # Errors
    /// [`PipelineError::Calibration`] and [`PipelineError::Sensor`].
    pub fn from_pairs(pairs: &[CalibrationPair<f64>], pixel_size_m: [f64; 2]) -> Result<Self, PipelineError> {
        let calibration = LinearCalibration::fit(pairs, &CalibrationOptions::default())
            .map_err(PipelineError::Calibration)?;
        Self::new(calibration, pixel_size_m, &ForceOptions::default())
    }
}

impl<C: StressCalibration<f64>> LightContact<C> {
    /// With any calibration and options.
    ///
    /// # Errors
    /// [`PipelineError::Sensor`].
    pub fn new(
        calibration: C,
        pixel_size_m: [f64; 2],
        options: &ForceOptions,
    ) -> Result<Self, PipelineError> {
        let meter = ForceMeter::new(pixel_size_m, options).map_err(PipelineError::Sensor)?;
        Ok(Self { meter, calibration, pixel_size_m, polarity: options.contact.polarity })
    }

    /// The calibration.
    pub fn calibration(&self) -> &C {
        &self.calibration
    }
}

impl<C: StressCalibration<f64>> ContactStage for LightContact<C> {
    fn measure(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        _gauge_n: Option<f64>,
        contact: &mut FrameContact,
    ) -> Result<(), ForceError> {
        let force = self.meter.measure_with(workspace, frame, reference, &self.calibration)?;
        contact.reading = ContactReading::of_light(&force);
        contact.region = None;
        let pixels = frame.len().max(1) as f64;
        contact.background_step_grey =
            force.contact.is_none().then_some(force.statistics.sum as f64 / pixels);
        if contact.reading.is_some()
            && let Some((region, mask)) = workspace.mask()
        {
            contact.region = Some(region);
            resize(&mut contact.mask, mask.dim());
            contact.mask.zip_mut_with(&mask, |to, from| *to = *from == 1);
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
