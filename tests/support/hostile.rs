//! Scenes on which a measurement must end with a flag, an error or a value, and never a panic.

use ndarray::Array2;
use tactile_simulate::{
    Gain, Illumination, PressLoad, PressOptions, PressScene, PressSimulation, SimulateError,
};

/// The defect of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Hostile {
    /// There is no contact.
    NoiseOnly,
    /// Every pixel of frame and reference is 255.
    AllSaturated,
    /// Every pixel of frame and reference is 0.
    AllBlack,
    /// Only the contact is saturated.
    SaturatedContact,
    /// Three contacts in one frame. The truth lists them in the order of decreasing force.
    SeveralContacts,
    /// Half of the contact lies beyond the left edge of the frame.
    CutByEdge,
    /// Three quarters of the contact lie beyond a corner.
    InCorner,
    /// The contact is smaller than a pixel.
    SubPixelContact,
    /// The contact is larger than the frame.
    FillsFrame,
    /// The light has become 5 % brighter since the reference.
    BrighterLamps,
    /// The LEDs have moved: 10 % brighter on one side and darker on the other.
    MovedLamps,
    /// The object was in contact during the reference, and has been removed since.
    PressedReference,
}

impl Hostile {
    /// All kinds.
    pub(crate) const ALL: [Self; 12] = [
        Self::NoiseOnly,
        Self::AllSaturated,
        Self::AllBlack,
        Self::SaturatedContact,
        Self::SeveralContacts,
        Self::CutByEdge,
        Self::InCorner,
        Self::SubPixelContact,
        Self::FillsFrame,
        Self::BrighterLamps,
        Self::MovedLamps,
        Self::PressedReference,
    ];

    /// Reference, one frame and the truth of the scene, based on `base` (camera, object, waveguide,
    /// seed). Loads, gain and centre are replaced.
    pub(crate) fn simulate(self, base: &PressOptions) -> Result<PressSimulation, SimulateError> {
        let (options, force_n) = self.options(base)?;
        if self == Self::SeveralContacts {
            return several(&options, force_n);
        }
        let mut made = PressScene::new(options)?.simulate();
        match self {
            Self::AllBlack => {
                made.reference.fill(0);
                made.frames[0].fill(0);
            }
            Self::PressedReference => std::mem::swap(&mut made.reference, &mut made.frames[0]),
            _ => {}
        }
        Ok(made)
    }

    /// The options of the scene, and the force of its common contact, whose radius is a fifth of
    /// the shorter side of the frame.
    fn options(self, base: &PressOptions) -> Result<(PressOptions, f64), SimulateError> {
        let camera = base.camera;
        let middle = [camera.shape[1], camera.shape[0]].map(|n| (n as f64 - 1.0) / 2.0);
        let side = (camera.shape[0] as f64 * camera.pixel_size_m[1])
            .min(camera.shape[1] as f64 * camera.pixel_size_m[0]);
        let unit = PressScene::new(PressOptions {
            loads: vec![PressLoad::normal(1.0)],
            ..base.clone()
        })?;
        let unit_radius = unit.truth(0).contact.contact_radius_m;
        // F = 4E*a³/(3R).
        let force = |radius_m: f64| (radius_m / unit_radius).powi(3);
        let mut options = PressOptions {
            loads: vec![PressLoad::normal(force(0.2 * side))],
            centre_px: Some([middle[0] + 0.3, middle[1] - 0.2]),
            gain: Gain::PeakGrey(200.0),
            ..base.clone()
        };
        match self {
            Self::NoiseOnly => options.loads = vec![PressLoad::normal(0.0)],
            Self::AllSaturated => options.camera.background_grey = 1000.0,
            Self::AllBlack => options.loads[0].illumination.level = 0.0,
            Self::SaturatedContact => options.gain = Gain::PeakGrey(2000.0),
            Self::CutByEdge => options.centre_px = Some([-0.5, middle[1]]),
            Self::InCorner => options.centre_px = Some([-0.5, -0.5]),
            Self::SubPixelContact => {
                options.loads[0] = PressLoad::normal(force(0.3 * camera.pixel_size_m[0]))
            }
            Self::FillsFrame => options.loads[0] = PressLoad::normal(force(3.0 * side)),
            Self::BrighterLamps => options.loads[0].illumination.level = 1.05,
            Self::MovedLamps => options.loads[0].illumination.tilt = [0.2, 0.0],
            Self::SeveralContacts | Self::PressedReference => {}
        }
        Ok((options, force(0.2 * side)))
    }
}

/// Three contacts of decreasing force along a diagonal.
fn several(base: &PressOptions, force_n: f64) -> Result<PressSimulation, SimulateError> {
    let [rows, cols] = base.camera.shape.map(|n| n as f64);
    let mut scenes = Vec::new();
    let first = PressScene::new(base.clone())?;
    for (share, at) in [
        (0.3, [0.25, 0.3]),
        (0.15, [0.7, 0.35]),
        (0.05, [0.45, 0.75]),
    ] {
        let options = PressOptions {
            loads: vec![PressLoad::normal(share * force_n)],
            centre_px: Some([at[0] * cols, at[1] * rows]),
            gain: Gain::GreyPerPascal(first.truth(0).grey_per_pascal),
            ..base.clone()
        };
        scenes.push(PressScene::new(options)?);
    }
    let light = superposed(&first, &scenes)?;
    Ok(PressSimulation {
        reference: first.reference(0),
        frames: vec![base.camera.expose(light.view(), base.seed, 1)],
        truth: scenes.iter().map(|s| s.truth(0)).collect(),
        pixel_size_m: base.camera.pixel_size_m,
        youngs_modulus_pa: base.object.material.youngs_modulus_pa,
    })
}

/// Expected grey levels of the first loads of several scenes in one frame: their light above that
/// of the sensor alone is summed.
fn superposed(sensor: &PressScene, scenes: &[PressScene]) -> Result<Array2<f64>, SimulateError> {
    let free = PressScene::new(PressOptions {
        loads: vec![PressLoad {
            illumination: Illumination::default(),
            ..PressLoad::normal(0.0)
        }],
        gain: Gain::GreyPerPascal(sensor.truth(0).grey_per_pascal),
        ..sensor.options().clone()
    })?;
    let dark = free.expected_frame(0);
    let add = |sum: Array2<f64>, scene: &PressScene| sum + (scene.expected_frame(0) - &dark);
    Ok(scenes.iter().fold(dark.clone(), add))
}
