//! The pipeline: the stages, shared, and the settings.
mod named;
mod options;
mod stages;

use super::choice::EstimatorChoice;
use super::contact::{ContactStage, LightContact};
use super::error::PipelineError;
use super::estimators::EstimatorStage;
use super::object::Object;
use super::settings::{Settings, SurfaceInput};
use crate::elasticity::modulus::ModulusEstimator;
use crate::elasticity::strain::{GreenLagrange, StrainMeasure};
use crate::force::{CalibrationPair, ReferenceFrame};
use crate::matching::PointMatcher;
use crate::sfs::{ContactSampler, ControlPointSampler, EquallySpaced, SurfaceReconstruction};
use crate::tps::{StrainSpline, WarpModel};
use ndarray::ArrayView2;
use std::sync::Arc;

/// The stages from a frame to Young's modulus, each of which can be replaced in one line, and the settings they share.
///
/// | stage | setter | default |
/// |---|---|---|
/// | frame to contact and force | [`with_contact`](Self::with_contact) | [`LightContact`] with a linear calibration |
/// | image to surface | [`with_surface`](Self::with_surface) | [`Eikonal`](crate::sfs::Eikonal), frontal light, zero height at the rim |
/// | slopes to heights, inside a reconstruction that has slopes | [`with_slope_integrator`](Self::with_slope_integrator) | the reconstruction's own |
/// | surface to control points | [`with_sampler`](Self::with_sampler) | [`ContactSampler`]; [`EquallySpaced`] where the surface is read from a signal |
/// | points to matches | [`with_matcher`](Self::with_matcher) | [`AnnealedSoftassign`](crate::matching::AnnealedSoftassign), searching near by |
/// | weighted matches to the warp whose gradient is strained | [`with_warp`](Self::with_warp) | a [spline](crate::tps::ThinPlateSpline), thin-plate, kernel −r, smoothed by blocked cross-validation |
/// | displacement gradient to strain | [`with_strain`](Self::with_strain) | [`GreenLagrange`] |
/// | loads to the modulus | [`with_estimator`](Self::with_estimator) | the layered law for a ball, else stress over strain; see [`EstimatorChoice::Best`] |
///
/// A setter takes any value that implements the stage's trait, a `Box` or an `Arc` of one too, so that a program can choose at run time;
/// [`with_stages`](Self::with_stages) takes stages by the names of a configuration. The stages are shared: a clone copies
/// pointers and the settings.
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::{Object, Pipeline, force::CalibrationPair};
/// // 10⁵ grey levels in all are 1 N; a pixel is 50 µm wide; the ball has a radius of 3 mm.
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// // Hertz's pressure p₀√(1 − r²/a²), a = 20 pixels = 1 mm: (2π/3) a² p₀ grey levels, 1.005 N for p₀ = 120.
/// let hertz = |peak: f64| Array2::from_shape_fn((64, 64), |(r, c)| {
///     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
///     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// });
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// let mut press = pipeline.press(reference.view())?;
/// press.add_frame(frame.view());
/// // Hertz has E = (1 − ν²) 3FR/(4a³) of a ball on a rigid flat; finite strain changes it by some percents at a/R = 1/3.
/// let hertz = 0.75 * 3.0 * 1.005 * 3e-3 / (4.0 * 1e-9);
/// assert!((press.modulus()?.youngs_modulus_pa / hertz - 1.0).abs() < 0.1);
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone)]
pub struct Pipeline {
    contact: Arc<dyn ContactStage>,
    surface: Arc<dyn SurfaceReconstruction<f64> + Send + Sync>,
    /// None: the default for what the surface is read from.
    sampler: Option<Arc<dyn ControlPointSampler<f64> + Send + Sync>>,
    matcher: Arc<dyn PointMatcher<3> + Send + Sync>,
    warp: Arc<dyn WarpModel<f64, 3> + Send + Sync>,
    strain: Arc<dyn StrainMeasure + Send + Sync>,
    estimator: EstimatorStage,
    settings: Settings,
}

impl Pipeline {
    /// The default stages behind any contact stage; no waveguide, 200 control points.
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
    /// [`PipelineError::Material`] for an object that is not physical, [`PipelineError::SurfaceOptions`] where a default stage refuses its options.
    pub fn new(
        contact: impl ContactStage + 'static,
        object: Object,
    ) -> Result<Self, PipelineError> {
        Ok(Self {
            contact: Arc::new(contact),
            surface: Arc::new(named::eikonal()?),
            sampler: None,
            matcher: Arc::new(named::near_by()),
            warp: Arc::new(StrainSpline),
            strain: Arc::new(GreenLagrange),
            estimator: EstimatorStage::named(EstimatorChoice::default()),
            settings: Settings::new(object.checked()?),
        })
    }

    /// The default pipeline for a sensor calibrated with pairs of integrated pixel value and force.
    ///
    /// # Errors
    /// [`PipelineError::Calibration`] and [`PipelineError::Sensor`]; those of [`new`](Self::new).
    pub fn from_pairs(
        pairs: &[CalibrationPair],
        pixel_size_m: [f64; 2],
        object: Object,
    ) -> Result<Self, PipelineError> {
        Self::new(LightContact::from_pairs(pairs, pixel_size_m)?, object)
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The contact stage.
    pub fn contact(&self) -> &dyn ContactStage {
        self.contact.as_ref()
    }

    /// The estimator of the modulus; one that goes by its name is built when it is first needed, for all clones.
    ///
    /// # Errors
    /// [`PipelineError::WrongEstimator`] where the chosen one does not fit the object.
    pub fn estimator(&self) -> Result<Arc<dyn ModulusEstimator + Send + Sync>, PipelineError> {
        let settings = &self.settings;
        self.estimator
            .get(settings.object, settings.waveguide.as_ref())
    }

    pub(super) fn surface(&self) -> &dyn SurfaceReconstruction<f64> {
        self.surface.as_ref()
    }

    pub(super) fn sampler(&self) -> &dyn ControlPointSampler<f64> {
        match (&self.sampler, self.settings.surface_input) {
            (Some(sampler), _) => sampler.as_ref(),
            (None, SurfaceInput::Shading) => &ContactSampler,
            // Depths read from a signal end in a step at the contact's boundary, not at the plane.
            (None, SurfaceInput::Signal) => &EquallySpaced,
        }
    }

    pub(super) fn matcher(&self) -> &dyn PointMatcher<3> {
        self.matcher.as_ref()
    }

    pub(super) fn warp(&self) -> &dyn WarpModel<f64, 3> {
        self.warp.as_ref()
    }

    pub(super) fn strain(&self) -> &dyn StrainMeasure {
        self.strain.as_ref()
    }

    /// The reference that the settings ask for, of one or more frames without contact.
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
