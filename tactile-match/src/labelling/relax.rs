//! Relaxation: support, update and normalisation in turn.

use super::update::{sinkhorn, update};
use super::{MatchMatrix, RelaxationLabelling};

/// (19), (20) and normalisation in turn until M no longer changes.
pub(super) fn relax_with(
    options: &RelaxationLabelling,
    mut m: MatchMatrix,
    support: impl Fn(&MatchMatrix) -> Vec<f64>,
) -> MatchMatrix {
    for _ in 0..options.sweeps {
        let before = m.clone();
        let support = support(&m);
        let gain = slack_gain(&support, m.columns(), options.slack);
        update(&mut m, &support, gain);
        sinkhorn(&mut m, options.sinkhorn_sweeps, 0.0);
        if m.largest_change(&before) <= options.tolerance {
            break;
        }
    }
    m
}

/// Gain of the slack: a share of what the best partners get, so that it means the same for every neighbourhood.
fn slack_gain(support: &[f64], columns: usize, share: f64) -> f64 {
    let rows = support.len() / columns;
    let best = support
        .chunks_exact(columns)
        .map(|row| row.iter().fold(0.0_f64, |m, &s| m.max(s)));
    best.fold(0.0, |sum, s| sum + s) * (share / rows as f64)
}
