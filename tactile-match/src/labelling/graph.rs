//! A point set as a graph (13), and how alike two edges are (15)–(17).

use nalgebra::SVector;

/// The edge from a point to one of its neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Edge<const D: usize> {
    /// Row of the neighbour.
    pub(crate) to: usize,
    /// Position of the neighbour relative to the point.
    pub(crate) vector: SVector<f64, D>,
    /// Its length `d`.
    pub(crate) length: f64,
    /// γ (17): `1 − d / max d`, with the maximum over the edges of the same point.
    pub(crate) gamma: f64,
}

impl<const D: usize> Edge<D> {
    /// The edge to point `to` at `at`, the only one of its point.
    pub(crate) fn new(from: &[f64; D], to: usize, at: &[f64; D]) -> Self {
        let vector = SVector::from(*at) - SVector::from(*from);
        Self {
            to,
            vector,
            length: vector.norm(),
            gamma: 1.0,
        }
    }
}

/// Selects the neighbours of a point.
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
#[non_exhaustive]
pub enum Neighbourhood {
    /// All points within the median of all pairwise distances of the set, the median included, as
    /// in the paper.
    ///
    /// Distances that exceed the median only by rounding count as equal to it, so that the ties of
    /// a regular grid do not depend on the grid's position.
    #[default]
    MedianRadius,
    /// The `k` nearest points. Among equal distances the lower rows come first. If there are fewer
    /// points, all of them.
    Nearest(usize),
}

/// A point set as a graph: each point with the edges to its neighbours, in ascending order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct NeighbourGraph<const D: usize> {
    edges: Vec<Edge<D>>,
    starts: Vec<usize>,
    order: Vec<usize>,
}

impl<const D: usize> NeighbourGraph<D> {
    /// The graph of `points`. `O(n²)`, with a factor `log n` for the median radius.
    pub(crate) fn new(points: &[[f64; D]], neighbourhood: Neighbourhood) -> Self {
        let mut graph = Self::default();
        graph.build(points, neighbourhood);
        graph
    }

    /// Like [`NeighbourGraph::new`], in the memory of the last graph.
    pub(crate) fn build(&mut self, points: &[[f64; D]], neighbourhood: Neighbourhood) {
        let radius = match neighbourhood {
            Neighbourhood::MedianRadius => median_pairwise_distance(points),
            Neighbourhood::Nearest(_) => None,
        };
        let reach = radius.map_or(0.0, |r| r + rounding(points, r));
        self.edges.clear();
        self.starts.clear();
        self.starts.push(0);
        for (i, point) in points.iter().enumerate() {
            let length = |a: usize| Edge::new(point, a, &points[a]).length;
            self.order.clear();
            self.order.extend((0..points.len()).filter(|&a| a != i));
            match neighbourhood {
                Neighbourhood::MedianRadius => self.order.retain(|&a| length(a) <= reach),
                Neighbourhood::Nearest(k) if k < self.order.len() => {
                    let nearer =
                        |a: &usize, b: &usize| length(*a).total_cmp(&length(*b)).then(a.cmp(b));
                    self.order.select_nth_unstable_by(k, nearer);
                    self.order.truncate(k);
                    self.order.sort_unstable();
                }
                Neighbourhood::Nearest(_) => {}
            }
            let first = self.edges.len();
            let edges = self.order.iter();
            self.edges
                .extend(edges.map(|&a| Edge::new(point, a, &points[a])));
            let longest = longest(&self.edges[first..]);
            for edge in &mut self.edges[first..] {
                edge.gamma = gamma(edge.length, longest);
            }
            self.starts.push(self.edges.len());
        }
    }

    /// The edges of point `i`.
    pub(crate) fn of(&self, i: usize) -> &[Edge<D>] {
        &self.edges[self.starts[i]..self.starts[i + 1]]
    }

    /// Number of points.
    pub(crate) fn points(&self) -> usize {
        self.starts.len() - 1
    }

    /// Length of the longest edge. Zero if there are no edges.
    pub(crate) fn longest(&self) -> f64 {
        longest(&self.edges)
    }
}

fn longest<const D: usize>(edges: &[Edge<D>]) -> f64 {
    edges.iter().fold(0.0_f64, |m, e| m.max(e.length))
}

/// Bound on the rounding error of a distance of about `radius`: the coordinates themselves are
/// rounded to half a unit in the last place.
fn rounding<const D: usize>(points: &[[f64; D]], radius: f64) -> f64 {
    let coordinates = points.as_flattened().iter();
    let largest = coordinates.fold(radius, |m, c| m.max(c.abs()));
    f64::EPSILON * (largest + largest)
}

/// The median of all pairwise distances (the mean of the two middle distances if their number is
/// even). `None` for fewer than two points. `O(n² log n)`.
pub(super) fn median_pairwise_distance<const D: usize>(points: &[[f64; D]]) -> Option<f64> {
    let mut distances = Vec::with_capacity(points.len() * points.len().saturating_sub(1) / 2);
    for (i, p) in points.iter().enumerate() {
        let later = points[i + 1..].iter();
        distances.extend(later.map(|q| Edge::new(p, 0, q).length));
    }
    distances.sort_by(f64::total_cmp);
    let n = distances.len();
    match n {
        0 => None,
        n if n % 2 == 1 => Some(distances[n / 2]),
        n => Some((distances[n / 2 - 1] + distances[n / 2]) * 0.5),
    }
}

/// α (15), with the maximum per pair: `1 − |d − e| / max(d, e) = min(d, e) / max(d, e)`. Two
/// lengths of zero count as equal.
///
/// The quotient keeps its digits if the lengths differ by many decades, whereas the printed
/// difference loses them.
pub(crate) fn alpha(d: f64, e: f64) -> f64 {
    let longer = d.max(e);
    if longer > 0.0 { d.min(e) / longer } else { 1.0 }
}

/// α (15), with the maximum over all edges: `1 − |d − e| / longest`. One if `longest` is zero.
pub(super) fn alpha_global(d: f64, e: f64, longest: f64) -> f64 {
    if longest > 0.0 {
        1.0 - (d - e).abs() / longest
    } else {
        1.0
    }
}

/// β (16): `1 − ∠(u, v) / π`, one for parallel and zero for opposite edges, in any dimension. Zero
/// if an edge has length zero.
///
/// The angle is `atan2(|u ∧ v|, u · v)`, which is exact at 0 and π. `acos` would lose half the
/// digits there or return NaN.
pub(crate) fn beta<const D: usize>(u: &SVector<f64, D>, v: &SVector<f64, D>) -> f64 {
    // Scaling the largest components to one prevents underflow and overflow of the squares, and
    // keeps parallel vectors exactly parallel.
    let (largest_u, largest_v) = (u.amax(), v.amax());
    if largest_u <= 0.0 || largest_v <= 0.0 {
        return 0.0;
    }
    let (u, v) = (u / largest_u, v / largest_v);
    let mut wedge = 0.0;
    for p in 0..D {
        for q in p + 1..D {
            let minor = u[p] * v[q] - u[q] * v[p];
            wedge += minor * minor;
        }
    }
    // π − ∠(u, v) = ∠(u, −v), so nearly opposite edges keep the digits of a small β.
    wedge.sqrt().atan2(-u.dot(&v)) / std::f64::consts::PI
}

/// γ (17): `1 − d / longest`, with `longest` among the edges of the same point. One if `longest` is
/// zero.
fn gamma(d: f64, longest: f64) -> f64 {
    if longest > 0.0 {
        (longest - d) / longest
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests;
