//! A tridiagonal form applied to columns: its reflectors, and solutions with a shift.

use super::Tridiagonal;
use crate::{layout::PANEL, real::Lane, simd::Job};

/// Columns that are reflected at once: so many sums stay in registers, and no addition waits for the one before.
pub(super) const TOGETHER: usize = 3 * PANEL;

/// Reflects columns, row by row.
pub(super) struct Turn<'a> {
    pub(super) form: &'a Tridiagonal,
    pub(super) b: &'a mut [f64],
    pub(super) width: usize,
    /// From the last reflector to the first.
    pub(super) back: bool,
}

impl Job<f64> for Turn<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<f64>>(mut self) {
        let mut at = 0;
        while at + TOGETHER <= self.width {
            self.columns::<L, TOGETHER>(at);
            at += TOGETHER;
        }
        while at < self.width {
            self.columns::<L, PANEL>(at);
            at += PANEL;
        }
    }
}

impl Turn<'_> {
    /// So many columns from the `at`-th on.
    #[inline(always)]
    fn columns<L: Lane<f64>, const W: usize>(&mut self, at: usize) {
        let (form, width) = (self.form, self.width);
        let (order, reflectors) = (form.order, form.scales.len());
        for step in 0..reflectors {
            let k = if self.back {
                reflectors - 1 - step
            } else {
                step
            };
            let v = &form.matrix[k * form.stride + k + 1..k * form.stride + order];
            let rows = &mut self.b[(k + 1) * width..order * width];
            let mut sums = [0.0; W];
            for (row, v) in rows.chunks_exact(width).zip(v) {
                let (row, v) = (&row[at..at + W], L::new(*v));
                for l in 0..W {
                    sums[l] = v.mul_add(L::new(row[l]), L::new(sums[l])).get();
                }
            }
            for (row, v) in rows.chunks_exact_mut(width).zip(v) {
                let (row, factor) = (&mut row[at..at + W], L::new(-form.scales[k] * v));
                for l in 0..W {
                    row[l] = factor.mul_add(L::new(sums[l]), L::new(row[l])).get();
                }
            }
        }
    }
}

/// Solves the tridiagonal system, each column with its own shift.
pub(super) struct Solve<'a> {
    pub(super) form: &'a Tridiagonal,
    pub(super) shifts: &'a [f64],
    pub(super) b: &'a mut [f64],
    pub(super) pivots: &'a mut [f64],
}

impl Job<f64> for Solve<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<f64>>(self) {
        let Self {
            form,
            shifts,
            b,
            pivots,
        } = self;
        let (order, width) = (form.order, shifts.len());
        for at in (0..width).step_by(PANEL) {
            let (mut pivot, mut above) = ([1.0; PANEL], [0.0; PANEL]);
            for i in 0..order {
                let beside = if i > 0 { form.beside[i - 1] } else { 0.0 };
                let place = i * width + at..i * width + at + PANEL;
                let (b, pivots) = (&mut b[place.clone()], &mut pivots[place]);
                for l in 0..PANEL {
                    let factor = beside / pivot[l];
                    pivot[l] = form.diagonal[i] + shifts[at + l] - factor * beside;
                    above[l] = b[l] - factor * above[l];
                    (pivots[l], b[l]) = (pivot[l], above[l]);
                }
            }
            let mut below = [0.0; PANEL];
            for i in (0..order).rev() {
                let beside = form.beside.get(i).copied().unwrap_or(0.0);
                let place = i * width + at..i * width + at + PANEL;
                let (b, pivots) = (&mut b[place.clone()], &pivots[place]);
                for l in 0..PANEL {
                    below[l] = (b[l] - beside * below[l]) / pivots[l];
                    b[l] = below[l];
                }
            }
        }
    }
}
