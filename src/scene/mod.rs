//! Scene files: a user's own frames, and all that is needed to measure them, in one TOML file.
//!
//! ```toml
//! reference = "reference.png"            # the sensor without contact
//! pixel_size_m = [21.55e-6, 21.55e-6]    # x, y, on the sensing surface
//!
//! [calibration]                          # one of the two
//! pairs = "calibration.csv"              # columns integrated_pixel_value,force_N
//! # depth_table = "depth.csv"            # columns darkness_grey_levels,depth_mm
//!
//! [[frames]]
//! image = "frame_1.png"
//! force_N = 0.70                         # a gauge reading, if there is one
//!
//! [[frames]]
//! image = "frame_2.png"
//!
//! [object]
//! shape = "sphere"                       # or "flat_punch", "unknown"
//! radius_m = 3e-3
//! poisson_ratio = 0.5
//!
//! [waveguide]                            # from the object's side to the glass
//! layers = [
//!     { refractive_index = 1.41, thickness_m = 2e-3, youngs_modulus_pa = 1.36e5, poisson_ratio = 0.5 },
//!     { refractive_index = 1.40, thickness_m = 3e-3, youngs_modulus_pa = 8.0e4 },
//! ]
//! ```
//!
//! Two more may stand there (`flat_field` above the first table):
//!
//! ```toml
//! flat_field = "reference"               # divides by the reference's own brightness: corrects vignetting; not by default
//!
//! [stages]                               # each by name; these are the defaults
//! reconstruction = "eikonal"             # or "tsai-shah", "brooks-horn"; not with a depth table
//! sampler = "equally-spaced"             # or "curvature", "random"
//! matcher = "relaxation"                 # or "dense-relaxation", "coherent-point-drift", "linear-assignment", "nearest-neighbour"
//! warp = "thin-plate-spline"             # or "cubic-spline", "affine", "rigid"
//! strain = "green-lagrange"              # or "euler-almansi", "hencky", "biot", "infinitesimal"
//! estimator = "best"                     # or "paper-ratio", "regression", "sphere" (a ball's), "flat-punch"
//! ```
//!
//! Images are PNG, PGM or JPEG; colour becomes grey by the luma of Rec. 601 (see [`io::image`](crate::io::image)).
//! Relative paths are relative to the scene file. Fields counted in errors (`frames[2]`) start at 1.
mod error;
mod fields;
mod load;
mod measure;
mod stages;

pub use error::SceneError;
pub use load::{LoadedCalibration, SceneData};

use crate::io::ReadError;
use crate::pipeline::{Object, StagesConfig};
use fields::{Fields, poisson, positive};
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
/// assert_eq!(scene.frames[0], SceneFrame { image: "press/one.png".into(), force_n: Some(0.7) });
/// assert_eq!(scene.frames[1].force_n, None, "no gauge: the calibration tells the force");
/// # Ok::<(), tactile_imaging::scene::SceneError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFrame {
    /// The image.
    pub image: PathBuf,
    /// What a gauge read, if there was one.
    pub force_n: Option<f64>,
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
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// A scene file, checked; paths are resolved, the files they name not yet read.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # use tactile_imaging::simulate::{CalibrationOptions, Camera, PressOptions, PressScene, write_folder};
/// # use tactile_imaging::simulate::{Elastic, Sphere};
/// use tactile_imaging::scene::Scene;
/// # let camera = Camera { shape: [65, 87], pixel_size_m: [345e-6; 2], ..Camera::default() };
/// # let object = Sphere { radius_m: 20e-3, material: Elastic::CL2000X };
/// # let made = PressScene::new(PressOptions { camera, object, ..PressOptions::default() })?;
/// # let folder = tempfile::tempdir()?;
/// # let calibration = CalibrationOptions { steps: 8, ..CalibrationOptions::default() };
/// # let path = write_folder(&made, &calibration, folder.path())?;
/// let scene = Scene::read(&path)?; // a CL2000X ball, E = 103 kPa, at 0.7 N and 1.2 N
/// let data = scene.load()?;
/// let stages = scene.stages(&data)?;
/// let mut press = scene.press(stages.as_ref(), &data)?;
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
    /// Size of a pixel on the sensing surface in metres, x and y.
    pub pixel_size_m: [f64; 2],
    /// Whether vignetting is corrected by the reference's own brightness.
    pub flat_field: bool,
    /// How grey levels become force or depth.
    pub calibration: CalibrationSource,
    /// The frames, in the order of the file.
    pub frames: Vec<SceneFrame>,
    /// What is pressed.
    pub object: Object,
    /// The waveguide's layers from the object's side; empty: taken as rigid.
    pub layers: Vec<SceneLayer>,
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
        let bytes = std::fs::read(path)
            .map_err(|source| SceneError::Open(Box::new(ReadError::Open { path: path.into(), source })))?;
        Self::parse(&String::from_utf8_lossy(&bytes), path)
    }

    /// Checks the text of a scene file; `file` is its name, to whose folder relative paths are relative.
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
        let table: toml::Table = text.parse().map_err(|e: toml::de::Error| SceneError::Syntax {
            file: file.into(),
            line: e.span().map_or(1, |s| 1 + text[..s.start.min(text.len())].matches('\n').count()),
            message: e.message().lines().next().unwrap_or("not TOML").into(),
        })?;
        let fields = Fields::new(file, &table);
        fields.only(&FIELDS)?;
        let folder = file.parent().unwrap_or(Path::new(""));
        Ok(Self {
            file: file.into(),
            reference: folder.join(fields.string("reference", "the path of the image without contact")?),
            pixel_size_m: fields
                .positive_pair("pixel_size_m", "two positive numbers [x, y] (metres per pixel)")?,
            flat_field: flat_field(&fields)?,
            calibration: calibration(&fields, folder)?,
            frames: frames(&fields, folder)?,
            object: object(&fields)?,
            layers: layers(&fields)?,
            stages: stages::read(&fields)?,
        })
    }
}

/// What may stand at the top of a scene file.
const FIELDS: [&str; 8] =
    ["reference", "pixel_size_m", "flat_field", "calibration", "frames", "object", "waveguide", "stages"];

fn flat_field(fields: &Fields<'_>) -> Result<bool, SceneError> {
    const EXPECTED: &str = "\"reference\", or absent for no correction";
    if !fields.has("flat_field") {
        return Ok(false);
    }
    match fields.string("flat_field", EXPECTED)? {
        "reference" => Ok(true),
        other => Err(fields.wrong("flat_field", EXPECTED, &toml::Value::String(other.into()))),
    }
}

fn calibration(fields: &Fields<'_>, folder: &Path) -> Result<CalibrationSource, SceneError> {
    const EXPECTED: &str = "a table with `pairs` or `depth_table`";
    let fields = fields.table("calibration", EXPECTED)?;
    fields.only(&["pairs", "depth_table"])?;
    match (fields.has("pairs"), fields.has("depth_table")) {
        (true, false) => {
            let path = fields.string("pairs", "the path of a CSV file (integrated_pixel_value,force_N)")?;
            Ok(CalibrationSource::Pairs(folder.join(path)))
        }
        (false, true) => {
            let path =
                fields.string("depth_table", "the path of a CSV file (darkness_grey_levels,depth_mm)")?;
            Ok(CalibrationSource::DepthTable(folder.join(path)))
        }
        (false, false) => Err(fields.missing("pairs", "`pairs` or `depth_table`, the path of a CSV file")),
        (true, true) => {
            let both = toml::Value::String("both".into());
            Err(fields.wrong("pairs", "alone: give `pairs` or `depth_table`", &both))
        }
    }
}

fn frames(fields: &Fields<'_>, folder: &Path) -> Result<Vec<SceneFrame>, SceneError> {
    let tables = fields.tables("frames", "one or more [[frames]] tables with `image`")?;
    let frame = |f: &Fields<'_>| {
        f.only(&["image", "force_N"])?;
        let image = folder.join(f.string("image", "the path of an image")?);
        let force_n = f.optional_number("force_N", "a positive number (newtons)", positive)?;
        Ok(SceneFrame { image, force_n })
    };
    tables.iter().map(frame).collect()
}

fn object(fields: &Fields<'_>) -> Result<Object, SceneError> {
    const SHAPE: &str = "\"sphere\", \"flat_punch\" or \"unknown\"";
    let fields = fields.table("object", "a table with `shape`")?;
    fields.only(&["shape", "radius_m", "poisson_ratio"])?;
    let shape = fields.string("shape", SHAPE)?;
    let poisson_ratio = fields
        .optional_number("poisson_ratio", "a number above -1, at most 0.5", poisson)?
        .unwrap_or(Object::DEFAULT_POISSON_RATIO);
    let radius = || fields.number("radius_m", "a positive number (metres)", positive);
    match shape {
        "sphere" => Ok(Object::Sphere { radius_m: radius()?, poisson_ratio }),
        "flat_punch" => Ok(Object::FlatPunch { radius_m: radius()?, poisson_ratio }),
        "unknown" => {
            let _ = fields.optional_number("radius_m", "a positive number (metres)", positive)?;
            Ok(Object::Unknown { poisson_ratio })
        }
        other => Err(fields.wrong("shape", SHAPE, &toml::Value::String(other.into()))),
    }
}

fn layers(fields: &Fields<'_>) -> Result<Vec<SceneLayer>, SceneError> {
    if !fields.has("waveguide") {
        return Err(fields.missing("waveguide", "a table with `layers`"));
    }
    let fields = fields.table("waveguide", "a table with `layers`")?;
    fields.only(&["layers"])?;
    let tables =
        fields.tables("layers", "an array of one or more tables, from the object's side to the glass")?;
    let layer = |f: &Fields<'_>| {
        f.only(&["refractive_index", "thickness_m", "youngs_modulus_pa", "poisson_ratio"])?;
        Ok(SceneLayer {
            refractive_index: f
                .number("refractive_index", "a number of at least 1", |v| v >= 1.0 && v.is_finite())?,
            thickness_m: f.number("thickness_m", "a positive number (metres)", positive)?,
            youngs_modulus_pa: f.number("youngs_modulus_pa", "a positive number (pascals)", positive)?,
            poisson_ratio: f
                .optional_number("poisson_ratio", "a number above -1, at most 0.5", poisson)?
                .unwrap_or(0.5),
        })
    };
    tables.iter().map(layer).collect()
}
