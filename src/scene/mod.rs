//! Scene files: a user's own frames, and all that is needed to measure them, in one TOML file.
//!
//! ```toml
//! reference = "reference.png"            # the sensor without contact
//! pixel_size_m = [21.55e-6, 21.55e-6]    # x, y, on the sensing surface
//!
//! [calibration]                          # one of the two; not needed where every frame has its force_N
//! pairs = "calibration.csv"              # columns integrated_pixel_value,force_N
//! # depth_table = "depth.csv"            # columns darkness_grey_levels,depth_mm
//!
//! [[frames]]
//! image = "frame_1.png"
//! force_N = 0.70                         # a gauge reading, if there is one
//! force_error_N = 0.002                  # its standard error; without, that of the force scale alone (0.1 %)
//! time_s = 0.5                           # since the object touched, not decreasing: five tell a relaxing sample from a drifting sensor
//!
//! [[frames]]
//! image = "frame_2.png"
//!
//! [object]
//! shape = "sphere"                       # or "block", "cylinder" (a flat face, squeezed; no size), "flat_punch", "layer" (radius_m of the ball on it,
//!                                        # thickness_m), "cone" (half_angle_rad), "unknown"
//! radius_m = 3e-3
//! poisson_ratio = 0.5
//!
//! [waveguide]                            # from the object's side to the glass; without, or with waveguide = "rigid": rigid
//! layers = [
//!     { refractive_index = 1.41, thickness_m = 2e-3, youngs_modulus_pa = 1.36e5, poisson_ratio = 0.5 },
//!     { refractive_index = 1.40, thickness_m = 3e-3, youngs_modulus_pa = 8.0e4 },
//! ]
//! ```
//!
//! A calibrated [`Sensor`](crate::sensor::Sensor) stands for `pixel_size_m`, `[calibration]`, `flat_field` and `[waveguide]`, with
//! the errors of them all:
//!
//! ```toml
//! reference = "reference.png"
//! sensor = "sensor.toml"                 # written by a calibration, see `sensor`
//! frames = [{ image = "frame_1.png" }]
//! object = { shape = "sphere", radius_m = 3e-3, radius_error_m = 5e-6, poisson_ratio = 0.5, poisson_ratio_error = 0.002 }
//! ```
//!
//! More may stand there (`flat_field`, `illumination_drift`, `bits` and `contact_table` above the first table):
//!
//! ```toml
//! contact_table = "table.toml"           # of this ball and waveguide, as `tactile table` makes it: the estimator is then "tabulated-contact"
//! bits = 12                              # of the camera, where its samples stand in files of 16 bits that do not say so
//! illumination_drift = "none"            # "automatic", the default with a sensor: changes of the lamps are divided out where they can be told
//! flat_field = "reference"               # divides by the reference's own brightness: corrects vignetting; not by default
//!
//! [stages]                               # each by name; these are the defaults
//! reconstruction = "eikonal"             # or "tsai-shah", "brooks-horn"; not with a depth table
//! integrator = "of-reconstruction"       # for "brooks-horn" also "frankot-chellappa", "cosine-poisson", "masked-least-squares"
//! sampler = "contact"                    # or "equally-spaced", "curvature", "random"
//! matcher = "annealed-softassign"        # or "relaxation-labelling", "coherent-point-drift", "linear-assignment", "nearest-neighbour"
//! warp = "thin-plate-spline"             # or "cubic-spline", "affine", "rigid"
//! strain = "green-lagrange"              # or "euler-almansi", "hencky", "biot", "infinitesimal"
//! estimator = "best"                     # or "paper-ratio", "regression"; of a ball "sphere", "sphere-on-waveguide", "tabulated-contact",
//!                                        # "sphere-between-plates", "tatara-sphere"; "bonded-layer", "cone", "flat-punch"; "least-akaike" of a ball's or a layer's laws
//! ```
//!
//! Images are PNG, PGM or JPEG. Colour becomes grey by the luma of Rec. 601 (see [`read_grey_image`](crate::io::read_grey_image)).
//! Relative paths are relative to the scene file. Fields counted in errors (`frames[2]`) start at 1.
mod contact_table;
mod error;
pub(crate) mod fields;
mod load;
#[cfg(feature = "inclusion")]
pub use load::read_pairs;
mod measure;
mod stages;
mod tables;

#[cfg(feature = "fem")]
pub use contact_table::solve_contact_table;
pub use contact_table::{read_contact_table, write_contact_table};
pub use error::SceneError;
pub use load::{LoadedCalibration, SceneData};

use crate::io::read_bytes;
use crate::pipeline::{Object, StagesConfig};
use fields::Fields;
use std::path::{Path, PathBuf};

/// The calibration of a scene.
///
/// ```
/// use tactile_imaging::scene::{CalibrationSource, Scene};
/// # let rest = r#"
/// #     [[frames]]
/// #     image = "frame.png"
/// #     [object]
/// #     shape = "unknown"
/// #     [waveguide]
/// #     layers = [{ refractive_index = 1.41, thickness_m = 2e-3, youngs_modulus_pa = 1e5 }]
/// # "#;
/// let head = "reference = \"reference.png\"\npixel_size_m = [2e-5, 2e-5]\n[calibration]\n";
/// let source = |line: &str| Scene::parse(&format!("{head}{line}{rest}"), "scene.toml").map(|s| s.calibration);
/// assert_eq!(source("pairs = \"pairs.csv\"")?, CalibrationSource::Pairs("pairs.csv".into()));
/// assert_eq!(source("depth_table = \"depth.csv\"")?, CalibrationSource::DepthTable("depth.csv".into()));
/// assert!(source("pairs = \"pairs.csv\"\ndepth_table = \"depth.csv\"").is_err(), "one of the two");
/// # Ok::<(), tactile_imaging::scene::SceneError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum CalibrationSource {
    /// Pairs of integrated pixel value and force.
    Pairs(PathBuf),
    /// A table of darkness and depth.
    DepthTable(PathBuf),
    /// None: every frame has a gauge's reading of its force.
    Gauge,
    /// The path of a sensor file: curve, lens and layers.
    Sensor(PathBuf),
}

/// A frame with contact.
///
/// ```
/// use tactile_imaging::scene::{Scene, SceneFrame};
/// # let rest = r#"
/// #     [calibration]
/// #     pairs = "pairs.csv"
/// #     [object]
/// #     shape = "unknown"
/// #     [waveguide]
/// #     layers = [{ refractive_index = 1.41, thickness_m = 2e-3, youngs_modulus_pa = 1e5 }]
/// # "#;
/// let head = "reference = \"reference.png\"\npixel_size_m = [2e-5, 2e-5]";
/// let frames = "[[frames]]\nimage = \"one.png\"\nforce_N = 0.7\n[[frames]]\nimage = \"two.png\"";
/// let scene = Scene::parse(&format!("{head}\n{frames}\n{rest}"), "press/scene.toml")?;
/// assert_eq!(scene.frames[0], SceneFrame { image: "press/one.png".into(), force_n: Some(0.7), force_error_n: None, time_s: None });
/// assert_eq!(scene.frames[1].force_n, None, "no gauge: the calibration tells the force");
/// # Ok::<(), tactile_imaging::scene::SceneError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFrame {
    /// The image.
    pub image: PathBuf,
    /// What a gauge read, if there was one.
    pub force_n: Option<f64>,
    /// The standard error of that reading in newtons, if one is stated.
    pub force_error_n: Option<f64>,
    /// When it was taken, in seconds since the object touched, if that is known.
    pub time_s: Option<f64>,
}

/// A layer of the waveguide.
///
/// ```
/// use tactile_imaging::scene::Scene;
/// # let head = r#"
/// #     reference = "reference.png"
/// #     pixel_size_m = [2e-5, 2e-5]
/// #     [calibration]
/// #     pairs = "pairs.csv"
/// #     [[frames]]
/// #     image = "frame.png"
/// #     [object]
/// #     shape = "unknown"
/// # "#;
/// let waveguide = "[waveguide]\nlayers = [
///     { refractive_index = 1.41, thickness_m = 2e-3, youngs_modulus_pa = 1.36e5, poisson_ratio = 0.48 },
///     { refractive_index = 1.40, thickness_m = 3e-3, youngs_modulus_pa = 8.0e4 },
/// ]";
/// let layers = Scene::parse(&format!("{head}\n{waveguide}"), "scene.toml")?.layers;
/// assert_eq!(layers[0].youngs_modulus_pa, 136e3, "the layer that the object touches");
/// assert_eq!((layers[1].thickness_m, layers[1].poisson_ratio), (3e-3, 0.5), "incompressible if not said");
/// # Ok::<(), tactile_imaging::scene::SceneError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneLayer {
    /// Refractive index.
    pub refractive_index: f64,
    /// Thickness in metres.
    pub thickness_m: f64,
    /// Young's modulus in pascals.
    pub youngs_modulus_pa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
}

/// A scene file, checked. Paths are resolved, the files they name not yet read.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # use tactile_simulate::{CalibrationRun, Camera, PressOptions, PressScene, write_folder};
/// # use tactile_simulate::{Elastic, ElasticSphere};
/// use tactile_imaging::scene::Scene;
/// # let camera = Camera::default().coarser(16);
/// # let object = ElasticSphere { radius_m: 20e-3, material: Elastic::CL2000X };
/// # let made = PressScene::new(PressOptions { camera, object, ..PressOptions::default() })?;
/// # let folder = tempfile::tempdir()?;
/// # let indenter = ElasticSphere { radius_m: 60e-3, material: Elastic::RIGID };
/// # let calibration = CalibrationRun { steps: 8, indenter, ..CalibrationRun::default() };
/// # let path = write_folder(&made, &made.calibrate(&calibration)?, folder.path())?;
/// let scene = Scene::read(&path)?; // a CL2000X ball, E = 103 kPa, at 0.7 N and 1.2 N
/// let data = scene.load()?;
/// let mut press = scene.press(&scene.pipeline(&data)?, &data)?;
/// let modulus = press.modulus().map_err(|e| scene.measure_error(e))?; // errors name file and field
/// let (low, high) = (modulus.interval_95.lower, modulus.interval_95.upper);
/// assert!(low < 103e3 && high.is_none_or(|high| high > 103e3));
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The file itself.
    pub file: PathBuf,
    /// The image without contact.
    pub reference: PathBuf,
    /// Size of a pixel on the sensing surface in metres, x and y. Zero where a sensor file has it.
    pub pixel_size_m: [f64; 2],
    /// Whether vignetting is corrected by the reference's own brightness.
    pub flat_field: bool,
    /// Bits of the camera, for images of 16 bits. Told from the file where not given.
    pub bits: Option<u8>,
    /// Whether changes of the lamps since the reference are divided out where they can be told.
    pub corrects_drift: bool,
    /// Standard error of the object's radius in metres.
    pub radius_error_m: f64,
    /// Standard error of the object's Poisson ratio.
    pub poisson_ratio_error: f64,
    /// How grey levels become force or depth.
    pub calibration: CalibrationSource,
    /// The frames, in the order of the file.
    pub frames: Vec<SceneFrame>,
    /// What is pressed.
    pub object: Object,
    /// The waveguide's layers from the object's side; empty: taken as rigid.
    pub layers: Vec<SceneLayer>,
    /// A table of the ball's contacts with the waveguide, which then tells the modulus unless `stages` names another estimator.
    pub contact_table: Option<PathBuf>,
    /// The stages, by name.
    pub stages: StagesConfig,
}

impl Scene {
    /// Reads and checks a scene file.
    ///
    /// # Errors
    /// [`SceneError`]: one sentence that names the file and the field.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let bytes = read_bytes(path).map_err(|error| SceneError::Open(Box::new(error)))?;
        Self::parse(&String::from_utf8_lossy(&bytes), path)
    }

    /// Checks the text of a scene file. `file` is its name, to whose folder relative paths are relative.
    ///
    /// ```
    /// use tactile_imaging::{pipeline::Object, scene::Scene};
    /// let text = r#"
    ///     reference = "reference.png"
    ///     pixel_size_m = [21.55e-6, 21.55e-6]
    ///     calibration = { pairs = "pairs.csv" }
    ///     frames = [{ image = "one.png" }, { image = "two.png", force_N = 1.2 }]
    ///     object = { shape = "sphere", radius_m = 3e-3, poisson_ratio = 0.5 }
    ///     [waveguide]
    ///     layers = [{ refractive_index = 1.41, thickness_m = 2e-3, youngs_modulus_pa = 1.36e5 }]
    /// "#;
    /// let scene = Scene::parse(text, "press/scene.toml")?;
    /// assert_eq!(scene.object, Object::Sphere { radius_m: 3e-3, poisson_ratio: 0.5 });
    /// assert_eq!(scene.reference, std::path::Path::new("press/reference.png"));
    /// # Ok::<(), tactile_imaging::scene::SceneError>(())
    /// ```
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(text: &str, file: impl AsRef<Path>) -> Result<Self, SceneError> {
        let file = file.as_ref();
        let table = parse_table(text, file)?;
        let fields = Fields::new(file, &table);
        fields.only(&tables::FIELDS)?;
        let folder = file.parent().unwrap_or(Path::new(""));
        let reference = fields.string("reference", "the path of the image without contact")?;
        let frames = tables::frames(&fields, folder)?;
        let gauged = frames.iter().all(|frame| frame.force_n.is_some());
        let sensor = tables::sensor(&fields)?;
        let [radius_error_m, poisson_ratio_error] = tables::object_errors(&fields)?;
        Ok(Self {
            file: file.into(),
            reference: folder.join(reference),
            pixel_size_m: match sensor {
                Some(_) => [0.0; 2],
                None => fields.positive_pair(
                    "pixel_size_m",
                    "two positive numbers [x, y] (metres per pixel)",
                )?,
            },
            corrects_drift: tables::corrects_drift(&fields)?.unwrap_or(sensor.is_some()),
            radius_error_m,
            poisson_ratio_error,
            flat_field: tables::flat_field(&fields)?,
            bits: tables::bits(&fields)?,
            calibration: match sensor {
                Some(path) => CalibrationSource::Sensor(folder.join(path)),
                None => tables::calibration(&fields, folder, gauged)?,
            },
            frames,
            object: tables::object(&fields)?,
            layers: tables::layers(&fields)?,
            contact_table: tables::contact_table(&fields, folder)?,
            stages: stages::read(&fields)?,
        })
    }
}

/// The text of a file as TOML.
pub(crate) fn parse_table(text: &str, file: &Path) -> Result<toml::Table, SceneError> {
    text.parse()
        .map_err(|e: toml::de::Error| SceneError::Syntax {
            file: file.into(),
            line: e.span().map_or(1, |s| {
                1 + text[..s.start.min(text.len())].matches('\n').count()
            }),
            message: e.message().lines().next().unwrap_or("not TOML").into(),
        })
}
