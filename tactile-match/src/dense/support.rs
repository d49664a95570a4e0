//! (14) and (19): the energy, and what the neighbours say.

use super::{CompatibilityRule, MatchMatrix, NeighbourGraph};
use nalgebra::RealField;

/// (19) as printed: `S_ij = Σ_{a∈N(i)} Σ_{b∈N(j)} M_ab r(ia, jb)`, row-major `I × J`; `O(I J A B)`.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::dense::{Compatibility, CompatibilityRule, MatchMatrix, NeighbourGraph, Neighbourhood, support};
/// let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]].map(Point2::from);
/// let graph = NeighbourGraph::new(&points, Neighbourhood::Nearest(2));
/// let rule = CompatibilityRule { factors: Compatibility::LengthDirection, longest: None };
/// let s = support(&MatchMatrix::<f64>::uniform(3, 3), &graph, &graph, &rule);
/// assert!(s[0] > s[1] && s[0] > s[2]); // point 0 has the neighbours of point 0
/// ```
///
/// # Panics
/// If `m` has not the size of the graphs.
#[must_use]
pub fn support<T: RealField + Copy, const D: usize>(
    m: &MatchMatrix<T>,
    model: &NeighbourGraph<T, D>,
    target: &NeighbourGraph<T, D>,
    rule: &CompatibilityRule<T>,
) -> Vec<T> {
    support_by(m, model, target, |x, y| {
        rule.of(&model.edges()[x], &target.edges()[y])
    })
}

/// [`support`] with a compatibility of the caller's choice: `r(x, y)` of the `x`-th model edge and the `y`-th target edge,
/// as they stand in [`NeighbourGraph::edges`].
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::dense::{MatchMatrix, NeighbourGraph, support_by};
/// let points = [[0.0, 0.0], [1.0, 0.0]].map(Point2::from);
/// let graph = NeighbourGraph::from_lists(&points, &[vec![1], vec![0]]);
/// let same = MatchMatrix::from_fn(2, 2, |i, j| if i == j { 1.0 } else { 0.0 });
/// // Every edge pair counts one: a pair hears the probability that its neighbours are a pair.
/// assert_eq!(support_by(&same, &graph, &graph, |_, _| 1.0), [1.0, 0.0, 0.0, 1.0]);
/// ```
///
/// # Panics
/// If `m` has not the size of the graphs.
#[must_use]
pub fn support_by<T: RealField + Copy, const D: usize>(
    m: &MatchMatrix<T>,
    model: &NeighbourGraph<T, D>,
    target: &NeighbourGraph<T, D>,
    r: impl Fn(usize, usize) -> T,
) -> Vec<T> {
    assert_eq!(
        (m.rows(), m.columns()),
        (model.points(), target.points()),
        "size of M"
    );
    let mut support = Vec::with_capacity(m.rows() * m.columns());
    for i in 0..m.rows() {
        for j in 0..m.columns() {
            let mut sum = T::zero();
            for x in model.range(i) {
                let row = m.row(model.edges()[x].to);
                for y in target.range(j) {
                    sum += row[target.edges()[y].to] * r(x, y);
                }
            }
            support.push(sum);
        }
    }
    support
}

/// The energy (14), `Σ_i Σ_{a∈N(i)} Σ_j Σ_{b∈N(j)} M_ij M_ab`: how many edges the match keeps, each counted from both
/// ends, the slack left out. `O(A B)` for each of the at most `I J` entries that are not nought.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::dense::{MatchMatrix, NeighbourGraph, energy};
/// let points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]].map(Point2::from);
/// let chain = NeighbourGraph::from_lists(&points, &[vec![1], vec![0, 2], vec![1]]);
/// let matched = |to: [usize; 3]| MatchMatrix::from_fn(3, 3, |i, j| if i < 3 && to[i] == j { 1.0 } else { 0.0 });
/// assert_eq!(energy(&matched([0, 1, 2]), &chain, &chain), 4.0); // two edges, each from both ends
/// assert_eq!(energy(&matched([1, 0, 2]), &chain, &chain), 2.0); // one of them is torn
/// ```
///
/// # Panics
/// If `m` has not the size of the graphs.
#[must_use]
pub fn energy<T: RealField + Copy, const D: usize>(
    m: &MatchMatrix<T>,
    model: &NeighbourGraph<T, D>,
    target: &NeighbourGraph<T, D>,
) -> T {
    assert_eq!(
        (m.rows(), m.columns()),
        (model.points(), target.points()),
        "size of M"
    );
    let mut energy = T::zero();
    for i in 0..m.rows() {
        for j in (0..m.columns()).filter(|&j| m[(i, j)] > T::zero()) {
            let mut kept = T::zero();
            for a in model.of(i) {
                let row = m.row(a.to);
                kept = target.of(j).iter().fold(kept, |sum, b| sum + row[b.to]);
            }
            energy += m[(i, j)] * kept;
        }
    }
    energy
}
