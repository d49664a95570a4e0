//! Setters of the stages: any implementation, or one by its name.
use super::{Pipeline, named};
use crate::elasticity::modulus::ModulusEstimator;
use crate::elasticity::strain::StrainMeasure;
use crate::matching::PointMatcher;
use crate::pipeline::config::StagesConfig;
use crate::pipeline::contact::ContactStage;
use crate::pipeline::error::PipelineError;
use crate::pipeline::estimators::EstimatorStage;
use crate::pipeline::settings::SurfaceInput;
use crate::sfs::{Binning, ControlPointSampler, SlopeIntegrator, SurfaceReconstruction};
use crate::tps::WarpModel;
use std::sync::Arc;

impl Pipeline {
    /// Takes the stages that a configuration names; a surface stage looks at shading.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// use tactile_imaging::pipeline::{StagesConfig, StrainChoice};
    /// let config = StagesConfig { strain: StrainChoice::Hencky, ..StagesConfig::default() };
    /// let pipeline = trial.pipeline()?.with_stages(&config)?.with_control_points(60);
    /// assert_eq!(trial.press(&pipeline)?.strain(1)?.measure, "Hencky");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::SurfaceOptions`], [`PipelineError::WarpOptions`] where a stage refuses its options;
    /// [`PipelineError::NoSlopes`] for an integrator beside a reconstruction without slopes.
    pub fn with_stages(mut self, config: &StagesConfig) -> Result<Self, PipelineError> {
        self.surface = named::reconstruction(config.reconstruction)?;
        self.settings.surface_input = SurfaceInput::Shading;
        if let Some(integrator) = named::integrator(config.integrator) {
            self = self.with_slope_integrator(integrator)?;
        }
        self.sampler = Some(named::sampler(config.sampler)?);
        self.matcher = named::matcher(config.matcher);
        self.warp = named::warp(config.warp)?;
        self.strain = named::strain(config.strain);
        self.estimator = EstimatorStage::named(config.estimator);
        Ok(self)
    }

    /// Takes another way from frame to contact and force.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{DarkContact, Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let light = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?.with_control_points(80);
    /// let dark = light.with_contact(DarkContact::new(&[(0.0, 0.0), (100.0, 0.5e-3)], [0.1e-3; 2])?);
    /// assert_eq!(dark.settings().control_points, 80, "the rest stays");
    /// let [reference, darker] = [200, 150].map(|grey| ndarray::Array2::from_shape_fn((40, 40), |(r, c)| {
    ///     if (10..30).contains(&r) && (10..30).contains(&c) { grey } else { 200_u8 }
    /// }));
    /// let mut press = dark.press(reference.view())?;
    /// press.add_frame(darker.view());
    /// let depth = press.contact(0)?.and_then(|contact| contact.indentation_m).expect("a depth");
    /// assert!((depth.value - 0.25e-3).abs() < 1e-9, "half of the darkness that is 0.5 mm deep");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    #[must_use]
    pub fn with_contact(mut self, contact: impl ContactStage + 'static) -> Self {
        self.contact = Arc::new(contact);
        self
    }

    /// Takes another way from image to surface, looking at `input`.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// use tactile_imaging::pipeline::SurfaceInput;
    /// use tactile_imaging::sfs::{BrooksHorn, Lighting};
    /// let variational = BrooksHorn::new(Lighting::default()).with_occluding_boundary(true);
    /// let pipeline = trial.pipeline()?.with_surface(variational, SurfaceInput::Shading);
    /// let mut press = trial.press(&pipeline)?;
    /// let heights = press.surface(0)?.surface.heights.iter().copied().filter(|h| h.is_finite());
    /// // Its heights have mean zero: from the rim to the top they are those of the truth.
    /// let (low, high) = heights.fold((0.0, 0.0), |(low, high): (f64, f64), h| (low.min(h), high.max(h)));
    /// assert!(((high - low) / trial.simulation.truth[0].contact.apparent_height_m(0.0) - 1.0).abs() < 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_surface(
        mut self,
        surface: impl SurfaceReconstruction<f64> + Send + Sync + 'static,
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

    /// Takes another way from slopes to heights, inside the reconstruction that the pipeline has by now.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// use tactile_imaging::pipeline::{PipelineError, SurfaceInput};
    /// use tactile_imaging::sfs::{BrooksHorn, Lighting, MaskedLeastSquares};
    /// // The default reconstruction solves for heights: it has no slopes.
    /// let eikonal = trial.pipeline()?;
    /// let refused = eikonal.clone().with_slope_integrator(MaskedLeastSquares::default());
    /// assert_eq!(refused.unwrap_err(), PipelineError::NoSlopes);
    /// // Brooks and Horn's has; least squares over the contact alone need not take the frame as periodic.
    /// let variational = BrooksHorn::new(Lighting::default()).with_occluding_boundary(true);
    /// let fourier = eikonal.with_surface(variational, SurfaceInput::Shading);
    /// let masked = fourier.clone().with_slope_integrator(MaskedLeastSquares::default())?;
    /// let truth = trial.simulation.truth[0].contact.apparent_height_m(0.0);
    /// for pipeline in [fourier, masked] {
    ///     let mut press = trial.press(&pipeline)?;
    ///     let heights = press.surface(0)?.surface.heights.iter().copied().filter(|h| h.is_finite());
    ///     let (low, high) = heights.fold((0.0, 0.0), |(low, high): (f64, f64), h| (low.min(h), high.max(h)));
    ///     assert!(((high - low) / truth - 1.0).abs() < 0.1);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoSlopes`] where the reconstruction goes from the image to heights without slopes.
    pub fn with_slope_integrator(
        mut self,
        integrator: impl SlopeIntegrator<f64> + Send + Sync + 'static,
    ) -> Result<Self, PipelineError> {
        self.surface = self
            .surface
            .with_slope_integrator(Arc::new(integrator))
            .ok_or(PipelineError::NoSlopes)?;
        Ok(self)
    }

    /// Takes another estimator of the modulus. Strains of the loads are counted from the first.
    ///
    /// ```
    /// # use tactile_simulate::Trial;
    /// # use tactile_simulate::{CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// use tactile_imaging::elasticity::modulus::{EstimatorKind, TataraSphere};
    /// let tatara = trial.pipeline()?.with_estimator(TataraSphere::new(3e-3, 0.5)?);
    /// let modulus = trial.press(&tatara)?.modulus()?;
    /// assert_eq!(modulus.estimator, EstimatorKind::TataraSphere);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_estimator(
        mut self,
        estimator: impl ModulusEstimator + Send + Sync + 'static,
    ) -> Self {
        self.estimator = EstimatorStage::Given(Arc::new(estimator));
        self
    }

    /// Takes another choice of control points.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// use tactile_imaging::sfs::Random;
    /// let pipeline = trial.pipeline()?.with_sampler(Random { seed: 7 }).with_control_points(40);
    /// let mut press = trial.press(&pipeline)?;
    /// let points = press.control_points(0)?.to_vec();
    /// assert_eq!(points.len(), 40);
    /// assert_eq!(trial.press(&pipeline)?.control_points(0)?, points, "the seed decides");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_sampler(
        mut self,
        sampler: impl ControlPointSampler<f64> + Send + Sync + 'static,
    ) -> Self {
        self.sampler = Some(Arc::new(sampler));
        self
    }

    /// Takes another matcher, one of your own too, or one chosen at run time.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// use tactile_imaging::matching::{LinearAssignment, PointMatcher};
    /// let pipeline = trial.pipeline()?.with_matcher(LinearAssignment::default()).with_control_points(60);
    /// let mut press = trial.press(&pipeline)?;
    /// let matching = press.matching(1)?;
    /// assert!(matching.assignment.iter().all(Option::is_some), "without a limit to the distance every point has a partner");
    /// let chosen: Box<dyn PointMatcher<3> + Send + Sync> = Box::new(LinearAssignment::default());
    /// let pipeline = pipeline.with_matcher(chosen);
    /// assert_eq!(trial.press(&pipeline)?.matching(1)?.assignment, matching.assignment);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_matcher(mut self, matcher: impl PointMatcher<3> + Send + Sync + 'static) -> Self {
        self.matcher = Arc::new(matcher);
        self
    }

    /// Takes another measure of strain.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// use tactile_imaging::elasticity::strain::Hencky;
    /// let green = trial.pipeline()?.with_control_points(60);
    /// let hencky = green.clone().with_strain(Hencky);
    /// let e = trial.press(&green)?.strain(1)?.summary.mean[(2, 2)];
    /// let logarithmic = trial.press(&hencky)?.strain(1)?.summary.mean[(2, 2)];
    /// // A stretch λ is (λ² − 1)/2 to Green and Lagrange, ln λ to Hencky.
    /// assert!(logarithmic < e && (logarithmic - 0.5 * (1.0 + 2.0 * e).ln()).abs() < 0.02);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_strain(mut self, strain: impl StrainMeasure + Send + Sync + 'static) -> Self {
        self.strain = Arc::new(strain);
        self
    }

    /// Takes another family of warps for the strain.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// use tactile_imaging::tps::AffineModel;
    /// let pipeline = trial.pipeline()?.with_warp(AffineModel::General).with_control_points(60);
    /// let mut press = trial.press(&pipeline)?;
    /// let strain = press.strain(1)?;
    /// assert!(strain.summary.spread.amax() < 1e-9, "one gradient for all points");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_warp(mut self, warp: impl WarpModel<f64, 3> + Send + Sync + 'static) -> Self {
        self.warp = Arc::new(warp);
        self
    }
}
