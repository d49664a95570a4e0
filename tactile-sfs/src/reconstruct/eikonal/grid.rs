//! From the frame to the grid (nodes, angles to the light, known heights, boundary offsets and
//! edges), and from the grid to the surface.
//!
//! A boundary offset is the height of a pixel above a boundary of known height next to it, with
//! sub-pixel accuracy.

use super::{BoundaryCondition, Eikonal, EikonalBuffers, Node};
use crate::{Domain, Frame, PixelFlags, PixelScalar, SfsError, Surface};

/// Number of pixels over which kind and curvature of the boundary are assumed to be constant.
const WINDOW: usize = 4;

/// The boundary is at most one pixel away; the rest is a tolerance for the error of the
/// extrapolation.
const REACH: f64 = 1.25;

impl<T: PixelScalar> EikonalBuffers<T> {
    /// Fills the grid and flags the pixels that disagree with the model. Returns whether heights
    /// are known inside the mask.
    pub(super) fn load(
        &mut self,
        method: &Eikonal<T>,
        frame: &Frame<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<bool, SfsError> {
        let area = surface.bounding_box;
        let [hx, hy] = domain.pixel_size_m;
        self.clear(area.rows(), area.columns());
        self.aspect = hy / hx;
        let at_border = match method.boundary {
            BoundaryCondition::Height(height) => Some(height),
            BoundaryCondition::Free => None,
        };
        // The lowest reflectance that differs from black: R = 1/√(1 + slope²) at the largest slope.
        // A darker pixel would be steeper than allowed.
        let least = (T::one() + method.max_slope.powi(2)).sqrt().recip();
        let (frame_rows, frame_columns) = frame.dim();
        let (mut known_inside, mut known_outside) = (false, false);
        for i in 0..self.node.len() {
            // The border of the grid may lie outside the frame.
            let row = (area.row_start + i / self.width).wrapping_sub(1);
            let column = (area.column_start + i % self.width).wrapping_sub(1);
            if row >= frame_rows || column >= frame_columns {
                continue;
            }
            let known = domain.known(row, column);
            if !domain.contains(row, column) {
                if let Some(height) = known.or(at_border) {
                    // The grid uses the width of a pixel as its unit, so that slopes have no unit.
                    self.given[i] = height / hx;
                    known_outside = true;
                }
                continue;
            }
            self.node[i] = if known.is_some() {
                Node::Known
            } else {
                Node::Unknown
            };
            known_inside |= known.is_some();
            self.given[i] = known.map_or(T::nan(), |height| height / hx);
            let reflectance = method.lighting.reflectance(frame.at(row, column));
            let flags = PixelFlags::of_reflectance(reflectance, least);
            surface.flags[[row, column]] = flags;
            if flags == PixelFlags::NON_FINITE {
                self.holes.push(i);
                self.cosine[i] = T::nan();
            } else {
                self.cosine[i] = reflectance.max(least).min(T::one());
            }
        }
        self.fill_holes(area.area())?;
        for (sine, &cosine) in self.sine.iter_mut().zip(&self.cosine) {
            // Written as a product, because 1 − cos² loses half of the digits at normals that point
            // to the light.
            *sine = ((T::one() - cosine) * (T::one() + cosine))
                .max(T::zero())
                .sqrt();
        }
        self.measure_offsets();
        let at_boundary = known_outside && self.offset.iter().any(|offset| !offset.is_nan());
        if !(known_inside || at_boundary) {
            return Err(SfsError::NoKnownHeight);
        }
        self.measure_edges();
        Ok(known_inside)
    }

    fn clear(&mut self, rows: usize, columns: usize) {
        self.width = columns + 2;
        let length = self.width * (rows + 2);
        fill(&mut self.node, length, Node::Outside);
        fill(&mut self.active, length, false);
        fill(&mut self.cosine, length, T::one());
        fill(&mut self.sine, length, T::zero());
        fill(&mut self.given, length, T::nan());
        fill(&mut self.value, length, T::infinity());
        fill(&mut self.offset, length, T::nan());
        fill(&mut self.edges, length, [T::one(); 2]);
        fill(&mut self.along_x, length, T::nan());
        self.corrected = false;
        self.directed = false;
        self.front.clear();
        self.holes.clear();
    }

    /// Fills pixels without a finite intensity with the mean of their finite neighbours, from the
    /// edge of a hole inwards. A region of the mask without any intensity is taken as flat, for
    /// lack of data. A mask without any intensity is an error.
    fn fill_holes(&mut self, pixels: usize) -> Result<(), SfsError> {
        for _ in 0..pixels {
            let before = self.holes.len();
            if before == 0 {
                break;
            }
            // `kept` holds the new values until the end of the pass, so that the order does not
            // matter.
            let mut values = core::mem::take(&mut self.kept);
            values.clear();
            values.extend(self.holes.iter().map(|&i| self.mean_around(i)));
            for (&i, &value) in self.holes.iter().zip(&values) {
                self.cosine[i] = value;
            }
            self.kept = values;
            let cosine = &self.cosine;
            self.holes.retain(|&i| cosine[i].is_nan());
            if self.holes.len() == before {
                if before
                    == self
                        .node
                        .iter()
                        .filter(|&&node| node != Node::Outside)
                        .count()
                {
                    return Err(SfsError::EmptyMask);
                }
                // No neighbour has a value: the remaining pixels form an isolated region of the
                // mask.
                self.holes.drain(..).for_each(|i| self.cosine[i] = T::one());
            }
        }
        Ok(())
    }

    /// Mean reflectance of the eight neighbours that have one. NaN if none has.
    fn mean_around(&self, i: usize) -> T {
        let (mut sum, mut count) = (T::zero(), 0usize);
        for line in [i - self.width, i, i + self.width] {
            for j in [line - 1, line, line + 1] {
                if self.node[j] != Node::Outside && self.cosine[j].is_finite() {
                    sum += self.cosine[j];
                    count += 1;
                }
            }
        }
        if count > 0 {
            sum / T::of(count as f64)
        } else {
            T::nan()
        }
    }

    /// 1/(slope · step)² by the chord rule for every edge between two nodes of the mask.
    fn measure_edges(&mut self) {
        // A lower bound of 10⁻⁶ pixels per pixel avoids a division by zero in flat regions (slope
        // 0).
        let floor = T::of(1e-6);
        let metric = |sine: [T; 2], cosine: [T; 2], step: T| {
            // The tangent of the mean angle, computed from sines and cosines without an arctangent.
            let slope = (sine[0] + sine[1]) / (cosine[0] + cosine[1]);
            (slope.max(floor) * step).powi(-2)
        };
        let (width, aspect) = (self.width, self.aspect);
        let rest = self.node.len() - 2 * width;
        // Every node and the nodes to its right and below, as slices of equal length, so that no
        // index needs a bounds check.
        let (sine, cosine) = (&self.sine[width..], &self.cosine[width..]);
        let (sine_right, cosine_right) = (&sine[1..=rest], &cosine[1..=rest]);
        let (sine_below, cosine_below) = (&sine[width..][..rest], &cosine[width..][..rest]);
        let (sine, cosine) = (&sine[..rest], &cosine[..rest]);
        let nodes = &self.node[width..][..rest];
        let edges = &mut self.edges[width..][..rest];
        for i in 0..rest {
            let (s, c) = (sine[i], cosine[i]);
            let right = metric([s, sine_right[i]], [c, cosine_right[i]], T::one());
            let below = metric([s, sine_below[i]], [c, cosine_below[i]], aspect);
            edges[i] = if nodes[i] == Node::Outside {
                [T::one(); 2]
            } else {
                [right, below]
            };
        }
    }

    /// Writes value × `scale` to the surface.
    pub(super) fn store(&self, scale: T, domain: &Domain<'_, T>, surface: &mut Surface<T>) {
        let area = surface.bounding_box;
        for (row, column) in area.pixels() {
            let i = (row - area.row_start + 1) * self.width + column - area.column_start + 1;
            match self.node[i] {
                Node::Outside => {}
                Node::Known => surface.set(
                    row,
                    column,
                    domain.known(row, column).unwrap_or_else(T::nan),
                ),
                Node::Unknown if self.value[i].is_finite() => {
                    surface.set(row, column, scale * self.value[i])
                }
                Node::Unknown => surface.flags[[row, column]] |= PixelFlags::UNREACHED,
            }
        }
    }

    /// Measures the boundary offset of every unknown pixel of the mask next to a given height
    /// outside the mask.
    ///
    /// The solution is a minimum over the whole boundary: one pixel that appears too flat because
    /// of noise would lower the whole surface. The kind of boundary is therefore decided by the
    /// majority of the boundary pixels around a pixel, and their mean |∇ sin θ| is used.
    fn measure_offsets(&mut self) {
        for i in self.width..self.node.len() - self.width {
            let near = [i - 1, i + 1, i - self.width, i + self.width];
            // Most nodes have no neighbour outside the mask.
            if !near.iter().any(|&j| self.node[j] == Node::Outside) {
                continue;
            }
            if self.node[i] == Node::Unknown && self.lowest(i, T::one()).is_finite() {
                // This array holds |∇ sin θ| and step until the edges are measured.
                self.edges[i] = self.gradient_and_step(i);
                self.offset[i] = T::zero();
            }
        }
        for i in self.width..self.node.len() - self.width {
            if !self.offset[i].is_nan() {
                self.offset[i] = self.offset_of(i);
            }
        }
    }

    /// Sets the values from which sweeps start: known heights, and boundary heights with their
    /// offsets.
    pub(super) fn start(&mut self, convex: bool) {
        let sign = if convex { T::one() } else { -T::one() };
        for i in self.width..self.node.len() - self.width {
            self.active[i] = self.node[i] == Node::Unknown;
            self.value[i] = match self.node[i] {
                Node::Known => sign * self.given[i],
                // The surface rises from the boundary in the convex branch, and in the concave
                // branch after a change of sign.
                Node::Unknown if !self.offset[i].is_nan() => self.lowest(i, sign) + self.offset[i],
                _ => T::infinity(),
            };
        }
    }

    /// Lowest height given outside the mask next to a pixel, or +∞ if there is none. For sign −1 it
    /// is the negated highest.
    fn lowest(&self, i: usize, sign: T) -> T {
        let width = self.width;
        let given = |j: usize| match self.node[j] {
            Node::Outside if !self.given[j].is_nan() => sign * self.given[j],
            _ => T::infinity(),
        };
        given(i - 1)
            .min(given(i + 1))
            .min(given(i - width))
            .min(given(i + width))
    }

    /// |∇ sin θ| at a pixel, and the largest possible distance of the boundary along that gradient.
    fn gradient_and_step(&self, i: usize) -> [T; 2] {
        let [gx, gy] = self.gradient(i);
        let length = gx.hypot(gy);
        if length > T::zero() {
            // Projection of the step to the next pixel along the steeper axis onto the gradient.
            let step = gx.abs().max(gy.abs() * self.aspect) / length;
            [length, step]
        } else {
            [length, T::one().min(self.aspect)]
        }
    }

    /// ∇ sin θ at a pixel of the mask.
    fn gradient(&self, i: usize) -> [T; 2] {
        [
            self.derivative(i, 1),
            self.derivative(i, self.width) / self.aspect,
        ]
    }

    /// The boundary offset of a pixel. At an occluding contour, sin θ is extrapolated to 1.
    /// Elsewhere the boundary is half a pixel away.
    fn offset_of(&self, i: usize) -> T {
        let (sine, cosine) = (self.sine[i], self.cosine[i]);
        let (gradient, occluding) = self.around(i);
        if occluding {
            // Radius of curvature times cos θ: the height above the contour, at which the normal
            // lies in the image plane.
            return cosine / gradient;
        }
        let half_step = T::of(0.5) * self.edges[i][1];
        // Extrapolated outwards, the sine may exceed 1.
        let boundary_sine = (sine + half_step * gradient).min(T::one());
        let boundary_cosine = (T::one() - boundary_sine * boundary_sine)
            .max(T::zero())
            .sqrt();
        half_step * (sine + boundary_sine) / (cosine + boundary_cosine)
    }

    /// Mean |∇ sin θ| of the boundary pixels around a pixel, and whether most of them lie at an
    /// occluding contour.
    fn around(&self, i: usize) -> (T, bool) {
        let (width, rows) = (self.width, self.node.len() / self.width);
        let span = |middle: usize, length: usize| {
            middle.saturating_sub(WINDOW)..(middle + WINDOW + 1).min(length)
        };
        let (mut sum, mut count, mut votes) = (T::zero(), 0usize, 0usize);
        for row in span(i / width, rows) {
            for j in span(i % width, width).map(|column| row * width + column) {
                if !self.offset[j].is_nan() {
                    let [gradient, step] = self.edges[j];
                    sum += gradient;
                    count += 1;
                    votes += usize::from(T::one() - self.sine[j] < T::of(REACH) * step * gradient);
                }
            }
        }
        (sum / T::of(count as f64), 2 * votes > count)
    }

    /// cos² of the angle between ∇ sin θ and the x axis.
    pub(super) fn boundary_along_x(&self, i: usize) -> T {
        let [gx, gy] = self.gradient(i);
        gx * gx / (gx * gx + gy * gy)
    }

    /// Derivative of sin θ along one axis, from the neighbours inside the mask. It is of second
    /// order if there are enough neighbours.
    fn derivative(&self, i: usize, stride: usize) -> T {
        let inside = |j: Option<usize>| {
            j.filter(|&j| self.node.get(j).is_some_and(|&node| node != Node::Outside))
        };
        let (before, after) = (inside(Some(i - stride)), inside(Some(i + stride)));
        let here = self.sine[i];
        let one_sided = |near: usize, far: Option<usize>| match inside(far) {
            Some(far) => {
                T::of(1.5) * here - T::of(2.0) * self.sine[near] + T::of(0.5) * self.sine[far]
            }
            None => here - self.sine[near],
        };
        match (before, after) {
            (Some(before), Some(after)) => T::of(0.5) * (self.sine[after] - self.sine[before]),
            (Some(before), None) => one_sided(before, before.checked_sub(stride)),
            (None, Some(after)) => -one_sided(after, Some(after + stride)),
            (None, None) => T::zero(),
        }
    }
}

/// Fills a buffer with `length` copies of `value`.
fn fill<A: Copy>(buffer: &mut Vec<A>, length: usize, value: A) {
    buffer.clear();
    buffer.resize(length, value);
}
