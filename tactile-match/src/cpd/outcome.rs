//! From the mixture at its end to a [`Matching`]: posterior, pairs, confidences, covariances.

use super::CoherentPointDrift;
use super::expectation::gaussians;
use super::registration::DriftWorkspace;
use crate::{AssignmentWorkspace, MatchReport, Matching, SoftMatches, unmatched_rows};
use nalgebra::{SMatrix, SVector};

/// Soft matches below this weight are left out.
const NEGLIGIBLE: f64 = 1e-4;

/// The posterior `P` at the end, a row of `M` entries per target point.
fn posterior<const D: usize>(
    options: &CoherentPointDrift,
    workspace: &DriftWorkspace<D>,
) -> Vec<f64> {
    let (model_len, target_len) = (workspace.moved[0].len(), workspace.target[0].len());
    let sigma2 = workspace.sigma2.max(f64::MIN_POSITIVE);
    let uniform = workspace.uniform(options);
    let mut rows = vec![0.0; model_len * target_len];
    for (n, row) in rows.chunks_exact_mut(model_len).enumerate() {
        let x = std::array::from_fn(|d| workspace.target[d][n]);
        let total = gaussians(row, &workspace.moved, x, sigma2) + uniform;
        if total > 0.0 {
            row.iter_mut().for_each(|p| *p /= total);
        }
    }
    rows
}

/// Distinct targets for the model points with the most posterior in sum; a pair stays only if its target is at least as
/// likely the model point's as an outlier.
fn pairs(posterior: &[f64], model_len: usize, target_len: usize) -> Vec<Option<usize>> {
    let costs: Vec<f64> = posterior.iter().map(|p| -p).collect();
    let mut workspace = AssignmentWorkspace::default();
    let mut assignment = vec![None; model_len];
    // The costs are probabilities: finite, and of the right number.
    let columns = workspace
        .solve(&costs, target_len, model_len)
        .unwrap_or_default();
    for (n, m) in columns
        .iter()
        .enumerate()
        .filter_map(|(n, m)| m.map(|m| (n, m)))
    {
        let row = &posterior[n * model_len..][..model_len];
        let outlier = 1.0 - row.iter().sum::<f64>();
        if row[m] > 0.0 && row[m] >= outlier {
            assignment[m] = Some(n);
        }
    }
    assignment
}

/// Assembles the result; lengths are those of the model and the target.
pub(super) fn matching<const D: usize>(
    options: &CoherentPointDrift,
    workspace: &DriftWorkspace<D>,
    model_len: usize,
    target_len: usize,
) -> Matching<D> {
    let posterior = posterior(options, workspace);
    let assignment = pairs(&posterior, model_len, target_len);
    let scale = workspace.target_frame.scale;
    let (mut soft, mut confidence, mut covariance) =
        (SoftMatches::default(), Vec::new(), Vec::new());
    for (m, partner) in assignment.iter().enumerate() {
        let row: Vec<(usize, f64)> = (0..target_len)
            .map(|n| (n, posterior[n * model_len + m]))
            .filter(|p| p.1 > NEGLIGIBLE)
            .collect();
        let mass = row.iter().map(|p| p.1).sum::<f64>();
        let share = |p: f64| p / mass.max(1.0); // many targets may have one model point; a row of M has sum one
        soft.push_row(row.iter().map(|&(n, p)| (n, share(p))));
        let sure = partner.map_or(1.0 - mass.min(1.0), |n| share(posterior[n * model_len + m]));
        confidence.push(sure.clamp(0.0, 1.0));
        covariance.push(spread(workspace, &row, mass) * (scale * scale));
    }
    let (unmatched_model, unmatched_target) = unmatched_rows(&assignment, target_len);
    Matching {
        warp: Box::new(workspace.warp()),
        warped: workspace.warped(),
        confidence,
        soft,
        unmatched_model,
        unmatched_target,
        displacement_covariance: covariance,
        energy: workspace.energy.iter().map(|&e| e).collect(),
        report: report(workspace, &assignment),
        assignment,
    }
}

/// Covariance of a displacement: the spread of the soft matches about their mean, and the noise `σ²` of the mixture.
fn spread<const D: usize>(
    workspace: &DriftWorkspace<D>,
    row: &[(usize, f64)],
    mass: f64,
) -> SMatrix<f64, D, D> {
    let at = |n: usize| SVector::<f64, D>::from_fn(|d, _| workspace.target[d][n]);
    let noise = SMatrix::identity() * workspace.sigma2;
    if mass <= 0.0 {
        return noise;
    }
    let mean: SVector<f64, D> = row.iter().map(|&(n, p)| at(n) * (p / mass)).sum();
    row.iter().fold(noise, |sum, &(n, p)| {
        let step = at(n) - mean;
        sum + step * step.transpose() * (p / mass)
    })
}

fn report<const D: usize>(
    workspace: &DriftWorkspace<D>,
    assignment: &[Option<usize>],
) -> MatchReport {
    let squares = assignment
        .iter()
        .enumerate()
        .filter_map(|(m, n)| n.map(|n| (m, n)))
        .map(|(m, n)| {
            (0..D)
                .map(|d| (workspace.moved[d][m] - workspace.target[d][n]).powi(2))
                .sum::<f64>()
        });
    let (count, sum) = squares.fold((0.0_f64, 0.0), |(count, sum), s| (count + 1.0, sum + s));
    let scale = workspace.target_frame.scale;
    MatchReport {
        stop: workspace.stop,
        iterations: workspace.iterations(),
        starts: 1,
        residual: (scale * (sum / count.max(1.0)).sqrt()),
        sigma: (scale * workspace.sigma2.sqrt()),
        doubt: None,
    }
}
