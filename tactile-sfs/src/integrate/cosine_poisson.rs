//! Poisson's equation with natural (Neumann) borders: cosine transform in one direction, tridiagonal in the other.
//!
//! Minimises Σ ((z_{c+1} − z_c)/h_x − p̄)² + Σ ((z_{r+1} − z_r)/h_y − q̄)², p̄ and q̄ the means of the slopes at the two
//! pixels: Δ_h z = div_h (p̄, q̄) with zero flux through the frame's border. The cosine transform along x turns it into
//! one tridiagonal system per frequency, (λ_k − δ_y²) ẑ_k = f̂_k, with λ_k = (h_y/h_x)² (2 − 2 cos(π k/N)), k = 0 … N−1
//! (0 included: with 1 … N, a known mistake, surfaces come out too flat). Error O(h²), cost O(N M log N).

use ndarray::ArrayView2;

use super::SlopeIntegrator;
use super::cosine_transform::CosineTransform;
use crate::domain::same_shape;
use crate::error::Input;
use crate::{BoundingBox, Domain, Scalar, SfsError, Surface, Workspace};

/// Poisson integration over the whole rectangle; with a mask, over its bounding box, slopes outside the mask being 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CosinePoisson;

impl CosinePoisson {
    /// The integrator; it has no options.
    pub fn new() -> Self {
        Self
    }
}

/// Plan and spectrum, kept between calls.
#[derive(Default)]
pub(crate) struct PoissonBuffers<T> {
    transform: Option<CosineTransform<T>>,
    grid: Vec<T>,
    spare: Vec<T>,
    pivots: Vec<T>,
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
        let (rows, columns) = p.dim();
        let area = domain.validate(rows, columns)?;
        same_shape(Input::SlopeY, [rows, columns], q.dim())?;
        let buffers = &mut workspace.poisson;
        divergence(&mut buffers.grid, p, q, domain, area)?;
        let [hx, hy] = domain.pixel_size_m;
        buffers.solve(area.rows, area.columns, (hy / hx) * (hy / hx));
        surface.prepare(rows, columns, area);
        write(&buffers.grid, domain, surface);
        surface.finish(domain);
        Ok(())
    }
}

/// h_y² div_h of the slopes in the box; slopes outside the mask are 0.
fn divergence<T: Scalar>(
    grid: &mut Vec<T>,
    p: ArrayView2<'_, T>,
    q: ArrayView2<'_, T>,
    domain: &Domain<'_, T>,
    area: BoundingBox,
) -> Result<(), SfsError> {
    let (p, q) = (area.view(p), area.view(q));
    let inside = |r: usize, c: usize| domain.contains(area.top + r, area.left + c);
    let [hx, hy] = domain.pixel_size_m;
    let half = T::of(0.5);
    grid.clear();
    grid.resize(area.area(), T::zero());
    for r in 0..area.rows {
        for c in 0..area.columns {
            if !inside(r, c) {
                continue;
            }
            let (flux_x, flux_y) = (p[[r, c]] * half * hy * hy / hx, q[[r, c]] * half * hy);
            if !(flux_x.is_finite() && flux_y.is_finite()) {
                return Err(SfsError::NonFiniteSlope { row: area.top + r, column: area.left + c });
            }
            let i = r * area.columns + c;
            if c + 1 < area.columns {
                grid[i] += flux_x;
                grid[i + 1] -= flux_x;
            }
            if c > 0 {
                grid[i - 1] += flux_x;
                grid[i] -= flux_x;
            }
            if r + 1 < area.rows {
                grid[i] += flux_y;
                grid[i + area.columns] -= flux_y;
            }
            if r > 0 {
                grid[i - area.columns] += flux_y;
                grid[i] -= flux_y;
            }
        }
    }
    Ok(())
}

impl<T: Scalar> PoissonBuffers<T> {
    /// Solves (δ_x² · aspect + δ_y²) z = grid in place, mean 0.
    fn solve(&mut self, rows: usize, columns: usize, aspect: T) {
        if self.transform.as_ref().is_none_or(|transform| transform.length() != columns) {
            self.transform = Some(CosineTransform::new(columns));
        }
        let Some(transform) = self.transform.as_mut() else { return };
        self.spare.clear();
        self.spare.resize(columns, T::zero());
        let mut both = |grid: &mut [T], forward: bool| {
            for lines in grid.chunks_mut(2 * columns) {
                let (a, b) = lines.split_at_mut(columns);
                let b = if b.is_empty() { &mut self.spare[..] } else { b };
                if forward { transform.forward(a, b) } else { transform.inverse(a, b) }
            }
        };
        both(&mut self.grid, true);
        let scale = T::one() / T::of(columns as f64);
        self.pivots.clear();
        self.pivots.resize(rows, T::zero());
        for k in 0..columns {
            let cosine = (core::f64::consts::PI * k as f64 / columns as f64 / 2.0).sin();
            let lambda = aspect * T::of(4.0 * cosine * cosine);
            tridiagonal(&mut self.grid[k..], columns, rows, lambda, scale, &mut self.pivots);
        }
        both(&mut self.grid, false);
    }
}

/// Solves (δ² − λ) z = f along one column of the spectrum, times `scale`; mean 0 for λ = 0.
fn tridiagonal<T: Scalar>(
    column: &mut [T],
    stride: usize,
    rows: usize,
    lambda: T,
    scale: T,
    pivots: &mut [T],
) {
    for r in 0..rows {
        let neighbours = T::of(f64::from(u8::from(r > 0)) + f64::from(u8::from(r + 1 < rows)));
        let mut diagonal = lambda + neighbours;
        let mut value = -column[r * stride] * scale;
        if r > 0 {
            diagonal -= pivots[r - 1];
            value += pivots[r - 1] * column[(r - 1) * stride];
        }
        let singular = lambda == T::zero() && r + 1 == rows;
        column[r * stride] = if singular { T::zero() } else { value };
        pivots[r] = if singular { T::zero() } else { T::one() / diagonal };
    }
    for r in (0..rows).rev() {
        let above = if r + 1 < rows { column[(r + 1) * stride] } else { T::zero() };
        column[r * stride] = pivots[r] * (column[r * stride] + above);
    }
    if lambda == T::zero() {
        let sum: f64 = (0..rows).map(|r| column[r * stride].as_f64()).sum();
        let mean = T::of(sum / rows as f64);
        for r in 0..rows {
            column[r * stride] -= mean;
        }
    }
}

fn write<T: Scalar>(grid: &[T], domain: &Domain<'_, T>, surface: &mut Surface<T>) {
    let area = surface.bounding_box;
    let (mut sum, mut count) = (0.0, 0usize);
    let (mut known_sum, mut known) = (0.0, 0usize);
    let each = |visit: &mut dyn FnMut(usize, usize, T)| {
        for r in 0..area.rows {
            for c in 0..area.columns {
                if domain.contains(area.top + r, area.left + c) {
                    visit(area.top + r, area.left + c, grid[r * area.columns + c]);
                }
            }
        }
    };
    each(&mut |row, column, height| {
        sum += height.as_f64();
        count += 1;
        if let Some(truth) = domain.known(row, column) {
            known_sum += (truth - height).as_f64();
            known += 1;
        }
    });
    let shift = T::of(if known > 0 { known_sum / known as f64 } else { -sum / count.max(1) as f64 });
    each(&mut |row, column, height| surface.set(row, column, height + shift));
}
