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
}

/// Grey level at a distance from the centre, and its derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    pub(super) value: f64,
    pub(super) by_peak: f64,
    pub(super) by_radius: f64,
    pub(super) by_blur: f64,
    /// dI/d(r²).
    pub(super) by_r2: f64,
}

/// B + A E √(1 − |r + ε|²/a²)₊, ε normal with the blur's variance w along each axis.
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
    let h = edge.derivatives(mean / sd);
    let q = skew / (6.0 * variance * sd);
    let root = sd.sqrt();
    let value = root * (h[0] + q * h[3]);
    let by_mean = (h[1] + q * h[4]) / root;
    let by_variance = 0.5 * (h[2] + q * h[5]) / (root * sd);
    let by_skew = root * h[3] / (6.0 * variance * sd);
    let by_radius = (2.0 * (r2 + 2.0 * w) * inverse * by_mean
        - 4.0 * variance * by_variance
        - 6.0 * skew * by_skew)
        / shape.radius;
    let by_blur = -2.0 * inverse * by_mean + (4.0 * r2 + 8.0 * w) * inverse2 * by_variance
        - 48.0 * (r2 * w + w * w) * inverse2 * inverse * by_skew;
    let by_r2 = -inverse * by_mean + 4.0 * w * inverse2 * by_variance
        - 24.0 * w * w * inverse2 * inverse * by_skew;
    Level {
        value: shape.background + shape.peak * value,
        by_peak: value,
        by_radius: shape.peak * by_radius,
        by_blur: shape.peak * by_blur,
        by_r2: shape.peak * by_r2,
    }
}
