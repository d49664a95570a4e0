//! (14) and (19): the energy, and what the neighbours say.

#[cfg(test)]
use super::CompatibilityRule;
use super::{MatchMatrix, NeighbourGraph};
use nalgebra::RealField;

/// (19) as printed: `S_ij = Σ_{a∈N(i)} Σ_{b∈N(j)} M_ab r(ia, jb)`, row-major `I × J`; `O(I J A B)`.
///
/// # Panics
/// If `m` has not the size of the graphs.
#[cfg(test)]
pub(crate) fn support<T: RealField + Copy, const D: usize>(
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
/// # Panics
/// If `m` has not the size of the graphs.
#[must_use]
pub(crate) fn support_by<T: RealField + Copy, const D: usize>(
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
/// ends, the slack left out. `O(A B)` for each of the at most `I J` entries that are not zero.
///
/// # Panics
/// If `m` has not the size of the graphs.
#[must_use]
pub(crate) fn energy<T: RealField + Copy, const D: usize>(
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
