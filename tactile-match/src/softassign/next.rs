//! The next match of a series: from where the last one put the model.

use super::frame::mean;
use super::series::Series;
use super::{AnnealedSoftassign, finish};
use crate::{MatchError, validate};
use nalgebra::Point;
use std::ops::ControlFlow;

/// A match that finds partners for less than this share of what the last one found, or leaves so many times its residuals, is
/// made anew.
const LOST: f64 = 0.95;
const WORSE: f64 = 2.0;
/// The first temperature is so many times what the sets differ by in place and size.
const MARGIN: f64 = 2.0;

impl AnnealedSoftassign {
    /// A short run from where the last match put the model, as warm as the target is far from there; the usual search where
    /// there is no last match, or the run loses partners. The answer is left in the series.
    pub(super) fn follow<const D: usize>(
        &self,
        series: &mut Series<D>,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<(), MatchError> {
        // Before the series takes notice of the model.
        validate::point_sets(model, target)?;
        series.switch_to(model);
        if !self.go_on(series, model, target)? {
            let go = |_, _| ControlFlow::Continue(());
            self.match_points_with(&mut series.workspace, model, target, go)?;
        }
        series.keep();
        Ok(())
    }

    /// Whether a run from the last answer is one: it keeps the partners, and fits as well.
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
        workspace.take(model, target)?;
        let frame = workspace.frame;
        start.clear();
        start.extend(last.iter().map(|p| frame.target(p)));
        let warmth = MARGIN * apart(start, &workspace.target);
        self.solve_from(workspace, start, warmth);
        let noise = (WORSE * *sigma / frame.scale).max(finish::CLEAN);
        let found = workspace.answer.assignment.iter().flatten().count();
        Ok(found as f64 >= LOST * *matched as f64 && workspace.best.sigma <= noise)
    }
}

/// How far two sets are apart in place and size: distance of the centroids and difference of the radii.
fn apart<const D: usize>(a: &[[f64; D]], b: &[[f64; D]]) -> f64 {
    let [(p, r), (q, s)] = [a, b].map(|points| {
        let centre = mean(points);
        let square = |p: &[f64; D]| (0..D).map(|k| (p[k] - centre[k]).powi(2)).sum::<f64>();
        (
            centre,
            (points.iter().map(square).sum::<f64>() / points.len() as f64).sqrt(),
        )
    });
    (0..D).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt() + (r - s).abs()
}
