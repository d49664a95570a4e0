//! Gauss–Seidel sweeps of the frontal equation p²/n_x² + q²/n_y² = k, n_x and n_y the slopes of the upwind edges.
//!
//! With k = 1 this is of first order: p and n_x belong to the middle of the edge in x, q and n_y to that of the edge in y.
//! With the direction φ of the gradient, p²/n_x² + q²/n_y² = cos²φ_x + sin²φ_y, φ_x and φ_y in those two places. A second
//! solve with k = 1 + cos²φ_x − cos²φ_y, φ from the first, removes that error (deferred correction). A profile fitted to the light tells φ before
//! anything is solved.

use super::boundary;
use super::grid::{EikonalBuffers, Node};
use super::profile::Profile;
use crate::{BoundingBox, Scalar};

/// Sweeps in one of four orders; returns the largest change.
pub(super) fn sweep<T: Scalar>(grid: &mut EikonalBuffers<T>, order: usize, tolerance: T) -> T {
    let width = grid.width;
    let rows = grid.node.len() / width;
    let mut change = T::zero();
    for r in 1..rows - 1 {
        let r = if order & 1 == 1 { rows - 1 - r } else { r };
        if !core::mem::take(&mut grid.busy[r]) {
            continue;
        }
        let mut lines = Lines::around(grid, r);
        let columns = 1..width - 1;
        if order == 0 || order == 3 {
            columns.for_each(|c| change = change.max(lines.visit(c, tolerance)));
        } else {
            columns
                .rev()
                .for_each(|c| change = change.max(lines.visit(c, tolerance)));
        }
    }
    change
}

impl<T: Scalar> EikonalBuffers<T> {
    /// Takes the order of the unknown nodes from a profile fitted to the mask's pixels, from its rim to its top, and the directions of the
    /// gradient: nothing but the rim is known, and lines of equal light are lines of equal height.
    pub(super) fn follow(&mut self, profile: &Profile, area: BoundingBox) {
        let aspect = self.aspect.as_f64();
        let directions = self.along_x.chunks_exact_mut(self.width);
        let lines = self.node.chunks_exact(self.width).zip(directions);
        let nodes = lines.enumerate().flat_map(|(row, (nodes, directions))| {
            let both = nodes.iter().zip(directions).enumerate();
            let unknown = both.filter(|(_, (node, _))| **node == Node::Unknown);
            unknown.map(move |(column, (_, along_x))| {
                // The grid has a border of one node around the box.
                let pixel = [area.top + row - 1, area.left + column - 1];
                let (quadratic, [p, q]) = profile.quadratic_and_gradient(pixel);
                let (pp, qq) = (p * p, q * q / (aspect * aspect));
                *along_x = T::of(pp / (pp + qq));
                ([row as u32, column as u32], -quadratic)
            })
        });
        self.front.sort(nodes);
        self.directed = true;
    }
}

/// Visits the nodes in the order of the front; returns whether any may still improve.
pub(super) fn march<T: Scalar>(grid: &mut EikonalBuffers<T>, tolerance: T) -> bool {
    let front = core::mem::take(&mut grid.front);
    for &[row, column] in &front.nodes {
        if grid.active[row as usize * grid.width + column as usize] {
            Lines::around(grid, row as usize).visit(column as usize, tolerance);
        }
    }
    grid.front = front;
    grid.active.contains(&true)
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

/// A row of the grid between its neighbours, all of one length: no index of a node has to be checked.
struct Lines<'a, T> {
    corrected: bool,
    value: [&'a mut [T]; 3],
    active: [&'a mut [bool]; 3],
    /// Whether a row has active nodes.
    busy: &'a mut [bool],
    node: [&'a [Node]; 3],
    along_x: [&'a [T]; 3],
    /// Of the row above and the row itself.
    edges: [&'a [[T; 2]]; 2],
}

impl<'a, T: Scalar> Lines<'a, T> {
    #[inline(always)]
    fn around(grid: &'a mut EikonalBuffers<T>, row: usize) -> Self {
        let (start, width) = ((row - 1) * grid.width, grid.width);
        let three = start..start + 3 * width;
        Self {
            corrected: grid.corrected,
            value: thirds_mut(&mut grid.value[three.clone()], width),
            active: thirds_mut(&mut grid.active[three.clone()], width),
            busy: &mut grid.busy[row - 1..=row + 1],
            node: thirds(&grid.node[three.clone()], width),
            along_x: thirds(&grid.along_x[three.clone()], width),
            edges: {
                let [above, here, _] = thirds(&grid.edges[three], width);
                [above, here]
            },
        }
    }

    /// Updates a node if it may improve, and wakes the neighbours its new value can lower.
    #[inline(always)]
    fn visit(&mut self, c: usize, tolerance: T) -> T {
        if !self.active[1][c] {
            return T::zero();
        }
        self.active[1][c] = false;
        let edge = |line: usize, c: usize, metric: T| Edge {
            value: self.value[line][c],
            metric,
            along_x: self.along_x[line][c],
        };
        let [above, here] = self.edges;
        let x = upwind(edge(1, c - 1, here[c - 1][0]), edge(1, c + 1, here[c][0]));
        let y = upwind(edge(0, c, above[c][1]), edge(2, c, here[c][1]));
        let k = if self.corrected {
            correction(x, y)
        } else {
            T::one()
        };
        let (old, new) = (self.value[1][c], update(x, y, k));
        if new >= old {
            return T::zero();
        }
        self.value[1][c] = new;
        let change = old - new;
        if change > tolerance {
            for (line, c) in [(1, c - 1), (1, c + 1), (0, c), (2, c)] {
                // Known and outside nodes never wake: they are not unknown.
                let wakes = self.value[line][c] > new && self.node[line][c] == Node::Unknown;
                self.active[line][c] |= wakes;
                self.busy[line] |= wakes;
            }
        }
        change
    }
}

#[inline(always)]
fn thirds<A>(all: &[A], width: usize) -> [&[A]; 3] {
    [
        &all[..width],
        &all[width..][..width],
        &all[2 * width..][..width],
    ]
}

#[inline(always)]
fn thirds_mut<A>(all: &mut [A], width: usize) -> [&mut [A]; 3] {
    let (above, rest) = all.split_at_mut(width);
    let (here, below) = rest.split_at_mut(width);
    [&mut above[..width], &mut here[..width], &mut below[..width]]
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
