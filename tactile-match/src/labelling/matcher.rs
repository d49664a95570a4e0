//! The whole method: first probabilities, relaxation, spline, and again.

use super::{
    CompatibilityRule, MatchMatrix, NeighbourGraph, RelaxationLabelling, first_matches, relax_with,
    support_by,
};
use crate::frame::Frame;
use crate::validate::point_sets;
use crate::{MatchError, Matching, PointMatcher, StopReason};
use nalgebra::Point;
use tactile_tps::Smoothing;

/// Edge pairs whose compatibilities are kept between sweeps; more than these are computed anew every time.
const TABLE_LIMIT: usize = 1 << 25;

impl RelaxationLabelling {
    /// One outer iteration's match matrix: first probabilities of `model` (as warped so far) and `target`, then relaxation.
    ///
    /// # Panics
    /// Never for finite points.
    #[must_use]
    pub(crate) fn relax<const D: usize>(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> MatchMatrix {
        let options = self;
        if let Some(candidates) = options.candidates {
            return super::sparse::relax(options, candidates, model, target);
        }
        let graphs =
            [model, target].map(|points| NeighbourGraph::new(points, options.neighbourhood));
        let compatibilities = Compatibilities::new(&graphs, options.rule(&graphs));
        let first = first_matches(model, target, options.temperature, options.slack);
        relax_with(options, first, |m| {
            support_by(m, &graphs[0], &graphs[1], |x, y| compatibilities.of(x, y))
        })
    }
}

/// The outer iterations: `relax` gives the match matrix of the warped model and the target, the spline warps the model, and again.
fn match_with<const D: usize>(
    options: &RelaxationLabelling,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    relax: impl Fn(&[Point<f64, D>], &[Point<f64, D>]) -> MatchMatrix,
) -> Result<Matching<D>, MatchError> {
    point_sets(model, target)?;
    let frames = [Frame::of(model), Frame::of(target)];
    let enter = |frame: &Frame<D>, points: &[Point<f64, D>]| -> Vec<Point<f64, D>> {
        points
            .iter()
            .map(|p| Point::from(frame.inside(p)))
            .collect()
    };
    let (start, goal) = (enter(&frames[0], model), enter(&frames[1], target));
    let mut run = super::outcome::Run::new(start, goal, frames[1]);
    for k in 0..options.max_iterations {
        run.matches = relax(&run.warped, &run.target);
        run.record_energy(options.neighbourhood);
        let lambda = options.smoothing * 0.5_f64.powi(i32::try_from(k).unwrap_or(i32::MAX));
        let step = run.fit(Smoothing::Lambda(lambda));
        if step <= 1e-3 {
            run.stop = StopReason::Converged;
            break;
        }
    }
    Ok(run.finish(model, target))
}

/// `r` of all edge pairs: tabulated while that is possible, computed otherwise.
struct Compatibilities<'a, const D: usize> {
    graphs: &'a [NeighbourGraph<D>; 2],
    rule: CompatibilityRule,
    table: Vec<f64>,
}

impl<'a, const D: usize> Compatibilities<'a, D> {
    fn new(graphs: &'a [NeighbourGraph<D>; 2], rule: CompatibilityRule) -> Self {
        let [x, y] = [0, 1].map(|g| graphs[g].edges());
        let mut table = Vec::new();
        if x.len().saturating_mul(y.len()) <= TABLE_LIMIT {
            table.extend(x.iter().flat_map(|x| y.iter().map(move |y| rule.of(x, y))));
        }
        Self {
            graphs,
            rule,
            table,
        }
    }

    fn of(&self, x: usize, y: usize) -> f64 {
        let [model, target] = [0, 1].map(|g| self.graphs[g].edges());
        match self.table.get(x * target.len() + y) {
            Some(&r) => r,
            None => self.rule.of(&model[x], &target[y]),
        }
    }
}

impl<const D: usize> PointMatcher<D> for RelaxationLabelling {
    fn match_points(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        match_with(self, model, target, |model, target| {
            self.relax(model, target)
        })
    }
}
