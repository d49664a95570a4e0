//! Points at equal distances over the box of a set.
use crate::core::InvalidOption;
use nalgebra::Point;

/// Maximum number of points of a grid: strains with their errors take some 300 bytes for each.
const MAX_POINTS: f64 = 4e6;

/// Points at equal distances over the box of a set, for displacement and strain between its points.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_imaging::PointGrid;
/// let set = [[0.0, 5.0], [2.5, 6.0], [f64::NAN, 0.0]].map(Point2::from);
/// let grid = PointGrid::over(&set, 1.0)?;
/// assert_eq!(grid.counts, [3, 2]);
/// assert_eq!(grid.points()[4], Point2::new(1.0, 6.0));
/// assert!(PointGrid::over(&set, 0.0).is_err());
/// # Ok::<(), tactile_imaging::core::InvalidOption>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PointGrid<const D: usize> {
    /// The point with the smallest coordinates.
    pub origin: Point<f64, D>,
    /// Distance between neighbours.
    pub spacing: f64,
    /// Number of points along each axis.
    pub counts: [usize; D],
}

impl<const D: usize> PointGrid<D> {
    /// A grid over the box of the points with finite coordinates.
    ///
    /// # Errors
    /// [`InvalidOption`] for a spacing that is not positive, or that gives more than four million
    /// points.
    pub fn over(set: &[Point<f64, D>], spacing: f64) -> Result<Self, InvalidOption> {
        let mut set = set.iter().filter(|p| p.iter().all(|x| x.is_finite()));
        let first = set.next().copied().unwrap_or_else(Point::origin);
        let (low, high) = set.fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)));
        let counts: [f64; D] =
            std::array::from_fn(|a| ((high[a] - low[a]) / spacing).floor() + 1.0);
        if !(spacing > 0.0 && counts.iter().product::<f64>() <= MAX_POINTS) {
            let expected = "a spacing above zero that gives four million points at most";
            return Err(InvalidOption::new("grid", spacing, expected));
        }
        let counts = counts.map(|count| count as usize);
        Ok(Self {
            origin: low,
            spacing,
            counts,
        })
    }

    /// The points, the first axis fastest.
    #[must_use]
    pub fn points(&self) -> Vec<Point<f64, D>> {
        let place = |k: usize| {
            let (mut rest, mut place) = (k, self.origin);
            for a in 0..D {
                place[a] += self.spacing * (rest % self.counts[a]) as f64;
                rest /= self.counts[a];
            }
            place
        };
        (0..self.counts.iter().product()).map(place).collect()
    }
}
