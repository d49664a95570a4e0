//! The blurred pressure profile and its derivatives.
//!
//! It is based on E √(z + N)₊ for a standard normal N: a square-root edge blurred by a Gaussian.
//! Let h(z) be this mean. Then h″ = ½ h − z h′, because √ is homogeneous of degree ½ and Gaussian
//! means obey the heat equation. Every derivative follows from h and h′: h⁽ⁿ⁺²⁾ = (½ − n) h⁽ⁿ⁾ − z
//! h⁽ⁿ⁺¹⁾. At zero h(0) = Γ(¾)/(2^¾ √π) and h′(0) = Γ(¼)/(2^(9/4) √π).

/// Nodes at every quarter from −8 to 16. Below this range h < 1e-15; above it the asymptotic series
/// is accurate to 1e-9.
const LOW: f64 = -8.0;
const HIGH: f64 = 16.0;
const STEP: f64 = 0.25;
const NODES: usize = 97;
const TERMS: usize = 9;

/// Taylor coefficients of h about each node.
#[derive(Clone, Debug)]
pub(super) struct BlurredEdge {
    table: Vec<[f64; TERMS]>,
}

impl BlurredEdge {
    /// Integrates the differential equation from zero in both directions.
    pub(super) fn new() -> Self {
        const H0: f64 = 0.411_089_479_331_229_4;
        const D0: f64 = 0.430_019_993_662_259_85;
        let mut table = vec![[0.0; TERMS]; NODES];
        let zero = (-LOW / STEP) as usize;
        // The start is zero, where h and h′ have closed forms.
        for direction in [1.0, -1.0] {
            let (mut h, mut d) = (H0, D0);
            let mut node = zero;
            loop {
                // Thirty terms carry a step to rounding. The table keeps as many as half a step
                // needs.
                let series = taylor::<30>(LOW + STEP * node as f64, h, d);
                table[node].copy_from_slice(&series[..TERMS]);
                h = horner(&series, direction * STEP);
                d = horner_derivative(&series, direction * STEP);
                match if direction > 0.0 {
                    node.checked_add(1)
                } else {
                    node.checked_sub(1)
                } {
                    Some(next) if next < NODES => node = next,
                    _ => break,
                }
            }
        }
        Self { table }
    }

    /// [h, h′, h″, h‴, h⁗, h⁽⁵⁾] at z.
    pub(super) fn derivatives(&self, z: f64) -> [f64; 6] {
        if z >= HIGH - 0.5 * STEP {
            return far(z);
        }
        // At this distance outside the edge the light is below rounding.
        if z <= LOW {
            return [0.0; 6];
        }
        let node = ((z - LOW) / STEP).round();
        let series = &self.table[node as usize];
        let t = z - (LOW + STEP * node);
        let (h, d1) = (horner(series, t), horner_derivative(series, t));
        let d2 = 0.5 * h - z * d1;
        let d3 = -0.5 * d1 - z * d2;
        let d4 = -1.5 * d2 - z * d3;
        [h, d1, d2, d3, d4, -2.5 * d3 - z * d4]
    }
}

/// √z plus the Gaussian corrections, Σ g⁽²ᵏ⁾(z)/(2ᵏ k!), differentiated term by term.
fn far(z: f64) -> [f64; 6] {
    let root = z.sqrt();
    let (i, i2) = (1.0 / z, 1.0 / (z * z));
    let h = root * (1.0 - i2 * (0.125 + i2 * (15.0 / 128.0 + i2 * (945.0 / 3072.0))));
    let d1 = root * i * (0.5 + i2 * (3.0 / 16.0 + i2 * (105.0 / 256.0)));
    let d2 = -root * i2 * (0.25 + i2 * (15.0 / 32.0));
    let d3 = root * i2 * i * (0.375 + i2 * (105.0 / 64.0));
    let d4 = -root * i2 * i2 * (15.0 / 16.0);
    [h, d1, d2, d3, d4, root * i2 * i2 * i * (105.0 / 32.0)]
}

/// Coefficients of the series about z: (k + 2)(k + 1) c_{k+2} = (½ − k) c_k − z (k + 1) c_{k+1}.
fn taylor<const N: usize>(z: f64, h: f64, d: f64) -> [f64; N] {
    let mut c = [0.0; N];
    (c[0], c[1]) = (h, d);
    for k in 0..N - 2 {
        let n = k as f64;
        c[k + 2] = ((0.5 - n) * c[k] - z * (n + 1.0) * c[k + 1]) / ((n + 2.0) * (n + 1.0));
    }
    c
}

fn horner(c: &[f64], t: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

fn horner_derivative(c: &[f64], t: f64) -> f64 {
    c.iter()
        .enumerate()
        .skip(1)
        .rev()
        .fold(0.0, |sum, (k, c)| sum * t + k as f64 * c)
}

/// The parameters of the profile. Lengths are in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    pub peak: f64,
    pub radius: f64,
    /// Variance of the blur along one axis, including the 1/12 of the pixel.
    pub blur: f64,
    /// c of √(1 − r²/a²) (1 − c r²/a²). Zero is Hertz's profile.
    pub bend: f64,
}

/// Grey level at a distance from the centre, with its derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    pub value: f64,
    pub by_peak: f64,
    pub by_radius: f64,
    pub by_blur: f64,
    pub by_bend: f64,
    /// dI/d(r²).
    pub by_r2: f64,
}

/// Mean of a power of (1 − |r + ε|²/a²)₊ under the blur, and its derivatives by the cumulants of
/// the base.
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

/// A E √x₊ (1 − c + c x) with x = 1 − |r + ε|²/a², where ε is normal with the blur variance w along
/// each axis.
///
/// |r + ε|² is w times a noncentral χ² with two degrees of freedom: mean r² + 2w, variance 4r²w + 4w², third cumulant 24 r²w² + 16 w³. The mean of the root is that of a normal variable, corrected for the skewness (Edgeworth). The error is of order (blur/a)². `spread` is the variance of r² among the pixels of this ring.
pub(super) fn level(edge: &BlurredEdge, shape: &Shape, r2: f64, spread: f64) -> Level {
    let (w, inverse) = (shape.blur, 1.0 / (shape.radius * shape.radius));
    let inverse2 = inverse * inverse;
    // Cumulants of x, which is one minus a scaled noncentral χ².
    let mean = 1.0 - (r2 + 2.0 * w) * inverse;
    let variance = (4.0 * r2 * w + 4.0 * w * w + spread) * inverse2;
    let skew = -(24.0 * r2 * w * w + 16.0 * w * w * w) * inverse2 * inverse;
    let sd = variance.sqrt();
    let z = mean / sd;
    let h = edge.derivatives(z);
    let q = skew / (6.0 * variance * sd);
    // √x = √sd √(z + N): the tabulated edge is scaled by the root of the standard deviation.
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
        value: shape.peak * profile.value,
        by_peak: profile.value,
        by_radius: shape.peak * by_radius,
        by_blur: shape.peak * by_blur,
        by_bend: shape.peak * (cubed.value - root.value),
        by_r2: shape.peak * by_r2,
    }
}

#[cfg(test)]
#[path = "model_tests.rs"]
mod tests;
