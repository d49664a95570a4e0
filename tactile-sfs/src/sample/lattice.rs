//! Every n-th pixel of a surface in both directions, with its height and the area of the surface it stands for.

use nalgebra::Point3;
use ndarray::ArrayView2;

use crate::quality::slopes_at;
use crate::{BoundingBox, Domain, Scalar, SfsError};

/// Nodes per point the areas are measured with, if the surface filled its box: with every pixel of most surfaces points
/// follow a surface that grows or moves to a hundredth of a pixel, with every other pixel to a third.
const NODES_PER_POINT: usize = 100;
/// Steeper ground counts as this steep (63°). At the rim of a round body the slope has no end: how much of it a lattice sees
/// depends on the pixels, and points would follow those, not the body.
const STEEPEST: f64 = 2.0;
/// Fewest nodes per point that leave points room to move.
const ROOM: usize = 8;

/// A regular lattice of pixels of a surface.
pub(super) struct Lattice<'a, T> {
    surface: ArrayView2<'a, T>,
    domain: Domain<'a, T>,
    area: BoundingBox,
    /// Pixels from node to node.
    stride: usize,
    /// Nodes per row.
    pub(super) columns: usize,
    /// Rows of nodes.
    pub(super) rows: usize,
    /// Area of the surface over the node's pixels per area of the pixels, times any density; 0 where there is no node.
    pub(super) weight: Vec<f64>,
    /// Nodes that lie on the surface.
    pub(super) count: usize,
}

impl<'a, T: Scalar> Lattice<'a, T> {
    /// All pixels; `weight` is a buffer to be used again.
    pub(super) fn dense(
        surface: ArrayView2<'a, T>,
        mask: Option<ArrayView2<'a, bool>>,
        pixel_size_m: [T; 2],
        points: usize,
        weight: Vec<f64>,
    ) -> Result<Self, SfsError> {
        let (rows, columns) = surface.dim();
        let domain = Domain {
            mask,
            pixel_size_m,
            known_heights: None,
        };
        let area = domain.validate(rows, columns)?;
        Self::with_stride(surface, domain, area, 1, weight).enough_for(points)
    }

    /// As few pixels as measure the spacing of `points` well, all of them if there is no room to move.
    pub(super) fn sparse(
        surface: ArrayView2<'a, T>,
        mask: Option<ArrayView2<'a, bool>>,
        pixel_size_m: [T; 2],
        points: usize,
        mut weight: Vec<f64>,
    ) -> Result<Self, SfsError> {
        let (rows, columns) = surface.dim();
        let domain = Domain {
            mask,
            pixel_size_m,
            known_heights: None,
        };
        let area = domain.validate(rows, columns)?;
        let wanted = NODES_PER_POINT * points.max(1);
        let mut stride = (area.area() / wanted).isqrt().max(1);
        loop {
            let lattice = Self::with_stride(surface, domain, area, stride, weight);
            if stride == 1 || lattice.has_room_for(points) {
                return lattice.enough_for(points);
            }
            stride /= 2;
            weight = lattice.weight;
        }
    }

    fn with_stride(
        surface: ArrayView2<'a, T>,
        domain: Domain<'a, T>,
        area: BoundingBox,
        stride: usize,
        mut weight: Vec<f64>,
    ) -> Self {
        let [rows, columns] = [area.rows, area.columns]
            .map(|length| (length - 1 - Self::first(stride, length)) / stride + 1);
        weight.clear();
        let mut lattice = Self {
            surface,
            domain,
            area,
            stride,
            columns,
            rows,
            weight,
            count: 0,
        };
        for node in 0..rows * columns {
            let at @ [row, column] = lattice.pixel(node);
            let there = domain.contains(row, column) && surface[at].is_finite();
            lattice.count += usize::from(there);
            let area = || {
                let [p, q] = slopes_at(surface, at, domain.pixel_size_m);
                (T::one() + (p * p + q * q).min(T::of(STEEPEST * STEEPEST)))
                    .sqrt()
                    .as_f64()
            };
            lattice.weight.push(if there { area() } else { 0.0 });
        }
        lattice
    }

    /// Where the first node lies in a box of `length` pixels: in the middle of its cell.
    fn first(stride: usize, length: usize) -> usize {
        (stride / 2).min(length - 1)
    }

    fn enough_for(self, points: usize) -> Result<Self, SfsError> {
        if self.count == 0 {
            return Err(SfsError::EmptyMask);
        }
        if points > self.count {
            return Err(SfsError::TooManyPoints {
                requested: points,
                available: self.count,
            });
        }
        Ok(self)
    }

    /// Whether points can move by less than their spacing.
    pub(super) fn has_room_for(&self, points: usize) -> bool {
        self.count >= ROOM * points
    }

    /// Row and column of a node's pixel.
    pub(super) fn pixel(&self, node: usize) -> [usize; 2] {
        let [row, column] = [node / self.columns, node % self.columns];
        [
            self.area.top + Self::first(self.stride, self.area.rows) + row * self.stride,
            self.area.left + Self::first(self.stride, self.area.columns) + column * self.stride,
        ]
    }

    /// Height of a pixel over its width.
    pub(super) fn aspect(&self) -> f64 {
        self.domain.pixel_size_m[1].as_f64() / self.domain.pixel_size_m[0].as_f64()
    }

    /// The point at a place (x, y) of the lattice, its height interpolated, and the pixel it lies in; where that is not
    /// inside the surface, the nearest node.
    pub(super) fn point_near(&self, [x, y]: [f64; 2]) -> ([usize; 2], Point3<T>) {
        let place = |start: usize, length: usize, at: f64| {
            (start + Self::first(self.stride, length)) as f64 + at * self.stride as f64
        };
        let column = place(self.area.left, self.area.columns, x);
        let row = place(self.area.top, self.area.rows, y);
        let Some(height) = self.height_at(row, column) else {
            let pixel = self.pixel(self.nearest([x, y]));
            return (pixel, self.point(pixel));
        };
        let [hx, hy] = self.domain.pixel_size_m;
        let point = Point3::new(T::of(column) * hx, T::of(row) * hy, height);
        ([row.round() as usize, column.round() as usize], point)
    }

    /// The node on the surface nearest to a place.
    fn nearest(&self, [x, y]: [f64; 2]) -> usize {
        let distance = |node: &usize| {
            let (dx, dy) = (
                (node % self.columns) as f64 - x,
                (node / self.columns) as f64 - y,
            );
            dx.hypot(dy * self.aspect())
        };
        self.nodes()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .unwrap_or(0)
    }

    /// Height between four pixels, bilinear; `None` unless all four lie on the surface.
    fn height_at(&self, row: f64, column: f64) -> Option<T> {
        let (r, c) = (row.floor() as usize, column.floor() as usize);
        let (down, right) = (T::of(row - r as f64), T::of(column - c as f64));
        let height = |row: usize, column: usize| {
            let z = self
                .surface
                .get([row, column])
                .copied()
                .filter(|z| z.is_finite())?;
            self.domain.contains(row, column).then_some(z)
        };
        let along =
            |row: usize| Some(height(row, c)? * (T::one() - right) + height(row, c + 1)? * right);
        Some(along(r)? * (T::one() - down) + along(r + 1)? * down)
    }

    /// The point at a pixel, in metres.
    pub(super) fn point(&self, [row, column]: [usize; 2]) -> Point3<T> {
        let [hx, hy] = self.domain.pixel_size_m;
        Point3::new(
            T::of(column as f64) * hx,
            T::of(row as f64) * hy,
            self.surface[[row, column]],
        )
    }

    /// The nodes on the surface, in reading order.
    pub(super) fn nodes(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.weight.len()).filter(|&node| self.weight[node] > 0.0)
    }
}
