//! The same method over few candidates a point, with the links between them computed once.

use super::matcher::{match_with, relax_with};
use super::{CompatibilityRule, LabellingOptions, MatchMatrix, NeighbourGraph, first_matches};
use crate::validate::at_least_one;
use crate::{MatchError, Matching, PointMatcher};
use nalgebra::Point;
use tactile_tps::Scalar;

/// The paper's method over the likeliest candidates of every point: [`RelaxationLabelling`](crate::RelaxationLabelling) with the same options, at a fraction of its cost.
///
/// Only the `c` pairs of largest first probability of every model point are kept; the others stay zero, which (20) would not change.
/// What pair `(a, b)` says for pair `(i, j)` in (19) does not depend on M: these links, `I A c²` at most, are computed once an
/// outer iteration, and a sweep costs one multiplication each instead of `O(I J A B)`. With all candidates
/// (`candidates ≥ J`) the answer is that of [`RelaxationLabelling`](crate::RelaxationLabelling) to rounding. The other candidates of a
/// point whose match is settled (to a hundred roundings) leave the sweeps.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::labelling::LabellingOptions;
/// use tactile_match::{PointMatcher, RelaxationLabelling, SparseRelaxationLabelling};
/// let model: Vec<_> = (0..16).map(f64::from).map(|k| Point2::new(k % 4.0 + 0.1 * k.sin(), (k / 4.0).floor())).collect();
/// let target: Vec<_> = model.iter().rev().map(|p| Point2::new(p.x + 0.1 * p.y, p.y)).collect();
/// let all = SparseRelaxationLabelling::new(LabellingOptions::default(), 16)?.match_points(&model, &target)?;
/// let dense = RelaxationLabelling::default().match_points(&model, &target)?;
/// assert_eq!(all.assignment, dense.assignment);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseRelaxationLabelling {
    options: LabellingOptions,
    candidates: usize,
}

impl Default for SparseRelaxationLabelling {
    /// Ten candidates.
    fn default() -> Self {
        Self {
            options: LabellingOptions::default(),
            candidates: 10,
        }
    }
}

impl SparseRelaxationLabelling {
    /// With these options and so many candidates a model point; as many as there are targets, or more, keeps all.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for no candidate.
    pub fn new(options: LabellingOptions, candidates: usize) -> Result<Self, MatchError> {
        at_least_one("candidates", candidates)?;
        Ok(Self {
            options,
            candidates,
        })
    }

    /// One outer iteration's match matrix, as [`RelaxationLabelling::relax`] with all other pairs at zero.
    #[must_use]
    pub(crate) fn relax<T: Scalar, const D: usize>(
        &self,
        model: &[Point<T, D>],
        target: &[Point<T, D>],
    ) -> MatchMatrix<T> {
        let options = &self.options;
        let graphs =
            [model, target].map(|points| NeighbourGraph::new(points, options.neighbourhood));
        let mut m = first_matches(model, target, options.temperature, options.slack);
        keep_likeliest(&mut m, self.candidates);
        let links = Links::new(&m, &graphs, options.rule(&graphs));
        relax_with(options, m, |m| links.support(m))
    }
}

impl<T: Scalar, const D: usize> PointMatcher<T, D> for SparseRelaxationLabelling {
    fn match_points(
        &self,
        model: &[Point<T, D>],
        target: &[Point<T, D>],
    ) -> Result<Matching<T, D>, MatchError> {
        match_with(&self.options, model, target, |model, target| {
            self.relax(model, target)
        })
    }
}

/// The target that has all of a row, so that no other can still come up: what they have is below a hundred roundings.
fn settled_on<T: Scalar>(row: &[T]) -> Option<usize> {
    let sum = row.iter().fold(T::zero(), |sum, &p| sum + p);
    let enough = sum * nalgebra::convert(1.0 - 100.0 * T::UNIT_ROUNDOFF);
    row[..row.len() - 1]
        .iter()
        .position(|&p| p > T::zero() && p >= enough)
}

/// Sets all but the `count` likeliest partners of every model point to zero; of equal ones the lower rows stay.
fn keep_likeliest<T: Scalar>(m: &mut MatchMatrix<T>, count: usize) {
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
        order.iter().skip(count).for_each(|&j| row[j] = T::zero());
    }
}

/// What every candidate pair hears from the candidate pairs of its neighbours: entries of M and their compatibilities, in flat rows.
struct Links<T> {
    columns: usize,
    /// The candidate pairs `(i, j)`, where their links start, and where the last of them ends.
    pairs: Vec<(usize, usize)>,
    starts: Vec<usize>,
    from: Vec<(u32, u32)>,
    compatibility: Vec<T>,
}

impl<T: Scalar> Links<T> {
    fn new<const D: usize>(
        m: &MatchMatrix<T>,
        graphs: &[NeighbourGraph<T, D>; 2],
        rule: CompatibilityRule<T>,
    ) -> Self {
        let columns = m.columns();
        let candidates = |i: usize| {
            m.row(i)[..columns]
                .iter()
                .enumerate()
                .filter(|(_, p)| **p > T::zero())
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
    fn support(&self, m: &MatchMatrix<T>) -> Vec<T> {
        let mut support = vec![T::zero(); m.rows() * self.columns];
        let settled: Vec<Option<usize>> = (0..m.rows()).map(|i| settled_on(m.row(i))).collect();
        for (&(i, j), ends) in self.pairs.iter().zip(self.starts.windows(2)) {
            if settled[i].is_some_and(|on| on != j) {
                continue;
            }
            let links = self.from[ends[0]..ends[1]]
                .iter()
                .zip(&self.compatibility[ends[0]..ends[1]]);
            support[i * self.columns + j] = links.fold(T::zero(), |sum, (&(a, b), &r)| {
                sum + m[(a as usize, b as usize)] * r
            });
        }
        support
    }
}
