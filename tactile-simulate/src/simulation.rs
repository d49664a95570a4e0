//! All frames of a scene with their truth.

use ndarray::Array2;

use super::press::PressScene;
use super::truth::PressTruth;

/// The frames of a scene and their truth.
///
/// ```
/// use tactile_simulate::{Camera, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let made = PressScene::new(PressOptions { camera, ..PressOptions::default() })?.simulate();
/// let sum = |frame: &ndarray::Array2<u8>| frame.iter().map(|&v| f64::from(v)).sum::<f64>();
/// let light = made.frames.iter().map(|frame| sum(frame) - sum(&made.reference)).collect::<Vec<_>>();
/// assert!((light[1] / light[0] / (1.2 / 0.7) - 1.0).abs() < 0.02, "light in proportion to force");
/// assert_eq!(made.youngs_modulus_pa, 103e3);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct PressSimulation {
    /// The frame without contact.
    pub reference: Array2<u8>,
    /// One frame per load.
    pub frames: Vec<Array2<u8>>,
    /// The truth of each frame.
    pub truth: Vec<PressTruth>,
    /// Size of a pixel in metres, x and y.
    pub pixel_size_m: [f64; 2],
    /// Young's modulus of the object in pascal: what a measurement should find.
    pub youngs_modulus_pa: f64,
}

impl PressScene {
    /// The frame without contact, and the frames and truth of every load.
    pub fn simulate(&self) -> PressSimulation {
        let loads = 0..self.options().loads.len();
        PressSimulation {
            reference: self.reference(0),
            frames: loads.clone().map(|k| self.frame(k, 0)).collect(),
            truth: loads.map(|k| self.truth(k)).collect(),
            pixel_size_m: self.options().camera.pixel_size_m,
            youngs_modulus_pa: self.options().object.material.youngs_modulus_pa,
        }
    }
}
