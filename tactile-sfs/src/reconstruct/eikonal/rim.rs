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
    // A pixel next to the rim lies, along the gradient, at most this far from it.
    let step = if bend > T::zero() {
        gx.abs().max(gy.abs() * grid.aspect) / bend
    } else {
        T::one().min(grid.aspect)
    };
    let half = T::of(0.5) * step;
    if (T::one() - sine) < T::of(REACH) * step * bend {
        return cosine / bend;
    }
    let rim_sine = (sine + half * bend).min(T::one());
    let rim_cosine = (T::one() - rim_sine * rim_sine).max(T::zero()).sqrt();
    half * (sine + rim_sine) / (cosine + rim_cosine)
}

/// cos² of the angle between ∇ sin θ and the x axis.
pub(super) fn along_x<T: Scalar>(grid: &EikonalBuffers<T>, i: usize) -> T {
    let gx = bend(grid, i, 1);
    let gy = bend(grid, i, grid.width) / grid.aspect;
    gx * gx / (gx * gx + gy * gy)
}

/// Derivative of sin θ along one axis, from the neighbours inside the mask; second order where there are enough.
fn bend<T: Scalar>(grid: &EikonalBuffers<T>, i: usize, stride: usize) -> T {
    let inside =
        |j: Option<usize>| j.filter(|&j| grid.node.get(j).is_some_and(|&node| node != Node::Outside));
    let (before, after) = (inside(Some(i - stride)), inside(Some(i + stride)));
    let here = grid.sine[i];
    let one_sided = |near: usize, far: Option<usize>| match inside(far) {
        Some(far) => T::of(1.5) * here - T::of(2.0) * grid.sine[near] + T::of(0.5) * grid.sine[far],
        None => here - grid.sine[near],
    };
    match (before, after) {
        (Some(before), Some(after)) => T::of(0.5) * (grid.sine[after] - grid.sine[before]),
        (Some(before), None) => one_sided(before, before.checked_sub(stride)),
        (None, Some(after)) => -one_sided(after, Some(after + stride)),
        (None, None) => T::zero(),
    }
}
