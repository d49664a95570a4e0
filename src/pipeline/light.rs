//! Contacts that let light leak: brightness measures force.
use super::contact::{ContactReading, ContactStage, FrameContact, resize};
use super::error::PipelineError;
use crate::force::{
    CalibrationPair, ForceError, ForceMeter, ForceOptions, ForceWorkspace, LensGeometry, LineDoubt,
    LinearCalibration, LocalCalibration, Polarity, ReferenceFrame, StressCalibration,
};
use ndarray::ArrayView2;
use std::sync::Arc;

/// Light that leaks where an object presses. A calibration converts brightness into force, or a
/// gauge gives the force.
///
/// ```
/// use tactile_imaging::force::{
///     CalibrationPair, Estimate, ForceOptions, LinearCalibration,
/// };
/// use tactile_imaging::pipeline::{LightContact, Object, Pipeline};
/// let hertz = |peak: f64| {
///     ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
///         let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
///         10 + (peak * (1.0 - d * d).sqrt()).round() as u8
///     })
/// };
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let line = LightContact::from_pairs(&pairs, [50e-6; 2])?;
/// // The same stage, with the contact radius from the mask instead of a fit.
/// let calibration = LinearCalibration::fit(&pairs)?;
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
/// // A radius from the mask has an error of half a pixel in twenty. E is proportional to a⁻³, so
/// // its error is 8 %.
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
    /// Doubts about the pairs to which a line was fitted.
    doubts: Vec<LineDoubt>,
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

    /// Like [`from_pairs`](Self::from_pairs), with options of the contact.
    ///
    /// # Errors
    /// [`PipelineError::Calibration`] and [`PipelineError::Sensor`].
    pub fn from_pairs_with(
        pairs: &[CalibrationPair],
        pixel_size_m: [f64; 2],
        options: &ForceOptions,
    ) -> Result<Self, PipelineError> {
        let calibration = LinearCalibration::fit(pairs).map_err(PipelineError::Calibration)?;
        Ok(Self {
            doubts: calibration.report().doubts.clone(),
            ..Self::new(calibration, pixel_size_m, options)?
        })
    }

    /// Creates the stage with any calibration and options.
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
            doubts: Vec::new(),
        })
    }

    /// Adds a distorting lens: contours and coordinates are undistorted, and areas are those
    /// covered by the pixels.
    ///
    /// ```
    /// use tactile_imaging::force::LensGeometry;
    /// use tactile_imaging::pipeline::{ContactStage, LightContact};
    /// let lens = LensGeometry::new([21.6e-6, 22e-6])?.with_distortion(
    ///     [695.5, 520.5],
    ///     869.0,
    ///     [0.03, 0.0],
    /// )?;
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

    /// Creates a stage without a calibration: the contact comes from the light, its force from the
    /// gauge
    /// ([`Press::add_gauged_frame`](crate::pipeline::Press::add_gauged_frame)).
    ///
    /// # Errors
    /// [`PipelineError::Sensor`].
    pub fn gauged(pixel_size_m: [f64; 2], options: &ForceOptions) -> Result<Self, PipelineError> {
        // Contact, radius and centroid do not depend on the calibration, so any line will do.
        let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(n, n));
        let any = LinearCalibration::fit(&pairs).map_err(PipelineError::Calibration)?;
        Ok(Self {
            force_from: ForceFrom::Gauge,
            ..Self::new(any, pixel_size_m, options)?
        })
    }
}

impl ContactStage for LightContact {
    fn reads_light(&self) -> bool {
        true
    }

    fn measure(
        &self,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<FrameContact, ForceError> {
        let mut contact = FrameContact::default();
        self.measure_into(
            &mut ForceWorkspace::default(),
            frame,
            reference,
            &mut contact,
        )?;
        Ok(contact)
    }

    fn measure_into(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        contact: &mut FrameContact,
    ) -> Result<(), ForceError> {
        let force =
            self.meter
                .measure_with(workspace, frame, reference, self.calibration.as_ref())?;
        let bend = self.doubts.iter().find_map(|doubt| match doubt {
            LineDoubt::Bend { departure } => Some(*departure),
            _ => None,
        });
        contact.reading = ContactReading::of_light(&force).map(|reading| ContactReading {
            calibration_bend: bend,
            ..reading
        });
        if let Some(reading) = &mut contact.reading
            && self.force_from == ForceFrom::Gauge
        {
            (reading.force_n, reading.peak_stress_pa) = (None, None);
            reading.out_of_calibration = false;
        }
        contact.region = None;
        let pixels = frame.len().max(1) as f64;
        contact.background_step_grey = force
            .contact
            .is_none()
            .then_some(force.difference_sum as f64 / pixels);
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

    fn unknown_hysteresis(&self) -> f64 {
        match self.force_from {
            ForceFrom::Calibration => self.calibration.unknown_hysteresis(),
            ForceFrom::Gauge => 0.0,
        }
    }

    fn doubts(&self) -> &[LineDoubt] {
        &self.doubts
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
