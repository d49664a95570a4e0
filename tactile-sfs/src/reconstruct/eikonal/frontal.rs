//! One Gauss–Seidel sweep of the frontal equation p²/n_x² + q²/n_y² = 1, n_x and n_y the slopes of the upwind edges.

use super::grid::EikonalBuffers;
use crate::Scalar;

/// Sweeps in one of four orders; returns the largest change.
pub(super) fn sweep<T: Scalar>(grid: &mut EikonalBuffers<T>, order: usize, tolerance: T) -> T {
    let width = grid.width;
    let rows = grid.node.len() / width;
    let mut change = T::zero();
    for r in 1..rows - 1 {
        let r = if order & 1 == 1 { rows - 1 - r } else { r };
        let start = r * width;
        let line = start + 1..start + width - 1;
        if order == 0 || order == 3 {
            line.for_each(|i| change = change.max(visit(grid, i, width, tolerance)));
        } else {
            line.rev().for_each(|i| change = change.max(visit(grid, i, width, tolerance)));
        }
    }
    change
}

/// Updates a node if it may improve, and wakes the neighbours its new value can lower.
#[inline(always)]
fn visit<T: Scalar>(grid: &mut EikonalBuffers<T>, i: usize, width: usize, tolerance: T) -> T {
    if !grid.active[i] {
        return T::zero();
    }
    grid.active[i] = false;
    let EikonalBuffers { value, edges, .. } = grid;
    let x = upwind((value[i - 1], edges[i - 1][0]), (value[i + 1], edges[i][0]));
    let y = upwind((value[i - width], edges[i - width][1]), (value[i + width], edges[i][1]));
    let (old, new) = (value[i], update(x, y));
    if new >= old {
        return T::zero();
    }
    value[i] = new;
    let change = old - new;
    if change > tolerance {
        for j in [i - 1, i + 1, i - width, i + width] {
            // Known and outside nodes never wake: they are not unknown.
            grid.active[j] =
                grid.value[j] > new && grid.node[j] == super::grid::Node::Unknown || grid.active[j];
        }
    }
    change
}

#[inline(always)]
fn upwind<T: Scalar>(before: (T, T), after: (T, T)) -> (T, T) {
    if before.0 < after.0 { before } else { after }
}

/// Solves A (u − a)² + B (u − b)² = 1 for the larger root, or along one edge where it is not upwind of both.
#[inline(always)]
fn update<T: Scalar>((a, ma): (T, T), (b, mb): (T, T)) -> T {
    let d = a - b;
    let (sum, square) = (ma + mb, ma * mb * d * d);
    // Upwind of both if u > max(a, b): the larger of the two seen from the smaller is less than one edge away.
    let lower_metric = if d > T::zero() { mb } else { ma };
    if lower_metric * d * d < T::one() {
        return (ma * a + mb * b + (sum - square).max(T::zero()).sqrt()) / sum;
    }
    if d > T::zero() { b + mb.sqrt().recip() } else { a + ma.sqrt().recip() }
}
