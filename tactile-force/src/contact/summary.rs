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
    pub(super) fn over(region: &Region) -> Self {
        let mut total = Self::default();
        let columns = region.columns();
        for run in &region.aperture {
            let (y, n) = (f64::from(run.row), run.len() as f64);
            let (first, last) = (f64::from(run.start), f64::from(run.end) - 1.0);
            // Σ x and Σ x² of consecutive whole numbers.
            let cubes = |t: f64| t * (t + 1.0) * (2.0 * t + 1.0) / 6.0;
            let plain = [
                n,
                0.5 * n * (first + last),
                y * n,
                cubes(last) - cubes(first - 1.0),
                y * y * n,
            ];
            let differences = &region.difference[run.span(columns)];
            let [d0, d1, d2] = vectorized(Moments(differences));
            let weighted = [
                d0,
                d1 + first * d0,
                y * d0,
                d2 + 2.0 * first * d1 + first * first * d0,
                y * y * d0,
            ];
            for k in 0..5 {
                total.plain[k] += plain[k];
                total.weighted[k] += weighted[k];
            }
        }
        total
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

/// Σ d, Σ x d, Σ x² d for x = 0, 1, …; in lanes, so that no sum waits for the one before.
struct Moments<'a>(&'a [f32]);

impl pulp::NullaryFnOnce for Moments<'_> {
    type Output = [f64; 3];

    #[inline(always)]
    fn call(self) -> [f64; 3] {
        const LANES: usize = 8;
        let mut lanes = [[0.0; LANES]; 3];
        let mut x: [f64; LANES] = std::array::from_fn(|k| k as f64);
        let (chunks, rest) = self.0.as_chunks::<LANES>();
        for chunk in chunks {
            for k in 0..LANES {
                let d = f64::from(chunk[k]);
                lanes[0][k] += d;
                lanes[1][k] += x[k] * d;
                lanes[2][k] += x[k] * x[k] * d;
                x[k] += LANES as f64;
            }
        }
        for (k, d) in rest.iter().enumerate() {
            let d = f64::from(*d);
            lanes[0][k] += d;
            lanes[1][k] += x[k] * d;
            lanes[2][k] += x[k] * x[k] * d;
        }
        lanes.map(|sums| sums.iter().sum())
    }
}
