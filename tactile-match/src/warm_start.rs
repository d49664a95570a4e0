//! What a matcher keeps from one target of a series for the next.

use tactile_tps::SeriesMemory;

/// Memory of one matcher along a series of targets of one model, for [`PointMatcher::match_next`](crate::PointMatcher::match_next).
///
/// What is in it belongs to the matcher: a matcher of your own asks for its own type with [`state`](Self::state). A matcher that finds the
/// state of another one starts cold.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_match::{PointMatcher, AnnealedSoftassign, Search, WarmStart};
/// # fn main() -> Result<(), tactile_match::MatchError> {
/// let model: Vec<Point3<f64>> = (0..60)
///     .map(|i| (0.13 * f64::from(i).sqrt(), 2.4 * f64::from(i)))
///     .map(|(r, angle)| Point3::new(r * angle.cos(), r * angle.sin(), 1.0 - 0.5 * r * r))
///     .collect();
/// let matcher = AnnealedSoftassign::default().with_search(Search::Near);
/// let mut warm = WarmStart::default();
/// // The load rises: the surface grows by a hundredth from frame to frame.
/// let mut iterations = Vec::new();
/// for frame in 1..=4 {
///     let target: Vec<_> = model.iter().map(|p| p * (1.1 + 0.01 * f64::from(frame))).collect();
///     let found = matcher.match_next(&mut warm, &model, &target)?;
///     assert!(found.assignment.iter().enumerate().all(|(i, &j)| j == Some(i)));
///     iterations.push(found.report.iterations);
/// }
/// assert!(iterations[3] < iterations[0]);
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Default)]
pub struct WarmStart(SeriesMemory);

impl WarmStart {
    /// The state of type `S` that the last match left here; a default one where there is none, or one of another type.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{MatchError, Matching, NearestNeighbour, PointMatcher, WarmStart};
    /// /// Nearest neighbours of where the model came to lie last.
    /// struct Follower;
    /// impl PointMatcher<2> for Follower {
    ///     fn match_points(&self, model: &[Point2<f64>], target: &[Point2<f64>]) -> Result<Matching<2>, MatchError> {
    ///         NearestNeighbour::default().match_points(model, target)
    ///     }
    ///     fn match_next(
    ///         &self, warm: &mut WarmStart, model: &[Point2<f64>], target: &[Point2<f64>],
    ///     ) -> Result<Matching<2>, MatchError> {
    ///         let last: &mut Vec<Point2<f64>> = warm.state();
    ///         let found = self.match_points(if last.len() == model.len() { last } else { model }, target)?;
    ///         last.clone_from(&found.warped);
    ///         Ok(found)
    ///     }
    /// }
    /// let model = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]].map(Point2::from);
    /// let mut warm = WarmStart::default();
    /// for frame in 1..5 { // the sets end 1.6 apart, more than their spacing
    ///     let target = model.map(|p| Point2::new(p.x + 0.4 * f64::from(frame), p.y));
    ///     assert_eq!(Follower.match_next(&mut warm, &model, &target)?.assignment, [Some(0), Some(1), Some(2)]);
    /// }
    /// # Ok::<(), MatchError>(())
    /// ```
    pub fn state<S: Default + Send + Sync + 'static>(&mut self) -> &mut S {
        self.0.state()
    }
}
