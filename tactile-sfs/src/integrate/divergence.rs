//! The right-hand side of Poisson's equation, computed row by row from the slopes.

use ndarray::{ArrayView1, ArrayView2};

use crate::{BoundingBox, Domain, Scalar, SfsError};

/// Weights of up to five neighbours, offsets −2 to 2, whose sum is the divergence at one of `n` pixels in a line.
///
/// The rise from a pixel to the next is the integral of the cubic through the slopes around,
/// (−p₋₁ + 13 p₀ + 13 p₁ − p₂)/24, of the parabola (5 p₀ + 8 p₁ − p₂)/12 at the ends; the divergence is the difference of
/// two rises, none beyond the ends.
fn stencil<T: Scalar>(i: usize, n: usize) -> [T; 5] {
    let mut weights = [0.0; 5];
    let mut add = |edge: usize, sign: f64| {
        let (first, terms): (usize, &[f64]) = match (edge, n) {
            (_, 2) => (0, &[12.0, 12.0]),
            (0, _) => (0, &[10.0, 16.0, -2.0]),
            (edge, n) if edge + 2 == n => (edge - 1, &[-2.0, 16.0, 10.0]),
            (edge, _) => (edge - 1, &[-1.0, 13.0, 13.0, -1.0]),
        };
        for (j, term) in (first..).zip(terms) {
            weights[j + 2 - i] += sign * term / 24.0;
        }
    };
    if i + 1 < n {
        add(i, 1.0);
    }
    if i > 0 {
        add(i - 1, -1.0);
    }
    weights.map(T::of)
}

/// Slopes of a rectangle and how to form their divergence.
pub(super) struct Divergence<'a, T> {
    p: ArrayView2<'a, T>,
    q: ArrayView2<'a, T>,
    mask: Option<ArrayView2<'a, bool>>,
    area: BoundingBox,
    /// h_y²/h_x and h_y.
    scale: [T; 2],
}

/// A line of slopes along x, and a ring of five of those along y.
#[derive(Debug, Default)]
pub(super) struct Lines<T> {
    p: Vec<T>,
    q: [Vec<T>; 5],
    /// Next row to be loaded into the ring.
    next: usize,
}

impl<'a, T: Scalar> Divergence<'a, T> {
    pub(super) fn new(
        p: ArrayView2<'a, T>,
        q: ArrayView2<'a, T>,
        domain: &'a Domain<'_, T>,
        area: BoundingBox,
    ) -> Self {
        let [hx, hy] = domain.pixel_size_m;
        let mask = domain.mask.as_ref().map(|mask| area.view(mask.view()));
        Self {
            p: area.view(p),
            q: area.view(q),
            mask,
            area,
            scale: [hy * hy / hx, hy],
        }
    }

    /// h_y² div_h for all rows.
    pub(super) fn fill(&self, lines: &mut Lines<T>, grid: &mut [T]) -> Result<(), SfsError> {
        self.fill_rows(lines, 0, grid)
    }

    /// h_y² div_h for the rows from `first` that fit into `grid`; rows are asked for in order.
    pub(super) fn fill_rows(
        &self,
        lines: &mut Lines<T>,
        first: usize,
        grid: &mut [T],
    ) -> Result<(), SfsError> {
        let BoundingBox { rows, columns, .. } = self.area;
        if first == 0 {
            lines.next = 0;
            lines.p.resize(columns, T::zero());
            lines.q.iter_mut().for_each(|line| {
                line.clear();
                line.resize(columns, T::zero());
            });
        }
        for (row, out) in (first..).zip(grid.chunks_mut(columns)) {
            while lines.next < rows.min(row + 3) {
                self.load(self.q, lines.next, &mut lines.q[lines.next % 5])?;
                lines.next += 1;
            }
            self.load(self.p, row, &mut lines.p)?;
            along(&lines.p, self.scale[0], out);
            let weights = stencil(row, rows).map(|weight: T| weight * self.scale[1]);
            // Lines beyond the ends have weight 0, whatever the ring holds there.
            across(
                [3, 4, 0, 1, 2].map(|offset| &lines.q[(row + offset) % 5][..]),
                weights,
                out,
            );
        }
        Ok(())
    }

    /// Copies a row of slopes, 0 outside the mask; refuses what is not finite.
    fn load(&self, slopes: ArrayView2<'_, T>, row: usize, line: &mut [T]) -> Result<(), SfsError> {
        let from = slopes.row(row);
        match from.as_slice() {
            Some(from) => line.copy_from_slice(from),
            None => line.iter_mut().zip(from).for_each(|(to, &from)| *to = from),
        }
        if let Some(mask) = self.mask {
            clear_outside(mask.row(row), line);
        }
        // x · 0 is 0 for finite x alone.
        let poison = line.iter().fold(T::zero(), |sum, &x| sum + x * T::zero());
        if poison == T::zero() {
            return Ok(());
        }
        let column = line.iter().position(|x| !x.is_finite()).unwrap_or(0);
        Err(SfsError::NonFiniteSlope {
            row: self.area.top + row,
            column: self.area.left + column,
        })
    }
}

fn clear_outside<T: Scalar>(mask: ArrayView1<'_, bool>, line: &mut [T]) {
    for (x, &inside) in line.iter_mut().zip(mask) {
        if !inside {
            *x = T::zero();
        }
    }
}

/// The divergence along a line of slopes.
fn along<T: Scalar>(p: &[T], scale: T, out: &mut [T]) {
    let n = p.len();
    let inner = 2..n.saturating_sub(2).max(2);
    if inner.end > inner.start {
        let [far, near, ..] = stencil::<T>(2, 5).map(|weight| weight * scale);
        for (out, p) in out[inner.clone()].iter_mut().zip(p.windows(5)) {
            *out = far * (p[0] - p[4]) + near * (p[1] - p[3]);
        }
    }
    for i in (0..n).filter(|i| !inner.contains(i)) {
        let near = i.saturating_sub(2)..(i + 3).min(n);
        let weights = stencil::<T>(i, n);
        out[i] = scale * near.map(|j| weights[j + 2 - i] * p[j]).sum::<T>();
    }
}

/// Adds the weighted lines.
fn across<T: Scalar>([a, b, c, d, e]: [&[T]; 5], [v, w, x, y, z]: [T; 5], out: &mut [T]) {
    let lines = a.iter().zip(b).zip(c).zip(d).zip(e);
    for (out, ((((&a, &b), &c), &d), &e)) in out.iter_mut().zip(lines) {
        *out += v * a + w * b + x * c + y * d + z * e;
    }
}
