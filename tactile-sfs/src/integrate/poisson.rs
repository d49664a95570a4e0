//! Poisson's equation with natural (Neumann) borders: cosine transform in one direction,
//! tridiagonal systems in the other.
//!
//! Minimises Σ ((z_{c+1} − z_c)/h_x − p̄)² + Σ ((z_{r+1} − z_r)/h_y − q̄)². Here p̄ and q̄ are mean
//! slopes along the edge between two pixels, of the cubic through the slopes of the four pixels in
//! line with it. The equation is Δ_h z = div_h (p̄, q̄) with zero flux through the border of the
//! frame. (The usual mean of two slopes gives surfaces of second order. Exact rises give fourth
//! order.) The cosine transform along x leaves one tridiagonal system per frequency: (λ_k − δ_y²)
//! ẑ_k = f̂_k, with λ_k = (h_y/h_x)² (2 − 2 cos(π k/N)) for k from 0 to N − 1. The error is O(h⁴),
//! and O(h³) for the rises at the border. The cost is O(N M log N).
//!
//! Only one direction is transformed, because a tridiagonal solution is cheaper than a transform.

use std::sync::Arc;

use ndarray::ArrayView2;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use super::{SlopeIntegrator, load_row, write_levelled};
use crate::{BoundingBox, Domain, PixelScalar, SfsError, Surface, SurfaceWorkspace};

/// Poisson integration over the whole rectangle by a cosine transform and tridiagonal systems.
///
/// With a mask, its bounding box is solved with slopes of 0 outside the mask (no contact, flat
/// surface). For a free border along the mask use
/// [`MaskedLeastSquares`](super::MaskedLeastSquares). The mean height inside the mask is 0, or one
/// shift of all heights makes it agree with the known heights.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{CosinePoisson, Domain, SlopeIntegrator};
/// let p = Array2::from_shape_fn((8, 9), |(_, column)| 2.0 * column as f64);
/// let surface =
///     CosinePoisson.integrate(p.view(), Array2::zeros((8, 9)).view(), &Domain::default())?;
/// // z = x²: rises are exact for slopes up to cubic polynomials.
/// assert!((surface.heights[[3, 8]] - surface.heights[[3, 0]] - 64.0).abs() < 1e-10);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CosinePoisson;

/// Plan, spectrum and lines, kept between calls.
#[derive(Default)]
pub(crate) struct PoissonBuffers {
    transform: Option<CosineTransform>,
    pivots: Vec<[f64; LANES]>,
    /// A row of slopes along x, and a ring buffer of four rows of slopes along y.
    p: Vec<f64>,
    q: [Vec<f64>; 4],
    /// Right-hand side, then spectrum, then heights. A row of zeros is appended to an odd number of
    /// rows.
    grid: Vec<f64>,
}

/// The cosine transform X_k = Σ x_n cos(π k (2n + 1)/(2N)) of two rows of length N by one complex
/// Fourier transform.
///
/// The samples in the order 0, 2, 4, … 5, 3, 1 have the Fourier transform V with X_k =
/// Re(e^(−iπk/(2N)) V_k) (Makhoul, IEEE Trans. ASSP 28(1), 1980). The second row is the imaginary
/// part, which saves a quarter of the time per row.
struct CosineTransform {
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
    /// e^(−iπk/(2N)).
    twiddles: Vec<Complex<f64>>,
    /// Both rows, reordered.
    line: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

impl CosineTransform {
    fn new(length: usize) -> Self {
        let mut planner = FftPlanner::new();
        let (forward, inverse) = (
            planner.plan_fft_forward(length),
            planner.plan_fft_inverse(length),
        );
        let scratch = forward
            .get_inplace_scratch_len()
            .max(inverse.get_inplace_scratch_len());
        let step = -core::f64::consts::FRAC_PI_2 / length as f64;
        Self {
            forward,
            inverse,
            twiddles: (0..length).map(|k| Complex::cis(step * k as f64)).collect(),
            line: vec![Complex::default(); length],
            scratch: vec![Complex::default(); scratch],
        }
    }

    /// Position of a sample in the reordered line.
    fn place(&self, sample: usize) -> usize {
        let half = sample / 2;
        if sample.is_multiple_of(2) {
            half
        } else {
            self.line.len() - 1 - half
        }
    }

    /// Transforms two rows in place.
    fn forward(&mut self, a: &mut [f64], b: &mut [f64]) {
        let n = self.line.len();
        for sample in 0..n {
            let place = self.place(sample);
            self.line[place] = Complex::new(a[sample], b[sample]);
        }
        self.forward
            .process_with_scratch(&mut self.line, &mut self.scratch);
        for (k, twiddle) in self.twiddles.iter().enumerate() {
            // The transforms of the two rows are (V_k + V̄_−k)/2 and (V_k − V̄_−k)/2i.
            let (here, there) = (self.line[k], self.line[(n - k) % n].conj());
            // The symmetry in frequency separates the transforms of two real rows.
            a[k] = 0.5 * (twiddle * (here + there)).re;
            b[k] = 0.5 * (twiddle * (here - there)).im;
        }
    }

    /// N times the inverse of [`forward`](Self::forward).
    fn inverse(&mut self, a: &mut [f64], b: &mut [f64]) {
        let n = self.line.len();
        self.line[0] = Complex::new(a[0], b[0]);
        for k in 1..n {
            // The inverse of the separation above: the two rows become the real and the imaginary
            // part.
            let both = Complex::new(a[k] + b[n - k], b[k] - a[n - k]);
            self.line[k] = self.twiddles[k].conj() * both;
        }
        self.inverse
            .process_with_scratch(&mut self.line, &mut self.scratch);
        for sample in 0..n {
            let value = self.line[self.place(sample)];
            (a[sample], b[sample]) = (value.re, value.im);
        }
    }
}

/// Number of columns of the spectrum that are solved together: a block of 1000 rows fits in the
/// second-level cache.
const LANES: usize = 16;

impl<T: PixelScalar> SlopeIntegrator<T> for CosinePoisson {
    fn integrate(
        &self,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
    ) -> Result<Surface<T>, SfsError> {
        Surface::made_by(|workspace, surface| self.integrate_with(workspace, p, q, domain, surface))
    }

    fn integrate_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let area = surface.enter_slopes(p, q, domain)?;
        let buffers = &mut workspace.poisson;
        buffers.load(p, q, domain, area)?;
        let [hx, hy] = domain.pixel_size_m.map(T::as_f64);
        let (rows, columns) = (area.rows(), area.columns());
        buffers.solve(rows, columns, (hy / hx).powi(2));
        write_levelled(&buffers.grid[..rows * columns], domain, surface);
        surface.finish(domain);
        Ok(())
    }
}

impl PoissonBuffers {
    /// Fills the grid with h_y² div_h: the difference between the rises on both sides of each
    /// pixel.
    fn load<T: PixelScalar>(
        &mut self,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        area: BoundingBox,
    ) -> Result<(), SfsError> {
        let (rows, columns) = (area.rows(), area.columns());
        let [hx, hy] = domain.pixel_size_m.map(T::as_f64);
        self.grid.clear();
        self.grid.resize(rows * columns, 0.0);
        for line in self.q.iter_mut().chain([&mut self.p]) {
            line.clear();
            line.resize(columns, 0.0);
        }
        for row in 0..rows.min(2) {
            load_row(q, domain, area, row, &mut self.q[row])?;
        }
        for row in 0..rows {
            load_row(p, domain, area, row, &mut self.p)?;
            let line = &mut self.grid[row * columns..][..columns];
            add_rises(&self.p, hy * hy / hx, line);
            if row + 1 == rows {
                break;
            }
            if row + 2 < rows {
                load_row(q, domain, area, row + 2, &mut self.q[(row + 2) % 4])?;
            }
            // Lines beyond the ends have weight 0, whatever the ring buffer contains there.
            let weights = edge_weights(row, rows).map(|weight| hy * weight);
            let [before, here, after, beyond] = [3, 0, 1, 2].map(|k| &self.q[(row + k) % 4]);
            let (above, below) = self.grid[row * columns..].split_at_mut(columns);
            for c in 0..columns {
                let rise = weights[0] * before[c]
                    + weights[1] * here[c]
                    + weights[2] * after[c]
                    + weights[3] * beyond[c];
                above[c] += rise;
                below[c] -= rise;
            }
        }
        Ok(())
    }

    /// Solves (aspect² δ_x² + δ_y²) z = f in place of the grid.
    fn solve(&mut self, rows: usize, columns: usize, aspect2: f64) {
        let planned = self.transform.take();
        let mut transform = planned
            .filter(|transform| transform.line.len() == columns)
            .unwrap_or_else(|| CosineTransform::new(columns));
        self.grid.resize(rows.next_multiple_of(2) * columns, 0.0);
        for rows in self.grid.chunks_exact_mut(2 * columns) {
            let (a, b) = rows.split_at_mut(columns);
            transform.forward(a, b);
        }
        self.pivots.resize(rows, [0.0; LANES]);
        for left in (0..columns).step_by(LANES) {
            self.solve_columns(left, rows, columns, aspect2);
        }
        for rows in self.grid.chunks_exact_mut(2 * columns) {
            let (a, b) = rows.split_at_mut(columns);
            transform.inverse(a, b);
        }
        self.transform = Some(transform);
    }

    /// Thomas's algorithm for a block of columns: (λ − δ²) z = −f/N. The factor 1/N inverts the
    /// transforms.
    ///
    /// The diagonal is λ plus the number of neighbours, and the off-diagonal elements are −1.
    /// System 0 is singular. Its last pivot is taken as 1, which fixes the constant that is removed
    /// later.
    fn solve_columns(&mut self, left: usize, rows: usize, columns: usize, aspect2: f64) {
        let lanes = LANES.min(columns - left);
        let scale = -1.0 / columns as f64;
        let mut lambda = [1.0; LANES];
        for (lane, lambda) in lambda.iter_mut().enumerate().take(lanes) {
            let angle = core::f64::consts::PI * (left + lane) as f64 / (2 * columns) as f64;
            // 4 sin²(x/2) instead of 2 − 2 cos x, which suffers from cancellation at low
            // frequencies.
            *lambda = aspect2 * 4.0 * angle.sin().powi(2);
        }
        let (mut pivot, mut carry) = ([0.0; LANES], [0.0; LANES]);
        for row in 0..rows {
            let neighbours = f64::from(u8::from(row > 0) + u8::from(row + 1 < rows));
            let line = &mut self.grid[row * columns + left..][..lanes];
            for (((x, carry), pivot), lambda) in
                line.iter_mut().zip(&mut carry).zip(&mut pivot).zip(lambda)
            {
                let sum = scale * *x + *pivot * *carry;
                // Values that decay towards subnormal numbers, which are slow, are set to 0.
                *carry = if sum.abs() < 1e-290 { 0.0 } else { sum };
                *x = *carry;
                *pivot = (lambda + neighbours - *pivot).recip();
            }
            if left == 0 && row + 1 == rows {
                pivot[0] = 1.0;
            }
            self.pivots[row] = pivot;
        }
        carry = [0.0; LANES];
        for row in (0..rows).rev() {
            let line = &mut self.grid[row * columns + left..][..lanes];
            let lines = line.iter_mut().zip(&mut carry);
            for ((x, carry), pivot) in lines.zip(&self.pivots[row]) {
                let sum = pivot * (*x + *carry);
                *carry = if sum.abs() < 1e-290 { 0.0 } else { sum };
                *x = *carry;
            }
        }
    }
}

/// Weights of the slopes at −1, 0, 1 and 2 whose sum is the mean slope from pixel 0 to pixel 1, for
/// the edge after pixel `edge` of a line of `n`. The mean slope is the integral of the cubic
/// through the four slopes, or of a parabola at the ends.
fn edge_weights(edge: usize, n: usize) -> [f64; 4] {
    let weights = match (edge, n) {
        (_, 2) => [0.0, 12.0, 12.0, 0.0],
        (0, _) => [0.0, 10.0, 16.0, -2.0],
        (edge, n) if edge + 2 == n => [-2.0, 16.0, 10.0, 0.0],
        _ => [-1.0, 13.0, 13.0, -1.0],
    };
    weights.map(|weight| weight / 24.0)
}

/// Adds the divergence along a line of slopes, times `scale`.
fn add_rises(p: &[f64], scale: f64, out: &mut [f64]) {
    let n = p.len();
    // Inside the line, the difference between the rises on both sides of a pixel is one sum over
    // five pixels.
    for (out, p) in out.iter_mut().skip(2).zip(p.windows(5)) {
        *out += scale / 24.0 * (14.0 * (p[3] - p[1]) - (p[4] - p[0]));
    }
    // Only the edges at an end contribute to its last two pixels, and no window of five does.
    let ends = |pixel: usize| pixel < 2 || pixel + 2 >= n;
    for edge in (0..n.saturating_sub(1)).filter(|&edge| ends(edge) || ends(edge + 1)) {
        let weights = edge_weights(edge, n);
        let near = (0..4).filter(|&k| weights[k] != 0.0);
        let rise = scale * near.map(|k| weights[k] * p[edge + k - 1]).sum::<f64>();
        if ends(edge) {
            out[edge] += rise;
        }
        if ends(edge + 1) {
            out[edge + 1] -= rise;
        }
    }
}
