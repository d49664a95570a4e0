//! The normal equations of the fit on the mask's bounding box, with a border of one pixel.

use ndarray::ArrayView2;

use super::MaskedBuffers;
use super::level::Level;
use super::solve::dot;
use crate::{BoundingBox, Domain, PixelFlags, Scalar, Surface};

/// Weight of an edge both of whose slopes are missing, relative to an edge of weight 1: it only bridges the gap.
const BRIDGE: f64 = 1e-4;

/// Slopes and their weights.
pub(super) struct Slopes<'a, T> {
    pub(super) p: ArrayView2<'a, T>,
    pub(super) q: ArrayView2<'a, T>,
    pub(super) weights: Option<ArrayView2<'a, T>>,
}

/// The direction of a family of edges: the slopes along it and its unit.
struct Axis<'a, T> {
    slopes: ArrayView2<'a, T>,
    /// From a pixel to the next: rows and columns, and nodes.
    step: [usize; 2],
    stride: usize,
    /// Weight of an edge between pixels of weight 1, and its length.
    weight: T,
    length: T,
}

impl<T: Scalar> Slopes<'_, T> {
    /// Mean slope along the edge between neighbours b and c, and its weight, from the pixels a, b, c, d in a line, of which
    /// those beside the edge may be missing.
    fn edge(&self, slopes: ArrayView2<'_, T>, [a, b, c, d]: [Option<[usize; 2]>; 4]) -> (T, T) {
        let usable = |at: Option<[usize; 2]>| {
            let at = at?;
            let (slope, weight) = (
                slopes[at],
                self.weights.map_or(T::one(), |weights| weights[at]),
            );
            (slope.is_finite() && weight > T::zero() && weight.is_finite())
                .then_some((slope, weight))
        };
        match (usable(b), usable(c)) {
            (Some((s, v)), Some((t, w))) => {
                let beside = |at| usable(at).map(|(slope, _)| slope);
                (
                    mean_slope([beside(a), Some(s), Some(t), beside(d)]),
                    T::of(2.0) * v * w / (v + w),
                )
            }
            (Some((s, v)), None) => (s, v),
            (None, Some((t, w))) => (t, w),
            (None, None) => (T::zero(), T::of(BRIDGE)),
        }
    }
}

/// Mean of the cubic or parabola through the slopes at −1, 0, 1, 2 over the edge from 0 to 1.
fn mean_slope<T: Scalar>([a, b, c, d]: [Option<T>; 4]) -> T {
    let (b, c) = (b.unwrap_or_default(), c.unwrap_or_default());
    let part = |numerator: f64, denominator: f64| T::of(numerator / denominator);
    match (a, d) {
        (Some(a), Some(d)) => part(13.0, 24.0) * (b + c) - part(1.0, 24.0) * (a + d),
        (Some(a), None) => part(5.0, 12.0) * c + part(8.0, 12.0) * b - part(1.0, 12.0) * a,
        (None, Some(d)) => part(5.0, 12.0) * b + part(8.0, 12.0) * c - part(1.0, 12.0) * d,
        (None, None) => part(1.0, 2.0) * (b + c),
    }
}

/// A weighted graph Laplacian whose nodes of given height have been moved to the right-hand side.
#[derive(Debug, Default)]
pub(super) struct System<T> {
    pub(super) width: usize,
    /// Node belongs to the mask.
    pub(super) inside: Vec<bool>,
    /// Node has a given height.
    pub(super) fixed: Vec<bool>,
    /// Weight of the edge to the right neighbour, and to the one below.
    right: Vec<T>,
    below: Vec<T>,
    /// Weight of the edges to given heights.
    pub(super) anchor: Vec<T>,
}

/// Sets up the system, the first heights (known ones) and the right-hand side (in `residual`), and the preconditioner.
/// Heights are in units of h_y; an edge along x weighs (h_y/h_x)² times its own weight.
pub(super) fn assemble<T: Scalar>(
    buffers: &mut MaskedBuffers<T>,
    slopes: &Slopes<'_, T>,
    domain: &Domain<'_, T>,
    surface: &mut Surface<T>,
) {
    let area = surface.bounding_box;
    let MaskedBuffers {
        hierarchy,
        system,
        z,
        residual,
        ..
    } = buffers;
    system.reset(area);
    for vector in [&mut *z, &mut *residual] {
        vector.clear();
        vector.resize(system.inside.len(), 0.0);
    }
    system.mark(z, slopes, domain, surface);
    system.add_edges(z, residual, slopes, domain.pixel_size_m, area);
    hierarchy.reset(area.rows, area.columns);
    system.copy_to(&mut hierarchy.levels[0]);
    hierarchy.build();
}

impl<T: Scalar> System<T> {
    fn reset(&mut self, area: BoundingBox) {
        self.width = area.columns + 2;
        let length = self.width * (area.rows + 2);
        for flags in [&mut self.inside, &mut self.fixed] {
            flags.clear();
            flags.resize(length, false);
        }
        for weights in [&mut self.right, &mut self.below, &mut self.anchor] {
            weights.clear();
            weights.resize(length, T::zero());
        }
    }

    /// Marks the nodes of the mask, takes over known heights and flags slopes that are not finite.
    fn mark(
        &mut self,
        z: &mut [f64],
        slopes: &Slopes<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) {
        let area = surface.bounding_box;
        for (row, r) in (area.top..).zip(1..=area.rows) {
            for (column, c) in (area.left..).zip(1..=area.columns) {
                if !domain.contains(row, column) {
                    continue;
                }
                let i = r * self.width + c;
                self.inside[i] = true;
                if let Some(height) = domain.known(row, column) {
                    self.fixed[i] = true;
                    z[i] = height.as_f64();
                }
                if !(slopes.p[[row, column]].is_finite() && slopes.q[[row, column]].is_finite()) {
                    surface.flags[[row, column]] |= PixelFlags::NON_FINITE;
                }
            }
        }
    }

    /// Adds all edges of the mask to the fit.
    fn add_edges(
        &mut self,
        z: &[f64],
        rhs: &mut [f64],
        slopes: &Slopes<'_, T>,
        [hx, hy]: [T; 2],
        area: BoundingBox,
    ) {
        let (width, weight) = (self.width, (hy / hx) * (hy / hx));
        let x = Axis {
            slopes: slopes.p,
            step: [0, 1],
            stride: 1,
            weight,
            length: hx,
        };
        let y = Axis {
            slopes: slopes.q,
            step: [1, 0],
            stride: width,
            weight: T::one(),
            length: hy,
        };
        for (row, column) in area.pixels() {
            let i = (row - area.top + 1) * width + column - area.left + 1;
            for axis in [&x, &y] {
                if self.inside[i] && self.inside[i + axis.stride] {
                    let (slope, weight) =
                        slopes.edge(axis.slopes, self.line(axis, i, [row, column]));
                    self.add(z, rhs, axis, i, weight * axis.weight, slope * axis.length);
                }
            }
        }
    }

    /// The pixels in line with the edge from node i, which lies at `at`, to the next.
    fn line(&self, axis: &Axis<'_, T>, i: usize, at: [usize; 2]) -> [Option<[usize; 2]>; 4] {
        let forth = |n: usize| [at[0] + n * axis.step[0], at[1] + n * axis.step[1]];
        let before = || [at[0] - axis.step[0], at[1] - axis.step[1]];
        [
            self.inside[i - axis.stride].then(before),
            Some(at),
            Some(forth(1)),
            self.inside[i + 2 * axis.stride].then(|| forth(2)),
        ]
    }

    /// Adds w (z_j − z_i − rise)², j the node after i, to the fit; an end of known height moves to the right-hand side.
    fn add(
        &mut self,
        z: &[f64],
        rhs: &mut [f64],
        axis: &Axis<'_, T>,
        i: usize,
        weight: T,
        rise: T,
    ) {
        let j = i + axis.stride;
        let (w, rise) = (weight.as_f64(), rise.as_f64());
        match (self.fixed[i], self.fixed[j]) {
            (false, false) => {
                let edges = if axis.stride == 1 {
                    &mut self.right
                } else {
                    &mut self.below
                };
                edges[i] = weight;
                rhs[i] -= w * rise;
                rhs[j] += w * rise;
            }
            (true, false) => {
                self.anchor[j] += weight;
                rhs[j] += w * (z[i] + rise);
            }
            (false, true) => {
                self.anchor[i] += weight;
                rhs[i] += w * (z[j] - rise);
            }
            (true, true) => {}
        }
    }

    /// Copies the weights, the largest as 1.
    fn copy_to(&self, level: &mut Level) {
        let all = || [&self.right, &self.below, &self.anchor].into_iter();
        let largest = all()
            .flatten()
            .fold(T::zero(), |largest, &weight| largest.max(weight))
            .as_f64();
        let scale = if largest > 0.0 { largest.recip() } else { 1.0 };
        for (from, to) in all().zip([&mut level.right, &mut level.below, &mut level.anchor]) {
            for (to, from) in to.iter_mut().zip(from) {
                *to = (from.as_f64() * scale) as f32;
            }
        }
    }

    /// Turns the direction, d ← x + β d, and multiplies it, image ← A d; returns d · A d.
    pub(super) fn turn(
        &self,
        beta: f64,
        x: &[f32],
        direction: &mut [f64],
        image: &mut [f64],
    ) -> f64 {
        let w = self.width;
        let advance = |direction: &mut [f64], row: usize| {
            for (d, &x) in direction[row * w..][..w].iter_mut().zip(&x[row * w..][..w]) {
                *d = f64::from(x) + beta * *d;
            }
        };
        let rows = direction.len() / w - 2;
        advance(direction, 1);
        let mut curvature = 0.0;
        for row in 1..=rows {
            advance(direction, row + 1);
            self.multiply_row(direction, image, row);
            curvature += dot(&direction[row * w..][..w], &image[row * w..][..w]);
        }
        curvature
    }

    /// One row of y = A x, in differences of neighbours so that smooth x keeps its digits.
    fn multiply_row(&self, x: &[f64], y: &mut [f64], row: usize) {
        let (w, n) = (self.width, self.width - 2);
        let at = row * w + 1;
        let (here, left, right) = (&x[at..][..n], &x[at - 1..][..n], &x[at + 1..][..n]);
        let (above, below) = (&x[at - w..][..n], &x[at + w..][..n]);
        let (e, wt) = (&self.right[at..][..n], &self.right[at - 1..][..n]);
        let (s, nt) = (&self.below[at..][..n], &self.below[at - w..][..n]);
        let (anchor, out) = (&self.anchor[at..][..n], &mut y[at..][..n]);
        for i in 0..n {
            let z = here[i];
            out[i] = anchor[i].as_f64() * z
                + e[i].as_f64() * (z - right[i])
                + wt[i].as_f64() * (z - left[i])
                + s[i].as_f64() * (z - below[i])
                + nt[i].as_f64() * (z - above[i]);
        }
    }
}
