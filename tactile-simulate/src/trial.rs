//! A simulated press, measured blindly and compared with its truth.

use crate::{
    CalibrationRun, Camera, ContactModel, PressOptions, PressScene, PressSimulation, SimulateError,
    WaveguideLayer,
};
use tactile_imaging::elasticity::contact::{Layer, Waveguide};
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::pipeline::{EstimatorChoice, PipelineError, StagesConfig};
use tactile_imaging::{Object, Pipeline, Press};

/// A simulated press with the calibration of its sensor: the frames to be measured and the truth
/// for comparison.
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// let pipeline = trial.pipeline()?;
/// let modulus = trial.press(&pipeline)?.modulus()?;
/// assert!((modulus.youngs_modulus_pa / trial.simulation.youngs_modulus_pa - 1.0).abs() < 0.0538);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Trial {
    /// The scene.
    pub scene: PressScene,
    /// The frames with their truth.
    pub simulation: PressSimulation,
    /// Calibration pairs of this sensor with a gauge.
    pub pairs: Vec<CalibrationPair>,
}

impl Trial {
    /// Simulates a calibration series and the press itself. If the ball of the calibration
    /// saturates the camera, it is replaced by one of two, four, eight or sixteen times its radius.
    /// A gain that suits the low pressure of a large or soft object is too high for a small rigid
    /// ball.
    ///
    /// # Errors
    /// [`SimulateError`] for invalid options.
    pub fn new(options: PressOptions, calibration: &CalibrationRun) -> Result<Self, SimulateError> {
        let scene = PressScene::new(options)?;
        let calibration = scene.unsaturated(*calibration)?;
        let pairs = scene.calibrate(&calibration)?.pairs;
        let simulation = scene.simulate();
        Ok(Self {
            scene,
            simulation,
            pairs,
        })
    }

    /// The default press with a camera that has every `factor`-th pixel, which is fast enough for
    /// examples and tests. With a factor of 8, the paper's camera has 174 × 130 pixels on 30 mm.
    ///
    /// # Errors
    /// [`SimulateError`] for a factor that leaves no pixels.
    pub fn coarser(factor: usize) -> Result<Self, SimulateError> {
        let options = PressOptions {
            camera: Camera::default().coarser(factor),
            ..PressOptions::default()
        };
        Self::new(options, &CalibrationRun::default())
    }

    /// The default pipeline for the simulated sensor. It gets the exact calibration, pixel size,
    /// ball radius and waveguide, but no truth. If the scene follows a closed form (Hertz, Tatara),
    /// the estimator is Hertz's with the layers in series ([`EstimatorChoice::Sphere`]), the same
    /// law as the truth. For tabulated contacts it is the default estimator.
    ///
    /// # Errors
    /// [`PipelineError`].
    pub fn pipeline(&self) -> Result<Pipeline, PipelineError> {
        let options = self.scene.options();
        let layer = |l: &WaveguideLayer| Layer {
            thickness_m: l.thickness_m,
            youngs_modulus_pa: l.material.youngs_modulus_pa,
            poisson_ratio: l.material.poisson_ratio,
        };
        let layers = options.waveguide.layers.iter().map(layer).collect();
        let waveguide = Waveguide::new(layers).map_err(PipelineError::Material)?;
        let ball = options.object;
        let object = Object::Sphere {
            radius_m: ball.radius_m,
            poisson_ratio: ball.material.poisson_ratio,
        };
        let pipeline = Pipeline::from_pairs(&self.pairs, self.simulation.pixel_size_m, object)?;
        let config = StagesConfig {
            estimator: match options.law {
                ContactModel::Hertz | ContactModel::Tatara => EstimatorChoice::Sphere,
                _ => EstimatorChoice::default(),
            },
            ..StagesConfig::default()
        };
        pipeline
            .with_settings(|settings| {
                settings.waveguide = Some(waveguide);
                settings.state_exact();
            })?
            .with_stages(&config)
    }

    /// The frames as a press on a pipeline.
    ///
    /// # Errors
    /// [`PipelineError`].
    pub fn press(&self, pipeline: &Pipeline) -> Result<Press<'_>, PipelineError> {
        let mut press = pipeline.press(self.simulation.reference.view())?;
        for frame in &self.simulation.frames {
            press.add_frame(frame.view());
        }
        Ok(press)
    }
}
