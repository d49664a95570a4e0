//! Poisson's equation with natural (Neumann) borders: cosine transform in one direction, tridiagonal in the other.
//!
//! Minimises Σ ((z_{c+1} − z_c)/h_x − p̄)² + Σ ((z_{r+1} − z_r)/h_y − q̄)², p̄ and q̄ the means along the edge of the cubic
//! through the slopes of the four pixels in line with it: Δ_h z = div_h (p̄, q̄) with zero flux through the frame's border.
//! (The usual mean of two slopes makes surfaces of second order; exact rises make them of fourth.) The cosine transform
//! along x turns it into one tridiagonal system per frequency, (λ_k − δ_y²) ẑ_k = f̂_k, with
//! λ_k = (h_y/h_x)² (2 − 2 cos(π k/N)), k = 0 … N−1 (0 included: with 1 … N, a known mistake, surfaces come out too flat).
//! Error O(h⁴), O(h³) in the rises at the border; cost O(N M log N).
//!
//! Only one direction is transformed because a tridiagonal solve is cheaper than a transform, and because the direction
//! whose length has the smaller prime factors can be taken.

use ndarray::ArrayView2;

use super::SlopeIntegrator;
use super::cosine_transform::CosineTransform;
use super::divergence::{Divergence, Lines};
use super::shift::write_levelled;
use super::tridiagonal::Tridiagonal;
use crate::{BoundingBox, Domain, Scalar, SfsError, Surface, Workspace};

/// Poisson integration over the whole rectangle by a cosine transform and tridiagonal solves.
///
/// With a mask, the bounding box is solved and slopes outside the mask are taken as 0 (flat where nothing touches);
/// for a free border along the mask use [`MaskedLeastSquares`](super::MaskedLeastSquares). The mean height inside the
/// mask is 0, or what the known heights demand (one shift for all).
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{CosinePoisson, Domain, SlopeIntegrator};
/// let p = Array2::from_shape_fn((8, 9), |(_, column)| 2.0 * column as f64);
/// let surface = CosinePoisson.integrate(p.view(), Array2::zeros((8, 9)).view(), &Domain::default())?;
/// // z = x²: rises are exact for slopes up to cubic ones.
/// assert!((surface.heights[[3, 8]] - surface.heights[[3, 0]] - 64.0).abs() < 1e-10);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CosinePoisson;

/// Plan, spectrum and lines, kept between calls.
#[derive(Default)]
pub(crate) struct PoissonBuffers<T> {
    transform: Option<CosineTransform<T>>,
    tridiagonal: Tridiagonal<T>,
    lines: Lines<T>,
    /// Right-hand side, spectrum and heights in turn, a line of the transformed direction after the other.
    pub(super) grid: Vec<T>,
    turned: Vec<T>,
    spare: Vec<T>,
}

impl<T: Scalar> SlopeIntegrator<T> for CosinePoisson {
    fn integrate_with(
        &self,
        workspace: &mut Workspace<T>,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let area = surface.enter_slopes(p, q, domain)?;
        let buffers = &mut workspace.poisson;
        let source = Divergence::new(p, q, domain, area);
        resize(&mut buffers.grid, area.area());
        let [hx, hy] = domain.pixel_size_m;
        if transform_cost(area.columns) <= 2.0 * transform_cost(area.rows) {
            buffers.solve(area.rows, area.columns, hy / hx, Some(&source))?;
        } else {
            source.fill(&mut buffers.lines, &mut buffers.grid)?;
            buffers.solve_turned(area, hx / hy)?;
        }
        write_levelled(&buffers.grid, domain, surface);
        surface.finish(domain);
        Ok(())
    }
}

impl<T: Scalar> PoissonBuffers<T> {
    /// Solves with rows and columns exchanged; the right-hand side is in `grid`, `aspect` = h_x/h_y.
    fn solve_turned(&mut self, area: BoundingBox, aspect: T) -> Result<(), SfsError> {
        resize(&mut self.turned, area.area());
        turn(&self.grid, area.columns, &mut self.turned);
        core::mem::swap(&mut self.grid, &mut self.turned);
        self.solve(area.columns, area.rows, aspect, None)?;
        turn(&self.grid, area.rows, &mut self.turned);
        core::mem::swap(&mut self.grid, &mut self.turned);
        // The right-hand side was in units of h_y², the turned problem wants h_x².
        self.grid.iter_mut().for_each(|z| *z *= aspect * aspect);
        Ok(())
    }

    /// Solves (aspect² δ_x² + δ_y²) z = f in place of `grid`; f comes from `source` line by line, or is in `grid`.
    fn solve(
        &mut self,
        rows: usize,
        columns: usize,
        aspect: T,
        source: Option<&Divergence<'_, T>>,
    ) -> Result<(), SfsError> {
        if self
            .transform
            .as_ref()
            .is_none_or(|transform| transform.length() != columns)
        {
            self.transform = Some(CosineTransform::new(columns));
        }
        let Some(transform) = self.transform.as_mut() else {
            return Ok(());
        };
        resize(&mut self.spare, columns);
        for (pair, lines) in self.grid.chunks_mut(2 * columns).enumerate() {
            if let Some(source) = source {
                source.fill_rows(&mut self.lines, 2 * pair, lines)?;
            }
            let (a, b) = lines.split_at_mut(columns);
            transform.forward(a, if b.is_empty() { &mut self.spare } else { b });
        }
        let scale = -1.0 / columns as f64;
        self.tridiagonal
            .solve(&mut self.grid, rows, columns, aspect * aspect, scale);
        for lines in self.grid.chunks_mut(2 * columns) {
            let (a, b) = lines.split_at_mut(columns);
            transform.inverse(a, if b.is_empty() { &mut self.spare } else { b });
        }
        Ok(())
    }
}

/// Operations of a Fourier transform per element, roughly: the sum of the prime factors, doubled for those that the
/// library has no kernel for.
fn transform_cost(length: usize) -> f64 {
    let (mut rest, mut cost, mut factor) = (length, 1.0, 2);
    while rest > 1 {
        if rest % factor == 0 {
            rest /= factor;
            // Rader's and Bluestein's algorithms cost a few transforms of smooth length, whatever the prime.
            cost += if factor <= 31 { factor as f64 } else { 60.0 };
        } else {
            factor += 1;
        }
    }
    cost
}

/// Transposes blocks of a matrix with `columns` columns.
fn turn<T: Scalar>(from: &[T], columns: usize, to: &mut [T]) {
    const BLOCK: usize = 16;
    let rows = from.len() / columns;
    for top in (0..rows).step_by(BLOCK) {
        for left in (0..columns).step_by(BLOCK) {
            for r in top..(top + BLOCK).min(rows) {
                for c in left..(left + BLOCK).min(columns) {
                    to[c * rows + r] = from[r * columns + c];
                }
            }
        }
    }
}

/// Sets the length; what is in the buffer does not matter.
pub(super) fn resize<T: Scalar>(buffer: &mut Vec<T>, length: usize) {
    buffer.resize(length, T::zero());
}
