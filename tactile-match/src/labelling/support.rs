//! (14) and (19): the energy, and what the neighbours say.

#[cfg(test)]
use super::CompatibilityRule;
use super::{MatchMatrix, NeighbourGraph};

/// (19) as printed: `S_ij = Σ_{a∈N(i)} Σ_{b∈N(j)} M_ab r(ia, jb)`, row-major `I × J`; `O(I J A B)`.
///
/// # Panics
/// If `m` has not the size of the graphs.
#[cfg(test)]
pub(crate) fn support<const D: usize>(
    m: &MatchMatrix,
    model: &NeighbourGraph<D>,
    target: &NeighbourGraph<D>,
    rule: &CompatibilityRule,
) -> Vec<f64> {
    support_by(m, model, target, |x, y| {
        rule.of(&model.edges()[x], &target.edges()[y])
    })
}

/// [`support`] with a compatibility of the caller's choice: `r(x, y)` of the `x`-th model edge and the `y`-th target edge,
/// as they stand in [`NeighbourGraph::edges`].
///
/// # Panics
/// If `m` has not the size of the graphs.
#[must_use]
pub(crate) fn support_by<const D: usize>(
    m: &MatchMatrix,
    model: &NeighbourGraph<D>,
    target: &NeighbourGraph<D>,
    r: impl Fn(usize, usize) -> f64,
) -> Vec<f64> {
    assert_eq!(
        (m.rows(), m.columns()),
        (model.points(), target.points()),
        "size of M"
    );
    let mut support = Vec::with_capacity(m.rows() * m.columns());
    for i in 0..m.rows() {
        for j in 0..m.columns() {
            let mut sum = 0.0;
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
/// ends, the slack left out. `O(A B)` for each of the at most `I J` entries that are not zero.
///
/// # Panics
/// If `m` has not the size of the graphs.
#[must_use]
pub(crate) fn energy<const D: usize>(
    m: &MatchMatrix,
    model: &NeighbourGraph<D>,
    target: &NeighbourGraph<D>,
) -> f64 {
    assert_eq!(
        (m.rows(), m.columns()),
        (model.points(), target.points()),
        "size of M"
    );
    let mut energy = 0.0;
    for i in 0..m.rows() {
        for j in (0..m.columns()).filter(|&j| m[(i, j)] > 0.0) {
            let mut kept = 0.0;
            for a in model.of(i) {
                let row = m.row(a.to);
                kept = target.of(j).iter().fold(kept, |sum, b| sum + row[b.to]);
            }
            energy += m[(i, j)] * kept;
        }
    }
    energy
}
