//! Stages by name, as a configuration gives them.
use super::choice::{
    EstimatorChoice, IntegratorChoice, MatcherChoice, ReconstructionChoice, SamplerChoice,
    StrainChoice, WarpChoice,
};

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
    /// Slopes to heights; only a reconstruction that goes through slopes takes another than its own.
    pub integrator: IntegratorChoice,
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
