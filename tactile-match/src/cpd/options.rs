//! Options of coherent point drift.

use super::{Motion, Normalization};
use crate::MatchError;
use crate::validate::{at_least_one, option_within};

/// Coherent point drift as a [`PointMatcher`](crate::PointMatcher).
///
/// Where the sets are far apart in rotation it finds a local optimum, as every method of its kind does. The time is
/// `O((M N + M r²) · iterations)`, with `r` the rank of the kernel.
///
/// ```
/// use nalgebra::{Point2, Rotation2, Vector2};
/// use tactile_match::{CoherentPointDrift, Motion, PointMatcher};
///
/// let model: Vec<_> = (0..40).map(|k| f64::from(k)).map(|k| Point2::new(k.cos() * k, (1.3 * k).sin() * k)).collect();
/// let motion = Rotation2::new(0.2);
/// let target: Vec<_> = model.iter().rev().map(|p| motion * p + Vector2::new(7.0, -2.0)).collect();
///
/// let matcher = CoherentPointDrift::default().with_motion(Motion::Rigid)?;
/// let matching = matcher.match_points(&model, &target)?;
/// assert!((0..40).all(|m| matching.assignment[m] == Some(39 - m)));
/// assert!(matching.warped.iter().zip(target.iter().rev()).all(|(w, t)| (w - t).norm() < 1e-6));
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
///
/// # Options
/// All are independent of the units of the points.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{CoherentPointDrift, MatchError, Motion, Normalization, PointMatcher};
/// // About a fifth of the target points are outliers, and the object may bend, but gently.
/// let motion = Motion::NonRigid { beta: 2.0, lambda: 10.0, rank: Some(30) };
/// let options = CoherentPointDrift::default()
///     .with_motion(motion)?
///     .with_normalization(Normalization::Model)
///     .with_outlier_weight(0.2)?
///     .with_tolerance(1e-6)?
///     .with_max_iterations(50)?;
/// let points = [[0.0, 0.0], [1.0, 0.1], [2.5, 0.0], [0.3, 2.0], [1.6, 1.4]].map(Point2::from);
/// let found = options.match_points(&points, &points)?;
/// assert!((0..5).all(|i| found.assignment[i] == Some(i)) && found.report.iterations <= 50);
/// let all_outliers = options.with_outlier_weight(1.0);
/// assert!(matches!(all_outliers, Err(MatchError::InvalidOption { option: "outlier_weight", .. })));
/// # Ok::<(), MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoherentPointDrift {
    pub(super) motion: Motion,
    pub(super) outlier_weight: f64,
    pub(super) tolerance: f64,
    pub(super) max_iterations: usize,
    pub(super) normalization: Normalization,
}

impl Default for CoherentPointDrift {
    fn default() -> Self {
        Self {
            motion: Motion::NON_RIGID,
            outlier_weight: 0.1,
            tolerance: 1e-5,
            max_iterations: 150,
            normalization: Normalization::Each,
        }
    }
}

impl CoherentPointDrift {
    /// Sets how the model may move (default [`Motion::NON_RIGID`]).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] unless β and λ are positive and finite and the rank is at least one.
    pub fn with_motion(mut self, motion: Motion) -> Result<Self, MatchError> {
        if let Motion::NonRigid { beta, lambda, rank } = motion {
            option_within("beta", beta, f64::MIN_POSITIVE, f64::MAX, "(0, ∞)")?;
            option_within("lambda", lambda, f64::MIN_POSITIVE, f64::MAX, "(0, ∞)")?;
            at_least_one("rank", rank.unwrap_or(1))?;
        }
        self.motion = motion;
        Ok(self)
    }

    /// Sets the weight `w` of the uniform component (default 0.1): about the share of target points that are outliers.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] outside `[0, 1)`.
    pub fn with_outlier_weight(mut self, weight: f64) -> Result<Self, MatchError> {
        option_within("outlier_weight", weight, 0.0, 1.0 - f64::EPSILON, "[0, 1)")?;
        self.outlier_weight = weight;
        Ok(self)
    }

    /// Sets the change of `σ²` at which the iterations end (default 10⁻⁵).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] unless it is finite and not negative.
    pub fn with_tolerance(mut self, tolerance: f64) -> Result<Self, MatchError> {
        option_within("tolerance", tolerance, 0.0, f64::MAX, "[0, ∞)")?;
        self.tolerance = tolerance;
        Ok(self)
    }

    /// Sets the most iterations (default 150).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for 0.
    pub fn with_max_iterations(mut self, limit: usize) -> Result<Self, MatchError> {
        at_least_one("max_iterations", limit)?;
        self.max_iterations = limit;
        Ok(self)
    }

    /// Sets the frame of the registration (default [`Normalization::Each`]).
    #[must_use]
    pub fn with_normalization(mut self, normalization: Normalization) -> Self {
        self.normalization = normalization;
        self
    }
}
