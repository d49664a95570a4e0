//! The calibration of a sensor from presses under known forces.
use super::file::{Sensor, SensorGeometry};
use super::findings::{LayerFinding, PressFinding, SensorError};
use super::input::SensorCalibration;
use super::layers;
use super::target::find_dots;
use ndarray::{Array2, ArrayView2};
use tactile_imaging::force::{
    CalibrationFrame, ForceError, ForceMeter, ForceWorkspace, LensFit, LensGeometry, PressureCurve,
    PressureCurveOptions, ReferenceFrame,
};
use tactile_imaging::pipeline::ReferenceLight;

/// A calibrated sensor with the findings of its calibration, from
/// [`SensorCalibration::run`](super::SensorCalibration::run).
///
/// ```no_run
/// use tactile_files::sensor::{CalibratedSensor, SensorCalibration};
/// let found: CalibratedSensor = SensorCalibration::read("calibration.toml")?.run()?;
/// println!("{} of {} layers' parameters were identified",
///     found.layers.iter().filter(|layer| layer.identified).count(), found.layers.len());
/// # Ok::<(), tactile_files::sensor::SensorError>(())
/// ```
#[derive(Clone, Debug)]
pub struct CalibratedSensor {
    /// The sensor.
    pub sensor: Sensor,
    /// The lens as fitted to the target. `None` without a target.
    pub lens: Option<LensFit>,
    /// The findings for every press.
    pub presses: Vec<PressFinding>,
    /// The findings for every parameter of the layers.
    pub layers: Vec<LayerFinding>,
}

/// Relative error of a force beyond the gauge noise, from the noise of the frames and the smoothing
/// of the curve.
const CURVE_ERROR: f64 = 2e-3;

/// Largest force of the presses over that of later scenes: a gauge does not read round numbers.
const MOST_SHORT: f64 = 0.98;

/// Smallest number of presses that determine a curve.
const FEWEST_PRESSES: usize = 5;

/// A press that shows a contact.
struct Seen {
    press: usize,
    histogram: CalibrationFrame,
}

impl SensorCalibration {
    /// Fits the sensor.
    ///
    /// # Errors
    /// [`SensorError`]: one sentence. A press is named by its number.
    pub fn run(&self) -> Result<CalibratedSensor, SensorError> {
        // Each stage needs the previous one. Contacts need the lens, the curve needs the histograms
        // of contacts, and radii and forces of the presses need the curve.
        let reference = self.reference()?;
        let (geometry, lens) = self.geometry()?;
        let seen = self.contacts(&reference, &geometry.lens)?;
        let curve = self.curve(&seen)?;
        let mut presses = self.measured(&reference, &geometry.lens, &curve)?;
        let fitted = layers::fit(&self.layers, self.gauge_noise_n, &mut presses)?;
        let sensor = Sensor {
            date: self.date.clone(),
            temperature_c: self.temperature_c,
            flat_field: self.flat_field,
            gauge_error: self.gauge_error,
            coupling_error: self.coupling_error,
            layer_covariance: fitted.covariance_rows(),
            geometry,
            noise: reference.noise(),
            light: Some(ReferenceLight::of(&reference)),
            shear: self.shear,
            layers: fitted.layers.clone(),
            curve,
        };
        Ok(CalibratedSensor {
            layers: layers::findings(&self.layers, &fitted),
            sensor,
            lens,
            presses,
        })
    }

    fn reference(&self) -> Result<ReferenceFrame, SensorError> {
        let frames: Vec<ArrayView2<'_, u8>> = self.references.iter().map(|f| f.view()).collect();
        let reference = ReferenceFrame::from_frames(&frames).map_err(SensorError::Reference)?;
        if !self.flat_field {
            return Ok(reference);
        }
        reference.with_flat_field().map_err(SensorError::Reference)
    }

    /// The geometry from the target, or as stated.
    fn geometry(&self) -> Result<(SensorGeometry, Option<LensFit>), SensorError> {
        let shape = self.references.first().map_or((0, 0), Array2::dim);
        let frame_px = [shape.1, shape.0];
        // Without a target the lens is assumed free of distortion, with exact k₁ and k₂.
        let Some((frame, pitch_m, target_error)) = &self.target else {
            let (size, error) = self.pixel_size_m;
            let mut covariance = [[0.0; 4]; 4];
            for k in 0..2 {
                covariance[k][k] = (error * size[k]).powi(2);
            }
            let geometry = SensorGeometry {
                frame_px,
                covariance,
                target_error: 0.0,
                lens: LensGeometry::new(size).map_err(SensorError::Lens)?,
            };
            return Ok((geometry, None));
        };
        let dots = find_dots(frame.view(), *pitch_m)?;
        let fit = LensFit::from_dots(&dots, shape).map_err(SensorError::Lens)?;
        let geometry = SensorGeometry {
            frame_px,
            covariance: fit.covariance,
            target_error: *target_error,
            lens: fit.geometry,
        };
        Ok((geometry, Some(fit)))
    }

    fn meter(lens: &LensGeometry) -> Result<ForceMeter, SensorError> {
        ForceMeter::new(lens.pixel_size_m(), &Sensor::force_options())
            .map(|meter| meter.with_lens(*lens))
            .map_err(SensorError::Lens)
    }

    /// The histograms of all presses that show a contact.
    fn contacts(
        &self,
        reference: &ReferenceFrame,
        lens: &LensGeometry,
    ) -> Result<Vec<Seen>, SensorError> {
        let meter = Self::meter(lens)?;
        let mut workspace = ForceWorkspace::default();
        let mut seen = Vec::new();
        for (press, given) in self.presses.iter().enumerate() {
            let failed = |source: ForceError| SensorError::Press { press, source };
            let found = meter.detect_with(&mut workspace, given.frame.view(), reference);
            // A press too light to be seen has a row in the findings but is not used for the curve.
            let Some(contact) = found.map_err(failed)? else {
                continue;
            };
            let centre = contact.centroid_px.map(|c| c.value);
            // Distortion changes the area of a pixel from the centre to the edge.
            let area = lens.mean_pixel_area_m2(centre, contact.equivalent_radius_px);
            let Some(histogram) = workspace.grey_histogram(area) else {
                continue;
            };
            let histogram =
                CalibrationFrame::new(histogram, given.force_n, given.branch).map_err(failed)?;
            seen.push(Seen { press, histogram });
        }
        if seen.len() < FEWEST_PRESSES {
            return Err(SensorError::TooFewPresses {
                found: seen.len(),
                expected: FEWEST_PRESSES,
            });
        }
        self.covered(&seen)?;
        Ok(seen)
    }

    /// Refuses presses that do not cover the forces of later scenes.
    fn covered(&self, seen: &[Seen]) -> Result<(), SensorError> {
        let Some([least, greatest]) = self.covers_n else {
            return Ok(());
        };
        let forces = || seen.iter().map(|s| self.presses[s.press].force_n);
        let found = [
            forces().fold(f64::INFINITY, f64::min),
            forces().fold(0.0, f64::max),
        ];
        // The curve starts at the origin, so that it is valid somewhat below the least force.
        if found[0] <= 2.0 * least && found[1] >= MOST_SHORT * greatest {
            return Ok(());
        }
        Err(SensorError::NotCovered {
            found,
            expected: [least, greatest],
        })
    }

    fn curve(&self, seen: &[Seen]) -> Result<PressureCurve, SensorError> {
        let forces = seen.iter().map(|s| self.presses[s.press].force_n);
        let largest = forces.fold(0.0, f64::max);
        let frames: Vec<CalibrationFrame> = seen.iter().map(|s| s.histogram.clone()).collect();
        // The options take the noise as a share of the range, which may not be zero.
        let of_range = (self.gauge_noise_n / largest).max(1e-6);
        let curve = PressureCurveOptions::default()
            .with_force_error(CURVE_ERROR, of_range)
            .and_then(|options| PressureCurve::fit(&frames, &options))
            .map_err(SensorError::Curve)?;
        let report = &curve.report;
        // Noise of the frames adds a little to that of the gauge. A press whose force is wrong by a
        // tenth makes the ratio 20.
        if report.residual_sd > 5.0 {
            let size = |k: usize| report.residuals_n[k].abs();
            let worst = (0..seen.len()).max_by(|a, b| size(*a).total_cmp(&size(*b)));
            return Err(SensorError::Scatter {
                scatter: report.residual_sd,
                worst: worst.map_or(0, |k| seen[k].press),
            });
        }
        Ok(curve)
    }

    /// Force and contact radius of every press, from the curve.
    fn measured(
        &self,
        reference: &ReferenceFrame,
        lens: &LensGeometry,
        curve: &PressureCurve,
    ) -> Result<Vec<PressFinding>, SensorError> {
        let meter = Self::meter(lens)?;
        let mut workspace = ForceWorkspace::default();
        let mut findings = Vec::with_capacity(self.presses.len());
        for (press, given) in self.presses.iter().enumerate() {
            let found = meter
                .measure_with(&mut workspace, given.frame.view(), reference, curve)
                .map_err(|source| SensorError::Press { press, source })?;
            findings.push(PressFinding {
                indenter: given.indenter,
                branch: given.branch,
                force_n: given.force_n,
                integrated_pixel_value: found.contact.map(|c| c.integrated_pixel_value.value),
                read_force_n: found.contact.map(|_| found.force_n.total()),
                contact_radius_m: found.profile.map(|p| p.radius_m.total()),
                layers_force_n: None,
            });
        }
        Ok(findings)
    }
}
