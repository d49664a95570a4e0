//! The pipeline whose stages are chosen at run time.
use super::choice::{
    BoxedMatcher, BoxedReconstruction, BoxedSampler, BoxedStrain, BoxedWarpModel, EstimatorChoice,
    MatcherChoice, ReconstructionChoice, SamplerChoice, StrainChoice, WarpChoice,
};
use super::contact::ContactStage;
use super::object::Object;
use super::settings::Settings;
use super::stages::{BoxedWarp, Stages};
use crate::elasticity::strain::StrainMeasure;
use crate::matching::PointMatcher;
use crate::sfs::{ControlPointSampler, SfsError, SurfaceReconstruction};
use crate::tps::TpsError;
use nalgebra::Point3;

/// Which stage to take for each step, by name; what is not said is the default. With the feature `serde` a table such as
/// `reconstruction = "tsai-shah"` is one.
///
/// ```
/// use tactile_imaging::pipeline::{MatcherChoice, StagesConfig, StrainChoice};
/// let config = StagesConfig { strain: StrainChoice::Hencky, ..StagesConfig::default() };
/// assert_eq!(config.matcher, MatcherChoice::AnnealedSoftassign);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct StagesConfig {
    /// Image to surface.
    pub reconstruction: ReconstructionChoice,
    /// Surface to control points.
    pub sampler: SamplerChoice,
    /// Points to matches.
    pub matcher: MatcherChoice,
    /// Matches to a warp.
    pub warp: WarpChoice,
    /// Displacement gradient to strain.
    pub strain: StrainChoice,
    /// Loads to the modulus.
    pub estimator: EstimatorChoice,
}

/// A pipeline of boxed stages: as [`Pipeline`](super::Pipeline), but chosen at run time. The default configuration gives the default
/// pipeline's bits.
///
/// ```
/// use tactile_imaging::force::CalibrationPair;
/// use tactile_imaging::pipeline::{BoxedPipeline, LightContact, Object, Stages, StagesConfig, StrainChoice};
/// let pairs = [0.0, 1.0, 2.0].map(|f| CalibrationPair::loading(1e5 * f, f));
/// let contact = LightContact::from_pairs(&pairs, [20e-6, 20e-6])?;
/// let config = StagesConfig { strain: StrainChoice::Hencky, ..StagesConfig::default() };
/// let pipeline = BoxedPipeline::from_config(Box::new(contact), Object::sphere(3e-3), &config)?;
/// assert!(pipeline.strain().name().contains("Hencky"));
///
/// // Stages without a name in configurations, your own among them, are put in one by one.
/// use tactile_imaging::{elasticity::strain::Biot, matching::NearestNeighbour, sfs, tps::AffineModel};
/// let pipeline = pipeline
///     .with_surface(Box::new(sfs::TsaiShah::new(sfs::Lighting::frontal())))
///     .with_sampler(Box::new(sfs::Random::new(1)))
///     .with_matcher(Box::new(NearestNeighbour::new()))
///     .with_warp(Box::new(AffineModel))
///     .with_strain(Box::new(Biot));
/// assert!(pipeline.strain().name().contains("Biot"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct BoxedPipeline {
    contact: Box<dyn ContactStage>,
    surface: BoxedReconstruction,
    sampler: BoxedSampler,
    matcher: BoxedMatcher,
    warp: BoxedWarpModel,
    strain: BoxedStrain,
    settings: Settings,
}

impl BoxedPipeline {
    /// The stages that `config` names behind any contact stage, with the settings of [`Pipeline::new`](super::Pipeline::new).
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] where a stage refuses its options.
    pub fn from_config(
        contact: Box<dyn ContactStage>,
        object: Object,
        config: &StagesConfig,
    ) -> Result<Self, SfsError> {
        Ok(Self {
            contact,
            surface: config.reconstruction.boxed()?,
            sampler: config.sampler.boxed()?,
            matcher: config.matcher.boxed(),
            warp: config.warp.boxed(),
            strain: config.strain.boxed(),
            settings: Settings {
                estimator: config.estimator,
                ..Settings::new(object)
            },
        })
    }

    /// Takes other settings, such as those of a [`Pipeline`](super::Pipeline).
    ///
    /// ```
    /// # use tactile_imaging::force::CalibrationPair;
    /// # use tactile_imaging::pipeline::{BoxedPipeline, LightContact, Object, Pipeline, Stages, StagesConfig};
    /// # let pairs = [0.0, 1.0, 2.0].map(|f| CalibrationPair::loading(1e5 * f, f));
    /// # let contact = LightContact::from_pairs(&pairs, [20e-6, 20e-6])?;
    /// let typed = Pipeline::new(contact.clone(), Object::sphere(3e-3)).with_control_points(120);
    /// let boxed = BoxedPipeline::from_config(Box::new(contact), Object::sphere(3e-3), &StagesConfig::default())?
    ///     .with_settings(typed.settings().clone());
    /// assert_eq!(boxed.settings().control_points, 120);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_settings(mut self, settings: Settings) -> Self {
        self.settings = settings;
        self
    }

    /// Takes another way from image to surface; [`Settings::surface_input`] says what it looks at.
    #[must_use]
    pub fn with_surface(mut self, surface: BoxedReconstruction) -> Self {
        self.surface = surface;
        self
    }

    /// Takes another choice of control points.
    #[must_use]
    pub fn with_sampler(mut self, sampler: BoxedSampler) -> Self {
        self.sampler = sampler;
        self
    }

    /// Takes another matcher.
    #[must_use]
    pub fn with_matcher(mut self, matcher: BoxedMatcher) -> Self {
        self.matcher = matcher;
        self
    }

    /// Takes another family of warps for the strain.
    #[must_use]
    pub fn with_warp(mut self, warp: BoxedWarpModel) -> Self {
        self.warp = warp;
        self
    }

    /// Takes another measure of strain.
    #[must_use]
    pub fn with_strain(mut self, strain: BoxedStrain) -> Self {
        self.strain = strain;
        self
    }
}

impl Stages for BoxedPipeline {
    fn contact(&self) -> &dyn ContactStage {
        self.contact.as_ref()
    }

    fn surface(&self) -> &dyn SurfaceReconstruction<f64> {
        self.surface.as_ref()
    }

    fn sampler(&self) -> &dyn ControlPointSampler<f64> {
        self.sampler.as_ref()
    }

    fn matcher(&self) -> &dyn PointMatcher<f64, 3> {
        self.matcher.as_ref()
    }

    fn fit_warp(
        &self,
        sources: &[Point3<f64>],
        targets: &[Point3<f64>],
        weights: &[f64],
    ) -> Result<BoxedWarp, TpsError> {
        self.warp.fit_warp(sources, targets, weights)
    }

    fn strain(&self) -> &dyn StrainMeasure<f64> {
        self.strain.as_ref()
    }

    fn settings(&self) -> &Settings {
        &self.settings
    }
}
