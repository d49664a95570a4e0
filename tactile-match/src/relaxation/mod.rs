//! The fast matcher: robust starts, annealed soft assignment and a statistical last stage.

mod anneal;
mod axes;
mod correspond;
mod finish;
mod frame;
mod labelling;
mod options;
mod prior;
mod regression;
mod soft_assign;
mod starts;

pub use labelling::Labelling;
pub use options::{Outliers, RelaxationOptions, Rotation};

use crate::{
    MatchError, MatchReport, Matching, PointMatcher, SoftMatches, StopReason, unmatched_rows, validate,
};
use anneal::{Annealer, Schedule, State};
use correspond::Correspondence;
use finish::Answer;
use frame::Frame;
use nalgebra::{Point, SMatrix};
use prior::PriorScales;
use std::ops::ControlFlow;
use tactile_tps::{Affine, FitOptions, Scalar, ThinPlateSpline, Warp};

const SCALES: PriorScales = PriorScales { length: 1.2, bending: 0.35, affine: 0.5 };
/// Residuals are judged no finer than this.
const RESOLUTION: f64 = 0.01;

/// The library's matcher. See the [module docs](self).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelaxationMatcher {
    options: RelaxationOptions,
}

/// Memory that matches use again and again.
#[derive(Clone, Debug, Default)]
pub struct RelaxationWorkspace<const D: usize> {
    frame: Frame<D>,
    model: Vec<[f64; D]>,
    target: Vec<[f64; D]>,
    annealer: Annealer<D>,
    state: State<D>,
    best: State<D>,
    answer: Answer<D>,
    correspondence: Correspondence<D>,
    starts: usize,
    stopped: bool,
}

impl<const D: usize> RelaxationWorkspace<D> {
    /// An empty workspace; it grows at its first use.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
}

impl RelaxationMatcher {
    /// A matcher with these options.
    #[must_use]
    pub fn new(options: RelaxationOptions) -> Self {
        Self { options }
    }

    /// The options.
    #[must_use]
    pub fn options(&self) -> &RelaxationOptions {
        &self.options
    }

    fn solve<const D: usize>(
        &self,
        ws: &mut RelaxationWorkspace<D>,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) {
        ws.annealer.volume = bounding_volume(&ws.target);
        ws.annealer.prior.build(&ws.model, SCALES);
        ws.annealer.soft.set_targets(&ws.target);
        (ws.starts, ws.stopped) = (0, false);
        ws.best.energy = f64::INFINITY;
        starts::centred(&ws.model, &ws.target, &mut ws.state.base);
        let mut flow = self.attempt(ws, 0.3, observe);
        if self.options.rotation == Rotation::Limited && flow.is_continue() && !self.is_exact(ws) {
            starts::centred(&ws.model, &ws.target, &mut ws.state.base);
            ws.state.warped.clone_from(&ws.state.base);
            ws.correspondence.start(&mut ws.annealer, SCALES, &ws.model, &ws.target, &mut ws.state);
            flow = self.refine(ws, 0.15, observe);
        }
        let rotations = match self.options.rotation {
            Rotation::Any => starts::rotations::<D>(),
            Rotation::Limited => starts::limited_rotations::<D>(),
        };
        for rotation in rotations {
            if flow.is_break() || self.is_exact(ws) {
                break;
            }
            starts::moments(&ws.model, &ws.target, &rotation, &mut ws.state.base);
            flow = self.attempt(ws, 0.3, observe);
        }
        ws.stopped = flow.is_break();
        ws.answer.read(&mut ws.annealer, &ws.best, &ws.target, self.options.slack);
    }

    /// Whether the best run so far explains nearly every point of the smaller set to rounding.
    fn is_exact<const D: usize>(&self, ws: &RelaxationWorkspace<D>) -> bool {
        ws.best.sigma <= finish::CLEAN
    }

    /// A run from `ws.state.base` itself.
    fn attempt<const D: usize>(
        &self,
        ws: &mut RelaxationWorkspace<D>,
        sigma: f64,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        ws.state.warped.clone_from(&ws.state.base);
        self.refine(ws, sigma, observe)
    }

    /// A run from `ws.state.warped`; kept if it is the best so far.
    fn refine<const D: usize>(
        &self,
        ws: &mut RelaxationWorkspace<D>,
        sigma: f64,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let schedule = Schedule {
            sigma,
            floor: 1e-3,
            rate: 0.93,
            limit: self.options.max_iterations,
            sweeps: 5,
            slack: self.options.slack,
        };
        ws.starts += 1;
        ws.state.trace.clear();
        ws.state.iterations = 0;
        let flow = ws.annealer.run(&mut ws.state, &schedule, observe);
        ws.annealer.judge(&mut ws.state, self.options.slack, RESOLUTION);
        if ws.state.energy < ws.best.energy || ws.starts == 1 {
            ws.best.copy_from(&ws.state);
        }
        flow
    }

    /// As [`PointMatcher::match_points`]; `observe` hears the iteration and the energy after every outer
    /// iteration and may stop the search: the best answer so far is then returned.
    ///
    /// # Errors
    /// As [`PointMatcher::match_points`].
    pub fn match_points_observed<T: Scalar, const D: usize>(
        &self,
        workspace: &mut RelaxationWorkspace<D>,
        model: &[Point<T, D>],
        target: &[Point<T, D>],
        mut observe: impl FnMut(usize, f64) -> ControlFlow<()>,
    ) -> Result<Matching<T, D>, MatchError> {
        validate::point_sets(model, target)?;
        let frame = Frame::new(model, target);
        workspace.frame = frame;
        workspace.model.clear();
        workspace.model.extend(model.iter().map(|p| frame.inward(p)));
        workspace.target.clear();
        workspace.target.extend(target.iter().map(|p| frame.inward(p)));
        self.solve(workspace, &mut observe);
        Ok(workspace.matching(model))
    }
}

impl<const D: usize> RelaxationWorkspace<D> {
    fn matching<T: Scalar>(&self, model: &[Point<T, D>]) -> Matching<T, D> {
        let (answer, frame) = (&self.answer, &self.frame);
        let warped: Vec<Point<T, D>> = answer.warped.iter().map(|w| frame.outward(w)).collect();
        let mut soft = SoftMatches::new();
        for i in 0..model.len() {
            soft.push_row(finish::soft_row(&self.annealer.soft, i).map(|(j, p)| (j, T::narrow(p))));
        }
        let square = frame.scale * frame.scale;
        let covariance = |c: &[[f64; D]; D]| SMatrix::from_fn(|a, b| T::narrow(c[a][b] * square));
        let (unmatched_model, unmatched_target) = unmatched_rows(&answer.assignment, self.target.len());
        Matching {
            warp: warp_through(model, &warped),
            warped,
            assignment: answer.assignment.clone(),
            confidence: answer.confidence.iter().map(|&c| T::narrow(c)).collect(),
            soft,
            unmatched_model,
            unmatched_target,
            displacement_covariance: answer.covariance.iter().map(covariance).collect(),
            energy: self.best.trace.iter().map(|&e| T::narrow(e)).collect(),
            report: MatchReport {
                stop: self.stop_reason(),
                iterations: self.best.iterations,
                starts: self.starts,
                residual: T::narrow(answer.residual * frame.scale),
                sigma: T::narrow(self.best.sigma * frame.scale),
            },
        }
    }

    fn stop_reason(&self) -> StopReason {
        match () {
            () if self.stopped => StopReason::Callback,
            () if self.best.sigma <= finish::CLEAN => StopReason::Exact,
            () if self.best.settled => StopReason::Converged,
            () => StopReason::IterationLimit,
        }
    }
}

/// The interpolating spline through the estimated positions; a translation where the spline does not exist
/// (coinciding model points that go different ways).
fn warp_through<T: Scalar, const D: usize>(
    model: &[Point<T, D>],
    warped: &[Point<T, D>],
) -> Box<dyn Warp<T, D> + Send + Sync> {
    match ThinPlateSpline::fit(model, warped, &FitOptions::default()) {
        Ok(spline) => Box::new(spline),
        Err(_) => Box::new(Affine::new(SMatrix::identity(), warped[0] - model[0])),
    }
}

impl<T: Scalar, const D: usize> PointMatcher<T, D> for RelaxationMatcher {
    fn match_points(
        &self,
        model: &[Point<T, D>],
        target: &[Point<T, D>],
    ) -> Result<Matching<T, D>, MatchError> {
        let mut workspace = RelaxationWorkspace::new();
        self.match_points_observed(&mut workspace, model, target, |_, _| ControlFlow::Continue(()))
    }
}

/// Volume of the bounding box; thin sides count as a tenth of the model's radius.
fn bounding_volume<const D: usize>(points: &[[f64; D]]) -> f64 {
    let side = |k: usize| {
        let (low, high) = points.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[k]), h.max(p[k])));
        (high - low).max(0.1)
    };
    (0..D).map(side).product()
}
