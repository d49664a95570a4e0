//! Scene files of a block pressed by the sensor's guide.

use super::rings::{RingMeans, ring_means};
use crate::force::{CalibrationOptions, LinearCalibration, StressCalibration};
use crate::io::{Grey, read_bytes, read_grey_image};
use crate::scene::fields::{Fields, poisson, positive};
use crate::scene::{SceneError, parse_table, read_pairs};
use ndarray::Array2;
use std::path::{Path, PathBuf};
use tactile_fem::{Guide, GuideLayer, Interface, Material};
use tactile_inclusion::{PressureProfile, Specimen};

/// A block of tissue, the guide pressed onto it, and the frames.
///
/// ```
/// use tactile_imaging::inclusion::InclusionScene;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("scene.toml");
/// let text = r#"
///     reference = "reference.png"            # the sensor without contact
///     pixel_size_m = [86e-6, 86e-6]          # x, y, on the face
///     calibration = { pairs = "pairs.csv" }  # integrated_pixel_value,force_N; without it every frame needs force_N
///     frames = [
///         { image = "one.png", approach_m = 1e-3, force_N = 0.35 },
///         { image = "two.png", approach_m = 2e-3, force_N = 0.71 },
///     ]
///     [object]
///     shape = "block"
///     height_m = 30e-3
///     radius_m = 40e-3
///     interface = "bonded"                   # or "frictionless"; both are tried where it is absent
///     [waveguide]                            # from the block's side to the glass
///     radius_m = 16e-3
///     layers = [{ thickness_m = 10e-3, youngs_modulus_pa = 60e3, poisson_ratio = 0.495 }]
/// "#;
/// std::fs::write(&path, text)?;
/// let scene = InclusionScene::read(&path)?;
/// assert_eq!((scene.specimen.height_m(), scene.guide.radius_m()), (30e-3, 16e-3));
/// assert!(scene.load().is_err(), "the images are not there");
/// # Ok(()) }
/// ```
#[derive(Clone, Debug)]
pub struct InclusionScene {
    /// What is known of the block.
    pub specimen: Specimen,
    /// The guide.
    pub guide: Guide,
    file: PathBuf,
    reference: PathBuf,
    pixel_size_m: [f64; 2],
    calibration: Option<PathBuf>,
    frames: Vec<Frame>,
}

#[derive(Clone, Debug)]
struct Frame {
    image: PathBuf,
    approach_m: f64,
    force_n: Option<f64>,
}

/// What a scene's images say.
///
/// ```no_run
/// use tactile_imaging::inclusion::{InclusionScene, LoadedInclusion};
/// let LoadedInclusion { rings, profiles } = InclusionScene::read("press/scene.toml")?.load()?;
/// println!("{} frames, the first one's centre at {:?}", profiles.len(), rings[0].centre_px);
/// # Ok::<(), tactile_imaging::scene::SceneError>(())
/// ```
#[derive(Clone, Debug)]
pub struct LoadedInclusion {
    /// Ring means of each frame.
    pub rings: Vec<RingMeans>,
    /// The same as the search takes them, at the radii of the first frame.
    pub profiles: Vec<PressureProfile>,
}

const LENGTH: &str = "a positive number (metres)";

impl InclusionScene {
    /// Reads and checks a scene file.
    ///
    /// # Errors
    /// [`SceneError`]: one sentence that names the file and the field.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let bytes = read_bytes(path).map_err(|error| SceneError::Open(Box::new(error)))?;
        Self::parse(&String::from_utf8_lossy(&bytes), path)
    }

    /// Checks the text of a scene file. Relative paths are relative to the folder of `file`.
    fn parse(text: &str, file: impl AsRef<Path>) -> Result<Self, SceneError> {
        let file = file.as_ref();
        let table = parse_table(text, file)?;
        let fields = Fields::new(file, &table);
        fields.only(&[
            "reference",
            "pixel_size_m",
            "calibration",
            "frames",
            "object",
            "waveguide",
        ])?;
        let folder = file.parent().unwrap_or(Path::new(""));
        let reference = fields.string("reference", "the path of the image without contact")?;
        Ok(Self {
            file: file.into(),
            reference: folder.join(reference),
            pixel_size_m: fields.positive_pair(
                "pixel_size_m",
                "two positive numbers [x, y] (metres per pixel)",
            )?,
            calibration: calibration(&fields, folder)?,
            frames: frames(&fields, folder)?,
            specimen: specimen(&fields)?,
            guide: guide(&fields)?,
        })
    }

    /// The images, in the order of the file.
    pub fn images(&self) -> Vec<&Path> {
        self.frames.iter().map(|f| f.image.as_path()).collect()
    }

    /// Reads the images and takes their ring means.
    ///
    /// The scale from light to pressure is the calibration's slope: p = s I / A with s in newtons per
    /// grey level and the area A of a pixel. Without a calibration the force spread over the picture gives
    /// it, and is then not counted once more as a measurement.
    ///
    /// # Errors
    /// [`SceneError::File`] and [`SceneError::SizeMismatch`] for images that cannot be read or differ in
    /// size. [`SceneError::Unusable`] where a frame shows no face.
    pub fn load(&self) -> Result<LoadedInclusion, SceneError> {
        let reference = self.image("reference".into(), &self.reference)?;
        let newtons_per_grey = self.newtons_per_grey()?;
        let area = self.pixel_size_m[0] * self.pixel_size_m[1];
        let mut rings = Vec::with_capacity(self.frames.len());
        for (index, frame) in self.frames.iter().enumerate() {
            let field = format!("frames[{}].image", index + 1);
            let image = self.image(field.clone(), &frame.image)?;
            if image.dim() != reference.dim() {
                let size = |image: &Array2<f64>| [image.nrows() as u32, image.ncols() as u32];
                return Err(SceneError::SizeMismatch {
                    file: self.file.clone(),
                    field,
                    image: frame.image.clone(),
                    reference: self.reference.clone(),
                    expected: size(&reference),
                    found: size(&image),
                });
            }
            let brightening = image - &reference;
            let newtons = newtons_per_grey
                .or_else(|| frame.force_n.map(|force| force / brightening.sum()))
                .ok_or_else(|| SceneError::Unusable {
                    file: self.file.clone(),
                    field: format!("frames[{}].force_N", index + 1),
                    reason: "without a [calibration] every frame needs its force".into(),
                })?;
            let means = ring_means(
                &brightening.view(),
                self.pixel_size_m,
                newtons / area,
                self.guide.radius_m(),
            );
            rings.push(means.map_err(|error| SceneError::Unusable {
                file: self.file.clone(),
                field,
                reason: error.to_string(),
            })?);
        }
        let radii = rings
            .first()
            .map(|first| first.radii_m.clone())
            .unwrap_or_default();
        let profiles = (self.frames.iter().zip(&rings))
            .map(|(frame, means)| PressureProfile {
                approach_m: frame.approach_m,
                force_n: frame.force_n.filter(|_| newtons_per_grey.is_some()),
                pressure_pa: resampled(means, &means.pressure_pa, &radii),
                standard_error_pa: resampled(means, &means.standard_error_pa, &radii),
            })
            .collect();
        Ok(LoadedInclusion { rings, profiles })
    }

    fn newtons_per_grey(&self) -> Result<Option<f64>, SceneError> {
        let Some(path) = &self.calibration else {
            return Ok(None);
        };
        let field = "calibration.pairs";
        let pairs = read_pairs(path).map_err(|source| SceneError::File {
            file: self.file.clone(),
            field: field.into(),
            source: Box::new(source),
        })?;
        let unusable = |reason: String| SceneError::Unusable {
            file: self.file.clone(),
            field: field.into(),
            reason,
        };
        let line = LinearCalibration::fit(&pairs, &CalibrationOptions::default())
            .map_err(|error| unusable(error.to_string()))?;
        let slope = line.force_n(1.0) - line.force_n(0.0);
        if slope > 0.0 {
            Ok(Some(slope))
        } else {
            Err(unusable("force does not grow with the light".into()))
        }
    }

    fn image(&self, field: String, path: &Path) -> Result<Array2<f64>, SceneError> {
        let image =
            read_grey_image(path, Grey::default(), None).map_err(|source| SceneError::File {
                file: self.file.clone(),
                field,
                source: Box::new(source),
            })?;
        Ok(image.to_u8().mapv(f64::from))
    }
}

/// Values at the radii of another frame, whose centre lies a fraction of a pixel elsewhere.
fn resampled(means: &RingMeans, values: &[f64], radii: &[f64]) -> Vec<f64> {
    let at = |radius: f64| {
        let last = means.radii_m.len() - 1;
        let after = means
            .radii_m
            .partition_point(|r| *r < radius)
            .clamp(1, last);
        let (a, b) = (means.radii_m[after - 1], means.radii_m[after]);
        let part = ((radius - a) / (b - a)).clamp(0.0, 1.0);
        values[after - 1] + part * (values[after] - values[after - 1])
    };
    radii.iter().map(|&radius| at(radius)).collect()
}

fn calibration(fields: &Fields<'_>, folder: &Path) -> Result<Option<PathBuf>, SceneError> {
    if !fields.has("calibration") {
        return Ok(None);
    }
    let fields = fields.table("calibration", "a table with `pairs`")?;
    fields.only(&["pairs"])?;
    let path = fields.string(
        "pairs",
        "the path of a CSV file (integrated_pixel_value,force_N)",
    )?;
    Ok(Some(folder.join(path)))
}

fn frames(fields: &Fields<'_>, folder: &Path) -> Result<Vec<Frame>, SceneError> {
    let tables = fields.tables(
        "frames",
        "one or more [[frames]] tables with `image` and `approach_m`",
    )?;
    let mut last = 0.0;
    let mut frames = Vec::with_capacity(tables.len());
    for table in &tables {
        table.only(&["image", "approach_m", "force_N"])?;
        let image = folder.join(table.string("image", "the path of an image")?);
        let grows = |approach: f64| positive(approach) && approach > last;
        let approach_m = table.number(
            "approach_m",
            "a positive number (metres), greater than that of the frame before",
            grows,
        )?;
        last = approach_m;
        let force_n = table.optional_number("force_N", "a positive number (newtons)", positive)?;
        frames.push(Frame {
            image,
            approach_m,
            force_n,
        });
    }
    Ok(frames)
}

fn specimen(fields: &Fields<'_>) -> Result<Specimen, SceneError> {
    const SHAPE: &str = "\"block\"";
    const RATIO: &str = "a number above -1, at most 0.4999";
    const INTERFACE: &str = "\"bonded\" or \"frictionless\", or absent: both are tried";
    let fields = fields.table("object", "a table with `shape = \"block\"`")?;
    fields.only(&[
        "shape",
        "height_m",
        "height_error_m",
        "radius_m",
        "poisson_ratio",
        "poisson_ratio_error",
        "youngs_modulus_pa",
        "youngs_modulus_error_pa",
        "approach_error_m",
        "interface",
    ])?;
    let shape = fields.string("shape", SHAPE)?;
    if shape != "block" {
        return Err(fields.wrong("shape", SHAPE, &toml::Value::String(shape.into())));
    }
    let height = fields.number("height_m", LENGTH, positive)?;
    let radius = fields.number("radius_m", LENGTH, positive)?;
    let refused = |error: crate::elasticity::ElasticityError| fields.unusable("object", &error);
    let mut specimen = Specimen::new(height, radius).map_err(refused)?;
    if let Some(error) = fields.optional_number("height_error_m", LENGTH, positive)? {
        specimen = specimen.with_height_error_m(error).map_err(refused)?;
    }
    if let Some(error) = fields.optional_number("approach_error_m", LENGTH, positive)? {
        specimen = specimen.with_approach_error_m(error).map_err(refused)?;
    }
    let accept = |ratio: f64| poisson(ratio) && ratio <= 0.4999;
    let ratio = fields.optional_number("poisson_ratio", RATIO, accept)?;
    let error = fields.optional_number("poisson_ratio_error", "a positive number", positive)?;
    if ratio.is_some() || error.is_some() {
        specimen = specimen
            .with_poisson_ratio(ratio.unwrap_or(0.495), error.unwrap_or(0.005))
            .map_err(refused)?;
    }
    const MODULUS: &str = "a positive number (pascals)";
    let modulus = fields.optional_number("youngs_modulus_pa", MODULUS, positive)?;
    let error = fields.optional_number("youngs_modulus_error_pa", MODULUS, positive)?;
    if let Some(value) = modulus {
        // A modulus from a textbook or another laboratory: a tenth.
        let error = error.unwrap_or(0.1 * value);
        specimen = specimen
            .with_youngs_modulus(value, error)
            .map_err(refused)?;
    }
    if fields.has("interface") {
        specimen = specimen.with_interface(match fields.string("interface", INTERFACE)? {
            "bonded" => Interface::Bonded,
            "frictionless" => Interface::Frictionless,
            other => {
                let found = toml::Value::String(other.into());
                return Err(fields.wrong("interface", INTERFACE, &found));
            }
        });
    }
    Ok(specimen)
}

fn guide(fields: &Fields<'_>) -> Result<Guide, SceneError> {
    let fields = fields.table("waveguide", "a table with `radius_m` and `layers`")?;
    fields.only(&["radius_m", "layers"])?;
    let radius = fields.number("radius_m", LENGTH, positive)?;
    let tables = fields.tables(
        "layers",
        "an array of one or more tables, from the block's side to the glass",
    )?;
    let mut layers = Vec::with_capacity(tables.len());
    for table in &tables {
        // The refractive index of a layer plays no part, but stands in files of the same sensor.
        table.only(&[
            "refractive_index",
            "thickness_m",
            "youngs_modulus_pa",
            "poisson_ratio",
        ])?;
        let modulus = table.number("youngs_modulus_pa", "a positive number (pascals)", positive)?;
        let accept = |ratio: f64| poisson(ratio) && ratio <= 0.4999;
        let ratio = table
            .optional_number("poisson_ratio", "a number above -1, at most 0.4999", accept)?
            .unwrap_or(0.495);
        let material = Material::new(modulus, ratio)
            .map_err(|error| table.unusable("poisson_ratio", &error))?;
        layers.push(GuideLayer {
            thickness_m: table.number("thickness_m", LENGTH, positive)?,
            material,
        });
    }
    Guide::new(layers, radius).map_err(|error| fields.unusable("layers", &error))
}
