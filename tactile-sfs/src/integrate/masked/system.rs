//! The normal equations of the fit on the mask's bounding box, with a border of one pixel.

use ndarray::ArrayView2;

use super::MaskedBuffers;
use super::multigrid::Level;
use crate::{Domain, PixelFlags, Scalar, Surface};

/// Weight of an edge both of whose slopes are missing, relative to an edge of weight 1: it only bridges the gap.
const BRIDGE: f64 = 1e-4;

/// Slopes and their weights.
pub(super) struct Slopes<'a, T> {
    pub(super) p: ArrayView2<'a, T>,
    pub(super) q: ArrayView2<'a, T>,
    pub(super) weights: Option<ArrayView2<'a, T>>,
}

impl<T: Scalar> Slopes<'_, T> {
    fn weight(&self, at: [usize; 2]) -> T {
        self.weights.map_or(T::one(), |weights| weights[at])
    }

    /// Mean slope along the edge between neighbours b and c, and its weight, from the pixels a, b, c, d in a line, of which
    /// those beside the edge may be missing.
    fn edge(&self, slopes: ArrayView2<'_, T>, [a, b, c, d]: [Option<[usize; 2]>; 4]) -> (T, T) {
        let usable = |at: Option<[usize; 2]>| {
            let (slope, weight) = at.map(|at| (slopes[at], self.weight(at)))?;
            (slope.is_finite() && weight > T::zero() && weight.is_finite()).then_some((slope, weight))
        };
        match (usable(b), usable(c)) {
            (Some((s, v)), Some((t, w))) => {
                let beside = |at| usable(at).map(|(slope, _)| slope);
                (mean_slope([beside(a), Some(s), Some(t), beside(d)]), T::of(2.0) * v * w / (v + w))
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

/// Sets up the finest level, the first heights (known ones) and the right-hand side (in `residual`), and the coarser
/// levels. Heights are in units of h_y; an edge along x weighs (h_y/h_x)² times its own weight.
pub(super) fn assemble<T: Scalar>(
    buffers: &mut MaskedBuffers<T>,
    slopes: &Slopes<'_, T>,
    domain: &Domain<'_, T>,
    surface: &mut Surface<T>,
) {
    let area = surface.bounding_box;
    let MaskedBuffers { hierarchy, z, residual, .. } = buffers;
    hierarchy.reset(area.rows, area.columns);
    let level = &mut hierarchy.levels[0];
    let width = level.width;
    for vector in [&mut *z, &mut *residual] {
        vector.clear();
        vector.resize(level.len(), 0.0);
    }
    for r in 0..area.rows {
        for c in 0..area.columns {
            let (row, column, i) = (area.top + r, area.left + c, (r + 1) * width + c + 1);
            if !domain.contains(row, column) {
                continue;
            }
            level.inside[i] = true;
            if let Some(height) = domain.known(row, column) {
                level.fixed[i] = true;
                z[i] = height.as_f64();
            }
            if !(slopes.p[[row, column]].is_finite() && slopes.q[[row, column]].is_finite()) {
                surface.flags[[row, column]] |= PixelFlags::NON_FINITE;
            }
        }
    }
    let [hx, hy] = domain.pixel_size_m;
    let aspect2 = (hy / hx) * (hy / hx);
    for r in 0..area.rows {
        for c in 0..area.columns {
            let (row, column, i) = (area.top + r, area.left + c, (r + 1) * width + c + 1);
            let inside = |j: usize, at: [usize; 2]| level.inside[j].then_some(at);
            if level.inside[i] && level.inside[i + 1] {
                let line = [
                    inside(i - 1, [row, column.wrapping_sub(1)]),
                    Some([row, column]),
                    Some([row, column + 1]),
                    inside(i + 2, [row, column + 2]),
                ];
                let (slope, weight) = slopes.edge(slopes.p, line);
                add_edge(level, residual, z, [i, i + 1], weight * aspect2, slope * hx);
            }
            let inside = |j: usize, at: [usize; 2]| level.inside[j].then_some(at);
            if level.inside[i] && level.inside[i + width] {
                let line = [
                    inside(i - width, [row.wrapping_sub(1), column]),
                    Some([row, column]),
                    Some([row + 1, column]),
                    inside(i + 2 * width, [row + 2, column]),
                ];
                let (slope, weight) = slopes.edge(slopes.q, line);
                add_edge(level, residual, z, [i, i + width], weight, slope * hy);
            }
        }
    }
    hierarchy.build();
}

/// Adds w (z_j − z_i − rise)² to the fit; an end of known height moves to the right-hand side.
fn add_edge<T: Scalar>(
    level: &mut Level<T>,
    rhs: &mut [f64],
    z: &[f64],
    [i, j]: [usize; 2],
    weight: T,
    rise: T,
) {
    let (w, rise) = (weight.as_f64(), rise.as_f64());
    match (level.fixed[i], level.fixed[j]) {
        (false, false) => {
            let edges = if j == i + 1 { &mut level.right } else { &mut level.below };
            edges[i] = weight;
            rhs[i] -= w * rise;
            rhs[j] += w * rise;
        }
        (true, false) => {
            level.anchor[j] += weight;
            rhs[j] += w * (z[i] + rise);
        }
        (false, true) => {
            level.anchor[i] += weight;
            rhs[i] += w * (z[j] - rise);
        }
        (true, true) => {}
    }
}
