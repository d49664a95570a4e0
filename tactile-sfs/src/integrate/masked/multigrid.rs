//! A hierarchy of grids, each a weighted graph Laplacian with four neighbours, and its V-cycle.
//!
//! Coarse nodes are blocks of 2×2. With piecewise constant interpolation the coarse operator is again a graph
//! Laplacian, whose edge is the sum of the fine edges that cross between two blocks; it is too stiff by a factor of 2
//! (Braess 1995), so half the sum is taken. Symmetric Gauss–Seidel makes the cycle a symmetric preconditioner.

use crate::Scalar;

/// One grid with a border of one node.
#[derive(Debug, Default)]
pub(super) struct Level<T> {
    pub(super) width: usize,
    rows: usize,
    /// Node belongs to the mask.
    pub(super) inside: Vec<bool>,
    /// Node has a given height (finest level alone).
    pub(super) fixed: Vec<bool>,
    /// Weight of the edge to the right neighbour, and to the one below.
    pub(super) right: Vec<T>,
    pub(super) below: Vec<T>,
    /// Weight of the edges to given heights.
    pub(super) anchor: Vec<T>,
    /// 1/diagonal, 0 where there is nothing to solve.
    inverse: Vec<T>,
    /// Right-hand side and solution of the cycle.
    pub(super) rhs: Vec<T>,
    pub(super) x: Vec<T>,
}

impl<T: Scalar> Level<T> {
    pub(super) fn len(&self) -> usize {
        self.width * (self.rows + 2)
    }

    fn reset(&mut self, rows: usize, columns: usize) {
        (self.width, self.rows) = (columns + 2, rows);
        let length = self.len();
        for flags in [&mut self.inside, &mut self.fixed] {
            flags.clear();
            flags.resize(length, false);
        }
        let Self { right, below, anchor, inverse, rhs, x, .. } = self;
        for vector in [right, below, anchor, inverse, rhs, x] {
            vector.clear();
            vector.resize(length, T::zero());
        }
    }

    /// The nodes that are not border.
    fn nodes(&self) -> core::ops::Range<usize> {
        self.width..self.len() - self.width
    }

    fn invert_diagonal(&mut self) {
        for i in self.nodes() {
            let edges = self.right[i] + self.right[i - 1] + self.below[i] + self.below[i - self.width];
            let diagonal = edges + self.anchor[i];
            self.inverse[i] = if diagonal > T::zero() { diagonal.recip() } else { T::zero() };
        }
    }

    /// y = A x, in differences of neighbours so that smooth x keeps its digits.
    pub(super) fn multiply(&self, x: &[f64], y: &mut [f64]) {
        let w = self.width;
        for r in 1..=self.rows {
            let n = w - 2;
            let at = r * w + 1;
            let (here, left, right) = (&x[at..at + n], &x[at - 1..at - 1 + n], &x[at + 1..at + 1 + n]);
            let (above, below) = (&x[at - w..at - w + n], &x[at + w..at + w + n]);
            let (e, wt) = (&self.right[at..at + n], &self.right[at - 1..at - 1 + n]);
            let (s, nt) = (&self.below[at..at + n], &self.below[at - w..at - w + n]);
            let (anchor, out) = (&self.anchor[at..at + n], &mut y[at..at + n]);
            for i in 0..n {
                let z = here[i];
                out[i] = anchor[i].as_f64() * z
                    + e[i].as_f64() * (z - right[i])
                    + wt[i].as_f64() * (z - left[i])
                    + s[i].as_f64() * (z - below[i])
                    + nt[i].as_f64() * (z - above[i]);
            }
        }
    }

    /// One Gauss–Seidel sweep, in reading order or against it.
    fn relax(&self, x: &mut [T], rhs: &[T], forward: bool) {
        let (w, n) = (self.width, self.width - 2);
        for k in 1..=self.rows {
            let r = if forward { k } else { self.rows + 1 - k };
            let at = r * w + 1;
            let (before, rest) = x.split_at_mut(at - 1);
            let (here, after) = rest.split_at_mut(w);
            let (above, below) = (&before[before.len() + 1 - w..][..n], &after[1..][..n]);
            let here = &mut here[..n + 2];
            let (right, left) = (&self.right[at..at + n], &self.right[at - 1..at - 1 + n]);
            let (s, nt) = (&self.below[at..at + n], &self.below[at - w..at - w + n]);
            let (inverse, rhs) = (&self.inverse[at..at + n], &rhs[at..at + n]);
            let mut update = |i: usize| {
                let vertical = rhs[i] + s[i] * below[i] + nt[i] * above[i];
                here[i + 1] = inverse[i] * (vertical + right[i] * here[i + 2] + left[i] * here[i]);
            };
            if forward {
                (0..n).for_each(&mut update);
            } else {
                (0..n).rev().for_each(&mut update);
            }
        }
    }
}

/// Grids from fine to coarse.
#[derive(Debug, Default)]
pub(super) struct Hierarchy<T> {
    pub(super) levels: Vec<Level<T>>,
    /// Levels in use; more may be kept from larger problems.
    depth: usize,
}

impl<T: Scalar> Hierarchy<T> {
    pub(super) fn reset(&mut self, mut rows: usize, mut columns: usize) {
        self.depth = 0;
        loop {
            if self.levels.len() == self.depth {
                self.levels.push(Level::default());
            }
            self.levels[self.depth].reset(rows, columns);
            self.depth += 1;
            if rows == 1 && columns == 1 {
                break;
            }
            (rows, columns) = (rows.div_ceil(2), columns.div_ceil(2));
        }
    }

    /// Computes the coarse operators from the finest.
    pub(super) fn build(&mut self) {
        self.levels[0].invert_diagonal();
        for k in 1..self.depth {
            let (fine, coarse) = self.levels.split_at_mut(k);
            coarsen(&fine[k - 1], &mut coarse[0]);
            coarse[0].invert_diagonal();
        }
    }

    /// One V-cycle from zero for the right-hand side in `levels[0].rhs`; the result is `levels[0].x`.
    pub(super) fn cycle(&mut self) {
        for k in 0..self.depth {
            let (fine, coarse) = self.levels.split_at_mut(k + 1);
            let level = &mut fine[k];
            let (mut x, rhs) = (core::mem::take(&mut level.x), core::mem::take(&mut level.rhs));
            x.fill(T::zero());
            level.relax(&mut x, &rhs, true);
            if k + 1 < self.depth {
                restrict(level, &x, &rhs, &mut coarse[0]);
            }
            (level.x, level.rhs) = (x, rhs);
        }
        for k in (0..self.depth).rev() {
            let (fine, coarse) = self.levels.split_at_mut(k + 1);
            let level = &mut fine[k];
            let (mut x, rhs) = (core::mem::take(&mut level.x), core::mem::take(&mut level.rhs));
            if k + 1 < self.depth {
                prolong(level, &mut x, &coarse[0]);
            }
            level.relax(&mut x, &rhs, false);
            (level.x, level.rhs) = (x, rhs);
        }
    }
}

/// Index of the block a node of a row belongs to.
#[inline(always)]
fn block(fine_width: usize, coarse_width: usize, i: usize) -> usize {
    let (r, c) = (i / fine_width - 1, i % fine_width);
    (r / 2 + 1) * coarse_width + (c.wrapping_sub(1) / 2 + 1)
}

fn coarsen<T: Scalar>(fine: &Level<T>, coarse: &mut Level<T>) {
    let half = T::of(0.5);
    for i in fine.nodes() {
        if fine.inverse[i] == T::zero() {
            continue;
        }
        let b = block(fine.width, coarse.width, i);
        coarse.anchor[b] += fine.anchor[i];
        if fine.right[i] > T::zero() && block(fine.width, coarse.width, i + 1) != b {
            coarse.right[b] += half * fine.right[i];
        }
        if fine.below[i] > T::zero() && block(fine.width, coarse.width, i + fine.width) != b {
            coarse.below[b] += half * fine.below[i];
        }
    }
}

/// Sums the residual over the blocks.
fn restrict<T: Scalar>(fine: &Level<T>, x: &[T], rhs: &[T], coarse: &mut Level<T>) {
    coarse.rhs.fill(T::zero());
    let (w, n) = (fine.width, fine.width - 2);
    for r in 1..=fine.rows {
        let at = r * w + 1;
        let (here, left, right) = (&x[at..at + n], &x[at - 1..at - 1 + n], &x[at + 1..at + 1 + n]);
        let (above, below) = (&x[at - w..at - w + n], &x[at + w..at + w + n]);
        let (e, wt) = (&fine.right[at..at + n], &fine.right[at - 1..at - 1 + n]);
        let (s, nt) = (&fine.below[at..at + n], &fine.below[at - w..at - w + n]);
        let (anchor, rhs) = (&fine.anchor[at..at + n], &rhs[at..at + n]);
        let to = &mut coarse.rhs[r.div_ceil(2) * coarse.width + 1..][..n.div_ceil(2)];
        for i in 0..n {
            let z = here[i];
            let outward = e[i] * (right[i] - z)
                + wt[i] * (left[i] - z)
                + s[i] * (below[i] - z)
                + nt[i] * (above[i] - z);
            to[i / 2] += rhs[i] + outward - anchor[i] * z;
        }
    }
}

fn prolong<T: Scalar>(fine: &Level<T>, x: &mut [T], coarse: &Level<T>) {
    let n = fine.width - 2;
    for r in 1..=fine.rows {
        let from = &coarse.x[r.div_ceil(2) * coarse.width + 1..][..n.div_ceil(2)];
        for (i, x) in x[r * fine.width + 1..][..n].iter_mut().enumerate() {
            *x += from[i / 2];
        }
    }
}
