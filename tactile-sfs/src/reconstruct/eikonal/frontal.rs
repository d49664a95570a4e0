//! Gauss–Seidel sweeps of the frontal equation p²/n_x² + q²/n_y² = k, n_x and n_y the slopes of the upwind edges.
//!
//! With k = 1 this is of first order: p and n_x belong to the middle of the edge in x, q and n_y to that of the edge in y.
//! With the direction φ of the gradient, p²/n_x² + q²/n_y² = cos²φ_x + sin²φ_y, φ_x and φ_y in those two places. A second
//! solve with k = 1 + cos²φ_x − cos²φ_y, φ from the first, removes that error (deferred correction).

use super::boundary;
use super::grid::{EikonalBuffers, Node};
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
            line.rev()
                .for_each(|i| change = change.max(visit(grid, i, width, tolerance)));
        }
    }
    change
}

/// Stores cos²φ of the solution's gradient for the second solve. Next to the boundary, where one-sided differences of a
/// height that may rise like a square root say nothing about its direction, that of ∇ sin θ is taken: both are normal to
/// the boundary.
pub(super) fn measure_directions<T: Scalar>(grid: &mut EikonalBuffers<T>) {
    let width = grid.width;
    for i in width..grid.node.len() - width {
        if grid.node[i] == Node::Outside {
            continue;
        }
        let value = &grid.value;
        let p = value[i + 1] - value[i - 1];
        let q = (value[i + width] - value[i - width]) / grid.aspect;
        let along_x = p * p / (p * p + q * q);
        grid.along_x[i] = if along_x.is_nan() && !grid.offset[i].is_nan() {
            boundary::along_x(grid, i)
        } else {
            along_x
        };
    }
}

/// An upwind neighbour: its value, 1/(slope · step)² of the edge to it, and its cos²φ.
#[derive(Clone, Copy)]
struct Edge<T> {
    value: T,
    metric: T,
    along_x: T,
}

/// Updates a node if it may improve, and wakes the neighbours its new value can lower.
#[inline(always)]
fn visit<T: Scalar>(grid: &mut EikonalBuffers<T>, i: usize, width: usize, tolerance: T) -> T {
    if !grid.active[i] {
        return T::zero();
    }
    grid.active[i] = false;
    let EikonalBuffers {
        value,
        edges,
        along_x,
        ..
    } = grid;
    let edge = |j: usize, metric: T| Edge {
        value: value[j],
        metric,
        along_x: along_x[j],
    };
    let x = upwind(edge(i - 1, edges[i - 1][0]), edge(i + 1, edges[i][0]));
    let y = upwind(
        edge(i - width, edges[i - width][1]),
        edge(i + width, edges[i][1]),
    );
    let k = if grid.corrected {
        correction(x, y)
    } else {
        T::one()
    };
    let (old, new) = (value[i], update(x, y, k));
    if new >= old {
        return T::zero();
    }
    value[i] = new;
    let change = old - new;
    if change > tolerance {
        for j in [i - 1, i + 1, i - width, i + width] {
            // Known and outside nodes never wake: they are not unknown.
            grid.active[j] |= grid.value[j] > new && grid.node[j] == Node::Unknown;
        }
    }
    change
}

/// k of the second solve, from means of the node and its neighbours: half of the difference of the neighbours is left. Where
/// the direction turns within a pixel (along ridges) such means say nothing, and the first order is better.
#[inline(always)]
fn correction<T: Scalar>(x: Edge<T>, y: Edge<T>) -> T {
    let turn = T::of(0.5) * (x.along_x - y.along_x);
    if turn.abs() < T::of(0.1) {
        T::one() + turn
    } else {
        T::one()
    }
}

#[inline(always)]
fn upwind<T: Scalar>(before: Edge<T>, after: Edge<T>) -> Edge<T> {
    if before.value < after.value {
        before
    } else {
        after
    }
}

/// Solves A (u − a)² + B (u − b)² = k for the larger root, or along one edge where it is not upwind of both.
#[inline(always)]
fn update<T: Scalar>(x: Edge<T>, y: Edge<T>, k: T) -> T {
    let d = x.value - y.value;
    let sum = x.metric + y.metric;
    // Upwind of both if u > max(a, b): the larger of the two seen from the smaller is less than one edge away.
    let lower = if d > T::zero() { y } else { x };
    if lower.metric * d * d < k {
        let root = (k * sum - x.metric * y.metric * d * d)
            .max(T::zero())
            .sqrt();
        return (x.metric * x.value + y.metric * y.value + root) / sum;
    }
    lower.value + (k / lower.metric).sqrt()
}
