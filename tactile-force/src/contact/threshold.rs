//! Thresholds from a false-alarm rate.

use statrs::function::erf::erfc_inv;

/// The z with P(N > z) = rate / trials for a standard normal N: among `trials` values one exceeds it with
/// probability at most `rate`.
pub(super) fn quantile(rate: f64, trials: usize) -> f64 {
    let tail = rate / trials.max(1) as f64;
    std::f64::consts::SQRT_2 * erfc_inv(2.0 * tail)
}
