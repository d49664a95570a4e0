//! Why a fit stopped.

/// The reason why a fit stopped.
///
/// ```
/// use tactile_force::{CalibrationOptions, CalibrationPair, LinearCalibration, Robustness, StopReason, StressCalibration};
///
/// let pairs = [(0.0, 0.0), (1.0, 1.1), (2.0, 1.9), (3.0, 3.0)].map(|(v, f)| CalibrationPair::loading(v, f));
/// let stop = |robustness| {
///     let options = CalibrationOptions::default().with_robustness(robustness);
///     LinearCalibration::<f64>::fit(&pairs, &options).map(|line| line.report().stop)
/// };
/// assert_eq!(stop(Robustness::None)?, StopReason::Direct);
/// assert_eq!(stop(Robustness::Huber)?, StopReason::Converged);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum StopReason {
    /// Solved without iterating.
    Direct,
    /// The last step was below the tolerance.
    Converged,
    /// The iterations ran out first.
    IterationLimit,
}
