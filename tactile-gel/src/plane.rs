//! The linear law of an elastic face in the frequency domain: pressure ↔ displacement ↔ slopes.
//!
//! A pressure p of wavenumber k displaces the face by u = f L(kh)/k, with f = 2p/E*, the gel's
//! plane-strain modulus E*, and L = 1 on a half-space. So f = k u/L. In terms of slopes this is a
//! transform of order zero, f̂ = −i (k_x p̂ + k_y q̂)/(k L), which does not amplify their noise.
//! Outside contacts f vanishes, regardless of the shape of the face.
//!
//! For one layer of thickness h, bonded to a rigid plate, with s = kh and κ = 3 − 4ν,
//! L = (2κ sinh 2s − 4s)/(2κ cosh 2s + 4s² + 1 + κ²) (Dhaliwal & Rau, Int. J. Eng. Sci. 8, 843–856,
//! 1970).

use std::sync::Arc;

use ndarray::{Array2, ArrayView2};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

/// Minimum L for the division. Smaller values belong to waves much longer than the thickness of the
/// layer, which a frame hardly contains.
const LEAST_YIELD: f64 = 0.05;

/// A bonded layer: its thickness in cells, and Poisson's ratio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LayerShape {
    pub thickness: f64,
    pub poisson_ratio: f64,
}

impl LayerShape {
    /// The function L(s) of the module's documentation.
    pub(crate) fn yields(self, wavenumber: f64) -> f64 {
        // Above 20 both hyperbolic functions equal the same exponential.
        let s = (wavenumber * self.thickness).clamp(1e-4, 20.0);
        let kappa = 3.0 - 4.0 * self.poisson_ratio;
        let (sinh, cosh) = ((2.0 * s).sinh(), (2.0 * s).cosh());
        (2.0 * kappa * sinh - 4.0 * s) / (2.0 * kappa * cosh + 4.0 * s * s + 1.0 + kappa * kappa)
    }
}

/// Transforms for a grid of square cells. Lengths are in cells.
pub(crate) struct Plane {
    shape: (usize, usize),
    padded: (usize, usize),
    /// L at each wavenumber of the transposed spectrum. Empty for a half-space.
    yields: Vec<f32>,
    /// Transforms along columns and rows, forward and inverse.
    forward: [Arc<dyn Fft<f32>>; 2],
    inverse: [Arc<dyn Fft<f32>>; 2],
}

/// The next number from `cells` upwards whose only prime factors are 2, 3 and 5, which makes
/// transforms fast.
fn smooth_size(cells: usize) -> usize {
    let smooth = |n: &usize| {
        let mut rest = *n;
        for prime in [2, 3, 5] {
            while rest.is_multiple_of(prime) {
                rest /= prime;
            }
        }
        rest == 1
    };
    (cells.max(2)..).find(smooth).unwrap_or(cells)
}

impl Plane {
    /// Creates the transforms, padded by `room` times the size of the grid, which separates
    /// periodic copies.
    pub(crate) fn new(shape: (usize, usize), room: f64, layer: Option<LayerShape>) -> Self {
        let larger = |n: usize| smooth_size((n as f64 * (1.0 + room)).ceil() as usize);
        let padded = (larger(shape.0), larger(shape.1));
        let mut planner = FftPlanner::new();
        let lengths = [padded.1, padded.0];
        let mut plane = Self {
            shape,
            padded,
            yields: Vec::new(),
            forward: lengths.map(|n| planner.plan_fft_forward(n)),
            inverse: lengths.map(|n| planner.plan_fft_inverse(n)),
        };
        if let Some(layer) = layer {
            let each = (0..padded.1).flat_map(|c| (0..padded.0).map(move |r| (r, c)));
            plane.yields = each
                .map(|(r, c)| {
                    let [x, y] = [wavenumber(c, padded.1), wavenumber(r, padded.0)];
                    layer.yields(f64::from(x).hypot(f64::from(y))) as f32
                })
                .collect();
        }
        plane
    }

    /// f from slopes along x and y of displacements into the gel.
    pub(crate) fn pressure(&self, p: ArrayView2<'_, f32>, q: ArrayView2<'_, f32>) -> Array2<f32> {
        let spectrum = self.spectrum(p, Some(q));
        let least = LEAST_YIELD as f32;
        let out = self.each(|at, mirrored, [x, y]| {
            let [p, q] = parts(spectrum[at], spectrum[mirrored]);
            let over = (x * x + y * y).sqrt() * self.yields.get(at).map_or(1.0, |l| l.max(least));
            if over > 0.0 {
                // −i (x p + y q)/(k L)
                let sum = p * x + q * y;
                Complex::new(sum.im, -sum.re) / over
            } else {
                Complex::default()
            }
        });
        self.real(out).0
    }

    /// The part of the slopes that does not belong to a surface: their curl, scaled like the
    /// divergence in `pressure`.
    pub(crate) fn curl(&self, p: ArrayView2<'_, f32>, q: ArrayView2<'_, f32>) -> Array2<f32> {
        // Rotating the slopes by 90° turns their curl into a divergence.
        let turned = p.mapv(|p| -p);
        self.pressure(q, turned.view())
    }

    /// Displacement, and slopes along x and y, under f.
    pub(crate) fn moved(&self, f: ArrayView2<'_, f32>) -> (Array2<f32>, [Array2<f32>; 2]) {
        let spectrum = self.spectrum(f, None);
        let face = |at: usize, [x, y]: [f32; 2]| {
            let k = (x * x + y * y).sqrt();
            let yields = self.yields.get(at).copied().unwrap_or(1.0);
            if k > 0.0 {
                spectrum[at] * (yields / k)
            } else {
                // The longest wave stands for the mean.
                let (longest, at) = self.longest();
                spectrum[0] * (self.yields.get(at).copied().unwrap_or(1.0) / longest)
            }
        };
        let heights = self.real(self.each(|at, _, k| face(at, k))).0;
        let slopes = self.real(self.each(|at, _, [x, y]| {
            // i x u + i (i y u)
            let u = face(at, [x, y]);
            Complex::new(-u.im * x - u.re * y, u.re * x - u.im * y)
        }));
        (heights, [slopes.0, slopes.1])
    }

    fn longest(&self) -> (f32, usize) {
        let (rows, columns) = self.padded;
        if columns > rows {
            (wavenumber(1, columns), rows)
        } else {
            (wavenumber(1, rows), 1)
        }
    }

    /// The spectrum of `re` + i `im`, column by column.
    fn spectrum(
        &self,
        re: ArrayView2<'_, f32>,
        im: Option<ArrayView2<'_, f32>>,
    ) -> Vec<Complex<f32>> {
        let (rows, columns) = self.padded;
        let mut field = vec![Complex::default(); rows * columns];
        for (r, (to, from)) in field
            .chunks_exact_mut(columns)
            .zip(re.outer_iter())
            .enumerate()
        {
            to.iter_mut().zip(from).for_each(|(to, v)| to.re = *v);
            if let Some(im) = &im {
                to.iter_mut().zip(im.row(r)).for_each(|(to, v)| to.im = *v);
            }
        }
        // Padded rows are zero, and so are their transforms.
        self.forward[0].process(&mut field[..self.shape.0 * columns]);
        let mut turned = transposed(&field, columns);
        self.forward[1].process(&mut turned);
        turned
    }

    /// Builds a spectrum from each index, that of the negative wavenumber, and the wavenumbers.
    fn each(&self, value: impl Fn(usize, usize, [f32; 2]) -> Complex<f32>) -> Vec<Complex<f32>> {
        let (rows, columns) = self.padded;
        let along: Vec<f32> = (0..rows).map(|r| wavenumber(r, rows)).collect();
        let mut out = Vec::with_capacity(rows * columns);
        for c in 0..columns {
            let x = wavenumber(c, columns);
            let opposite = (columns - c) % columns * rows;
            for (r, y) in along.iter().enumerate() {
                out.push(value(c * rows + r, opposite + (rows - r) % rows, [x, *y]));
            }
        }
        out
    }

    /// Real and imaginary part of the field of a spectrum.
    fn real(&self, mut spectrum: Vec<Complex<f32>>) -> (Array2<f32>, Array2<f32>) {
        let (rows, columns) = self.padded;
        self.inverse[1].process(&mut spectrum);
        let mut field = transposed(&spectrum, rows);
        self.inverse[0].process(&mut field[..self.shape.0 * columns]);
        let scale = 1.0 / (rows * columns) as f32;
        let at = |(r, c): (usize, usize)| field[r * columns + c] * scale;
        (
            Array2::from_shape_fn(self.shape, |place| at(place).re),
            Array2::from_shape_fn(self.shape, |place| at(place).im),
        )
    }
}

/// Spectra of the real and the imaginary part of a field, from its spectrum at k and −k.
fn parts(here: Complex<f32>, there: Complex<f32>) -> [Complex<f32>; 2] {
    let there = there.conj();
    let odd = here - there;
    [
        (here + there) * 0.5,
        Complex::new(0.5 * odd.im, -0.5 * odd.re),
    ]
}

/// Signed wavenumber in radians per cell. The shortest wave has no sign; its wavenumber is 0, so
/// that fields stay real.
fn wavenumber(k: usize, n: usize) -> f32 {
    let step = core::f64::consts::TAU / n as f64;
    if 2 * k == n {
        0.0
    } else if 2 * k < n {
        (step * k as f64) as f32
    } else {
        (step * (k as f64 - n as f64)) as f32
    }
}

fn transposed(field: &[Complex<f32>], width: usize) -> Vec<Complex<f32>> {
    let high = field.len() / width;
    let mut turned = vec![Complex::default(); field.len()];
    // Block size that fits in the first-level cache.
    const BLOCK: usize = 16;
    for top in (0..high).step_by(BLOCK) {
        for left in (0..width).step_by(BLOCK) {
            for r in top..(top + BLOCK).min(high) {
                for c in left..(left + BLOCK).min(width) {
                    turned[c * high + r] = field[r * width + c];
                }
            }
        }
    }
    turned
}

/// Bessel's function J₀ to 1e−7 (Abramowitz & Stegun, 9.4.1 and 9.4.3).
pub(crate) fn bessel_j0(x: f64) -> f64 {
    let x = x.abs();
    let series =
        |coefficients: &[f64], t: f64| coefficients.iter().rev().fold(0.0, |sum, c| sum * t + c);
    if x <= 3.0 {
        const NEAR: [f64; 7] = [
            1.0,
            -2.249_999_7,
            1.265_620_8,
            -0.316_386_6,
            0.044_447_9,
            -0.003_944_4,
            0.000_21,
        ];
        return series(&NEAR, (x / 3.0).powi(2));
    }
    const HEIGHT: [f64; 7] = [
        0.797_884_56,
        -0.000_000_77,
        -0.005_527_4,
        -0.000_095_12,
        0.001_372_37,
        -0.000_728_05,
        0.000_144_76,
    ];
    const PHASE: [f64; 7] = [
        -core::f64::consts::FRAC_PI_4,
        -0.041_663_97,
        -0.000_039_54,
        0.002_625_73,
        -0.000_541_25,
        -0.000_293_33,
        0.000_135_58,
    ];
    let t = 3.0 / x;
    series(&HEIGHT, t) / x.sqrt() * (x + series(&PHASE, t)).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hertz: a ball displaces the face by d − r²/2R inside a = √(R d), under 2p/E* = 4a/πR √(1 −
    /// r²/a²).
    #[test]
    fn slopes_of_a_ball_have_the_pressure_of_hertz() {
        let (a, ball) = (14.0_f64, 40.0);
        let slope = |row: usize, column: usize| {
            let [x, y] = [column as f64 - 50.0, row as f64 - 44.0];
            let r = x.hypot(y).max(1e-9);
            let rho = r / a;
            let along = match rho < 1.0 {
                true => -r / ball,
                false => {
                    let curve = (rho * rho - 1.0).sqrt() / rho - rho * (1.0 / rho).asin();
                    2.0 * a / (core::f64::consts::PI * ball) * curve
                }
            };
            [along * x / r, along * y / r]
        };
        let shape = (90, 100);
        let [p, q] =
            [0, 1].map(|k: usize| Array2::from_shape_fn(shape, |(r, c)| slope(r, c)[k] as f32));
        let f = Plane::new(shape, 0.3, None).pressure(p.view(), q.view());
        for ((row, column), f) in f.indexed_iter() {
            let r = (column as f64 - 50.0).hypot(row as f64 - 44.0) / a;
            let truth = 4.0 * a / (core::f64::consts::PI * ball) * (1.0 - r * r).max(0.0).sqrt();
            // The root at the edge is sharper than a pixel, and slopes end with the frame.
            let bound = if (r - 1.0).abs() < 0.15 { 0.1 } else { 0.03 };
            let inside = (8..82).contains(&row) && (8..92).contains(&column);
            assert!(
                !inside || (f64::from(*f) - truth).abs() < bound,
                "{row} {column} {f} {truth}"
            );
        }
    }

    /// The displacement by a pressure gives the same pressure again, also on a layer.
    #[test]
    fn pressure_and_slopes_are_inverse() {
        let f = Array2::from_shape_fn((60, 72), |(r, c)| {
            let square = ((r as f32 - 30.0).powi(2) + (c as f32 - 34.0).powi(2)) / 100.0;
            (1.0 - square).max(0.0).sqrt()
        });
        let layer = LayerShape {
            thickness: 20.0,
            poisson_ratio: 0.48,
        };
        let plane = Plane::new(f.dim(), 1.0, Some(layer));
        let (_, [p, q]) = plane.moved(f.view());
        let back = plane.pressure(p.view(), q.view());
        // Slopes are cut at the frame, so the longest waves are incomplete.
        let miss = back
            .iter()
            .zip(&f)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        assert!(miss < 0.12, "{miss}");
        let sums = [&back, &f].map(|f| f.iter().sum::<f32>());
        assert!((sums[0] / sums[1] - 1.0).abs() < 0.3, "{sums:?}");
    }
}
