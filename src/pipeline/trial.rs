//! A simulated press, measured blindly and laid beside its truth.
use super::choice::EstimatorChoice;
use super::composition::Pipeline;
use super::config::StagesConfig;
use super::error::PipelineError;
use super::object::Object;
use super::press::Press;
use crate::elasticity::contact::{Layer, Waveguide};
use crate::force::CalibrationPair;
use crate::simulate::{
    Branch, CalibrationOptions, ContactLaw, PressOptions, PressScene, PressSimulation,
    SimulateError, WaveguideLayer,
};

/// The truth of one simulated frame.
///
/// ```
/// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
/// # let camera = Camera::default().coarser(8);
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
/// use tactile_imaging::pipeline::FrameTruth;
/// let frames: Vec<FrameTruth> = trial.truth().frames;
/// assert_eq!(frames[0].force_n, 0.7);
/// // Hertz: the contact's radius grows as the cube root of the force.
/// let growth = frames[1].contact_radius_m / frames[0].contact_radius_m;
/// assert!((growth.powi(3) - 1.2 / 0.7).abs() < 1e-9);
/// assert!((frames[0].contact_ratio - frames[0].contact_radius_m / 3e-3).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct FrameTruth {
    /// Normal force in newtons.
    pub force_n: f64,
    /// Contact radius in metres.
    pub contact_radius_m: f64,
    /// Contact radius over the ball's.
    pub contact_ratio: f64,
    /// Intensity centroid (x, y) in pixels.
    pub centroid_px: [f64; 2],
    /// Approach of the bodies in metres.
    pub indentation_m: f64,
    /// Greatest height of the surface that the pressure is read as, in metres.
    pub surface_height_m: f64,
}

/// The truth of a simulated press.
///
/// ```
/// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
/// # let camera = Camera::default().coarser(8);
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
/// use tactile_imaging::pipeline::Truth;
/// let truth: Truth = trial.truth();
/// assert_eq!((truth.youngs_modulus_pa, truth.frames.len()), (103e3, 2));
/// // The apparent surface grows by s = (1.2/0.7)^⅓ in all directions.
/// let strain = truth.strain.expect("two frames");
/// let s = (1.2_f64 / 0.7).cbrt();
/// assert!((strain[2][2] - 0.5 * (s * s - 1.0)).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Truth {
    /// Young's modulus of the ball in pascals.
    pub youngs_modulus_pa: f64,
    /// The frames.
    pub frames: Vec<FrameTruth>,
    /// Green–Lagrange strain of the apparent surfaces between the first and the last frame, rows of the tensor.
    pub strain: Option<[[f64; 3]; 3]>,
}

/// A simulated press with the calibration of its sensor: the frames to measure and the truth to compare with.
///
/// ```
/// use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
/// // A coarse camera: 174 × 130 pixels on 30 mm.
/// let camera = Camera::default().coarser(8);
/// let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
/// let pipeline = trial.pipeline()?;
/// let modulus = trial.press(&pipeline)?.modulus()?;
/// assert!((modulus.youngs_modulus_pa / trial.truth().youngs_modulus_pa - 1.0).abs() < 0.0538);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Trial {
    /// The scene.
    pub scene: PressScene,
    /// Its frames and their truth.
    pub simulation: PressSimulation,
    /// What the calibration of this sensor with a gauge gave.
    pub pairs: Vec<CalibrationPair<f64>>,
}

impl Trial {
    /// Simulates a calibration series and the press itself.
    ///
    /// # Errors
    /// [`SimulateError`] for options that have no meaning.
    pub fn new(
        options: PressOptions,
        calibration: &CalibrationOptions,
    ) -> Result<Self, SimulateError> {
        let scene = PressScene::new(options)?;
        let series = scene.calibrate(calibration)?;
        let pair = |p: &crate::simulate::CalibrationPoint| match p.branch {
            Branch::Unloading => CalibrationPair::unloading(p.integrated_pixel_value, p.force_n),
            _ => CalibrationPair::loading(p.integrated_pixel_value, p.force_n),
        };
        let pairs = series.points.iter().map(pair).collect();
        let simulation = scene.simulate();
        Ok(Self {
            scene,
            simulation,
            pairs,
        })
    }

    /// The default pipeline for the simulated sensor: it knows the calibration, the pixel size, the ball's radius and the
    /// waveguide, and nothing of the truth. Where the scene obeys a closed form (Hertz, Tatara), the estimator is Hertz's with the layers in series
    /// ([`EstimatorChoice::Sphere`]), whose law the truth shares; where its contacts come from elsewhere, the default.
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
                ContactLaw::Hertz | ContactLaw::Tatara => EstimatorChoice::Sphere,
                _ => EstimatorChoice::default(),
            },
            ..StagesConfig::default()
        };
        pipeline.with_waveguide(waveguide).with_stages(&config)
    }

    /// The frames on a pipeline.
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

    /// The truth.
    pub fn truth(&self) -> Truth {
        let truth = &self.simulation.truth;
        let frame = |t: &crate::simulate::PressTruth| FrameTruth {
            force_n: t.contact.force_n,
            contact_radius_m: t.contact.contact_radius_m,
            contact_ratio: t.contact.contact_ratio(),
            centroid_px: t.centroid_px,
            indentation_m: t.contact.indentation_m,
            surface_height_m: t.contact.apparent_height_m(0.0),
        };
        let strain = (truth.len() > 1).then(|| {
            let e = truth[0]
                .scaling_to(&truth[truth.len() - 1])
                .green_lagrange_strain();
            std::array::from_fn(|r| std::array::from_fn(|c| e[(r, c)]))
        });
        Truth {
            youngs_modulus_pa: self.simulation.youngs_modulus_pa,
            frames: truth.iter().map(frame).collect(),
            strain,
        }
    }
}
