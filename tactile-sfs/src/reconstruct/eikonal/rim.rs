//! How far the pixels next to a rim of known height stand above it, to a fraction of a pixel.

use super::grid::{EikonalBuffers, Node};
use crate::Scalar;

/// The contour is occluding if sin θ reaches 1 within this many pixels: the rim is at most one away, the rest is slack
/// for the error of the extrapolation.
const REACH: f64 = 1.25;

/// Pixels around a rim pixel, in both directions, over which the rim's kind and curvature are taken to be the same.
const WINDOW: usize = 4;

/// Measures the rise of every unknown pixel of the mask that has a given height outside next to it.
///
/// The solution is a minimum over all of the rim: one pixel that noise makes look flatter than it is would draw down the
/// whole surface. So the kind of rim is decided by the majority of the rim pixels around, and their mean bend is taken.
pub(super) fn measure<T: Scalar>(grid: &mut EikonalBuffers<T>) {
    for i in grid.width..grid.node.len() - grid.width {
        if grid.node[i] == Node::Unknown && lowest(grid, i, T::one()).is_finite() {
            // Until the edges are measured their place holds bend and step.
            grid.edges[i] = bend_and_step(grid, i);
            grid.rise[i] = T::zero();
        }
    }
    for i in grid.width..grid.node.len() - grid.width {
        if !grid.rise[i].is_nan() {
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
    given(i - 1)
        .min(given(i + 1))
        .min(given(i - width))
        .min(given(i + width))
}

/// |∇ sin θ| at a pixel, and how far the rim can be from it along that gradient.
fn bend_and_step<T: Scalar>(grid: &EikonalBuffers<T>, i: usize) -> [T; 2] {
    let gx = bend(grid, i, 1);
    let gy = bend(grid, i, grid.width) / grid.aspect;
    let bend = gx.hypot(gy);
    if bend > T::zero() {
        [bend, gx.abs().max(gy.abs() * grid.aspect) / bend]
    } else {
        [bend, T::one().min(grid.aspect)]
    }
}

fn rise<T: Scalar>(grid: &EikonalBuffers<T>, i: usize) -> T {
    let (sine, cosine) = (grid.sine[i], grid.cosine[i]);
    let (bend, occluding) = around(grid, i);
    if occluding {
        return cosine / bend;
    }
    let half = T::of(0.5) * grid.edges[i][1];
    let rim_sine = (sine + half * bend).min(T::one());
    let rim_cosine = (T::one() - rim_sine * rim_sine).max(T::zero()).sqrt();
    half * (sine + rim_sine) / (cosine + rim_cosine)
}

/// Mean bend of the rim pixels around one, and whether most of them lie at an occluding contour.
fn around<T: Scalar>(grid: &EikonalBuffers<T>, i: usize) -> (T, bool) {
    let (width, rows) = (grid.width, grid.node.len() / grid.width);
    let span = |middle: usize, length: usize| {
        middle.saturating_sub(WINDOW)..(middle + WINDOW + 1).min(length)
    };
    let (mut sum, mut count, mut votes) = (T::zero(), 0usize, 0usize);
    for row in span(i / width, rows) {
        for j in span(i % width, width).map(|column| row * width + column) {
            if !grid.rise[j].is_nan() {
                let [bend, step] = grid.edges[j];
                sum += bend;
                count += 1;
                votes += usize::from(T::one() - grid.sine[j] < T::of(REACH) * step * bend);
            }
        }
    }
    (sum / T::of(count as f64), 2 * votes > count)
}

/// cos² of the angle between ∇ sin θ and the x axis.
pub(super) fn along_x<T: Scalar>(grid: &EikonalBuffers<T>, i: usize) -> T {
    let gx = bend(grid, i, 1);
    let gy = bend(grid, i, grid.width) / grid.aspect;
    gx * gx / (gx * gx + gy * gy)
}

/// Derivative of sin θ along one axis, from the neighbours inside the mask; second order where there are enough.
fn bend<T: Scalar>(grid: &EikonalBuffers<T>, i: usize, stride: usize) -> T {
    let inside = |j: Option<usize>| {
        j.filter(|&j| grid.node.get(j).is_some_and(|&node| node != Node::Outside))
    };
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
