//! One grid of the hierarchy: a weighted graph Laplacian with four neighbours in single precision, and its smoother.

/// Added to right-hand sides of order one. Where they vanish a sweep halves its values again and again; this stops them
/// above the subnormal numbers, which processors are slow with.
const FLOOR: f32 = 1e-25;

/// One grid with a border of one node.
#[derive(Debug, Default)]
pub(super) struct Level {
    pub(super) width: usize,
    pub(super) rows: usize,
    /// Weight of the edge to the right neighbour, and to the one below.
    pub(super) right: Vec<f32>,
    pub(super) below: Vec<f32>,
    /// Weight of the edges to given heights.
    pub(super) anchor: Vec<f32>,
    /// 1/diagonal, 0 where there is nothing to solve.
    pub(super) inverse: Vec<f32>,
    /// Shares of the next coarse nodes in x and in y in the node's correction.
    pub(super) lean_x: Vec<f32>,
    pub(super) lean_y: Vec<f32>,
    /// Right-hand side and solution of the cycle.
    pub(super) rhs: Vec<f32>,
    pub(super) x: Vec<f32>,
    /// One line of the smoother.
    line: Vec<f32>,
}

impl Level {
    pub(super) fn reset(&mut self, rows: usize, columns: usize) {
        (self.width, self.rows) = (columns + 2, rows);
        let length = self.width * (rows + 2);
        let Self {
            right,
            below,
            anchor,
            inverse,
            lean_x,
            lean_y,
            rhs,
            x,
            line,
            ..
        } = self;
        for vector in [right, below, anchor, inverse, lean_x, lean_y, rhs, x] {
            vector.clear();
            vector.resize(length, 0.0);
        }
        line.clear();
        line.resize(columns, 0.0);
    }

    /// Completes a level whose edges are set.
    pub(super) fn finish(&mut self) {
        let w = self.width;
        for i in w..self.right.len() - w {
            let edges = self.right[i] + self.right[i - 1] + self.below[i] + self.below[i - w];
            let diagonal = edges + self.anchor[i];
            self.inverse[i] = if diagonal > 0.0 {
                diagonal.recip()
            } else {
                0.0
            };
            self.lean_x[i] = lean(self.right[i - 1], self.right[i], i % w % 2 == 1);
            self.lean_y[i] = lean(self.below[i - w], self.below[i], i / w % 2 == 1);
        }
    }

    /// Gauss–Seidel in reading order from x = 0, of which neither the right nor the lower neighbours are felt.
    pub(super) fn relax_from_zero(&mut self) {
        let (w, n) = (self.width, self.width - 2);
        for r in 1..=self.rows {
            let at = r * w + 1;
            let (before, here) = self.x.split_at_mut(at);
            let above = &before[at - w..][..n];
            let here = &mut here[..n];
            let (inverse, rhs) = (&self.inverse[at..][..n], &self.rhs[at..][..n]);
            let (upper, left) = (&self.below[at - w..][..n], &self.right[at - 1..][..n]);
            for i in 0..n {
                here[i] = inverse[i] * (rhs[i] + FLOOR + upper[i] * above[i]);
            }
            let mut last = 0.0;
            for i in 0..n {
                last = here[i] + inverse[i] * left[i] * last;
                here[i] = last;
            }
        }
    }

    /// Gauss–Seidel against reading order.
    pub(super) fn relax_backwards(&mut self) {
        let (w, n) = (self.width, self.width - 2);
        for r in (1..=self.rows).rev() {
            let at = r * w + 1;
            let line = &mut self.line[..n];
            let (inverse, rhs) = (&self.inverse[at..][..n], &self.rhs[at..][..n]);
            let (upper, lower) = (&self.below[at - w..][..n], &self.below[at..][..n]);
            let (left, right) = (&self.right[at - 1..][..n], &self.right[at..][..n]);
            let (above, under) = (&self.x[at - w..][..n], &self.x[at + w..][..n]);
            let before = &self.x[at - 1..][..n];
            for i in 0..n {
                let vertical = upper[i] * above[i] + lower[i] * under[i];
                line[i] = inverse[i] * (rhs[i] + FLOOR + vertical + left[i] * before[i]);
            }
            let here = &mut self.x[at..][..n];
            let mut last = 0.0;
            for i in (0..n).rev() {
                last = line[i] + inverse[i] * right[i] * last;
                here[i] = last;
            }
        }
    }
}

/// Share of the coarse node across the edge of a block in a linear interpolation whose flux is continuous: a quarter where
/// all weights are equal, none without an edge. `first` is the side of its block on which the node lies.
fn lean(before: f32, after: f32, first: bool) -> f32 {
    let across = if first { before } else { after };
    if across > 0.0 {
        0.5 * across / (before + after)
    } else {
        0.0
    }
}
