//! The settings of a pipeline, one by one.
use super::Pipeline;
use crate::elasticity::contact::Waveguide;
use crate::pipeline::binning::Binning;
use crate::pipeline::error::PipelineError;
use crate::pipeline::guide_error::LAYER_PARAMETERS;
use crate::pipeline::object::Object;
use crate::pipeline::settings::Skips;
use nalgebra::DMatrix;

impl Pipeline {
    /// Sets the sensor's layers: the waveguide yields beside the object. Without, it is rigid.
    ///
    /// ```
    /// use tactile_imaging::elasticity::contact::{Layer, Waveguide};
    /// use tactile_imaging::pipeline::{Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 10e6, poisson_ratio: 0.5 };
    /// let rigid = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let yielding = rigid.clone().with_waveguide(Waveguide::new(vec![gel])?);
    /// let (reference, frame) = (hertz(0.0), hertz(120.0));
    /// let mut modulus = Vec::new();
    /// for pipeline in [&rigid, &yielding] {
    ///     let mut press = pipeline.press(reference.view())?;
    ///     press.add_frame(frame.view());
    ///     modulus.push(press.modulus()?.youngs_modulus_pa);
    /// }
    /// // The gel has about a quarter of the compliance: the ball is the stiffer for it.
    /// let ratio = modulus[1] / modulus[0];
    /// assert!(ratio > 1.15 && ratio < 1.35, "{ratio}");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_waveguide(mut self, waveguide: Waveguide<f64>) -> Self {
        self.settings.waveguide = Some(waveguide);
        self.settings.layer_covariance = None;
        self.estimator.renew();
        self
    }

    /// Says what is pressed.
    ///
    /// ```
    /// # use tactile_imaging::pipeline::{Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// use tactile_imaging::elasticity::modulus::ModulusEstimator;
    /// let pairs = [0.0, 1e5, 2e5].map(|value| CalibrationPair::loading(value, 1e-5 * value));
    /// let pipeline = Pipeline::from_pairs(&pairs, [21.55e-6; 2], Object::sphere(3e-3))?;
    /// assert!(!pipeline.estimator()?.needs_strain(), "the contact's radius is enough");
    /// let unknown = pipeline.with_object(Object::Unknown { poisson_ratio: 0.5 })?;
    /// assert!(unknown.estimator()?.needs_strain());
    /// assert!(unknown.with_object(Object::sphere(f64::NAN)).is_err());
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::Material`] for a size that is not positive or a Poisson ratio outside (−1, ½].
    pub fn with_object(mut self, object: Object) -> Result<Self, PipelineError> {
        self.settings.object = object.checked()?;
        self.estimator.renew();
        Ok(self)
    }

    /// Sets the number of control points.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// let pipeline = trial.pipeline()?.with_control_points(40);
    /// assert_eq!(trial.press(&pipeline)?.control_points(0)?.len(), 40);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_control_points(mut self, count: usize) -> Self {
        self.settings.control_points = count;
        self
    }

    /// Sets the width in pixels of the smoothing before the surface stage: odd, 1 for none.
    ///
    /// ```
    /// use tactile_imaging::{Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// assert_eq!(pipeline.settings().smoothing_px, 5);
    /// assert_eq!(pipeline.clone().with_smoothing(9)?.settings().smoothing_px, 9);
    /// assert!(pipeline.with_smoothing(8).is_err());
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::EvenSmoothing`].
    pub fn with_smoothing(mut self, width_px: usize) -> Result<Self, PipelineError> {
        if width_px.is_multiple_of(2) {
            return Err(PipelineError::EvenSmoothing { found: width_px });
        }
        self.settings.smoothing_px = width_px;
        Ok(self)
    }

    /// Sets the grid of the surface stage (default [`Binning::Auto`] for shading, every pixel for signals).
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::pipeline::Binning;
    /// let pipeline = trial.pipeline()?.with_binning(Binning::Blocks(2))?;
    /// let mut press = trial.press(&pipeline)?;
    /// // Blocks of 2 × 2 pixels.
    /// assert!((press.surface(0)?.pixel_size_m[0] / camera.pixel_size_m[0] - 2.0).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::EmptyBlocks`].
    pub fn with_binning(mut self, binning: Binning) -> Result<Self, PipelineError> {
        if binning == Binning::Blocks(0) {
            return Err(PipelineError::EmptyBlocks);
        }
        self.settings.binning = binning;
        Ok(self)
    }

    /// Corrects vignetting by the reference's own brightness or not (default: not); see [`Settings::flat_field`](crate::pipeline::Settings::flat_field).
    ///
    /// ```
    /// use tactile_imaging::{Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// // A lens that darkens stray light and signal alike towards the right: by 11 % at the contact.
    /// let lens = |c: usize| 1.0 - 0.005 * (c as f64 - 47.5);
    /// let press = |peak: f64| ndarray::Array2::from_shape_fn((64, 96), |(r, c)| {
    ///     let d = ((r as f64 - 32.0).hypot(c as f64 - 70.0) / 20.0).min(1.0);
    ///     (lens(c) * (100.0 + peak * (1.0 - d * d).sqrt())).round() as u8
    /// });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let (reference, frame) = (press(0.0), press(120.0));
    /// for (flat_field, newton) in [(false, 0.89 * 1.005), (true, 1.005)] {
    ///     let pipeline = pipeline.clone().with_flat_field(flat_field);
    ///     let mut press = pipeline.press(reference.view())?;
    ///     press.add_frame(frame.view());
    ///     let force = press.contact(0)?.and_then(|c| c.force_n).expect("a force");
    ///     assert!((force.value / newton - 1.0).abs() < 0.01);
    /// }
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    #[must_use]
    pub fn with_flat_field(mut self, flat_field: bool) -> Self {
        self.settings.flat_field = flat_field;
        self
    }

    /// Sets the relative errors common to all forces (default 0.1 %) and to all lengths (default none).
    ///
    /// ```
    /// use tactile_imaging::{Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?.with_scale_errors(0.02, 0.005)?;
    /// assert_eq!((pipeline.settings().force_scale_error, pipeline.settings().length_scale_error), (0.02, 0.005));
    /// assert!(pipeline.with_scale_errors(0.02, f64::NAN).is_err());
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::ScaleError`] for a negative or not finite one.
    pub fn with_scale_errors(mut self, force: f64, length: f64) -> Result<Self, PipelineError> {
        for found in [force, length] {
            if !(found >= 0.0 && found.is_finite()) {
                return Err(PipelineError::ScaleError { found });
            }
        }
        self.settings.force_scale_error = force;
        self.settings.length_scale_error = length;
        Ok(self)
    }

    /// Says how well the object is known: standard errors of its radius in metres and of its Poisson ratio (default: exact).
    ///
    /// ```
    /// use tactile_imaging::{Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let press = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// # let (reference, frame) = (press(0.0), press(120.0));
    /// let exact = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let known_to_3_percent = exact.clone().with_object_errors(0.09e-3, 0.0)?;
    /// let relative_error = |pipeline: &Pipeline| {
    ///     let mut press = pipeline.press(reference.view())?;
    ///     press.add_frame(frame.view());
    ///     let modulus = press.modulus()?;
    ///     Ok::<_, tactile_imaging::pipeline::PipelineError>(modulus.standard_error_pa / modulus.youngs_modulus_pa)
    /// };
    /// // E is proportional to the radius, but for a/R in the correction for finite strain.
    /// let of_the_radius = relative_error(&known_to_3_percent)?.powi(2) - relative_error(&exact)?.powi(2);
    /// assert!((of_the_radius.sqrt() / 0.03 - 1.0).abs() < 0.2, "{of_the_radius}");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::InputError`] for a negative or not finite one.
    pub fn with_object_errors(
        mut self,
        radius_error_m: f64,
        poisson_ratio_error: f64,
    ) -> Result<Self, PipelineError> {
        for found in [radius_error_m, poisson_ratio_error] {
            if !(found >= 0.0 && found.is_finite()) {
                return Err(PipelineError::InputError { found });
            }
        }
        self.settings.object_radius_error_m = radius_error_m;
        self.settings.poisson_ratio_error = poisson_ratio_error;
        Ok(self)
    }

    /// Says how well the waveguide's layers are known: the covariance of ln E of all layers, then of ln h, then of ν (default: exact).
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use nalgebra::DMatrix;
    /// // Three layers, their moduli known to 5 % each.
    /// let covariance = DMatrix::from_fn(9, 9, |i, j| if i == j && i < 3 { 0.05 * 0.05 } else { 0.0 });
    /// let (exact, pipeline) = (trial.pipeline()?, trial.pipeline()?.with_layer_covariance(covariance)?);
    /// let error = |pipeline| trial.press(pipeline)?.modulus().map(|m| m.standard_error_pa);
    /// assert!(error(&pipeline)? > error(&exact)?);
    /// assert!(exact.with_layer_covariance(DMatrix::zeros(2, 2)).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::LayerCovariance`] unless it has three rows and columns for each layer of the waveguide, and
    /// [`PipelineError::InputError`] for an entry that is not finite or a negative variance.
    pub fn with_layer_covariance(
        mut self,
        covariance: DMatrix<f64>,
    ) -> Result<Self, PipelineError> {
        let layers = self.settings.waveguide.as_ref();
        let expected = LAYER_PARAMETERS * layers.map_or(0, |guide| guide.layers().len());
        let found = covariance.shape();
        if found != (expected, expected) {
            return Err(PipelineError::LayerCovariance { expected, found });
        }
        let broken = |c: &&f64| !c.is_finite();
        let negative = covariance.diagonal().iter().copied().find(|v| *v < 0.0);
        if let Some(found) = covariance.iter().find(broken).copied().or(negative) {
            return Err(PipelineError::InputError { found });
        }
        self.settings.layer_covariance = Some(covariance);
        Ok(self)
    }

    /// Sets what may be left out.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::pipeline::{Skips, Stage};
    /// let pipeline = trial.pipeline()?.with_skips(Skips { equal_frames: false, ..Skips::default() });
    /// let mut press = pipeline.press(trial.simulation.reference.view())?;
    /// for _ in 0..2 {
    ///     let frame = press.add_frame(trial.simulation.frames[0].view());
    ///     press.contact(frame)?;
    /// }
    /// assert_eq!(press.report().work(Stage::Contact).runs, 2, "the same image, measured twice");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_skips(mut self, skips: Skips) -> Self {
        self.settings.skips = skips;
        self
    }
}
