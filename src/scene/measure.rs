//! A scene as a pipeline with its frames.
use super::contact_table::guide;
use super::load::read_image;
use super::{LoadedCalibration, Scene, SceneData, SceneError};
use crate::elasticity::ElasticityError;
use crate::elasticity::modulus::TabulatedContact;
use crate::force::{ContactOptions, DriftCorrection, Estimate, ForceOptions};
use crate::pipeline::{
    DarkContact, EstimatorChoice, LightContact, Measurement, Object, Pipeline, PipelineError,
    Press, SurfaceInput,
};

/// Images of a scene that a press keeps. Those beyond are read again for every stage that needs them.
const MOST_KEPT_BYTES: usize = 64 << 20;

impl Scene {
    /// Reads a scene file with its images and measures everything. What a stage cannot do stands in its place in the
    /// [`Measurement`] ([`measure_error`](Self::measure_error) adds the field of the scene file).
    ///
    /// ```
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # use tactile_simulate::{CalibrationRun, Camera, PressLoad, PressOptions, PressScene, write_folder};
    /// use tactile_imaging::scene::Scene;
    /// # let camera = Camera::default().coarser(16);
    /// # let made = PressScene::new(PressOptions { camera, loads: vec![PressLoad::normal(0.7)], ..Default::default() })?;
    /// # let folder = tempfile::tempdir()?;
    /// # let calibration = CalibrationRun { steps: 8, ..CalibrationRun::default() };
    /// # let path = write_folder(&made, &made.calibrate(&calibration)?, folder.path())?;
    /// let measured = Scene::measure_file(&path)?; // one frame, of a ball pressed with 0.7 N
    /// let force = measured.frames[0].as_ref().expect("a contact").force_n.as_ref().expect("a calibration").value;
    /// assert!((force / 0.7 - 1.0).abs() < 0.03);
    /// let modulus = measured.youngs_modulus_pa?;
    /// assert_eq!(modulus.estimator.to_string(), "Hertz sphere");
    /// assert!(measured.strain.is_err(), "strain takes two frames");
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// [`SceneError`]: one sentence that names the file and the field.
    pub fn measure_file(path: impl AsRef<std::path::Path>) -> Result<Measurement, SceneError> {
        let scene = Self::read(path)?;
        let data = scene.load_without_frames()?;
        let press = scene.press(&scene.pipeline(&data)?, &data)?;
        Ok(press.measure())
    }

    /// The pipeline for this scene's sensor and object, of the stages it names.
    ///
    /// ```
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # use tactile_imaging::force::CalibrationPair;
    /// # use tactile_imaging::scene::{LoadedCalibration, Scene, SceneData};
    /// # let scene = Scene::parse(r#"
    /// #     reference = "reference.png"
    /// #     pixel_size_m = [2e-5, 2e-5]
    /// #     calibration = { pairs = "pairs.csv" }
    /// #     frames = [{ image = "one.png" }]
    /// #     object = { shape = "unknown" }
    /// #     stages = { strain = "hencky" }
    /// #     [waveguide]
    /// #     layers = [{ refractive_index = 1.41, thickness_m = 2e-3, youngs_modulus_pa = 1.36e5 }]
    /// # "#, "scene.toml")?;
    /// # let pairs = [0.0, 1.0, 2.0].map(|f| CalibrationPair::loading(1e5 * f, f)).to_vec();
    /// # let frame = ndarray::Array2::from_elem((20, 30), 10);
    /// # let calibration = LoadedCalibration::Pairs(pairs);
    /// # let data = SceneData { reference: frame.clone(), frames: vec![frame], calibration, contact_table: None };
    /// let pipeline = scene.pipeline(&data)?.with_control_points(60); // the scene says: strain = "hencky"
    /// let mut press = scene.press(&pipeline, &data)?;
    /// assert!(press.contact(0)?.is_none(), "as grey as the reference");
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// [`SceneError::Measure`] where the calibration or the waveguide is not usable.
    pub fn pipeline(&self, data: &SceneData) -> Result<Pipeline, SceneError> {
        self.build(data).map_err(|e| self.measure_error(e))
    }

    /// The scene's frames on a pipeline, ready to be asked. Those that `data` lacks are read from their files.
    ///
    /// # Errors
    /// [`SceneError::Measure`]. [`SceneError::File`] and [`SceneError::SizeMismatch`] of frames that are read.
    pub fn press<'a>(
        &self,
        pipeline: &Pipeline,
        data: &'a SceneData,
    ) -> Result<Press<'a>, SceneError> {
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
                    if kept_bytes <= MOST_KEPT_BYTES {
                        press.add_gauged_frame(image, gauge)
                    } else {
                        let (path, bits) = (frame.image.clone(), self.bits);
                        let read = move || read_image(&path, bits).map_err(|e| e.to_string());
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
            LoadedCalibration::Gauge => {
                let contact = LightContact::gauged(self.pixel_size_m, &self.force_options())?;
                Pipeline::new(contact, self.object)?.with_stages(&self.stages)?
            }
            LoadedCalibration::Sensor(sensor) => {
                let contact = sensor.contact(&self.force_options())?;
                let pipeline = Pipeline::new(contact, self.object)?.with_stages(&self.stages)?;
                return sensor.configured(pipeline)?.with_settings(|settings| {
                    settings.object_radius_error_m = self.radius_error_m;
                    settings.poisson_ratio_error = self.poisson_ratio_error;
                });
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
            settings.object_radius_error_m = self.radius_error_m;
            settings.poisson_ratio_error = self.poisson_ratio_error;
        })?;
        let guide = guide(&self.layers).map_err(PipelineError::Material)?;
        let pipeline = match (&data.contact_table, self.stages.estimator) {
            (Some(table), EstimatorChoice::Best | EstimatorChoice::TabulatedContact) => {
                let Object::Sphere {
                    radius_m,
                    poisson_ratio,
                } = self.object
                else {
                    return Err(PipelineError::WrongEstimator {
                        estimator: EstimatorChoice::TabulatedContact,
                        needs: "a ball as the object",
                    });
                };
                let tabulated =
                    TabulatedContact::new(table.clone(), radius_m, poisson_ratio, &guide);
                pipeline.with_estimator(tabulated.map_err(PipelineError::Material)?)
            }
            _ => pipeline,
        };
        if self.layers.is_empty() {
            return Ok(pipeline);
        }
        pipeline.with_settings(|settings| settings.waveguide = Some(guide))
    }

    /// The pipeline's error with the field that it comes from.
    pub fn measure_error(&self, error: PipelineError) -> SceneError {
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
        SceneError::Measure {
            file: self.file.clone(),
            field,
            source: Box::new(error),
        }
    }
}
