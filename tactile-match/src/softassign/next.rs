//! The next match of a series: from where the last one put the model.

use super::frame::mean;
use super::series::Series;
use super::{AnnealedSoftassign, SoftassignMatch, finish};
use crate::{MatchError, Matching, validate};
use nalgebra::Point;
use std::ops::ControlFlow;
use tactile_tps::Scalar;

/// A match that finds partners for less than this share of what the last one found, or leaves so many times its residuals, is
/// made anew.
const LOST: f64 = 0.95;
const WORSE: f64 = 2.0;
/// The first temperature is so many times what the sets differ by in place and size.
const MARGIN: f64 = 2.0;

impl AnnealedSoftassign {
    /// A short run from where the last match put the model, as warm as the target is far from there; the usual search where
    /// there is no last match, or the run loses partners.
    pub(super) fn follow<T: Scalar, const D: usize>(
        &self,
        series: &mut Series<T, D>,
        model: &[Point<T, D>],
        target: &[Point<T, D>],
    ) -> Result<Matching<T, D>, MatchError> {
        // Before the series takes notice of the model.
        validate::point_sets(model, target)?;
        let go = |_, _| ControlFlow::Continue(());
        let found = match self.go_on(series, model, target)? {
            Some(found) => found,
            None => {
                let (spline, workspace) = series.parts(model);
                self.match_points_with(workspace, model, target, go)?
                    .interpolated(model, spline)
            }
        };
        series.keep(model, &found);
        Ok(found)
    }

    fn go_on<T: Scalar, const D: usize>(
        &self,
        series: &mut Series<T, D>,
        model: &[Point<T, D>],
        target: &[Point<T, D>],
    ) -> Result<Option<Matching<T, D>>, MatchError> {
        let (matched, sigma) = (series.matched as f64, series.sigma);
        let Some(last) = series.last_for(model) else {
            return Ok(None);
        };
        let last = last.to_vec();
        let (spline, workspace) = series.parts(model);
        workspace.take(model, target)?;
        let frame = workspace.frame;
        let start: Vec<[f64; D]> = last.iter().map(|p| frame.target(p)).collect();
        let warmth = MARGIN * apart(&start, &workspace.target);
        self.solve_from(workspace, &start, warmth);
        let found = SoftassignMatch::of(workspace);
        let noise =
            (WORSE * nalgebra::convert_unchecked::<T, f64>(sigma) / frame.scale).max(finish::CLEAN);
        let kept = found.assignment.iter().flatten().count() as f64 >= LOST * matched
            && workspace.best.sigma <= noise;
        Ok(kept.then(|| found.interpolated(model, spline)))
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
