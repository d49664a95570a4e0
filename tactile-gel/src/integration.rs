//! Slopes to depth, each slope by what it is worth.
//!
//! The colours give normals whose errors are alike everywhere. Slopes are their tangents: at a slope s
//! the error is (1 + s²)^(3/2) times as large along it, and √(1 + s²) across. Poisson's equation takes
//! all slopes for equally good, so that what is wrong on the steep rim of a ball tilts its whole cap.
//! The depth z minimises Σ w_x (∂z/∂x − p)² + w_y (∂z/∂y − q)² with the inverse variances w. Where no
//! slope is steep this is Poisson's equation, whose solution is the start. What is added to it is
//! smooth, and is found on a coarse grid.

use ndarray::Array2;
use tactile_sfs::{CosinePoisson, Domain, SlopeIntegrator};

use crate::GelError;

/// Blocks along the longer side of a frame that the added depth is found on. Twice as many change the
/// heights of real balls by less than a hundredth of their error.
const BLOCKS: usize = 40;
/// Rounds of conjugate gradients at most, and the share of the residual at which they end.
const ROUNDS: usize = 60;
const ENOUGH: f64 = 1e-3;

/// Depth in the unit of `size`, that of a pixel, up to a constant.
pub fn integrated(slopes: [&Array2<f32>; 2], size: f64) -> Result<Array2<f64>, GelError> {
    let [p, q] = slopes.map(|slope| slope.mapv(f64::from));
    let domain = Domain::new([size; 2])?;
    let mut depth = CosinePoisson
        .integrate(p.view(), q.view(), &domain)?
        .heights;
    let (rows, columns) = depth.dim();
    let block = rows.max(columns).div_ceil(BLOCKS).max(4);
    if rows.min(columns) >= 2 * block {
        let added = Coarse::of(slopes, &depth, size, block).depth();
        add_between(&mut depth, &added, block);
    }
    Ok(depth)
}

/// The weighted fit on blocks of pixels: what the edges between neighbours weigh, and the rises that
/// are left along them.
struct Coarse {
    /// Of the edges to the right and downwards from every block, zero at the border.
    weights: [Array2<f64>; 2],
    rises: [Array2<f64>; 2],
}

impl Coarse {
    fn of(slopes: [&Array2<f32>; 2], depth: &Array2<f64>, size: f64, block: usize) -> Self {
        let (rows, columns) = depth.dim();
        let shape = (rows / block, columns / block);
        let mut means = [(); 4].map(|()| Array2::<f64>::zeros(shape));
        // Every other pixel of every other row is enough for a mean.
        let last = [shape.0 * block, shape.1 * block];
        for row in (1..last[0].min(rows - 1)).step_by(2) {
            for column in (1..last[1].min(columns - 1)).step_by(2) {
                let [p, q] = slopes.map(|slope| f64::from(slope[[row, column]]));
                let [left, right] = [column - 1, column + 1].map(|c| depth[[row, c]]);
                let [above, below] = [row - 1, row + 1].map(|r| depth[[r, column]]);
                let [x, y] = [
                    p - (right - left) / (2.0 * size),
                    q - (below - above) / (2.0 * size),
                ];
                // The derivative of n/n_z by n is (1 + n nᵀ/n_z²)/n_z, and n/n_z are the slopes.
                let up2 = 1.0 / (1.0 + p * p + q * q);
                let across = (p * q).powi(2);
                let [wx, wy] = [p, q].map(|s| up2 / ((1.0 + s * s).powi(2) + across));
                let at = [row / block, column / block];
                for (mean, more) in means.iter_mut().zip([wx, wy, wx * x, wy * y]) {
                    mean[at] += more;
                }
            }
        }
        let [wx, wy, x, y] = means;
        let share = 4.0 / (block * block) as f64;
        let step = block as f64 * size;
        let edges = |weights: &Array2<f64>, sums: &Array2<f64>, ahead: [usize; 2]| {
            let mut edges = [(); 2].map(|()| Array2::<f64>::zeros(shape));
            for ((r, c), a) in weights.indexed_iter() {
                let there = [r + ahead[0], c + ahead[1]];
                if let Some(b) = weights.get(there) {
                    let slope = 0.5 * (sums[[r, c]] / a + sums[there] / b);
                    edges[0][[r, c]] = 2.0 * share * a * b / (a + b);
                    edges[1][[r, c]] = step * slope;
                }
            }
            edges
        };
        let [across, down] = [edges(&wx, &x, [0, 1]), edges(&wy, &y, [1, 0])];
        let ([wx, x], [wy, y]) = (across, down);
        Self {
            weights: [wx, wy],
            rises: [x, y],
        }
    }

    /// Sums over each block of what flows in along its edges.
    fn inflow(&self, flow: impl Fn(usize, [usize; 2], [usize; 2]) -> f64) -> Array2<f64> {
        let (rows, columns) = self.weights[0].dim();
        let mut sums = Array2::<f64>::zeros((rows, columns));
        for r in 0..rows {
            for c in 0..columns {
                for (axis, there) in [[r, c + 1], [r + 1, c]].into_iter().enumerate() {
                    if there[0] < rows && there[1] < columns {
                        let flow = self.weights[axis][[r, c]] * flow(axis, [r, c], there);
                        sums[[r, c]] -= flow;
                        sums[there] += flow;
                    }
                }
            }
        }
        sums
    }

    /// Conjugate gradients, with the diagonal as preconditioner.
    fn depth(&self) -> Array2<f64> {
        let mut left = self.inflow(|axis, here, _| self.rises[axis][here]);
        let mut diagonal = Array2::<f64>::zeros(left.dim());
        for (r, c) in ndarray::indices(left.dim()) {
            let [wx, wy] = self.weights.each_ref().map(|w| w[[r, c]]);
            diagonal[[r, c]] += wx + wy;
            if let Some(d) = diagonal.get_mut([r, c + 1]) {
                *d += wx;
            }
            if let Some(d) = diagonal.get_mut([r + 1, c]) {
                *d += wy;
            }
        }
        let mut depth = Array2::<f64>::zeros(left.dim());
        let mut scaled = &left / &diagonal;
        let mut along = scaled.clone();
        let mut product = (&left * &scaled).sum();
        let end = ENOUGH * ENOUGH * product;
        for _ in 0..ROUNDS {
            if product <= end {
                break;
            }
            let moved = self.inflow(|_, here, there| along[there] - along[here]);
            let step = product / (&along * &moved).sum();
            depth.scaled_add(step, &along);
            left.scaled_add(-step, &moved);
            scaled = &left / &diagonal;
            let next = (&left * &scaled).sum();
            along = &scaled + &(&along * (next / product));
            product = next;
        }
        depth
    }
}

/// Adds values of blocks to their pixels, linearly between the blocks' middles.
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
