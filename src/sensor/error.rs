//! Why a sensor could not be calibrated.
use crate::force::ForceError;
use crate::pipeline::PipelineError;
use crate::scene::SceneError;
use std::path::PathBuf;

/// Why a sensor could not be calibrated, in one sentence. Presses are counted from 1 in the sentences and from 0 in the fields.
///
/// ```
/// use tactile_imaging::sensor::SensorError;
/// let few = SensorError::TooFewPresses { found: 3, expected: 5 };
/// assert_eq!(few.to_string(), "3 presses with a contact and a force, at least 5 are needed to fit the light-to-pressure curve");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SensorError {
    /// The calibration's file, or one that it names, cannot be read.
    #[error(transparent)]
    File(#[from] SceneError),
    /// The sensor's file cannot be written.
    #[error("cannot write {}: {source}", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Too few presses.
    #[error(
        "{found} presses with a contact and a force, at least {expected} are needed to fit the light-to-pressure curve"
    )]
    TooFewPresses {
        /// Presses that can be used.
        found: usize,
        /// How many are needed.
        expected: usize,
    },
    /// A press that should have one shows no contact, or cannot be measured.
    #[error("press {}: {source}", press + 1)]
    Press {
        /// The press.
        press: usize,
        /// What is wrong with it.
        source: ForceError,
    },
    /// A frame's reference cannot be used.
    #[error("the reference: {0}")]
    Reference(#[source] ForceError),
    /// The presses do not determine the curve.
    #[error("the presses do not determine the light-to-pressure curve: {0}")]
    Curve(#[source] ForceError),
    /// The curve leaves a scatter beyond what the gauge explains.
    #[error("the forces scatter by {scatter:.1} times their stated error about the light-to-pressure curve: check press {}, the worst", worst + 1)]
    Scatter {
        /// Standard deviation of the residuals over the stated errors.
        scatter: f64,
        /// The press with the largest residual.
        worst: usize,
    },
    /// The presses leave out forces that scenes will have.
    #[error("the presses reach from {:.3} N to {:.3} N, but scenes will have {:.3} N to {:.3} N", found[0], found[1], expected[0], expected[1])]
    NotCovered {
        /// Least and greatest force of the presses.
        found: [f64; 2],
        /// Those of the scenes.
        expected: [f64; 2],
    },
    /// The target's dots cannot be found or do not lie on a grid.
    #[error("the target: {found} dots on a grid, at least {expected} are needed")]
    Target {
        /// Dots with a place on the grid.
        found: usize,
        /// How many are needed.
        expected: usize,
    },
    /// The target's dots do not determine the lens.
    #[error("the target does not determine the lens: {0}")]
    Lens(#[source] ForceError),
    /// The contact radii do not go with the forces of a ball on these layers.
    #[error(
        "the contact radii under the ball of {radius_m:e} m do not fit layers of the stated errors (off by {deviation:.1} standard errors): check the ball's radius and the forces"
    )]
    Radius {
        /// The ball's stated radius.
        radius_m: f64,
        /// How far off, in standard errors.
        deviation: f64,
    },
    /// Something cannot be built from what was fitted.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
}
