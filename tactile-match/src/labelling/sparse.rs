//! The same method over few candidates a point, with the links between them computed once.

use super::{
    CompatibilityRule, MatchMatrix, NeighbourGraph, RelaxationLabelling, first_matches, relax_with,
};
use nalgebra::Point;
use tactile_tps::Scalar;

/// One outer iteration's match matrix, as [`RelaxationLabelling::relax`](super::RelaxationLabelling::relax) with all but the likeliest
/// candidates at zero.
pub(super) fn relax<const D: usize>(
    options: &RelaxationLabelling,
    candidates: usize,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
) -> MatchMatrix {
    let graphs = [model, target].map(|points| NeighbourGraph::new(points, options.neighbourhood));
    let mut m = first_matches(model, target, options.temperature, options.slack);
    keep_likeliest(&mut m, candidates);
    let links = Links::new(&m, &graphs, options.rule(&graphs));
    relax_with(options, m, |m| links.support(m))
}

/// The target that has all of a row, so that no other can still come up: what they have is below a hundred roundings.
fn settled_on(row: &[f64]) -> Option<usize> {
    let sum = row.iter().fold(0.0, |sum, &p| sum + p);
    let enough = sum * (1.0 - 100.0 * f64::UNIT_ROUNDOFF);
    row[..row.len() - 1]
        .iter()
        .position(|&p| p > 0.0 && p >= enough)
}

/// Sets all but the `count` likeliest partners of every model point to zero; of equal ones the lower rows stay.
fn keep_likeliest(m: &mut MatchMatrix, count: usize) {
    let columns = m.columns();
    let mut order: Vec<usize> = Vec::with_capacity(columns);
    for i in 0..m.rows() {
        order.clear();
        order.extend(0..columns);
        let row = m.row_mut(i);
        let unlikely = |a: &usize, b: &usize| {
            row[*b]
                .partial_cmp(&row[*a])
                .unwrap_or(std::cmp::Ordering::Equal)
                .then(a.cmp(b))
        };
        order.sort_unstable_by(unlikely);
        order.iter().skip(count).for_each(|&j| row[j] = 0.0);
    }
}

/// What every candidate pair hears from the candidate pairs of its neighbours: entries of M and their compatibilities, in flat rows.
struct Links {
    columns: usize,
    /// The candidate pairs `(i, j)`, where their links start, and where the last of them ends.
    pairs: Vec<(usize, usize)>,
    starts: Vec<usize>,
    from: Vec<(u32, u32)>,
    compatibility: Vec<f64>,
}

impl Links {
    fn new<const D: usize>(
        m: &MatchMatrix,
        graphs: &[NeighbourGraph<D>; 2],
        rule: CompatibilityRule,
    ) -> Self {
        let columns = m.columns();
        let candidates = |i: usize| {
            m.row(i)[..columns]
                .iter()
                .enumerate()
                .filter(|(_, p)| **p > 0.0)
                .map(|(j, _)| j)
        };
        let mut links = Self {
            columns,
            pairs: Vec::new(),
            starts: vec![0],
            from: Vec::new(),
            compatibility: Vec::new(),
        };
        let mut edge_to = vec![None; columns];
        for i in 0..m.rows() {
            for j in candidates(i) {
                edge_to.fill(None);
                graphs[1]
                    .of(j)
                    .iter()
                    .for_each(|edge| edge_to[edge.to] = Some(edge));
                for x in graphs[0].of(i) {
                    for b in candidates(x.to) {
                        if let Some(y) = edge_to[b] {
                            links.from.push((x.to as u32, b as u32));
                            links.compatibility.push(rule.of(x, y));
                        }
                    }
                }
                links.pairs.push((i, j));
                links.starts.push(links.from.len());
            }
        }
        links
    }

    /// The support (19) of the candidate pairs; zero for all others. Of points whose match is settled
    /// only the pair they settled on is heard.
    fn support(&self, m: &MatchMatrix) -> Vec<f64> {
        let mut support = vec![0.0; m.rows() * self.columns];
        let settled: Vec<Option<usize>> = (0..m.rows()).map(|i| settled_on(m.row(i))).collect();
        for (&(i, j), ends) in self.pairs.iter().zip(self.starts.windows(2)) {
            if settled[i].is_some_and(|on| on != j) {
                continue;
            }
            let links = self.from[ends[0]..ends[1]]
                .iter()
                .zip(&self.compatibility[ends[0]..ends[1]]);
            support[i * self.columns + j] = links.fold(0.0, |sum, (&(a, b), &r)| {
                sum + m[(a as usize, b as usize)] * r
            });
        }
        support
    }
}
