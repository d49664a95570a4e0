//! Relaxation (13)–(20): graphs, compatibilities, support, update and normalisation.

use super::{Compatibility, LengthMaximum, Neighbourhood, RelaxationLabelling};
use crate::{ShapeContexts, Watch};
use nalgebra::{Point, SVector};
use std::ops::ControlFlow;

/// Maximum number of links stored between sweeps. If there are more, each sweep computes them
/// again.
const MAX_STORED_LINKS: usize = 1 << 25;

/// The edge from a point to one of its neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Edge<const D: usize> {
    /// Row of the point.
    pub from: usize,
    /// Row of its neighbour.
    pub to: usize,
    /// Position of the neighbour relative to the point.
    pub vector: SVector<f64, D>,
    /// Its length `d`.
    pub length: f64,
    /// The value of [`gamma`] for this edge among the edges of its point.
    pub gamma: f64,
}

/// A point set as a graph: each point with the edges to its neighbours.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NeighbourGraph<const D: usize> {
    edges: Vec<Edge<D>>,
    starts: Vec<usize>,
}

impl<const D: usize> NeighbourGraph<D> {
    /// Joins each point to its neighbours. `O(n² log n)`.
    pub(super) fn new(points: &[Point<f64, D>], neighbourhood: Neighbourhood) -> Self {
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
                    neighbours.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
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

    /// The edges of point `i`.
    ///
    /// # Panics
    /// If there is no such point.
    fn of(&self, i: usize) -> &[Edge<D>] {
        &self.edges[self.range(i)]
    }

    /// Index range of the edges of point `i` in [`edges`](Self::edges).
    fn range(&self, i: usize) -> std::ops::Range<usize> {
        self.starts[i]..self.starts[i + 1]
    }

    /// Number of points.
    fn points(&self) -> usize {
        self.starts.len() - 1
    }

    /// Length of the longest edge. Zero if there are no edges.
    fn longest(&self) -> f64 {
        self.edges.iter().fold(0.0_f64, |m, e| m.max(e.length))
    }
}

/// Bound on the rounding error of a distance of about `radius`: the coordinates themselves are
/// rounded to half a unit in the last place.
fn rounding<const D: usize>(points: &[Point<f64, D>], radius: f64) -> f64 {
    let largest = points
        .iter()
        .flat_map(|p| p.iter())
        .fold(radius, |m, c| m.max(c.abs()));
    f64::EPSILON * (largest + largest)
}

/// The median of all pairwise distances (the mean of the two middle distances if their number is
/// even). `None` for fewer than two points. `O(n² log n)`.
fn median_pairwise_distance<const D: usize>(points: &[Point<f64, D>]) -> Option<f64> {
    let mut distances = Vec::with_capacity(points.len() * points.len().saturating_sub(1) / 2);
    for (i, p) in points.iter().enumerate() {
        distances.extend(points[i + 1..].iter().map(|q| (q - p).norm()));
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
fn alpha(d: f64, e: f64) -> f64 {
    let longer = d.max(e);
    if longer > 0.0 { d.min(e) / longer } else { 1.0 }
}

/// α (15), with the maximum over all edges: `1 − |d − e| / longest`. One if `longest` is zero.
fn alpha_global(d: f64, e: f64, longest: f64) -> f64 {
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
fn beta<const D: usize>(u: &SVector<f64, D>, v: &SVector<f64, D>) -> f64 {
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

/// A [`Compatibility`] ready for evaluation: the factors and the maximum in α.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CompatibilityRule {
    /// The factors.
    pub factors: Compatibility,
    /// Longest edge of both graphs for [`alpha_global`]. `None` selects [`alpha`].
    pub longest: Option<f64>,
}

impl CompatibilityRule {
    /// The compatibility r (18) of model edge `x` and target edge `y`.
    fn of<const D: usize>(&self, x: &Edge<D>, y: &Edge<D>) -> f64 {
        let length = || match self.longest {
            None => alpha(x.length, y.length),
            Some(longest) => alpha_global(x.length, y.length, longest),
        };
        match self.factors {
            Compatibility::Count => 1.0,
            Compatibility::Length => length(),
            Compatibility::LengthDirection => length() * beta(&x.vector, &y.vector),
            Compatibility::Printed => length() * beta(&x.vector, &y.vector) * x.gamma,
            Compatibility::Full => length() * beta(&x.vector, &y.vector) * x.gamma * y.gamma,
        }
    }
}

/// The match matrix `M` of the paper, `(I + 1) × (J + 1)`, row-major: entry `(i, j)` is the
/// probability that model point `i` corresponds to target point `j`. Row `I` and column `J` are the
/// slack for points without a partner. The corner `(I, J)` is not used.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MatchMatrix {
    rows: usize,
    columns: usize,
    entries: Vec<f64>,
}

impl MatchMatrix {
    /// All entries zero.
    pub(super) fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            entries: vec![0.0; (rows + 1) * (columns + 1)],
        }
    }

    /// Fills the matrix entry by entry, `i` in `0..=rows` and `j` in `0..=columns`. The corner is
    /// set to zero.
    fn from_fn(rows: usize, columns: usize, mut entry: impl FnMut(usize, usize) -> f64) -> Self {
        let mut m = Self::zeros(rows, columns);
        for i in 0..=rows {
            for j in 0..=columns {
                if (i, j) != (rows, columns) {
                    m[(i, j)] = entry(i, j);
                }
            }
        }
        m
    }

    /// Row `i` with its slack entry last. Row `I` is the slack row.
    ///
    /// # Panics
    /// If `i` exceeds the number of rows.
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.entries[i * (self.columns + 1)..][..=self.columns]
    }

    fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.entries[i * (self.columns + 1)..][..=self.columns]
    }

    /// The largest change of an entry, `max |M − M'|`. The matrices must have the same size.
    fn largest_change(&self, other: &Self) -> f64 {
        self.entries
            .iter()
            .zip(&other.entries)
            .fold(0.0, |worst, (&a, &b)| worst.max((a - b).abs()))
    }
}

impl std::ops::Index<(usize, usize)> for MatchMatrix {
    type Output = f64;
    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        debug_assert!(j <= self.columns);
        &self.entries[i * (self.columns + 1) + j]
    }
}

impl std::ops::IndexMut<(usize, usize)> for MatchMatrix {
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        debug_assert!(j <= self.columns);
        &mut self.entries[i * (self.columns + 1) + j]
    }
}

/// The energy (14), `Σ_i Σ_{a∈N(i)} Σ_j Σ_{b∈N(j)} M_ij M_ab`: the number of edges that the match
/// preserves, each counted from both ends, without the slack. `O(A B)` for each of the at most
/// `I J` non-zero entries.
///
/// # Panics
/// If the size of `m` does not match the graphs.
pub(super) fn energy<const D: usize>(
    m: &MatchMatrix,
    model: &NeighbourGraph<D>,
    target: &NeighbourGraph<D>,
    watch: Watch<'_>,
) -> ControlFlow<(), f64> {
    assert_eq!(
        (m.rows, m.columns),
        (model.points(), target.points()),
        "size of M"
    );
    let mut energy = 0.0;
    for i in 0..m.rows {
        for j in (0..m.columns).filter(|&j| m[(i, j)] > 0.0) {
            watch()?;
            let mut kept = 0.0;
            for a in model.of(i) {
                let row = m.row(a.to);
                kept = target.of(j).iter().fold(kept, |sum, b| sum + row[b.to]);
            }
            energy += m[(i, j)] * kept;
        }
    }
    ControlFlow::Continue(energy)
}

/// Update (20): each model row becomes `[M_ij S_ij, M_i,slack · slack_gain]` divided by its sum.
/// Returns the rows whose sum was zero; they are not changed. `support` is row-major `I × J`. The
/// slack row is not changed.
///
/// Each product is divided by the largest in its row first, so that none underflows or overflows.
///
/// # Panics
/// If `support` does not have `I · J` entries.
fn update(m: &mut MatchMatrix, support: &[f64], slack_gain: f64) -> Vec<usize> {
    let columns = m.columns;
    assert_eq!(support.len(), m.rows * columns, "size of the support");
    let mut zero_rows = Vec::new();
    for i in 0..m.rows {
        let gains = support[i * columns..][..columns]
            .iter()
            .copied()
            .chain([slack_gain]);
        let entries = m.row(i).iter().copied();
        let largest = entries
            .zip(gains.clone())
            .fold(None, |best, (p, s)| match best {
                _ if p <= 0.0 || s <= 0.0 => best,
                Some((_, _, log)) if p.ln() + s.ln() <= log => best,
                _ => Some((p, s, p.ln() + s.ln())),
            });
        let Some((largest_p, largest_s, largest_log)) = largest else {
            zero_rows.push(i);
            continue;
        };
        let row = m.row_mut(i);
        for (p, s) in row.iter_mut().zip(gains) {
            let product = (*p / largest_p) * (s / largest_s);
            *p = if *p <= 0.0 || s <= 0.0 {
                0.0
            } else if product.is_finite() {
                product
            } else {
                (p.ln() + s.ln() - largest_log).exp() // one quotient overflowed
            };
        }
        divide_by_sum(row);
    }
    zero_rows
}

/// Alternating normalisation with slack. Each sweep divides the rows `0..I` by their sums over
/// `J + 1` entries, then the columns `0..J` by their sums over `I + 1` entries. The slack row and
/// column are not normalised, and sums of zero are skipped. It stops after `sweeps`, or when each
/// row sum is within `tolerance` of one. Returns `max_i |1 − Σ_j M_ij|` (the columns sum to one).
fn sinkhorn(m: &mut MatchMatrix, sweeps: usize, tolerance: f64) -> f64 {
    for _ in 0..sweeps {
        for i in 0..m.rows {
            divide_by_sum(m.row_mut(i));
        }
        for j in 0..m.columns {
            let sum = (0..=m.rows).fold(0.0, |sum, i| sum + m[(i, j)]);
            if sum > 0.0 {
                (0..=m.rows).for_each(|i| m[(i, j)] /= sum);
            }
        }
        if row_defect(m) <= tolerance {
            break;
        }
    }
    row_defect(m)
}

fn divide_by_sum(row: &mut [f64]) {
    let sum: f64 = row.iter().sum();
    if sum > 0.0 {
        row.iter_mut().for_each(|p| *p /= sum);
    }
}

fn row_defect(m: &MatchMatrix) -> f64 {
    (0..m.rows).fold(0.0, |worst, i| {
        worst.max((1.0 - m.row(i).iter().sum::<f64>()).abs())
    })
}

/// Shape contexts with a radius of twice the mean pairwise distance. `None` if all points coincide.
fn contexts<const D: usize>(points: &[Point<f64, D>]) -> Option<ShapeContexts> {
    let distances = points
        .iter()
        .flat_map(|p| points.iter().map(move |q| (q - p).norm()));
    let sum: f64 = distances.sum();
    let pairs = points.len() * points.len().saturating_sub(1);
    ShapeContexts::new(points, 2.0 * sum / (pairs.max(1) as f64)).ok()
}

/// The first match matrix: `exp(−C_ij / temperature)` of the shape-context distances `C`. The slack
/// entries are `slack` times the entry of the likeliest partner. One sweep of [`sinkhorn`] follows.
/// `O(I J)` times the number of bins.
fn first_matches<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    temperature: f64,
    slack: f64,
) -> MatchMatrix {
    let contexts = contexts(model).zip(contexts(target));
    let cost = |i, j| {
        contexts
            .as_ref()
            .map_or(0.0, |(g, h)| f64::from(g.cost(i, h, j)))
    };
    let costs: Vec<Vec<f64>> = (0..model.len())
        .map(|i| (0..target.len()).map(|j| cost(i, j)).collect())
        .collect();
    let least = |row: &[f64]| row.iter().copied().fold(f64::INFINITY, f64::min);
    let columns = target.len();
    let mut m = MatchMatrix::from_fn(model.len(), columns, |i, j| match costs.get(i) {
        Some(row) if j < columns => (-(row[j] - least(row)) / temperature).exp(),
        _ => slack,
    });
    sinkhorn(&mut m, 1, 0.0);
    m
}

/// The match matrix of one outer iteration: first probabilities of `model` (as warped so far) and
/// `target`, then (19), (20) and normalisation in turn until M converges.
///
/// If the options limit the candidates, all but the likeliest are zero, which (20) preserves.
pub(super) fn relax<const D: usize>(
    options: &RelaxationLabelling,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    watch: Watch<'_>,
) -> ControlFlow<(), MatchMatrix> {
    let graphs = [model, target].map(|points| NeighbourGraph::new(points, options.neighbourhood));
    let longest = match options.length_maximum {
        LengthMaximum::PerPair => None,
        LengthMaximum::Global => Some(graphs[0].longest().max(graphs[1].longest())),
    };
    let rule = CompatibilityRule {
        factors: options.compatibility,
        longest,
    };
    let mut m = first_matches(model, target, options.temperature, options.slack);
    if let Some(count) = options.candidates {
        keep_likeliest(&mut m, count);
    }
    let links = Links::new(&m, &graphs, rule, watch)?;
    for _ in 0..options.sweeps {
        let before = m.clone();
        let support = links.support(&m, watch)?;
        let gain = slack_gain(&support, m.columns, options.slack);
        update(&mut m, &support, gain);
        sinkhorn(&mut m, options.sinkhorn_sweeps, 0.0);
        if m.largest_change(&before) <= options.tolerance {
            break;
        }
    }
    ControlFlow::Continue(m)
}

/// Gain of the slack: a fraction of the best partners' support, so that it means the same for every
/// neighbourhood.
fn slack_gain(support: &[f64], columns: usize, share: f64) -> f64 {
    let rows = support.len() / columns;
    let best = support
        .chunks_exact(columns)
        .map(|row| row.iter().fold(0.0_f64, |m, &s| m.max(s)));
    best.fold(0.0, |sum, s| sum + s) * (share / rows as f64)
}

/// The target that holds the whole row, if no other can recover: the others are below a hundred
/// roundings.
fn settled_on(row: &[f64]) -> Option<usize> {
    let sum: f64 = row.iter().sum();
    let enough = sum * (1.0 - 50.0 * f64::EPSILON);
    row[..row.len() - 1]
        .iter()
        .position(|&p| p > 0.0 && p >= enough)
}

/// Sets all but the `count` likeliest partners of each model point to zero. Among equal ones the
/// lower rows are kept.
fn keep_likeliest(m: &mut MatchMatrix, count: usize) {
    let columns = m.columns;
    let mut order: Vec<usize> = Vec::with_capacity(columns);
    for i in 0..m.rows {
        order.clear();
        order.extend(0..columns);
        let row = m.row_mut(i);
        order.sort_unstable_by(|&a, &b| row[b].total_cmp(&row[a]).then(a.cmp(&b)));
        order.iter().skip(count).for_each(|&j| row[j] = 0.0);
    }
}

/// The terms of the support (19): for each candidate pair `(i, j)` the entries `M_ab` of its
/// neighbours' candidate pairs, with their compatibilities, which do not depend on M.
struct Links<'a, const D: usize> {
    graphs: &'a [NeighbourGraph<D>; 2],
    rule: CompatibilityRule,
    /// Candidates of each model point.
    candidates: Vec<Vec<usize>>,
    /// Start of the links of each candidate pair, and the end of the last pair's links. Empty if
    /// there are too many links to store.
    starts: Vec<usize>,
    /// Positions in M and compatibilities.
    stored: Vec<(u32, f64)>,
}

impl<'a, const D: usize> Links<'a, D> {
    fn new(
        m: &MatchMatrix,
        graphs: &'a [NeighbourGraph<D>; 2],
        rule: CompatibilityRule,
        watch: Watch<'_>,
    ) -> ControlFlow<(), Self> {
        assert_eq!(
            (m.rows, m.columns),
            (graphs[0].points(), graphs[1].points()),
            "size of M"
        );
        let candidates = |i: usize| (0..m.columns).filter(|&j| m[(i, j)] > 0.0).collect();
        let mut links = Self {
            graphs,
            rule,
            candidates: (0..m.rows).map(candidates).collect(),
            starts: Vec::new(),
            stored: Vec::new(),
        };
        let edges = |i: usize| graphs[0].of(i).iter();
        let products = (0..m.rows).map(|i| {
            let offered: usize = edges(i).map(|x| links.candidates[x.to].len()).sum();
            links.candidates[i].len() * offered
        });
        if products.sum::<usize>() <= 2 * MAX_STORED_LINKS {
            links.store(watch)?;
        }
        ControlFlow::Continue(links)
    }

    fn store(&mut self, watch: Watch<'_>) -> ControlFlow<()> {
        let (mut starts, mut stored) = (vec![0], Vec::new());
        let width = self.graphs[1].points() + 1;
        for i in 0..self.candidates.len() {
            for &j in &self.candidates[i] {
                watch()?;
                self.visit(i, j, |a, b, r| stored.push(((a * width + b) as u32, r)));
                starts.push(stored.len());
            }
        }
        (self.starts, self.stored) = (starts, stored);
        ControlFlow::Continue(())
    }

    /// Calls `take` with each pair `(a, b)` that supports pair `(i, j)`, and its compatibility.
    fn visit(&self, i: usize, j: usize, mut take: impl FnMut(usize, usize, f64)) {
        let mut edge_to = vec![None; self.graphs[1].points()];
        for edge in self.graphs[1].of(j) {
            edge_to[edge.to] = Some(edge);
        }
        for x in self.graphs[0].of(i) {
            for &b in &self.candidates[x.to] {
                if let Some(y) = edge_to[b] {
                    take(x.to, b, self.rule.of(x, y));
                }
            }
        }
    }

    /// The support (19) of the candidate pairs, row-major `I × J`, and zero for all others:
    /// `S_ij = Σ_{a∈N(i)} Σ_{b∈N(j)} M_ab r(ia, jb)`.
    ///
    /// A point whose match is settled to rounding keeps the support of that pair alone.
    fn support(&self, m: &MatchMatrix, watch: Watch<'_>) -> ControlFlow<(), Vec<f64>> {
        let mut support = vec![0.0; m.rows * m.columns];
        let mut pair = 0;
        for (i, candidates) in self.candidates.iter().enumerate() {
            let settled = settled_on(m.row(i));
            for &j in candidates {
                watch()?;
                let sum = &mut support[i * m.columns + j];
                let links = self.starts.get(pair..pair + 2);
                pair += 1;
                if settled.is_some_and(|on| on != j) {
                    continue;
                }
                match links {
                    Some(ends) => {
                        let links = self.stored[ends[0]..ends[1]].iter();
                        *sum = links.map(|&(at, r)| m.entries[at as usize] * r).sum();
                    }
                    None => self.visit(i, j, |a, b, r| *sum += m[(a, b)] * r),
                }
            }
        }
        ControlFlow::Continue(support)
    }
}

#[cfg(test)]
mod tests;
