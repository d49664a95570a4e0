//! The input of a calibration: presses under known forces, a target, stated layers, and their file.
use crate::io::{
    FileError, FrameReader, beside, finite, length, modulus, not_negative, one_or_more, pixel_size,
    poisson_ratio, positive, positive_pair, read_frame, read_toml,
};
use crate::scene::{SceneLayer, refractive_index};
use ndarray::Array2;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use tactile_imaging::force::{Branch, ShearCalibration};
use tactile_imaging::pipeline::FrameSource;

/// An object that is pressed on the sensor for calibration.
///
/// ```
/// use tactile_files::sensor::Indenter;
/// let ball = Indenter::Ball { radius_m: 4e-3, radius_error_m: 5e-6 };
/// assert_ne!(ball, Indenter::Punch { radius_m: 4e-3 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Indenter {
    /// A rigid ball. The curve is fitted to the forces and the layers to the contact radii.
    Ball {
        /// Radius in metres.
        radius_m: f64,
        /// Standard error of the radius in metres.
        radius_error_m: f64,
    },
    /// A rigid flat punch. Only the curve is fitted to it, because its contact radius is constant.
    Punch {
        /// Radius in metres.
        radius_m: f64,
    },
    /// Any one body. Only the curve is fitted to it.
    Body,
}

/// A layer with the manufacturer's values and their standard errors, from which a calibration
/// starts.
///
/// ```
/// use tactile_files::{scene::SceneLayer, sensor::LayerInput};
/// let layer = SceneLayer {
///     refractive_index: 1.41,
///     thickness_m: 2e-3,
///     youngs_modulus_pa: 136e3,
///     poisson_ratio: 0.495,
/// };
/// let known = LayerInput {
///     layer,
///     thickness_error_m: 20e-6,
///     youngs_modulus_error_pa: 14e3,
///     poisson_ratio_error: 0.003,
/// };
/// assert!(known.youngs_modulus_error_pa / known.layer.youngs_modulus_pa > 0.1, "to a tenth");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerInput {
    /// The stated values.
    pub layer: SceneLayer,
    /// Standard error of the thickness in metres.
    pub thickness_error_m: f64,
    /// Standard error of Young's modulus in pascals.
    pub youngs_modulus_error_pa: f64,
    /// Standard error of Poisson's ratio.
    pub poisson_ratio_error: f64,
}

/// A frame under a known force.
///
/// ```
/// use tactile_imaging::force::Branch;
/// use tactile_files::sensor::{Indenter, SensorPress};
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
    /// The force of the gauge in newtons.
    pub force_n: f64,
    /// Whether the force was rising or falling.
    pub branch: Branch,
    /// The pressed object.
    pub indenter: Indenter,
}

/// The input of a sensor calibration.
///
/// The curve f in P = f(I) is fitted to the grey histograms of the contacts, F = Σ f(I) dS. The
/// lens comes from a target, the vignetting from the reference, and the moduli of the layers from
/// the contact radii of rigid balls. Parameters that the presses do not determine keep their stated
/// values and errors.
///
/// ```no_run
/// use tactile_files::sensor::SensorCalibration;
/// let calibrated = SensorCalibration::read("calibration.toml")?.run()?;
/// for layer in calibrated.layers.iter().filter(|layer| !layer.identified) {
///     println!("layer {}: its {} is not determined", layer.layer + 1, layer.parameter);
/// }
/// calibrated.sensor.write("sensor.toml")?;
/// # Ok::<(), tactile_files::sensor::SensorError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SensorCalibration {
    /// Date of the calibration, as the user writes it.
    pub date: String,
    /// Temperature in degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Frames without contact.
    pub references: Vec<Array2<u8>>,
    /// The presses.
    pub presses: Vec<SensorPress>,
    /// A frame of a target, the pitch of its dots in metres and the relative standard error of the
    /// pitch.
    pub target: Option<(Array2<u8>, f64, f64)>,
    /// Size of a pixel in metres and its relative standard error, used without a target.
    pub pixel_size_m: ([f64; 2], f64),
    /// The layers as stated, from the object's side, rigid if empty.
    pub layers: Vec<LayerInput>,
    /// Whether frames are divided by the reference's own brightness.
    pub flat_field: bool,
    /// Relative standard error of the gauge, common to all presses.
    pub gauge_error: f64,
    /// Relative standard error of the light that other objects couple, see
    /// [`Sensor`](super::Sensor).
    pub coupling_error: Option<f64>,
    /// Standard deviation of the gauge noise in newtons.
    pub gauge_noise_n: f64,
    /// Shear stiffnesses, which are copied to the sensor file.
    pub shear: Option<ShearCalibration>,
    /// Least and greatest force of later scenes in newtons. Presses that do not cover them are
    /// refused.
    pub covers_n: Option<[f64; 2]>,
}

impl SensorCalibration {
    /// Reads a calibration file and the images that it names.
    ///
    /// ```toml
    /// date = "2026-11-22"
    /// temperature_c = 22.5                # may be left out
    /// references = ["reference.png"]
    /// pixel_size_m = [21.55e-6, 21.55e-6] # without a target
    /// pixel_size_error = 1e-3             # relative
    /// flat_field = true                   # the default
    /// gauge_error = 1e-3                  # relative, common to all forces
    /// gauge_noise_N = 2e-3
    /// coupling_error = 0.0                # under a fixed diffusing skin, 0.12 if absent
    /// gravity_m_per_s2 = 9.81             # for masses, 9.80665 ± 0.15 % if absent
    /// covers_N = [0.1, 1.2]               # forces of later scenes, may be left out
    /// target = { image = "target.png", pitch_m = 1e-3, error = 5e-4 }
    ///
    /// [[presses]]
    /// image = "press_01.png"              # or a video, whose frames are averaged
    /// frames = [20, 40]                   # first and last frame of a video, all if absent
    /// force_N = 0.1                       # or mass_kg of a weight
    /// branch = "loading"                  # the default, or "unloading"
    /// # or indenter = { shape = "punch", radius_m = 2e-3 }, or none for any one body
    /// indenter = { shape = "ball", radius_m = 4e-3, radius_error_m = 5e-6 }
    ///
    /// [[layers]]                          # from the object's side to the glass
    /// refractive_index = 1.41
    /// thickness_m = 2e-3
    /// thickness_error_m = 20e-6
    /// youngs_modulus_pa = 1.36e5
    /// youngs_modulus_error_pa = 1.4e4
    /// poisson_ratio = 0.5
    /// poisson_ratio_error = 0.0
    /// ```
    ///
    /// # Errors
    /// [`FileError`]: one sentence with file and field.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FileError> {
        CalibrationFile::read(path.as_ref())
    }
}

/// The fields of a calibration file, unchecked.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationFile {
    date: String,
    #[serde(default, deserialize_with = "finite")]
    temperature_c: Option<f64>,
    #[serde(deserialize_with = "one_or_more")]
    references: Vec<PathBuf>,
    #[serde(default, deserialize_with = "pixel_size")]
    pixel_size_m: Option<[f64; 2]>,
    #[serde(default = "per_mille", deserialize_with = "not_negative")]
    pixel_size_error: f64,
    flat_field: Option<bool>,
    #[serde(default = "per_mille", deserialize_with = "not_negative")]
    gauge_error: f64,
    #[serde(default, deserialize_with = "not_negative")]
    coupling_error: Option<f64>,
    #[serde(default, rename = "gauge_noise_N", deserialize_with = "positive")]
    gauge_noise_n: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    gravity_m_per_s2: Option<f64>,
    #[serde(default, rename = "covers_N", deserialize_with = "positive_pair")]
    covers_n: Option<[f64; 2]>,
    target: Option<TargetTable>,
    #[serde(deserialize_with = "one_or_more")]
    presses: Vec<PressTable>,
    #[serde(default)]
    layers: Vec<LayerTable>,
}

/// Standard gravity, and the relative standard error of the local one: 9.78 to 9.83, evenly
/// distributed.
const GRAVITY_M_PER_S2: f64 = 9.80665;
const GRAVITY_ERROR: f64 = 1.5e-3;

/// Largest number of frames of a video that are references.
const MOST_REFERENCES: usize = 64;

/// The relative error of a size or a gauge if none is stated.
fn per_mille() -> f64 {
    1e-3
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TargetTable {
    image: PathBuf,
    #[serde(deserialize_with = "length")]
    pitch_m: f64,
    #[serde(default = "per_mille", deserialize_with = "not_negative")]
    error: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PressTable {
    image: PathBuf,
    /// First and last frame of a video, from 1.
    frames: Option<[usize; 2]>,
    #[serde(default, rename = "force_N", deserialize_with = "not_negative")]
    force_n: Option<f64>,
    #[serde(default, deserialize_with = "not_negative")]
    mass_kg: Option<f64>,
    #[serde(default = "loading", deserialize_with = "BranchName::deserialize")]
    branch: Branch,
    indenter: Option<IndenterTable>,
}

/// The branch if none is stated.
fn loading() -> Branch {
    Branch::Loading
}

#[derive(Deserialize)]
#[serde(remote = "Branch", rename_all = "lowercase")]
enum BranchName {
    Loading,
    Unloading,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct IndenterTable {
    shape: IndenterShape,
    #[serde(deserialize_with = "length")]
    radius_m: f64,
    #[serde(default, deserialize_with = "not_negative")]
    radius_error_m: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum IndenterShape {
    Ball,
    Punch,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LayerTable {
    #[serde(deserialize_with = "refractive_index")]
    refractive_index: f64,
    #[serde(deserialize_with = "length")]
    thickness_m: f64,
    #[serde(deserialize_with = "not_negative")]
    thickness_error_m: f64,
    #[serde(deserialize_with = "modulus")]
    youngs_modulus_pa: f64,
    #[serde(deserialize_with = "not_negative")]
    youngs_modulus_error_pa: f64,
    #[serde(deserialize_with = "poisson_ratio")]
    poisson_ratio: f64,
    #[serde(deserialize_with = "not_negative")]
    poisson_ratio_error: f64,
}

impl CalibrationFile {
    /// Not generic, so that the parser is compiled once, not again in every crate that reads.
    fn read(path: &Path) -> Result<SensorCalibration, FileError> {
        read_toml::<Self>(path)?.validate(path)
    }

    /// Reads the images and checks their sizes.
    fn validate(self, file: &Path) -> Result<SensorCalibration, FileError> {
        let image = |field: &str, name: &Path, size| {
            read_frame(file, field, &beside(file, name), None, size)
        };
        let mut references = Vec::new();
        for name in &self.references {
            match image("references", name, None) {
                Ok(frame) => references.push(frame),
                Err(error) => {
                    let range = [1, MOST_REFERENCES];
                    let found = video(&beside(file, name), range, |frame| {
                        references.push(frame.clone())
                    });
                    found.ok().filter(|frames| *frames > 0).ok_or(error)?;
                }
            }
        }
        // All images come from one camera and have one size.
        let size = references.first().map(Array2::dim);
        let mut presses = Vec::with_capacity(self.presses.len());
        for (k, table) in self.presses.iter().enumerate() {
            let field = format!("presses[{}].image", k + 1);
            let frame = match (table.frames, image(&field, &table.image, size)) {
                (None, Ok(frame)) => frame,
                (range, still) => {
                    let path = beside(file, &table.image);
                    let mean = mean_of_video(&path, range.unwrap_or([1, usize::MAX]), size);
                    match (still, mean) {
                        (_, Ok(mean)) => mean,
                        (Err(error), Err(_)) if range.is_none() => return Err(error),
                        (_, Err(reason)) => {
                            let field = format!("presses[{}].frames", k + 1);
                            return Err(FileError::field(file, &field, reason));
                        }
                    }
                }
            };
            let force_n = match (table.force_n, table.mass_kg) {
                (Some(force_n), None) => force_n,
                (None, Some(mass_kg)) => {
                    mass_kg * self.gravity_m_per_s2.unwrap_or(GRAVITY_M_PER_S2)
                }
                _ => {
                    let field = format!("presses[{}].force_N", k + 1);
                    let reason = "expected either force_N in newtons or mass_kg of a weight";
                    return Err(FileError::field(file, &field, reason));
                }
            };
            presses.push(SensorPress {
                frame,
                force_n,
                branch: table.branch,
                indenter: (table.indenter.as_ref()).map_or(Indenter::Body, IndenterTable::indenter),
            });
        }
        let target = match &self.target {
            None => None,
            Some(table) => Some((
                image("target.image", &table.image, None)?,
                table.pitch_m,
                table.error,
            )),
        };
        let pixel_size_m = match (self.pixel_size_m, &target) {
            (Some(size), _) => size,
            // The target gives the size.
            (None, Some(_)) => [1.0; 2],
            (None, None) => {
                let reason = "it is missing, expected two positive numbers, or a [target]";
                return Err(FileError::field(file, "pixel_size_m", reason));
            }
        };
        // Gravity that is not stated is an error that all weights share.
        let weights = self.presses.iter().any(|press| press.mass_kg.is_some());
        let gravity_error = match self.gravity_m_per_s2 {
            None if weights => GRAVITY_ERROR,
            _ => 0.0,
        };
        Ok(SensorCalibration {
            date: self.date,
            temperature_c: self.temperature_c,
            references,
            presses,
            target,
            pixel_size_m: (pixel_size_m, self.pixel_size_error),
            // Shear stiffnesses come from another experiment. The program adds them.
            shear: None,
            layers: self.layers.iter().map(LayerTable::layer).collect(),
            flat_field: self.flat_field.unwrap_or(true),
            gauge_error: self.gauge_error.hypot(gravity_error),
            coupling_error: self.coupling_error,
            gauge_noise_n: self.gauge_noise_n.unwrap_or(2e-3),
            covers_n: self.covers_n,
        })
    }
}

/// Calls a function with the frames of a video from the first to the last, counted from 1, and
/// returns their number.
fn video(
    path: &Path,
    [first, last]: [usize; 2],
    mut each: impl FnMut(&Array2<u8>),
) -> Result<usize, String> {
    let said = |error: &dyn std::fmt::Display| error.to_string();
    // The times of the frames are not used.
    let mut reader = FrameReader::open(path, 1.0).map_err(|error| said(&error))?;
    let (mut frame, mut found) = (Array2::default((0, 0)), 0);
    for number in 1..=last {
        if reader
            .next_frame(&mut frame)
            .map_err(|error| said(&error))?
            .is_none()
        {
            break;
        }
        if number >= first {
            each(&frame);
            found += 1;
        }
    }
    Ok(found)
}

/// The rounded mean of frames of a video.
fn mean_of_video(
    path: &Path,
    range: [usize; 2],
    size: Option<(usize, usize)>,
) -> Result<Array2<u8>, String> {
    let mut sum = Array2::<u32>::zeros(size.unwrap_or_default());
    let mut fits = true;
    let count = video(path, range, |frame| {
        fits &= frame.dim() == sum.dim();
        if fits {
            sum.zip_mut_with(frame, |sum, grey| *sum += u32::from(*grey));
        }
    })?;
    let name = path.display();
    match u32::try_from(count) {
        Ok(0) => Err(format!("{name} has no frames {} to {}", range[0], range[1])),
        _ if !fits => Err(format!(
            "the frames of {name} have another size than the reference"
        )),
        Ok(count) => Ok(sum.mapv(|sum| ((2 * sum + count) / (2 * count)) as u8)),
        Err(_) => Err(format!("{name} has too many frames")),
    }
}

impl IndenterTable {
    fn indenter(&self) -> Indenter {
        let radius_m = self.radius_m;
        match self.shape {
            IndenterShape::Ball => Indenter::Ball {
                radius_m,
                radius_error_m: self.radius_error_m,
            },
            IndenterShape::Punch => Indenter::Punch { radius_m },
        }
    }
}

impl LayerTable {
    fn layer(&self) -> LayerInput {
        LayerInput {
            layer: SceneLayer {
                refractive_index: self.refractive_index,
                thickness_m: self.thickness_m,
                youngs_modulus_pa: self.youngs_modulus_pa,
                poisson_ratio: self.poisson_ratio,
            },
            thickness_error_m: self.thickness_error_m,
            youngs_modulus_error_pa: self.youngs_modulus_error_pa,
            poisson_ratio_error: self.poisson_ratio_error,
        }
    }
}
