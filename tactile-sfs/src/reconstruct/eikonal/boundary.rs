//! Boundary offsets: how far the pixels next to a boundary of known height stand above it, to a fraction of a pixel.

use super::grid::{EikonalBuffers, Node};
use crate::Scalar;

/// The contour is occluding if sin θ reaches 1 within this many pixels: the boundary is at most one away, the rest is
/// slack for the error of the extrapolation.
const REACH: f64 = 1.25;

/// Pixels around a boundary pixel, in both directions, over which the boundary's kind and curvature are taken to be the
/// same.
const WINDOW: usize = 4;

/// Measures the boundary offset of every unknown pixel of the mask that has a given height outside next to it.
///
/// The solution is a minimum over the whole boundary: one pixel that noise makes look flatter than it is would draw down
/// the whole surface. So the kind of boundary is decided by the majority of the boundary pixels around, and their mean
/// |∇ sin θ| is taken.
pub(super) fn measure<T: Scalar>(grid: &mut EikonalBuffers<T>) {
    for i in grid.width..grid.node.len() - grid.width {
        let near = [i - 1, i + 1, i - grid.width, i + grid.width];
        // Most nodes have none outside beside them.
        if !near.iter().any(|&j| grid.node[j] == Node::Outside) {
            continue;
        }
        if grid.node[i] == Node::Unknown && lowest(grid, i, T::one()).is_finite() {
            // Until the edges are measured their place holds |∇ sin θ| and step.
            grid.edges[i] = gradient_and_step(grid, i);
            grid.offset[i] = T::zero();
        }
    }
    for i in grid.width..grid.node.len() - grid.width {
        if !grid.offset[i].is_nan() {
            grid.offset[i] = offset(grid, i);
        }
    }
}

/// Sets the values that sweeps start from: known heights, and boundary heights with their offsets.
pub(super) fn start<T: Scalar>(grid: &mut EikonalBuffers<T>, convex: bool) {
    let sign = if convex { T::one() } else { -T::one() };
    grid.busy.fill(true);
    for i in grid.width..grid.node.len() - grid.width {
        grid.active[i] = grid.node[i] == Node::Unknown;
        grid.value[i] = match grid.node[i] {
            Node::Known => sign * grid.given[i],
            Node::Unknown if !grid.offset[i].is_nan() => lowest(grid, i, sign) + grid.offset[i],
            _ => T::infinity(),
        };
    }
}

/// Lowest (highest for sign −1, negated) height given outside the mask next to a pixel, +∞ if there is none.
fn lowest<T: Scalar>(grid: &EikonalBuffers<T>, i: usize, sign: T) -> T {
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

/// |∇ sin θ| at a pixel, and how far the boundary can be from it along that gradient.
fn gradient_and_step<T: Scalar>(grid: &EikonalBuffers<T>, i: usize) -> [T; 2] {
    let [gx, gy] = gradient(grid, i);
    let length = gx.hypot(gy);
    if length > T::zero() {
        let step = gx.abs().max(gy.abs() * grid.aspect) / length;
        [length, step]
    } else {
        [length, T::one().min(grid.aspect)]
    }
}

/// ∇ sin θ at a pixel of the mask.
fn gradient<T: Scalar>(grid: &EikonalBuffers<T>, i: usize) -> [T; 2] {
    [
        derivative(grid, i, 1),
        derivative(grid, i, grid.width) / grid.aspect,
    ]
}

/// At an occluding contour sin θ is continued to 1; elsewhere the boundary is half a pixel away.
fn offset<T: Scalar>(grid: &EikonalBuffers<T>, i: usize) -> T {
    let (sine, cosine) = (grid.sine[i], grid.cosine[i]);
    let (gradient, occluding) = around(grid, i);
    if occluding {
        return cosine / gradient;
    }
    let half_step = T::of(0.5) * grid.edges[i][1];
    let boundary_sine = (sine + half_step * gradient).min(T::one());
    let boundary_cosine = (T::one() - boundary_sine * boundary_sine)
        .max(T::zero())
        .sqrt();
    half_step * (sine + boundary_sine) / (cosine + boundary_cosine)
}

/// Mean |∇ sin θ| of the boundary pixels around one, and whether most of them lie at an occluding contour.
fn around<T: Scalar>(grid: &EikonalBuffers<T>, i: usize) -> (T, bool) {
    let (width, rows) = (grid.width, grid.node.len() / grid.width);
    let span = |middle: usize, length: usize| {
        middle.saturating_sub(WINDOW)..(middle + WINDOW + 1).min(length)
    };
    let (mut sum, mut count, mut votes) = (T::zero(), 0usize, 0usize);
    for row in span(i / width, rows) {
        for j in span(i % width, width).map(|column| row * width + column) {
            if !grid.offset[j].is_nan() {
                let [gradient, step] = grid.edges[j];
                sum += gradient;
                count += 1;
                votes += usize::from(T::one() - grid.sine[j] < T::of(REACH) * step * gradient);
            }
        }
    }
    (sum / T::of(count as f64), 2 * votes > count)
}

/// cos² of the angle between ∇ sin θ and the x axis.
pub(super) fn along_x<T: Scalar>(grid: &EikonalBuffers<T>, i: usize) -> T {
    let [gx, gy] = gradient(grid, i);
    gx * gx / (gx * gx + gy * gy)
}

/// Derivative of sin θ along one axis, from the neighbours inside the mask; second order where there are enough.
fn derivative<T: Scalar>(grid: &EikonalBuffers<T>, i: usize, stride: usize) -> T {
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
