//! Scene files of a block pressed by the sensor's guide.
use super::rings::{FaceCells, RingMeans, interpolated, ring_means};
use crate::elasticity::ElasticityError;
use crate::force::{CalibrationOptions, LinearCalibration, StressCalibration};
use crate::io::{
    FileError, beside, force, length, modulus, number, one_or_more, pixel_size, positive,
    read_frame, read_toml,
};
use crate::scene::force_pairs;
use core::ops::ControlFlow;
use ndarray::Array2;
use serde::{Deserialize, Deserializer};
use std::error::Error;
use std::path::{Path, PathBuf};
use tactile_fem::{Guide, GuideLayer, Interface, Material};
use tactile_inclusion::{
    InclusionEstimate, InclusionSearch, PressureProfile, SearchProgress, Specimen,
    asymmetry_warnings,
};

/// A block of tissue, the guide pressed onto it, and the frames.
///
/// ```
/// use tactile_imaging::inclusion::InclusionScene;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("scene.toml");
/// let text = r#"
///     reference = "reference.png"            # the sensor without contact
///     pixel_size_m = [86e-6, 86e-6]          # x, y, on the face
///     ## Columns integrated_pixel_value,force_N. Without it every frame needs force_N.
///     calibration = { pairs = "pairs.csv" }
///     frames = [
///         { image = "one.png", approach_m = 1e-3, force_N = 0.35 },
///         { image = "two.png", approach_m = 2e-3, force_N = 0.71 },
///     ]
///     [object]
///     shape = "block"
///     height_m = 30e-3
///     radius_m = 40e-3
///     interface = "bonded"                   # or "frictionless", or absent to try both
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
    /// The block, with the errors of its sizes.
    pub specimen: Specimen,
    /// The guide.
    pub guide: Guide,
    file: PathBuf,
    reference: PathBuf,
    pixel_size_m: [f64; 2],
    calibration: Option<PathBuf>,
    frames: Vec<Frame>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Frame {
    image: PathBuf,
    #[serde(deserialize_with = "length")]
    approach_m: f64,
    #[serde(default, rename = "force_N", deserialize_with = "force")]
    force_n: Option<f64>,
}

/// The pressures of a scene's images.
///
/// ```no_run
/// use tactile_imaging::inclusion::{InclusionScene, LoadedInclusion};
/// let LoadedInclusion { rings, profiles, .. } = InclusionScene::read("press/scene.toml")?.load()?;
/// println!("{} frames, the first one's centre at {:?}", profiles.len(), rings[0].centre_px);
/// # Ok::<(), tactile_imaging::io::FileError>(())
/// ```
#[derive(Clone, Debug)]
pub struct LoadedInclusion {
    /// Ring means of each frame.
    pub rings: Vec<RingMeans>,
    /// The same as the search takes them, at the radii of the first frame.
    pub profiles: Vec<PressureProfile>,
    /// The whole face, which shows a lump off the axis.
    pub face: FacePicture,
}

/// Pressures on square cells within three quarters of a face's radius.
///
/// ```no_run
/// use tactile_imaging::inclusion::InclusionScene;
/// let face = InclusionScene::read("press/scene.toml")?.load()?.face;
/// println!("{} cells, the first one at {:?}", face.positions_m.len(), face.positions_m[0]);
/// # Ok::<(), tactile_imaging::io::FileError>(())
/// ```
#[derive(Clone, Debug)]
pub struct FacePicture {
    /// Middles (x, y) of the cells, in metres from the face's centre.
    pub positions_m: Vec<[f64; 2]>,
    /// Each frame's pressures.
    pub profiles: Vec<PressureProfile>,
}

impl LoadedInclusion {
    /// First harmonic of the pressure around the axis over its mean, of the least symmetric frame.
    pub fn asymmetry(&self) -> f64 {
        self.rings.iter().map(|r| r.asymmetry).fold(0.0, f64::max)
    }

    /// Root mean square of the second to fourth harmonics of that frame which has most of them.
    pub fn harmonics(&self) -> f64 {
        self.rings.iter().map(|r| r.harmonics).fold(0.0, f64::max)
    }

    /// The lump that explains the frames best: one under the axis from the ring means where the
    /// pressure is symmetric, else one anywhere from the whole face.
    ///
    /// # Errors
    /// Those of [`InclusionSearch::search_with_progress`].
    pub fn search(
        &self,
        search: &InclusionSearch,
        progress: &mut dyn FnMut(SearchProgress) -> ControlFlow<()>,
    ) -> Result<InclusionEstimate, ElasticityError> {
        if asymmetry_warnings(self.asymmetry(), self.harmonics()).is_empty() {
            let radii_m = &self.rings[0].radii_m;
            search.search_with_progress(radii_m, &self.profiles, progress)
        } else {
            let face = &self.face;
            search.search_picture(&face.positions_m, &face.profiles, progress)
        }
    }
}

impl InclusionScene {
    /// Reads and checks a scene file. Relative paths are relative to its folder.
    ///
    /// # Errors
    /// [`FileError`]: one sentence that names the file and the field.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FileError> {
        Self::from_file(path.as_ref())
    }

    /// Not generic, so that the parser is compiled once, not again in every crate that reads.
    fn from_file(path: &Path) -> Result<Self, FileError> {
        let file: InclusionFile = read_toml(path)?;
        let mut frames = file.frames;
        let mut last_m = 0.0;
        for (index, frame) in frames.iter_mut().enumerate() {
            // Contact grows with the approach, and the search starts each frame from the one
            // before.
            if frame.approach_m <= last_m {
                let field = format!("frames[{}].approach_m", index + 1);
                let reason = "expected an approach greater than that of the frame before";
                return Err(FileError::field(path, field, reason));
            }
            last_m = frame.approach_m;
            frame.image = beside(path, &frame.image);
        }
        let specimen = file.object.specimen();
        let guide = file.waveguide.guide();
        Ok(Self {
            specimen: specimen.map_err(|error| FileError::field(path, "object", error))?,
            guide: guide.map_err(|error| FileError::field(path, "waveguide.layers", error))?,
            file: path.into(),
            reference: beside(path, &file.reference),
            pixel_size_m: file.pixel_size_m,
            calibration: file.calibration.map(|table| beside(path, &table.pairs)),
            frames,
        })
    }

    /// The images, in the order of the file.
    pub fn images(&self) -> Vec<&Path> {
        self.frames.iter().map(|f| f.image.as_path()).collect()
    }

    /// Reads the images and takes their ring means.
    ///
    /// The scale from light to pressure is the calibration's slope: p = s I / A with s in newtons
    /// per grey level and the area A of a pixel. Without a calibration the force spread over the
    /// picture gives it, and is then not counted once more as a measurement.
    ///
    /// # Errors
    /// [`FileError`] for images that cannot be read, differ in size or show no face.
    pub fn load(&self) -> Result<LoadedInclusion, FileError> {
        let reference = self.image("reference", &self.reference, None)?;
        let newtons_per_grey = self.newtons_per_grey()?;
        let area = self.pixel_size_m[0] * self.pixel_size_m[1];
        let mut rings = Vec::with_capacity(self.frames.len());
        let mut images = Vec::with_capacity(self.frames.len());
        for (index, frame) in self.frames.iter().enumerate() {
            let field = format!("frames[{}].image", index + 1);
            let image = self.image(&field, &frame.image, Some(reference.dim()))?;
            let brightening = image - &reference;
            let newtons = newtons_per_grey
                .or_else(|| frame.force_n.map(|force| force / brightening.sum()))
                .ok_or_else(|| {
                    let field = format!("frames[{}].force_N", index + 1);
                    let reason = "without a [calibration] every frame needs its force";
                    FileError::field(&self.file, field, reason)
                })?;
            let (size, face) = (self.pixel_size_m, self.guide.radius_m());
            let means = ring_means(&brightening.view(), size, newtons / area, face);
            rings.push(means.map_err(|error| FileError::field(&self.file, field, error))?);
            images.push(brightening * (newtons / area));
        }
        // The search compares frames ring by ring, so all are taken at the radii of the first.
        let first = rings.first().map(|first| first.radii_m.clone());
        let radii = first.unwrap_or_default();
        let profiles = self.frames.iter().zip(&rings).map(|(frame, means)| {
            let resampled = |values: &[f64]| -> Vec<f64> {
                let at = |&radius| interpolated(&means.radii_m, values, radius);
                radii.iter().map(at).collect()
            };
            PressureProfile {
                approach_m: frame.approach_m,
                // A force that gave the scale is no measurement of its own.
                force_n: frame.force_n.filter(|_| newtons_per_grey.is_some()),
                pressure_pa: resampled(&means.pressure_pa),
                standard_error_pa: resampled(&means.standard_error_pa),
            }
        });
        let profiles = profiles.collect();
        Ok(LoadedInclusion {
            face: self.face(&rings, &images),
            profiles,
            rings,
        })
    }

    /// The pressures of all frames on cells of the face.
    fn face(&self, rings: &[RingMeans], images: &[Array2<f64>]) -> FacePicture {
        // The face does not move in the picture: the mean of its centres is nearest to it.
        let mean = |axis: usize| {
            let centres = rings.iter().map(|rings| rings.centre_px[axis]);
            centres.sum::<f64>() / rings.len() as f64
        };
        let size = images.first().map_or((0, 0), Array2::dim);
        let centre = [mean(0), mean(1)];
        let cells = FaceCells::new(size, centre, self.pixel_size_m, self.guide.radius_m());
        let frames = self.frames.iter().zip(rings).zip(images);
        let profiles = frames.map(|((frame, rings), image)| PressureProfile {
            approach_m: frame.approach_m,
            force_n: None,
            pressure_pa: cells.means(&image.view()),
            standard_error_pa: cells.errors(rings.pixel_noise_pa),
        });
        FacePicture {
            profiles: profiles.collect(),
            positions_m: cells.positions_m.clone(),
        }
    }

    fn newtons_per_grey(&self) -> Result<Option<f64>, FileError> {
        let Some(path) = &self.calibration else {
            return Ok(None);
        };
        let unusable = |reason| FileError::field(&self.file, "calibration.pairs", reason);
        let pairs = force_pairs(path).map_err(|error| unusable(error.into()))?;
        let line = LinearCalibration::fit(&pairs, &CalibrationOptions::default())
            .map_err(|error| unusable(Box::<dyn Error + Send + Sync>::from(error)))?;
        let slope = line.force_n(1.0) - line.force_n(0.0);
        if slope > 0.0 {
            Ok(Some(slope))
        } else {
            Err(unusable("force does not grow with the light".into()))
        }
    }

    fn image(
        &self,
        field: &str,
        path: &Path,
        size: Option<(usize, usize)>,
    ) -> Result<Array2<f64>, FileError> {
        Ok(read_frame(&self.file, field, path, None, size)?.mapv(f64::from))
    }
}

/// An inclusion scene as it stands in its file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InclusionFile {
    reference: PathBuf,
    #[serde(deserialize_with = "pixel_size")]
    pixel_size_m: [f64; 2],
    calibration: Option<PairsTable>,
    #[serde(deserialize_with = "one_or_more")]
    frames: Vec<Frame>,
    object: BlockTable,
    waveguide: GuideTable,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PairsTable {
    pairs: PathBuf,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BlockTable {
    #[serde(rename = "shape")]
    _shape: BlockShape,
    #[serde(deserialize_with = "length")]
    height_m: f64,
    #[serde(default, deserialize_with = "positive")]
    height_error_m: Option<f64>,
    #[serde(deserialize_with = "length")]
    radius_m: f64,
    #[serde(default, deserialize_with = "compressible")]
    poisson_ratio: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    poisson_ratio_error: Option<f64>,
    #[serde(default, deserialize_with = "modulus")]
    youngs_modulus_pa: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    youngs_modulus_error_pa: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    approach_error_m: Option<f64>,
    interface: Option<InterfaceName>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum BlockShape {
    Block,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum InterfaceName {
    Bonded,
    Frictionless,
}

/// A Poisson ratio that finite elements take.
fn compressible<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    let expected = "a number above -1, at most 0.4999";
    number(d, expected, |v| v > -1.0 && v <= 0.4999)
}

impl BlockTable {
    fn specimen(&self) -> Result<Specimen, ElasticityError> {
        let mut specimen = Specimen::new(self.height_m, self.radius_m)?;
        if let Some(error) = self.height_error_m {
            specimen = specimen.with_height_error_m(error)?;
        }
        if let Some(error) = self.approach_error_m {
            specimen = specimen.with_approach_error_m(error)?;
        }
        if self.poisson_ratio.is_some() || self.poisson_ratio_error.is_some() {
            let ratio = self.poisson_ratio.unwrap_or(0.495);
            specimen =
                specimen.with_poisson_ratio(ratio, self.poisson_ratio_error.unwrap_or(0.005))?;
        }
        if let Some(modulus) = self.youngs_modulus_pa {
            // A modulus from a textbook or another laboratory is good to a tenth.
            let error = self.youngs_modulus_error_pa.unwrap_or(0.1 * modulus);
            specimen = specimen.with_youngs_modulus(modulus, error)?;
        }
        Ok(match self.interface {
            None => specimen,
            Some(InterfaceName::Bonded) => specimen.with_interface(Interface::Bonded),
            Some(InterfaceName::Frictionless) => specimen.with_interface(Interface::Frictionless),
        })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GuideTable {
    #[serde(deserialize_with = "length")]
    radius_m: f64,
    #[serde(deserialize_with = "one_or_more")]
    layers: Vec<LayerTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LayerTable {
    /// It plays no part, but stands in files of the same sensor.
    #[serde(rename = "refractive_index")]
    _refractive_index: Option<f64>,
    #[serde(deserialize_with = "length")]
    thickness_m: f64,
    #[serde(deserialize_with = "modulus")]
    youngs_modulus_pa: f64,
    #[serde(default, deserialize_with = "compressible")]
    poisson_ratio: Option<f64>,
}

impl GuideTable {
    fn guide(&self) -> Result<Guide, ElasticityError> {
        let layer = |layer: &LayerTable| {
            let ratio = layer.poisson_ratio.unwrap_or(0.495);
            Ok(GuideLayer {
                thickness_m: layer.thickness_m,
                material: Material::new(layer.youngs_modulus_pa, ratio)?,
            })
        };
        let layers = self.layers.iter().map(layer);
        Guide::new(
            layers.collect::<Result<_, ElasticityError>>()?,
            self.radius_m,
        )
    }
}
