//! The result of a match: its warp, and the state kept along a series of targets.

use super::assign::Blocks;
use super::problem::{Frame, LARGE};
use super::{AnnealedSoftassign, SoftassignWorkspace, mean, squared_distance};
use crate::frame::centre_and_radius;
use crate::interpolation::{Interpolation, follows, through};
use crate::{
    FittedTransformation, MatchError, MatchReport, MatchedPairs, Matching, Transformation, error,
};
use nalgebra::{Point, SMatrix};
use std::ops::ControlFlow;
use std::sync::{Arc, OnceLock};
use tactile_tps::{Smoothing, TpsError, Warp};

/// Soft matches below this value are not reported.
const FAINTEST: f64 = 1e-3;

// The result of a run, read from its workspace.

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
    fn interpolated(&self, model: &[Point<f64, D>], spline: &ModelSpline<D>) -> Matching<D> {
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

// The warp of a match: the thin-plate spline through the estimated positions.

/// Minimum distance of two points, in radii of the model, above which a spline is certain to
/// interpolate all positions: the condition number of its system grows at most with the square of
/// the inverse distance (Narcowich & Ward, J. Approx. Theory 69, 1992), to 10⁷ for several hundred
/// points.
const APART: f64 = 0.01;
/// Points closer than this need an interpolating spline of weights of about the difference of their
/// displacements over the kernel at their distance. Up to this weight, in radii, 4,000 points are
/// interpolated to half the digits.
const MAX_WEIGHT: f64 = 1e3;
/// Maximum number of such pairs per point: with more, a part of the model nearly coincides.
const MAX_CLOSE_PAIRS: usize = 8;

/// Radii for which nothing overflows or underflows, whatever the type of the points.
const ORDINARY: std::ops::Range<f64> = 1e-12..1e12;

/// A model's interpolating spline, through all points or through a well-spread sample of a large
/// set. Its system is factorised once for all targets, when a warp first needs it.
#[derive(Clone, Debug)]
struct ModelSpline<const D: usize> {
    sources: Arc<Sources<D>>,
}

#[derive(Debug)]
struct Sources<const D: usize> {
    points: Vec<Point<f64, D>>,
    /// Rows of the sources in the model. Empty if all points are used.
    rows: Vec<usize>,
    /// Pairs of points closer than [`APART`], in radii, and their squared distance. `None` for too
    /// many, or sizes out of range.
    close: Option<Vec<(f64, usize, usize)>>,
    /// Radius of the points.
    radius: f64,
    system: OnceLock<Interpolation<D>>,
}

impl<const D: usize> Sources<D> {
    fn system(&self) -> &Interpolation<D> {
        self.system
            .get_or_init(|| Interpolation::new(&self.points, None, Smoothing::None))
    }

    /// Whether a spline is certain to interpolate these positions.
    fn interpolates(&self, images: &[Point<f64, D>]) -> bool {
        let radius = centre_and_radius(images).1;
        let Some(close) = self.close.as_ref().filter(|_| ORDINARY.contains(&radius)) else {
            return false;
        };
        close.iter().all(|&(square, i, k)| {
            let [before, after] = [
                (self.points[i] - self.points[k]) / self.radius,
                (images[i] - images[k]) / radius,
            ];
            let kernel = match D {
                2 => -0.5 * square * square.ln(),
                _ => square.sqrt(),
            };
            (after - before).norm() <= MAX_WEIGHT * kernel
        })
    }
}

impl<const D: usize> ModelSpline<D> {
    fn new(model: &[Point<f64, D>]) -> Self {
        let mut rows = Vec::new();
        if model.len() >= LARGE {
            let frame = Frame::new(model, model);
            let inside: Vec<[f64; D]> = model.iter().map(|p| frame.model(p)).collect();
            let mut blocks = Blocks::default();
            blocks.build(&inside);
            // Number of points of a large set that the spline interpolates. The system of this size
            // is solved in a tenth of a second, and between the points the spline differs from a
            // field as smooth as the prior by less than the residuals.
            let step = model.len() / 1500;
            rows.extend(blocks.order.iter().step_by(step));
        }
        let points = if rows.is_empty() {
            model.to_vec()
        } else {
            rows.iter().map(|&i| model[i]).collect()
        };
        Self {
            sources: Arc::new(Sources {
                close: close_pairs(&points),
                radius: centre_and_radius(&points).1,
                points,
                rows,
                system: OnceLock::new(),
            }),
        }
    }

    /// The spline that maps the model, or its sample, to `warped`. If no spline interpolates these
    /// positions, a smoothed one takes its place; `warped` then becomes its values, unless it
    /// belongs to a sample.
    fn through(&self, warped: &mut [Point<f64, D>]) -> Box<dyn Warp<D> + Send + Sync> {
        let rows = &self.sources.rows;
        let mut images = if rows.is_empty() {
            warped.to_vec()
        } else {
            rows.iter().map(|&i| warped[i]).collect()
        };
        if self.sources.interpolates(&images) {
            return Box::new(Lazy {
                sources: Arc::clone(&self.sources),
                images,
                spline: OnceLock::new(),
            });
        }
        let warp = warp_through(&self.sources, &mut images);
        if rows.is_empty() {
            warped.copy_from_slice(&images);
        }
        warp
    }
}

/// A spline that is fitted on first use, so that callers who need only the pairs do not wait for
/// it.
struct Lazy<const D: usize> {
    sources: Arc<Sources<D>>,
    images: Vec<Point<f64, D>>,
    spline: OnceLock<Box<dyn Warp<D> + Send + Sync>>,
}

impl<const D: usize> Lazy<D> {
    fn spline(&self) -> &dyn Warp<D> {
        let fit = || warp_through(&self.sources, &mut self.images.clone());
        &**self.spline.get_or_init(fit)
    }
}

impl<const D: usize> Warp<D> for Lazy<D> {
    fn apply(&self, point: &Point<f64, D>) -> Point<f64, D> {
        self.spline().apply(point)
    }

    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D> {
        self.spline().jacobian(point)
    }

    fn rank(&self) -> usize {
        self.spline().rank()
    }

    fn apply_into(
        &self,
        points: &[Point<f64, D>],
        images: &mut [Point<f64, D>],
    ) -> Result<(), TpsError> {
        self.spline().apply_into(points, images)
    }

    fn jacobian_into(
        &self,
        points: &[Point<f64, D>],
        jacobians: &mut [SMatrix<f64, D, D>],
    ) -> Result<(), TpsError> {
        self.spline().jacobian_into(points, jacobians)
    }
}

/// The pairs of points closer than [`APART`] radii, with their squared distance in radii. `None` for
/// too many of them, or if the size of the set is out of range.
fn close_pairs<const D: usize>(points: &[Point<f64, D>]) -> Option<Vec<(f64, usize, usize)>> {
    let (centre, radius) = centre_and_radius(points);
    if !ORDINARY.contains(&radius) {
        return None;
    }
    let inside = |(i, p): (usize, &Point<f64, D>)| (i, (p.coords - centre) / radius);
    let mut sorted: Vec<_> = points.iter().enumerate().map(inside).collect();
    // Only neighbours along the first axis can be close.
    sorted.sort_unstable_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    let mut close = Vec::new();
    for (at, (i, p)) in sorted.iter().enumerate() {
        let near = sorted[at + 1..].iter();
        let near = near.take_while(|(_, q)| q[0] - p[0] < APART);
        let squares = near.map(|(k, q)| ((q - p).norm_squared(), *i, *k));
        close.extend(squares.filter(|&(square, ..)| square < APART * APART));
        if close.len() > MAX_CLOSE_PAIRS * points.len() {
            return None;
        }
    }
    Some(close)
}

/// The interpolating spline through the estimated positions. If there is none (coincident model
/// points with different displacements), the result is a smoothed spline, and `warped` becomes its
/// values.
fn warp_through<const D: usize>(
    sources: &Sources<D>,
    warped: &mut [Point<f64, D>],
) -> Box<dyn Warp<D> + Send + Sync> {
    let model = &sources.points;
    let exact = sources.system().through(model, warped);
    // Accurate to half the digits.
    if follows(&*exact, model, warped, (0.5 * f64::EPSILON).sqrt()) {
        return exact;
    }
    // Smoothing of the spline if none interpolates all positions.
    let (warp, places) = through(model, model, warped, Smoothing::Lambda(1e-6));
    warped.copy_from_slice(&places);
    warp
}

// State of the matcher for one model along a series of targets.

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

#[cfg(test)]
mod tests;
