//! Pairs from the surroundings of the points: shape contexts propose candidates, relaxation
//! labelling decides.

use crate::Watch;
use crate::labelling::Neighbourhood;
use crate::labelling::graph::{Edge, NeighbourGraph, alpha, beta};
use crate::labelling::matrix::{Links, MatchMatrix};
use crate::shape_context::ShapeContexts;
use std::ops::ControlFlow;

/// Radius of the shape contexts, in radii of the model.
const RADIUS: f64 = 2.0;
/// Candidates per model point.
const CANDIDATES: usize = 10;
/// Initial weight of the slack.
const SLACK: f64 = 0.1;
/// Constant gain of the slack, relative to a full support of one.
const SLACK_GAIN: f64 = 0.05;
/// Neighbours per model point.
const NEIGHBOURS: usize = 8;
/// Maximum number of sweeps.
const SWEEPS: usize = 12;

/// Working memory of the search for pairs.
#[derive(Clone, Debug, Default)]
pub(super) struct Correspondence<const D: usize> {
    model_contexts: ShapeContexts,
    target_contexts: ShapeContexts,
    costs: Vec<f32>,
    order: Vec<usize>,
    labels: MatchMatrix,
    graph: NeighbourGraph<D>,
    links: Links,
    support: Vec<f64>,
    /// The likeliest target of each model point, with its probability.
    pub(super) pairs: Vec<(usize, f64)>,
}

impl<const D: usize> Correspondence<D> {
    /// Finds `pairs` for model points in place.
    pub(super) fn find(
        &mut self,
        model: &[[f64; D]],
        target: &[[f64; D]],
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        self.propose(model, target, watch)?;
        self.relax(model, target, watch)?;
        let likeliest = |i| {
            self.labels.row(i).fold(
                (0, 0.0),
                |best: (usize, f64), entry| if entry.1 > best.1 { entry } else { best },
            )
        };
        self.pairs.clear();
        self.pairs.extend((0..model.len()).map(likeliest));
        ControlFlow::Continue(())
    }

    /// Selects the candidates with the lowest shape-context cost, with first probabilities.
    fn propose(
        &mut self,
        model: &[[f64; D]],
        target: &[[f64; D]],
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        self.model_contexts.build(model, RADIUS);
        self.target_contexts.build(target, RADIUS);
        self.labels.reset(target.iter().map(|_| SLACK));
        for i in 0..model.len() {
            watch()?;
            self.model_contexts
                .costs_into(i, &self.target_contexts, &mut self.costs);
            let costs = &self.costs;
            self.order.clear();
            self.order.extend(0..target.len());
            let kept = CANDIDATES.min(target.len());
            if kept < self.order.len() {
                let by_cost = |a: &usize, b: &usize| costs[*a].total_cmp(&costs[*b]).then(a.cmp(b));
                self.order.select_nth_unstable_by(kept - 1, by_cost);
            }
            self.order.truncate(kept);
            let least = self
                .order
                .iter()
                .map(|&j| costs[j])
                .fold(f32::MAX, f32::min);
            // A χ² distance larger by 0.05 lowers the probability by a factor e.
            let raw = |j: usize| (-f64::from(costs[j] - least) / 0.05).exp();
            let sum: f64 = self.order.iter().map(|&j| raw(j)).sum();
            self.labels.push_row(
                self.order
                    .iter()
                    .map(|&j| (j, (1.0 - SLACK) * raw(j) / sum)),
                SLACK,
            );
        }
        ControlFlow::Continue(())
    }

    /// Relaxation over nearest neighbours with the compatibility αβ⁴ (0.3 + 0.7 γ): (15) with the
    /// maximum per pair, and (16) to the fourth power, because the edges of a neighbourhood differ
    /// in direction more than in length.
    fn relax(
        &mut self,
        model: &[[f64; D]],
        target: &[[f64; D]],
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        self.graph.build(model, Neighbourhood::Nearest(NEIGHBOURS));
        let share = 1.0 / NEIGHBOURS.min(model.len() - 1) as f64;
        let compatibility = |x: &Edge<D>, j: usize, b: usize| {
            if j == b {
                return 0.0;
            }
            let y = Edge::new(&target[j], b, &target[b]);
            let beta = beta(&x.vector, &y.vector);
            alpha(x.length, y.length) * beta.powi(4) * (0.3 + 0.7 * x.gamma) * share
        };
        self.links
            .build(&self.labels, &self.graph, compatibility, watch)?;
        for _ in 0..SWEEPS {
            let of = |_, pair| self.links.support(&self.labels, pair);
            self.labels.support(&mut self.support, of, watch)?;
            self.labels.update(&self.support, SLACK_GAIN);
            (0..2).for_each(|_| self.labels.normalise());
            if self.labels.is_settled(0.999) {
                break;
            }
        }
        ControlFlow::Continue(())
    }
}
