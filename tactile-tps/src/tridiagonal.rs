//! Householder's tridiagonal form of a dense symmetric matrix.

mod apply;

use apply::{Solve, Turn};

use crate::{
    layout::PANEL,
    real::Lane,
    simd::{Job, dispatch},
};

/// A = H T Hᵀ with H orthogonal and T tridiagonal.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tridiagonal {
    order: usize,
    stride: usize,
    /// The matrix row by row, of which only the triangle from the diagonal on is read; after [`reduce`](Self::reduce) row k holds reflector k.
    pub(crate) matrix: Vec<f64>,
    /// What a reflector v is scaled with: 1 − τ v vᵀ.
    scales: Vec<f64>,
    diagonal: Vec<f64>,
    beside: Vec<f64>,
    /// The last reflector and what it takes off the matrix, the present one and its product with the matrix.
    work: [Vec<f64>; 4],
}

impl Tridiagonal {
    /// Room for a matrix of this order, all zero.
    pub(crate) fn reset(&mut self, order: usize) {
        self.order = order;
        self.stride = order.next_multiple_of(PANEL);
        self.matrix.clear();
        self.matrix.resize(order * self.stride, 0.0);
        for list in [&mut self.scales, &mut self.diagonal, &mut self.beside] {
            list.clear();
        }
        for vector in &mut self.work {
            vector.clear();
            vector.resize(self.stride, 0.0);
        }
    }

    /// Numbers from one row of the matrix to the next.
    pub(crate) fn stride(&self) -> usize {
        self.stride
    }

    /// Finds T and H. 4/3 n³ operations; the matrix goes through the caches once a reflector.
    pub(crate) fn reduce(&mut self) {
        dispatch(Reduce(self));
    }

    /// B ← Hᵀ B, B having so many columns, a multiple of eight, row by row. 2 n² operations a column.
    pub(crate) fn turn(&self, b: &mut [f64], width: usize) {
        let back = false;
        let form = self;
        dispatch(Turn {
            form,
            b,
            width,
            back,
        });
    }

    /// B ← H B.
    pub(crate) fn turn_back(&self, b: &mut [f64], width: usize) {
        let back = true;
        let form = self;
        dispatch(Turn {
            form,
            b,
            width,
            back,
        });
    }

    /// Solves (T + λ) x = b for every column of B, each with its own λ, of which `shifts` has a multiple of eight; overwrites B. Positive
    /// definite T + λ needs no pivots.
    pub(crate) fn solve(&self, shifts: &[f64], b: &mut [f64], pivots: &mut Vec<f64>) {
        pivots.clear();
        pivots.resize(self.order * shifts.len(), 0.0);
        dispatch(Solve {
            form: self,
            shifts,
            b,
            pivots,
        });
    }
}

struct Reduce<'a>(&'a mut Tridiagonal);

impl Job<f64> for Reduce<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<f64>>(self) {
        let Tridiagonal {
            order,
            stride,
            matrix,
            scales,
            diagonal,
            beside,
            work: [last, taken, v, w],
        } = self.0;
        let (order, stride) = (*order, *stride);
        for k in 0..order {
            let row = &mut matrix[k * stride..(k + 1) * stride];
            let (by_v, by_w) = (L::new(-taken[k]), L::new(-last[k]));
            for ((a, v), w) in row[k..].iter_mut().zip(&last[k..]).zip(&taken[k..]) {
                let sum = by_v.mul_add(L::new(*v), L::new(*a));
                *a = by_w.mul_add(L::new(*w), sum).get();
            }
            diagonal.push(row[k]);
            if k + 1 == order {
                break;
            }
            // Whole vectors from the one that holds k + 1; what lies before is zero in v.
            let from = (k + 1) / PANEL * PANEL;
            v[from..].copy_from_slice(&row[from..]);
            v[from..=k].fill(0.0);
            let (tau, side) = reflector::<L>(&mut v[from..], k + 1 - from);
            row[from..].copy_from_slice(&v[from..]);
            beside.push(side);
            scales.push(tau);
            // w = τ A v − ½ τ² (vᵀ A v) v; A without what the last reflector takes off, which is made up for on the way.
            w[from..].fill(0.0);
            let mut pass = Pass {
                stride,
                last,
                taken,
                v,
                product: w,
            };
            let mut j = k + 1;
            if j % 2 == 1 {
                pass.rows::<L, 1>(&mut matrix[j * stride..(j + 1) * stride], j);
                j += 1;
            }
            while j + 1 < order {
                pass.rows::<L, 2>(&mut matrix[j * stride..(j + 2) * stride], j);
                j += 2;
            }
            if j < order {
                pass.rows::<L, 1>(&mut matrix[j * stride..(j + 1) * stride], j);
            }
            w[from..].iter_mut().for_each(|w| *w *= tau);
            let half = L::new(-0.5 * tau * dot::<L>(&w[from..], &v[from..]));
            for (w, v) in w[from..].iter_mut().zip(&v[from..]) {
                *w = half.mul_add(L::new(*v), L::new(*w)).get();
            }
            core::mem::swap(last, v);
            core::mem::swap(taken, w);
        }
    }
}

/// A row's part of a panel.
type Block = [f64; PANEL];

/// What a pass over the triangle reads and adds to.
struct Pass<'a> {
    stride: usize,
    last: &'a [f64],
    taken: &'a [f64],
    v: &'a [f64],
    product: &'a mut [f64],
}

impl Pass<'_> {
    /// Takes off so many rows, of which `j` is the first and which lie in one panel, what the last reflector does, and adds to the product
    /// with v what they and the columns that mirror them have.
    #[inline(always)]
    fn rows<L: Lane<f64>, const R: usize>(&mut self, rows: &mut [f64], j: usize) {
        let start = j / PANEL * PANEL;
        let blocks = (self.stride - start) / PANEL;
        let mut sums = [[0.0; PANEL]; R];
        let mut cut = [0; R];
        for (r, cut) in cut.iter_mut().enumerate() {
            *cut = j + r - start;
        }
        self.block::<L, R>(rows, j, start, cut, &mut sums);
        for block in 1..blocks {
            self.block::<L, R>(rows, j, start + block * PANEL, [0; R], &mut sums);
        }
        for r in 0..R {
            // The diagonal is its own mirror.
            let own = rows[r * self.stride + j + r] * self.v[j + r];
            self.product[j + r] += sums[r].iter().sum::<f64>() - own;
        }
    }

    /// One panel of these rows from column `at` on; the first `cut` places of a row belong to the other triangle.
    #[inline(always)]
    fn block<L: Lane<f64>, const R: usize>(
        &mut self,
        rows: &mut [f64],
        j: usize,
        at: usize,
        cut: [usize; R],
        sums: &mut [Block; R],
    ) {
        let take = |list: &[f64]| -> Block {
            let mut block = [0.0; PANEL];
            block.copy_from_slice(&list[at..at + PANEL]);
            block
        };
        let (last, taken, v) = (take(self.last), take(self.taken), take(self.v));
        let mut product = take(self.product);
        for r in 0..R {
            let (by_v, by_w) = (L::new(-self.taken[j + r]), L::new(-self.last[j + r]));
            let own = L::new(self.v[j + r]);
            let row = &mut rows[r * self.stride + at..r * self.stride + at + PANEL];
            let mut a = [0.0; PANEL];
            a.copy_from_slice(row);
            for l in 0..PANEL {
                let sum = by_v.mul_add(L::new(last[l]), L::new(a[l]));
                a[l] = by_w.mul_add(L::new(taken[l]), sum).get();
            }
            a[..cut[r]].fill(0.0);
            for l in 0..PANEL {
                sums[r][l] = L::new(a[l]).mul_add(L::new(v[l]), L::new(sums[r][l])).get();
            }
            for l in 0..PANEL {
                product[l] = own.mul_add(L::new(a[l]), L::new(product[l])).get();
            }
            row.copy_from_slice(&a);
        }
        self.product[at..at + PANEL].copy_from_slice(&product);
    }
}

/// Turns x into the v of the reflector 1 − τ v vᵀ that takes it to a multiple of the axis `head`, before which all is zero; returns τ and that
/// multiple. Where x is one already τ is zero, and so is v.
#[inline(always)]
fn reflector<L: Lane<f64>>(x: &mut [f64], head: usize) -> (f64, f64) {
    let (top, norm) = (x[head], dot::<L>(x, x).sqrt());
    let beta = if top > 0.0 { -norm } else { norm };
    if norm == top.abs() {
        x.fill(0.0);
        return (0.0, top);
    }
    x.iter_mut().for_each(|x| *x /= top - beta);
    x[head] = 1.0;
    ((beta - top) / beta, beta)
}

/// Inner product of whole vectors, their lanes summed apart.
#[inline(always)]
fn dot<L: Lane<f64>>(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; PANEL];
    for (a, b) in a
        .as_chunks::<PANEL>()
        .0
        .iter()
        .zip(b.as_chunks::<PANEL>().0)
    {
        for l in 0..PANEL {
            sums[l] = L::new(a[l]).mul_add(L::new(b[l]), L::new(sums[l])).get();
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// x that reads (A + λ) x = b, of two λ at once, against LU.
    #[test]
    fn solutions_are_those_of_the_dense_matrix() {
        let mut form = Tridiagonal::default();
        for n in [1, 2, 3, 8, 9, 21, 40] {
            // Diagonally dominant.
            let entry = |i: usize, j: usize| {
                let (i, j) = (i.min(j), i.max(j));
                if i == j {
                    30.0
                } else {
                    ((7 * i + 3 * j) % 5) as f64 - 2.0
                }
            };
            let a = DMatrix::from_fn(n, n, entry);
            let b = DVector::from_fn(n, |i, _| 1.0 + (i % 4) as f64);
            form.reset(n);
            let stride = form.stride();
            for i in 0..n {
                (0..n).for_each(|j| {
                    // What lies below the diagonal is not read.
                    form.matrix[i * stride + j] = if j < i { f64::NAN } else { a[(i, j)] };
                });
            }
            form.reduce();
            // More columns than are turned together, and a λ for each.
            let width = apply::TOGETHER + PANEL;
            let shifts: Vec<f64> = (0..width).map(|c| (c % 4) as f64).collect();
            let mut x: Vec<f64> = (0..n * width).map(|at| b[at / width]).collect();
            form.turn(&mut x, width);
            form.solve(&shifts, &mut x, &mut Vec::new());
            form.turn_back(&mut x, width);
            for (c, shift) in shifts.iter().enumerate() {
                let shifted = &a + *shift * DMatrix::identity(n, n);
                let expected = shifted.lu().solve(&b).expect("definite");
                for i in 0..n {
                    let error = (x[i * width + c] - expected[i]).abs();
                    assert!(error < 1e-13 * n as f64, "{n}, {c}: {error}");
                }
            }
        }
    }

    /// A matrix that is tridiagonal already has nothing to reflect.
    #[test]
    fn a_tridiagonal_matrix_stays_as_it_is() {
        let mut form = Tridiagonal::default();
        form.reset(5);
        let stride = form.stride();
        for i in 0..5 {
            form.matrix[i * stride + i] = 2.0 + i as f64;
            if i < 4 {
                form.matrix[i * stride + i + 1] = -1.0;
            }
        }
        form.reduce();
        assert_eq!(form.diagonal, [2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(form.beside, [-1.0; 4]);
        assert_eq!(form.scales, [0.0; 4]);
    }
}
