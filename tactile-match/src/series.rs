//! One model against a series of targets, each near the one before.

use crate::hard::Interpolation;
use crate::{Matching, RelaxationWorkspace};
use nalgebra::Point;
use tactile_tps::{Scalar, Smoothing};

/// What a match leaves for the next of the same model: where the model came to lie, the factorisation of the spline between
/// its points, the matcher's memory.
///
/// For [`PointMatcher::match_next`](crate::PointMatcher::match_next). A series that is given another model forgets the old one.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_match::{MatchSeries, PointMatcher, RelaxationMatcher, RelaxationOptions, Search};
/// # fn main() -> Result<(), tactile_match::MatchError> {
/// let model: Vec<Point3<f64>> = (0..60)
///     .map(|i| (0.13 * f64::from(i).sqrt(), 2.4 * f64::from(i)))
///     .map(|(r, angle)| Point3::new(r * angle.cos(), r * angle.sin(), 1.0 - 0.5 * r * r))
///     .collect();
/// let matcher = RelaxationMatcher::new(RelaxationOptions::default().search(Search::Near));
/// let mut series = MatchSeries::new();
/// // The load rises: the surface grows by a hundredth from frame to frame.
/// let mut iterations = Vec::new();
/// for frame in 1..=4 {
///     let target: Vec<_> = model.iter().map(|p| p * (1.1 + 0.01 * f64::from(frame))).collect();
///     let found = matcher.match_next(&mut series, &model, &target)?;
///     assert!(found.assignment.iter().enumerate().all(|(i, &j)| j == Some(i)));
///     iterations.push(found.report.iterations);
/// }
/// assert!(iterations[3] < iterations[0]);
/// assert!((series.last_for(&model).unwrap()[10] - model[10] * 1.14).norm() < 1e-9);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct MatchSeries<T: Scalar, const D: usize> {
    model: Vec<Point<T, D>>,
    last: Vec<Point<T, D>>,
    /// How many points had a partner.
    pub(crate) matched: usize,
    /// The noise that was found.
    pub(crate) sigma: T,
    pub(crate) workspace: RelaxationWorkspace<D>,
    interpolation: Option<Interpolation<T, D>>,
}

impl<T: Scalar, const D: usize> Default for MatchSeries<T, D> {
    fn default() -> Self {
        Self {
            model: Vec::new(),
            last: Vec::new(),
            matched: 0,
            sigma: T::zero(),
            workspace: RelaxationWorkspace::new(),
            interpolation: None,
        }
    }
}

impl<T: Scalar, const D: usize> MatchSeries<T, D> {
    /// A series that has seen nothing.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Where the last match put the points of `model`; `None` for a model it has not seen.
    #[must_use]
    pub fn last_for(&self, model: &[Point<T, D>]) -> Option<&[Point<T, D>]> {
        (!self.last.is_empty() && self.model == model).then_some(&self.last)
    }

    /// Takes note of a match, for the next: what a matcher of one's own does at the end of its
    /// [`match_next`](crate::PointMatcher::match_next).
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{LinearAssignment, MatchSeries, PointMatcher};
    /// let model = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]].map(Point2::from);
    /// let found = LinearAssignment::new().match_points(&model, &model)?;
    /// let mut series = MatchSeries::<f64, 2>::new();
    /// assert!(series.last_for(&model).is_none());
    /// series.remember(&model, &found);
    /// assert_eq!(series.last_for(&model), Some(&*found.warped));
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    pub fn remember(&mut self, model: &[Point<T, D>], found: &Matching<T, D>) {
        self.adopt(model);
        self.last.clone_from(&found.warped);
        self.matched = found.assignment.iter().flatten().count();
        self.sigma = found.report.sigma;
    }

    /// Forgets the past of another model.
    fn adopt(&mut self, model: &[Point<T, D>]) {
        if self.model != model {
            self.model.clear();
            self.model.extend_from_slice(model);
            self.last.clear();
            self.interpolation = None;
        }
    }

    /// The factorised system of the model's interpolating spline, and the workspace.
    pub(crate) fn parts(
        &mut self,
        model: &[Point<T, D>],
    ) -> (&Interpolation<T, D>, &mut RelaxationWorkspace<D>) {
        self.adopt(model);
        let Self {
            interpolation,
            workspace,
            ..
        } = self;
        let interpolation =
            interpolation.get_or_insert_with(|| Interpolation::new(model, None, Smoothing::None));
        (interpolation, workspace)
    }
}
