//! The match in a workspace.

use super::SoftassignWorkspace;
use super::spline::ModelSpline;
use crate::{FittedTransformation, MatchReport, Matching, Transformation};
use nalgebra::{Point, SMatrix};

/// Soft matches below this value are not reported.
const FAINTEST: f64 = 1e-3;

/// A match in a workspace.
///
/// ```
/// use nalgebra::Point2;
/// use std::ops::ControlFlow;
/// use tactile_match::{AnnealedSoftassign, SoftassignWorkspace};
/// let model = [
///     [0.0, 0.0],
///     [1.0, 0.1],
///     [0.2, 1.0],
///     [1.1, 1.2],
///     [0.5, 0.4],
///     [1.8, 0.3],
/// ]
/// .map(Point2::from);
/// let target = model.map(|p| Point2::new(1.1 * p.x + 0.1 * p.y, p.y));
/// let mut workspace = SoftassignWorkspace::default();
/// let found = AnnealedSoftassign::default().match_points_with(
///     &mut workspace,
///     &model,
///     &target,
///     || ControlFlow::Continue(()),
/// )?;
/// assert_eq!(
///     (found.assignment[2], found.confidence[2] > 0.9),
///     (Some(2), true)
/// );
/// assert!(
///     found
///         .warped()
///         .zip(&target)
///         .all(|(w, t)| (w - t).norm() < 1e-9)
/// );
/// assert!(found.report.residual < 1e-9); // units of the points
/// let matching = found.to_matching(&model);
/// // Areas grow by a tenth.
/// assert!((matching.warp.jacobian(&model[4]).determinant() - 1.1).abs() < 1e-6);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SoftassignMatch<'w, const D: usize> {
    workspace: &'w SoftassignWorkspace<D>,
    /// Target row of each model point.
    pub assignment: &'w [Option<usize>],
    /// Probability that each assignment is correct.
    pub confidence: &'w [f64],
    /// Report of the match.
    pub report: MatchReport,
}

impl<'w, const D: usize> SoftassignMatch<'w, D> {
    /// The match in the workspace.
    pub(super) fn of(workspace: &'w SoftassignWorkspace<D>) -> Self {
        let answer = &workspace.answer;
        Self {
            workspace,
            assignment: &answer.assignment,
            confidence: &answer.confidence,
            report: answer.report.clone(),
        }
    }

    /// The warped model points.
    pub fn warped(&self) -> impl ExactSizeIterator<Item = Point<f64, D>> + use<'w, D> {
        let SoftassignWorkspace {
            problem, answer, ..
        } = self.workspace;
        answer.warped.iter().map(|w| problem.frame.outward(w))
    }

    /// The match with its warp, soft matches and covariances. `model` must be the points that were
    /// matched.
    #[must_use]
    pub fn to_matching(&self, model: &[Point<f64, D>]) -> Matching<D> {
        self.interpolated(model, &ModelSpline::new(model))
    }

    /// Like [`to_matching`](Self::to_matching), with the factorised system of the model's spline.
    pub(super) fn interpolated(
        &self,
        model: &[Point<f64, D>],
        spline: &ModelSpline<D>,
    ) -> Matching<D> {
        let SoftassignWorkspace {
            problem,
            answer,
            best,
            ..
        } = self.workspace;
        let mut warped: Vec<Point<f64, D>> = self.warped().collect();
        let warp = spline.through(&mut warped);
        let matched = (0..model.len()).filter(|&i| answer.assignment[i].is_some());
        let grows = problem.options.transformation != Transformation::Rigid;
        let sigma = self.report.sigma;
        let transformation = (!problem.bends())
            .then(|| FittedTransformation::of(model, &warped, matched, sigma, grows))
            .flatten();
        let mut taken = vec![false; problem.target.len()];
        let partners = answer.assignment.iter().flatten();
        partners.for_each(|&j| taken[j] = true);
        let unmatched = (0..model.len()).filter(|&i| answer.assignment[i].is_none());
        let square = problem.frame.scale * problem.frame.scale;
        let covariance = |v: &f64| SMatrix::from_diagonal_element(v * square);
        Matching {
            warp,
            warped,
            assignment: answer.assignment.clone(),
            confidence: answer.confidence.clone(),
            soft: (0..model.len()).map(|i| self.soft_row(i)).collect(),
            unmatched_model: unmatched.collect(),
            unmatched_target: (0..taken.len()).filter(|&j| !taken[j]).collect(),
            displacement_covariance: answer.variance.iter().map(covariance).collect(),
            transformation,
            energy: best.trace.clone(),
            report: self.report.clone(),
        }
    }

    /// Soft matches of a model point, sorted by target row.
    fn soft_row(&self, i: usize) -> Vec<(usize, f64)> {
        let entries = self.workspace.runner.annealer.soft.entries(i);
        let mut row: Vec<_> = entries.filter(|&(_, p)| p > FAINTEST).collect();
        row.sort_unstable_by_key(|entry| entry.0);
        row
    }
}
