//! The findings of a sensor calibration per press and per layer, and its errors.
use super::input::Indenter;
use crate::io::FileError;
use tactile_imaging::force::{Branch, Estimate, ForceError};
use tactile_imaging::pipeline::PipelineError;

/// Why a sensor could not be calibrated, in one sentence. Presses are counted from 1 in the
/// messages and from 0 in the fields.
///
/// ```
/// use tactile_files::sensor::SensorError;
/// let few = SensorError::TooFewPresses { found: 3, expected: 5 };
/// assert!(few.to_string().starts_with("3 presses with a contact and a force, at least 5 are"));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SensorError {
    /// A file cannot be read, used or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Too few presses.
    #[error(
        "{found} presses with a contact and a force, at least {expected} are needed to fit the \
         light-to-pressure curve"
    )]
    TooFewPresses {
        /// Number of presses that can be used.
        found: usize,
        /// Smallest number that is needed.
        expected: usize,
    },
    /// A press shows no contact although it should, or cannot be measured.
    #[error("press {}: {source}", press + 1)]
    Press {
        /// The press.
        press: usize,
        /// The fault of the press.
        source: ForceError,
    },
    /// The reference frame cannot be used.
    #[error("the reference: {0}")]
    Reference(#[source] ForceError),
    /// The presses do not determine the curve.
    #[error("the presses do not determine the light-to-pressure curve: {0}")]
    Curve(#[source] ForceError),
    /// The forces scatter about the curve by more than the errors of the gauge.
    #[error(
        "the forces scatter by {scatter:.1} times their stated error about the light-to-pressure \
         curve: check press {}, the worst",
        worst + 1
    )]
    Scatter {
        /// Standard deviation of the residuals over the stated errors.
        scatter: f64,
        /// The press with the largest residual.
        worst: usize,
    },
    /// The presses do not cover the forces of later scenes.
    #[error(
        "the presses reach from {:.3} N to {:.3} N, but scenes will have {:.3} N to {:.3} N",
        found[0],
        found[1],
        expected[0],
        expected[1]
    )]
    NotCovered {
        /// Least and greatest force of the presses.
        found: [f64; 2],
        /// Least and greatest force of the scenes.
        expected: [f64; 2],
    },
    /// The target's dots cannot be found or do not lie on a grid.
    #[error("the target: {found} dots on a grid, at least {expected} are needed")]
    Target {
        /// Number of dots with a place on the grid.
        found: usize,
        /// Smallest number that is needed.
        expected: usize,
    },
    /// The target's dots do not determine the lens.
    #[error("the target does not determine the lens: {0}")]
    Lens(#[source] ForceError),
    /// The contact radii do not fit the forces of a ball on these layers.
    #[error(
        "the contact radii under the ball of {radius_m:e} m do not fit layers of the stated errors \
         (off by {deviation:.1} standard errors): check the ball's radius and the forces"
    )]
    Radius {
        /// The ball's stated radius.
        radius_m: f64,
        /// The deviation in standard errors.
        deviation: f64,
    },
    /// The fitted values cannot form a pipeline.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
}

/// The findings for one press.
///
/// ```
/// use tactile_imaging::force::{Branch, Estimate};
/// use tactile_files::sensor::{Indenter, PressFinding};
/// let finding = PressFinding {
///     indenter: Indenter::Punch { radius_m: 2e-3 },
///     branch: Branch::Loading,
///     force_n: 0.5,
///     integrated_pixel_value: Some(1.2e6),
///     read_force_n: Some(Estimate::new(0.503, 1e-3)),
///     contact_radius_m: Some(Estimate::new(2.01e-3, 2e-6)),
///     layers_force_n: None,
/// };
/// let off = finding.read_force_n.map(|read| read.value / finding.force_n - 1.0);
/// assert!(off.is_some_and(|off| off.abs() < 0.01));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressFinding {
    /// The pressed object.
    pub indenter: Indenter,
    /// Whether the force was rising or falling.
    pub branch: Branch,
    /// The gauge's force in newtons.
    pub force_n: f64,
    /// Grey levels above the reference, summed over the contact. `None` if no contact is seen; the
    /// press is then not used.
    pub integrated_pixel_value: Option<f64>,
    /// The force read from the frame with the fitted curve.
    pub read_force_n: Option<Estimate>,
    /// The fitted contact radius. `None` if no contact is seen.
    pub contact_radius_m: Option<Estimate>,
    /// The force that the fitted layers predict at this radius. `None` if the press was not used
    /// for the layers.
    pub layers_force_n: Option<f64>,
}

/// A parameter of a layer before and after the calibration.
///
/// ```
/// use tactile_files::sensor::LayerFinding;
/// use tactile_imaging::force::Estimate;
/// let modulus = LayerFinding {
///     layer: 0,
///     parameter: "youngs_modulus_pa",
///     stated: Estimate::new(120e3, 15e3),
///     fitted: Estimate::new(135e3, 3e3),
///     identified: true,
/// };
/// assert!(modulus.fitted.standard_error < 0.7 * modulus.stated.standard_error);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerFinding {
    /// Index of the layer, from 0 on the object's side.
    pub layer: usize,
    /// Name of the field in the sensor file.
    pub parameter: &'static str,
    /// The value stated by the user.
    pub stated: Estimate,
    /// The estimate from the presses and the stated value together.
    pub fitted: Estimate,
    /// Whether the presses determine the parameter, so that its error is below 0.7 times the stated
    /// error. Otherwise it keeps its stated value.
    pub identified: bool,
}
