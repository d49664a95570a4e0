//! Calibration of the sensor: integrated pixel value against the force of a gauge, during loading
//! and unloading (Fig. 9).

use crate::camera::{Purpose, row_stream};
use crate::contact::ContactModel;
use crate::error::{SimulateError, not_negative, positive, within};
use crate::light::Illumination;
use crate::materials::{Elastic, ElasticSphere};
use crate::press::{PressLoad, PressScene};
use ndarray::Array2;
use rand_distr::{Distribution, StandardNormal};
use tactile_imaging::force::{Branch, CalibrationPair};

/// Maximum number of doublings of an indenter's radius: sixteen times the radius gives a sixth of
/// the pressure.
const DOUBLINGS: usize = 4;

/// Largest grey level of the camera.
const BRIGHTEST: f64 = 255.0;

/// Options of a calibration.
///
/// ```
/// use tactile_simulate::{CalibrationRun, Camera, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// let options = CalibrationRun { largest_force_n: 1.0, steps: 4, ..CalibrationRun::default() };
/// let forces = scene.calibrate(&options)?.true_forces_n;
/// assert_eq!(forces, [0.0, 0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25, 0.0]);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CalibrationRun {
    /// Object pressed on the sensor.
    pub indenter: ElasticSphere,
    /// Largest force in newtons.
    pub largest_force_n: f64,
    /// Number of equal steps from 0 to the largest force. Unloading takes as many.
    pub steps: usize,
    /// Standard deviation of the gauge reading in newtons.
    pub gauge_noise_n: f64,
    /// Hysteresis h. During unloading the light corresponds to a larger force F + 4·h·F_max·x(1 −
    /// x), with x = F/F_max. Here h is the largest difference between the branches as a fraction of
    /// the range. The paper found none.
    pub hysteresis: f64,
}

impl Default for CalibrationRun {
    /// A rigid sphere of 10 mm radius, 0 to 2 N and back in 20 steps each, 2 mN of gauge noise, and
    /// no hysteresis.
    fn default() -> Self {
        let indenter = ElasticSphere {
            radius_m: 10e-3,
            material: Elastic::RIGID,
        };
        Self {
            indenter,
            largest_force_n: 2.0,
            steps: 20,
            gauge_noise_n: 2e-3,
            hysteresis: 0.0,
        }
    }
}

/// A complete calibration.
///
/// ```
/// use tactile_simulate::{CalibrationRun, Camera, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let scene = PressScene::new(PressOptions {
///     camera,
///     ..PressOptions::default()
/// })?;
/// let series = scene.calibrate(&CalibrationRun {
///     steps: 8,
///     ..CalibrationRun::default()
/// })?;
/// let (light, force) = series.pairs.iter().fold((0.0, 0.0), |sum, p| {
///     (sum.0 + p.integrated_pixel_value, sum.1 + p.force_n)
/// });
/// let lens = 1.0 - camera.vignetting; // the maximum loss in the corners
/// let slope = force / light / series.newton_per_grey;
/// assert!((0.99..1.01 / lens).contains(&slope));
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct CalibrationSeries {
    /// Sum over the pixels of frame minus reference in 8-bit grey levels, and the noisy gauge
    /// reading, in the order of acquisition: loading, then unloading.
    pub pairs: Vec<CalibrationPair>,
    /// True force of each pair, in newtons.
    pub true_forces_n: Vec<f64>,
    /// Force over integrated pixel value in newtons, without noise. It is exact for a linear
    /// response.
    pub newton_per_grey: f64,
}

impl PressScene {
    /// Calibrates the sensor of the scene (waveguide, camera, light and gain) with another
    /// indenter. Each reading is the sum over a simulated frame. There is a single reference
    /// exposure.
    ///
    /// ```
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// use tactile_imaging::{Object, Pipeline};
    /// use tactile_simulate::{CalibrationRun, Camera, PressOptions, PressScene};
    /// let camera = Camera::default().coarser(16);
    /// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
    /// let series = scene.calibrate(&CalibrationRun { steps: 8, ..CalibrationRun::default() })?;
    /// let ball = Object::sphere(3e-3);
    /// let pipeline = Pipeline::from_pairs(&series.pairs, camera.pixel_size_m, ball)?;
    /// let (reference, frame) = (scene.reference(0), scene.frame(0, 0));
    /// let mut press = pipeline.press(reference.view())?;
    /// press.add_frame(frame.view());
    /// let force = press.contact(0)?.and_then(|contact| contact.force_n);
    /// assert!(force.is_some_and(|f| (f.value / 0.7 - 1.0).abs() < 0.03));
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// [`SimulateError::OutOfRange`] for an invalid option; [`SimulateError::CalibrationSaturates`]
    /// if the light of a pixel exceeds the range of the camera.
    pub fn calibrate(&self, options: &CalibrationRun) -> Result<CalibrationSeries, SimulateError> {
        options.validate()?;
        let (camera, seed) = (self.options().camera, self.options().seed);
        let dark = camera.compose(&[], &Illumination::default());
        let exposure = |light: ndarray::ArrayView2<'_, f64>, k: usize| -> f64 {
            let frame = camera.expose_for(Purpose::CalibrationFrames, light, seed, k as u64);
            frame.iter().map(|&v| u64::from(v)).sum::<u64>() as f64
        };
        let reference = exposure(dark.view(), 0);
        let mut gauge = row_stream(seed, Purpose::Gauge, 0, 0);
        let mut pairs = Vec::with_capacity(2 * options.steps + 1);
        let mut true_forces_n = Vec::with_capacity(2 * options.steps + 1);
        for (k, (branch, true_force_n)) in options.forces().enumerate() {
            let lit = options.lit_force_n(branch, true_force_n);
            let light = self.calibration_light(options.indenter, lit)?;
            if is_beyond_range(&light) {
                let force_n = true_force_n;
                return Err(SimulateError::CalibrationSaturates { force_n });
            }
            // Exposure 0 is the reference.
            let sum = exposure(light.view(), k + 1);
            let normal: f64 = StandardNormal.sample(&mut gauge);
            let force_n = true_force_n + options.gauge_noise_n * normal;
            pairs.push(CalibrationPair {
                integrated_pixel_value: sum - reference,
                force_n,
                branch,
            });
            true_forces_n.push(true_force_n);
        }
        Ok(CalibrationSeries {
            pairs,
            true_forces_n,
            newton_per_grey: camera.pixel_area_m2() / self.light.grey_per_pascal,
        })
    }

    /// The calibration with two, four, eight or sixteen times the radius of the indenter, if the
    /// given one saturates the camera. A gain that suits the low pressure of a large or soft object
    /// is too high for a small rigid ball.
    ///
    /// ```
    /// use tactile_simulate::{
    ///     CalibrationRun, Camera, Elastic, ElasticSphere, PressOptions, PressScene,
    /// };
    /// let camera = Camera::default().coarser(16);
    /// let object = ElasticSphere { radius_m: 20e-3, material: Elastic::CL2003X };
    /// let scene = PressScene::new(PressOptions { camera, object, ..PressOptions::default() })?;
    /// let given = CalibrationRun::default();
    /// assert!(scene.calibrate(&given).is_err());
    /// assert!(scene.calibrate(&scene.unsaturated(given)?).is_ok());
    /// # Ok::<(), tactile_simulate::SimulateError>(())
    /// ```
    ///
    /// # Errors
    /// [`SimulateError::OutOfRange`] for an invalid option; [`SimulateError::CalibrationSaturates`]
    /// if the largest indenter saturates too.
    pub fn unsaturated(
        &self,
        mut options: CalibrationRun,
    ) -> Result<CalibrationRun, SimulateError> {
        options.validate()?;
        // Light increases with the force on both branches.
        let force_n = options.largest_force_n;
        for _ in 0..=DOUBLINGS {
            if !is_beyond_range(&self.calibration_light(options.indenter, force_n)?) {
                return Ok(options);
            }
            options.indenter.radius_m *= 2.0;
        }
        Err(SimulateError::CalibrationSaturates { force_n })
    }

    /// The light of an indenter under a normal force.
    fn calibration_light(
        &self,
        indenter: ElasticSphere,
        force_n: f64,
    ) -> Result<Array2<f64>, SimulateError> {
        // A table is valid only for the object of the scene.
        let law = match &self.options().law {
            ContactModel::Tabulated(_) | ContactModel::FiniteElements => ContactModel::Hertz,
            closed_form => closed_form.clone(),
        };
        let press = self.with_object(indenter, law, vec![PressLoad::normal(force_n)])?;
        Ok(press.expected_frame(0))
    }
}

fn is_beyond_range(light: &Array2<f64>) -> bool {
    light.iter().any(|&grey| grey > BRIGHTEST)
}

impl CalibrationRun {
    /// Equal steps from zero up, and down to zero again.
    fn forces(&self) -> impl Iterator<Item = (Branch, f64)> {
        let (steps, largest) = (self.steps, self.largest_force_n);
        let force = move |k: usize| largest * k as f64 / steps as f64;
        let up = (0..=steps).map(move |k| (Branch::Loading, force(k)));
        up.chain((0..steps).rev().map(move |k| (Branch::Unloading, force(k))))
    }

    /// The force that determines the light.
    fn lit_force_n(&self, branch: Branch, force_n: f64) -> f64 {
        let x = force_n / self.largest_force_n;
        if branch == Branch::Loading {
            return force_n;
        }
        // The parabola vanishes at both ends, where the branches meet, and is largest in the
        // middle.
        force_n + 4.0 * self.hysteresis * self.largest_force_n * x * (1.0 - x)
    }

    fn validate(&self) -> Result<(), SimulateError> {
        self.indenter.validate()?;
        positive("largest_force_n", self.largest_force_n)?;
        within("steps", self.steps as f64, 1.0, 1e6)?;
        not_negative("gauge_noise_n", self.gauge_noise_n)?;
        // Above 1/4 the unloading branch would not be monotone.
        within("hysteresis", self.hysteresis, 0.0, 0.25)
    }
}
