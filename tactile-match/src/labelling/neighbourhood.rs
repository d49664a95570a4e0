//! (13): which points are neighbours, and the edges that join them.

use super::gamma;
use nalgebra::{Point, SVector};

/// Which points are a point's neighbours.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::labelling::Neighbourhood;
/// use tactile_match::{PointMatcher, RelaxationLabelling};
/// let model: Vec<_> = (0..12).map(f64::from).map(|k| Point2::new(k % 4.0 + 0.2 * (3.0 * k).sin(), (k / 4.0).floor())).collect();
/// let target: Vec<_> = model.iter().map(|p| Point2::new(p.x + 0.1 * p.y, p.y)).collect();
/// for neighbourhood in [Neighbourhood::MedianRadius, Neighbourhood::Nearest(4)] {
///     let options = RelaxationLabelling::default().with_neighbourhood(neighbourhood)?;
///     let found = options.match_points(&model, &target)?;
///     assert!((0..12).all(|i| found.assignment[i] == Some(i)));
/// }
/// # Ok::<(), tactile_match::MatchError>(())
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Edge<const D: usize> {
    /// Row of the point.
    pub from: usize,
    /// Row of its neighbour.
    pub to: usize,
    /// Position of the neighbour relative to the point.
    pub vector: SVector<f64, D>,
    /// Its length `d`.
    pub length: f64,
    /// [`gamma`] of this edge among the edges of its point.
    pub gamma: f64,
}

/// A point set as a graph: every point with the edges to its neighbours.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NeighbourGraph<const D: usize> {
    edges: Vec<Edge<D>>,
    starts: Vec<usize>,
}

impl<const D: usize> NeighbourGraph<D> {
    /// Joins every point to its neighbours; `O(n² log n)`.
    #[must_use]
    pub(crate) fn new(points: &[Point<f64, D>], neighbourhood: Neighbourhood) -> Self {
        let radius = median_pairwise_distance(points);
        let mut graph = Self {
            edges: Vec::new(),
            starts: vec![0],
        };
        for i in 0..points.len() {
            let mut neighbours: Vec<usize> = (0..points.len()).filter(|&a| a != i).collect();
            match neighbourhood {
                Neighbourhood::MedianRadius => {
                    let reach = radius.map_or(0.0, |r| r + rounding(points, r));
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

    fn push_point(&mut self, points: &[Point<f64, D>], i: usize, neighbours: &[usize]) {
        let first = self.edges.len();
        for &a in neighbours {
            let vector = points[a] - points[i];
            self.edges.push(Edge {
                from: i,
                to: a,
                vector,
                length: vector.norm(),
                gamma: 0.0,
            });
        }
        let longest = self.edges[first..]
            .iter()
            .fold(0.0_f64, |m, e| m.max(e.length));
        for edge in &mut self.edges[first..] {
            edge.gamma = gamma(edge.length, longest);
        }
        self.starts.push(self.edges.len());
    }

    /// All edges, in the order of the points they start from.
    #[must_use]
    pub(crate) fn edges(&self) -> &[Edge<D>] {
        &self.edges
    }

    /// The edges of point `i`.
    ///
    /// # Panics
    /// If there is no such point.
    #[must_use]
    pub(crate) fn of(&self, i: usize) -> &[Edge<D>] {
        &self.edges[self.range(i)]
    }

    /// Where the edges of point `i` stand in [`edges`](Self::edges).
    pub(super) fn range(&self, i: usize) -> std::ops::Range<usize> {
        self.starts[i]..self.starts[i + 1]
    }

    /// Number of points.
    #[must_use]
    pub(crate) fn points(&self) -> usize {
        self.starts.len() - 1
    }

    /// Length of the longest edge; zero without edges.
    #[must_use]
    pub(crate) fn longest(&self) -> f64 {
        self.edges.iter().fold(0.0_f64, |m, e| m.max(e.length))
    }
}

/// What rounding may add to a distance of about `radius`: the coordinates themselves carry half a unit in the last place.
fn rounding<const D: usize>(points: &[Point<f64, D>], radius: f64) -> f64 {
    let largest = points
        .iter()
        .flat_map(|p| p.iter())
        .fold(radius, |m, c| m.max(c.abs()));
    f64::EPSILON * (largest + largest)
}

/// The median of all pairwise distances (the mean of the two middle ones where their number is even); `None` for fewer
/// than two points. `O(n² log n)`.
#[must_use]
pub(crate) fn median_pairwise_distance<const D: usize>(points: &[Point<f64, D>]) -> Option<f64> {
    let mut distances = Vec::with_capacity(points.len() * points.len().saturating_sub(1) / 2);
    for (i, p) in points.iter().enumerate() {
        distances.extend(points[i + 1..].iter().map(|q| (q - p).norm()));
    }
    distances.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    let n = distances.len();
    let half: f64 = 0.5;
    match n {
        0 => None,
        n if n % 2 == 1 => Some(distances[n / 2]),
        n => Some((distances[n / 2 - 1] + distances[n / 2]) * half),
    }
}
