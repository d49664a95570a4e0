//! (13): which points are neighbours, and the edges that join them.

use super::gamma;
use nalgebra::{Point, RealField, SVector};

/// Which points are a point's neighbours.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::dense::{NeighbourGraph, Neighbourhood};
/// let line = [0.0, 1.0, 2.0, 10.0].map(|x| Point2::new(x, 0.0)); // distances 1, 1, 2, 8, 9, 10: the median is 5
/// let degrees = |neighbourhood| {
///     let graph = NeighbourGraph::new(&line, neighbourhood);
///     [0, 1, 2, 3].map(|i| graph.of(i).len())
/// };
/// assert_eq!(degrees(Neighbourhood::MedianRadius), [2, 2, 2, 0]); // the far point stands alone
/// assert_eq!(degrees(Neighbourhood::Nearest(1)), [1, 1, 1, 1]);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Neighbourhood {
    /// All within the median of all pairwise distances of the set, the median included: the paper's.
    ///
    /// Distances that exceed the median by rounding alone count as equal to it, so that the ties of a regular grid
    /// do not depend on where the grid lies.
    #[default]
    MedianRadius,
    /// The `k` nearest, of equal distances those of the lower row first; all others if there are fewer.
    Nearest(usize),
}

/// The edge from a point to one of its neighbours.
///
/// ```
/// use nalgebra::{Point2, Vector2};
/// use tactile_match::dense::{Edge, NeighbourGraph};
/// let points = [[0.0, 0.0], [3.0, 4.0], [0.0, 10.0]].map(Point2::from);
/// let graph = NeighbourGraph::from_lists(&points, &[vec![1, 2], vec![], vec![]]);
/// let near = Edge { from: 0, to: 1, vector: Vector2::new(3.0, 4.0), length: 5.0, gamma: 0.5 };
/// assert_eq!(graph.of(0)[0], near); // half as long as the longest edge of its point
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge<T, const D: usize> {
    /// Row of the point.
    pub from: usize,
    /// Row of its neighbour.
    pub to: usize,
    /// Position of the neighbour relative to the point.
    pub vector: SVector<T, D>,
    /// Its length `d`.
    pub length: T,
    /// [`gamma`] of this edge among the edges of its point.
    pub gamma: T,
}

/// A point set as a graph: every point with the edges to its neighbours.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::dense::{NeighbourGraph, Neighbourhood};
/// let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
/// let graph = NeighbourGraph::new(&square, Neighbourhood::MedianRadius);
/// assert_eq!(graph.radius(), Some(1.0)); // four sides and two diagonals
/// assert_eq!(graph.of(0).iter().map(|e| e.to).collect::<Vec<_>>(), [1, 3]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct NeighbourGraph<T, const D: usize> {
    edges: Vec<Edge<T, D>>,
    starts: Vec<usize>,
    radius: Option<T>,
}

impl<T: RealField + Copy, const D: usize> NeighbourGraph<T, D> {
    /// Joins every point to its neighbours; `O(n² log n)`.
    #[must_use]
    pub fn new(points: &[Point<T, D>], neighbourhood: Neighbourhood) -> Self {
        let radius = median_pairwise_distance(points);
        let mut graph = Self {
            edges: Vec::new(),
            starts: vec![0],
            radius,
        };
        for i in 0..points.len() {
            let mut neighbours: Vec<usize> = (0..points.len()).filter(|&a| a != i).collect();
            match neighbourhood {
                Neighbourhood::MedianRadius => {
                    let reach = radius.map_or(T::zero(), |r| r + rounding(points, r));
                    neighbours.retain(|&a| (points[a] - points[i]).norm() <= reach);
                }
                Neighbourhood::Nearest(k) => {
                    let distance = |&a: &usize| (points[a] - points[i]).norm();
                    neighbours.sort_by(|a, b| {
                        distance(a)
                            .partial_cmp(&distance(b))
                            .unwrap_or(std::cmp::Ordering::Equal)
                    });
                    neighbours.truncate(k);
                    neighbours.sort_unstable();
                }
            }
            graph.push_point(points, i, &neighbours);
        }
        graph
    }

    /// The same with neighbour lists of the caller's choice: `lists[i]` holds the neighbours of point `i`.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::dense::NeighbourGraph;
    /// let points = [[0.0, 0.0], [3.0, 4.0], [0.0, 1.0]].map(Point2::from);
    /// let graph = NeighbourGraph::from_lists(&points, &[vec![1, 2], vec![0], vec![0]]);
    /// assert_eq!((graph.points(), graph.edges().len()), (3, 4));
    /// assert_eq!((graph.longest(), graph.radius()), (5.0, None));
    /// ```
    ///
    /// # Panics
    /// If a list names a point that does not exist.
    #[must_use]
    pub fn from_lists(points: &[Point<T, D>], lists: &[Vec<usize>]) -> Self {
        let mut graph = Self {
            edges: Vec::new(),
            starts: vec![0],
            radius: None,
        };
        for (i, list) in lists.iter().enumerate() {
            graph.push_point(points, i, list);
        }
        graph
    }

    fn push_point(&mut self, points: &[Point<T, D>], i: usize, neighbours: &[usize]) {
        let first = self.edges.len();
        for &a in neighbours {
            let vector = points[a] - points[i];
            self.edges.push(Edge {
                from: i,
                to: a,
                vector,
                length: vector.norm(),
                gamma: T::zero(),
            });
        }
        let longest = self.edges[first..]
            .iter()
            .fold(T::zero(), |m, e| m.max(e.length));
        for edge in &mut self.edges[first..] {
            edge.gamma = gamma(edge.length, longest);
        }
        self.starts.push(self.edges.len());
    }

    /// All edges, in the order of the points they start from.
    #[must_use]
    pub fn edges(&self) -> &[Edge<T, D>] {
        &self.edges
    }

    /// The edges of point `i`.
    ///
    /// # Panics
    /// If there is no such point.
    #[must_use]
    pub fn of(&self, i: usize) -> &[Edge<T, D>] {
        &self.edges[self.range(i)]
    }

    /// Where the edges of point `i` stand in [`edges`](Self::edges).
    pub(super) fn range(&self, i: usize) -> std::ops::Range<usize> {
        self.starts[i]..self.starts[i + 1]
    }

    /// Number of points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.starts.len() - 1
    }

    /// The median of all pairwise distances; `None` for fewer than two points and for given lists.
    #[must_use]
    pub fn radius(&self) -> Option<T> {
        self.radius
    }

    /// Length of the longest edge; nought without edges.
    #[must_use]
    pub fn longest(&self) -> T {
        self.edges.iter().fold(T::zero(), |m, e| m.max(e.length))
    }
}

/// What rounding may add to a distance of about `radius`: the coordinates themselves carry half a unit in the last place.
fn rounding<T: RealField + Copy, const D: usize>(points: &[Point<T, D>], radius: T) -> T {
    let largest = points
        .iter()
        .flat_map(|p| p.iter())
        .fold(radius, |m, c| m.max(c.abs()));
    T::default_epsilon() * (largest + largest)
}

/// The median of all pairwise distances (the mean of the two middle ones where their number is even); `None` for fewer
/// than two points. `O(n² log n)`.
///
/// ```
/// use nalgebra::Point1;
/// use tactile_match::dense::median_pairwise_distance;
/// let points = [0.0, 1.0, 3.0].map(Point1::new); // distances 1, 2, 3
/// assert_eq!(median_pairwise_distance(&points), Some(2.0));
/// ```
#[must_use]
pub fn median_pairwise_distance<T: RealField + Copy, const D: usize>(
    points: &[Point<T, D>],
) -> Option<T> {
    let mut distances = Vec::with_capacity(points.len() * points.len().saturating_sub(1) / 2);
    for (i, p) in points.iter().enumerate() {
        distances.extend(points[i + 1..].iter().map(|q| (q - p).norm()));
    }
    distances.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    let n = distances.len();
    let half: T = nalgebra::convert(0.5);
    match n {
        0 => None,
        n if n % 2 == 1 => Some(distances[n / 2]),
        n => Some((distances[n / 2 - 1] + distances[n / 2]) * half),
    }
}
