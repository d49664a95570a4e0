//! A sensor's calibration: presses under known forces, and a target.
mod guide;
mod reading;

use super::error::SensorError;
use super::file::{Sensor, SensorGeometry};
use super::findings::{CalibratedSensor, PressFinding};
use super::input::{Indenter, LayerInput};
use super::target::find_dots;
use crate::force::{
    Branch, CalibrationFrame, ContactDetector, ContactOptions, Detection, DetectorWorkspace,
    DriftCorrection, ForceError, ForceMeter, ForceWorkspace, LensFit, LensGeometry, PressureCurve,
    PressureCurveOptions, ReferenceFrame, ShearCalibration,
};
use guide::rows;
use ndarray::{Array2, ArrayView2};

/// A frame under a gauge's force.
///
/// ```
/// use tactile_imaging::force::Branch;
/// use tactile_imaging::sensor::{Indenter, SensorPress};
/// let press = SensorPress {
///     frame: ndarray::Array2::zeros((1042, 1392)),
///     force_n: 0.5,
///     branch: Branch::Loading,
///     indenter: Indenter::Ball { radius_m: 4e-3, radius_error_m: 5e-6 },
/// };
/// assert_eq!(press.frame.dim(), (1042, 1392));
/// ```
#[derive(Clone, Debug)]
pub struct SensorPress {
    /// The frame.
    pub frame: Array2<u8>,
    /// The gauge's force in newtons.
    pub force_n: f64,
    /// Whether the force was rising or falling.
    pub branch: Branch,
    /// What was pressed.
    pub indenter: Indenter,
}

/// What a sensor is calibrated from.
///
/// The curve f of P = f(I) comes from the grey histograms of the presses' contacts, F = Σ f(I) dS. The lens from a target; vignetting
/// from the reference itself. The layers' moduli from the contact radii of rigid balls. What the presses do not determine keeps the
/// value and the error that were stated.
///
/// ```no_run
/// use tactile_imaging::sensor::SensorCalibration;
/// let calibrated = SensorCalibration::read("calibration.toml")?.run()?;
/// for layer in calibrated.layers.iter().filter(|layer| !layer.identified) {
///     println!("layer {}: the presses do not tell its {}", layer.layer + 1, layer.parameter);
/// }
/// calibrated.sensor.write("sensor.toml")?;
/// # Ok::<(), tactile_imaging::sensor::SensorError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SensorCalibration {
    /// When, as the user writes it.
    pub date: String,
    /// Temperature in degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Frames without contact.
    pub references: Vec<Array2<u8>>,
    /// The presses.
    pub presses: Vec<SensorPress>,
    /// A frame of a target, the pitch of its dots in metres and that pitch's relative standard error.
    pub target: Option<(Array2<u8>, f64, f64)>,
    /// Size of a pixel in metres and its relative standard error: used without a target.
    pub pixel_size_m: ([f64; 2], f64),
    /// The layers as stated, from the object's side; empty: rigid.
    pub layers: Vec<LayerInput>,
    /// Whether frames are divided by the reference's own brightness.
    pub flat_field: bool,
    /// Relative standard error of the gauge, common to all presses.
    pub gauge_error: f64,
    /// Standard deviation of the gauge's noise in newtons.
    pub gauge_noise_n: f64,
    /// Springs of shear, passed on as they are.
    pub shear: Option<ShearCalibration>,
    /// Least and greatest force in newtons that scenes will have: presses that do not cover them are refused.
    pub covers_n: Option<[f64; 2]>,
}

/// Fewest presses with a contact.
const FEWEST_PRESSES: usize = 5;
/// Largest scatter of the forces about the curve over what the gauge explains. Noise of the frames adds a little. A press whose force
/// is wrong by a tenth makes it 20.
const LARGEST_SCATTER: f64 = 5.0;
/// What a force may be off by beside the gauge's noise: frames' noise and what the curve smooths over.
const CURVE_ERROR: f64 = 2e-3;
/// Relative error of contact radii that noise does not name: the profile of a guide that ends is not quite Hertz's.
const PROFILE_ERROR: f64 = 5e-4;

/// A press that shows a contact.
struct Seen {
    press: usize,
    histogram: CalibrationFrame,
}

impl SensorCalibration {
    /// Finds the sensor.
    ///
    /// # Errors
    /// [`SensorError`]: one sentence. A press is named by its number.
    pub fn run(&self) -> Result<CalibratedSensor, SensorError> {
        let reference = self.reference()?;
        let (geometry, lens) = self.geometry()?;
        let seen = self.contacts(&reference, &geometry.lens)?;
        let curve = self.curve(&seen)?;
        let mut presses = self.measured(&reference, &geometry.lens, &curve)?;
        let fitted = self.fit_layers(&mut presses)?;
        let sensor = Sensor {
            date: self.date.clone(),
            temperature_c: self.temperature_c,
            flat_field: self.flat_field,
            gauge_error: self.gauge_error,
            layer_covariance: match &fitted {
                Some(fit) => rows(fit),
                None => self.stated_covariance(),
            },
            geometry,
            noise: reference.noise(),
            shear: self.shear,
            layers: self.found_layers(fitted.as_ref()),
            curve,
        };
        Ok(CalibratedSensor {
            layers: self.layer_findings(fitted.as_ref()),
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

    /// From the target, or as stated.
    fn geometry(&self) -> Result<(SensorGeometry, Option<LensFit>), SensorError> {
        let shape = self.references.first().map_or((0, 0), Array2::dim);
        let frame_px = [shape.1, shape.0];
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

    /// The histograms of all presses that show a contact.
    fn contacts(
        &self,
        reference: &ReferenceFrame,
        lens: &LensGeometry,
    ) -> Result<Vec<Seen>, SensorError> {
        let options = ContactOptions::default().with_drift(DriftCorrection::Automatic);
        let detector = ContactDetector::new(options);
        let mut workspace = DetectorWorkspace::default();
        let mut seen = Vec::new();
        for (press, given) in self.presses.iter().enumerate() {
            let failed = |source: ForceError| SensorError::Press { press, source };
            let found: Detection = detector
                .detect_with(&mut workspace, given.frame.view(), reference)
                .map_err(failed)?;
            let Some(contact) = found.contact else {
                continue;
            };
            let centre = contact.centroid_px.map(|c| c.value);
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

    /// Refuses presses that leave out forces which scenes will have.
    fn covered(&self, seen: &[Seen]) -> Result<(), SensorError> {
        let Some([least, greatest]) = self.covers_n else {
            return Ok(());
        };
        let forces = || seen.iter().map(|s| self.presses[s.press].force_n);
        let found = [
            forces().fold(f64::INFINITY, f64::min),
            forces().fold(0.0, f64::max),
        ];
        // A curve that starts at the origin is known somewhat below the least force.
        if found[0] <= 2.0 * least && found[1] >= greatest {
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
        let of_range = (self.gauge_noise_n / largest).max(1e-6);
        let curve = PressureCurveOptions::default()
            .with_force_error(CURVE_ERROR, of_range)
            .and_then(|options| PressureCurve::fit(&frames, &options))
            .map_err(SensorError::Curve)?;
        let report = &curve.report;
        if report.residual_sd > LARGEST_SCATTER {
            let size = |k: usize| report.residuals_n[k].abs();
            let worst = (0..seen.len()).max_by(|a, b| size(*a).total_cmp(&size(*b)));
            return Err(SensorError::Scatter {
                scatter: report.residual_sd,
                worst: worst.map_or(0, |k| seen[k].press),
            });
        }
        Ok(curve)
    }

    /// Force and contact radius of every press, by the curve.
    fn measured(
        &self,
        reference: &ReferenceFrame,
        lens: &LensGeometry,
        curve: &PressureCurve,
    ) -> Result<Vec<PressFinding>, SensorError> {
        let meter = ForceMeter::new(lens.pixel_size_m(), &Sensor::force_options())
            .map_err(SensorError::Lens)?
            .with_lens(*lens);
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
                read_force_n: found.contact.map(|_| found.force_n.value),
                contact_radius_m: found.profile.map(|p| p.radius_m),
                layers_force_n: None,
            });
        }
        Ok(findings)
    }
}
