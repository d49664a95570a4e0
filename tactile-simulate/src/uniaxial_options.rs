//! What describes the squeezed block: material, face, forces, light and camera.

use super::camera::Camera;
use super::error::{SimulateError, at_least, finite, not_negative, positive};
use super::material::Elastic;
use super::press_options::Gain;
use super::relief::{FaceOutline, SurfacePattern};

/// Everything that describes the squeezed block; [`UniaxialScene::new`](super::UniaxialScene::new) checks it.
///
/// ```
/// use tactile_simulate::{Camera, Elastic, UniaxialOptions, UniaxialScene};
/// let options = UniaxialOptions {
///     material: Elastic::CL2003X,
///     face_m: [10e-3, 14e-3],
///     forces_n: vec![0.1, 0.4],
///     camera: Camera::default().coarser(16),
///     ..UniaxialOptions::default()
/// };
/// let state = UniaxialScene::new(options)?.states()[1];
/// assert!((state.second_piola_zz_pa / state.strain_zz - 62e3).abs() < 1e-6, "Young's modulus");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct UniaxialOptions {
    /// What the block is made of.
    pub material: Elastic,
    /// Outline of the face.
    #[cfg_attr(feature = "serde", serde(default))]
    pub outline: FaceOutline,
    /// Sides of the undeformed face (x, y), or axes of its ellipse, in metres.
    pub face_m: [f64; 2],
    /// What its surface looks like.
    pub pattern: SurfacePattern,
    /// Forces in newton, a frame each; 0 shows no light.
    pub forces_n: Vec<f64>,
    /// Centre (x, y) of the face in pixels; the frame's middle if not given.
    pub centre_px: Option<[f64; 2]>,
    /// Camera, lens, stray light.
    pub camera: Camera,
    /// Grey levels per pascal.
    pub gain: Gain,
    /// Seed of noise and pattern.
    pub seed: u64,
}

impl Default for UniaxialOptions {
    /// A CL2000X block of 12 × 12 mm at 0.2, 0.7 and 1.2 N: compressed by 1, 5 and 9 %.
    fn default() -> Self {
        Self {
            material: Elastic::CL2000X,
            outline: FaceOutline::default(),
            face_m: [12e-3; 2],
            pattern: SurfacePattern::default(),
            forces_n: vec![0.2, 0.7, 1.2],
            centre_px: None,
            camera: Camera::default(),
            gain: Gain::PeakGrey(200.0),
            seed: 1,
        }
    }
}

impl UniaxialOptions {
    pub(super) fn validate(&self) -> Result<(), SimulateError> {
        self.material.validate()?;
        positive("youngs_modulus_pa", self.material.youngs_modulus_pa)?;
        self.pattern.validate()?;
        self.camera.validate()?;
        at_least("forces_n", self.forces_n.len(), 1)?;
        for &force in &self.forces_n {
            not_negative("force_n", force)?;
        }
        for k in 0..2 {
            positive("face_m", self.face_m[k])?;
            finite("centre_px", self.centre_px.map_or(0.0, |c| c[k]))?;
        }
        self.gain.validate()
    }
}
