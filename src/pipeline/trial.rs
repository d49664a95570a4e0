//! A simulated press, measured blindly and laid beside its truth.
use super::error::PipelineError;
use super::object::Object;
use super::press::Press;
use super::stages::Pipeline;
use crate::elasticity::contact::{Layer, Waveguide};
use crate::force::CalibrationPair;
use crate::simulate::{
    Branch, CalibrationOptions, PressOptions, PressScene, PressSimulation, SimulateError, WaveguideLayer,
};

/// The truth of one simulated frame.
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
    pub fn new(options: PressOptions, calibration: &CalibrationOptions) -> Result<Self, SimulateError> {
        let scene = PressScene::new(options)?;
        let series = scene.calibrate(calibration)?;
        let pair = |p: &crate::simulate::CalibrationPoint| match p.branch {
            Branch::Unloading => CalibrationPair::unloading(p.integrated_pixel_value, p.force_n),
            _ => CalibrationPair::loading(p.integrated_pixel_value, p.force_n),
        };
        let pairs = series.points.iter().map(pair).collect();
        let simulation = scene.simulate();
        Ok(Self { scene, simulation, pairs })
    }

    /// The default pipeline for the simulated sensor: it knows the calibration, the pixel size, the ball's radius and the
    /// waveguide, and nothing of the truth.
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
        let object = Object::Sphere { radius_m: ball.radius_m, poisson_ratio: ball.material.poisson_ratio };
        let pipeline = Pipeline::from_pairs(&self.pairs, self.simulation.pixel_size_m, object)?;
        Ok(pipeline.with_waveguide(waveguide))
    }

    /// The frames on a pipeline.
    ///
    /// # Errors
    /// [`PipelineError`].
    pub fn press<'a>(&'a self, stages: &'a dyn super::Stages) -> Result<Press<'a>, PipelineError> {
        let mut press = Press::new(stages, self.simulation.reference.view())?;
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
            let e = truth[0].scaling_to(&truth[truth.len() - 1]).green_lagrange_strain();
            std::array::from_fn(|r| std::array::from_fn(|c| e[(r, c)]))
        });
        Truth {
            youngs_modulus_pa: self.simulation.youngs_modulus_pa,
            frames: truth.iter().map(frame).collect(),
            strain,
        }
    }
}
