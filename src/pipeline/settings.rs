//! Settings of a pipeline besides its stages.
use super::assumptions::{Assumption, Assumptions, CheckedGain, CheckedGuide};
use super::error::PipelineError;
use super::reference_light::ReferenceLight;
use super::specimen::Object;
use crate::core::{InvalidOption, Requirement, Source, Uncertain};
use crate::elasticity::ElasticityError;
use crate::elasticity::contact::{Layer, Waveguide};
use crate::elasticity::modulus::Bodies;
use crate::sfs::Binning;
use nalgebra::{DMatrix, DVector};

/// Default number of control points on each surface, as in the paper.
pub(crate) const DEFAULT_CONTROL_POINTS: usize = 200;

/// Requirement on a covariance of layers.
const THREE_PER_LAYER: &str = "three rows and columns per layer (ln E, ln h, ν)";

/// The part of the frame's information that the surface stage gets.
///
/// ```
/// use tactile_imaging::pipeline::{DarkContact, Object, Pipeline, SurfaceInput};
/// // A depth table needs grey levels; shape from shading, the default, needs the cosine of the
/// // slope.
/// use tactile_imaging::force::CalibrationPair;
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let shading = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(4e-3))?;
/// assert_eq!(shading.settings().surface_input, SurfaceInput::Shading);
/// let table = DarkContact::depth_table(&[(0.0, 0.0), (100.0, 0.5e-3)])?;
/// let depth = shading.with_surface(table, SurfaceInput::Signal);
/// assert_eq!(depth.settings().smoothing_px, 1, "measured heights");
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SurfaceInput {
    /// The signal relative to its largest value, from 0 to 1: the cosine of the slope under frontal
    /// light.
    #[default]
    Shading,
    /// The signal itself: grey levels above (or, for sensors that darken, below) the reference.
    Signal,
}

/// Settings of a pipeline besides its stages, changed by
/// [`Pipeline::with_settings`](super::Pipeline::with_settings).
///
/// ```
/// use tactile_imaging::pipeline::{Binning, Object, Pipeline, Settings};
/// use tactile_imaging::force::CalibrationPair;
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?.with_settings(
///     |settings| {
///         settings.control_points = 80;
///         settings.smoothing_px = 3;
///     },
/// )?;
/// let settings: &Settings = pipeline.settings();
/// assert_eq!((settings.control_points, settings.smoothing_px), (80, 3));
/// assert_eq!(settings.binning, Binning::Auto);
/// assert!(settings.waveguide.is_none(), "rigid compared with the ball");
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Settings {
    /// The pressed object.
    pub object: Object,
    /// The sensor's layers. `None` if they are rigid compared with the object.
    pub waveguide: Option<Waveguide>,
    /// Number of control points on each surface. The default is 200, as in the paper.
    pub control_points: usize,
    /// The input of the surface stage.
    pub surface_input: SurfaceInput,
    /// Width in pixels (odd) of the box filter applied twice along each axis to the signal before
    /// the surface stage; 1 for no filter. If the surface is nearly level, its slope √(1/I² − 1)
    /// amplifies noise of the shading I.
    pub smoothing_px: usize,
    /// Grid of the surface stage.
    pub binning: Binning,
    /// Whether differences are divided by the local brightness of the reference, so that vignetting
    /// does not reduce the force. This is correct if stray light and signal come through the same
    /// lens and the calibration was taken in the centre of the frame.
    pub flat_field: bool,
    /// The standard errors of the inputs: stated or default.
    pub assumptions: Assumptions,
    /// Covariance of ln E of all layers of the waveguide, then of ln h, then of ν. If `None`, the
    /// moduli of all layers have one common factor, with the error of [`Source::Guide`].
    pub layer_covariance: Option<DMatrix<f64>>,
    /// Covariances of the same parameters with the logarithm of measured lengths, because the
    /// pixels that measure the object also measured the contacts of the balls that checked the
    /// layers. `None` for zero.
    pub layers_with_length: Option<DVector<f64>>,
    /// The light of the reference at the calibration of the forces. Forces read from light are
    /// divided by the factor by which the reference of a press is brighter. If `None`, the light is
    /// assumed unchanged.
    pub calibrated_light: Option<ReferenceLight>,
    /// The gain by presses of known force. Forces read from light are divided by it, and its error
    /// replaces that of [`Source::Coupling`].
    pub checked_gain: Option<CheckedGain>,
    /// The stiffness of the waveguide by presses of balls of known modulus. `waveguide` and
    /// `layer_covariance` are the values after these presses.
    pub checked_guide: Option<CheckedGuide>,
}

impl Settings {
    /// The defaults for an object: no waveguide, 200 control points.
    pub(super) fn new(object: Object) -> Self {
        Self {
            object,
            waveguide: None,
            control_points: DEFAULT_CONTROL_POINTS,
            surface_input: SurfaceInput::Shading,
            smoothing_px: 5,
            binning: Binning::default(),
            flat_field: false,
            assumptions: Assumptions::default(),
            layer_covariance: None,
            layers_with_length: None,
            calibrated_light: None,
            checked_gain: None,
            checked_guide: None,
        }
    }

    /// Adds stated errors. An error of the layers' common factor ([`Source::Guide`]) replaces a
    /// covariance of the layers, such as that of a calibrated sensor.
    ///
    /// ```
    /// use tactile_imaging::force::Source;
    /// use tactile_imaging::pipeline::Assumptions;
    /// use tactile_simulate::Trial;
    /// let mut errors = Assumptions::default();
    /// errors.state(Source::Guide, 0.02);
    /// let pipeline = Trial::coarser(8)?.pipeline()?.with_settings(|settings| {
    ///     settings.layer_covariance = Some(nalgebra::DMatrix::zeros(9, 9)); // of three layers
    ///     settings.state_errors(&errors);
    /// })?;
    /// assert_eq!(pipeline.settings().assumptions.stated(Source::Guide), Some(0.02));
    /// assert!(pipeline.settings().layer_covariance.is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn state_errors(&mut self, errors: &Assumptions) {
        self.assumptions.state_all(errors);
        if errors.stated(Source::Guide).is_some() {
            self.layer_covariance = None;
        }
    }

    /// States that every input without a stated error is exact, except for uneven light over the
    /// frame. Use it for frames with known truth.
    ///
    /// ```
    /// use tactile_imaging::{Object, Pipeline, force::CalibrationPair, force::Source};
    /// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?
    ///     .with_settings(|settings| {
    ///         settings.assumptions.state(Source::PoissonRatio, 0.005);
    ///         settings.state_exact();
    ///     })?;
    /// let errors = &pipeline.settings().assumptions;
    /// assert_eq!(errors.stated(Source::Coupling), Some(0.0));
    /// assert_eq!(errors.stated(Source::PoissonRatio), Some(0.005));
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn state_exact(&mut self) {
        for Assumption { source, .. } in Assumption::ALL {
            // Light is never perfectly even.
            let error = if source == Source::Gain { 1e-3 } else { 0.0 };
            if self.assumptions.stated(source).is_none() {
                self.assumptions.state(source, error);
            }
        }
    }

    /// Whether the error of a source is the default.
    pub(super) fn assumes(&self, source: Source) -> bool {
        let shown = match source {
            Source::Coupling => self.checked_gain.is_some(),
            Source::Guide => self.layer_covariance.is_some(),
            _ => false,
        };
        let assumed = Assumption::of(source).is_some();
        assumed && !shown && self.assumptions.stated(source).is_none()
    }

    /// The covariance of the layers' parameters, stated or default.
    pub(super) fn layer_covariance(&self) -> DMatrix<f64> {
        let layers = self
            .waveguide
            .as_ref()
            .map_or(0, |guide| guide.layers().len());
        self.layer_covariance.clone().unwrap_or_else(|| {
            // A common factor of all moduli, whose logarithms come first.
            let variance = self.assumptions.error(Source::Guide).powi(2);
            let parameters = Layer::PARAMETERS * layers;
            DMatrix::from_fn(parameters, parameters, |i, j| match i.max(j) < layers {
                true => variance,
                false => 0.0,
            })
        })
    }

    /// The object and the guide, with their stated or default errors.
    pub(super) fn bodies(&self) -> Result<Bodies, ElasticityError> {
        let errors = &self.assumptions;
        let size_error = match (self.object.radius_m(), errors.stated(Source::ObjectSize)) {
            // The estimator of a block does not use its size, and the tip of a cone has no default
            // radius.
            (None, None) => 0.0,
            _ => errors.error(Source::ObjectSize),
        };
        let bodies = Bodies::new(self.object, self.waveguide.clone())
            .with_size_error(size_error)?
            .with_poisson_ratio_error(errors.error(Source::PoissonRatio))?
            .with_adhesion_j_per_m2(errors.error(Source::Adhesion))?;
        let Some(covariance) = &self.layer_covariance else {
            let error = errors.error(Source::Guide);
            return bodies.with_guide_error(Uncertain::exact(1.0).by(Source::Guide, error));
        };
        let length_error = errors.error(Source::PixelSize);
        let with_length = self.layers_with_length.as_ref();
        let with_length = with_length.filter(|_| length_error > 0.0);
        let by_length = |c: &DVector<f64>| c / length_error;
        bodies.with_layer_errors(covariance.clone(), with_length.map(by_length))
    }

    /// Rejects invalid settings.
    pub(super) fn check(&self) -> Result<(), PipelineError> {
        self.object.validated().map_err(PipelineError::Material)?;
        Requirement::Odd.check("smoothing_px", self.smoothing_px as f64)?;
        if let Binning::Blocks(side) = self.binning {
            Requirement::AtLeastOne.check("binning", side as f64)?;
        }
        self.assumptions.check()?;
        let layers = self.waveguide.as_ref().map_or(0, |w| w.layers().len());
        let parameters = Layer::PARAMETERS * layers;
        let sized = |name, found: usize| match found == parameters {
            true => Ok(()),
            false => Err(InvalidOption::new(name, found as f64, THREE_PER_LAYER)),
        };
        if let Some(covariances) = &self.layers_with_length {
            sized("layers_with_length", covariances.len())?;
            for entry in covariances {
                Requirement::Finite.check("layers_with_length", *entry)?;
            }
        }
        if let Some(covariance) = &self.layer_covariance {
            sized("layer_covariance", covariance.nrows())?;
            sized("layer_covariance", covariance.ncols())?;
            for entry in covariance {
                Requirement::Finite.check("layer_covariance", *entry)?;
            }
            for variance in &covariance.diagonal() {
                Requirement::NonNegative.check("layer_covariance", *variance)?;
            }
        }
        Ok(())
    }
}
