//! Relaxation labelling, the paper's matching method as printed: a dense, slow reference that
//! faster methods are checked against.
//!
//! Two point sets `x_i` (model, `I` points) and `y_j` (target, `J` points) are graphs: each point
//! is joined to its neighbours. A match matrix `M`, `(I + 1) × (J + 1)` with a slack row and a
//! slack column for points without a partner, should preserve neighbourhoods. The equations, with
//! the paper's numbers and the reading taken here:
//!
//! | equation | what |
//! |---|---|
//! | (13) | neighbourhood: within the median of all pairwise distances, the median included |
//! | (14) | energy `Σ_i Σ_{a∈N(i)} Σ_j Σ_{b∈N(j)} M_ij M_ab`: edges kept, each counted from both ends |
//! | constraint of (14) | rows and columns sum to one, slack included; the slack row and column themselves need not |
//! | (15) | `α = 1 − |d_ia − d_jb| / max(d_ia, d_jb)` per pair, or over the longest edge of both graphs |
//! | (16) | `β = 1 − ∠(x_a − x_i, y_b − y_j) / π` |
//! | (17) | `γ = 1 − d_ia / max_{a'∈N(i)} d_ia'` |
//! | (18) | compatibility `r = αβγ_ia`, or `αβγ_ia γ_jb` ([`Compatibility`]) |
//! | (19) | support `S_ij = Σ_{a∈N(i)} Σ_{b∈N(j)} M_ab r(ia, jb)` |
//! | (20) | `M_ij ← M_ij S_ij / Σ_j' M_ij' S_ij'`, the slack entry with a constant gain in place of `S` |
//!
//! Four equations need an interpretation. β compares directions by the angle between the vectors,
//! which is defined everywhere. The printed difference of angles breaks at ±180° and does not exist
//! in 3-D; elsewhere the two agree. The maximum in α may be taken per pair or over all pairs:
//! [`LengthMaximum`] offers both. γ is printed for the model's edge alone, which treats the graphs
//! differently: [`Compatibility`] offers this form and, as the default, the product of both. γ is
//! zero for the farthest neighbour of a point, so a point with one neighbour has no support, as
//! printed.
//!
//! One sweep costs `O(I J A B)` for `A` and `B` neighbours per point. With neighbourhoods of the
//! median radius `A ≈ I/2` and `B ≈ J/2`: this is fourth order, not third order as the paper
//! claims. For work use [`AnnealedSoftassign`](crate::AnnealedSoftassign). [`RelaxationLabelling`]
//! is the reference, and [`RelaxationLabelling::with_candidates`] runs the same method over few
//! candidates.

pub(crate) mod graph;
pub(crate) mod matrix;
mod relaxation;

pub use graph::Neighbourhood;

use crate::assignment::assigned;
use crate::error::{all_pairs, at_least_one, option_within, point_sets};
use crate::frame::{Frame, spread};
use crate::interpolation::spline;
use crate::{Judgement, MatchError, Matching, StopReason, Watch};
use matrix::MatchMatrix;
use nalgebra::{Point, SVector};
use relaxation::relax;
use std::ops::ControlFlow;
use tactile_tps::Smoothing;

/// The set of edges over which the maximum in α (15) is taken.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::labelling::LengthMaximum;
/// use tactile_match::{PointMatcher, RelaxationLabelling};
/// let model: Vec<_> = (0..12)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 4.0 + 0.2 * (3.0 * k).sin(), (k / 4.0).floor()))
///     .collect();
/// let target: Vec<_> = model
///     .iter()
///     .map(|p| Point2::new(p.x + 0.1 * p.y, p.y))
///     .collect();
/// for maximum in [LengthMaximum::PerPair, LengthMaximum::Global] {
///     let options = RelaxationLabelling::default().with_length_maximum(maximum);
///     let found = options.match_points(&model, &target)?;
///     assert!((0..12).all(|i| found.assignment[i] == Some(i)));
/// }
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum LengthMaximum {
    /// The two edges compared, `max(d, e)`.
    #[default]
    PerPair,
    /// All edges of both graphs.
    Global,
}

/// The factors in the compatibility r (18) of two edges.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::labelling::Compatibility;
/// use tactile_match::{PointMatcher, RelaxationLabelling};
/// let model: Vec<_> = (0..12)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 4.0 + 0.2 * (3.0 * k).sin(), (k / 4.0).floor()))
///     .collect();
/// let target: Vec<_> = model
///     .iter()
///     .map(|p| Point2::new(p.x + 0.1 * p.y, p.y))
///     .collect();
/// for compatibility in [
///     Compatibility::LengthDirection,
///     Compatibility::Printed,
///     Compatibility::Full,
/// ] {
///     let options = RelaxationLabelling::default().with_compatibility(compatibility);
///     let found = options.match_points(&model, &target)?;
///     assert!((0..12).all(|i| found.assignment[i] == Some(i)));
/// }
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Compatibility {
    /// r = 1: the support counts neighbours (the method that the paper extends).
    Count,
    /// α: compares lengths.
    Length,
    /// αβ: compares lengths and directions.
    LengthDirection,
    /// αβγ with the γ of the model's edge alone, as printed in (18).
    Printed,
    /// αβγγ′ with the γ of both edges: the graphs are treated alike.
    #[default]
    Full,
}

/// The paper's matching method (13)–(20) as printed: relaxation labelling alternates with a
/// thin-plate spline.
///
/// Each outer iteration builds the graphs of the warped model and the target, computes the first M
/// from shape contexts, relaxes M by (19), (20) and Sinkhorn's normalisation until it converges,
/// and fits a thin-plate spline to the mean partners. Each sweep costs `O(I J A B)`: seconds for
/// 105 points with neighbourhoods of the median radius. Use it as a reference only.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{PointMatcher, RelaxationLabelling};
/// let model: Vec<_> = (0..16)
///     .map(|k| f64::from(k))
///     .map(|k| Point2::new(k % 4.0 + 0.1 * k.sin(), (k / 4.0).floor()))
///     .collect();
/// let target: Vec<_> = model
///     .iter()
///     .rev()
///     .map(|p| Point2::new(p.x + 0.1 * p.y, p.y))
///     .collect();
/// let matching = RelaxationLabelling::default().match_points(&model, &target)?;
/// assert!((0..16).all(|i| matching.assignment[i] == Some(15 - i)));
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
///
/// # Options
/// Lengths refer to sets scaled to a root mean square radius of one.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::labelling::{Compatibility, LengthMaximum, Neighbourhood};
/// use tactile_match::{MatchError, PointMatcher, RelaxationLabelling};
/// let model: Vec<_> = (0..12)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 4.0 + 0.2 * (3.0 * k).sin(), (k / 4.0).floor()))
///     .collect();
/// let target: Vec<_> = model
///     .iter()
///     .map(|p| Point2::new(p.x + 0.1 * p.y, p.y))
///     .collect();
/// let options = RelaxationLabelling::default()
///     .with_neighbourhood(Neighbourhood::Nearest(4))?
///     .with_length_maximum(LengthMaximum::Global)
///     .with_compatibility(Compatibility::default())
///     .with_temperature(0.2)?
///     .with_slack(0.1)?
///     .with_smoothing(0.5)?
///     .with_candidates(8)?
///     .with_max_iterations(3)?;
/// let matching = options.match_points(&model, &target)?;
/// assert!(
///     (0..12).all(|i| matching.assignment[i] == Some(i)) && matching.report.iterations <= 3
/// );
/// assert!(matches!(
///     options.with_slack(2.0),
///     Err(MatchError::InvalidOption {
///         option: "slack",
///         ..
///     })
/// ));
/// # Ok::<(), MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelaxationLabelling {
    neighbourhood: Neighbourhood,
    compatibility: Compatibility,
    length_maximum: LengthMaximum,
    temperature: f64,
    slack: f64,
    sweeps: usize,
    tolerance: f64,
    sinkhorn_sweeps: usize,
    smoothing: f64,
    max_iterations: usize,
    candidates: Option<usize>,
}

impl Default for RelaxationLabelling {
    fn default() -> Self {
        Self {
            neighbourhood: Neighbourhood::MedianRadius,
            compatibility: Compatibility::Full,
            length_maximum: LengthMaximum::PerPair,
            temperature: 0.1,
            slack: 0.2,
            sweeps: 10,
            tolerance: 0.01,
            sinkhorn_sweeps: 10,
            smoothing: 1.0,
            max_iterations: 10,
            candidates: None,
        }
    }
}

impl RelaxationLabelling {
    /// Sets the neighbours of a point (13).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for zero neighbours.
    pub fn with_neighbourhood(mut self, neighbourhood: Neighbourhood) -> Result<Self, MatchError> {
        if let Neighbourhood::Nearest(k) = neighbourhood {
            at_least_one("neighbourhood", k)?;
        }
        self.neighbourhood = neighbourhood;
        Ok(self)
    }

    /// Sets the factors of the compatibility r (18).
    #[must_use]
    pub fn with_compatibility(mut self, compatibility: Compatibility) -> Self {
        self.compatibility = compatibility;
        self
    }

    /// Sets the edges over which the maximum in α (15) is taken.
    #[must_use]
    pub fn with_length_maximum(mut self, maximum: LengthMaximum) -> Self {
        self.length_maximum = maximum;
        self
    }

    /// Sets the temperature of the first probabilities (default 0.1). Shape-context distances range
    /// from zero to one.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] unless it is positive and finite.
    pub fn with_temperature(mut self, temperature: f64) -> Result<Self, MatchError> {
        option_within(
            "temperature",
            temperature,
            f64::MIN_POSITIVE,
            f64::MAX,
            "(0, ∞)",
        )?;
        self.temperature = temperature;
        Ok(self)
    }

    /// Sets the slack (default 0.2). It applies to the first probabilities, relative to the
    /// likeliest partner, and to the support, relative to the mean of the largest supports of the
    /// model points.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] outside `[0, 1]`.
    pub fn with_slack(mut self, slack: f64) -> Result<Self, MatchError> {
        option_within("slack", slack, 0.0, 1.0, "[0, 1]")?;
        self.slack = slack;
        Ok(self)
    }

    /// Sets the smoothing λ of the first spline (default 1). It halves from one outer iteration to
    /// the next.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] unless it is finite and not negative.
    pub fn with_smoothing(mut self, lambda: f64) -> Result<Self, MatchError> {
        option_within("smoothing", lambda, 0.0, f64::MAX, "[0, ∞)")?;
        self.smoothing = lambda;
        Ok(self)
    }

    /// Sets the maximum number of outer iterations (default 10).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for 0.
    pub fn with_max_iterations(mut self, limit: usize) -> Result<Self, MatchError> {
        at_least_one("max_iterations", limit)?;
        self.max_iterations = limit;
        Ok(self)
    }

    /// Keeps only this number of the likeliest candidates of each model point, for a fraction of
    /// the time (default: all).
    ///
    /// The pairs of largest first probability are kept. The others stay zero, which (20) preserves.
    /// The contribution of pair `(a, b)` to pair `(i, j)` in (19) does not depend on M. These
    /// links, at most `I A c²`, are computed once per outer iteration, and a sweep costs one
    /// multiplication per link instead of `O(I J A B)`. With as many candidates as targets the
    /// answer is the dense one to rounding. Once the match of a point is settled (to a hundred
    /// roundings), its other candidates leave the sweeps.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{PointMatcher, RelaxationLabelling};
    /// let model: Vec<_> = (0..16)
    ///     .map(f64::from)
    ///     .map(|k| Point2::new(k % 4.0 + 0.1 * k.sin(), (k / 4.0).floor()))
    ///     .collect();
    /// let target: Vec<_> = model
    ///     .iter()
    ///     .rev()
    ///     .map(|p| Point2::new(p.x + 0.1 * p.y, p.y))
    ///     .collect();
    /// let all = RelaxationLabelling::default()
    ///     .with_candidates(16)?
    ///     .match_points(&model, &target)?;
    /// let dense = RelaxationLabelling::default().match_points(&model, &target)?;
    /// assert_eq!(all.assignment, dense.assignment);
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for zero candidates.
    pub fn with_candidates(mut self, candidates: usize) -> Result<Self, MatchError> {
        at_least_one("candidates", candidates)?;
        self.candidates = Some(candidates);
        Ok(self)
    }
}

impl RelaxationLabelling {
    /// [`PointMatcher::match_points`](crate::PointMatcher::match_points).
    pub(crate) fn once<const D: usize>(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        watch: Watch<'_>,
    ) -> Result<Matching<D>, MatchError> {
        point_sets(model, target)?;
        all_pairs(model.len(), target.len())?;
        let frames = [Frame::of(model), Frame::of(target)];
        let enter = |frame: &Frame<D>, points: &[Point<f64, D>]| -> Vec<Point<f64, D>> {
            points
                .iter()
                .map(|p| Point::from(frame.inside(p)))
                .collect()
        };
        let (start, goal) = (enter(&frames[0], model), enter(&frames[1], target));
        let mut run = Run {
            matches: MatchMatrix::without_candidates(start.len(), goal.len()),
            warped: start.clone(),
            model: start,
            target: goal,
            stop: StopReason::IterationLimit,
            energy: Vec::new(),
            frame: frames[1],
        };
        for k in 0..self.max_iterations {
            if run.relax(self, watch).is_break() {
                run.stop = StopReason::Cancelled;
                break;
            }
            let lambda = self.smoothing * 0.5_f64.powi(i32::try_from(k).unwrap_or(i32::MAX));
            let step = run.fit(Smoothing::Lambda(lambda));
            if step <= 1e-3 {
                run.stop = StopReason::Converged;
                break;
            }
        }
        Ok(run.finish(model, target, watch))
    }
}

/// A match in progress, with both sets centred and scaled to size one.
struct Run<const D: usize> {
    model: Vec<Point<f64, D>>,
    target: Vec<Point<f64, D>>,
    warped: Vec<Point<f64, D>>,
    matches: MatchMatrix,
    stop: StopReason,
    energy: Vec<f64>,
    frame: Frame<D>,
}

impl<const D: usize> Run<D> {
    /// Computes the match matrix of the current sets and its energy (14).
    fn relax(&mut self, options: &RelaxationLabelling, watch: Watch<'_>) -> ControlFlow<()> {
        let (matches, energy) = relax(options, &self.warped, &self.target, watch)?;
        self.matches = matches;
        self.energy.push(energy);
        ControlFlow::Continue(())
    }

    /// Mean partner of model point `i`, and its weight: one minus the slack.
    fn partner(&self, i: usize) -> (SVector<f64, D>, f64) {
        let (sum, mass) = self
            .matches
            .row(i)
            .fold((SVector::zeros(), 0.0), |(sum, mass), (j, w)| {
                (sum + self.target[j].coords * w, mass + w)
            });
        if mass > 0.0 {
            (sum / mass, mass)
        } else {
            (self.warped[i].coords, mass)
        }
    }

    /// Fits the spline to the mean partners and moves the model. Returns the largest displacement.
    fn fit(&mut self, smoothing: Smoothing) -> f64 {
        let (means, weights): (Vec<_>, Vec<_>) =
            (0..self.model.len()).map(|i| self.partner(i)).unzip();
        let kept: Vec<usize> = (0..weights.len()).filter(|&i| weights[i] > 1e-6).collect();
        if kept.is_empty() {
            return 0.0;
        }
        let sources: Vec<_> = kept.iter().map(|&i| self.model[i]).collect();
        let images: Vec<_> = kept.iter().map(|&i| Point::from(means[i])).collect();
        let warp = spline(
            &sources,
            &images,
            Some(kept.iter().map(|&i| weights[i]).collect()),
            smoothing,
        );
        let moved: Vec<_> = self.model.iter().map(|p| warp.apply(p)).collect();
        let step = moved
            .iter()
            .zip(&self.warped)
            .fold(0.0_f64, |m, (a, b)| m.max((a - b).norm()));
        self.warped = moved;
        step
    }

    /// Distinct partners with the largest sum of probabilities. `None` if the slack is likelier.
    fn assignment(&self, watch: Watch<'_>) -> Vec<Option<usize>> {
        let (rows, columns) = (self.model.len(), self.target.len());
        let mut entries = vec![0.0; rows * columns];
        for i in 0..rows {
            for (j, p) in self.matches.row(i) {
                entries[i * columns + j] = p;
            }
        }
        let entry = |i, j| entries[i * columns + j];
        // The costs are probabilities, hence finite.
        let mut assignment = assigned([rows, columns], |i, j| -entry(i, j), watch)
            .unwrap_or_else(|_| vec![None; rows]);
        for (i, partner) in assignment.iter_mut().enumerate() {
            let slack = self.matches.slack(i);
            *partner = partner.filter(|&j| entry(i, j) > 0.0 && entry(i, j) >= slack);
        }
        assignment
    }

    /// The result, in the units of the caller.
    fn finish(
        self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        watch: Watch<'_>,
    ) -> Matching<D> {
        let assignment = self.assignment(watch);
        let positions: Vec<Point<f64, D>> = self
            .warped
            .iter()
            .map(|p| self.frame.leave(p.coords))
            .collect();
        // The values of the spline at the model points determine it, so interpolating them gives
        // the spline in the units of the caller.
        let warp = spline(model, &positions, None, Smoothing::None);
        let warped: Vec<_> = model.iter().map(|p| warp.apply(p)).collect();
        let mut found = Matching::new(target, warp, warped, assignment);
        for (i, partner) in found.assignment.iter().enumerate() {
            let (row, slack) = (|| self.matches.row(i), self.matches.slack(i));
            // Sinkhorn's normalisation ends with the columns, so a row may sum to slightly more
            // than one.
            let sum = (row().map(|pair| pair.1).sum::<f64>() + slack).max(1.0);
            // Soft matches below this weight are dropped.
            let kept = row().filter(|p| p.1 > 1e-4);
            found.soft.push_row(kept.map(|(j, p)| (j, p / sum)));
            let surest = |on| row().find(|&(j, _)| j == on).map_or(0.0, |pair| pair.1);
            found.confidence.push(partner.map_or(slack, surest) / sum);
            let places = row().map(|(j, p)| (target[j] - target[0], p));
            let covariance = spread(places);
            found.displacement_covariance.push(covariance);
        }
        (found.report.judgement, found.report.period) =
            Judgement::of_pairs(model, target, &found.assignment);
        found.report.stop = self.stop;
        found.report.iterations = self.energy.len();
        found.energy = self.energy;
        found
    }
}
