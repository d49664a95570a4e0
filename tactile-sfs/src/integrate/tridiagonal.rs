//! One tridiagonal system per column of a spectrum, a block of columns at a time.
//!
//! System k is (λ_k − δ²) z = f with Neumann ends: diagonal λ_k + 2 (λ_k + 1 at the ends), −1 beside it. Elimination has
//! the pivots c_0 = 1/(λ + 1), c_r = 1/(λ + 2 − c_{r−1}), which converge to a fixed point: once a block's pivots repeat
//! to the last bit, no division is needed any more. Systems of low frequency, whose pivots are close to 1, are solved in
//! f64 for both float types: in `f32` 2 + λ would lose λ.

use crate::Scalar;

/// Columns solved together: four to eight SIMD registers, and a block of 1000 rows stays in the second-level cache.
const BLOCK: usize = 16;

/// Below this λ systems are solved in f64: single precision would leave less than 6 digits of λ in 2 + λ.
const WIDE_BELOW: f64 = 0.2;

/// Pivots of one block, kept between calls to save the allocation.
#[derive(Debug, Default)]
pub(super) struct Tridiagonal<T> {
    pivots: Vec<[T; BLOCK]>,
    wide: Wide,
    /// Column 0, which is solved by summing.
    constant: Vec<T>,
}

impl<T: Scalar> Tridiagonal<T> {
    /// Solves for every column of `grid`, whose right-hand sides are multiplied by `scale`; system 0, which is
    /// singular, gets the solution of mean 0.
    pub(super) fn solve(
        &mut self,
        grid: &mut [T],
        rows: usize,
        columns: usize,
        aspect2: T,
        scale: f64,
    ) {
        self.pivots.resize(rows, [T::zero(); BLOCK]);
        self.wide.resize(rows);
        for left in (0..columns).step_by(BLOCK) {
            let lanes = BLOCK.min(columns - left);
            let mut lambda = [1.0; BLOCK];
            for (lane, lambda) in lambda.iter_mut().enumerate().take(lanes) {
                let sine =
                    (core::f64::consts::PI * (left + lane) as f64 / (2 * columns) as f64).sin();
                *lambda = aspect2.as_f64() * 4.0 * sine * sine;
            }
            if left == 0 {
                // Whatever this solves for lane 0 is overwritten below.
                lambda[0] = 1.0;
                self.sum_constant(grid, columns, scale);
            }
            let block = Block {
                rows,
                stride: columns,
                lanes,
            };
            if lambda[..lanes].iter().any(|&lambda| lambda < WIDE_BELOW) {
                self.wide.solve(&mut grid[left..], &block, &lambda, scale);
            } else {
                self.narrow(&mut grid[left..], &block, &lambda.map(T::of), T::of(scale));
            }
        }
        for (row, &height) in self.constant.iter().enumerate() {
            grid[row * columns] = height;
        }
    }

    /// Solves −δ² z = f for column 0 with mean 0: z_{r+1} − z_r = −Σ_{i ≤ r} f_i, summed in f64.
    fn sum_constant(&mut self, grid: &[T], columns: usize, scale: f64) {
        self.constant.clear();
        let (mut flux, mut height, mut sum) = (0.0, 0.0, 0.0);
        for line in grid.chunks(columns) {
            self.constant.push(T::of(height));
            sum += height;
            flux += line[0].as_f64() * scale;
            height -= flux;
        }
        let mean = T::of(sum / self.constant.len() as f64);
        self.constant.iter_mut().for_each(|z| *z -= mean);
    }

    fn narrow(&mut self, grid: &mut [T], block: &Block, lambda: &[T; BLOCK], scale: T) {
        let &Block {
            rows,
            stride,
            lanes,
        } = block;
        let settled = factor(&mut self.pivots, rows, lambda);
        let mut carry = [T::zero(); BLOCK];
        let mut before = [T::zero(); BLOCK];
        for r in 0..rows {
            let line = &mut grid[r * stride..r * stride + lanes];
            for ((x, carry), &pivot) in line.iter_mut().zip(&mut carry).zip(&before) {
                *carry = flush(scale * *x + pivot * *carry);
                *x = *carry;
            }
            before = self.pivots[r.min(settled)];
        }
        carry = [T::zero(); BLOCK];
        let last = last(&self.pivots, rows, settled, lambda);
        for r in (0..rows).rev() {
            let pivots = if r + 1 == rows {
                &last
            } else {
                &self.pivots[r.min(settled)]
            };
            let line = &mut grid[r * stride..r * stride + lanes];
            for ((x, carry), &pivot) in line.iter_mut().zip(&mut carry).zip(pivots) {
                *carry = flush(pivot * (*x + *carry));
                *x = *carry;
            }
        }
    }
}

/// Shape of a block of columns.
struct Block {
    rows: usize,
    stride: usize,
    lanes: usize,
}

/// Pivots and intermediate results of blocks solved in f64.
#[derive(Debug, Default)]
struct Wide {
    pivots: Vec<[f64; BLOCK]>,
    values: Vec<[f64; BLOCK]>,
}

impl Wide {
    fn resize(&mut self, rows: usize) {
        self.pivots.resize(rows, [0.0; BLOCK]);
        self.values.resize(rows, [0.0; BLOCK]);
    }

    fn solve<T: Scalar>(
        &mut self,
        grid: &mut [T],
        block: &Block,
        lambda: &[f64; BLOCK],
        scale: f64,
    ) {
        let &Block {
            rows,
            stride,
            lanes,
        } = block;
        let settled = factor(&mut self.pivots, rows, lambda);
        let (mut carry, mut before) = ([0.0; BLOCK], [0.0; BLOCK]);
        for r in 0..rows {
            let line = &grid[r * stride..r * stride + lanes];
            for ((&x, carry), &pivot) in line.iter().zip(&mut carry).zip(&before) {
                *carry = scale * x.as_f64() + pivot * *carry;
            }
            self.values[r] = carry;
            before = self.pivots[r.min(settled)];
        }
        carry = [0.0; BLOCK];
        let last = last(&self.pivots, rows, settled, lambda);
        for r in (0..rows).rev() {
            let pivots = if r + 1 == rows {
                &last
            } else {
                &self.pivots[r.min(settled)]
            };
            for ((&y, carry), &pivot) in self.values[r].iter().zip(&mut carry).zip(pivots) {
                *carry = pivot * (y + *carry);
            }
            let line = &mut grid[r * stride..r * stride + lanes];
            line.iter_mut()
                .zip(&carry)
                .for_each(|(x, &carry)| *x = T::of(carry));
        }
    }
}

/// 0 for what is so small that it would decay into subnormal numbers, which are slow.
#[inline(always)]
fn flush<T: Scalar>(x: T) -> T {
    if x.abs() < T::min_positive_value() / T::epsilon() {
        T::zero()
    } else {
        x
    }
}

/// Pivots of all rows but the last; returns the row from which on they repeat.
fn factor<T: Scalar>(pivots: &mut [[T; BLOCK]], rows: usize, lambda: &[T; BLOCK]) -> usize {
    let two = T::of(2.0);
    let mut pivot = lambda.map(|lambda| (lambda + T::one()).recip());
    pivots[0] = pivot;
    for (r, slot) in pivots.iter_mut().enumerate().take(rows).skip(1) {
        let mut next = pivot;
        for (next, &lambda) in next.iter_mut().zip(lambda) {
            *next = (lambda + two - *next).recip();
        }
        *slot = next;
        if next == pivot {
            return r;
        }
        pivot = next;
    }
    rows - 1
}

/// Pivot of the last row, which has one neighbour (none if it is the only row).
fn last<T: Scalar>(
    pivots: &[[T; BLOCK]],
    rows: usize,
    settled: usize,
    lambda: &[T; BLOCK],
) -> [T; BLOCK] {
    let mut last = *lambda;
    if rows == 1 {
        return last.map(T::recip);
    }
    for (pivot, before) in last.iter_mut().zip(pivots[(rows - 2).min(settled)]) {
        *pivot = (*pivot + T::one() - before).recip();
    }
    last
}
