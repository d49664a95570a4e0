//! What a run of the matcher has found, read from its workspace.

use super::spline::ModelSpline;
use super::{SoftassignWorkspace, finish};
use crate::{MatchReport, Matching, SoftMatches, StopReason, unmatched_rows};
use nalgebra::{Point, SMatrix};

/// The answer in a workspace.
///
/// ```
/// use nalgebra::Point2;
/// use std::ops::ControlFlow;
/// use tactile_match::{AnnealedSoftassign, SoftassignWorkspace};
/// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2], [0.5, 0.4], [1.8, 0.3]].map(Point2::from);
/// let target = model.map(|p| Point2::new(1.1 * p.x + 0.1 * p.y, p.y));
/// let mut workspace = SoftassignWorkspace::default();
/// let found = AnnealedSoftassign::default()
///     .match_points_with(&mut workspace, &model, &target, |_, _| ControlFlow::Continue(()))?;
/// assert_eq!((found.assignment[2], found.confidence[2] > 0.9), (Some(2), true));
/// assert!(found.warped().zip(&target).all(|(w, t)| (w - t).norm() < 1e-9));
/// assert!(found.report.residual < 1e-9); // units of the points
/// let matching = found.to_matching(&model);
/// assert!((matching.warp.jacobian(&model[4]).determinant() - 1.1).abs() < 1e-6); // areas grow by a tenth
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SoftassignMatch<'w, const D: usize> {
    workspace: &'w SoftassignWorkspace<D>,
    /// Target row of every model point.
    pub assignment: &'w [Option<usize>],
    /// Probability that each assignment is right.
    pub confidence: &'w [f64],
    /// How it went.
    pub report: MatchReport,
}

impl<'w, const D: usize> SoftassignMatch<'w, D> {
    /// What the workspace holds.
    pub(super) fn of(workspace: &'w SoftassignWorkspace<D>) -> Self {
        let scale = workspace.frame.scale;
        Self {
            workspace,
            assignment: &workspace.answer.assignment,
            confidence: &workspace.answer.confidence,
            report: MatchReport {
                stop: stop_reason(workspace),
                iterations: workspace.best.iterations,
                starts: workspace.starts,
                residual: workspace.answer.residual * scale,
                sigma: workspace.best.sigma * scale,
                doubt: workspace.doubt(),
            },
        }
    }

    /// The warped model points.
    pub fn warped(&self) -> impl ExactSizeIterator<Item = Point<f64, D>> + use<'w, D> {
        let workspace = self.workspace;
        workspace
            .answer
            .warped
            .iter()
            .map(|w| workspace.frame.outward(w))
    }

    /// The answer with its warp, soft matches and covariances; `model` are the points that were matched.
    #[must_use]
    pub fn to_matching(&self, model: &[Point<f64, D>]) -> Matching<D> {
        self.interpolated(model, &ModelSpline::new(model))
    }

    /// The report in the type of the points.
    pub(super) fn narrow_report(&self) -> MatchReport {
        let report = &self.report;
        MatchReport {
            stop: report.stop,
            iterations: report.iterations,
            starts: report.starts,
            residual: report.residual,
            sigma: report.sigma,
            doubt: report.doubt,
        }
    }

    /// As [`to_matching`](Self::to_matching), with the factorised system of the model's spline.
    pub(super) fn interpolated(
        &self,
        model: &[Point<f64, D>],
        spline: &ModelSpline<D>,
    ) -> Matching<D> {
        let workspace = self.workspace;
        let (answer, frame) = (&workspace.answer, &workspace.frame);
        let mut warped: Vec<Point<f64, D>> = self.warped().collect();
        let warp = spline.through(&mut warped);
        let (mut soft, mut row) = (SoftMatches::default(), Vec::new());
        for i in 0..model.len() {
            row.clear();
            row.extend(finish::soft_row(&workspace.annealer.soft, i).map(|(j, p)| (j, p)));
            row.sort_unstable_by_key(|entry| entry.0);
            soft.push_row(row.iter().copied());
        }
        let square = frame.scale * frame.scale;
        let covariance = |v: &f64| SMatrix::from_diagonal_element(v * square);
        let (unmatched_model, unmatched_target) =
            unmatched_rows(&answer.assignment, workspace.target.len());
        Matching {
            warp,
            warped,
            assignment: answer.assignment.clone(),
            confidence: answer.confidence.iter().map(|&c| c).collect(),
            soft,
            unmatched_model,
            unmatched_target,
            displacement_covariance: answer.variance.iter().map(covariance).collect(),
            energy: workspace.best.trace.iter().map(|&e| e).collect(),
            report: self.narrow_report(),
        }
    }
}

fn stop_reason<const D: usize>(workspace: &SoftassignWorkspace<D>) -> StopReason {
    match () {
        () if workspace.stopped => StopReason::Cancelled,
        // The floor is reached to rounding.
        () if workspace.best.sigma <= 1.000_001 * finish::FLOOR
            && !workspace.annealer.soft.errors.differ()
            && workspace.doubt().is_none() =>
        {
            StopReason::Exact
        }
        () if workspace.best.settled => StopReason::Converged,
        () => StopReason::IterationLimit,
    }
}
