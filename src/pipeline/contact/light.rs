//! Contacts that let light out: brightness is force.
use super::{ContactReading, ContactStage, FrameContact, bend, resize};
use crate::force::{
    CalibrationOptions, CalibrationPair, Estimate, ForceError, ForceMeter, ForceOptions,
    ForceWorkspace, LensGeometry, LinearCalibration, LocalCalibration, Polarity, ReferenceFrame,
    StressCalibration,
};
use crate::pipeline::error::PipelineError;
use ndarray::ArrayView2;
use std::sync::Arc;

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
///     press.add_gauged_frame(frame.view(), Some(Estimate::new(1.005, 2e-3)));
///     moduli.push(press.modulus()?.youngs_modulus_pa);
/// }
/// // A radius read off the mask is uncertain by half a pixel in twenty: E, which goes as a⁻³, by 8 %.
/// assert!(moduli.iter().all(|e| (e / moduli[0] - 1.0).abs() < 0.08));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct LightContact {
    meter: ForceMeter,
    calibration: Arc<dyn StressCalibration>,
    force_from: ForceFrom,
    pixel_size_m: [f64; 2],
    polarity: Polarity,
    lens: Option<LensGeometry>,
    /// Of the pairs that a line was fitted to.
    calibration_bend: Option<f64>,
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
        pairs: &[CalibrationPair],
        pixel_size_m: [f64; 2],
    ) -> Result<Self, PipelineError> {
        Self::from_pairs_with(pairs, pixel_size_m, &ForceOptions::default())
    }

    /// [`from_pairs`](Self::from_pairs) with options of the contact.
    pub(crate) fn from_pairs_with(
        pairs: &[CalibrationPair],
        pixel_size_m: [f64; 2],
        options: &ForceOptions,
    ) -> Result<Self, PipelineError> {
        let calibration = LinearCalibration::fit(pairs, &CalibrationOptions::default())
            .map_err(PipelineError::Calibration)?;
        Ok(Self {
            calibration_bend: bend::of(pairs),
            ..Self::new(calibration, pixel_size_m, options)?
        })
    }

    /// With any calibration and options.
    ///
    /// # Errors
    /// [`PipelineError::Sensor`].
    pub fn new(
        calibration: impl StressCalibration + 'static,
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
            lens: None,
            calibration_bend: None,
        })
    }

    /// Behind a lens that distorts: contours and coordinates are undistorted, areas are those that the pixels cover.
    ///
    /// ```
    /// use tactile_imaging::force::LensGeometry;
    /// use tactile_imaging::pipeline::{ContactStage, LightContact};
    /// let lens = LensGeometry::new([21.6e-6, 22e-6])?.with_distortion([695.5, 520.5], 869.0, [0.03, 0.0])?;
    /// let contact = LightContact::gauged([21e-6; 2], &Default::default())?.with_lens(lens);
    /// assert_eq!(contact.pixel_size_m(), [21.6e-6, 22e-6]);
    /// assert_eq!(contact.lens(), Some(&lens));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_lens(mut self, lens: LensGeometry) -> Self {
        self.meter = self.meter.with_lens(lens);
        self.pixel_size_m = lens.pixel_size_m();
        self.lens = Some(lens);
        self
    }

    /// Without a calibration: the contact from the light, its force from the gauge
    /// ([`Press::add_gauged_frame`](crate::pipeline::Press::add_gauged_frame)).
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
        gauge: Option<Estimate>,
        contact: &mut FrameContact,
    ) -> Result<(), ForceError> {
        let force =
            self.meter
                .measure_with(workspace, frame, reference, self.calibration.as_ref())?;
        contact.reading = ContactReading::of_light(&force).map(|reading| ContactReading {
            calibration_bend: self.calibration_bend,
            ..reading
        });
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
            && let Some((region, mask)) = workspace.detector.mask()
        {
            contact.region = Some(region);
            resize(&mut contact.mask, mask.dim());
            match (contact.mask.as_slice_mut(), mask.as_slice()) {
                // Slices, which do not overlap, turn into wide instructions.
                (Some(to), Some(from)) => {
                    to.iter_mut()
                        .zip(from)
                        .for_each(|(to, from)| *to = *from == 1);
                }
                _ => contact
                    .mask
                    .zip_mut_with(&mask, |to, from| *to = *from == 1),
            }
        }
        Ok(())
    }

    fn polarity(&self) -> Polarity {
        self.polarity
    }

    fn pixel_size_m(&self) -> [f64; 2] {
        self.pixel_size_m
    }

    fn lens(&self) -> Option<&LensGeometry> {
        self.lens.as_ref()
    }

    fn pressure_curve(&self) -> Option<&dyn LocalCalibration> {
        self.calibration.local()
    }

    fn for_flat_faces(&self) -> Option<Arc<dyn ContactStage>> {
        Some(Arc::new(Self {
            meter: self.meter.clone().without_profile(),
            ..self.clone()
        }))
    }
}
