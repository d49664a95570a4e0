//! Options of relaxation labelling.

use super::{Compatibility, CompatibilityRule, LengthMaximum, NeighbourGraph, Neighbourhood};
use crate::MatchError;
use crate::validate::{at_least_one, option_within};

/// The paper's matching method (13)–(20) as printed: relaxation labelling, then a thin-plate spline, in turn.
///
/// Every outer iteration joins the warped model and the target to graphs, compares their shape contexts for the first M, relaxes M by
/// (19), (20) and Sinkhorn's normalisation until it no longer changes, and fits a thin-plate spline to the mean partners. Each sweep costs
/// `O(I J A B)`, seconds for 105 points with neighbourhoods of the median radius; use it to check, not to work.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{PointMatcher, RelaxationLabelling};
/// let model: Vec<_> = (0..16).map(|k| f64::from(k)).map(|k| Point2::new(k % 4.0 + 0.1 * k.sin(), (k / 4.0).floor())).collect();
/// let target: Vec<_> = model.iter().rev().map(|p| Point2::new(p.x + 0.1 * p.y, p.y)).collect();
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
/// let model: Vec<_> = (0..12).map(f64::from).map(|k| Point2::new(k % 4.0 + 0.2 * (3.0 * k).sin(), (k / 4.0).floor())).collect();
/// let target: Vec<_> = model.iter().map(|p| Point2::new(p.x + 0.1 * p.y, p.y)).collect();
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
/// assert!((0..12).all(|i| matching.assignment[i] == Some(i)) && matching.report.iterations <= 3);
/// assert!(matches!(options.with_slack(2.0), Err(MatchError::InvalidOption { option: "slack", .. })));
/// # Ok::<(), MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelaxationLabelling {
    pub(super) neighbourhood: Neighbourhood,
    pub(super) compatibility: Compatibility,
    pub(super) length_maximum: LengthMaximum,
    pub(super) temperature: f64,
    pub(super) slack: f64,
    pub(super) sweeps: usize,
    pub(super) tolerance: f64,
    pub(super) sinkhorn_sweeps: usize,
    pub(super) smoothing: f64,
    pub(super) max_iterations: usize,
    pub(super) candidates: Option<usize>,
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

    /// Sets the temperature of the first probabilities, over shape-context distances between zero and one (default 0.1).
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

    /// Sets the slack (default 0.2): of the first probabilities relative to the likeliest partner, and of the support relative to the
    /// mean over the model points of the largest.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] outside `[0, 1]`.
    pub fn with_slack(mut self, slack: f64) -> Result<Self, MatchError> {
        option_within("slack", slack, 0.0, 1.0, "[0, 1]")?;
        self.slack = slack;
        Ok(self)
    }

    /// Sets the smoothing λ of the first spline (default 1); it halves from one outer iteration to the next.
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

    /// Keeps only this many likeliest candidates of every model point, at a fraction of the time (default: all).
    ///
    /// The pairs of largest first probability are kept; the others stay zero, which (20) would not change. What pair `(a, b)` says for pair
    /// `(i, j)` in (19) does not depend on M: these links, `I A c²` at most, are computed once an outer iteration, and a sweep costs one
    /// multiplication each instead of `O(I J A B)`. With as many candidates as there are targets the answer is the dense one to rounding. The
    /// other candidates of a point whose match is settled (to a hundred roundings) leave the sweeps.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{RelaxationLabelling, PointMatcher};
    /// let model: Vec<_> = (0..16).map(f64::from).map(|k| Point2::new(k % 4.0 + 0.1 * k.sin(), (k / 4.0).floor())).collect();
    /// let target: Vec<_> = model.iter().rev().map(|p| Point2::new(p.x + 0.1 * p.y, p.y)).collect();
    /// let all = RelaxationLabelling::default().with_candidates(16)?.match_points(&model, &target)?;
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

    /// How edges of these two graphs are compared.
    pub(super) fn rule<const D: usize>(
        &self,
        graphs: &[NeighbourGraph<D>; 2],
    ) -> CompatibilityRule {
        let longest = match self.length_maximum {
            LengthMaximum::PerPair => None,
            LengthMaximum::Global => Some(graphs[0].longest().max(graphs[1].longest())),
        };
        CompatibilityRule {
            factors: self.compatibility,
            longest,
        }
    }
}
