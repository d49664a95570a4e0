//! Pairs from the points' surroundings: shape contexts propose, relaxation labelling decides.

use super::candidate_labels::CandidateLabels;
use crate::shape_context::ShapeContexts;
use std::f64::consts::PI;

/// Candidates a model point.
const CANDIDATES: usize = 10;
/// Neighbours a model point.
const NEIGHBOURS: usize = 8;
/// Radius of the shape contexts, in radii of the model.
const RADIUS: f64 = 2.0;
/// χ² distance that costs a candidate a factor e.
const COST_SCALE: f64 = 0.05;
/// Initial share and constant gain of the slack.
const SLACK: f64 = 0.1;
const SLACK_GAIN: f64 = 0.05;
const SWEEPS: usize = 12;

/// Memory of the search for pairs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Correspondence {
    model_contexts: ShapeContexts,
    target_contexts: ShapeContexts,
    costs: Vec<f32>,
    order: Vec<usize>,
    labels: CandidateLabels,
    neighbours: Vec<usize>,
    reach: Vec<f64>,
    /// The likeliest target of every model point, with its probability.
    pub(crate) pairs: Vec<(usize, f64)>,
}

impl Correspondence {
    /// Finds `pairs` for model points as they lie.
    pub(crate) fn find<const D: usize>(&mut self, model: &[[f64; D]], target: &[[f64; D]]) {
        self.propose(model, target);
        self.relax(model, target);
        let likeliest = |i| {
            self.labels.row(i).fold(
                (0, 0.0),
                |best: (usize, f64), entry| if entry.1 > best.1 { entry } else { best },
            )
        };
        self.pairs.clear();
        self.pairs.extend((0..model.len()).map(likeliest));
    }

    /// The candidates of least shape-context cost, with first probabilities.
    fn propose<const D: usize>(&mut self, model: &[[f64; D]], target: &[[f64; D]]) {
        self.model_contexts.build(model, RADIUS);
        self.target_contexts.build(target, RADIUS);
        self.labels.reset(target.len(), SLACK);
        for i in 0..model.len() {
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
            let raw = |j: usize| (-f64::from(costs[j] - least) / COST_SCALE).exp();
            let sum: f64 = self.order.iter().map(|&j| raw(j)).sum();
            self.labels.push_row(
                self.order
                    .iter()
                    .map(|&j| (j, (1.0 - SLACK) * raw(j) / sum)),
                SLACK,
            );
        }
    }

    /// Relaxation with the paper's compatibilities over nearest neighbours.
    fn relax<const D: usize>(&mut self, model: &[[f64; D]], target: &[[f64; D]]) {
        let kept = self.find_neighbours(model);
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
            let gamma = 1.0 - 0.7 * norm(&u) / reach[i];
            compatibility(&u, &v) * gamma / kept as f64
        };
        self.labels.link(weight, near);
        for _ in 0..SWEEPS {
            self.labels.sweep(SLACK_GAIN, 2);
            if self.labels.is_settled(0.999) {
                break;
            }
        }
    }

    /// Lists the nearest neighbours of every model point and the distance to the farthest of them.
    fn find_neighbours<const D: usize>(&mut self, model: &[[f64; D]]) -> usize {
        let kept = NEIGHBOURS.min(model.len() - 1);
        self.neighbours.clear();
        self.reach.clear();
        for (i, x) in model.iter().enumerate() {
            self.order.clear();
            self.order.extend((0..model.len()).filter(|&a| a != i));
            let square = |a: usize| norm(&difference(&model[a], x));
            if kept > 0 {
                self.order.select_nth_unstable_by(kept - 1, |&a, &b| {
                    square(a).total_cmp(&square(b)).then(a.cmp(&b))
                });
            }
            self.order.truncate(kept);
            self.reach.push(
                self.order
                    .iter()
                    .map(|&a| square(a))
                    .fold(f64::MIN_POSITIVE, f64::max),
            );
            self.neighbours.extend_from_slice(&self.order);
        }
        kept
    }
}

fn difference<const D: usize>(a: &[f64; D], b: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn norm<const D: usize>(v: &[f64; D]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// αβ⁴ of two edges: (15) with the maximum of the pair, (16) sharpened, because a neighbourhood's edges differ in
/// direction more than in length.
fn compatibility<const D: usize>(u: &[f64; D], v: &[f64; D]) -> f64 {
    let (p, q) = (norm(u), norm(v));
    if p == 0.0 || q == 0.0 {
        return 0.0;
    }
    let cosine = (0..D).map(|k| u[k] * v[k]).sum::<f64>() / (p * q);
    let beta = 1.0 - cosine.clamp(-1.0, 1.0).acos() / PI;
    p.min(q) / p.max(q) * beta.powi(4)
}
