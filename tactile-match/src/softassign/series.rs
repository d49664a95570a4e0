//! What the matcher keeps of one model along a series of targets.

use super::SoftassignWorkspace;
use super::spline::ModelSpline;
use crate::Matching;
use nalgebra::Point;
use tactile_tps::Scalar;

/// Where the last match put the model, the factorisation of the spline between its points, the matcher's memory. Given another model it
/// forgets the old one.
#[derive(Clone, Debug)]
pub(super) struct Series<T: Scalar, const D: usize> {
    model: Vec<Point<T, D>>,
    last: Vec<Point<T, D>>,
    /// How many points had a partner.
    pub(super) matched: usize,
    /// The noise that was found.
    pub(super) sigma: T,
    workspace: SoftassignWorkspace<D>,
    spline: Option<ModelSpline<T, D>>,
}

impl<T: Scalar, const D: usize> Default for Series<T, D> {
    fn default() -> Self {
        Self {
            model: Vec::new(),
            last: Vec::new(),
            matched: 0,
            sigma: T::zero(),
            workspace: SoftassignWorkspace::default(),
            spline: None,
        }
    }
}

impl<T: Scalar, const D: usize> Series<T, D> {
    /// Where the last match put the points of `model`; `None` for a model it has not seen.
    pub(super) fn last_for(&self, model: &[Point<T, D>]) -> Option<&[Point<T, D>]> {
        (!self.last.is_empty() && self.model == model).then_some(&self.last)
    }

    /// Keeps a match for the next.
    pub(super) fn keep(&mut self, model: &[Point<T, D>], found: &Matching<T, D>) {
        self.switch_to(model);
        self.last.clone_from(&found.warped);
        self.matched = found.assignment.iter().flatten().count();
        self.sigma = found.report.sigma;
    }

    /// Forgets the past of another model.
    fn switch_to(&mut self, model: &[Point<T, D>]) {
        if self.model != model {
            self.model.clear();
            self.model.extend_from_slice(model);
            self.last.clear();
            self.spline = None;
        }
    }

    /// The factorised system of the model's spline, and the workspace.
    pub(super) fn parts(
        &mut self,
        model: &[Point<T, D>],
    ) -> (&ModelSpline<T, D>, &mut SoftassignWorkspace<D>) {
        self.switch_to(model);
        let Self {
            spline, workspace, ..
        } = self;
        let spline = spline.get_or_insert_with(|| ModelSpline::new(model));
        (spline, workspace)
    }
}
