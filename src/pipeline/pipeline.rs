//! The pipeline: the shared stages and the settings.
use super::contact::ContactStage;
use super::error::PipelineError;
use super::estimators::EstimatorStage;
use super::light::LightContact;
use super::settings::{Settings, SurfaceInput};
use super::specimen::Object;
use super::stage_names::{self, EstimatorChoice, StagesConfig};
use crate::elasticity::modulus::{Bodies, ModulusEstimator};
use crate::elasticity::strain::{GreenLagrange, StrainMeasure};
use crate::force::{CalibrationPair, ReferenceFrame};
use crate::matching::PointMatcher;
use crate::sfs::{
    Binning, ContactSampler, ControlPointSampler, EquallySpaced, SurfaceReconstruction,
};
use crate::tps::{AffineModel, WarpModel};
use ndarray::ArrayView2;
use std::sync::Arc;

/// The stages from a frame to Young's modulus and their common settings. Each stage can be replaced
/// in one line.
///
/// | stage | setter | default |
/// |---|---|---|
/// | frame to contact and force | [`with_contact`](Self::with_contact) | [`LightContact`] with a linear calibration |
/// | image to surface | [`with_surface`](Self::with_surface) | [`Eikonal`](crate::sfs::Eikonal), frontal light, zero height at the rim |
/// | surface to control points | [`with_sampler`](Self::with_sampler) | [`ContactSampler`]; [`EquallySpaced`] where the surface is read from a signal |
/// | points to matches | [`with_matcher`](Self::with_matcher) | [`AnnealedSoftassign`](crate::matching::AnnealedSoftassign), searching near by |
/// | weighted matches to the warp whose gradient is strained | [`with_warp`](Self::with_warp) | [affine](crate::tps::AffineModel::General) |
/// | displacement gradient to strain | [`with_strain`](Self::with_strain) | [`GreenLagrange`] |
/// | loads to the modulus | [`with_estimator`](Self::with_estimator) | the layered law for a ball, else stress over strain; see [`EstimatorChoice::Best`] |
///
/// A setter accepts any value that implements the stage's trait, and also a `Box` or an `Arc` of
/// one, so that a program can choose at run time. [`with_stages`](Self::with_stages) selects stages
/// by name, as in a configuration. The stages are shared: a clone copies only pointers and the
/// settings.
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::{Object, Pipeline, force::CalibrationPair};
/// // 10⁵ grey levels in total are 1 N; a pixel is 50 µm wide; the ball has a radius of 3 mm.
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// // Hertz's pressure p₀√(1 − r²/a²) with a = 20 pixels = 1 mm has (2π/3) a² p₀ grey levels in
/// // total, which are 1.005 N for p₀ = 120.
/// let hertz = |peak: f64| {
///     Array2::from_shape_fn((64, 64), |(r, c)| {
///         let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
///         10 + (peak * (1.0 - d * d).sqrt()).round() as u8
///     })
/// };
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// let mut press = pipeline.press(reference.view())?;
/// press.add_frame(frame.view());
/// // For a ball on a rigid flat, Hertz's law is E = (1 − ν²) 3FR/(4a³). Finite strain changes it
/// // by several per cent at a/R = 1/3.
/// let hertz = 0.75 * 3.0 * 1.005 * 3e-3 / (4.0 * 1e-9);
/// assert!((press.modulus()?.youngs_modulus_pa / hertz - 1.0).abs() < 0.1);
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone)]
pub struct Pipeline {
    contact: Arc<dyn ContactStage>,
    surface: Arc<dyn SurfaceReconstruction<f64> + Send + Sync>,
    /// `None` for the default, which depends on the source of the surface.
    sampler: Option<Arc<dyn ControlPointSampler<f64> + Send + Sync>>,
    matcher: Arc<dyn PointMatcher<3> + Send + Sync>,
    warp: Arc<dyn WarpModel<3> + Send + Sync>,
    strain: Arc<dyn StrainMeasure + Send + Sync>,
    estimator: EstimatorStage,
    settings: Settings,
    /// The object and the guide of the settings.
    bodies: Arc<Bodies>,
}

impl Pipeline {
    /// Combines any contact stage with the default stages, without a waveguide and with 200 control
    /// points.
    ///
    /// ```
    /// use tactile_imaging::elasticity::modulus::ModulusEstimator;
    /// use tactile_imaging::pipeline::{DarkContact, Object, Pipeline};
    /// let contact = DarkContact::new(&[(0.0, 0.0), (100.0, 0.5e-3)], [0.1e-3; 2])?;
    /// let pipeline = Pipeline::new(contact, Object::Unknown { poisson_ratio: 0.48 })?;
    /// assert!(pipeline.estimator()?.needs_strain(), "stress over strain");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::Material`] for an unphysical object, [`PipelineError::SurfaceOptions`] if a
    /// default stage rejects its options.
    pub fn new(
        contact: impl ContactStage + 'static,
        object: Object,
    ) -> Result<Self, PipelineError> {
        let settings = Settings::new(object.validated().map_err(PipelineError::Material)?);
        Ok(Self {
            contact: Arc::new(contact),
            surface: Arc::new(stage_names::eikonal()?),
            sampler: None,
            matcher: Arc::new(stage_names::near_by()),
            warp: Arc::new(AffineModel::General),
            strain: Arc::new(GreenLagrange),
            estimator: EstimatorStage::named(EstimatorChoice::default()),
            bodies: Arc::new(settings.bodies().map_err(PipelineError::Material)?),
            settings,
        })
    }

    /// The default pipeline for a sensor calibrated with pairs of integrated pixel value and force.
    ///
    /// # Errors
    /// [`PipelineError::Calibration`], [`PipelineError::Sensor`] and those of [`new`](Self::new).
    pub fn from_pairs(
        pairs: &[CalibrationPair],
        pixel_size_m: [f64; 2],
        object: Object,
    ) -> Result<Self, PipelineError> {
        Self::new(LightContact::from_pairs(pairs, pixel_size_m)?, object)
    }

    /// Sets the number of control points.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?.with_control_points(40);
    /// assert_eq!(trial.press(&pipeline)?.control_points(0)?.len(), 40);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_control_points(mut self, count: usize) -> Self {
        self.settings.control_points = count;
        self
    }

    /// Changes any of the settings and validates them together.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// use tactile_imaging::{force::Source, pipeline::Binning};
    /// let exact = trial.pipeline()?;
    /// let pipeline = exact.clone().with_settings(|settings| {
    ///     settings.binning = Binning::Blocks(2);
    ///     settings.assumptions.state(Source::ObjectSize, 0.03); // of the ball's radius
    /// })?;
    /// let press = trial.press(&pipeline)?;
    /// let camera = trial.scene.options().camera;
    /// assert!((press.surface(0)?.pixel_size_m[0] / camera.pixel_size_m[0] - 2.0).abs() < 1e-12);
    /// // E is proportional to the radius, apart from the guide's share of the compliance and the
    /// // correction for finite strain.
    /// let relative = |m: &tactile_imaging::elasticity::modulus::ModulusEstimate| {
    ///     m.standard_error_pa / m.youngs_modulus_pa
    /// };
    /// let of_the_radius = relative(&press.modulus()?).powi(2)
    ///     - relative(&trial.press(&exact)?.modulus()?).powi(2);
    /// assert!(of_the_radius.sqrt() > 0.03);
    /// // On a rigid flat instead of the layered guide, the same contact would mean a softer ball.
    /// let rigid = exact.clone().with_settings(|settings| {
    ///     (settings.waveguide, settings.layer_covariance) = (None, None);
    /// })?;
    /// assert!(
    ///     trial.press(&rigid)?.modulus()?.youngs_modulus_pa
    ///         < trial.press(&exact)?.modulus()?.youngs_modulus_pa
    /// );
    /// assert!(
    ///     exact.clone().with_settings(|settings| settings.smoothing_px = 8).is_err(),
    ///     "no middle"
    /// );
    /// assert!(
    ///     exact.with_settings(|s| s.assumptions.state(Source::Gain, f64::NAN)).is_err()
    /// );
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::Material`] for an unphysical object, [`PipelineError::Setting`] for a
    /// setting outside its range, an error that is negative or not finite, and a covariance without
    /// three rows and columns for each layer of the waveguide.
    pub fn with_settings(
        mut self,
        change: impl FnOnce(&mut Settings),
    ) -> Result<Self, PipelineError> {
        let known = (self.settings.object, self.settings.waveguide.clone());
        change(&mut self.settings);
        self.settings.check()?;
        self.bodies = Arc::new(self.settings.bodies().map_err(PipelineError::Material)?);
        if known != (self.settings.object, self.settings.waveguide.clone()) {
            self.estimator.renew();
        }
        Ok(self)
    }

    /// Uses the stages named in a configuration. The input of the surface stage is then shading.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// use tactile_imaging::pipeline::{StagesConfig, StrainChoice};
    /// let config = StagesConfig { strain: StrainChoice::Hencky, ..StagesConfig::default() };
    /// let pipeline = trial.pipeline()?.with_stages(&config)?.with_control_points(60);
    /// assert_eq!(trial.press(&pipeline)?.strain(1)?.measure, "Hencky");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::SurfaceOptions`] and [`PipelineError::WarpOptions`] if a stage rejects its
    /// options.
    pub fn with_stages(mut self, config: &StagesConfig) -> Result<Self, PipelineError> {
        self.surface = config.reconstruction.build()?;
        self.settings.surface_input = SurfaceInput::Shading;
        self.sampler = Some(config.sampler.build());
        self.matcher = config.matcher.build();
        self.warp = config.warp.build()?;
        self.strain = config.strain.build();
        self.estimator = EstimatorStage::named(config.estimator);
        Ok(self)
    }

    /// Replaces the contact stage, which converts a frame to contact and force.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{DarkContact, Object, Pipeline};
    /// use tactile_imaging::force::CalibrationPair;
    /// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let light =
    ///     Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?.with_control_points(80);
    /// let dark = light.with_contact(DarkContact::new(
    ///     &[(0.0, 0.0), (100.0, 0.5e-3)],
    ///     [0.1e-3; 2],
    /// )?);
    /// assert_eq!(dark.settings().control_points, 80, "the rest stays");
    /// let [reference, darker] = [200, 150].map(|grey| {
    ///     ndarray::Array2::from_shape_fn((40, 40), |(r, c)| {
    ///         if (10..30).contains(&r) && (10..30).contains(&c) {
    ///             grey
    ///         } else {
    ///             200_u8
    ///         }
    ///     })
    /// });
    /// let mut press = dark.press(reference.view())?;
    /// press.add_frame(darker.view());
    /// let depth = press.contact(0)?.and_then(|contact| contact.indentation_m).expect("a depth");
    /// assert!((depth.value - 0.25e-3).abs() < 1e-9, "half of the darkening for 0.5 mm");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    #[must_use]
    pub fn with_contact(mut self, contact: impl ContactStage + 'static) -> Self {
        self.contact = Arc::new(contact);
        self
    }

    /// Replaces the surface stage, which gets `input`.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// use tactile_imaging::pipeline::SurfaceInput;
    /// use tactile_imaging::sfs::{BoundaryCondition, Eikonal, Lighting};
    /// // A rim of 0.1 mm height.
    /// let raised =
    ///     Eikonal::new(Lighting::default()).with_boundary(BoundaryCondition::Height(1e-4))?;
    /// let pipeline = trial.pipeline()?.with_surface(raised, SurfaceInput::Shading);
    /// let press = trial.press(&pipeline)?;
    /// let heights = press.surface(0)?.surface.heights.iter().copied();
    /// assert!(heights.filter(|h| h.is_finite()).all(|h| h >= 1e-4));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_surface(
        mut self,
        surface: impl SurfaceReconstruction<f64> + 'static,
        input: SurfaceInput,
    ) -> Self {
        self.surface = Arc::new(surface);
        self.settings.surface_input = input;
        if input == SurfaceInput::Signal {
            self.settings.smoothing_px = 1;
            self.settings.binning = Binning::Blocks(1);
        }
        self
    }

    /// Replaces the estimator of the modulus. Strains of the loads are counted from the first load.
    /// The loads include the [object and the
    /// guide](crate::elasticity::modulus::LoadSeries::bodies). A result from contacts on a
    /// compliant guide that ignores the guide gets the caution
    /// [`GuideIgnored`](crate::elasticity::modulus::Warning::GuideIgnored).
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// use tactile_imaging::elasticity::modulus::HertzSphere;
    /// let ball = trial.scene.options().object;
    /// let hertz = HertzSphere::new(ball.radius_m, ball.material.poisson_ratio)?;
    /// let by_name = trial.pipeline()?;
    /// let given = by_name.clone().with_estimator(hertz);
    /// // The guide comes from the pipeline, as for the estimator with that name.
    /// assert_eq!(trial.press(&given)?.modulus()?, trial.press(&by_name)?.modulus()?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_estimator(mut self, estimator: impl ModulusEstimator + 'static) -> Self {
        self.estimator = EstimatorStage::given(Arc::new(estimator));
        self
    }

    /// Replaces the sampler of control points.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// use tactile_imaging::sfs::EquallySpaced;
    /// let pipeline = trial.pipeline()?.with_sampler(EquallySpaced).with_control_points(40);
    /// assert_eq!(trial.press(&pipeline)?.control_points(0)?.len(), 40);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_sampler(mut self, sampler: impl ControlPointSampler<f64> + 'static) -> Self {
        self.sampler = Some(Arc::new(sampler));
        self
    }

    /// Replaces the matcher. It may be user-defined or chosen at run time.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// use tactile_imaging::matching::{LinearAssignment, PointMatcher};
    /// let pipeline =
    ///     trial.pipeline()?.with_matcher(LinearAssignment::default()).with_control_points(60);
    /// let press = trial.press(&pipeline)?;
    /// let matching = press.matching(1)?;
    /// assert!(
    ///     matching.assignment.iter().all(Option::is_some),
    ///     "without a limit to the distance every point has a partner"
    /// );
    /// let chosen: Box<dyn PointMatcher<3> + Send + Sync> = Box::new(LinearAssignment::default());
    /// let pipeline = pipeline.with_matcher(chosen);
    /// assert_eq!(trial.press(&pipeline)?.matching(1)?.assignment, matching.assignment);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_matcher(mut self, matcher: impl PointMatcher<3> + 'static) -> Self {
        self.matcher = Arc::new(matcher);
        self
    }

    /// Replaces the strain measure.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// use tactile_imaging::elasticity::strain::Hencky;
    /// let green = trial.pipeline()?.with_control_points(60);
    /// let hencky = green.clone().with_strain(Hencky);
    /// let e = trial.press(&green)?.strain(1)?.summary.mean[(2, 2)];
    /// let logarithmic = trial.press(&hencky)?.strain(1)?.summary.mean[(2, 2)];
    /// // A stretch λ has the strain (λ² − 1)/2 by Green and Lagrange, and ln λ by Hencky.
    /// assert!(logarithmic < e && (logarithmic - 0.5 * (1.0 + 2.0 * e).ln()).abs() < 0.02);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_strain(mut self, strain: impl StrainMeasure + 'static) -> Self {
        self.strain = Arc::new(strain);
        self
    }

    /// Replaces the warp model used for the strain.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// use tactile_imaging::tps::AffineModel;
    /// let pipeline = trial.pipeline()?.with_warp(AffineModel::General).with_control_points(60);
    /// let press = trial.press(&pipeline)?;
    /// let strain = press.strain(1)?;
    /// assert!(strain.summary.spread.amax() < 1e-9, "one gradient for all points");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_warp(mut self, warp: impl WarpModel<3> + 'static) -> Self {
        self.warp = Arc::new(warp);
        self
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The contact stage.
    pub fn contact(&self) -> &dyn ContactStage {
        self.contact.as_ref()
    }

    /// The estimator of the modulus. An estimator selected by name is built on first use and shared
    /// by all clones.
    ///
    /// # Errors
    /// [`PipelineError::WrongEstimator`] if the chosen one does not fit the object.
    pub fn estimator(&self) -> Result<Arc<dyn ModulusEstimator + Send + Sync>, PipelineError> {
        let settings = &self.settings;
        self.estimator
            .get(settings.object, settings.waveguide.as_ref())
    }

    /// The object and the guide, with their errors.
    pub(super) fn bodies(&self) -> &Arc<Bodies> {
        &self.bodies
    }

    pub(super) fn shared_contact(&self) -> Arc<dyn ContactStage> {
        Arc::clone(&self.contact)
    }

    pub(super) fn surface(&self) -> &dyn SurfaceReconstruction<f64> {
        self.surface.as_ref()
    }

    pub(super) fn sampler(&self) -> &dyn ControlPointSampler<f64> {
        match (&self.sampler, self.settings.surface_input) {
            (Some(sampler), _) => sampler.as_ref(),
            (None, SurfaceInput::Shading) => &ContactSampler,
            // Depths from a signal end in a step at the boundary of the contact, not at the plane.
            (None, SurfaceInput::Signal) => &EquallySpaced,
        }
    }

    pub(super) fn matcher(&self) -> &dyn PointMatcher<3> {
        self.matcher.as_ref()
    }

    pub(super) fn warp(&self) -> &dyn WarpModel<3> {
        self.warp.as_ref()
    }

    pub(super) fn strain(&self) -> &dyn StrainMeasure {
        self.strain.as_ref()
    }

    /// The reference according to the settings, from one or more frames without contact.
    pub(super) fn reference_frame(
        &self,
        frames: &[ArrayView2<'_, u8>],
    ) -> Result<ReferenceFrame, PipelineError> {
        let reference = ReferenceFrame::from_frames(frames).map_err(PipelineError::Sensor)?;
        if !self.settings.flat_field {
            return Ok(reference);
        }
        reference.with_flat_field().map_err(PipelineError::Sensor)
    }
}

impl std::fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Pipeline")
            .field("settings", &self.settings)
            .finish_non_exhaustive()
    }
}
