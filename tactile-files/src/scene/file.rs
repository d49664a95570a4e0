//! The fields of a scene file, and the files of contact tables.
use crate::io::{
    FileError, beside, force, length, modulus, not_negative, number, one_or_more, parse_toml,
    pixel_size, poisson_ratio, positive, read_bytes, read_toml,
};
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserializer, MapAccess, Unexpected, Visitor};
use serde::{Deserialize, Serialize};
use std::fmt;
#[cfg(feature = "fem")]
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
#[cfg(feature = "fem")]
use tactile_imaging::core::Progress;
use tactile_imaging::core::{Estimate, Source};
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::elasticity::contact::{ContactTable, Layer, Waveguide};
#[cfg(feature = "fem")]
use tactile_imaging::fem::ContactTableOptions;
use tactile_imaging::pipeline::{
    Assumptions, CheckPress, CheckedObject, EstimatorChoice, KnownBall, MatcherChoice, Object,
    ReconstructionChoice, SamplerChoice, StagesConfig, StrainChoice, WarpChoice,
};

/// The calibration of a scene.
///
/// ```
/// use tactile_files::scene::{CalibrationSource, Scene};
/// let rest = r#"
///     [[frames]]
///     image = "frame.png"
///     [object]
///     shape = "unknown"
///     [waveguide]
///     layers = [{ refractive_index = 1.41, thickness_m = 2e-3, youngs_modulus_pa = 1e5 }]
/// "#;
/// let head = "reference = \"reference.png\"\npixel_size_m = [2e-5, 2e-5]\n[calibration]\n";
/// let source = |line: &str| {
///     Scene::parse(&format!("{head}{line}{rest}"), "scene.toml").map(|s| s.calibration)
/// };
/// let pairs = CalibrationSource::Pairs("pairs.csv".into());
/// assert_eq!(source("pairs = \"pairs.csv\"")?, pairs);
/// let depths = CalibrationSource::DepthTable("depth.csv".into());
/// assert_eq!(source("depth_table = \"depth.csv\"")?, depths);
/// let both = "pairs = \"pairs.csv\"\ndepth_table = \"depth.csv\"";
/// assert!(source(both).is_err(), "one of the two");
/// # Ok::<(), tactile_files::io::FileError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum CalibrationSource {
    /// The path of pairs of integrated pixel value and force.
    Pairs(PathBuf),
    /// The path of a table of darkness and depth.
    DepthTable(PathBuf),
    /// No calibration: every frame has a gauge reading of its force.
    Gauge,
    /// The path of a sensor file, which has curve, lens and layers.
    Sensor(PathBuf),
}

/// A frame with contact.
///
/// ```
/// use tactile_files::scene::{Scene, SceneFrame};
/// let rest = r#"
///     [calibration]
///     pairs = "pairs.csv"
///     [object]
///     shape = "unknown"
///     [waveguide]
///     layers = [{ refractive_index = 1.41, thickness_m = 2e-3, youngs_modulus_pa = 1e5 }]
/// "#;
/// let head = "reference = \"reference.png\"\npixel_size_m = [2e-5, 2e-5]";
/// let frames = "[[frames]]\nimage = \"one.png\"\nforce_N = 0.7\n[[frames]]\nimage = \"two.png\"";
/// let scene = Scene::parse(&format!("{head}\n{frames}\n{rest}"), "press/scene.toml")?;
/// let image = "press/one.png".into();
/// let first = SceneFrame { image, force_n: Some(0.7), force_error_n: None, time_s: None };
/// assert_eq!(scene.frames[0], first);
/// assert_eq!(scene.frames[1].force_n, None, "no gauge: the calibration gives the force");
/// # Ok::<(), tactile_files::io::FileError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFrame {
    /// The path of the image.
    pub image: PathBuf,
    /// The gauge reading in newtons, if there is one.
    #[serde(default, rename = "force_N", deserialize_with = "force")]
    pub force_n: Option<f64>,
    /// The standard error of the gauge reading in newtons, if one is stated.
    #[serde(default, rename = "force_error_N", deserialize_with = "not_negative")]
    pub force_error_n: Option<f64>,
    /// The time of the frame in seconds since first contact, if known.
    #[serde(default, deserialize_with = "not_negative")]
    pub time_s: Option<f64>,
}

impl SceneFrame {
    /// A frame of which only the image is known.
    pub fn new(image: impl Into<PathBuf>) -> Self {
        Self {
            image: image.into(),
            force_n: None,
            force_error_n: None,
            time_s: None,
        }
    }
}

/// A press of known force beside the frames ([`CheckPress`](tactile_imaging::pipeline::CheckPress)).
///
/// ```
/// use tactile_imaging::pipeline::CheckedObject;
/// use tactile_files::scene::Scene;
/// let text = r#"
///     reference = "reference.png"
///     pixel_size_m = [2e-5, 2e-5]
///     calibration = { pairs = "pairs.csv" }
///     frames = [{ image = "frame.png" }]
///     object = { shape = "sphere", radius_m = 3e-3 }
///     [[check]]
///     image = "weight.png"
///     force_N = 1.0
///     object = "sample"
/// "#;
/// let check = &Scene::parse(text, "press/scene.toml")?.checks[0];
/// assert_eq!(check.image, std::path::Path::new("press/weight.png"));
/// assert_eq!((check.known_n.value, check.object), (1.0, CheckedObject::Sample));
/// assert_eq!(check.known_n.standard_error, 2e-3, "0.2 % are assumed");
/// # Ok::<(), tactile_files::io::FileError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SceneCheck {
    /// The path of the image.
    pub image: PathBuf,
    /// The force of a weight or a gauge in newtons. If no error is stated, it is 0.2 % of the
    /// force.
    pub known_n: Estimate,
    /// The pressed object. If no errors of a ball are stated, they are 0.5 % of the radius, 2 % of
    /// the modulus and 0.01 in Poisson's ratio.
    pub object: CheckedObject,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CheckTable {
    image: PathBuf,
    #[serde(rename = "force_N", deserialize_with = "positive")]
    force_n: f64,
    #[serde(default, rename = "force_error_N", deserialize_with = "not_negative")]
    force_error_n: Option<f64>,
    object: Option<OpticalCheck>,
    ball: Option<BallTable>,
}

/// Objects that check the light.
#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum OpticalCheck {
    Sample,
    Calibrator,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BallTable {
    #[serde(deserialize_with = "length")]
    radius_m: f64,
    #[serde(default, deserialize_with = "stated")]
    radius_error_m: Option<f64>,
    /// If absent, the ball is rigid.
    #[serde(default, deserialize_with = "modulus")]
    youngs_modulus_pa: Option<f64>,
    #[serde(default, deserialize_with = "stated")]
    youngs_modulus_error_pa: Option<f64>,
    #[serde(default = "incompressible", deserialize_with = "poisson_ratio")]
    poisson_ratio: f64,
    #[serde(default, deserialize_with = "stated")]
    poisson_ratio_error: Option<f64>,
}

impl BallTable {
    fn known(&self) -> KnownBall {
        let radius_m = KnownBall::radius(self.radius_m, self.radius_error_m);
        let Some(modulus_pa) = self.youngs_modulus_pa else {
            return KnownBall::rigid(radius_m);
        };
        let modulus_pa = KnownBall::modulus(modulus_pa, self.youngs_modulus_error_pa);
        let mut ball = KnownBall::elastic(radius_m, modulus_pa);
        ball.poisson_ratio.value = self.poisson_ratio;
        if let Some(error) = self.poisson_ratio_error {
            ball.poisson_ratio.standard_error = error;
        }
        ball
    }
}

impl CheckTable {
    /// The check with its image path resolved beside `file`, or the field that is missing or
    /// superfluous.
    fn check(self, file: &Path) -> Result<SceneCheck, (&'static str, &'static str)> {
        let object = match (self.object, self.ball) {
            (Some(OpticalCheck::Sample), None) => CheckedObject::Sample,
            (Some(OpticalCheck::Calibrator), None) => CheckedObject::Calibrator,
            (None, Some(ball)) => CheckedObject::Ball(ball.known()),
            (Some(_), Some(_)) => return Err(("ball", "expected none beside object")),
            (None, None) => {
                return Err(("object", "expected \"sample\", \"calibrator\" or a ball"));
            }
        };
        Ok(SceneCheck {
            image: beside(file, &self.image),
            known_n: CheckPress::force(self.force_n, self.force_error_n),
            object,
        })
    }
}

/// A layer of the waveguide.
///
/// ```
/// use tactile_files::scene::Scene;
/// let head = r#"
///     reference = "reference.png"
///     pixel_size_m = [2e-5, 2e-5]
///     [calibration]
///     pairs = "pairs.csv"
///     [[frames]]
///     image = "frame.png"
///     [object]
///     shape = "unknown"
/// "#;
/// let waveguide = "
///     [[waveguide.layers]]
///     refractive_index = 1.41
///     thickness_m = 2e-3
///     youngs_modulus_pa = 1.36e5
///     poisson_ratio = 0.48
///     [[waveguide.layers]]
///     refractive_index = 1.40
///     thickness_m = 3e-3
///     youngs_modulus_pa = 8.0e4
/// ";
/// let layers = Scene::parse(&format!("{head}\n{waveguide}"), "scene.toml")?.layers;
/// assert_eq!(layers[0].youngs_modulus_pa, 136e3, "the layer that the object touches");
/// assert_eq!(layers[1].poisson_ratio, 0.5, "incompressible where it is absent");
/// # Ok::<(), tactile_files::io::FileError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneLayer {
    /// Refractive index.
    #[serde(deserialize_with = "refractive_index")]
    pub refractive_index: f64,
    /// Thickness in metres.
    #[serde(deserialize_with = "length")]
    pub thickness_m: f64,
    /// Young's modulus in pascals.
    #[serde(deserialize_with = "modulus")]
    pub youngs_modulus_pa: f64,
    /// Poisson's ratio, ½ if the file states none.
    #[serde(default = "incompressible", deserialize_with = "poisson_ratio")]
    pub poisson_ratio: f64,
}

fn incompressible() -> f64 {
    0.5
}

/// A refractive index, for `#[serde(deserialize_with = …)]`.
pub(crate) fn refractive_index<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<f64, D::Error> {
    let accepts = |v: f64| v >= 1.0 && v.is_finite();
    number(deserializer, "a number of at least 1", accepts)
}

/// Converts layers to the type of the contact laws.
pub(crate) fn elastic_layers(layers: &[SceneLayer]) -> Vec<Layer> {
    let elastic = |layer: &SceneLayer| Layer {
        thickness_m: layer.thickness_m,
        youngs_modulus_pa: layer.youngs_modulus_pa,
        poisson_ratio: layer.poisson_ratio,
    };
    layers.iter().map(elastic).collect()
}

/// A standard error, or `"exact"`, for `#[serde(deserialize_with = …)]`.
fn stated<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Stated {
        Error(f64),
        Text(String),
    }
    let expected = "expected zero, a positive number or \"exact\"";
    match Stated::deserialize(deserializer) {
        Ok(Stated::Error(error)) if error >= 0.0 && error.is_finite() => Ok(Some(error)),
        Ok(Stated::Text(text)) if text == "exact" => Ok(Some(0.0)),
        _ => Err(de::Error::custom(expected)),
    }
}

/// A checked scene file. Its paths are resolved, but the files that they name are not read yet.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_simulate::{CalibrationRun, Camera, PressOptions, PressScene, write_folder};
/// use tactile_simulate::{Elastic, ElasticSphere};
/// use tactile_files::scene::Scene;
/// let camera = Camera::default().coarser(16);
/// let object = ElasticSphere { radius_m: 20e-3, material: Elastic::CL2000X };
/// let made = PressScene::new(PressOptions { camera, object, ..PressOptions::default() })?;
/// let folder = tempfile::tempdir()?;
/// let indenter = ElasticSphere { radius_m: 60e-3, material: Elastic::RIGID };
/// let calibration = CalibrationRun { steps: 8, indenter, ..CalibrationRun::default() };
/// let path = write_folder(&made, &made.calibrate(&calibration)?, folder.path())?;
/// let scene = Scene::read(&path)?; // a CL2000X ball, E = 103 kPa, at 0.7 N and 1.2 N
/// let data = scene.load()?;
/// let mut press = scene.press(&scene.pipeline(&data)?, &data)?;
/// // Errors of a scene name its file and the field.
/// let modulus = press.modulus().map_err(|e| scene.measure_error(e))?;
/// let (low, high) = (modulus.interval_95.lower, modulus.interval_95.upper);
/// assert!(low < 103e3 && high.is_none_or(|high| high > 103e3));
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The path of the scene file.
    pub file: PathBuf,
    /// The path of the image without contact.
    pub reference: PathBuf,
    /// Size of a pixel on the sensing surface in metres, along x and y. Zero if a sensor file holds
    /// it.
    pub pixel_size_m: [f64; 2],
    /// Whether vignetting is corrected by the brightness of the reference.
    pub flat_field: bool,
    /// Bits of the camera, for 16-bit images whose files do not state them.
    pub bits: Option<u8>,
    /// Whether detected changes of the lamps since the reference are divided out.
    pub corrects_drift: bool,
    /// Standard errors of the inputs.
    pub errors: Assumptions,
    /// The conversion from grey levels to force or depth.
    pub calibration: CalibrationSource,
    /// The frame without contact from which the sums of the calibration's pairs were taken.
    pub calibration_reference: Option<PathBuf>,
    /// The frames, in the order of the file.
    pub frames: Vec<SceneFrame>,
    /// Presses of known force, before or after the frames.
    pub checks: Vec<SceneCheck>,
    /// The pressed object.
    pub object: Object,
    /// The waveguide's layers from the object's side, rigid if empty.
    pub layers: Vec<SceneLayer>,
    /// The path of a contact table of the ball on the waveguide. The modulus is estimated from it
    /// unless `stages` names another estimator.
    pub contact_table: Option<PathBuf>,
    /// The names of the stages.
    pub stages: StagesConfig,
}

impl Scene {
    /// Reads and checks a scene file.
    ///
    /// # Errors
    /// [`FileError`]: one sentence that names the file and the field.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let path = path.as_ref();
        Self::parse(&String::from_utf8_lossy(&read_bytes(path)?), path)
    }

    /// Checks the text of a scene file. Relative paths are relative to the folder of `file`.
    ///
    /// ```
    /// use tactile_files::scene::Scene;
    /// use tactile_imaging::pipeline::Object;
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
    /// # Ok::<(), tactile_files::io::FileError>(())
    /// ```
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(text: &str, file: impl AsRef<Path>) -> Result<Self, FileError> {
        SceneFile::parse(text, file.as_ref())
    }
}

/// The fields of a scene file, unchecked.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    reference: PathBuf,
    sensor: Option<PathBuf>,
    #[serde(default, deserialize_with = "pixel_size")]
    pixel_size_m: Option<[f64; 2]>,
    flat_field: Option<FlatField>,
    illumination_drift: Option<Drift>,
    #[serde(default, deserialize_with = "stated")]
    pixel_size_error: Option<f64>,
    #[serde(default, deserialize_with = "stated")]
    gauge_error: Option<f64>,
    #[serde(default, deserialize_with = "stated")]
    coupling_error: Option<f64>,
    #[serde(default, deserialize_with = "stated")]
    layer_error: Option<f64>,
    #[serde(default, deserialize_with = "bits")]
    bits: Option<u8>,
    calibration: Option<CalibrationTable>,
    #[serde(deserialize_with = "one_or_more")]
    frames: Vec<SceneFrame>,
    #[serde(default)]
    check: Vec<CheckTable>,
    object: ObjectTable,
    waveguide: Option<WaveguideTable>,
    contact_table: Option<PathBuf>,
    #[serde(default)]
    stages: StagesTable,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum FlatField {
    Reference,
}

#[derive(Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Drift {
    Automatic,
    None,
}

fn bits<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<u8>, D::Error> {
    let expected = "a whole number from 8 to 16, the bits of the camera";
    let accepts = |bits: f64| (8.0..=16.0).contains(&bits) && bits.fract() == 0.0;
    let bits: f64 = number(deserializer, expected, accepts)?;
    Ok(Some(bits as u8))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationTable {
    pairs: Option<PathBuf>,
    /// The frame without contact from which the sums of the pairs were taken.
    reference: Option<PathBuf>,
    depth_table: Option<PathBuf>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ObjectTable {
    shape: Shape,
    #[serde(default, deserialize_with = "length")]
    radius_m: Option<f64>,
    #[serde(default, deserialize_with = "length")]
    thickness_m: Option<f64>,
    #[serde(default, deserialize_with = "half_angle")]
    half_angle_rad: Option<f64>,
    #[serde(default, deserialize_with = "poisson_ratio")]
    poisson_ratio: Option<f64>,
    #[serde(default, deserialize_with = "stated")]
    radius_error_m: Option<f64>,
    #[serde(default, deserialize_with = "stated")]
    poisson_ratio_error: Option<f64>,
    #[serde(default, deserialize_with = "stated")]
    adhesion_error_j_per_m2: Option<f64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Shape {
    Sphere,
    Block,
    Cylinder,
    FlatPunch,
    Layer,
    Cone,
    Unknown,
}

fn half_angle<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    let accepts = |v: f64| v > 0.0 && v < std::f64::consts::FRAC_PI_2;
    number(deserializer, "a number between 0 and π/2", accepts)
}

/// `"rigid"`, or a table with `layers`.
struct WaveguideTable(Vec<SceneLayer>);

impl<'de> Deserialize<'de> for WaveguideTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Layers {
            #[serde(deserialize_with = "one_or_more")]
            layers: Vec<SceneLayer>,
        }
        // An untagged enum would lose the path to a wrong field in a layer.
        struct RigidOrLayers;
        impl<'de> Visitor<'de> for RigidOrLayers {
            type Value = WaveguideTable;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table with `layers`, or \"rigid\"")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<WaveguideTable, E> {
                match text {
                    "rigid" => Ok(WaveguideTable(Vec::new())),
                    text => Err(E::invalid_value(Unexpected::Str(text), &self)),
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<WaveguideTable, A::Error> {
                let table = Layers::deserialize(MapAccessDeserializer::new(map))?;
                Ok(WaveguideTable(table.layers))
            }
        }
        deserializer.deserialize_any(RigidOrLayers)
    }
}

/// Names of stages. An absent stage takes its default.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct StagesTable {
    #[serde(default)]
    as_printed: bool,
    reconstruction: Option<ReconstructionChoice>,
    sampler: Option<SamplerChoice>,
    matcher: Option<MatcherChoice>,
    warp: Option<WarpChoice>,
    strain: Option<StrainChoice>,
    estimator: Option<EstimatorChoice>,
}

impl SceneFile {
    /// The function is not generic, so that the parser is compiled only once.
    fn parse(text: &str, path: &Path) -> Result<Scene, FileError> {
        parse_toml::<Self>(text, path)?.validate(path)
    }

    /// Checks the fields against each other.
    fn validate(self, file: &Path) -> Result<Scene, FileError> {
        let error = |field: &str, reason: &str| FileError::field(file, field, reason);
        let missing = |field: &str| error(field, "it is missing");
        let calibration = self.calibration(file)?;
        // The relaxation fit needs times in ascending order.
        let mut last_s = 0.0;
        for (index, frame) in self.frames.iter().enumerate() {
            let Some(time_s) = frame.time_s else { continue };
            if time_s < last_s {
                let field = format!("frames[{}].time_s", index + 1);
                let reason = format!("{time_s} s is before the preceding frame ({last_s} s)");
                return Err(FileError::field(file, field, reason));
            }
            last_s = time_s;
        }
        let by_light = matches!(
            calibration,
            CalibrationSource::Pairs(_) | CalibrationSource::Sensor(_)
        );
        let of_light = |check: &CheckTable| check.object.is_some();
        if self.check.iter().any(of_light) && !by_light {
            let reason = "expected none: no force is read from light";
            return Err(error("check", reason));
        }
        let stages = self.stages.choices();
        // A named stage that would not run is refused as a mistake of the user.
        let by_table = matches!(calibration, CalibrationSource::DepthTable(_));
        if by_table && self.stages.reconstruction.is_some() {
            let reason = "expected none: the surface comes from the depth table";
            return Err(error("stages.reconstruction", reason));
        }
        // The sensor file holds the pixel size, and its curve allows for drift of the lamps.
        let has_sensor = self.sensor.is_some();
        let pixel_size_m = match self.pixel_size_m {
            Some(size) => size,
            None if has_sensor => [0.0; 2],
            None => return Err(missing("pixel_size_m")),
        };
        let mut frames = self.frames;
        for frame in &mut frames {
            frame.image = beside(file, &frame.image);
        }
        let mut checks = Vec::with_capacity(self.check.len());
        for (index, check) in self.check.into_iter().enumerate() {
            checks.push(check.check(file).map_err(|(field, reason)| {
                let field = format!("check[{}].{field}", index + 1);
                FileError::field(file, field, reason)
            })?);
        }
        let of_ball = |check: &SceneCheck| matches!(check.object, CheckedObject::Ball(_));
        if self.contact_table.is_some() && checks.iter().any(of_ball) {
            let reason = "expected none beside checks by balls: the table was computed for the \
            stated layers";
            return Err(error("contact_table", reason));
        }
        let object = self.object.object(file)?;
        let size_error = self.object.radius_error_m.zip(object.radius_m());
        let mut errors = Assumptions::default();
        for (source, stated) in [
            (Source::Gain, self.gauge_error),
            (Source::Coupling, self.coupling_error),
            (Source::PixelSize, self.pixel_size_error),
            (Source::Guide, self.layer_error),
            (
                Source::ObjectSize,
                size_error.map(|(error_m, radius_m)| error_m / radius_m),
            ),
            (Source::PoissonRatio, self.object.poisson_ratio_error),
            (Source::Adhesion, self.object.adhesion_error_j_per_m2),
        ] {
            if let Some(error) = stated {
                errors.state(source, error);
            }
        }
        Ok(Scene {
            file: file.into(),
            reference: beside(file, &self.reference),
            pixel_size_m,
            flat_field: self.flat_field.is_some(),
            bits: self.bits,
            corrects_drift: self
                .illumination_drift
                .is_none_or(|d| d == Drift::Automatic),
            errors,
            calibration,
            calibration_reference: self
                .calibration
                .and_then(|table| table.reference)
                .map(|path| beside(file, &path)),
            frames,
            checks,
            object,
            layers: self
                .waveguide
                .map_or_else(Vec::new, |waveguide| waveguide.0),
            contact_table: self.contact_table.map(|path| beside(file, &path)),
            stages,
        })
    }

    /// The source of the calibration, which must be unique.
    fn calibration(&self, file: &Path) -> Result<CalibrationSource, FileError> {
        let error = |field: &str, reason: &str| FileError::field(file, field, reason);
        if let Some(sensor) = &self.sensor {
            // With two sources of one quantity it would be unclear which one is used.
            let beside_sensor = [
                ("pixel_size_m", self.pixel_size_m.is_some()),
                ("flat_field", self.flat_field.is_some()),
                ("calibration", self.calibration.is_some()),
                ("waveguide", self.waveguide.is_some()),
            ];
            return match beside_sensor.iter().find(|(_, is_given)| *is_given) {
                Some((field, _)) => Err(error(field, "expected none: the sensor file has it")),
                None => Ok(CalibrationSource::Sensor(beside(file, sensor))),
            };
        }
        match &self.calibration {
            None if self.frames.iter().all(|frame| frame.force_n.is_some()) => {
                Ok(CalibrationSource::Gauge)
            }
            None => Err(error(
                "calibration",
                "it is missing, expected `pairs` or `depth_table`, or `force_N` in every frame",
            )),
            Some(table) => match (&table.pairs, &table.depth_table) {
                (Some(pairs), None) => Ok(CalibrationSource::Pairs(beside(file, pairs))),
                (None, Some(_)) if table.reference.is_some() => Err(error(
                    "calibration.reference",
                    "expected none: a depth table does not depend on the lamps",
                )),
                (None, Some(depths)) => Ok(CalibrationSource::DepthTable(beside(file, depths))),
                (None, None) => Err(error("calibration", "expected `pairs` or `depth_table`")),
                (Some(_), Some(_)) => Err(error(
                    "calibration",
                    "expected `pairs` or `depth_table`, found both",
                )),
            },
        }
    }
}

impl ObjectTable {
    fn object(&self, file: &Path) -> Result<Object, FileError> {
        let poisson_ratio = self.poisson_ratio.unwrap_or(Object::DEFAULT_POISSON_RATIO);
        let given = |field: &str, value: Option<f64>| {
            let missing = || {
                let reason = "it is missing, but this shape needs it";
                FileError::field(file, format!("object.{field}"), reason)
            };
            value.ok_or_else(missing)
        };
        let radius_m = || given("radius_m", self.radius_m);
        Ok(match self.shape {
            Shape::Sphere => Object::Sphere {
                radius_m: radius_m()?,
                poisson_ratio,
            },
            Shape::FlatPunch => Object::FlatPunch {
                radius_m: radius_m()?,
                poisson_ratio,
            },
            Shape::Layer => Object::Layer {
                indenter_radius_m: radius_m()?,
                thickness_m: given("thickness_m", self.thickness_m)?,
                poisson_ratio,
            },
            Shape::Cone => Object::Cone {
                half_angle_rad: given("half_angle_rad", self.half_angle_rad)?,
                poisson_ratio,
            },
            Shape::Block => Object::Block { poisson_ratio },
            Shape::Cylinder => Object::Cylinder { poisson_ratio },
            Shape::Unknown => Object::Unknown { poisson_ratio },
        })
    }
}

impl StagesTable {
    /// The named stages. The others are the defaults, or those of the paper.
    fn choices(&self) -> StagesConfig {
        let others = if self.as_printed {
            StagesConfig::as_printed()
        } else {
            StagesConfig::default()
        };
        StagesConfig {
            reconstruction: self.reconstruction.unwrap_or(others.reconstruction),
            sampler: self.sampler.unwrap_or(others.sampler),
            matcher: self.matcher.unwrap_or(others.matcher),
            warp: self.warp.unwrap_or(others.warp),
            strain: self.strain.unwrap_or(others.strain),
            estimator: self.estimator.unwrap_or(others.estimator),
        }
    }
}

/// Reads a contact table from a TOML file and checks it.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::elasticity::contact::{ContactCurve, ContactTable, Waveguide};
/// use tactile_files::scene::read_contact_table;
///
/// let contact_radius_m: Vec<f64> = (1..=10).map(|k| 0.1e-3 * f64::from(k)).collect();
/// let force_n = contact_radius_m.iter().map(|a| 4.0 / 3.0 * 80e3 * a.powi(3) / 3e-3).collect();
/// let curve = ContactCurve { youngs_modulus_pa: 60e3, contact_radius_m, force_n };
/// let table = ContactTable::new(3e-3, 0.5, &Waveguide::rigid(), vec![curve])?;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("table.toml");
/// std::fs::write(&path, toml::to_string(&table)?)?;
/// assert_eq!(read_contact_table(&path)?, table);
/// std::fs::write(&path, "version = 7")?;
/// assert!(read_contact_table(&path).is_err());
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FileError`], also if the contacts do not form a table or the table has another version.
pub fn read_contact_table(path: impl AsRef<Path>) -> Result<ContactTable, FileError> {
    // The function is not generic, so that the parser is compiled only once.
    fn read(path: &Path) -> Result<ContactTable, FileError> {
        read_toml(path)
    }
    read(path.as_ref())
}

/// Computes the contact table of the ball and the waveguide that a file describes.
///
/// The file is a scene file, or holds only its tables `object` and `waveguide`. `progress` is
/// called before each modulus and after the last.
///
/// # Errors
/// [`FileError`], also if the object is not a ball or the table cannot be computed.
#[cfg(feature = "fem")]
pub fn solve_contact_table(
    path: impl AsRef<Path>,
    options: &ContactTableOptions,
    progress: impl FnMut(Progress) -> ControlFlow<()>,
) -> Result<ContactTable, FileError> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct BallFile {
        object: ObjectTable,
        waveguide: Option<WaveguideTable>,
    }
    let path = path.as_ref();
    let text = String::from_utf8_lossy(&read_bytes(path)?).into_owned();
    // A scene has a reference. The other kind of file may hold only the two tables, so that a
    // misspelt `waveguide` is an error instead of a rigid guide.
    let is_scene = parse_toml::<toml::Table>(&text, path)?.contains_key("reference");
    let BallFile { object, waveguide } = if is_scene {
        let SceneFile {
            object, waveguide, ..
        } = parse_toml(&text, path)?;
        BallFile { object, waveguide }
    } else {
        parse_toml(&text, path)?
    };
    let Object::Sphere {
        radius_m,
        poisson_ratio,
    } = object.object(path)?
    else {
        let reason = "expected a ball: contact tables exist only for balls";
        return Err(FileError::field(path, "object.shape", reason));
    };
    let layers = waveguide.map_or_else(Vec::new, |waveguide| waveguide.0);
    guide(&layers)
        .and_then(|guide| {
            tactile_imaging::fem::solve_contact_table(
                radius_m,
                poisson_ratio,
                &guide,
                options,
                progress,
            )
        })
        .map_err(|error| FileError::field(path, "waveguide", error))
}

/// The layers of a scene as a waveguide, which is rigid without layers.
pub(crate) fn guide(layers: &[SceneLayer]) -> Result<Waveguide, ElasticityError> {
    if layers.is_empty() {
        return Ok(Waveguide::rigid());
    }
    Waveguide::new(elastic_layers(layers))
}
