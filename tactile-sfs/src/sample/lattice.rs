//! Every n-th pixel of a surface in both directions, with its height and the area of the surface it stands for. And a spread
//! of points over such weights: the surface cut into strips of rows, the strips into cells of equal weight, a point in the
//! centroid of each.
//!
//! Cuts run through nodes: where the surface is the same but larger, or lies elsewhere between the pixels, the points
//! are the same points of the surface.

use nalgebra::Point3;
use ndarray::ArrayView2;

use crate::quality::slopes_at;
use crate::{BoundingBox, Domain, PixelScalar, SfsError};

/// Nodes per point the areas are measured with, if the surface filled its box: with every pixel of most surfaces points
/// follow a surface that grows or moves to a hundredth of a pixel, with every other pixel to a third.
const NODES_PER_POINT: usize = 100;
/// Steeper ground counts as this steep (63°). At the rim of a round body the slope has no end: how much of it a lattice sees
/// depends on the pixels, and points would follow those, not the body.
const STEEPEST: f64 = 2.0;
/// Fewest nodes per point that leave points room to move.
const ROOM: usize = 8;

/// A regular lattice of pixels of a surface.
pub(super) struct Lattice<'s, 'd, T> {
    surface: ArrayView2<'s, T>,
    domain: Domain<'d, T>,
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

impl<'s, 'd, T: PixelScalar> Lattice<'s, 'd, T> {
    /// All pixels; `weight` is a buffer to be used again.
    pub(super) fn dense(
        surface: ArrayView2<'s, T>,
        domain: &Domain<'d, T>,
        points: usize,
        weight: Vec<f64>,
    ) -> Result<Self, SfsError> {
        let area = domain.bounding_box(surface.dim())?;
        Self::with_stride(surface, *domain, area, 1, weight).enough_for(points)
    }

    /// As few pixels as measure the spacing of `points` well, all of them if there is no room to move.
    pub(super) fn sparse(
        surface: ArrayView2<'s, T>,
        domain: &Domain<'d, T>,
        points: usize,
        mut weight: Vec<f64>,
    ) -> Result<Self, SfsError> {
        let area = domain.bounding_box(surface.dim())?;
        let wanted = NODES_PER_POINT * points.max(1);
        let mut stride = (area.area() / wanted).isqrt().max(1);
        loop {
            let lattice = Self::with_stride(surface, *domain, area, stride, weight);
            if stride == 1 || lattice.has_room_for(points) {
                return lattice.enough_for(points);
            }
            stride /= 2;
            weight = lattice.weight;
        }
    }

    fn with_stride(
        surface: ArrayView2<'s, T>,
        domain: Domain<'d, T>,
        area: BoundingBox,
        stride: usize,
        mut weight: Vec<f64>,
    ) -> Self {
        let [rows, columns] = [area.rows(), area.columns()]
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
            self.area.row_start + Self::first(self.stride, self.area.rows()) + row * self.stride,
            self.area.column_start
                + Self::first(self.stride, self.area.columns())
                + column * self.stride,
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
        let column = place(self.area.column_start, self.area.columns(), x);
        let row = place(self.area.row_start, self.area.rows(), y);
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

/// A grid of weights to be cut into cells.
pub(super) struct Weights<'a> {
    /// Row by row; 0 where there is no surface.
    pub(super) weight: &'a [f64],
    pub(super) columns: usize,
    /// Rows with a weight.
    pub(super) rows: usize,
    /// Pixels on the surface.
    pub(super) count: f64,
    /// Height of a pixel over its width.
    pub(super) aspect: f64,
}

/// Weight of a piece of a column, and its moment along the column.
#[derive(Clone, Copy, Debug, Default)]
struct Piece {
    weight: f64,
    moment: f64,
}

/// Buffers, and the centroids found.
#[derive(Debug, Default)]
pub(super) struct Strips {
    rows: Cuts,
    cells: Cuts,
    pieces: Vec<Piece>,
    /// Centroids (x, y) in units of the lattice.
    pub(super) places: Vec<[f64; 2]>,
}

impl Strips {
    /// Finds the centroids of `points` cells of equal weight.
    pub(super) fn find(&mut self, grid: &Weights<'_>, points: usize) {
        let row_weight = |row: usize| {
            grid.weight[row * grid.columns..][..grid.columns]
                .iter()
                .sum()
        };
        let bands = bands(grid, points);
        let lines = grid.weight.len() / grid.columns;
        let share = |band: usize| (band * points / bands) as f64 / points as f64;
        self.rows
            .find((0..lines).map(row_weight), (1..=bands).map(share));
        self.pieces.clear();
        self.pieces.resize(grid.columns, Piece::default());
        self.places.clear();
        let mut top = 0.0;
        for band in 0..bands {
            let bottom = self.rows.at[band];
            gather(grid, top, bottom, &mut self.pieces);
            self.split((band + 1) * points / bands - band * points / bands);
            top = bottom;
        }
    }

    /// Cuts the strip gathered last into `cells` of equal weight; their centroids.
    fn split(&mut self, cells: usize) {
        let shares = (1..=cells).map(|cell| cell as f64 / cells as f64);
        self.cells
            .find(self.pieces.iter().map(|piece| piece.weight), shares);
        let mut from = 0.0;
        for &to in &self.cells.at {
            let (mut weight, mut x, mut y) = (0.0, 0.0, 0.0);
            for (column, share, middle) in parts(from, to, self.pieces.len()) {
                weight += share * self.pieces[column].weight;
                x += share * self.pieces[column].weight * middle;
                y += share * self.pieces[column].moment;
            }
            self.places.push([x / weight, y / weight]);
            from = to;
        }
    }
}

/// Number of strips that makes cells about as wide as high.
fn bands(grid: &Weights<'_>, points: usize) -> usize {
    let width = grid.count / grid.rows as f64;
    let square = points as f64 * grid.rows as f64 * grid.aspect / width;
    (square.sqrt().round() as usize).clamp(1, points)
}

/// Cuts of a line of nodes: node k covers [k, k + 1].
#[derive(Debug, Default)]
struct Cuts {
    weights: Vec<f64>,
    at: Vec<f64>,
}

impl Cuts {
    /// Where the running sum of `weights` reaches each of the rising `shares` of its total.
    fn find(&mut self, weights: impl Iterator<Item = f64>, shares: impl Iterator<Item = f64>) {
        let Self { weights: line, at } = self;
        line.clear();
        line.extend(weights);
        at.clear();
        let total: f64 = line.iter().sum();
        let (mut node, mut before) = (0, 0.0);
        at.extend(shares.map(|share| {
            while node + 1 < line.len() && before + line[node] < share * total {
                before += line[node];
                node += 1;
            }
            let part = if line[node] > 0.0 {
                (share * total - before) / line[node]
            } else {
                1.0
            };
            node as f64 + part.clamp(0.0, 1.0)
        }));
    }
}

/// Parts of the nodes between two cuts: node, share of it, middle of that share.
fn parts(from: f64, to: f64, nodes: usize) -> impl Iterator<Item = (usize, f64, f64)> {
    (from as usize..(to.ceil() as usize).min(nodes)).filter_map(move |node| {
        let (low, high) = (from.max(node as f64), to.min(node as f64 + 1.0));
        (high > low).then_some((node, high - low, 0.5 * (low + high) - 0.5))
    })
}

/// Sums the columns of the strip between two cuts.
fn gather(grid: &Weights<'_>, top: f64, bottom: f64, strip: &mut [Piece]) {
    strip.fill(Piece::default());
    for (row, share, middle) in parts(top, bottom, grid.weight.len() / grid.columns) {
        let weights = &grid.weight[row * grid.columns..][..grid.columns];
        for (piece, weight) in strip.iter_mut().zip(weights) {
            piece.weight += share * weight;
            piece.moment += share * weight * middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cuts_run_through_nodes() {
        let mut cuts = Cuts::default();
        cuts.find(
            [1.0, 0.0, 2.0, 1.0].into_iter(),
            [0.125, 0.25, 0.5, 1.0].into_iter(),
        );
        assert_eq!(cuts.at, [0.5, 1.0, 2.5, 4.0]);
        // Without any weight they are numbers all the same.
        cuts.find([0.0; 3].into_iter(), [0.5, 1.0].into_iter());
        assert_eq!(cuts.at, [1.0, 1.0]);
    }

    #[test]
    fn the_centroid_of_one_cell_is_that_of_all() {
        let pieces = [1.0, 3.0]
            .map(|weight| Piece {
                weight,
                moment: 2.0 * weight,
            })
            .to_vec();
        let mut strips = Strips {
            pieces,
            ..Strips::default()
        };
        strips.split(1);
        assert_eq!(strips.places, [[0.75, 2.0]]);
    }
}
