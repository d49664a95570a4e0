//! Relaxation: support, update and normalisation in turn.

use super::update::{sinkhorn, update};
use super::{MatchMatrix, RelaxationLabelling};
use tactile_tps::Scalar;

/// (19), (20) and normalisation in turn until M no longer changes.
pub(super) fn relax_with<T: Scalar>(
    options: &RelaxationLabelling,
    mut m: MatchMatrix<T>,
    support: impl Fn(&MatchMatrix<T>) -> Vec<T>,
) -> MatchMatrix<T> {
    for _ in 0..options.sweeps {
        let before = m.clone();
        let support = support(&m);
        let gain = slack_gain(&support, m.columns(), options.slack);
        update(&mut m, &support, gain);
        sinkhorn(&mut m, options.sinkhorn_sweeps, T::zero());
        if m.largest_change(&before) <= nalgebra::convert(options.tolerance) {
            break;
        }
    }
    m
}

/// Gain of the slack: a share of what the best partners get, so that it means the same for every neighbourhood.
fn slack_gain<T: Scalar>(support: &[T], columns: usize, share: f64) -> T {
    let rows = support.len() / columns;
    let best = support
        .chunks_exact(columns)
        .map(|row| row.iter().fold(T::zero(), |m, &s| m.max(s)));
    best.fold(T::zero(), |sum, s| sum + s) * nalgebra::convert(share / rows as f64)
}
