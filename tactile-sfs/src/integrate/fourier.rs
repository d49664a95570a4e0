//! Frankot and Chellappa 1988: projection of the slopes onto integrable slopes in the Fourier
//! domain.
//!
//! Ẑ(u, v) = −i (u P̂ + v Q̂)/(u² + v²). The surface is assumed to be periodic: slopes that do not
//! vanish at the border wrap round and bend it. Errors are then typically 0.5 instead of 10⁻², and
//! [`CosinePoisson`](super::CosinePoisson) is the better choice. For smooth slopes that vanish at
//! the border, the method converges faster than any power of h.

use std::sync::Arc;

use ndarray::ArrayView2;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use super::{SlopeIntegrator, load_row, write_levelled};
use crate::{Domain, PixelScalar, SfsError, Surface, SurfaceWorkspace};

/// Integration by Fourier projection, periodic in both directions.
///
/// With a mask, its bounding box is solved with slopes of 0 outside the mask. The mean height
/// inside the mask is 0, or agrees with the known heights. O(N M log(N M)).
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Domain, FrankotChellappa, SlopeIntegrator};
/// let wave = core::f64::consts::TAU / 32.0;
/// let p = Array2::from_shape_fn((16, 32), |(_, column)| wave * (wave * column as f64).cos());
/// let surface =
///     FrankotChellappa.integrate(p.view(), Array2::zeros((16, 32)).view(), &Domain::default())?;
/// assert!((surface.heights[[3, 8]] - 1.0).abs() < 1e-12); // the sine at a quarter of the period
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrankotChellappa;

/// Transforms and spectrum, kept between calls.
#[derive(Default)]
pub(crate) struct FourierBuffers {
    plans: Option<Plans>,
    /// p + i q, then its spectrum, then the heights as the real part.
    field: Vec<Complex<f64>>,
    lines: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
    heights: Vec<f64>,
}

/// Transforms along y and along x.
struct Plans {
    rows: usize,
    columns: usize,
    forward: [Arc<dyn Fft<f64>>; 2],
    inverse: [Arc<dyn Fft<f64>>; 2],
}

impl<T: PixelScalar> SlopeIntegrator<T> for FrankotChellappa {
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
        let buffers = &mut workspace.fourier;
        let (rows, columns) = (area.rows(), area.columns());
        buffers.field.resize(rows * columns, Complex::default());
        let mut line = core::mem::take(&mut buffers.heights);
        line.resize(columns, 0.0);
        for (row, field) in buffers.field.chunks_exact_mut(columns).enumerate() {
            load_row(p, domain, area, row, &mut line)?;
            field.iter_mut().zip(&line).for_each(|(to, p)| to.re = *p);
            load_row(q, domain, area, row, &mut line)?;
            field.iter_mut().zip(&line).for_each(|(to, q)| to.im = *q);
        }
        buffers.heights = line;
        let heights = buffers.integrate((rows, columns), domain.pixel_size_m.map(T::as_f64));
        write_levelled(heights, domain, surface);
        surface.finish(domain);
        Ok(())
    }
}

/// Number of columns that are transformed through the buffer at once.
const LANES: usize = 8;

impl FourierBuffers {
    /// Integrates the field p + i q.
    fn integrate(&mut self, (rows, columns): (usize, usize), pixel_size: [f64; 2]) -> &[f64] {
        let planned = self.plans.take();
        let plans = planned
            .filter(|plans| (plans.rows, plans.columns) == (rows, columns))
            .unwrap_or_else(|| {
                let mut planner = FftPlanner::new();
                Plans {
                    rows,
                    columns,
                    forward: [rows, columns].map(|length| planner.plan_fft_forward(length)),
                    inverse: [rows, columns].map(|length| planner.plan_fft_inverse(length)),
                }
            });
        self.transform(&plans, &plans.forward);
        self.project(&plans, pixel_size);
        self.transform(&plans, &plans.inverse);
        self.plans = Some(plans);
        self.heights.clear();
        self.heights.extend(self.field.iter().map(|z| z.re));
        &self.heights
    }

    /// Two-dimensional transform: rows in place, columns in groups through a buffer.
    fn transform(&mut self, plans: &Plans, [along_y, along_x]: &[Arc<dyn Fft<f64>>; 2]) {
        let &Plans { rows, columns, .. } = plans;
        let scratch = [along_y, along_x].map(|fft| fft.get_inplace_scratch_len());
        let length = scratch[0].max(scratch[1]);
        self.scratch.resize(length, Complex::default());
        self.lines.resize(LANES * rows, Complex::default());
        along_x.process_with_scratch(&mut self.field, &mut self.scratch);
        for left in (0..columns).step_by(LANES) {
            let lanes = LANES.min(columns - left);
            for r in 0..rows {
                for lane in 0..lanes {
                    self.lines[lane * rows + r] = self.field[r * columns + left + lane];
                }
            }
            along_y.process_with_scratch(&mut self.lines[..lanes * rows], &mut self.scratch);
            for r in 0..rows {
                for lane in 0..lanes {
                    self.field[r * columns + left + lane] = self.lines[lane * rows + r];
                }
            }
        }
    }

    /// Replaces the spectrum C of p + i q by the spectrum of z.
    ///
    /// P̂(u) = (C(u) + C̄(−u))/2 and Q̂(u) = (C(u) − C̄(−u))/2i. The frequencies u and −u are
    /// processed together.
    fn project(&mut self, &Plans { rows, columns, .. }: &Plans, [hx, hy]: [f64; 2]) {
        let scale = 1.0 / (rows * columns) as f64;
        for r in 0..rows {
            let v = frequency(r, rows, hy);
            for c in 0..columns {
                let i = r * columns + c;
                let j = (rows - r) % rows * columns + (columns - c) % columns;
                // Processed together with its partner.
                if j < i {
                    continue;
                }
                let u = frequency(c, columns, hx);
                let (here, there) = (self.field[i], self.field[j].conj());
                let (p, q) = ((here + there).scale(0.5), (here - there).scale(0.5));
                let q = Complex::new(q.im, -q.re);
                let square = u * u + v * v;
                // Frequency 0 is the constant that slopes do not determine. The scale removes the
                // factor of the transforms.
                let factor = if square > 0.0 { scale / square } else { 0.0 };
                let sum = (p.scale(u) + q.scale(v)).scale(factor);
                let z = Complex::new(sum.im, -sum.re);
                self.field[i] = z;
                self.field[j] = z.conj();
            }
        }
    }
}

/// Angular frequency of a coefficient. It is 0 at the Nyquist frequency, where the derivative of a
/// real wave vanishes.
fn frequency(index: usize, length: usize, step: f64) -> f64 {
    let signed = match (2 * index).cmp(&length) {
        core::cmp::Ordering::Less => index as f64,
        core::cmp::Ordering::Equal => 0.0,
        core::cmp::Ordering::Greater => index as f64 - length as f64,
    };
    core::f64::consts::TAU * signed / length as f64 / step
}
