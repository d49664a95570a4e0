//! How far the pixels next to a rim of known height stand above it, to a fraction of a pixel.

use super::grid::{EikonalBuffers, Node};
use crate::Scalar;

/// The contour is occluding if sin θ reaches 1 within this many pixels: the rim is at most one away, the rest is slack
/// for the error of the extrapolation.
const REACH: f64 = 1.25;

/// Measures the rise of every unknown pixel of the mask that has a given height outside next to it.
pub(super) fn measure<T: Scalar>(grid: &mut EikonalBuffers<T>) {
    for i in grid.width..grid.node.len() - grid.width {
        if grid.node[i] == Node::Unknown && lowest(grid, i, T::one()).is_finite() {
            grid.rise[i] = rise(grid, i);
        }
    }
}

/// Lowest (highest for sign −1, negated) height given outside the mask next to a pixel, +∞ if there is none.
pub(super) fn lowest<T: Scalar>(grid: &EikonalBuffers<T>, i: usize, sign: T) -> T {
    let width = grid.width;
    let given = |j: usize| match grid.node[j] {
        Node::Outside if !grid.given[j].is_nan() => sign * grid.given[j],
        _ => T::infinity(),
    };
    given(i - 1).min(given(i + 1)).min(given(i - width)).min(given(i + width))
}

fn rise<T: Scalar>(grid: &EikonalBuffers<T>, i: usize) -> T {
    let (sine, cosine) = (grid.sine[i], grid.cosine[i]);
    let gx = bend(grid, i, 1);
    let gy = bend(grid, i, grid.width) / grid.aspect;
    let bend = gx.hypot(gy);
    // Extent of a pixel along the gradient.
    let step =
        if bend > T::zero() { (gx.abs() + gy.abs() * grid.aspect) / bend } else { T::one().min(grid.aspect) };
    let half = T::of(0.5) * step;
    if (T::one() - sine) < T::of(REACH) * step * bend {
        return cosine / bend;
    }
    let rim_sine = (sine + half * bend).min(T::one());
    let rim_cosine = (T::one() - rim_sine * rim_sine).max(T::zero()).sqrt();
    half * (sine + rim_sine) / (cosine + rim_cosine)
}

/// Derivative of sin θ along one axis, from the neighbours inside the mask.
fn bend<T: Scalar>(grid: &EikonalBuffers<T>, i: usize, stride: usize) -> T {
    let (before, after) = (i - stride, i + stride);
    let inside = |j: usize| grid.node[j] != Node::Outside;
    match (inside(before), inside(after)) {
        (true, true) => T::of(0.5) * (grid.sine[after] - grid.sine[before]),
        (true, false) => grid.sine[i] - grid.sine[before],
        (false, true) => grid.sine[after] - grid.sine[i],
        (false, false) => T::zero(),
    }
}
