//! The blurred Hertz profile and its derivatives.

use super::edge::BlurredEdge;

/// What the profile depends on, lengths in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    pub(super) peak: f64,
    pub(super) background: f64,
    pub(super) radius: f64,
    /// Variance of the blur along one axis, the 1/12 of the pixel included.
    pub(super) blur: f64,
    /// c of √(1 − r²/a²) (1 − c r²/a²); zero is Hertz's profile.
    pub(super) bend: f64,
}

/// Grey level at a distance from the centre, and its derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    pub(super) value: f64,
    pub(super) by_peak: f64,
    pub(super) by_radius: f64,
    pub(super) by_blur: f64,
    pub(super) by_bend: f64,
    /// dI/d(r²).
    pub(super) by_r2: f64,
}

/// Mean of a power of (1 − |r + ε|²/a²)₊ under the blur, and its derivatives by the cumulants of what is raised.
#[derive(Clone, Copy, Debug)]
struct Power {
    value: f64,
    by_mean: f64,
    by_variance: f64,
    by_skew: f64,
}

impl Power {
    /// (1 − weight) `self` + weight `other`.
    fn blend(&self, other: &Self, weight: f64) -> Self {
        let mix = |a: f64, b: f64| a + weight * (b - a);
        Self {
            value: mix(self.value, other.value),
            by_mean: mix(self.by_mean, other.by_mean),
            by_variance: mix(self.by_variance, other.by_variance),
            by_skew: mix(self.by_skew, other.by_skew),
        }
    }
}

/// B + A E √x₊ (1 − c + c x) with x = 1 − |r + ε|²/a², ε normal with the blur's variance w along each axis.
///
/// |r + ε|² is w times a noncentral χ² with two degrees of freedom: mean r² + 2w, variance 4r²w + 4w², third cumulant
/// 24 r²w² + 16 w³. The mean of the root is that of a normal variable, corrected for the skewness (Edgeworth); the error is of
/// order (blur/a)². `spread` is the variance of r² among the pixels that share this distance.
pub(super) fn level(edge: &BlurredEdge, shape: &Shape, r2: f64, spread: f64) -> Level {
    let (w, inverse) = (shape.blur, 1.0 / (shape.radius * shape.radius));
    let inverse2 = inverse * inverse;
    let mean = 1.0 - (r2 + 2.0 * w) * inverse;
    let variance = (4.0 * r2 * w + 4.0 * w * w + spread) * inverse2;
    let skew = -(24.0 * r2 * w * w + 16.0 * w * w * w) * inverse2 * inverse;
    let sd = variance.sqrt();
    let z = mean / sd;
    let h = edge.derivatives(z);
    let q = skew / (6.0 * variance * sd);
    let scale = sd.sqrt();
    let root = Power {
        value: scale * (h[0] + q * h[3]),
        by_mean: (h[1] + q * h[4]) / scale,
        by_variance: 0.5 * (h[2] + q * h[5]) / (scale * sd),
        by_skew: scale * h[3] / (6.0 * variance * sd),
    };
    // E (z + N)₊^{3/2} = z h + h′, whose derivative is 3/2 h.
    let cubed = Power {
        value: scale * sd * (z * h[0] + h[1] + 1.5 * q * h[2]),
        by_mean: 1.5 * scale * (h[0] + q * h[3]),
        by_variance: 0.75 * (h[1] + q * h[4]) / scale,
        by_skew: 0.25 * h[2] / (variance * sd) * scale * sd,
    };
    let profile = root.blend(&cubed, shape.bend);
    let by_radius = (2.0 * (r2 + 2.0 * w) * inverse * profile.by_mean
        - 4.0 * variance * profile.by_variance
        - 6.0 * skew * profile.by_skew)
        / shape.radius;
    let by_blur = -2.0 * inverse * profile.by_mean
        + (4.0 * r2 + 8.0 * w) * inverse2 * profile.by_variance
        - 48.0 * (r2 * w + w * w) * inverse2 * inverse * profile.by_skew;
    let by_r2 = -inverse * profile.by_mean + 4.0 * w * inverse2 * profile.by_variance
        - 24.0 * w * w * inverse2 * inverse * profile.by_skew;
    Level {
        value: shape.background + shape.peak * profile.value,
        by_peak: profile.value,
        by_radius: shape.peak * by_radius,
        by_blur: shape.peak * by_blur,
        by_bend: shape.peak * (cubed.value - root.value),
        by_r2: shape.peak * by_r2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_differences() {
        let edge = BlurredEdge::new();
        for bend in [0.0, 0.15, -0.3] {
            let shape = Shape {
                peak: 120.0,
                background: 3.0,
                radius: 40.0,
                blur: 0.6,
                bend,
            };
            for r in [0.0, 11.0, 33.0, 38.9, 39.8, 40.4, 42.0] {
                let at = |shape: Shape, r2: f64| level(&edge, &shape, r2, 0.02);
                let here = at(shape, r * r);
                let e = 1e-4;
                let central = |change: &dyn Fn(f64) -> f64| (change(e) - change(-e)) / (2.0 * e);
                let slopes = [
                    (
                        here.by_peak,
                        central(&|e| {
                            at(
                                Shape {
                                    peak: shape.peak + e,
                                    ..shape
                                },
                                r * r,
                            )
                            .value
                        }),
                    ),
                    (
                        here.by_radius,
                        central(&|e| {
                            at(
                                Shape {
                                    radius: shape.radius + e,
                                    ..shape
                                },
                                r * r,
                            )
                            .value
                        }),
                    ),
                    (
                        here.by_blur,
                        central(&|e| {
                            at(
                                Shape {
                                    blur: shape.blur + e,
                                    ..shape
                                },
                                r * r,
                            )
                            .value
                        }),
                    ),
                    (
                        here.by_bend,
                        central(&|e| {
                            at(
                                Shape {
                                    bend: shape.bend + e,
                                    ..shape
                                },
                                r * r,
                            )
                            .value
                        }),
                    ),
                    (here.by_r2, central(&|e| at(shape, r * r + e).value)),
                ];
                for (k, (slope, difference)) in slopes.into_iter().enumerate() {
                    // Differences: e² times a third derivative of some hundreds, over six.
                    assert!(
                        (slope - difference).abs() < 2e-6 * (1.0 + slope.abs()),
                        "r {r}, bend {bend}, {k}: {slope} {difference}"
                    );
                }
            }
        }
    }

    /// The mean over the blur, by sums over a fine grid of displacements.
    #[test]
    fn level_is_the_blurred_profile() {
        let edge = BlurredEdge::new();
        let (radius, blur, bend) = (40.0_f64, 0.6_f64, 0.2);
        let shape = Shape {
            peak: 1.0,
            background: 0.0,
            radius,
            blur,
            bend,
        };
        let profile = |x: f64, y: f64| {
            let rho2 = (x * x + y * y) / (radius * radius);
            (1.0 - rho2).max(0.0).sqrt() * (1.0 - bend * rho2)
        };
        let step = 0.02;
        for r in [0.0, 20.0, 39.0, 40.0, 41.0] {
            let (mut sum, mut weights) = (0.0, 0.0);
            for i in -200_i32..=200 {
                for j in -200_i32..=200 {
                    let (x, y) = (step * f64::from(i), step * f64::from(j));
                    let weight = (-0.5 * (x * x + y * y) / blur).exp();
                    sum += weight * profile(r + x, y);
                    weights += weight;
                }
            }
            // The Edgeworth series leaves (blur/a)² at the edge.
            assert!(
                (level(&edge, &shape, r * r, 0.0).value - sum / weights).abs() < 5e-4,
                "r = {r}"
            );
        }
    }
}
