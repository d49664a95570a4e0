//! Pairs from the surroundings of the points: shape contexts propose candidates, relaxation
//! labelling decides.

use super::{difference, dot, squared, squared_distance};
use crate::Watch;
use crate::shape_context::ShapeContexts;
use std::f64::consts::PI;
use std::ops::ControlFlow;

/// Radius of the shape contexts, in radii of the model.
const RADIUS: f64 = 2.0;
/// Initial weight and constant gain of the slack.
const SLACK: f64 = 0.1;

/// Working memory of the search for pairs.
#[derive(Clone, Debug, Default)]
pub(super) struct Correspondence {
    model_contexts: ShapeContexts,
    target_contexts: ShapeContexts,
    costs: Vec<f32>,
    order: Vec<usize>,
    labels: CandidateLabels,
    neighbours: Vec<usize>,
    reach: Vec<f64>,
    /// The likeliest target of each model point, with its probability.
    pub(super) pairs: Vec<(usize, f64)>,
}

impl Correspondence {
    /// Finds `pairs` for model points in place.
    pub(super) fn find<const D: usize>(
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
    fn propose<const D: usize>(
        &mut self,
        model: &[[f64; D]],
        target: &[[f64; D]],
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        self.model_contexts.build(model, RADIUS);
        self.target_contexts.build(target, RADIUS);
        self.labels.reset(target.len(), SLACK);
        for i in 0..model.len() {
            watch()?;
            self.model_contexts
                .costs_into(i, &self.target_contexts, &mut self.costs);
            let costs = &self.costs;
            self.order.clear();
            self.order.extend(0..target.len());
            // Candidates per model point.
            let kept = 10.min(target.len());
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

    /// Relaxation with the paper's compatibilities over nearest neighbours.
    fn relax<const D: usize>(
        &mut self,
        model: &[[f64; D]],
        target: &[[f64; D]],
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        let kept = self.find_neighbours(model, watch)?;
        let (neighbours, reach) = (&self.neighbours, &self.reach);
        let near = |i: usize| &neighbours[i * kept..(i + 1) * kept];
        let weight = |(i, j): (usize, usize), (a, b): (usize, usize)| {
            if j == b {
                return 0.0;
            }
            let (u, v) = (
                difference(&model[a], &model[i]),
                difference(&target[b], &target[j]),
            );
            let gamma = 1.0 - 0.7 * squared(&u).sqrt() / reach[i];
            compatibility(&u, &v) * gamma / kept as f64
        };
        self.labels.link(weight, near);
        for _ in 0..12 {
            watch()?;
            self.labels.sweep(0.05, 2);
            if self.labels.is_settled(0.999) {
                break;
            }
        }
        ControlFlow::Continue(())
    }

    /// Lists the nearest neighbours of each model point. Returns the number of neighbours per
    /// point.
    fn find_neighbours<const D: usize>(
        &mut self,
        model: &[[f64; D]],
        watch: Watch<'_>,
    ) -> ControlFlow<(), usize> {
        // Neighbours per model point.
        let kept = 8.min(model.len() - 1);
        self.neighbours.clear();
        self.reach.clear();
        for (i, x) in model.iter().enumerate() {
            watch()?;
            self.order.clear();
            self.order.extend((0..model.len()).filter(|&a| a != i));
            let distance = |a: usize| squared_distance(&model[a], x).sqrt();
            if kept > 0 {
                self.order.select_nth_unstable_by(kept - 1, |&a, &b| {
                    distance(a).total_cmp(&distance(b)).then(a.cmp(&b))
                });
            }
            self.order.truncate(kept);
            self.reach.push(
                self.order
                    .iter()
                    .map(|&a| distance(a))
                    .fold(f64::MIN_POSITIVE, f64::max),
            );
            self.neighbours.extend_from_slice(&self.order);
        }
        ControlFlow::Continue(kept)
    }
}

/// αβ⁴ of two edges: (15) with the maximum per pair, and (16) to the fourth power, because the
/// edges of a neighbourhood differ in direction more than in length.
fn compatibility<const D: usize>(u: &[f64; D], v: &[f64; D]) -> f64 {
    let (p, q) = (squared(u).sqrt(), squared(v).sqrt());
    if p == 0.0 || q == 0.0 {
        return 0.0;
    }
    let cosine = dot(u, v) / (p * q);
    let beta = 1.0 - cosine.clamp(-1.0, 1.0).acos() / PI;
    p.min(q) / p.max(q) * beta.powi(4)
}

// Relaxation labelling over candidates: the paper's update (19)–(20) as a sparse matrix–vector
// product.
//
// Only some pairs `(i, j)` are candidates; the match matrix stores these pairs and the slack. The
// contribution of pair `(a, b)` to pair `(i, j)` does not depend on M: these links are computed
// once, and a sweep costs one multiplication per link instead of `O(I J A B)`. With all pairs as
// candidates the numbers are those of [`labelling`](crate::labelling).

/// The match matrix over candidate pairs, with the links between them.
#[derive(Clone, Debug, Default)]
struct CandidateLabels {
    starts: Vec<usize>,
    columns: Vec<usize>,
    entries: Vec<f64>,
    row_slack: Vec<f64>,
    column_slack: Vec<f64>,
    link_starts: Vec<usize>,
    link_from: Vec<u32>,
    link_weight: Vec<f64>,
    support: Vec<f64>,
    sums: Vec<f64>,
}

impl CandidateLabels {
    /// Clears all values and keeps the memory.
    fn reset(&mut self, targets: usize, slack: f64) {
        self.starts.clear();
        self.starts.push(0);
        self.columns.clear();
        self.entries.clear();
        self.row_slack.clear();
        self.column_slack.clear();
        self.column_slack.resize(targets, slack);
    }

    /// Appends a model point with its candidates.
    fn push_row(&mut self, row: impl Iterator<Item = (usize, f64)>, slack: f64) {
        for (column, probability) in row {
            self.columns.push(column);
            self.entries.push(probability);
        }
        self.starts.push(self.columns.len());
        self.row_slack.push(slack);
    }

    /// Computes the links `weight((i, j), (a, b))` for the points `a` of `neighbours(i)` and their
    /// candidates. Zeros are dropped.
    fn link<'a>(
        &mut self,
        weight: impl Fn((usize, usize), (usize, usize)) -> f64,
        neighbours: impl Fn(usize) -> &'a [usize],
    ) {
        self.link_starts.clear();
        self.link_from.clear();
        self.link_weight.clear();
        self.link_starts.push(0);
        for i in 0..self.rows() {
            for e in self.starts[i]..self.starts[i + 1] {
                for &a in neighbours(i) {
                    for f in self.starts[a]..self.starts[a + 1] {
                        let w = weight((i, self.columns[e]), (a, self.columns[f]));
                        if w > 0.0 {
                            self.link_from.push(f as u32);
                            self.link_weight.push(w);
                        }
                    }
                }
                self.link_starts.push(self.link_from.len());
            }
        }
    }

    /// Number of model points.
    fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// Candidates of model point `i` with their probabilities.
    fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[i]..self.starts[i + 1];
        self.columns[range.clone()]
            .iter()
            .copied()
            .zip(self.entries[range].iter().copied())
    }

    /// One sweep: support (19), update (20) with the constant `slack_gain` for the slack, and
    /// `normalisations` of rows and columns in turn.
    fn sweep(&mut self, slack_gain: f64, normalisations: usize) {
        self.support.clear();
        for links in self.link_starts.windows(2) {
            let range = links[0]..links[1];
            let pairs = self.link_from[range.clone()]
                .iter()
                .zip(&self.link_weight[range]);
            self.support
                .push(pairs.map(|(&f, w)| w * self.entries[f as usize]).sum());
        }
        for i in 0..self.rows() {
            let range = self.starts[i]..self.starts[i + 1];
            let gains = self.entries[range.clone()]
                .iter()
                .zip(&self.support[range.clone()]);
            let total = gains.map(|(p, s)| p * s).sum::<f64>() + self.row_slack[i] * slack_gain;
            if total > 0.0 {
                for e in range {
                    self.entries[e] *= self.support[e] / total;
                }
                self.row_slack[i] *= slack_gain / total;
            }
        }
        (0..normalisations).for_each(|_| self.normalise());
    }

    /// Whether every model point is decided: one candidate, or the slack, has a probability of at
    /// least `certainty`.
    fn is_settled(&self, certainty: f64) -> bool {
        (0..self.rows()).all(|i| {
            self.row(i)
                .map(|(_, p)| p)
                .fold(self.row_slack[i], f64::max)
                >= certainty
        })
    }

    fn normalise(&mut self) {
        let or_one = |sum: f64| if sum > 0.0 { sum } else { 1.0 };
        self.sums.clone_from(&self.column_slack);
        for i in 0..self.rows() {
            let range = self.starts[i]..self.starts[i + 1];
            let sum = or_one(self.entries[range.clone()].iter().sum::<f64>() + self.row_slack[i]);
            for e in range {
                self.entries[e] /= sum;
                self.sums[self.columns[e]] += self.entries[e];
            }
            self.row_slack[i] /= sum;
        }
        self.sums.iter_mut().for_each(|sum| *sum = or_one(*sum));
        for (p, &j) in self.entries.iter_mut().zip(&self.columns) {
            *p /= self.sums[j];
        }
        for (slack, sum) in self.column_slack.iter_mut().zip(&self.sums) {
            *slack /= sum;
        }
    }
}
