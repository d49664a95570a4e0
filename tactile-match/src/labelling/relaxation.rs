//! The match matrix of one outer iteration: first probabilities, then (19), (20) and normalisation
//! until it converges.

use super::graph::{Edge, NeighbourGraph, alpha, alpha_global, beta};
use super::matrix::{Links, MatchMatrix};
use super::{Compatibility, LengthMaximum, RelaxationLabelling};
use crate::{ShapeContexts, Watch};
use nalgebra::Point;
use std::ops::ControlFlow;

/// Maximum number of products of candidates for which links are stored between sweeps (12 bytes
/// each, of which about half are links). If there are more, each sweep computes them again.
const MAX_STORED: usize = 1 << 26;

/// A [`Compatibility`] ready for evaluation: the factors and the maximum in α.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CompatibilityRule {
    /// The factors.
    factors: Compatibility,
    /// Longest edge of both graphs for [`alpha_global`]. `None` selects [`alpha`].
    longest: Option<f64>,
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

/// The edges of a graph by both ends.
struct EdgeTable<'a, const D: usize> {
    graph: &'a NeighbourGraph<D>,
    /// One more than the place of edge `(j, b)` among those of `j`, row-major. Zero if there is
    /// none.
    places: Vec<u32>,
}

impl<'a, const D: usize> EdgeTable<'a, D> {
    fn new(graph: &'a NeighbourGraph<D>) -> Self {
        let n = graph.points();
        let mut places = vec![0; n * n];
        for j in 0..n {
            for (place, edge) in (1..).zip(graph.of(j)) {
                places[j * n + edge.to] = place;
            }
        }
        Self { graph, places }
    }

    /// The edge from `j` to `b`.
    fn between(&self, j: usize, b: usize) -> Option<&Edge<D>> {
        let place = self.places[j * self.graph.points() + b];
        (place > 0).then(|| &self.graph.of(j)[place as usize - 1])
    }
}

/// The energy (14), `Σ_i Σ_{a∈N(i)} Σ_j Σ_{b∈N(j)} M_ij M_ab`: the number of edges that the match
/// preserves, each counted from both ends, without the slack. `O(A B)` for each candidate pair.
fn energy<const D: usize>(
    m: &MatchMatrix,
    model: &NeighbourGraph<D>,
    target: &EdgeTable<'_, D>,
    watch: Watch<'_>,
) -> ControlFlow<(), f64> {
    let joined = |_: &Edge<D>, j, b| f64::from(target.between(j, b).is_some());
    let mut energy = 0.0;
    for i in 0..m.rows() {
        watch()?;
        for (j, p) in m.row(i).filter(|pair| pair.1 > 0.0) {
            let mut kept = 0.0;
            m.supporters(model.of(i), j, &joined, |pair, _| {
                kept += m.probability(pair);
            });
            energy += p * kept;
        }
    }
    ControlFlow::Continue(energy)
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
    let mut m = MatchMatrix::default();
    m.reset(target.iter().map(|_| slack));
    for row in &costs {
        let least = least(row);
        let raw = row.iter().map(|c| (-(c - least) / temperature).exp());
        m.push_row(raw.enumerate(), slack);
    }
    m.normalise();
    m
}

/// The match matrix of one outer iteration, and its energy (14): first probabilities of `model` (as
/// warped so far) and `target`, then (19), (20) and normalisation in turn until M converges.
///
/// If the options limit the candidates, all but the likeliest are zero, which (20) preserves.
pub(super) fn relax<const D: usize>(
    options: &RelaxationLabelling,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    watch: Watch<'_>,
) -> ControlFlow<(), (MatchMatrix, f64)> {
    let graphs = [model, target].map(|points| {
        let points: Vec<[f64; D]> = points.iter().map(|p| p.coords.into()).collect();
        NeighbourGraph::new(&points, options.neighbourhood)
    });
    let longest = match options.length_maximum {
        LengthMaximum::PerPair => None,
        LengthMaximum::Global => Some(graphs[0].longest().max(graphs[1].longest())),
    };
    let rule = CompatibilityRule {
        factors: options.compatibility,
        longest,
    };
    let (graph, table) = (&graphs[0], EdgeTable::new(&graphs[1]));
    let mut m = first_matches(model, target, options.temperature, options.slack);
    if let Some(count) = options.candidates {
        m.keep_likeliest(count);
    }
    let compatibility = |x: &Edge<D>, j, b| table.between(j, b).map_or(0.0, |y| rule.of(x, y));
    let mut links = None;
    if products(&m, graph) <= MAX_STORED {
        let stored: &mut Links = links.get_or_insert_default();
        stored.build(&m, graph, compatibility, watch)?;
    }
    let mut support = Vec::new();
    for _ in 0..options.sweeps {
        let before = m.clone();
        let of = |i, pair| match &links {
            Some(links) => links.support(&m, pair),
            None => m.support_of(graph.of(i), pair, &compatibility),
        };
        m.support(&mut support, of, watch)?;
        m.update(&support, slack_gain(&m, &support, options.slack));
        (0..options.sinkhorn_sweeps).for_each(|_| m.normalise());
        if m.largest_change(&before) <= options.tolerance {
            break;
        }
    }
    let energy = energy(&m, graph, &table, watch)?;
    ControlFlow::Continue((m, energy))
}

/// Number of products of a candidate pair and a candidate pair of a neighbour.
fn products<const D: usize>(m: &MatchMatrix, model: &NeighbourGraph<D>) -> usize {
    let candidates = |i| m.row(i).count();
    let offered = |i| model.of(i).iter().map(|x| candidates(x.to)).sum::<usize>();
    (0..m.rows()).map(|i| candidates(i) * offered(i)).sum()
}

/// Gain of the slack: a fraction of the best partners' support, so that it means the same for every
/// neighbourhood.
fn slack_gain(m: &MatchMatrix, support: &[f64], share: f64) -> f64 {
    let mut support = support.iter();
    let best = (0..m.rows()).map(|i| {
        let row = support.by_ref().take(m.row(i).count());
        row.fold(0.0_f64, |m, &s| m.max(s))
    });
    best.sum::<f64>() * (share / m.rows() as f64)
}

#[cfg(test)]
mod tests;
