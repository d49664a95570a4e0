//! Weighted least squares on a mask of any shape, by a sparse Cholesky factorisation.
//!
//! Minimises Σ w_ij (z_j − z_i − h s̄_ij)² over the edges between neighbouring pixels of the mask.
//! Here s̄ is the mean slope along the edge, of the cubic through the slopes of the pixels in line
//! with it (at the border a parabola or line). The weight w_ij is the harmonic mean of the weights
//! of the two pixels. The error is O(h⁴) inside. On a full rectangle with equal weights,
//! [`CosinePoisson`] solves the same equations directly and is used instead. The border of the mask
//! is free (natural). Connected regions are independent: each has mean 0, or is fixed by its own
//! known heights.

use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};
use ndarray::{Array2, ArrayView2};

use super::{CosinePoisson, SlopeIntegrator};
use crate::domain::{parts, same_shape};
use crate::surface::Component;
use crate::{BoundingBox, Domain, PixelFlags, PixelScalar, SfsError, Surface, SurfaceWorkspace};

/// Weighted least squares integration on a mask.
///
/// Slopes that are NaN or infinite are left out: the edge uses the slope of the other pixel, or, if
/// both are missing, a zero slope of small weight. Such pixels have the flag `NON_FINITE`. Known
/// heights inside the mask are met exactly, and each connected region without one has mean 0
/// (`report.components`).
///
/// The equations are solved directly, by a sparse Cholesky factorisation with a fill-reducing
/// order. On a full rectangle of n pixels with equal weights and without known heights, Poisson's
/// equation is solved instead, in O(n log n).
///
/// ```
/// use ndarray::{Array2, array};
/// use tactile_sfs::{Domain, MaskedLeastSquares, SlopeIntegrator};
/// let mask = array![[true, true, false, true], [false, true, false, true]];
/// let (p, q) = (Array2::from_elem((2, 4), 1.0), Array2::from_elem((2, 4), 2.0));
/// let domain = Domain::default().with_mask(mask.view());
/// let surface = MaskedLeastSquares::default().integrate(p.view(), q.view(), &domain)?;
/// assert_eq!(surface.report.components.len(), 2);
/// assert!((surface.heights[[1, 3]] - surface.heights[[0, 3]] - 2.0_f64).abs() < 1e-9);
/// assert!(surface.heights[[0, 2]].is_nan());
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaskedLeastSquares<'a, T> {
    weights: Option<ArrayView2<'a, T>>,
}

/// Equal weights.
impl<T> Default for MaskedLeastSquares<'_, T> {
    fn default() -> Self {
        Self { weights: None }
    }
}

impl<'a, T: PixelScalar> MaskedLeastSquares<'a, T> {
    /// Weight of the slopes of each pixel, for example the inverse of their variance. A weight of
    /// 0, NaN or below 0 excludes the slopes.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{Domain, MaskedLeastSquares, SlopeIntegrator};
    /// let (mut p, mut weights) = (Array2::from_elem((6, 6), 0.5), Array2::from_elem((6, 6), 1.0));
    /// (p[[2, 3]], weights[[2, 3]]) = (40.0, 0.0); // a wrong slope, with weight 0
    /// let method = MaskedLeastSquares::default().with_weights(weights.view());
    /// let surface = method.integrate(p.view(), Array2::zeros((6, 6)).view(), &Domain::default())?;
    /// let z = &surface.heights;
    /// assert!((z[[2, 5]] - z[[2, 0]] - 2.5_f64).abs() < 0.1);
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    pub fn with_weights(self, weights: ArrayView2<'a, T>) -> Self {
        Self {
            weights: Some(weights),
        }
    }

    /// Whether the fit is Poisson's equation on a rectangle: equal weights, no known height, and no
    /// hole in the mask.
    fn is_poisson(&self, domain: &Domain<'_, T>, area: BoundingBox) -> bool {
        let full = |mask: ArrayView2<'_, bool>| area.of(mask).iter().all(|&inside| inside);
        self.weights.is_none() && domain.known_heights.is_none() && domain.mask.is_none_or(full)
    }

    /// The slope at a pixel and its weight. `None` if the slope is not used.
    fn usable(&self, slopes: ArrayView2<'_, T>, at: [usize; 2]) -> Option<[f64; 2]> {
        let weight = self.weights.map_or(1.0, |weights| weights[at].as_f64());
        let slope = slopes[at].as_f64();
        (slope.is_finite() && weight > 0.0 && weight.is_finite()).then_some([slope, weight])
    }

    /// Mean slope and weight of the edge between the middle two of four pixels in line. The outer
    /// two may be missing.
    fn edge(
        &self,
        slopes: ArrayView2<'_, T>,
        [before, from, to, beyond]: [Option<[usize; 2]>; 4],
    ) -> [f64; 2] {
        let usable = |at: Option<[usize; 2]>| self.usable(slopes, at?);
        let slope = |at| usable(at).map(|[slope, _]| slope);
        match (usable(from), usable(to)) {
            (Some([b, v]), Some([c, w])) => {
                let mean = match (slope(before), slope(beyond)) {
                    // Integrals over the edge of the polynomial through the available slopes.
                    (Some(a), Some(d)) => (13.0 * (b + c) - a - d) / 24.0,
                    (Some(a), None) => (5.0 * c + 8.0 * b - a) / 12.0,
                    (None, Some(d)) => (5.0 * b + 8.0 * c - d) / 12.0,
                    (None, None) => 0.5 * (b + c),
                };
                // The less certain of the two slopes dominates the harmonic mean.
                [mean, 2.0 * v * w / (v + w)]
            }
            (Some(one), None) | (None, Some(one)) => one,
            // Small enough to do no more than bridge the gap, and large enough for equations that
            // are far from singular.
            (None, None) => [0.0, 1e-4],
        }
    }
}

/// The numbering of the unknowns and the equations between them, kept between calls.
///
/// A weighted graph Laplacian: known heights are moved to the right-hand side.
#[derive(Debug, Default)]
pub(crate) struct MaskedBuffers {
    /// Number of the unknown of each pixel of the box, or one of the marks below.
    number: Vec<usize>,
    /// Pixels of the unknowns.
    pixels: Vec<[usize; 2]>,
    diagonal: Vec<f64>,
    rhs: Vec<f64>,
    /// Edges between unknowns: the two numbers and the weight.
    edges: Vec<(usize, usize, f64)>,
    /// The connected regions of the mask, in the order of their first pixels.
    parts: Vec<Vec<[usize; 2]>>,
}

/// Marks of pixels outside the mask and of pixels with a known height.
const OUTSIDE: usize = usize::MAX;
const KNOWN: usize = usize::MAX - 1;

impl<T: PixelScalar> SlopeIntegrator<T> for MaskedLeastSquares<'_, T> {
    fn integrate(
        &self,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
    ) -> Result<Surface<T>, SfsError> {
        Surface::made_by(|workspace, surface| self.integrate_with(workspace, p, q, domain, surface))
    }

    fn integrate_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let area = domain.bounding_box(p.dim())?;
        if let Some(weights) = self.weights {
            same_shape("weights", p.dim(), weights.dim())?;
        }
        if self.is_poisson(domain, area) {
            match CosinePoisson.integrate_with(workspace, p, q, domain, surface) {
                // The general solver can leave out such slopes.
                Err(SfsError::NonFiniteSlope { .. }) => {}
                other => {
                    other?;
                    surface.report.components.push(Component {
                        pixels: area.area(),
                        first: [area.row_start, area.column_start],
                        mean_height: T::zero(),
                    });
                    return Ok(());
                }
            }
        }
        surface.enter_slopes(p, q, domain)?;
        let buffers = &mut workspace.masked;
        buffers.enumerate(domain, surface, [p, q]);
        buffers.label(area);
        self.assemble(buffers, [p, q], domain, area);
        let heights = buffers.solve(area)?;
        buffers.write_levelled(&heights, surface);
        surface.finish(domain);
        Ok(())
    }
}

impl<T: PixelScalar> MaskedLeastSquares<'_, T> {
    /// Assembles the equations. Heights are in units of the pixel size, and the weight of an edge
    /// along x is multiplied by (h_y/h_x)².
    fn assemble(
        &self,
        buffers: &mut MaskedBuffers,
        slopes: [ArrayView2<'_, T>; 2],
        domain: &Domain<'_, T>,
        area: BoundingBox,
    ) {
        let [hx, hy] = domain.pixel_size_m.map(T::as_f64);
        let inside = |row: usize, column: usize| {
            let in_box = area.row_start <= row && row < area.row_end;
            let in_box = in_box && area.column_start <= column && column < area.column_end;
            (in_box && domain.contains(row, column)).then_some([row, column])
        };
        for (row, column) in area.pixels() {
            let before = [
                inside(row, column.wrapping_sub(1)),
                inside(row.wrapping_sub(1), column),
            ];
            let line = |down: usize, right: usize| {
                [0, 1, 2].map(|k| inside(row + k * down, column + k * right))
            };
            for (axis, [here, next, beyond]) in [line(0, 1), line(1, 0)].into_iter().enumerate() {
                let (Some(from), Some(to)) = (here, next) else {
                    continue;
                };
                let [slope, weight] = self.edge(slopes[axis], [before[axis], here, next, beyond]);
                // The squared slope is minimised, multiplied by h_y².
                let (step, factor) = [(hx, (hy / hx).powi(2)), (hy, 1.0)][axis];
                let height = |[row, column]: [usize; 2]| domain.known(row, column).map(T::as_f64);
                let ends = [from, to].map(|at| (buffers.number_of(at, area), height(at)));
                buffers.add(ends, factor * weight, slope * step);
            }
        }
    }
}

impl MaskedBuffers {
    /// Numbers the pixels without a known height, writes the known heights, and flags slopes that
    /// are not finite.
    fn enumerate<T: PixelScalar>(
        &mut self,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
        [p, q]: [ArrayView2<'_, T>; 2],
    ) {
        self.number.clear();
        self.pixels.clear();
        for (row, column) in surface.bounding_box.pixels() {
            let number = if !domain.contains(row, column) {
                OUTSIDE
            } else if let Some(height) = domain.known(row, column) {
                surface.set(row, column, height);
                KNOWN
            } else {
                self.pixels.push([row, column]);
                self.pixels.len() - 1
            };
            self.number.push(number);
            let at = [row, column];
            if number != OUTSIDE && !(p[at].is_finite() && q[at].is_finite()) {
                surface.flags[at] |= PixelFlags::NON_FINITE;
            }
        }
        for vector in [&mut self.diagonal, &mut self.rhs] {
            vector.clear();
            vector.resize(self.pixels.len(), 0.0);
        }
        self.edges.clear();
    }

    fn number_of(&self, [row, column]: [usize; 2], area: BoundingBox) -> usize {
        self.number[(row - area.row_start) * area.columns() + column - area.column_start]
    }

    /// Adds w (z_j − z_i − rise)² to the fit, for two ends with their numbers and known heights.
    fn add(&mut self, [i, j]: [(usize, Option<f64>); 2], weight: f64, rise: f64) {
        for ((end, known), (_, other), sign) in [(i, j, -1.0), (j, i, 1.0)] {
            if known.is_none() {
                self.diagonal[end] += weight;
                self.rhs[end] += weight * (sign * rise + other.unwrap_or(0.0));
            }
        }
        // A known height is not an unknown and has been moved to the right-hand side.
        if i.1.is_none() && j.1.is_none() {
            self.edges.push((i.0, j.0, weight));
        }
    }

    /// Finds the connected regions of the mask (four neighbours).
    fn label(&mut self, area: BoundingBox) {
        let (rows, columns) = (area.rows(), area.columns());
        let inside = |(row, column)| self.number[row * columns + column] != OUTSIDE;
        self.parts = parts(Array2::from_shape_fn((rows, columns), inside).view(), true);
        for [row, column] in self.parts.iter_mut().flatten() {
            *row += area.row_start;
            *column += area.column_start;
        }
    }

    /// Whether a region contains a known height.
    fn is_anchored(&self, part: &[[usize; 2]], area: BoundingBox) -> bool {
        part.iter().any(|&at| self.number_of(at, area) == KNOWN)
    }

    /// The heights of the unknowns. A region without a known height is held at height 0 by a spring
    /// at its first pixel. The spring exerts no force, because the right-hand side of such a region
    /// sums to 0.
    fn solve(&mut self, area: BoundingBox) -> Result<Vec<f64>, SfsError> {
        let n = self.pixels.len();
        if n == 0 {
            return Ok(Vec::new());
        }
        for part in &self.parts {
            if self.is_anchored(part, area) {
                continue;
            }
            // A region of one pixel has no edge.
            let first = self.number_of(part[0], area);
            let held = &mut self.diagonal[first];
            // The spring is as stiff as the edges of the pixel, which preserves the condition of
            // the equations.
            *held = if *held > 0.0 { 2.0 * *held } else { 1.0 };
        }
        let entry = Triplet::<usize, usize, f64>::new;
        let diagonal = self.diagonal.iter().enumerate();
        let mut entries: Vec<_> = diagonal.map(|(i, &value)| entry(i, i, value)).collect();
        let edges = self.edges.iter();
        entries.extend(edges.map(|&(i, j, weight)| entry(i.max(j), i.min(j), -weight)));
        let matrix =
            SparseColMat::try_new_from_triplets(n, n, &entries).map_err(SfsError::custom)?;
        let factor = matrix.sp_cholesky(Side::Lower).map_err(SfsError::custom)?;
        let mut heights = Mat::from_fn(n, 1, |i, _| self.rhs[i]);
        factor.solve_in_place(&mut heights);
        Ok((0..n).map(|i| heights[(i, 0)]).collect())
    }

    /// Writes the heights, shifts regions without a known height to mean 0, and reports all
    /// regions.
    fn write_levelled<T: PixelScalar>(&self, heights: &[f64], surface: &mut Surface<T>) {
        let area = surface.bounding_box;
        let unknown = |at| heights.get(self.number_of(at, area)).copied();
        for part in &self.parts {
            let height = |&at| unknown(at).unwrap_or(surface.heights[at].as_f64());
            let mean = part.iter().map(height).sum::<f64>() / part.len() as f64;
            let anchored = self.is_anchored(part, area);
            let shift = if anchored { 0.0 } else { mean };
            for &at in part {
                if let Some(height) = unknown(at) {
                    surface.set(at[0], at[1], T::of(height - shift));
                }
            }
            surface.report.components.push(Component {
                pixels: part.len(),
                first: part[0],
                mean_height: T::of(mean - shift),
            });
        }
    }
}
