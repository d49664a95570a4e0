//! Reads the files of a scene, checks them against each other, and builds the pipeline.
use super::file::guide;
use super::{CalibrationSource, Scene, SceneCheck, read_contact_table};
use crate::io::{FileError, FilePlace, InputQuantity, read_columns, read_frame, read_grey_levels};
use crate::sensor::Sensor;
use ndarray::{Array2, ArrayView2};
use std::error::Error;
use std::path::Path;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::elasticity::contact::ContactTable;
use tactile_imaging::elasticity::modulus::TabulatedContact;
use tactile_imaging::force::{
    CalibrationPair, ContactOptions, DriftCorrection, Estimate, ForceOptions, ReferenceFrame,
};
use tactile_imaging::pipeline::{
    CheckPress, CheckedObject, DarkContact, EstimatorChoice, LightContact, Measurement, Object,
    Pipeline, PipelineError, Press, ReferenceLight, SurfaceInput,
};

/// The calibration of a scene, read from its files.
///
/// ```
/// use tactile_imaging::force::CalibrationPair;
/// use tactile_files::scene::LoadedCalibration;
/// let name = |calibration: &LoadedCalibration| match calibration {
///     LoadedCalibration::Pairs(pairs) => format!("pairs to {} N", pairs[1].force_n),
///     LoadedCalibration::Gauge => "a gauge's forces".into(),
///     LoadedCalibration::Sensor(sensor) => format!("of {}", sensor.date),
///     LoadedCalibration::DepthTable(rows) => format!("down to {} m", rows[1].1),
/// };
/// let pairs = [0.0, 1.0].map(|f| CalibrationPair::loading(1e5 * f, f)).to_vec();
/// assert_eq!(name(&LoadedCalibration::Pairs(pairs)), "pairs to 1 N");
/// let depths = LoadedCalibration::DepthTable(vec![(0.0, 0.0), (60.0, 1.9e-3)]);
/// assert_eq!(name(&depths), "down to 0.0019 m");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum LoadedCalibration {
    /// Pairs of integrated pixel value and force.
    Pairs(Vec<CalibrationPair>),
    /// Pairs of darkness in grey levels and depth in metres.
    DepthTable(Vec<(f64, f64)>),
    /// No calibration, because a gauge read the forces.
    Gauge,
    /// A calibrated sensor with its curve, lens and layers.
    Sensor(Box<Sensor>),
}

/// The images and the calibration of a scene.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_simulate::{CalibrationRun, Camera, PressOptions, PressScene, write_folder};
/// use tactile_files::scene::{LoadedCalibration, Scene};
/// let camera = Camera::default().coarser(16);
/// let made = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// let folder = tempfile::tempdir()?;
/// let calibration = CalibrationRun { steps: 8, ..CalibrationRun::default() };
/// let path = write_folder(&made, &made.calibrate(&calibration)?, folder.path())?;
/// let data = Scene::read(&path)?.load()?; // a calibration up to 2 N in 8 steps and back
/// assert!(data.frames.iter().all(|frame| frame.dim() == data.reference.dim()));
/// let LoadedCalibration::Pairs(pairs) = &data.calibration else { unreachable!() };
/// assert!(pairs.len() == 17 && (pairs[8].force_n - 2.0).abs() < 0.01);
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SceneData {
    /// The frame without contact.
    pub reference: Array2<u8>,
    /// The frames, in the order of the scene. Frames missing here are read from their files
    /// whenever a stage needs them.
    pub frames: Vec<Array2<u8>>,
    /// The calibration.
    pub calibration: LoadedCalibration,
    /// The light of the calibration's own frame without contact, if the scene names one.
    pub calibrated_light: Option<ReferenceLight>,
    /// The contact table, if the scene names one.
    pub contact_table: Option<ContactTable>,
    /// The images of the presses of known force, in the order of the scene.
    pub checks: Vec<Array2<u8>>,
}

impl Scene {
    /// Reads the images and the calibration, and checks that all images have one size. If the
    /// frames do not fit into memory, use [`measure_file`](Self::measure_file), which keeps only a
    /// few of them.
    ///
    /// # Errors
    /// [`FileError`], which names the field and the file.
    pub fn load(&self) -> Result<SceneData, FileError> {
        let mut data = self.load_without_frames()?;
        let reference = data.reference.view();
        let frames = (0..self.frames.len()).map(|index| self.read_frame(index, reference));
        data.frames = frames.collect::<Result<_, _>>()?;
        Ok(data)
    }

    /// Does the same as [`load`](Self::load) without the frames. A [`press`](Self::press) then
    /// reads each frame when it is added and again when a stage needs it, so that memory does not
    /// limit their number.
    ///
    /// # Errors
    /// [`FileError`], which names the field and the file.
    pub fn load_without_frames(&self) -> Result<SceneData, FileError> {
        let in_field = |field: &str, error: Box<dyn Error + Send + Sync>| {
            FileError::field(&self.file, field, error)
        };
        let reference = read_frame(&self.file, "reference", &self.reference, self.bits, None)?;
        let calibration = match &self.calibration {
            CalibrationSource::Gauge => LoadedCalibration::Gauge,
            CalibrationSource::Sensor(path) => {
                LoadedCalibration::Sensor(Box::new(Sensor::read(path)?))
            }
            CalibrationSource::Pairs(path) => LoadedCalibration::Pairs(
                force_pairs(path).map_err(|error| in_field("calibration.pairs", error.into()))?,
            ),
            CalibrationSource::DepthTable(path) => {
                let darkness = (&["darkness"][..], "grey_levels");
                let [darkness, depth] = read_columns(path, [darkness, (&["depth"], "mm")])
                    .map_err(|error| in_field("calibration.depth_table", error.into()))?;
                let rows: Vec<_> = darkness.into_iter().zip(depth).collect();
                if let Some(reason) = doubt_of_depths(&rows) {
                    return Err(in_field("calibration.depth_table", reason.into()));
                }
                LoadedCalibration::DepthTable(rows)
            }
        };
        let light = self.calibration_reference.as_ref().map(|path| {
            let (field, size) = ("calibration.reference", Some(reference.dim()));
            let image = read_frame(&self.file, field, path, self.bits, size)?;
            let frame = ReferenceFrame::new(image.view()).map_err(|e| in_field(field, e.into()))?;
            Ok::<_, FileError>(ReferenceLight::of(&frame))
        });
        let calibrated_light = light.transpose()?;
        let checks = self.checks.iter().enumerate().map(|(k, check)| {
            let field = format!("check[{}].image", k + 1);
            let size = Some(reference.dim());
            read_frame(&self.file, &field, &check.image, self.bits, size)
        });
        let checks = checks.collect::<Result<_, _>>()?;
        // Errors of a contact table or a sensor file name fields of that file.
        let contact_table = self.contact_table.as_ref().map(read_contact_table);
        Ok(SceneData {
            reference,
            frames: Vec::new(),
            calibration,
            calibrated_light,
            contact_table: contact_table.transpose()?,
            checks,
        })
    }

    /// The image of a frame, which must have the size of the reference.
    fn read_frame(
        &self,
        index: usize,
        reference: ArrayView2<'_, u8>,
    ) -> Result<Array2<u8>, FileError> {
        let field = format!("frames[{}].image", index + 1);
        let (path, size) = (&self.frames[index].image, Some(reference.dim()));
        read_frame(&self.file, &field, path, self.bits, size)
    }

    /// Reads a scene file with its images and runs all stages.
    ///
    /// If a stage fails, its error takes the place of its result in the [`Measurement`].
    /// [`measure_error`](Self::measure_error) adds the field of the scene file to the error.
    ///
    /// ```
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// use tactile_simulate::{CalibrationRun, Camera, PressLoad, PressOptions, PressScene};
    /// use tactile_simulate::write_folder;
    /// use tactile_files::scene::Scene;
    /// let camera = Camera::default().coarser(16);
    /// let loads = vec![PressLoad::normal(0.7)];
    /// let made = PressScene::new(PressOptions { camera, loads, ..Default::default() })?;
    /// let folder = tempfile::tempdir()?;
    /// let calibration = CalibrationRun { steps: 8, ..CalibrationRun::default() };
    /// let path = write_folder(&made, &made.calibrate(&calibration)?, folder.path())?;
    /// let measured = Scene::measure_file(&path)?; // one frame, of a ball pressed with 0.7 N
    /// let frame = measured.frames[0].as_ref().expect("a contact");
    /// let force = frame.force_n.as_ref().expect("a calibration").value;
    /// assert!((force / 0.7 - 1.0).abs() < 0.03);
    /// let modulus = measured.youngs_modulus_pa?;
    /// assert_eq!(modulus.estimator.to_string(), "Hertz sphere");
    /// assert!(measured.strain.is_err(), "strain takes two frames");
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// [`FileError`]: one sentence that names the file and the field.
    pub fn measure_file(path: impl AsRef<Path>) -> Result<Measurement, FileError> {
        Self::read(path)?.measure()
    }

    fn measure(&self) -> Result<Measurement, FileError> {
        let data = self.load_without_frames()?;
        let press = self.press(&self.pipeline(&data)?, &data)?;
        Ok(press.measure())
    }

    /// The pipeline for the sensor and the object of this scene, with the stages that it names.
    ///
    /// ```
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// use tactile_imaging::force::CalibrationPair;
    /// use tactile_files::scene::{LoadedCalibration, Scene, SceneData};
    /// let scene = Scene::parse(r#"
    ///     reference = "reference.png"
    ///     pixel_size_m = [2e-5, 2e-5]
    ///     calibration = { pairs = "pairs.csv" }
    ///     frames = [{ image = "one.png" }]
    ///     object = { shape = "unknown" }
    ///     stages = { strain = "hencky" }
    ///     [waveguide]
    ///     layers = [{ refractive_index = 1.41, thickness_m = 2e-3, youngs_modulus_pa = 1.36e5 }]
    /// "#, "scene.toml")?;
    /// let pairs = [0.0, 1.0, 2.0].map(|f| CalibrationPair::loading(1e5 * f, f)).to_vec();
    /// let frame = ndarray::Array2::from_elem((20, 30), 10);
    /// let calibration = LoadedCalibration::Pairs(pairs);
    /// let frames = vec![frame.clone()];
    /// let (calibrated_light, contact_table, checks) = (None, None, vec![]);
    /// let reference = frame;
    /// let data =
    ///     SceneData { reference, frames, calibration, calibrated_light, contact_table, checks };
    /// // The strain measure comes from the file, the number of points from the program.
    /// let pipeline = scene.pipeline(&data)?.with_control_points(60);
    /// let mut press = scene.press(&pipeline, &data)?;
    /// assert!(press.contact(0)?.is_none(), "as grey as the reference");
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// [`FileError::Rejected`] if the calibration or the waveguide cannot be used.
    pub fn pipeline(&self, data: &SceneData) -> Result<Pipeline, FileError> {
        let pipeline = self.build(data).map_err(|e| self.measure_error(e))?;
        self.checked(pipeline, data)
    }

    /// The pipeline, corrected by the presses of known force.
    fn checked(&self, pipeline: Pipeline, data: &SceneData) -> Result<Pipeline, FileError> {
        if self.checks.is_empty() {
            return Ok(pipeline);
        }
        let stated = self.checks.iter().zip(&data.checks);
        let presses = stated.map(|(c, image)| CheckPress::new(image.view(), c.known_n, c.object));
        let presses: Vec<_> = presses.collect();
        let checked = pipeline.with_checks(data.reference.view(), &presses);
        checked.map_err(|error| match error {
            PipelineError::Check { press, reason } => {
                FileError::field(&self.file, format!("check[{}]", press + 1), reason)
            }
            error => FileError::field(&self.file, "check", error.numbered_from(1)),
        })
    }

    /// Adds the frames of the scene to a pipeline, ready to be measured. Frames that `data` lacks
    /// are read from their files.
    ///
    /// # Errors
    /// [`FileError::Rejected`], also if a frame cannot be read.
    pub fn press<'a>(
        &self,
        pipeline: &Pipeline,
        data: &'a SceneData,
    ) -> Result<Press<'a>, FileError> {
        let mut press = pipeline
            .press(data.reference.view())
            .map_err(|e| self.measure_error(e))?;
        let mut kept_bytes = 0;
        for (index, frame) in self.frames.iter().enumerate() {
            let gauge = frame
                .force_n
                .map(|value| Estimate::new(value, frame.force_error_n.unwrap_or(0.0)));
            let added = match data.frames.get(index) {
                Some(image) => press.add_gauged_frame(image.view(), gauge),
                None => {
                    let image = self.read_frame(index, data.reference.view())?;
                    kept_bytes += image.len();
                    // Images beyond 64 MiB are read again for every stage that needs them.
                    if kept_bytes <= 64 << 20 {
                        press.add_gauged_frame(image, gauge)
                    } else {
                        let (path, bits) = (frame.image.clone(), self.bits);
                        let read = move || read_grey_levels(&path, bits).map_err(|e| e.to_string());
                        press.add_frame_on_demand(gauge, read)
                    }
                }
            };
            if let Some(time_s) = frame.time_s {
                press
                    .set_time_s(added, time_s)
                    .map_err(|e| self.measure_error(e))?;
            }
        }
        Ok(press)
    }

    fn force_options(&self) -> ForceOptions {
        let drift = match self.corrects_drift {
            true => DriftCorrection::Automatic,
            false => DriftCorrection::None,
        };
        ForceOptions::default().with_contact(ContactOptions::default().with_drift(drift))
    }

    fn build(&self, data: &SceneData) -> Result<Pipeline, PipelineError> {
        let pipeline = match &data.calibration {
            LoadedCalibration::Pairs(pairs) => {
                let contact =
                    LightContact::from_pairs_with(pairs, self.pixel_size_m, &self.force_options())?;
                Pipeline::new(contact, self.object)?.with_stages(&self.stages)?
            }
            // Forces come from the gauge, but contacts and radii still come from the light.
            LoadedCalibration::Gauge => {
                let contact = LightContact::gauged(self.pixel_size_m, &self.force_options())?;
                Pipeline::new(contact, self.object)?.with_stages(&self.stages)?
            }
            LoadedCalibration::Sensor(sensor) => {
                let contact = sensor.contact(&self.force_options())?;
                let pipeline = Pipeline::new(contact, self.object)?.with_stages(&self.stages)?;
                return sensor
                    .configured(pipeline)?
                    .with_settings(|settings| settings.state_errors(&self.errors));
            }
            LoadedCalibration::DepthTable(table) => {
                let contact = DarkContact::new(table, self.pixel_size_m)?;
                Pipeline::new(contact, self.object)?
                    .with_stages(&self.stages)?
                    .with_surface(DarkContact::depth_table(table)?, SurfaceInput::Signal)
            }
        };
        let pipeline = pipeline.with_settings(|settings| {
            settings.flat_field = self.flat_field;
            settings.calibrated_light.clone_from(&data.calibrated_light);
        })?;
        let guide = guide(&self.layers).map_err(PipelineError::Material)?;
        // An estimator named in the file takes precedence over the one of the contact table.
        let pipeline = match (&data.contact_table, self.stages.estimator) {
            (Some(table), EstimatorChoice::Best | EstimatorChoice::TabulatedContact) => {
                let Object::Sphere {
                    radius_m,
                    poisson_ratio,
                } = self.object
                else {
                    return Err(PipelineError::WrongEstimator {
                        estimator: EstimatorChoice::TabulatedContact.into(),
                        needs: "a ball as the object",
                    });
                };
                let tabulated =
                    TabulatedContact::new(table.clone(), radius_m, poisson_ratio, &guide);
                pipeline.with_estimator(tabulated.map_err(PipelineError::Material)?)
            }
            _ => pipeline,
        };
        pipeline.with_settings(|settings| {
            // On a rigid guide the settings keep their default.
            if !self.layers.is_empty() {
                settings.waveguide = Some(guide);
            }
            settings.state_errors(&self.errors);
        })
    }

    /// Whether nothing shows that the lamps are those of the calibration: neither its reference, nor
    /// a press of known force.
    #[must_use]
    pub fn takes_light_as_unchanged(&self) -> bool {
        let by_pairs = matches!(self.calibration, CalibrationSource::Pairs(_));
        let of_light = |check: &SceneCheck| !matches!(check.object, CheckedObject::Ball(_));
        by_pairs && self.calibration_reference.is_none() && !self.checks.iter().any(of_light)
    }

    /// The error of a pipeline, with the field of the scene that caused it. Both count from 1.
    pub fn measure_error(&self, error: PipelineError) -> FileError {
        // The field that the user has to change, if the kind of error determines it.
        let field = match (&error, error.frame()) {
            (PipelineError::NoForce { .. }, Some(i)) => format!("frames[{}].force_N", i + 1),
            (PipelineError::Time { .. } | PipelineError::TimeDecreases { .. }, Some(i)) => {
                format!("frames[{}].time_s", i + 1)
            }
            (_, Some(i)) => match self.frames.get(i) {
                Some(frame) => format!("frames[{}].image = {}", i + 1, frame.image.display()),
                None => format!("frames[{}]", i + 1),
            },
            (PipelineError::Calibration(_), _) => "calibration.pairs".into(),
            (PipelineError::DepthTable(_), _) => "calibration.depth_table".into(),
            (PipelineError::Material(ElasticityError::TableMismatch { .. }), _) => {
                "contact_table".into()
            }
            (PipelineError::Material(_), _) => "waveguide.layers".into(),
            (PipelineError::WrongEstimator { .. }, _) => "stages.estimator".into(),
            (PipelineError::Sensor(_), _) => "reference".into(),
            _ => "frames".into(),
        };
        FileError::field(&self.file, field, error.numbered_from(1))
    }
}

/// Reads pairs of integrated pixel value and force from a CSV file.
pub(super) fn force_pairs(path: &Path) -> Result<Vec<CalibrationPair>, FileError> {
    let value = (&["integrated_pixel_value"][..], "grey_levels");
    let [values, forces] = read_columns(path, [value, (&["force"], "N")])?;
    let pairs = values.into_iter().zip(forces);
    let pairs: Vec<_> = pairs.map(|(v, f)| CalibrationPair::loading(v, f)).collect();
    match doubt_of_pairs(&pairs) {
        Some(reason) => Err(FileError::Rejected {
            path: path.into(),
            place: FilePlace::File,
            source: reason.into(),
        }),
        None => Ok(pairs),
    }
}

/// The reason why rows of (darkness in grey levels, depth in metres) cannot be a depth table: a
/// darkness above eight bits, or a depth beyond any gel. `None` if they can be one.
///
/// ```
/// use tactile_files::scene::doubt_of_depths;
/// assert_eq!(doubt_of_depths(&[(0.0, 0.0), (60.0, 1.9e-3)]), None);
/// assert!(doubt_of_depths(&[(0.0, 0.0), (1.9, 60e-3)]).is_some(), "swapped columns");
/// ```
#[must_use]
pub fn doubt_of_depths(rows: &[(f64, f64)]) -> Option<String> {
    if let Some((darkness, _)) = rows.iter().find(|(darkness, _)| *darkness > 255.0) {
        return Some(format!(
            "a darkness of {darkness} is more than the 255 grey levels of a frame: are the \
             columns swapped?"
        ));
    }
    // The films of such sensors are a few millimetres thick.
    let (_, depth) = rows.iter().find(|(_, depth)| *depth > 20e-3)?;
    Some(format!(
        "a depth of {} mm exceeds the thickness of any film: are the columns swapped, or is the \
         unit \
         in the heading wrong?",
        1e3 * depth
    ))
}

/// The reason why pairs cannot calibrate light against force: forces that no sensor bears, forces
/// that are all equal, or forces that fall while the light grows. `None` if they can.
///
/// ```
/// use tactile_imaging::force::CalibrationPair;
/// use tactile_files::scene::doubt_of_pairs;
/// let pairs = |slope: f64| [1e5, 2e5, 3e5].map(|v| CalibrationPair::loading(v, slope * v));
/// assert_eq!(doubt_of_pairs(&pairs(1e-6)), None);
/// assert!(doubt_of_pairs(&pairs(-1e-6)).is_some_and(|reason| reason.contains("falls")));
/// ```
#[must_use]
pub fn doubt_of_pairs(pairs: &[CalibrationPair]) -> Option<String> {
    let forces = || pairs.iter().map(|pair| pair.force_n);
    let [_, most] = InputQuantity::Force.limits();
    if let Some(force) = forces().find(|force| force.abs() > most) {
        return Some(format!(
            "a force of {force:e} N exceeds what any sensor withstands: are the columns swapped, \
             or is \
             the unit in the heading wrong?"
        ));
    }
    let mean = |values: &dyn Fn(&CalibrationPair) -> f64| {
        pairs.iter().map(values).sum::<f64>() / pairs.len() as f64
    };
    let light = mean(&|pair| pair.integrated_pixel_value);
    let force = mean(&|pair| pair.force_n);
    let together = mean(&|pair| (pair.integrated_pixel_value - light) * (pair.force_n - force));
    let [least, greatest] = [f64::min, f64::max].map(|end| forces().fold(force, end));
    if pairs.len() > 1 && least == greatest {
        return Some(format!(
            "all forces are {force} N: a calibration needs at least two"
        ));
    }
    (together < 0.0).then(|| {
        "the force falls while the light grows: does a column hold another quantity, or are rows \
         out of order?"
            .to_owned()
    })
}
