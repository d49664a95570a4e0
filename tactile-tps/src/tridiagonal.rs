//! Householder's tridiagonal form of a dense symmetric matrix, applied to vectors on the way.

use crate::{
    layout::PANEL,
    real::Lane,
    simd::{Job, dispatch},
};

/// A symmetric matrix with both triangles, row by row, and vectors that go with it, component by component: the j-th vector's i-th
/// component is at i × `width` + j.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tridiagonal {
    order: usize,
    stride: usize,
    pub(crate) matrix: Vec<f64>,
    pub(crate) vectors: Vec<f64>,
    width: usize,
    diagonal: Vec<f64>,
    beside: Vec<f64>,
}

impl Tridiagonal {
    /// Room for a matrix and so many vectors, all zero.
    pub(crate) fn new(order: usize, vectors: usize) -> Self {
        let [stride, width] = [order, vectors].map(|n| n.next_multiple_of(PANEL));
        Self {
            order,
            stride,
            width,
            matrix: vec![0.0; order * stride],
            vectors: vec![0.0; order * width],
            diagonal: Vec::with_capacity(order),
            beside: Vec::with_capacity(order),
        }
    }

    /// Numbers from one row of the matrix to the next, and from one component of the vectors to the next.
    pub(crate) fn strides(&self) -> [usize; 2] {
        [self.stride, self.width]
    }

    /// Turns matrix A and vectors x into T = Hᵀ A H and Hᵀ x, with H orthogonal and T tridiagonal. 4/3 n³ operations, and 2 n² a vector.
    pub(crate) fn reduce(&mut self) {
        dispatch(Reduce(self));
    }

    /// Solves (T + λ) X = B, one of M columns after the other; overwrites `b`. Positive definite T + λ needs no pivots.
    pub(crate) fn solve<const M: usize>(&self, lambda: f64, b: &mut [[f64; M]]) {
        let mut pivot = vec![0.0; self.order];
        for i in 0..self.order {
            pivot[i] = self.diagonal[i] + lambda;
            if i > 0 {
                let factor = self.beside[i - 1] / pivot[i - 1];
                pivot[i] -= factor * self.beside[i - 1];
                for m in 0..M {
                    b[i][m] -= factor * b[i - 1][m];
                }
            }
        }
        for i in (0..self.order).rev() {
            for m in 0..M {
                if i + 1 < self.order {
                    b[i][m] -= self.beside[i] * b[i + 1][m];
                }
                b[i][m] /= pivot[i];
            }
        }
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
            vectors,
            width,
            diagonal,
            beside,
        } = self.0;
        let (order, stride, width) = (*order, *stride, *width);
        let (mut v, mut w) = (vec![0.0; stride], vec![0.0; stride]);
        let mut sums = vec![0.0; width];
        for k in 0..order {
            diagonal.push(matrix[k * stride + k]);
            if k + 1 == order {
                break;
            }
            // Whole vectors from the one that holds k + 1; what lies before is zero in v.
            let from = (k + 1) / PANEL * PANEL;
            v[from..].copy_from_slice(&matrix[k * stride + from..(k + 1) * stride]);
            v[from..=k].fill(0.0);
            let (tau, side) = reflector::<L>(&mut v[from..], k + 1 - from);
            beside.push(side);
            if tau == 0.0 {
                continue;
            }
            // w = τ A v − ½ τ² (vᵀ A v) v.
            w[from..].fill(0.0);
            let rows = &matrix[(k + 1) * stride..order * stride];
            combine::<L>(&mut w[from..], rows, stride, from, &v[k + 1..order]);
            w[from..].iter_mut().for_each(|w| *w *= tau);
            let half = L::new(-0.5 * tau * dot::<L>(&w[from..], &v[from..]));
            for (w, v) in w[from..].iter_mut().zip(&v[from..]) {
                *w = half.mul_add(L::new(*v), L::new(*w)).get();
            }
            for j in k + 1..order {
                let row = &mut matrix[j * stride + from..(j + 1) * stride];
                let (by_v, by_w) = (L::new(-w[j]), L::new(-v[j]));
                for ((a, v), w) in row.iter_mut().zip(&v[from..]).zip(&w[from..]) {
                    let sum = by_v.mul_add(L::new(*v), L::new(*a));
                    *a = by_w.mul_add(L::new(*w), sum).get();
                }
            }
            sums.fill(0.0);
            let rows = &vectors[(k + 1) * width..order * width];
            combine::<L>(&mut sums, rows, width, 0, &v[k + 1..order]);
            for i in k + 1..order {
                let factor = L::new(-tau * v[i]);
                let row = &mut vectors[i * width..(i + 1) * width];
                for (x, sum) in row.iter_mut().zip(&sums) {
                    *x = factor.mul_add(L::new(*sum), L::new(*x)).get();
                }
            }
        }
    }
}

/// y + Σ factor × row, of the rows from place `from` on; four at a time, so that y is fetched and stored a quarter as often.
#[inline(always)]
fn combine<L: Lane<f64>>(y: &mut [f64], rows: &[f64], stride: usize, from: usize, factors: &[f64]) {
    const ROWS: usize = 4;
    let row = |i: usize| &rows[i * stride + from..(i + 1) * stride];
    let (fours, rest) = factors.as_chunks::<ROWS>();
    for (four, factors) in fours.iter().enumerate() {
        let factors = factors.map(L::new);
        let [a, b, c, d] = core::array::from_fn(|l| &row(ROWS * four + l)[..y.len()]);
        for (i, y) in y.iter_mut().enumerate() {
            let mut sum = L::new(*y);
            for (factor, x) in factors.into_iter().zip([a[i], b[i], c[i], d[i]]) {
                sum = factor.mul_add(L::new(x), sum);
            }
            *y = sum.get();
        }
    }
    for (i, &factor) in rest.iter().enumerate() {
        let factor = L::new(factor);
        for (y, x) in y.iter_mut().zip(row(ROWS * fours.len() + i)) {
            *y = factor.mul_add(L::new(*x), L::new(*y)).get();
        }
    }
}

/// Turns x into v with v[head] = 1 and (1 − τ v vᵀ) x = β e_head; returns τ and β.
#[inline(always)]
fn reflector<L: Lane<f64>>(x: &mut [f64], head: usize) -> (f64, f64) {
    let (top, norm) = (x[head], dot::<L>(x, x).sqrt());
    let beta = if top > 0.0 { -norm } else { norm };
    if norm == top.abs() {
        return (0.0, top);
    }
    x.iter_mut().for_each(|x| *x /= top - beta);
    x[head] = 1.0;
    ((beta - top) / beta, beta)
}

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

    #[test]
    fn solutions_are_those_of_the_dense_matrix() {
        for n in [1, 2, 3, 8, 9, 21] {
            // Diagonally dominant, and an x that reads (A + λ) x in two vectors.
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
            let probe = DVector::from_fn(n, |i, _| ((5 * i) % 7) as f64 - 3.0);
            let mut form = Tridiagonal::new(n, 2);
            let [stride, width] = form.strides();
            for i in 0..n {
                (0..n).for_each(|j| form.matrix[i * stride + j] = a[(i, j)]);
                form.vectors[i * width] = b[i];
                form.vectors[i * width + 1] = probe[i];
            }
            form.reduce();
            for lambda in [0.0, 3.0] {
                let mut x: Vec<_> = (0..n).map(|i| [form.vectors[i * width]]).collect();
                form.solve(lambda, &mut x);
                let found: f64 = (0..n).map(|i| x[i][0] * form.vectors[i * width + 1]).sum();
                let shifted = &a + lambda * DMatrix::identity(n, n);
                let expected = probe.dot(&shifted.lu().solve(&b).expect("definite"));
                assert!(
                    (found - expected).abs() < 1e-12 * n as f64,
                    "{n}: {found} {expected}"
                );
            }
        }
    }
}
