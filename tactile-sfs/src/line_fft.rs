//! Fourier transforms of lines.

use crate::Scalar;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// A complex Fourier transform of one length, in double precision whatever the lines' type: a second planner would double
/// what the library takes to compile.
pub(crate) struct LineFft {
    fft: Arc<dyn Fft<f64>>,
}

impl LineFft {
    pub(crate) fn forward(length: usize) -> Self {
        Self {
            fft: FftPlanner::new().plan_fft_forward(length),
        }
    }

    /// Not divided by the length.
    pub(crate) fn inverse(length: usize) -> Self {
        Self {
            fft: FftPlanner::new().plan_fft_inverse(length),
        }
    }

    /// Scratch needed by [`Self::process`].
    pub(crate) fn scratch_len(&self) -> usize {
        self.fft.len() + self.fft.get_inplace_scratch_len()
    }

    /// Transforms `lines`, a whole number of lines, in place. `scratch` is at least [`Self::scratch_len`] long.
    pub(crate) fn process<T: Scalar>(
        &self,
        lines: &mut [Complex<T>],
        scratch: &mut [Complex<f64>],
    ) {
        let length = self.fft.len();
        if let Some(lines) = T::as_doubles(lines) {
            self.fft.process_with_scratch(lines, scratch);
            return;
        }
        let (wide, scratch) = scratch.split_at_mut(length);
        for line in lines.chunks_exact_mut(length) {
            for (wide, value) in wide.iter_mut().zip(&*line) {
                *wide = Complex::new(value.re.as_f64(), value.im.as_f64());
            }
            self.fft.process_with_scratch(wide, scratch);
            for (value, wide) in line.iter_mut().zip(&*wide) {
                *value = Complex::new(T::of(wide.re), T::of(wide.im));
            }
        }
    }
}
