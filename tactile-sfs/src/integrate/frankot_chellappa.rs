//! Frankot & Chellappa 1988: projection of the slopes on the integrable ones in the Fourier domain.
//!
//! Ẑ(u, v) = −i (u P̂ + v Q̂)/(u² + v²). The surface is taken as periodic: slopes that do not vanish at the border wrap
//! round and bend it (errors of 0.5 instead of 10⁻² are usual); where that may happen use
//! [`CosinePoisson`](super::CosinePoisson). For smooth slopes that vanish at the border it converges faster than any
//! power of h.

use ndarray::ArrayView2;
use rustfft::num_complex::Complex;

use super::SlopeIntegrator;
use super::cosine_poisson::resize;
use super::shift::write_levelled;
use crate::line_fft::LineFft;
use crate::{BoundingBox, Domain, Scalar, SfsError, Surface, Workspace};

/// Integration by Fourier projection, periodic in both directions.
///
/// With a mask, the bounding box is solved and slopes outside the mask are taken as 0. The mean height inside the mask
/// is 0, or what the known heights demand. O(N M log(N M)).
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Domain, FrankotChellappa, SlopeIntegrator};
/// let wave = core::f64::consts::TAU / 32.0;
/// let p = Array2::from_shape_fn((16, 32), |(_, column)| wave * (wave * column as f64).cos());
/// let surface = FrankotChellappa.integrate(p.view(), Array2::zeros((16, 32)).view(), &Domain::default())?;
/// assert!((surface.heights[[3, 8]] - 1.0).abs() < 1e-12); // sin at a quarter of the period
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrankotChellappa;

/// Transforms and spectrum, kept between calls.
#[derive(Default)]
pub(crate) struct FourierBuffers<T> {
    plans: Option<Plans>,
    /// p + i q, then its spectrum, then the heights in the real part.
    field: Vec<Complex<T>>,
    lines: Vec<Complex<T>>,
    scratch: Vec<Complex<f64>>,
    heights: Vec<T>,
}

struct Plans {
    size: [usize; 2],
    forward: [LineFft; 2],
    inverse: [LineFft; 2],
}

impl<T: Scalar> SlopeIntegrator<T> for FrankotChellappa {
    fn integrate_with(
        &self,
        workspace: &mut Workspace<T>,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let area = surface.enter_slopes(p, q, domain)?;
        let buffers = &mut workspace.fourier;
        buffers.load(p, q, domain, area)?;
        buffers.integrate(domain.pixel_size_m);
        write_levelled(buffers.heights(), domain, surface);
        surface.finish(domain);
        Ok(())
    }
}

impl<T: Scalar> FourierBuffers<T> {
    /// Fills the field with p + i q, 0 outside the mask; refuses slopes that are not finite.
    fn load(
        &mut self,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        area: BoundingBox,
    ) -> Result<(), SfsError> {
        let mut wrong = None;
        let slopes = area.pixels().map(|(row, column)| {
            if !domain.contains(row, column) {
                return Complex::new(T::zero(), T::zero());
            }
            let (p, q) = (p[[row, column]], q[[row, column]]);
            if !(p.is_finite() && q.is_finite()) {
                wrong = wrong.or(Some((row, column)));
            }
            Complex::new(p, q)
        });
        self.fill(area.rows, area.columns, slopes);
        wrong.map_or(Ok(()), |(row, column)| {
            Err(SfsError::NonFiniteSlope { row, column })
        })
    }

    /// Fills the field and prepares transforms of its size.
    pub(crate) fn fill(
        &mut self,
        rows: usize,
        columns: usize,
        values: impl Iterator<Item = Complex<T>>,
    ) {
        self.field.clear();
        self.field.extend(values);
        self.plan(rows, columns);
    }

    /// Integrates the field p + i q.
    pub(crate) fn integrate(&mut self, pixel_size: [T; 2]) {
        self.transform(false);
        self.project(pixel_size);
        self.transform(true);
        self.take_real();
    }

    /// Multiplies the spectrum by `factor(u, v)`, angular frequencies per unit of the pixel size.
    pub(crate) fn filter(&mut self, [hx, hy]: [T; 2], factor: impl Fn(T, T) -> Complex<T>) {
        self.transform(false);
        let Some(plans) = &self.plans else { return };
        let [rows, columns] = plans.size;
        let scale = T::one() / T::of((rows * columns) as f64);
        for (i, value) in self.field.iter_mut().enumerate() {
            let (u, v) = (
                frequency(i % columns, columns, hx),
                frequency(i / columns, rows, hy),
            );
            *value = (*value * factor(u, v)).scale(scale);
        }
        self.transform(true);
        self.take_real();
    }

    /// Heights of the last integration or filter.
    pub(crate) fn heights(&self) -> &[T] {
        &self.heights
    }

    fn take_real(&mut self) {
        resize(&mut self.heights, self.field.len());
        self.heights
            .iter_mut()
            .zip(&self.field)
            .for_each(|(z, field)| *z = field.re);
    }

    fn plan(&mut self, rows: usize, columns: usize) {
        if self
            .plans
            .as_ref()
            .is_some_and(|plans| plans.size == [rows, columns])
        {
            return;
        }
        let plans = Plans {
            size: [rows, columns],
            forward: [rows, columns].map(LineFft::forward),
            inverse: [rows, columns].map(LineFft::inverse),
        };
        let lengths = plans
            .forward
            .iter()
            .chain(&plans.inverse)
            .map(|fft| fft.scratch_len());
        let longest = lengths.max().unwrap_or(0);
        self.scratch.resize(longest, Complex::default());
        let zero = Complex::new(T::zero(), T::zero());
        self.lines.resize(LANES * rows, zero);
        self.plans = Some(plans);
    }

    /// Two-dimensional transform: rows in place, columns a few at a time through a buffer.
    fn transform(&mut self, inverse: bool) {
        let Some(plans) = &self.plans else { return };
        let [rows, columns] = plans.size;
        let [along_y, along_x] = if inverse {
            &plans.inverse
        } else {
            &plans.forward
        };
        along_x.process(&mut self.field, &mut self.scratch);
        for left in (0..columns).step_by(LANES) {
            let lanes = LANES.min(columns - left);
            for r in 0..rows {
                for lane in 0..lanes {
                    self.lines[lane * rows + r] = self.field[r * columns + left + lane];
                }
            }
            along_y.process(&mut self.lines[..lanes * rows], &mut self.scratch);
            for r in 0..rows {
                for lane in 0..lanes {
                    self.field[r * columns + left + lane] = self.lines[lane * rows + r];
                }
            }
        }
    }

    /// Replaces the spectrum C of p + i q by that of z.
    ///
    /// P̂(u) = (C(u) + C̄(−u))/2 and Q̂(u) = (C(u) − C̄(−u))/2i; the frequencies u and −u are done together.
    fn project(&mut self, [hx, hy]: [T; 2]) {
        let Some(plans) = &self.plans else { return };
        let [rows, columns] = plans.size;
        let scale = T::one() / T::of((rows * columns) as f64);
        let half = T::of(0.5);
        for r in 0..rows {
            let v = frequency(r, rows, hy);
            let mirrored_row = (rows - r) % rows;
            for c in 0..columns {
                let (i, j) = (
                    r * columns + c,
                    mirrored_row * columns + (columns - c) % columns,
                );
                if j < i {
                    continue;
                }
                let u = frequency(c, columns, hx);
                let (here, there) = (self.field[i], self.field[j].conj());
                let (p, q) = ((here + there).scale(half), (here - there).scale(half));
                let q = Complex::new(q.im, -q.re);
                let square = u * u + v * v;
                let factor = if square > T::zero() {
                    scale / square
                } else {
                    T::zero()
                };
                let sum = (p.scale(u) + q.scale(v)).scale(factor);
                let z = Complex::new(sum.im, -sum.re);
                self.field[i] = z;
                self.field[j] = z.conj();
            }
        }
    }
}

/// Columns transformed through the buffer at a time.
const LANES: usize = 8;

/// Angular frequency of a coefficient; 0 at the Nyquist frequency, where the derivative of a real wave vanishes.
fn frequency<T: Scalar>(index: usize, length: usize, step: T) -> T {
    let signed = if 2 * index < length {
        index as f64
    } else if 2 * index == length {
        0.0
    } else {
        index as f64 - length as f64
    };
    T::of(core::f64::consts::TAU * signed / length as f64) / step
}
