//! Cosine transforms of many lines: two real lines in one complex FFT of the same length.
//!
//! For x of length N the DCT-II is X_k = Σ_n x_n cos(π k (2n + 1)/2N). With the even samples forward and the odd ones
//! backward, v_n = x_{2n}, v_{N−1−n} = x_{2n+1}, it is X_k = Re(e^{−iπk/2N} V_k), V the Fourier transform of v
//! (Makhoul 1980). Two lines a, b travel as v = a + i b.

use rustfft::num_complex::Complex;

use crate::Scalar;
use crate::line_fft::LineFft;

/// DCT-II and its inverse for lines of one length.
pub(crate) struct CosineTransform<T> {
    length: usize,
    forward: LineFft,
    inverse: LineFft,
    /// e^{−iπk/2N}.
    twiddles: Vec<Complex<T>>,
    line: Vec<Complex<T>>,
    scratch: Vec<Complex<f64>>,
}

impl<T: Scalar> CosineTransform<T> {
    pub(crate) fn new(length: usize) -> Self {
        let (forward, inverse) = (LineFft::forward(length), LineFft::inverse(length));
        let scratch = forward.scratch_len().max(inverse.scratch_len());
        let zero = Complex::new(T::zero(), T::zero());
        let twiddle = |k: usize| {
            let (sin, cos) = (core::f64::consts::PI * k as f64 / (2 * length) as f64).sin_cos();
            Complex::new(T::of(cos), T::of(-sin))
        };
        let twiddles = (0..length).map(twiddle).collect();
        Self {
            length,
            forward,
            inverse,
            twiddles,
            line: vec![zero; length],
            scratch: vec![Complex::default(); scratch],
        }
    }

    pub(crate) fn length(&self) -> usize {
        self.length
    }

    /// DCT-II of two lines in place.
    pub(crate) fn forward(&mut self, a: &mut [T], b: &mut [T]) {
        let n = self.length;
        let half = n.div_ceil(2);
        for j in 0..half {
            self.line[j] = Complex::new(a[2 * j], b[2 * j]);
        }
        for j in 0..n - half {
            self.line[n - 1 - j] = Complex::new(a[2 * j + 1], b[2 * j + 1]);
        }
        self.forward.process(&mut self.line, &mut self.scratch);
        a[0] = self.line[0].re;
        b[0] = self.line[0].im;
        let half_unit = T::of(0.5);
        for k in 1..=n / 2 {
            let (v, u) = (self.line[k], self.line[n - k].conj());
            let w = self.twiddles[k];
            let (sum, difference) = ((v + u).scale(half_unit), (v - u).scale(half_unit));
            let (x, y) = (w * sum, w * Complex::new(difference.im, -difference.re));
            // X_k = Re, X_{N−k} = −Im of e^{−iπk/2N} V_k; at k = N/2 both are the same number.
            (a[n - k], b[n - k]) = (-x.im, -y.im);
            (a[k], b[k]) = (x.re, y.re);
        }
    }

    /// Inverse of [`forward`](Self::forward), times N.
    pub(crate) fn inverse(&mut self, a: &mut [T], b: &mut [T]) {
        let n = self.length;
        self.line[0] = Complex::new(a[0], b[0]);
        for k in 1..=n / 2 {
            let w = self.twiddles[k].conj();
            let x = w * Complex::new(a[k], -a[n - k]);
            let y = w * Complex::new(b[k], -b[n - k]);
            // x + i y at k, and the mirrored conj(x) + i conj(y) at N − k.
            self.line[n - k] = Complex::new(x.re + y.im, y.re - x.im);
            self.line[k] = Complex::new(x.re - y.im, x.im + y.re);
        }
        self.inverse.process(&mut self.line, &mut self.scratch);
        let half = n.div_ceil(2);
        for j in 0..half {
            (a[2 * j], b[2 * j]) = (self.line[j].re, self.line[j].im);
        }
        for j in 0..n - half {
            let value = self.line[n - 1 - j];
            (a[2 * j + 1], b[2 * j + 1]) = (value.re, value.im);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_sum_and_inverts() {
        for n in 1..20 {
            let a: Vec<f64> = (0..n).map(|i| ((i * i + 3) % 7) as f64 - 2.0).collect();
            let b: Vec<f64> = (0..n).map(|i| ((i * 5 + 1) % 11) as f64 - 4.0).collect();
            let mut transform = CosineTransform::new(n);
            let (mut x, mut y) = (a.clone(), b.clone());
            transform.forward(&mut x, &mut y);
            for (line, spectrum) in [(&a, &x), (&b, &y)] {
                for (k, &found) in spectrum.iter().enumerate() {
                    let angle = |i: usize| {
                        core::f64::consts::PI * (k * (2 * i + 1)) as f64 / (2 * n) as f64
                    };
                    let sum: f64 = (0..n).map(|i| line[i] * angle(i).cos()).sum();
                    // Rounding of at most 20 terms of size 6.
                    assert!((sum - found).abs() < 1e-13 * 200.0, "n {n} k {k}");
                }
            }
            transform.inverse(&mut x, &mut y);
            for i in 0..n {
                assert!((x[i] / n as f64 - a[i]).abs() < 1e-13, "n {n}");
                assert!((y[i] / n as f64 - b[i]).abs() < 1e-13);
            }
        }
    }
}
