//! What describes a press: object, waveguide, loads, light and camera.

use super::camera::Camera;
use super::contact_law::ContactLaw;
use super::error::{SimulateError, at_least, finite, not_negative, positive, within};
use super::light::{Illumination, Response};
use super::material::{Elastic, Sphere, Waveguide};

/// How many grey levels a pascal makes.
///
/// ```
/// use tactile_simulate::{Camera, Gain, Load, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let scene = |force_n, gain| {
///     PressScene::new(PressOptions { camera, gain, loads: vec![Load::normal(force_n)], ..Default::default() })
/// };
/// let first = scene(1.2, Gain::PeakGrey(200.0))?;
/// let peak_pa = first.truth(0).contact.peak_pressure_pa;
/// assert!((first.truth(0).grey_per_pascal * peak_pa - 200.0).abs() < 1e-9);
/// let same_sensor = scene(0.3, Gain::GreyPerPascal(first.truth(0).grey_per_pascal))?;
/// let light = |scene: &PressScene| scene.truth(0).integrated_pixel_value;
/// assert!((light(&first) / light(&same_sensor) - 4.0).abs() < 1e-9, "light in proportion to force");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Gain {
    /// The largest load's peak pressure lies so many grey levels above the background (before vignetting).
    PeakGrey(f64),
    /// Fixed: grey levels per pascal. Use it to share one calibration among scenes.
    GreyPerPascal(f64),
}

impl Gain {
    /// Grey levels per pascal in a scene whose brightest place shows the light of `largest_pa`; 0 where a peak is asked for and nothing is
    /// lit.
    pub(super) fn grey_per_pascal(self, largest_pa: f64) -> f64 {
        match self {
            Self::GreyPerPascal(gain) => gain,
            Self::PeakGrey(grey) if largest_pa > 0.0 => grey / largest_pa,
            Self::PeakGrey(_) => 0.0,
        }
    }

    pub(super) fn validate(self) -> Result<(), SimulateError> {
        match self {
            Self::PeakGrey(value) | Self::GreyPerPascal(value) => not_negative("gain", value),
        }
    }
}

/// One state of load.
///
/// ```
/// use tactile_simulate::{Camera, Load, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let loads = vec![Load::normal(0.7), Load { shear_n: [0.28, 0.0], ..Load::normal(0.7) }];
/// let scene = PressScene::new(PressOptions { camera, loads, ..PressOptions::default() })?;
/// let [x, sheared] = [0, 1].map(|k| scene.truth(k).centre_px[0]);
/// let moved_m = (sheared - x) * camera.pixel_size_m[0];
/// assert!((moved_m - 0.7e-3).abs() < 1e-12, "0.28 N over 400 N/m");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Load {
    /// Normal force in newton.
    pub force_n: f64,
    /// Shear force (x, y) in newton; it moves the contact by force over [`PressOptions::shear_stiffness_n_per_m`].
    pub shear_n: [f64; 2],
    /// Illumination, relative to the reference frame.
    pub illumination: Illumination,
}

impl Load {
    /// A normal force without shear, the illumination unchanged.
    pub fn normal(force_n: f64) -> Self {
        Self {
            force_n,
            shear_n: [0.0; 2],
            illumination: Illumination::default(),
        }
    }
}

/// Everything that describes a press; [`PressScene::new`](super::PressScene::new) checks it.
///
/// ```
/// use tactile_simulate::{Camera, Elastic, Load, PressOptions, PressScene, Sphere};
/// let options = PressOptions {
///     object: Sphere { radius_m: 20e-3, material: Elastic::CL2003X },
///     loads: vec![Load::normal(0.2), Load::normal(0.4)],
///     camera: Camera::default().coarser(16),
///     seed: 7,
///     ..PressOptions::default()
/// };
/// let made = PressScene::new(options.clone())?.simulate();
/// assert!(made.truth.iter().all(|t| t.contact.contact_radius_m < 0.3 * 20e-3), "inside Hertz's range");
/// assert_eq!(PressScene::new(options)?.simulate().frames, made.frames, "one seed, the same bits");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PressOptions {
    /// The object.
    pub object: Sphere,
    /// The waveguide.
    pub waveguide: Waveguide,
    /// Where pressure, radius and indentation at each force come from.
    pub law: ContactLaw,
    /// Loads, a frame each.
    pub loads: Vec<Load>,
    /// Centre (x, y) of the unsheared contact in pixels; the frame's middle if not given.
    pub centre_px: Option<[f64; 2]>,
    /// K_x, K_y of F_x = K_x u_x, F_y = K_y u_y in newton per metre.
    pub shear_stiffness_n_per_m: [f64; 2],
    /// Camera, lens, stray light.
    pub camera: Camera,
    /// Pressure → light.
    pub response: Response,
    /// Grey levels per pascal.
    pub gain: Gain,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for PressOptions {
    /// The paper's experiment (§5): a CL2000X sphere of 3 mm radius at 0.7 N and 1.2 N. The brightest pixel expected is
    /// 15 + 200 of 255 grey levels: 40 levels, twenty times its noise, are left before saturation.
    ///
    /// Hertz's a/R is 1.09 and 1.30 there, far outside small contact; for scenes inside Hertz's range, take a
    /// larger sphere or smaller loads.
    fn default() -> Self {
        Self {
            object: Sphere {
                radius_m: 3e-3,
                material: Elastic::CL2000X,
            },
            waveguide: Waveguide::default(),
            law: ContactLaw::Hertz,
            loads: vec![Load::normal(0.7), Load::normal(1.2)],
            centre_px: None,
            shear_stiffness_n_per_m: [400.0; 2],
            camera: Camera::default(),
            response: Response::Linear,
            gain: Gain::PeakGrey(200.0),
            seed: 1,
        }
    }
}

impl PressOptions {
    pub(super) fn validate(&self) -> Result<(), SimulateError> {
        self.object.validate()?;
        self.waveguide.validate()?;
        self.camera.validate()?;
        self.response.validate()?;
        self.law.validate()?;
        at_least("loads", self.loads.len(), 1)?;
        within("loads", self.loads.len() as f64, 1.0, 65534.0)?;
        for load in &self.loads {
            not_negative("force_n", load.force_n)?;
            load.illumination.validate()?;
            for k in 0..2 {
                finite("shear_n", load.shear_n[k])?;
                positive("shear_stiffness_n_per_m", self.shear_stiffness_n_per_m[k])?;
                finite("centre_px", self.centre_px.map_or(0.0, |c| c[k]))?;
            }
        }
        self.gain.validate()
    }
}
