//! The whole method: first probabilities, relaxation, spline, and again.

use super::{
    Compatibility, CompatibilityRule, LengthMaximum, MatchMatrix, NeighbourGraph, Neighbourhood,
    first_matches, sinkhorn, support_by, update,
};
use crate::frame::Frame;
use crate::validate::{option_within, point_sets};
use crate::{MatchError, Matching, PointMatcher, StopReason};
use nalgebra::Point;
use tactile_tps::{Scalar, Smoothing};

/// Edge pairs whose compatibilities are kept between sweeps; more than these are computed anew every time.
const TABLE_LIMIT: usize = 1 << 25;

/// Options of [`DenseRelaxation`]. Lengths refer to sets of root mean square radius one.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::dense::{DenseOptions, DenseRelaxation, Neighbourhood};
/// use tactile_match::{MatchError, PointMatcher};
/// let model: Vec<_> = (0..12).map(f64::from).map(|k| Point2::new(k % 4.0 + 0.2 * (3.0 * k).sin(), (k / 4.0).floor())).collect();
/// let target: Vec<_> = model.iter().map(|p| Point2::new(p.x + 0.1 * p.y, p.y)).collect();
/// let options = DenseOptions { neighbourhood: Neighbourhood::Nearest(4), max_iterations: 3, ..Default::default() };
/// let matching = DenseRelaxation::new(options)?.match_points(&model, &target)?;
/// assert!((0..12).all(|i| matching.assignment[i] == Some(i)) && matching.report.iterations <= 3);
/// let hot = DenseRelaxation::new(DenseOptions { slack: 2.0, ..options });
/// assert!(matches!(hot, Err(MatchError::InvalidOption { option: "slack", .. })));
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DenseOptions {
    /// (13): which points are neighbours.
    pub neighbourhood: Neighbourhood,
    /// (16)–(19): the factors of the support.
    pub factors: Compatibility,
    /// (16): the maximum in α.
    pub maximum: LengthMaximum,
    /// Temperature of the first probabilities, over shape-context distances between nought and one.
    pub temperature: f64,
    /// Slack, in `[0, 1]`: of the first probabilities relative to the likeliest partner, and of the support relative to the mean over
    /// the model points of the largest.
    pub slack: f64,
    /// Most sweeps of relaxation in one outer iteration.
    pub sweeps: usize,
    /// Relaxation ends when no entry of M changes by more.
    pub settled: f64,
    /// Sweeps of normalisation after every update.
    pub sinkhorn_sweeps: usize,
    /// Smoothing λ of the first spline; it halves from one outer iteration to the next.
    pub smoothing: f64,
    /// Most outer iterations.
    pub max_iterations: usize,
}

impl Default for DenseOptions {
    fn default() -> Self {
        Self {
            neighbourhood: Neighbourhood::MedianRadius,
            factors: Compatibility::Full,
            maximum: LengthMaximum::PerPair,
            temperature: 0.1,
            slack: 0.2,
            sweeps: 10,
            settled: 0.01,
            sinkhorn_sweeps: 10,
            smoothing: 1.0,
            max_iterations: 10,
        }
    }
}

/// The paper's method as printed: the reference the fast matcher is judged by, in error and in time.
///
/// Every outer iteration joins the warped model and the target to graphs, compares their shape contexts for the first M, relaxes M by
/// (19), (20) and Sinkhorn's normalisation until it stands still, and fits a thin-plate spline to the mean partners. Each sweep costs
/// `O(I J A B)`, seconds for 105 points with neighbourhoods of the median radius; use it to check, not to work.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{PointMatcher, dense::DenseRelaxation};
/// let model: Vec<_> = (0..16).map(|k| f64::from(k)).map(|k| Point2::new(k % 4.0 + 0.1 * k.sin(), (k / 4.0).floor())).collect();
/// let target: Vec<_> = model.iter().rev().map(|p| Point2::new(p.x + 0.1 * p.y, p.y)).collect();
/// let matching = DenseRelaxation::default().match_points(&model, &target)?;
/// assert!((0..16).all(|i| matching.assignment[i] == Some(15 - i)));
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DenseRelaxation {
    options: DenseOptions,
}

impl DenseRelaxation {
    /// With these options.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for an option out of its range.
    pub fn new(options: DenseOptions) -> Result<Self, MatchError> {
        let count =
            |option, value: usize| option_within(option, value as f64, 1.0, f64::MAX, "[1, ∞)");
        if let Neighbourhood::Nearest(k) = options.neighbourhood {
            count("neighbourhood", k)?;
        }
        option_within(
            "temperature",
            options.temperature,
            f64::MIN_POSITIVE,
            f64::MAX,
            "(0, ∞)",
        )?;
        option_within("slack", options.slack, 0.0, 1.0, "[0, 1]")?;
        option_within("settled", options.settled, 0.0, 1.0, "[0, 1]")?;
        option_within("smoothing", options.smoothing, 0.0, f64::MAX, "[0, ∞)")?;
        count("sweeps", options.sweeps)?;
        count("sinkhorn_sweeps", options.sinkhorn_sweeps)?;
        count("max_iterations", options.max_iterations)?;
        Ok(Self { options })
    }

    /// One outer iteration's match matrix: first probabilities of `model` (as warped so far) and `target`, then relaxation.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::dense::DenseRelaxation;
    /// let points = [[0.0, 0.0], [1.0, 0.1], [2.5, 0.0], [0.3, 2.0], [1.6, 1.4]].map(Point2::from);
    /// let m = DenseRelaxation::default().relax(&points, &points);
    /// assert!((0..5).all(|i| (0..5).all(|j| m[(i, i)] >= m[(i, j)])));
    /// ```
    ///
    /// # Panics
    /// Never for finite points.
    #[must_use]
    pub fn relax<T: Scalar, const D: usize>(
        &self,
        model: &[Point<T, D>],
        target: &[Point<T, D>],
    ) -> MatchMatrix<T> {
        let options = &self.options;
        let graphs =
            [model, target].map(|points| NeighbourGraph::new(points, options.neighbourhood));
        let compatibilities = Compatibilities::new(&graphs, options.rule(&graphs));
        let first = first_matches(model, target, options.temperature, options.slack);
        relax_with(options, first, |m| {
            support_by(m, &graphs[0], &graphs[1], |x, y| compatibilities.of(x, y))
        })
    }
}

impl DenseOptions {
    /// How edges of these two graphs are compared.
    pub(super) fn rule<T: Scalar, const D: usize>(
        &self,
        graphs: &[NeighbourGraph<T, D>; 2],
    ) -> CompatibilityRule<T> {
        let longest = match self.maximum {
            LengthMaximum::PerPair => None,
            LengthMaximum::Global => Some(graphs[0].longest().max(graphs[1].longest())),
        };
        CompatibilityRule {
            factors: self.factors,
            longest,
        }
    }
}

/// (19), (20) and (15) in turn until M stands still.
pub(super) fn relax_with<T: Scalar>(
    options: &DenseOptions,
    mut m: MatchMatrix<T>,
    support: impl Fn(&MatchMatrix<T>) -> Vec<T>,
) -> MatchMatrix<T> {
    for _ in 0..options.sweeps {
        let before = m.clone();
        let support = support(&m);
        let gain = slack_gain(&support, m.columns(), options.slack);
        update(&mut m, &support, gain);
        sinkhorn(&mut m, options.sinkhorn_sweeps, T::zero());
        if m.largest_change(&before) <= nalgebra::convert(options.settled) {
            break;
        }
    }
    m
}

/// The outer iterations: `relax` gives the match matrix of the warped model and the target, the spline warps the model, and again.
pub(super) fn match_with<T: Scalar, const D: usize>(
    options: &DenseOptions,
    model: &[Point<T, D>],
    target: &[Point<T, D>],
    relax: impl Fn(&[Point<T, D>], &[Point<T, D>]) -> MatchMatrix<T>,
) -> Result<Matching<T, D>, MatchError> {
    point_sets(model, target)?;
    let frames = [Frame::of(model), Frame::of(target)];
    let enter = |frame: &Frame<D>, points: &[Point<T, D>]| -> Vec<Point<T, D>> {
        points
            .iter()
            .map(|p| Point::from(frame.inside(p).map(nalgebra::convert)))
            .collect()
    };
    let (start, goal) = (enter(&frames[0], model), enter(&frames[1], target));
    let mut run = super::outcome::Run::new(start, goal, frames[1]);
    for k in 0..options.max_iterations {
        run.matches = relax(&run.warped, &run.target);
        run.record_energy(options.neighbourhood);
        let lambda = options.smoothing * 0.5_f64.powi(i32::try_from(k).unwrap_or(i32::MAX));
        let step = run.fit(Smoothing::Lambda(nalgebra::convert(lambda)));
        if step <= nalgebra::convert(1e-3) {
            run.stop = StopReason::Converged;
            break;
        }
    }
    Ok(run.finish(model, target))
}

/// Gain of the slack: a share of what the best partners get, so that it means the same for every neighbourhood.
fn slack_gain<T: Scalar>(support: &[T], columns: usize, share: f64) -> T {
    let rows = support.len() / columns;
    let best = support
        .chunks_exact(columns)
        .map(|row| row.iter().fold(T::zero(), |m, &s| m.max(s)));
    best.fold(T::zero(), |sum, s| sum + s) * nalgebra::convert(share / rows as f64)
}

/// `r` of all edge pairs: tabulated while that is possible, computed otherwise.
struct Compatibilities<'a, T: Scalar, const D: usize> {
    graphs: &'a [NeighbourGraph<T, D>; 2],
    rule: CompatibilityRule<T>,
    table: Vec<T>,
}

impl<'a, T: Scalar, const D: usize> Compatibilities<'a, T, D> {
    fn new(graphs: &'a [NeighbourGraph<T, D>; 2], rule: CompatibilityRule<T>) -> Self {
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

    fn of(&self, x: usize, y: usize) -> T {
        let [model, target] = [0, 1].map(|g| self.graphs[g].edges());
        match self.table.get(x * target.len() + y) {
            Some(&r) => r,
            None => self.rule.of(&model[x], &target[y]),
        }
    }
}

impl<T: Scalar, const D: usize> PointMatcher<T, D> for DenseRelaxation {
    fn match_points(
        &self,
        model: &[Point<T, D>],
        target: &[Point<T, D>],
    ) -> Result<Matching<T, D>, MatchError> {
        match_with(&self.options, model, target, |model, target| {
            self.relax(model, target)
        })
    }
}
