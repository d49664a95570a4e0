//! State of the matcher for one model along a series of targets.

use super::spline::ModelSpline;
use super::{AnnealedSoftassign, SoftassignMatch, SoftassignWorkspace, mean, squared_distance};
use crate::{MatchError, MatchedPairs, Matching, error};
use nalgebra::Point;
use std::ops::ControlFlow;

/// The model's last positions, the factorisation of the spline between its points, and the
/// matcher's memory. A different model resets the state.
#[derive(Clone, Debug, Default)]
pub(super) struct Series<const D: usize> {
    model: Vec<Point<f64, D>>,
    /// Last warped positions. Empty before the first match.
    last: Vec<Point<f64, D>>,
    /// `last` in the frame of the match that starts there.
    start: Vec<[f64; D]>,
    /// Number of points with a partner.
    matched: usize,
    /// Noise of the last match, in the units of the points.
    sigma: f64,
    /// Workspace with the answer of the last match.
    workspace: SoftassignWorkspace<D>,
    spline: Option<ModelSpline<D>>,
}

impl<const D: usize> Series<D> {
    /// Resets the state if the model is a different one.
    fn switch_to(&mut self, model: &[Point<f64, D>]) {
        if self.model != model {
            self.model.clear();
            self.model.extend_from_slice(model);
            self.last.clear();
            self.spline = None;
        }
    }

    /// Stores the answer in the workspace for the next match.
    fn keep(&mut self) {
        let found = SoftassignMatch::of(&self.workspace);
        self.last.clear();
        self.last.extend(found.warped());
        self.matched = found.assignment.iter().flatten().count();
        self.sigma = found.report.sigma;
    }

    /// The last answer. Its warp uses the factorised system of the model's spline.
    pub(super) fn matching(&mut self) -> Matching<D> {
        let Self {
            spline,
            workspace,
            model,
            ..
        } = self;
        let spline = spline.get_or_insert_with(|| ModelSpline::new(model));
        SoftassignMatch::of(workspace).interpolated(model, spline)
    }

    /// The pairs of the last answer.
    pub(super) fn pairs(&self, pairs: &mut MatchedPairs) {
        let found = SoftassignMatch::of(&self.workspace);
        pairs.assignment.clear();
        pairs.assignment.extend_from_slice(found.assignment);
        pairs.confidence.clear();
        pairs.confidence.extend_from_slice(found.confidence);
        pairs.report = found.report;
    }
}

// The next match of a series starts from the last positions of the model.

impl AnnealedSoftassign {
    /// A short run from the last positions of the model. Its first temperature is the distance of
    /// the target from there. If there is no last match, or the run loses partners, the usual
    /// search follows. The answer stays in the series.
    pub(super) fn follow<const D: usize>(
        &self,
        series: &mut Series<D>,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<(), MatchError> {
        // Validate the sets before the series stores the model.
        error::point_sets(model, target)?;
        series.switch_to(model);
        if !self.go_on(series, model, target)? {
            let go = || ControlFlow::Continue(());
            self.match_points_with(&mut series.workspace, model, target, go)?;
        }
        series.keep();
        Ok(())
    }

    /// Whether a run from the last answer succeeded: it keeps the partners and fits equally well.
    fn go_on<const D: usize>(
        &self,
        series: &mut Series<D>,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<bool, MatchError> {
        let Series {
            last,
            start,
            matched,
            sigma,
            workspace,
            ..
        } = series;
        if last.is_empty() {
            return Ok(false);
        }
        workspace.problem.take(*self, model, target)?;
        let problem = &workspace.problem;
        let frame = problem.frame;
        start.clear();
        start.extend(last.iter().map(|p| frame.target(p)));
        // The first temperature is this multiple of the difference of the sets in position and
        // size.
        let warmth = 2.0 * apart(start, &problem.target);
        let noise = (2.0 * *sigma / frame.scale).max(problem.limits.clean);
        workspace.solve_from(start, warmth);
        let found = workspace.answer.assignment.iter().flatten().count();
        // A match is made anew if it finds partners for less than this fraction of the last number,
        // or if its residuals exceed this multiple of the last ones.
        Ok(found as f64 >= 0.95 * *matched as f64 && workspace.best.sigma <= noise)
    }
}

/// Difference of two sets in position and size: distance of the centroids and difference of the
/// radii.
fn apart<const D: usize>(a: &[[f64; D]], b: &[[f64; D]]) -> f64 {
    let [(p, r), (q, s)] = [a, b].map(|points| {
        let centre = mean(points);
        let square = |p: &[f64; D]| squared_distance(p, &centre);
        (
            centre,
            (points.iter().map(square).sum::<f64>() / points.len() as f64).sqrt(),
        )
    });
    squared_distance(&p, &q).sqrt() + (r - s).abs()
}
