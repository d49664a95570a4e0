//! Settings of a pipeline beside its stages.
use super::assumptions::{Assumption, CheckedGain, CheckedGuide};
use super::error::PipelineError;
use super::reference_light::ReferenceLight;
use super::specimen::Object;
use crate::core::{InvalidOption, Requirement, Source, Uncertain};
use crate::elasticity::ElasticityError;
use crate::elasticity::contact::{PARAMETERS_PER_LAYER, Waveguide};
use crate::elasticity::modulus::Bodies;
use crate::sfs::Binning;
use nalgebra::{DMatrix, DVector};

/// Control points on each surface where nothing else is asked for: the paper's number.
pub(crate) const DEFAULT_CONTROL_POINTS: usize = 200;

/// What a covariance of layers must have.
const THREE_PER_LAYER: &str = "as many rows and columns as the layers have ln E, ln h and ν";

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

    /// The standard error that is stated of a source's input. `None` if it is assumed, as that of
    /// the layers is unless their covariance is stated.
    fn stated(&self, source: Source) -> Option<f64> {
        match source {
            Source::Gain => self.force_scale_error,
            Source::Coupling => self.coupling_error,
            Source::PixelSize => self.length_scale_error,
            Source::ObjectSize => self.object_radius_error_m,
            Source::PoissonRatio => self.poisson_ratio_error,
            Source::Adhesion => self.adhesion_error_j_per_m2,
            _ => None,
        }
    }

    /// The error of a source's input, stated or assumed.
    fn error(&self, source: Source) -> f64 {
        self.stated(source)
            .unwrap_or_else(|| Assumption::default_of(source))
    }

    /// Whether the error of a source is assumed.
    pub(super) fn assumes(&self, source: Source) -> bool {
        let shown = match source {
            Source::Coupling => self.checked_gain.is_some(),
            Source::Guide => self.layer_covariance.is_some(),
            _ => false,
        };
        let assumption = Assumption::of(source);
        assumption.is_some() && !shown && self.stated(source).is_none()
    }

    pub(super) fn force_scale(&self) -> f64 {
        self.error(Source::Gain)
    }

    /// Relative error of the gain of the light, beside that of the calibration.
    pub(super) fn coupling(&self) -> f64 {
        match self.checked_gain {
            Some(checked) => checked.gain.relative_error(),
            None => self.unchecked_coupling(),
        }
    }

    /// That without presses of known force.
    pub(super) fn unchecked_coupling(&self) -> f64 {
        self.error(Source::Coupling)
    }

    pub(super) fn length_scale(&self) -> f64 {
        self.error(Source::PixelSize)
    }

    /// The covariance of the layers' parameters, stated or assumed.
    pub(super) fn layer_covariance(&self) -> DMatrix<f64> {
        let layers = self
            .waveguide
            .as_ref()
            .map_or(0, |guide| guide.layers().len());
        self.layer_covariance.clone().unwrap_or_else(|| {
            Self::common_layer_covariance(layers, Assumption::default_of(Source::Guide))
        })
    }

    /// The object and the guide, with the errors that are stated or assumed of them.
    pub(super) fn bodies(&self) -> Result<Bodies, ElasticityError> {
        let bodies = Bodies::new(self.object, self.waveguide.clone())
            .with_size_error(self.size_error())?
            .with_poisson_ratio_error(self.error(Source::PoissonRatio))?
            .with_adhesion_j_per_m2(self.error(Source::Adhesion))?;
        match &self.layer_covariance {
            None => {
                let error = Assumption::default_of(Source::Guide);
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
        let stated = self.object_radius_error_m;
        let assumed = Assumption::default_of(Source::ObjectSize);
        stated.map_or(assumed, |error_m| error_m / radius_m)
    }

    /// Refuses what has no meaning.
    pub(super) fn check(&self) -> Result<(), PipelineError> {
        self.object.validated().map_err(PipelineError::Material)?;
        Requirement::Odd.check("smoothing_px", self.smoothing_px as f64)?;
        if let Binning::Blocks(side) = self.binning {
            Requirement::AtLeastOne.check("binning", side as f64)?;
        }
        for assumption in Assumption::ALL {
            if let Some(error) = self.stated(assumption.source) {
                Requirement::NonNegative.check(assumption.setting, error)?;
            }
        }
        let layers = self.waveguide.as_ref().map_or(0, |w| w.layers().len());
        let parameters = PARAMETERS_PER_LAYER * layers;
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
