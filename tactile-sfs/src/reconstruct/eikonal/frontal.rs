//! Gauss–Seidel sweeps of the frontal equation p²/n_x² + q²/n_y² = k, n_x and n_y the slopes of the upwind edges.
//!
//! With k = 1 this is of first order: p and n_x belong to the middle of the edge in x, q and n_y to that of the edge in y.
//! With the direction φ of the gradient, p²/n_x² + q²/n_y² = cos²φ_x + sin²φ_y, φ_x and φ_y in those two places. A second
//! solve with k = 1 + cos²φ_x − cos²φ_y, φ from the first, removes that error (deferred correction). A profile fitted to the light tells φ before
//! anything is solved.

use std::ops::Range;

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
        let (mut nodes, busy) = Nodes::of(grid);
        let busy = &mut busy[r - 1..=r + 1];
        let row = r * width + 1..(r + 1) * width - 1;
        let forwards = order == 0 || order == 3;
        let mut rest = row;
        while let Some(i) = nodes.next_active(&mut rest, forwards) {
            let wake = |line: usize| busy[line] = true;
            change = change.max(nodes.visit(i, tolerance, wake));
        }
    }
    change
}

impl<T: Scalar> EikonalBuffers<T> {
    /// Takes the order of the unknown nodes from a profile fitted to the mask's pixels, from its rim to its top, and the directions of the
    /// gradient: nothing but the rim is known, and lines of equal light are lines of equal height.
    pub(super) fn follow(&mut self, profile: &Profile, area: BoundingBox) {
        let (aspect, room) = (self.aspect.as_f64(), self.node.len());
        let width = self.width;
        let directions = self.along_x.chunks_exact_mut(width);
        let lines = self.node.chunks_exact(width).zip(directions);
        let nodes = lines.enumerate().flat_map(|(row, (nodes, directions))| {
            let first = row * width;
            let both = nodes.iter().zip(directions).enumerate();
            let unknown = both.filter(|(_, (node, _))| **node == Node::Unknown);
            unknown.map(move |(column, (_, along_x))| {
                // The grid has a border of one node around the box.
                let pixel = [area.top + row - 1, area.left + column - 1];
                let (quadratic, [p, q]) = profile.quadratic_and_gradient(pixel);
                let (pp, qq) = (p * p, q * q / (aspect * aspect));
                *along_x = T::of(pp / (pp + qq));
                ((first + column) as u32, -quadratic)
            })
        });
        self.front.sort(room, nodes);
        self.directed = true;
    }
}

/// Visits the nodes in the order of the front; returns whether any may still improve.
pub(super) fn march<T: Scalar>(grid: &mut EikonalBuffers<T>, tolerance: T) -> bool {
    let front = core::mem::take(&mut grid.front);
    // All rows count as busy until a sweep has been through them.
    let (mut nodes, _) = Nodes::of(grid);
    for &node in &front.nodes {
        nodes.visit(node as usize, tolerance, |_| {});
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

/// The nodes of the grid, side by side.
struct Nodes<'a, T> {
    width: usize,
    corrected: bool,
    value: &'a mut [T],
    active: &'a mut [bool],
    node: &'a [Node],
    along_x: &'a [T],
    edges: &'a [[T; 2]],
}

impl<'a, T: Scalar> Nodes<'a, T> {
    /// The nodes, and which rows have active ones.
    fn of(grid: &'a mut EikonalBuffers<T>) -> (Self, &'a mut [bool]) {
        let nodes = Self {
            width: grid.width,
            corrected: grid.corrected,
            value: &mut grid.value,
            active: &mut grid.active,
            node: &grid.node,
            along_x: &grid.along_x,
            edges: &grid.edges,
        };
        (nodes, &mut grid.busy)
    }

    /// Takes the next active node from a row's `rest`, from the front or from the back. Most nodes sleep, and are passed over by wide instructions.
    #[inline(always)]
    fn next_active(&self, rest: &mut Range<usize>, forwards: bool) -> Option<usize> {
        const BLOCK: usize = 16;
        let any = |block: &[bool]| block.iter().fold(false, |any, &active| any | active);
        while rest.start < rest.end {
            let length = (rest.end - rest.start).min(BLOCK);
            let (from, block);
            if forwards {
                (from, block) = (rest.start, &self.active[rest.start..rest.start + length]);
                rest.start += length;
            } else {
                (from, block) = (rest.end - length, &self.active[rest.end - length..rest.end]);
                rest.end -= length;
            }
            if !any(block) {
                continue;
            }
            let found = if forwards {
                block.iter().position(|&active| active)
            } else {
                block.iter().rposition(|&active| active)
            };
            if let Some(i) = found.map(|at| from + at) {
                // What is left of the block stays in the rest.
                if forwards {
                    rest.start = i + 1;
                } else {
                    rest.end = i;
                }
                return Some(i);
            }
        }
        None
    }

    /// Updates a node if it may improve, and wakes the neighbours its new value can lower; `wake` is told in which of the three lines around the
    /// node they are.
    #[inline(always)]
    fn visit(&mut self, i: usize, tolerance: T, mut wake: impl FnMut(usize)) -> T {
        if !self.active[i] {
            return T::zero();
        }
        self.active[i] = false;
        let width = self.width;
        let edge = |at: usize, metric: T| Edge {
            value: self.value[at],
            metric,
            along_x: self.along_x[at],
        };
        let [right, down] = self.edges[i];
        let x = upwind(edge(i - 1, self.edges[i - 1][0]), edge(i + 1, right));
        let y = upwind(
            edge(i - width, self.edges[i - width][1]),
            edge(i + width, down),
        );
        let k = if self.corrected {
            correction(x, y)
        } else {
            T::one()
        };
        let (old, new) = (self.value[i], update(x, y, k));
        if new >= old {
            return T::zero();
        }
        self.value[i] = new;
        let change = old - new;
        if change > tolerance {
            let near = [(1, i - 1), (1, i + 1), (0, i - width), (2, i + width)];
            for (line, j) in near {
                // Known and outside nodes never wake: they are not unknown.
                if self.value[j] > new && !self.active[j] && self.node[j] == Node::Unknown {
                    self.active[j] = true;
                    wake(line);
                }
            }
        }
        change
    }
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
