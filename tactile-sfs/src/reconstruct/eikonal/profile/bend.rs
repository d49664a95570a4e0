//! R² = A (1 − ρ²) (1 − c ρ²)², fitted to the means of R² along the ellipses of a quadratic profile.

use nalgebra::{Matrix3, Vector3};

/// Ellipses on which R² is averaged; a profile hardly bends across one.
const ELLIPSES: usize = 128;

/// Share of the quadratic's residual that the bend must take away, and the sizes that it may have: what `tactile-force` asks of the bend of a
/// pressure profile. Noise of a grey level in 200 on Hertz's profile loses nothing; contacts by finite elements lose nine tenths.
const EXPLAINED: f64 = 0.5;
const LARGEST_BEND: f64 = 0.6;

/// Relative change of the contour's ρ² beyond which the fit has left what the inside determines.
const LARGEST_SHIFT: f64 = 0.2;

const STEPS: usize = 8;

/// Weighted means of R² over s = 1 − q/top, with q the quadratic profile.
#[derive(Debug)]
pub(super) struct RadialMeans {
    /// Σ w, Σ w s, Σ w R², Σ w R⁴.
    sums: [[f64; 4]; ELLIPSES],
}

impl Default for RadialMeans {
    fn default() -> Self {
        Self {
            sums: [[0.0; 4]; ELLIPSES],
        }
    }
}

impl RadialMeans {
    pub(super) fn add(&mut self, s: f64, squared: f64, weight: f64) {
        let ellipse = ((s.max(0.0) * ELLIPSES as f64) as usize).min(ELLIPSES - 1);
        let terms = [1.0, s, squared, squared * squared];
        for (sum, term) in self.sums[ellipse].iter_mut().zip(terms) {
            *sum += weight * term;
        }
    }

    /// Weight, mean s and mean R² of every ellipse that has pixels.
    fn filled(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        let filled = self.sums.iter().filter(|sum| sum[0] > 0.0);
        filled.map(|sum| [sum[0], sum[1] / sum[0], sum[2] / sum[0]])
    }

    /// Σ w (R² − its mean on the ellipse)².
    fn scatter(&self) -> f64 {
        let filled = self.sums.iter().filter(|sum| sum[0] > 0.0);
        filled.map(|sum| sum[3] - sum[2] * sum[2] / sum[0]).sum()
    }
}

/// How R² depends on a quadratic profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bend {
    /// The quadratic's greatest value.
    top: f64,
    /// A, ρ²/s and c.
    parameters: Vector3<f64>,
}

impl Bend {
    /// Gauss–Newton from the quadratic itself. `None` where the bend explains less than half of `left`, the weighted squares that the quadratic leaves.
    pub(super) fn fit(means: &RadialMeans, top: f64, left: f64) -> Option<Self> {
        let mut bend = Self {
            top,
            parameters: Vector3::new(top, 1.0, 0.0),
        };
        for _ in 0..STEPS {
            let (mut matrix, mut side) = (Matrix3::zeros(), Vector3::zeros());
            for [weight, s, squared] in means.filled() {
                let gradient = bend.gradient(s);
                matrix += gradient * gradient.transpose() * weight;
                side += gradient * (weight * (squared - bend.value(s)));
            }
            bend.parameters += matrix.cholesky()?.solve(&side);
        }
        let misfit = |[weight, s, squared]: [f64; 3]| weight * (squared - bend.value(s)).powi(2);
        let left_bent = means.scatter() + means.filled().map(misfit).sum::<f64>();
        let [_, scale, c] = bend.parameters.into();
        let plausible = (scale - 1.0).abs() < LARGEST_SHIFT && c.abs() < LARGEST_BEND;
        (plausible && left_bent < EXPLAINED * left).then_some(bend)
    }

    /// R² where the quadratic is `quadratic`; negative outside the contour.
    pub(super) fn squared_reflectance(&self, quadratic: f64) -> f64 {
        self.value(1.0 - quadratic / self.top)
    }

    fn value(&self, s: f64) -> f64 {
        let [amplitude, scale, c] = self.parameters.into();
        let rho2 = scale * s;
        amplitude * (1.0 - rho2) * (1.0 - c * rho2).powi(2)
    }

    /// Derivatives by A, ρ²/s and c.
    fn gradient(&self, s: f64) -> Vector3<f64> {
        let [amplitude, scale, c] = self.parameters.into();
        let rho2 = scale * s;
        let (edge, factor) = (1.0 - rho2, 1.0 - c * rho2);
        let by_rho2 = -amplitude * factor * (factor + 2.0 * c * edge);
        let by_c = -2.0 * amplitude * rho2 * edge * factor;
        Vector3::new(edge * factor * factor, s * by_rho2, by_c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of R² = (1 − ρ²)(1 − cρ²)² plus `noise` of alternating sign, for a quadratic whose contour lies at ρ² = `contour`.
    fn means(c: f64, contour: f64, noise: f64) -> (RadialMeans, f64) {
        let (mut means, mut left) = (RadialMeans::default(), 0.0);
        for k in 0..4000_u32 {
            let rho2 = 0.85 * f64::from(k) / 4000.0;
            let sign = if k % 2 == 0 { noise } else { -noise };
            let squared = (1.0 - rho2) * (1.0 - c * rho2).powi(2) + sign;
            means.add(rho2 / contour, squared, 1.0);
            left += (squared - (1.0 - rho2 / contour)).powi(2);
        }
        (means, left)
    }

    #[test]
    fn contour_and_bend_come_back() {
        for c in [-0.3, -0.1, 0.1, 0.15] {
            let (means, left) = means(c, 1.03, 1e-3);
            let bend = Bend::fit(&means, 1.0, left).unwrap();
            // Means over an ellipse of 1/128 are off by its curvature, 1e-5.
            let expected = Vector3::new(1.0, 1.03, c);
            assert!((bend.parameters - expected).amax() < 1e-3, "{c}: {bend:?}");
            assert!(bend.squared_reflectance(1.0 - 1.0 / 1.03).abs() < 1e-3);
        }
    }

    #[test]
    fn noise_is_not_explained() {
        let (means, left) = means(0.0, 1.0, 0.02);
        assert_eq!(Bend::fit(&means, 1.0, left), None);
    }
}
