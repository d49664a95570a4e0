//! Prior knowledge of a block, and measured pressure profiles.

use tactile_elasticity::{ElasticityError, Quantity};
use tactile_fem::{Interface, Material};

/// A cylindrical block of tissue on a rigid stage: prior values, each with its standard error.
///
/// ```
/// use tactile_fem::Interface;
/// use tactile_inclusion::TissueBlock;
///
/// let block = TissueBlock::new(30e-3, 40e-3)?
///     .with_height_error_m(0.3e-3)?
///     .with_poisson_ratio(0.49, 0.005)?
///     .with_youngs_modulus(5e3, 1e3)?
///     .with_approach_error_m(10e-6)?
///     .with_interface(Interface::Bonded);
/// assert_eq!((block.height_m(), block.radius_m()), (30e-3, 40e-3));
/// assert!(TissueBlock::new(f64::NAN, 40e-3).is_err());
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TissueBlock {
    height_m: f64,
    height_error_m: f64,
    radius_m: f64,
    poisson_ratio: f64,
    poisson_ratio_error: f64,
    approach_error_m: f64,
    each_approach_error_m: f64,
    /// ln E₀ and its standard error.
    block_modulus: Option<(f64, f64)>,
    interface: Option<Interface>,
}

impl TissueBlock {
    /// Creates the block from its height and radius in metres. The defaults are: 2 % standard error
    /// of the height, a Poisson ratio of 0.495 ± 0.005, and an error of 20 µm of the approach zero.
    /// Whether the face sticks or slides is unknown.
    ///
    /// # Errors
    /// An error for a length that is not positive.
    pub fn new(height_m: f64, radius_m: f64) -> Result<Self, ElasticityError> {
        Quantity::Thickness.positive(height_m)?;
        Quantity::Radius.positive(radius_m)?;
        Ok(Self {
            height_m,
            height_error_m: 0.02 * height_m,
            radius_m,
            poisson_ratio: 0.495,
            poisson_ratio_error: 0.005,
            approach_error_m: 20e-6,
            each_approach_error_m: 0.0,
            block_modulus: None,
            interface: None,
        })
    }

    /// Sets the height's standard error, in metres.
    ///
    /// # Errors
    /// An error for a value that is not positive.
    pub fn with_height_error_m(mut self, error_m: f64) -> Result<Self, ElasticityError> {
        self.height_error_m = Quantity::StandardError.positive(error_m)?;
        Ok(self)
    }

    /// Sets Poisson's ratio of tissue and inclusion, at most 0.4999, and its standard error.
    ///
    /// # Errors
    /// An error for a ratio that the finite elements do not support, or an error that is not
    /// positive.
    pub fn with_poisson_ratio(mut self, value: f64, error: f64) -> Result<Self, ElasticityError> {
        Material::new(1.0, value)?;
        self.poisson_ratio = value;
        self.poisson_ratio_error = Quantity::StandardError.positive(error)?;
        Ok(self)
    }

    /// Sets the standard error of the zero of all approaches, in metres.
    ///
    /// # Errors
    /// An error for a value that is not positive.
    pub fn with_approach_error_m(mut self, error_m: f64) -> Result<Self, ElasticityError> {
        self.approach_error_m = Quantity::StandardError.positive(error_m)?;
        Ok(self)
    }

    /// Sets the standard error of each approach on its own, in metres, in addition to that of their
    /// common zero: 0 (the default) for a stage, 0.2 mm for a hand that presses to a mark.
    ///
    /// # Errors
    /// An error for a negative value or NaN.
    pub fn with_each_approach_error_m(mut self, error_m: f64) -> Result<Self, ElasticityError> {
        self.each_approach_error_m = Quantity::StandardError.not_negative(error_m)?;
        Ok(self)
    }

    /// Sets the tissue's Young's modulus and its standard error, in pascals. Without it the modulus
    /// is fitted without prior knowledge.
    ///
    /// # Errors
    /// An error for a value that is not positive.
    pub fn with_youngs_modulus(
        mut self,
        value_pa: f64,
        error_pa: f64,
    ) -> Result<Self, ElasticityError> {
        Quantity::YoungsModulus.positive(value_pa)?;
        Quantity::StandardError.positive(error_pa)?;
        self.block_modulus = Some((value_pa.ln(), error_pa / value_pa));
        Ok(self)
    }

    /// Sets whether the guide's face sticks to the block or slides on it.
    pub fn with_interface(mut self, interface: Interface) -> Self {
        self.interface = Some(interface);
        self
    }

    /// The height, in metres.
    pub fn height_m(&self) -> f64 {
        self.height_m
    }

    /// The radius, in metres.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    pub(crate) fn poisson_ratio(&self) -> f64 {
        self.poisson_ratio
    }

    pub(crate) fn each_approach_error_m(&self) -> f64 {
        self.each_approach_error_m
    }

    pub(crate) fn block_modulus(&self) -> Option<(f64, f64)> {
        self.block_modulus
    }

    pub(crate) fn interfaces(&self) -> Vec<Interface> {
        match self.interface {
            Some(interface) => vec![interface],
            None => vec![Interface::Bonded, Interface::Frictionless],
        }
    }

    /// Means and standard errors of ln H, the approach zero and ν.
    pub(crate) fn known(&self) -> [(f64, f64); 3] {
        [
            (self.height_m.ln(), self.height_error_m / self.height_m),
            (0.0, self.approach_error_m),
            (self.poisson_ratio, self.poisson_ratio_error),
        ]
    }
}

/// Smooth errors of a sensor's pressure over its face, and the error of its force.
///
/// ```
/// use tactile_inclusion::SensorErrors;
///
/// let errors = SensorErrors::default();
/// assert!(errors.common > errors.each_frame);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorErrors {
    /// Relative standard error of the pressure common to all frames, from the calibration.
    pub common: f64,
    /// Relative standard error specific to each frame.
    pub each_frame: f64,
    /// Length over which both are correlated, in metres (Matérn's kernel of order 3/2).
    pub correlation_m: f64,
    /// Relative standard error of the force.
    pub force: f64,
    /// Standard error of the zero of the pressure, in pascals, common to all pixels and frames: the
    /// reference frame's error of rounding, 0.29 grey levels if it is even and without noise.
    pub zero_pa: f64,
    /// Fraction of the finite elements' own error (the deviation from another code) that is
    /// included: 1. With 0 the result contains only the uncertainty of the sensor, as in published
    /// bounds.
    pub model: f64,
}

impl Default for SensorErrors {
    /// 0.3 % in common and 0.1 % for each frame, correlated over 3 mm; 0.1 % of the force; no error
    /// of the zero; and the error of the model.
    fn default() -> Self {
        Self {
            common: 3e-3,
            each_frame: 1e-3,
            correlation_m: 3e-3,
            force: 1e-3,
            zero_pa: 0.0,
            model: 1.0,
        }
    }
}

impl SensorErrors {
    pub(crate) fn checked(self) -> Result<Self, ElasticityError> {
        Quantity::StandardError.not_negative(self.common)?;
        Quantity::StandardError.not_negative(self.each_frame)?;
        Quantity::Distance.positive(self.correlation_m)?;
        Quantity::StandardError.positive(self.force)?;
        Quantity::StandardError.not_negative(self.zero_pa)?;
        Quantity::StandardError.not_negative(self.model)?;
        Ok(self)
    }
}

/// Mean pressure in rings around the axis, for one frame.
///
/// ```
/// use tactile_inclusion::PressureProfile;
///
/// let frame = PressureProfile {
///     approach_m: 1e-3,
///     force_n: Some(0.35),
///     pressure_pa: vec![348.0; 12],
///     standard_error_pa: vec![0.3; 12],
/// };
/// assert_eq!(frame.pressure_pa.len(), frame.standard_error_pa.len());
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PressureProfile {
    /// Displacement of the guide into the block, in metres.
    pub approach_m: f64,
    /// Force on the guide in newtons. `None` if unknown.
    pub force_n: Option<f64>,
    /// Mean pressure of each ring, in pascals.
    pub pressure_pa: Vec<f64>,
    /// White error of each ring's mean in pascals: that of a pixel over the root of the pixel
    /// count.
    pub standard_error_pa: Vec<f64>,
}

/// Checks that there are approaches, and that they are positive and increasing.
pub(crate) fn check_approaches(
    approaches_m: impl Iterator<Item = f64>,
) -> Result<(), ElasticityError> {
    let mut approaches_m = approaches_m.peekable();
    if approaches_m.peek().is_none() {
        return Err(ElasticityError::TooFewLoads {
            expected: 1,
            found: 0,
        });
    }
    Quantity::Distance.growing(approaches_m)
}

/// Checks frames against the radii of the rings.
pub(crate) fn check(radii_m: &[f64], frames: &[PressureProfile]) -> Result<(), ElasticityError> {
    check_approaches(frames.iter().map(|frame| frame.approach_m))?;
    for &radius in radii_m {
        Quantity::Radius.positive(radius)?;
    }
    for frame in frames {
        if let Some(force) = frame.force_n {
            Quantity::Force.positive(force)?;
        }
        Quantity::Pressure.entries(frame.pressure_pa.len(), radii_m.len())?;
        Quantity::StandardError.entries(frame.standard_error_pa.len(), radii_m.len())?;
        for &pressure in &frame.pressure_pa {
            Quantity::Pressure.finite(pressure)?;
        }
        for &error in &frame.standard_error_pa {
            Quantity::StandardError.positive(error)?;
        }
    }
    Ok(())
}
