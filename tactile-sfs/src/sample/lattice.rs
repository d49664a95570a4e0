//! Every n-th pixel of a surface in both directions, with its height and the area of the surface it stands for.

use nalgebra::Point3;
use ndarray::ArrayView2;

use crate::quality::slopes_at;
use crate::{BoundingBox, Domain, Scalar, SfsError};

/// Nodes per point the spacing is measured with, if the surface filled its box; more do not change it visibly.
const NODES_PER_POINT: usize = 25;
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
    /// All pixels.
    pub(super) fn dense(
        surface: ArrayView2<'a, T>,
        mask: Option<ArrayView2<'a, bool>>,
        pixel_size_m: [T; 2],
        points: usize,
    ) -> Result<Self, SfsError> {
        let (rows, columns) = surface.dim();
        let domain = Domain { mask, pixel_size_m, known_heights: None };
        let area = domain.validate(rows, columns)?;
        Self::with_stride(surface, domain, area, 1).enough_for(points)
    }

    /// As few pixels as measure the spacing of `points` well, all of them if there is no room to move.
    pub(super) fn sparse(
        surface: ArrayView2<'a, T>,
        mask: Option<ArrayView2<'a, bool>>,
        pixel_size_m: [T; 2],
        points: usize,
    ) -> Result<Self, SfsError> {
        let (rows, columns) = surface.dim();
        let domain = Domain { mask, pixel_size_m, known_heights: None };
        let area = domain.validate(rows, columns)?;
        let wanted = NODES_PER_POINT * points.max(1);
        let mut stride = ((area.area() as f64 / wanted as f64).sqrt().round() as usize).max(1);
        loop {
            let lattice = Self::with_stride(surface, domain, area, stride);
            if stride == 1 || lattice.has_room_for(points) {
                return lattice.enough_for(points);
            }
            stride /= 2;
        }
    }

    fn with_stride(
        surface: ArrayView2<'a, T>,
        domain: Domain<'a, T>,
        area: BoundingBox,
        stride: usize,
    ) -> Self {
        let [rows, columns] =
            [area.rows, area.columns].map(|length| (length - 1 - Self::first(stride, length)) / stride + 1);
        let weight = Vec::with_capacity(rows * columns);
        let mut lattice = Self { surface, domain, area, stride, columns, rows, weight, count: 0 };
        for node in 0..rows * columns {
            let at @ [row, column] = lattice.pixel(node);
            let there = domain.contains(row, column) && surface[at].is_finite();
            lattice.count += usize::from(there);
            let area = || {
                let [p, q] = slopes_at(surface, at, domain.pixel_size_m);
                (T::one() + p * p + q * q).sqrt().as_f64()
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
            return Err(SfsError::TooManyPoints { requested: points, available: self.count });
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

    /// Heights of all nodes in units of the lattice's spacing along x, from that of the first; NaN where there is no node.
    pub(super) fn heights(&self) -> Vec<f32> {
        let unit = self.domain.pixel_size_m[0].as_f64() * self.stride as f64;
        let height = |node: usize| self.surface[self.pixel(node)].as_f64();
        let on = |node: &usize| self.weight[*node] > 0.0;
        let start = (0..self.weight.len()).find(on).map_or(0.0, height);
        (0..self.weight.len())
            .map(|node| if on(&node) { ((height(node) - start) / unit) as f32 } else { f32::NAN })
            .collect()
    }

    /// Whether a pixel lies on the surface.
    fn is_on(&self, [row, column]: [usize; 2]) -> bool {
        self.surface.get([row, column]).is_some_and(|z| z.is_finite()) && self.domain.contains(row, column)
    }

    /// The point at the pixel nearest to a place (x, y) in units of the lattice, among those of a node's own cell; at the
    /// node's pixel where that is not on the surface.
    pub(super) fn snapped(&self, node: usize, [x, y]: [f32; 2]) -> Point3<T> {
        let at = self.pixel(node);
        let stride = self.stride as f32;
        // The cells of two nodes share no pixel: offsets run from −stride/2 to (stride − 1)/2.
        let (low, high) = (-(self.stride as i64 / 2), (self.stride as i64 - 1) / 2);
        let offset = |place: f32, index: usize| {
            (((place - index as f32) * stride).round() as i64).clamp(low, high) as isize
        };
        let row = at[0].checked_add_signed(offset(y, node / self.columns));
        let column = at[1].checked_add_signed(offset(x, node % self.columns));
        let near = row.zip(column).map(|(row, column)| [row, column]);
        self.point(near.filter(|&near| self.is_on(near)).unwrap_or(at))
    }

    /// The point of the surface at a place between pixels, by bilinear interpolation; `None` where one of the pixels around is
    /// not on the surface.
    pub(super) fn between(&self, [x, y]: [f32; 2]) -> Option<Point3<T>> {
        let [first_row, first_column] = self.pixel(0);
        let at = |place: f32, first: usize| first as f64 + f64::from(place) * self.stride as f64;
        let (x, y) = (at(x, first_column), at(y, first_row));
        let (row, column) = (y as usize, x as usize);
        let (u, v) = (T::of(x.fract()), T::of(y.fract()));
        let corner = |dr: usize, dc: usize| {
            let at = [row + dr, column + dc];
            self.is_on(at).then(|| self.surface[at])
        };
        let (above, below) = ((corner(0, 0)?, corner(0, 1)?), (corner(1, 0)?, corner(1, 1)?));
        let line = |(a, b): (T, T)| a + u * (b - a);
        let [hx, hy] = self.domain.pixel_size_m;
        Some(Point3::new(T::of(x) * hx, T::of(y) * hy, line(above) + v * (line(below) - line(above))))
    }

    /// The point at a pixel, in metres.
    pub(super) fn point(&self, [row, column]: [usize; 2]) -> Point3<T> {
        let [hx, hy] = self.domain.pixel_size_m;
        Point3::new(T::of(column as f64) * hx, T::of(row as f64) * hy, self.surface[[row, column]])
    }

    /// The nodes on the surface, in reading order.
    pub(super) fn nodes(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.weight.len()).filter(|&node| self.weight[node] > 0.0)
    }
}
