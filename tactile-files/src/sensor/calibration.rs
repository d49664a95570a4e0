//! The calibration of a sensor from presses under known forces, and its findings.
use super::file::{Sensor, SensorGeometry};
use super::input::{Indenter, SensorCalibration};
use super::layers;
use super::target::find_dots;
use crate::io::FileError;
use ndarray::{Array2, ArrayView2};
use tactile_imaging::force::{
    Branch, CalibrationFrame, ContactDetector, ContactOptions, Detection, DetectorWorkspace,
    DriftCorrection, Estimate, ForceError, ForceMeter, ForceWorkspace, LensFit, LensGeometry,
    PressureCurve, PressureCurveOptions, ReferenceFrame,
};
use tactile_imaging::pipeline::{PipelineError, ReferenceLight};

/// Why a sensor could not be calibrated, in one sentence. Presses are counted from 1 in the
/// sentences and from 0 in the fields.
///
/// ```
/// use tactile_files::sensor::SensorError;
/// let few = SensorError::TooFewPresses { found: 3, expected: 5 };
/// assert!(few.to_string().starts_with("3 presses with a contact and a force, at least 5 are"));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SensorError {
    /// A file cannot be read, used or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Too few presses.
    #[error(
        "{found} presses with a contact and a force, at least {expected} are needed to fit the \
         light-to-pressure curve"
    )]
    TooFewPresses {
        /// Presses that can be used.
        found: usize,
        /// How many are needed.
        expected: usize,
    },
    /// A press that should have one shows no contact, or cannot be measured.
    #[error("press {}: {source}", press + 1)]
    Press {
        /// The press.
        press: usize,
        /// What is wrong with it.
        source: ForceError,
    },
    /// A frame's reference cannot be used.
    #[error("the reference: {0}")]
    Reference(#[source] ForceError),
    /// The presses do not determine the curve.
    #[error("the presses do not determine the light-to-pressure curve: {0}")]
    Curve(#[source] ForceError),
    /// The curve leaves a scatter beyond what the gauge explains.
    #[error(
        "the forces scatter by {scatter:.1} times their stated error about the light-to-pressure \
         curve: check press {}, the worst",
        worst + 1
    )]
    Scatter {
        /// Standard deviation of the residuals over the stated errors.
        scatter: f64,
        /// The press with the largest residual.
        worst: usize,
    },
    /// The presses leave out forces that scenes will have.
    #[error(
        "the presses reach from {:.3} N to {:.3} N, but scenes will have {:.3} N to {:.3} N",
        found[0],
        found[1],
        expected[0],
        expected[1]
    )]
    NotCovered {
        /// Least and greatest force of the presses.
        found: [f64; 2],
        /// Those of the scenes.
        expected: [f64; 2],
    },
    /// The target's dots cannot be found or do not lie on a grid.
    #[error("the target: {found} dots on a grid, at least {expected} are needed")]
    Target {
        /// Dots with a place on the grid.
        found: usize,
        /// How many are needed.
        expected: usize,
    },
    /// The target's dots do not determine the lens.
    #[error("the target does not determine the lens: {0}")]
    Lens(#[source] ForceError),
    /// The contact radii do not go with the forces of a ball on these layers.
    #[error(
        "the contact radii under the ball of {radius_m:e} m do not fit layers of the stated errors \
         (off by {deviation:.1} standard errors): check the ball's radius and the forces"
    )]
    Radius {
        /// The ball's stated radius.
        radius_m: f64,
        /// How far off, in standard errors.
        deviation: f64,
    },
    /// Something cannot be built from what was fitted.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
}

/// What one press was found to be.
///
/// ```
/// use tactile_imaging::force::{Branch, Estimate};
/// use tactile_files::sensor::{Indenter, PressFinding};
/// let finding = PressFinding {
///     indenter: Indenter::Punch { radius_m: 2e-3 },
///     branch: Branch::Loading,
///     force_n: 0.5,
///     read_force_n: Some(0.503),
///     contact_radius_m: Some(Estimate::new(2.01e-3, 2e-6)),
///     layers_force_n: None,
/// };
/// assert!(finding.read_force_n.is_some_and(|read| (read / finding.force_n - 1.0).abs() < 0.01));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressFinding {
    /// What was pressed.
    pub indenter: Indenter,
    /// Rising or falling force.
    pub branch: Branch,
    /// The gauge's force in newtons.
    pub force_n: f64,
    /// The force read from the frame with the fitted curve. `None` where no contact is seen, and
    /// the press was not used.
    pub read_force_n: Option<f64>,
    /// The fitted contact radius.
    pub contact_radius_m: Option<Estimate>,
    /// The force that the fitted layers have at that radius. `None` for presses that the layers
    /// were not fitted to.
    pub layers_force_n: Option<f64>,
}

/// One parameter of a layer before and after the calibration.
///
/// ```
/// use tactile_files::sensor::LayerFinding;
/// use tactile_imaging::force::Estimate;
/// let modulus = LayerFinding {
///     layer: 0,
///     parameter: "youngs_modulus_pa",
///     stated: Estimate::new(120e3, 15e3),
///     fitted: Estimate::new(135e3, 3e3),
///     identified: true,
/// };
/// assert!(modulus.fitted.standard_error < 0.7 * modulus.stated.standard_error);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerFinding {
    /// The layer, counted from the object's side from 0.
    pub layer: usize,
    /// The field of the sensor file.
    pub parameter: &'static str,
    /// The user's statement.
    pub stated: Estimate,
    /// The estimate from the presses and the statement together.
    pub fitted: Estimate,
    /// Whether the presses determine it: its error fell below 0.7 times the stated one. A parameter
    /// that is not identified keeps its statement.
    pub identified: bool,
}

/// A calibrated sensor and how it was found. Made by
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
    /// The lens as the target showed it. `None` without a target.
    pub lens: Option<LensFit>,
    /// Every press.
    pub presses: Vec<PressFinding>,
    /// Every parameter of the layers.
    pub layers: Vec<LayerFinding>,
}

/// Relative error of a force beside the gauge's noise: the noise of the frames, and the smoothing
/// of the curve.
const CURVE_ERROR: f64 = 2e-3;

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
        // Each stage needs the one before: contacts need the lens, the curve needs their
        // histograms, and radii and forces of the presses need the curve.
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

    /// From the target, or as stated.
    fn geometry(&self) -> Result<(SensorGeometry, Option<LensFit>), SensorError> {
        let shape = self.references.first().map_or((0, 0), Array2::dim);
        let frame_px = [shape.1, shape.0];
        // Without a target the lens is taken as free of distortion, with an exact k₁ and k₂.
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
            // A press too light to be seen has a row in the findings, but no part in the curve.
            let Some(contact) = found.contact else {
                continue;
            };
            let centre = contact.centroid_px.map(|c| c.value);
            // Distortion changes the area of a pixel from the middle to the edge.
            let area = lens.mean_pixel_area_m2(centre, contact.equivalent_radius_px);
            let Some(histogram) = workspace.grey_histogram(area) else {
                continue;
            };
            let histogram =
                CalibrationFrame::new(histogram, given.force_n, given.branch).map_err(failed)?;
            seen.push(Seen { press, histogram });
        }
        // The fewest presses that determine a curve.
        let expected = 5;
        if seen.len() < expected {
            return Err(SensorError::TooFewPresses {
                found: seen.len(),
                expected,
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
        // The options take the noise as a share of the range, and none below its digits.
        let of_range = (self.gauge_noise_n / largest).max(1e-6);
        let curve = PressureCurveOptions::default()
            .with_force_error(CURVE_ERROR, of_range)
            .and_then(|options| PressureCurve::fit(&frames, &options))
            .map_err(SensorError::Curve)?;
        let report = &curve.report;
        // Noise of the frames adds a little to the gauge's. A press whose force is wrong by a tenth
        // makes the ratio 20.
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
                contact_radius_m: found.profile.map(|p| p.radius_m.total()),
                layers_force_n: None,
            });
        }
        Ok(findings)
    }
}
