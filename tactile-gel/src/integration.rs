//! Integration of slopes to depth, with each slope weighted by its accuracy.
//!
//! The colours give normals with equal errors everywhere. Slopes are their tangents: at a slope s
//! the error is (1 + s²)^(3/2) times as large along the slope, and √(1 + s²) times across.
//! Poisson's equation weights all slopes equally, so an error on the steep rim of a ball tilts its
//! whole cap. Here the depth z minimises Σ w_x (∂z/∂x − p)² + w_y (∂z/∂y − q)² with the inverse
//! variances w. Without steep slopes this is Poisson's equation, whose solution is the start. The
//! correction to it is smooth, and is computed on a coarse grid.

use ndarray::Array2;
use tactile_sfs::{CosinePoisson, Domain, SlopeIntegrator};

use crate::GelError;

/// Blocks along the longer side of the grid for the correction. Twice as many change the heights of
/// real balls by less than a hundredth of their error.
const BLOCKS: usize = 24;
/// Frames with fewer cells are solved pixel by pixel.
const LEAST_CELLS: usize = 8;
/// Maximum number of conjugate-gradient iterations, and the relative residual at which they stop.
const ROUNDS: usize = 60;
const ENOUGH: f64 = 1e-3;

/// Depth in units of `size`, the size of a pixel, up to a constant. `means` are the slopes on cells
/// of 2 × 2 pixels, half the size of the frame. The blur of the frames is wider than a cell, so
/// depth is solved on cells and extrapolated from their centres to the pixels with the slopes of
/// both.
pub(crate) fn integrated(
    slopes: [&Array2<f32>; 2],
    means: [&Array2<f32>; 2],
    size: f64,
) -> Result<Array2<f64>, GelError> {
    let shape = slopes[0].dim();
    if shape.0.min(shape.1) < 2 * LEAST_CELLS {
        return solved(slopes, size);
    }
    let cells = solved(means, 2.0 * size)?;
    let (high, wide) = cells.dim();
    let mut depth = Array2::zeros(shape);
    for (row, mut line) in depth.outer_iter_mut().enumerate() {
        // The last rows and columns of odd sizes are extrapolated from the last cells.
        let r = (row / 2).min(high - 1);
        let down = 0.5 * size * (row as f64 - 2.0 * r as f64 - 0.5);
        let (cells, [p, q]) = (cells.row(r), means.map(|mean| mean.row(r)));
        let own = slopes.map(|slope| slope.row(row));
        let pixel = |c: usize, right: f64, own: [f32; 2]| {
            let [p, q] = [own[0] + p[c], own[1] + q[c]].map(f64::from);
            cells[c] + 0.5 * size * right * p + down * q
        };
        let pixels = line.iter_mut().zip(own[0]).zip(own[1]).enumerate();
        for (column, ((depth, p), q)) in pixels {
            let c = (column / 2).min(wide - 1);
            *depth = pixel(c, column as f64 - 2.0 * c as f64 - 0.5, [*p, *q]);
        }
    }
    Ok(depth)
}

/// Depth from slopes on a grid, weighted by their accuracy.
fn solved(slopes: [&Array2<f32>; 2], size: f64) -> Result<Array2<f64>, GelError> {
    let [p, q] = slopes.map(|slope| slope.mapv(f64::from));
    let domain = Domain::new([size; 2])?;
    let mut depth = CosinePoisson
        .integrate(p.view(), q.view(), &domain)?
        .heights;
    let (rows, columns) = depth.dim();
    let block = rows.max(columns).div_ceil(BLOCKS).max(2);
    if rows.min(columns) >= 2 * block {
        let added = Coarse::of(slopes, &depth, size, block).depth();
        add_between(&mut depth, &added, block);
    }
    Ok(depth)
}

/// The weighted fit on blocks: weights of the edges between neighbours, and the remaining rises
/// along them. Row by row, each block has the edge to its right and the one below. Edges at the
/// border have weight zero.
struct Coarse {
    shape: (usize, usize),
    weights: [Vec<f64>; 2],
    rises: [Vec<f64>; 2],
}

impl Coarse {
    fn of(slopes: [&Array2<f32>; 2], depth: &Array2<f64>, size: f64, block: usize) -> Self {
        let (rows, columns) = depth.dim();
        let shape = (rows / block, columns / block);
        let mut means = vec![[0.0; 4]; shape.0 * shape.1];
        for row in 1..(shape.0 * block).min(rows - 1) {
            let [above, here, below] = [row - 1, row, row + 1].map(|r| depth.row(r));
            let [p, q] = slopes.map(|slope| slope.row(row));
            let blocks = &mut means[row / block * shape.1..][..shape.1];
            for (b, mean) in blocks.iter_mut().enumerate() {
                for column in (b * block).max(1)..((b + 1) * block).min(columns - 1) {
                    let [p, q] = [p, q].map(|slope| f64::from(slope[column]));
                    let x = p - (here[column + 1] - here[column - 1]) / (2.0 * size);
                    let y = q - (below[column] - above[column]) / (2.0 * size);
                    // The derivative of n/n_z by n is (1 + n nᵀ/n_z²)/n_z, and n/n_z are the
                    // slopes.
                    let up2 = 1.0 / (1.0 + p * p + q * q);
                    let across = (p * q).powi(2);
                    let [wx, wy] = [p, q].map(|s| up2 / ((1.0 + s * s).powi(2) + across));
                    let more = [wx, wy, wx * x, wy * y];
                    mean.iter_mut()
                        .zip(more)
                        .for_each(|(mean, more)| *mean += more);
                }
            }
        }
        let share = 1.0 / (block * block) as f64;
        let step = block as f64 * size;
        let (mut weights, mut rises) = ([(); 2].map(|()| Vec::new()), [(); 2].map(|()| Vec::new()));
        for (i, a) in means.iter().enumerate() {
            let inside = [(i + 1) % shape.1 != 0, i + shape.1 < means.len()];
            for (axis, ahead) in [1, shape.1].into_iter().enumerate() {
                let edge = means.get(i + ahead).filter(|_| inside[axis]).map(|b| {
                    let slope = 0.5 * (a[axis + 2] / a[axis] + b[axis + 2] / b[axis]);
                    (
                        2.0 * share * a[axis] * b[axis] / (a[axis] + b[axis]),
                        step * slope,
                    )
                });
                let (weight, rise) = edge.unwrap_or_default();
                weights[axis].push(weight);
                rises[axis].push(rise);
            }
        }
        Self {
            shape,
            weights,
            rises,
        }
    }

    /// Sums over each block of the inflow along its edges: weight times rise.
    fn inflow(&self, rise: impl Fn(usize, usize, usize) -> f64, sums: &mut [f64]) {
        sums.fill(0.0);
        for (axis, ahead) in [1, self.shape.1].into_iter().enumerate() {
            let weights = &self.weights[axis][..sums.len() - ahead];
            for (i, weight) in weights.iter().enumerate() {
                let flow = weight * rise(axis, i, i + ahead);
                sums[i] -= flow;
                sums[i + ahead] += flow;
            }
        }
    }

    /// Conjugate gradients with a diagonal preconditioner.
    fn depth(&self) -> Array2<f64> {
        let count = self.shape.0 * self.shape.1;
        let [mut left, mut moved, mut diagonal] = [(); 3].map(|()| vec![0.0; count]);
        self.inflow(|axis, i, _| self.rises[axis][i], &mut left);
        for (weights, ahead) in self.weights.iter().zip([1, self.shape.1]) {
            for (i, weight) in weights[..count - ahead].iter().enumerate() {
                diagonal[i] += weight;
                diagonal[i + ahead] += weight;
            }
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let over_diagonal = |left: &[f64]| -> Vec<f64> {
            left.iter()
                .zip(&diagonal)
                .map(|(left, d)| left / d)
                .collect()
        };
        let mut depth = vec![0.0; count];
        let mut along = over_diagonal(&left);
        let mut product = dot(&left, &along);
        let end = ENOUGH * ENOUGH * product;
        for _ in 0..ROUNDS {
            if product <= end {
                break;
            }
            self.inflow(|_, here, there| along[there] - along[here], &mut moved);
            let step = product / dot(&along, &moved);
            for i in 0..count {
                depth[i] += step * along[i];
                left[i] -= step * moved[i];
            }
            let scaled = over_diagonal(&left);
            let next = dot(&left, &scaled);
            for (along, scaled) in along.iter_mut().zip(scaled) {
                *along = scaled + *along * (next / product);
            }
            product = next;
        }
        Array2::from_shape_fn(self.shape, |(r, c)| depth[r * self.shape.1 + c])
    }
}

/// Adds values of blocks to their pixels, interpolated linearly between the centres of the blocks.
fn add_between(depth: &mut Array2<f64>, blocks: &Array2<f64>, block: usize) {
    let split = |k: usize, n: usize| {
        let at = ((k as f64 + 0.5) / block as f64 - 0.5).clamp(0.0, (n - 1) as f64);
        let low = (at as usize).min(n - 2);
        (low, at - low as f64)
    };
    let (high, wide) = blocks.dim();
    let across: Vec<(usize, f64)> = (0..depth.ncols()).map(|c| split(c, wide)).collect();
    for (row, mut line) in depth.outer_iter_mut().enumerate() {
        let (r, v) = split(row, high);
        let mixed: Vec<f64> = blocks
            .row(r)
            .iter()
            .zip(blocks.row(r + 1))
            .map(|(above, below)| (1.0 - v) * above + v * below)
            .collect();
        for (depth, &(c, u)) in line.iter_mut().zip(&across) {
            *depth += (1.0 - u) * mixed[c] + u * mixed[c + 1];
        }
    }
}
