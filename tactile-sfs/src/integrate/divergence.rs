//! The right-hand side of Poisson's equation, computed row by row from the slopes.

use ndarray::{ArrayView1, ArrayView2};

use crate::{BoundingBox, Domain, Scalar, SfsError};

/// Slopes of a rectangle and how to form their divergence.
pub(super) struct Divergence<'a, T> {
    p: ArrayView2<'a, T>,
    q: ArrayView2<'a, T>,
    mask: Option<ArrayView2<'a, bool>>,
    area: BoundingBox,
    /// h_y²/(2 h_x) and h_y/2.
    scale: [T; 2],
}

/// Three lines of slopes.
#[derive(Debug, Default)]
pub(super) struct Lines<T> {
    p: Vec<T>,
    above: Vec<T>,
    here: Vec<T>,
}

impl<'a, T: Scalar> Divergence<'a, T> {
    pub(super) fn new(
        p: ArrayView2<'a, T>,
        q: ArrayView2<'a, T>,
        domain: &'a Domain<'_, T>,
        area: BoundingBox,
    ) -> Self {
        let [hx, hy] = domain.pixel_size_m;
        let half = T::of(0.5);
        let mask = domain.mask.as_ref().map(|mask| area.view(mask.view()));
        Self { p: area.view(p), q: area.view(q), mask, area, scale: [half * hy * hy / hx, half * hy] }
    }

    /// h_y² div_h for all rows.
    pub(super) fn fill(&self, lines: &mut Lines<T>, grid: &mut [T]) -> Result<(), SfsError> {
        self.fill_rows(lines, 0, grid)
    }

    /// h_y² div_h for the rows from `first` that fit into `grid`.
    pub(super) fn fill_rows(
        &self,
        lines: &mut Lines<T>,
        first: usize,
        grid: &mut [T],
    ) -> Result<(), SfsError> {
        let BoundingBox { rows, columns, .. } = self.area;
        for line in [&mut lines.p, &mut lines.above, &mut lines.here] {
            line.resize(columns, T::zero());
        }
        if first > 0 {
            self.load(self.q, first - 1, &mut lines.above)?;
        }
        self.load(self.q, first, &mut lines.here)?;
        for (i, out) in grid.chunks_mut(columns).enumerate() {
            let row = first + i;
            self.load(self.p, row, &mut lines.p)?;
            along(&lines.p, self.scale[0], out);
            // Flux (q_{r−1} + q_r)/2 enters from above, (q_r + q_{r+1})/2 leaves below; none through the border.
            let scale = self.scale[1];
            if row > 0 {
                for ((out, &above), &here) in out.iter_mut().zip(&lines.above).zip(&lines.here) {
                    *out -= scale * (above + here);
                }
            }
            core::mem::swap(&mut lines.above, &mut lines.here);
            if row + 1 < rows {
                self.load(self.q, row + 1, &mut lines.here)?;
                for ((out, &here), &below) in out.iter_mut().zip(&lines.above).zip(&lines.here) {
                    *out += scale * (here + below);
                }
            }
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
        Err(SfsError::NonFiniteSlope { row: self.area.top + row, column: self.area.left + column })
    }
}

fn clear_outside<T: Scalar>(mask: ArrayView1<'_, bool>, line: &mut [T]) {
    for (x, &inside) in line.iter_mut().zip(mask) {
        if !inside {
            *x = T::zero();
        }
    }
}

/// Differences of the means of neighbouring slopes, zero flux at both ends.
fn along<T: Scalar>(p: &[T], scale: T, out: &mut [T]) {
    let n = p.len();
    if n == 1 {
        out[0] = T::zero();
        return;
    }
    // (p_c + p_{c+1}) − (p_{c−1} + p_c) = p_{c+1} − p_{c−1} inside.
    for (out, p) in out[1..n - 1].iter_mut().zip(p.windows(3)) {
        *out = scale * (p[2] - p[0]);
    }
    out[0] = scale * (p[0] + p[1]);
    out[n - 1] = -scale * (p[n - 2] + p[n - 1]);
}
