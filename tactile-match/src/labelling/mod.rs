//! Relaxation labelling, the paper's matching method as printed: dense, slow and obvious, to check
//! faster ones against.
//!
//! Two point sets `x_i` (model, `I` points) and `y_j` (target, `J` points) are graphs: every point
//! is joined to its neighbours. A match matrix `M`, `(I + 1) × (J + 1)` with a slack row and a
//! slack column for points without a partner, should keep neighbours neighbours. In the paper's
//! numbers, with the reading taken here:
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
//! Four readings need a word. β compares directions: a difference of printed angles breaks at ±180°
//! and does not exist in 3-D, the angle between the vectors has neither fault (and the same value
//! elsewhere). The maximum in α may be meant per pair or over all pairs: [`LengthMaximum`] offers
//! both. γ is printed for the model's edge alone, which prefers one of the graphs:
//! [`Compatibility`] offers that and, as the default, the product of both. γ is zero for a point's
//! farthest neighbour, so that a point with one neighbour has no support: that is what is printed.
//!
//! One sweep costs `O(I J A B)` for `A` and `B` neighbours a point, and with neighbourhoods of the
//! median radius `A ≈ I/2`, `B ≈ J/2`: fourth order, not the third the paper claims.
//! [`AnnealedSoftassign`](crate::AnnealedSoftassign) is the matcher to use. [`RelaxationLabelling`]
//! is what to check it against, and [`RelaxationLabelling::with_candidates`] runs the same method
//! over few candidates.

mod relaxation;

use crate::error::{at_least_one, option_within, point_sets};
use crate::frame::{Frame, spread};
use crate::interpolation::spline;
use crate::{Judgement, MatchError, Matching, StopReason, linear_assignment};
use nalgebra::{Point, SVector};
use relaxation::{MatchMatrix, NeighbourGraph, energy, relax};
use tactile_tps::Smoothing;

/// Which points are a point's neighbours.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::labelling::Neighbourhood;
/// use tactile_match::{PointMatcher, RelaxationLabelling};
/// let model: Vec<_> = (0..12)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 4.0 + 0.2 * (3.0 * k).sin(), (k / 4.0).floor()))
///     .collect();
/// let target: Vec<_> = model
///     .iter()
///     .map(|p| Point2::new(p.x + 0.1 * p.y, p.y))
///     .collect();
/// for neighbourhood in [Neighbourhood::MedianRadius, Neighbourhood::Nearest(4)] {
///     let options = RelaxationLabelling::default().with_neighbourhood(neighbourhood)?;
///     let found = options.match_points(&model, &target)?;
///     assert!((0..12).all(|i| found.assignment[i] == Some(i)));
/// }
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Neighbourhood {
    /// All within the median of all pairwise distances of the set, the median included: the
    /// paper's.
    ///
    /// Distances that exceed the median by rounding alone count as equal to it, so that the ties of
    /// a regular grid do not depend on where the grid lies.
    #[default]
    MedianRadius,
    /// The `k` nearest, of equal distances those of the lower row first. All others if there are
    /// fewer.
    Nearest(usize),
}

/// What the maximum in α (15) is taken over.
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
pub enum LengthMaximum {
    /// The two edges compared, `max(d, e)`.
    #[default]
    PerPair,
    /// All edges of both graphs.
    Global,
}

/// Which factors the compatibility r (18) of two edges has.
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
pub enum Compatibility {
    /// One: the support counts neighbours (the method the paper's extends).
    Count,
    /// α: like lengths.
    Length,
    /// αβ: like lengths and directions.
    LengthDirection,
    /// αβγ with the γ of the model's edge alone, as (18) is printed.
    Printed,
    /// αβγγ′ with the γ of both edges: neither graph is preferred.
    #[default]
    Full,
}

/// The paper's matching method (13)–(20) as printed: relaxation labelling, then a thin-plate
/// spline, in turn.
///
/// Every outer iteration joins the warped model and the target to graphs, compares their shape
/// contexts for the first M, relaxes M by (19), (20) and Sinkhorn's normalisation until it no
/// longer changes, and fits a thin-plate spline to the mean partners. Each sweep costs
/// `O(I J A B)`, seconds for 105 points with neighbourhoods of the median radius. Use it to check,
/// not to work.
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
/// Lengths refer to sets of root mean square radius one.
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
    /// Sets which points are neighbours (13).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for no neighbour at all.
    pub fn with_neighbourhood(mut self, neighbourhood: Neighbourhood) -> Result<Self, MatchError> {
        if let Neighbourhood::Nearest(k) = neighbourhood {
            at_least_one("neighbourhood", k)?;
        }
        self.neighbourhood = neighbourhood;
        Ok(self)
    }

    /// Sets which factors the compatibility r (18) has.
    #[must_use]
    pub fn with_compatibility(mut self, compatibility: Compatibility) -> Self {
        self.compatibility = compatibility;
        self
    }

    /// Sets what the maximum in α (15) is taken over.
    #[must_use]
    pub fn with_length_maximum(mut self, maximum: LengthMaximum) -> Self {
        self.length_maximum = maximum;
        self
    }

    /// Sets the temperature of the first probabilities, over shape-context distances between zero
    /// and one (default 0.1).
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

    /// Sets the slack (default 0.2): of the first probabilities relative to the likeliest partner,
    /// and of the support relative to the mean over the model points of the largest.
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

    /// Sets the most outer iterations (default 10).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for 0.
    pub fn with_max_iterations(mut self, limit: usize) -> Result<Self, MatchError> {
        at_least_one("max_iterations", limit)?;
        self.max_iterations = limit;
        Ok(self)
    }

    /// Keeps only this many likeliest candidates of every model point, at a fraction of the time
    /// (default: all).
    ///
    /// The pairs of largest first probability are kept. The others stay zero, which (20) would not
    /// change. What pair `(a, b)` says for pair `(i, j)` in (19) does not depend on M: these links,
    /// `I A c²` at most, are computed once an outer iteration, and a sweep costs one multiplication
    /// each instead of `O(I J A B)`. With as many candidates as there are targets the answer is the
    /// dense one to rounding. The other candidates of a point whose match is settled (to a hundred
    /// roundings) leave the sweeps.
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
    /// [`MatchError::InvalidOption`] for no candidate.
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
        let mut run = Run {
            matches: MatchMatrix::zeros(start.len(), goal.len()),
            warped: start.clone(),
            model: start,
            target: goal,
            stop: StopReason::IterationLimit,
            energy: Vec::new(),
            frame: frames[1],
        };
        for k in 0..self.max_iterations {
            run.matches = relax(self, &run.warped, &run.target);
            run.record_energy(self.neighbourhood);
            let lambda = self.smoothing * 0.5_f64.powi(i32::try_from(k).unwrap_or(i32::MAX));
            let step = run.fit(Smoothing::Lambda(lambda));
            if step <= 1e-3 {
                run.stop = StopReason::Converged;
                break;
            }
        }
        Ok(run.finish(model, target))
    }
}

/// A match under way, both sets centred and of size one.
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
    /// Keeps the energy (14) of the present match matrix.
    fn record_energy(&mut self, neighbourhood: Neighbourhood) {
        let [x, y] =
            [&self.warped, &self.target].map(|points| NeighbourGraph::new(points, neighbourhood));
        self.energy.push(energy(&self.matches, &x, &y));
    }

    /// Mean partner of model point `i` and its weight, one less the slack.
    fn partner(&self, i: usize) -> (SVector<f64, D>, f64) {
        let weights = &self.matches.row(i)[..self.target.len()];
        let mass: f64 = weights.iter().sum();
        let sum = self
            .target
            .iter()
            .zip(weights)
            .fold(SVector::zeros(), |sum, (y, &w)| sum + y.coords * w);
        if mass > 0.0 {
            (sum / mass, mass)
        } else {
            (self.warped[i].coords, mass)
        }
    }

    /// Fits the spline to the mean partners, moves the model, and returns the largest step.
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

    /// Distinct partners of most probability in sum. None where the slack is likelier.
    fn assignment(&self) -> Vec<Option<usize>> {
        let (rows, columns) = (self.model.len(), self.target.len());
        let costs: Vec<f64> = (0..rows)
            .flat_map(|i| self.matches.row(i)[..columns].iter().map(|&p| -p))
            .collect();
        // Probabilities: finite, and as many as there are pairs.
        let mut assignment =
            linear_assignment(&costs, rows, columns).unwrap_or_else(|_| vec![None; rows]);
        for (i, partner) in assignment.iter_mut().enumerate() {
            let slack = self.matches[(i, columns)];
            *partner =
                partner.filter(|&j| self.matches[(i, j)] > 0.0 && self.matches[(i, j)] >= slack);
        }
        assignment
    }

    /// The result, in the units of the caller.
    fn finish(self, model: &[Point<f64, D>], target: &[Point<f64, D>]) -> Matching<D> {
        let assignment = self.assignment();
        let positions: Vec<Point<f64, D>> = self
            .warped
            .iter()
            .map(|p| self.frame.leave(p.coords))
            .collect();
        // The spline's values determine it: interpolating them gives it back in the units of the
        // caller.
        let warp = spline(model, &positions, None, Smoothing::None);
        let warped: Vec<_> = model.iter().map(|p| warp.apply(p)).collect();
        let mut found = Matching::new(target, warp, warped, assignment);
        for (i, partner) in found.assignment.iter().enumerate() {
            let row = &self.matches.row(i)[..target.len()];
            // Sinkhorn's normalisation ends with the columns: a row may sum to a little more than
            // one.
            let sum = self.matches.row(i).iter().sum::<f64>().max(1.0);
            // Soft matches below this weight are left out.
            let kept = row.iter().copied().enumerate().filter(|p| p.1 > 1e-4);
            found.soft.push_row(kept.map(|(j, p)| (j, p / sum)));
            let sure = partner.map_or(self.matches[(i, target.len())], |j| row[j]);
            found.confidence.push(sure / sum);
            let places = target.iter().map(|y| y - target[0]);
            let covariance = spread(places.zip(row.iter().copied()));
            found.displacement_covariance.push(covariance);
        }
        found.report.judgement = Judgement::of_pairs(model, target, &found.assignment);
        found.report.stop = self.stop;
        found.report.iterations = self.energy.len();
        found.energy = self.energy;
        found
    }
}
