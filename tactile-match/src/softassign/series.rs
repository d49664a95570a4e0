//! What the matcher keeps of one model along a series of targets.

use super::spline::ModelSpline;
use super::{SoftassignMatch, SoftassignWorkspace};
use crate::{MatchedPairs, Matching};
use nalgebra::Point;

/// Where the last match put the model, the factorisation of the spline between its points, the matcher's memory. Given another model it
/// forgets the old one.
#[derive(Clone, Debug)]
pub(super) struct Series<const D: usize> {
    model: Vec<Point<f64, D>>,
    /// Empty where nothing was matched yet.
    pub(super) last: Vec<Point<f64, D>>,
    /// `last` in the frame of the match that begins there.
    pub(super) start: Vec<[f64; D]>,
    /// How many points had a partner.
    pub(super) matched: usize,
    /// The noise that was found, in the units of the points.
    pub(super) sigma: f64,
    /// Holds the answer of the last match.
    pub(super) workspace: SoftassignWorkspace<D>,
    spline: Option<ModelSpline<D>>,
}

impl<const D: usize> Default for Series<D> {
    fn default() -> Self {
        Self {
            model: Vec::new(),
            last: Vec::new(),
            start: Vec::new(),
            matched: 0,
            sigma: 0.0,
            workspace: SoftassignWorkspace::default(),
            spline: None,
        }
    }
}

impl<const D: usize> Series<D> {
    /// Forgets the past of another model.
    pub(super) fn switch_to(&mut self, model: &[Point<f64, D>]) {
        if self.model != model {
            self.model.clear();
            self.model.extend_from_slice(model);
            self.last.clear();
            self.spline = None;
        }
    }

    /// Keeps the answer in the workspace for the next match.
    pub(super) fn keep(&mut self) {
        let found = SoftassignMatch::of(&self.workspace);
        self.last.clear();
        self.last.extend(found.warped());
        self.matched = found.assignment.iter().flatten().count();
        self.sigma = found.report.sigma;
    }

    /// The last answer, its warp through the factorised system of the model's spline.
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
        let confidence = found.confidence.iter();
        pairs.confidence.extend(confidence.map(|&c| c));
        pairs.report = found.narrow_report();
    }
}
