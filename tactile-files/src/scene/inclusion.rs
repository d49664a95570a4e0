//! Scene files of a block pressed by the sensor's guide.
use super::data::force_pairs;
use crate::io::{
    FileError, beside, force, length, modulus, not_negative, number, one_or_more, pixel_size,
    positive, read_frame, read_toml,
};
use core::ops::ControlFlow;
use ndarray::Array2;
use serde::{Deserialize, Deserializer};
use std::error::Error;
use std::path::{Path, PathBuf};
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::fem::{Guide, GuideLayer, Interface, Material};
use tactile_imaging::force::{LinearCalibration, StressCalibration};
use tactile_imaging::inclusion::{
    FaceCells, InclusionEstimate, InclusionSearch, PressureProfile, Progress, RingMeans, Scan,
    ScanPress, SensorErrors, TissueBlock, asymmetry_warnings, ring_means, rounding_error,
};

/// Position error of a press in metres if the file states none. It is typical of placing the guide
/// by hand on lines drawn on the block, or by a simple robot.
const USUAL_POSITION_ERROR_M: f64 = 0.2e-3;

/// A block of tissue, the guide pressed onto it, and the frames.
///
/// A scan has `[[presses]]` instead of frames, each with `position_m` and `frames`.
/// `position_error_m` is the standard error of the positions (0.2 mm if absent).
///
/// ```
/// use tactile_files::scene::InclusionScene;
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
    /// The block, with the errors of its dimensions.
    pub specimen: TissueBlock,
    /// The guide.
    pub guide: Guide,
    file: PathBuf,
    reference: PathBuf,
    pixel_size_m: [f64; 2],
    calibration: Option<PathBuf>,
    presses: Vec<Press>,
    position_error_m: f64,
}

/// The frames of a press, and its position.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Press {
    position_m: [f64; 2],
    #[serde(deserialize_with = "one_or_more")]
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

/// The pressures in the images of a scene.
///
/// ```no_run
/// use tactile_files::scene::{InclusionScene, LoadedInclusion};
/// let LoadedInclusion { rings, profiles, .. } = InclusionScene::read("press/scene.toml")?.load()?;
/// println!("{} frames, the first one's centre at {:?}", profiles.len(), rings[0].centre_px);
/// # Ok::<(), tactile_files::io::FileError>(())
/// ```
#[derive(Clone, Debug)]
pub struct LoadedInclusion {
    /// The search in the scene's block, with the error of rounding of its reference frame.
    pub search: InclusionSearch,
    /// Ring means of each frame, one press after the other.
    pub rings: Vec<RingMeans>,
    /// Pressure profiles of the first press, at the radii of its first frame, for the search.
    pub profiles: Vec<PressureProfile>,
    /// The whole face at each press, on square cells within three quarters of its radius. It shows
    /// an inclusion off the axis.
    pub scan: Scan,
}

impl LoadedInclusion {
    /// First harmonic of the pressure around the axis over its mean, in the least symmetric frame.
    pub fn asymmetry(&self) -> f64 {
        self.rings.iter().map(|r| r.asymmetry).fold(0.0, f64::max)
    }

    /// Root mean square of the second to fourth harmonics, in the frame with the largest value.
    pub fn harmonics(&self) -> f64 {
        self.rings.iter().map(|r| r.harmonics).fold(0.0, f64::max)
    }

    /// Whether the search uses the ring means and assumes an inclusion under the axis. This holds
    /// for a single press with symmetric pressure.
    pub fn is_axial(&self) -> bool {
        self.scan.presses.len() == 1
            && asymmetry_warnings(self.asymmetry(), self.harmonics()).is_empty()
    }

    /// Searches the inclusion that fits the frames best. If [`is_axial`](Self::is_axial), it lies
    /// under the axis. Otherwise its position is fitted to the whole face of all presses.
    ///
    /// # Errors
    /// The errors of [`InclusionSearch::search_with_progress`].
    pub fn estimate(
        &self,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<InclusionEstimate, ElasticityError> {
        if self.is_axial() {
            let radii_m = &self.rings[0].radii_m;
            (self.search).search_with_progress(radii_m, &self.profiles, progress)
        } else {
            self.search.search_scan(&self.scan, progress)
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
        let is_scan = !file.presses.is_empty();
        let mut presses = file.presses;
        if is_scan != file.frames.is_empty() {
            let reason = "expected either frames or presses, each with its frames";
            return Err(FileError::field(path, "frames", reason));
        }
        if !is_scan {
            presses.push(Press {
                position_m: [0.0; 2],
                frames: file.frames,
            });
        }
        for (index, press) in presses.iter_mut().enumerate() {
            let field = |name: &str| press_field(is_scan.then_some(index), name);
            if !press.position_m.iter().all(|x| x.is_finite()) {
                return Err(FileError::field(
                    path,
                    field("position_m"),
                    "expected two numbers",
                ));
            }
            let mut last_m = 0.0;
            for (frame_index, frame) in press.frames.iter_mut().enumerate() {
                // The contact grows with the approach, and the search starts each frame from the
                // previous one.
                if frame.approach_m <= last_m {
                    let field = field(&format!("frames[{}].approach_m", frame_index + 1));
                    let reason = "expected an approach greater than that of the preceding frame";
                    return Err(FileError::field(path, field, reason));
                }
                last_m = frame.approach_m;
                frame.image = beside(path, &frame.image);
            }
        }
        let approaches = |press: &Press| -> Vec<f64> {
            press.frames.iter().map(|frame| frame.approach_m).collect()
        };
        let is_other = |press: &Press| approaches(press) != approaches(&presses[0]);
        if let Some(index) = presses.iter().position(is_other) {
            let field = format!("presses[{}].frames", index + 1);
            let reason = "expected the approaches of presses[1]";
            return Err(FileError::field(path, field, reason));
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
            presses,
            position_error_m: file.position_error_m.unwrap_or(USUAL_POSITION_ERROR_M),
        })
    }

    /// The paths of the images, in the order of the file.
    pub fn images(&self) -> Vec<&Path> {
        let frames = self.presses.iter().flat_map(|press| &press.frames);
        frames.map(|frame| frame.image.as_path()).collect()
    }

    /// Reads the images and computes their ring means.
    ///
    /// The scale from light to pressure is the slope of the calibration: p = s I / A, with s in
    /// newtons per grey level and the area A of a pixel. Without a calibration the force of each
    /// frame gives the scale, and is then not used again as a measurement.
    ///
    /// # Errors
    /// [`FileError`] if images cannot be read, differ in size or show no face.
    pub fn load(&self) -> Result<LoadedInclusion, FileError> {
        let reference = self.image("reference", &self.reference, None)?;
        let newtons_per_grey = self.newtons_per_grey()?;
        let area = self.pixel_size_m[0] * self.pixel_size_m[1];
        let mut rings: Vec<RingMeans> = Vec::new();
        let mut scan = Scan {
            presses: Vec::with_capacity(self.presses.len()),
            position_error_m: self.position_error_m,
        };
        let is_scan = self.presses.len() > 1;
        let mut zero_pa: f64 = 0.0;
        for (index, press) in self.presses.iter().enumerate() {
            let first = rings.len();
            let mut images = Vec::with_capacity(press.frames.len());
            for (number, frame) in press.frames.iter().enumerate() {
                let field = |name: &str| {
                    let name = format!("frames[{}].{name}", number + 1);
                    press_field(is_scan.then_some(index), &name)
                };
                let image = self.image(&field("image"), &frame.image, Some(reference.dim()))?;
                let brightening = image - &reference;
                let newtons = newtons_per_grey
                    .or_else(|| frame.force_n.map(|force| force / brightening.sum()))
                    .ok_or_else(|| {
                        let reason = "without a [calibration] every frame needs its force";
                        FileError::field(&self.file, field("force_N"), reason)
                    })?;
                zero_pa = zero_pa.max(rounding_error(&reference.view()) * newtons / area);
                let (size, face) = (self.pixel_size_m, self.guide.radius_m());
                let means = ring_means(&brightening.view(), size, newtons / area, face);
                rings.push(
                    means.map_err(|error| FileError::field(&self.file, field("image"), error))?,
                );
                images.push(brightening * (newtons / area));
            }
            scan.presses
                .push(self.face(press, &rings[first..], &images));
        }
        // The search compares frames ring by ring, so that all use the radii of the first.
        let first = rings.first().map(|first| first.radii_m.clone());
        let radii = first.unwrap_or_default();
        let profiles = self.presses[0].frames.iter().zip(&rings);
        let profiles = profiles.map(|(frame, means)| {
            // A force that gave the scale is not an independent measurement.
            let force_n = frame.force_n.filter(|_| newtons_per_grey.is_some());
            means.profile(&radii, frame.approach_m, force_n)
        });
        let errors = SensorErrors {
            zero_pa,
            ..SensorErrors::default()
        };
        let search = InclusionSearch::new(self.specimen, self.guide.clone())
            .and_then(|search| search.with_sensor_errors(errors))
            .map_err(|error| FileError::field(&self.file, "object", error))?;
        Ok(LoadedInclusion {
            search,
            profiles: profiles.collect(),
            rings,
            scan,
        })
    }

    /// The pressures of the frames of a press on cells of the face.
    fn face(&self, press: &Press, rings: &[RingMeans], images: &[Array2<f64>]) -> ScanPress {
        // Number of cells per radius. For a single press, cells are half as wide as the narrowest
        // inclusion that can be seen. The search time grows as the third power of the total number
        // of cells.
        let fineness = if self.presses.len() == 1 { 15.0 } else { 8.0 };
        // The face does not move in the picture, so that the mean of the centres is the best
        // estimate.
        let mean = |axis: usize| {
            let centres = rings.iter().map(|rings| rings.centre_px[axis]);
            centres.sum::<f64>() / rings.len() as f64
        };
        let size = images.first().map_or((0, 0), Array2::dim);
        let (centre, face) = ([mean(0), mean(1)], self.guide.radius_m());
        let cells = FaceCells::new(size, centre, self.pixel_size_m, face, face / fineness);
        let frames = press.frames.iter().zip(rings).zip(images);
        let frames = frames.map(|((frame, rings), image)| PressureProfile {
            approach_m: frame.approach_m,
            force_n: None,
            pressure_pa: cells.means(&image.view()),
            standard_error_pa: cells.errors(rings.pixel_noise_pa),
        });
        ScanPress {
            axis_m: press.position_m,
            frames: frames.collect(),
            positions_m: cells.positions_m.clone(),
        }
    }

    fn newtons_per_grey(&self) -> Result<Option<f64>, FileError> {
        let Some(path) = &self.calibration else {
            return Ok(None);
        };
        let unusable = |reason| FileError::field(&self.file, "calibration.pairs", reason);
        let pairs = force_pairs(path).map_err(|error| unusable(error.into()))?;
        let line = LinearCalibration::fit(&pairs)
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

/// Name of a field of a press. `press` is its index from zero, or `None` in a file without presses.
fn press_field(press: Option<usize>, name: &str) -> String {
    match press {
        Some(index) => format!("presses[{}].{name}", index + 1),
        None => name.to_owned(),
    }
}

/// The fields of an inclusion scene, unchecked.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InclusionFile {
    reference: PathBuf,
    #[serde(deserialize_with = "pixel_size")]
    pixel_size_m: [f64; 2],
    calibration: Option<PairsTable>,
    #[serde(default, deserialize_with = "one_or_more")]
    frames: Vec<Frame>,
    #[serde(default, deserialize_with = "one_or_more")]
    presses: Vec<Press>,
    #[serde(default, deserialize_with = "not_negative")]
    position_error_m: Option<f64>,
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
    #[serde(default, deserialize_with = "not_negative")]
    each_approach_error_m: Option<f64>,
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

/// A Poisson ratio that the finite elements can use.
fn compressible<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    let expected = "a number above -1, at most 0.4999";
    number(d, expected, |v| v > -1.0 && v <= 0.4999)
}

impl BlockTable {
    fn specimen(&self) -> Result<TissueBlock, ElasticityError> {
        let mut specimen = TissueBlock::new(self.height_m, self.radius_m)?;
        if let Some(error) = self.height_error_m {
            specimen = specimen.with_height_error_m(error)?;
        }
        if let Some(error) = self.approach_error_m {
            specimen = specimen.with_approach_error_m(error)?;
        }
        if let Some(error) = self.each_approach_error_m {
            specimen = specimen.with_each_approach_error_m(error)?;
        }
        if self.poisson_ratio.is_some() || self.poisson_ratio_error.is_some() {
            let ratio = self.poisson_ratio.unwrap_or(0.495);
            specimen =
                specimen.with_poisson_ratio(ratio, self.poisson_ratio_error.unwrap_or(0.005))?;
        }
        if let Some(modulus) = self.youngs_modulus_pa {
            // A modulus from the literature or another laboratory is accurate to some 10 %.
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
    /// Not used here, but present in files of the same sensor.
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
