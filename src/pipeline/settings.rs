//! Settings of a pipeline beside its stages.
use super::assumptions::{CheckedGain, CheckedGuide};
use super::error::PipelineError;
use super::reference_light::ReferenceLight;
use super::specimen::Object;
use crate::core::{Source, Uncertain};
use crate::elasticity::ElasticityError;
use crate::elasticity::contact::{PARAMETERS_PER_LAYER, Waveguide};
use crate::elasticity::modulus::Bodies;
use crate::sfs::Binning;
use nalgebra::{DMatrix, DVector};

/// Control points on each surface where nothing else is asked for: the paper's number.
pub(crate) const DEFAULT_CONTROL_POINTS: usize = 200;

/// What of the frame the surface stage looks at.
///
/// ```
/// use tactile_imaging::pipeline::{DarkContact, Object, Pipeline, SurfaceInput};
/// // A table of depths wants grey levels; shape from shading, the default, the cosine of the
/// // slope.
/// use tactile_imaging::force::CalibrationPair;
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let shading = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(4e-3))?;
/// assert_eq!(shading.settings().surface_input, SurfaceInput::Shading);
/// let table = DarkContact::depth_table(&[(0.0, 0.0), (100.0, 0.5e-3)])?;
/// let depth = shading.with_surface(table, SurfaceInput::Signal);
/// assert_eq!(depth.settings().smoothing_px, 1, "heights as they are measured");
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SurfaceInput {
    /// Signal over its greatest value, from 0 to 1: the cosine of the slope under frontal light.
    #[default]
    Shading,
    /// The signal itself: grey levels above (or, for sensors that darken, below) the reference.
    Signal,
}

/// Settings of a pipeline beside its stages.
/// [`Pipeline::with_settings`](super::Pipeline::with_settings) changes it.
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
/// assert!(settings.waveguide.is_none(), "rigid beside the ball");
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Settings {
    /// What is pressed.
    pub object: Object,
    /// The sensor's layers. `None`: rigid beside the object.
    pub waveguide: Option<Waveguide>,
    /// Number of control points on each surface. The paper's 200 by default.
    pub control_points: usize,
    /// What of the frame the surface stage looks at.
    pub surface_input: SurfaceInput,
    /// Width in pixels (odd) of the box that smooths the signal, twice along each axis, before the
    /// surface stage; 1 for none. Where the surface is nearly level its slope √(1/I² − 1) turns
    /// noise of the shading I into height.
    pub smoothing_px: usize,
    /// Grid of the surface stage.
    pub binning: Binning,
    /// Whether differences are divided by the brightness that the reference has there: vignetting
    /// then costs no force. Right where stray light and signal come through the same lens, and the
    /// calibration was taken in the frame's middle.
    pub flat_field: bool,
    /// Relative standard error common to all forces beside the calibration's scatter: the gauge's
    /// scale, and light that is uneven over the frame, by which contacts of another size than the
    /// calibration's are read with another gain. `None`: a gauge to 0.2 % and 0.1 % of the light
    /// are assumed.
    pub force_scale_error: Option<f64>,
    /// Relative standard error common to all forces read from light: a bare guide scatters by what
    /// touches it, and the object may reflect otherwise than what it was calibrated with. Zero
    /// under a fixed diffusing skin, or for the calibrator itself. `None`: 12 % are assumed, and
    /// the force of an object that reflects a fifth less lies in the interval.
    pub coupling_error: Option<f64>,
    /// Relative standard error common to all lengths: that of the pixel size. `None`: 0.3 % are
    /// assumed.
    pub length_scale_error: Option<f64>,
    /// Standard error of the object's radius in metres. `None`: 0.5 % of it are assumed.
    pub object_radius_error_m: Option<f64>,
    /// Standard error of the object's Poisson ratio. `None`: 0.01 is assumed.
    pub poisson_ratio_error: Option<f64>,
    /// Work of adhesion that a ball may have, in J/m², one standard deviation. `None`: 1 mJ/m² is
    /// assumed, as of a dusted ball. Clean dry silicone has some tens.
    pub adhesion_error_j_per_m2: Option<f64>,
    /// Covariance of ln E of all layers of the waveguide, then of ln h, then of ν. `None`: the
    /// moduli of all layers are assumed to be wrong by one factor, of 5 %.
    pub layer_covariance: Option<DMatrix<f64>>,
    /// Covariances of the same parameters with the logarithm of measured lengths: the pixels that
    /// measure the object have measured the contacts of the balls that checked the layers, too.
    /// `None`: zero.
    pub layers_with_length: Option<DVector<f64>>,
    /// The light of the reference that forces were calibrated on. Forces read from light are
    /// divided by the factor by which a press's reference is brighter. `None`: the light is taken
    /// to be the same.
    pub calibrated_light: Option<ReferenceLight>,
    /// The gain that presses of known force show. Forces that are read from light are divided by
    /// it, and its error stands in place of `coupling_error`.
    pub checked_gain: Option<CheckedGain>,
    /// What presses of balls of known modulus show of the waveguide. `waveguide` and
    /// `layer_covariance` are those after these presses.
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
            force_scale_error: None,
            coupling_error: None,
            length_scale_error: None,
            object_radius_error_m: None,
            poisson_ratio_error: None,
            adhesion_error_j_per_m2: None,
            layer_covariance: None,
            layers_with_length: None,
            calibrated_light: None,
            checked_gain: None,
            checked_guide: None,
        }
    }

    /// Relative error of the layers' moduli where none is stated.
    pub(super) const ASSUMED_LAYER_ERROR: f64 = 0.05;

    /// Covariance of ln E, ln h and ν of all layers whose moduli are wrong by one factor with this
    /// relative error.
    ///
    /// ```
    /// use tactile_imaging::pipeline::Settings;
    /// let covariance = Settings::common_layer_covariance(2, 0.05);
    /// assert_eq!(covariance.shape(), (6, 6)); // ln E, ln h and ν of two layers
    /// assert_eq!((covariance[(0, 1)], covariance[(2, 2)]), (0.05 * 0.05, 0.0));
    /// ```
    #[must_use]
    pub fn common_layer_covariance(layers: usize, error: f64) -> DMatrix<f64> {
        let parameters = PARAMETERS_PER_LAYER * layers;
        // The logarithms of the moduli come first.
        let is_modulus = |parameter: usize| parameter < layers;
        DMatrix::from_fn(parameters, parameters, |i, j| {
            match is_modulus(i) && is_modulus(j) {
                true => error * error,
                false => 0.0,
            }
        })
    }

    /// States that every input which is not stated yet is exact, but for light that is uneven over
    /// the frame: for frames whose truth is known.
    ///
    /// ```
    /// use tactile_imaging::{Object, Pipeline, force::CalibrationPair};
    /// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?
    ///     .with_settings(|settings| {
    ///         settings.poisson_ratio_error = Some(0.005);
    ///         settings.state_exact();
    ///     })?;
    /// let stated = pipeline.settings();
    /// assert_eq!(stated.coupling_error, Some(0.0));
    /// assert_eq!(stated.poisson_ratio_error, Some(0.005));
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn state_exact(&mut self) {
        self.force_scale_error.get_or_insert(1e-3);
        for error in [
            &mut self.coupling_error,
            &mut self.length_scale_error,
            &mut self.object_radius_error_m,
            &mut self.poisson_ratio_error,
            &mut self.adhesion_error_j_per_m2,
        ] {
            error.get_or_insert(0.0);
        }
        let layers = self.waveguide.as_ref().map_or(0, |w| w.layers().len());
        let parameters = PARAMETERS_PER_LAYER * layers;
        self.layer_covariance
            .get_or_insert_with(|| DMatrix::zeros(parameters, parameters));
    }

    pub(super) fn force_scale(&self) -> f64 {
        self.force_scale_error.unwrap_or(0.2e-2_f64.hypot(0.1e-2))
    }

    /// Relative error of the gain of the light, beside that of the calibration.
    pub(super) fn coupling(&self) -> f64 {
        match self.checked_gain {
            Some(checked) => checked.gain.relative_error(),
            None => self.unchecked_coupling(),
        }
    }

    /// That without presses of known force.
    pub(crate) fn unchecked_coupling(&self) -> f64 {
        self.coupling_error.unwrap_or(0.12)
    }

    pub(super) fn length_scale(&self) -> f64 {
        self.length_scale_error.unwrap_or(0.3e-2)
    }

    /// The object and the guide, with the errors that are stated or assumed of them.
    pub(super) fn bodies(&self) -> Result<Bodies, ElasticityError> {
        let poisson_error = self.poisson_ratio_error.unwrap_or(0.01);
        let bodies = Bodies::new(self.object, self.waveguide.clone())
            .with_size_error(self.size_error())?
            .with_poisson_ratio_error(poisson_error)?
            .with_adhesion_j_per_m2(self.adhesion_error_j_per_m2.unwrap_or(1e-3))?;
        match &self.layer_covariance {
            None => {
                let error = Self::ASSUMED_LAYER_ERROR;
                bodies.with_guide_error(Uncertain::exact(1.0).by(Source::Guide, error))
            }
            Some(covariance) => {
                let length_error = self.length_scale();
                let by_length = |c: &DVector<f64>| c / length_error;
                let lengths = self
                    .layers_with_length
                    .as_ref()
                    .filter(|_| length_error > 0.0);
                bodies.with_layer_errors(covariance.clone(), lengths.map(by_length))
            }
        }
    }

    /// Relative error of the object's size.
    fn size_error(&self) -> f64 {
        let radius_m = match self.object {
            Object::Sphere { radius_m, .. } | Object::FlatPunch { radius_m, .. } => radius_m,
            Object::Layer {
                indenter_radius_m, ..
            } => indenter_radius_m,
            Object::Cone { .. }
            | Object::Block { .. }
            | Object::Cylinder { .. }
            | Object::Unknown { .. } => return 0.0,
        };
        self.object_radius_error_m
            .map_or(0.5e-2, |error_m| error_m / radius_m)
    }

    /// Refuses what has no meaning.
    pub(super) fn check(&self) -> Result<(), PipelineError> {
        self.object.validated().map_err(PipelineError::Material)?;
        if self.smoothing_px.is_multiple_of(2) {
            return Err(PipelineError::EvenSmoothing {
                found: self.smoothing_px,
            });
        }
        if self.binning == Binning::Blocks(0) {
            return Err(PipelineError::EmptyBlocks);
        }
        let is_error = |found: &f64| *found >= 0.0 && found.is_finite();
        let scales = [
            self.force_scale_error,
            self.coupling_error,
            self.length_scale_error,
        ];
        if let Some(&found) = scales.iter().flatten().find(|e| !is_error(e)) {
            return Err(PipelineError::ScaleError { found });
        }
        let inputs = [
            self.object_radius_error_m,
            self.poisson_ratio_error,
            self.adhesion_error_j_per_m2,
        ];
        if let Some(&found) = inputs.iter().flatten().find(|e| !is_error(e)) {
            return Err(PipelineError::InputError { found });
        }
        let layers = self.waveguide.as_ref().map_or(0, |w| w.layers().len());
        let expected = PARAMETERS_PER_LAYER * layers;
        if let Some(covariances) = &self.layers_with_length {
            if covariances.len() != expected {
                let found = covariances.shape();
                return Err(PipelineError::LayerCovariance { expected, found });
            }
            if let Some(&found) = covariances.iter().find(|c| !c.is_finite()) {
                return Err(PipelineError::InputError { found });
            }
        }
        match &self.layer_covariance {
            Some(covariance) => Self::check_covariance(covariance, expected),
            None => Ok(()),
        }
    }

    fn check_covariance(covariance: &DMatrix<f64>, expected: usize) -> Result<(), PipelineError> {
        let found = covariance.shape();
        if found != (expected, expected) {
            return Err(PipelineError::LayerCovariance { expected, found });
        }
        let broken = |c: &&f64| !c.is_finite();
        let negative = covariance.diagonal().iter().copied().find(|v| *v < 0.0);
        match covariance.iter().find(broken).copied().or(negative) {
            Some(found) => Err(PipelineError::InputError { found }),
            None => Ok(()),
        }
    }
}
