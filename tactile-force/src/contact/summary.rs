//! Sums over the aperture and their errors.

use super::region::Region;
use crate::frame::DifferenceNoise;
use crate::simd::vectorized;

/// Sums over the aperture; coordinates are relative to the region's first pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// Number of pixels and their moments: 1, x, y, x², y².
    pub(super) plain: [f64; 5],
    /// The same weighted with the difference.
    pub(super) weighted: [f64; 5],
}

impl Sums {
    /// `columns` is scratch.
    pub(super) fn over(region: &Region, columns: &mut Vec<f64>) -> Self {
        let mut plain = [0.0; 5];
        for run in &region.aperture {
            let (y, n) = (f64::from(run.row), run.len() as f64);
            let (first, last) = (f64::from(run.start), f64::from(run.end) - 1.0);
            // Σ x and Σ x² of consecutive whole numbers.
            let cubes = |t: f64| t * (t + 1.0) * (2.0 * t + 1.0) / 6.0;
            let terms = [
                n,
                0.5 * n * (first + last),
                y * n,
                cubes(last) - cubes(first - 1.0),
                y * y * n,
            ];
            for (sum, term) in plain.iter_mut().zip(terms) {
                *sum += term;
            }
        }
        columns.clear();
        columns.resize(region.columns(), 0.0);
        let [d, dy, dyy] = vectorized(Differences { region, columns });
        let (mut dx, mut dxx) = (0.0, 0.0);
        for (x, column) in columns.iter().enumerate() {
            let x = x as f64;
            dx += x * column;
            dxx += x * x * column;
        }
        Self {
            plain,
            weighted: [d, dx, dy, dxx, dyy],
        }
    }

    pub(super) fn sum(&self) -> f64 {
        self.weighted[0]
    }

    pub(super) fn centroid(&self) -> [f64; 2] {
        [
            self.weighted[1] / self.weighted[0],
            self.weighted[2] / self.weighted[0],
        ]
    }

    /// Variance of Σ d: every pixel's, and that of errors of background and scale common to all, which go together.
    pub(super) fn variance(&self, noise: &DifferenceNoise) -> f64 {
        noise.background * self.plain[0]
            + noise.gain * self.weighted[0].max(0.0)
            + (noise.common.sqrt() * self.plain[0] + noise.scale.sqrt() * self.weighted[0]).powi(2)
            + noise.flat_field * self.weighted[0] * self.weighted[0]
    }

    /// Variance of the centroid along x (0) or y (1): Σ var(d) (x − x̄)²/(Σ d)², and the common error's lever.
    pub(super) fn centroid_variance(&self, axis: usize, noise: &DifferenceNoise) -> f64 {
        let at = self.centroid()[axis];
        let about = |s: &[f64; 5]| s[3 + axis] - 2.0 * at * s[1 + axis] + at * at * s[0];
        let lever = self.plain[1 + axis] - at * self.plain[0];
        let total = self.weighted[0];
        let white =
            noise.background * about(&self.plain) + noise.gain * about(&self.weighted).max(0.0);
        (white + noise.common * lever * lever) / (total * total)
    }
}

/// Σ d of every column of the aperture, and Σ d, Σ y d, Σ y² d: moments need no product for every pixel.
struct Differences<'a> {
    region: &'a Region,
    columns: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Differences<'_> {
    type Output = [f64; 3];

    #[inline(always)]
    fn call(self) -> [f64; 3] {
        const LANES: usize = 8;
        let width = self.region.columns();
        let mut moments = [0.0; 3];
        for run in &self.region.aperture {
            let columns = &mut self.columns[run.start as usize..run.end as usize];
            let (columns, rest) = columns.as_chunks_mut::<LANES>();
            let (chunks, tail) = self.region.difference[run.span(width)].as_chunks::<LANES>();
            // In lanes, so that no sum waits for the one before.
            let mut lanes = [0.0; LANES];
            for (columns, chunk) in columns.iter_mut().zip(chunks) {
                for k in 0..LANES {
                    let d = f64::from(chunk[k]);
                    columns[k] += d;
                    lanes[k] += d;
                }
            }
            for (column, d) in rest.iter_mut().zip(tail) {
                *column += f64::from(*d);
                lanes[0] += f64::from(*d);
            }
            let (y, sum) = (f64::from(run.row), lanes.iter().sum::<f64>());
            moments[0] += sum;
            moments[1] += y * sum;
            moments[2] += y * y * sum;
        }
        moments
    }
}
