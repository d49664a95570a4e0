//! Control points on a surface: the trait and its implementations.
//!
//! Most samplers distribute points over the area of the surface, on a lattice of its pixels. The
//! surface is divided into strips of rows and the strips into cells of equal weight, with a point
//! in the centroid of each cell. Cuts may pass through nodes: if the surface is scaled, or shifted
//! by a fraction of a pixel, the points remain the same points of the surface.

mod contact;

use std::ops::Deref;

use nalgebra::Point3;
use ndarray::ArrayView2;

pub use contact::ContactSampler;

use crate::slopes::slopes_at;
use crate::{BoundingBox, Domain, PixelScalar, SfsError, SurfaceWorkspace};

/// A method of choosing control points on a surface.
///
/// Points are (x, y, z) in metres, with x = column · width and y = row · height of a pixel. Heights
/// between pixels are interpolated. All points lie inside the mask (for [`ContactSampler`]: inside
/// the contour) and at finite heights, no two coincide, and equal input gives equal points. Exactly
/// `count` points are returned. The trait is object-safe. Only [`sample`](Self::sample) has to be
/// implemented.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, Domain, EquallySpaced};
/// let flat = Array2::<f64>::zeros((60, 80));
/// let points = EquallySpaced.sample(flat.view(), &Domain::new([1e-4, 1e-4])?, 48)?;
/// assert_eq!(points.len(), 48);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
pub trait ControlPointSampler<T: PixelScalar>: Send + Sync {
    /// Chooses `count` points on `heights` inside the mask of `domain`. The known heights of the
    /// domain are not used.
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::{ControlPointSampler, Domain, EquallySpaced};
    /// let z = array![[5.0, 5.0], [5.0, f64::NAN]];
    /// let points = EquallySpaced.sample(z.view(), &Domain::new([1.0, 2.0])?, 3)?;
    /// assert!(points.iter().all(|point| point.z == 5.0 && (point.x, point.y) != (1.0, 2.0)));
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// Those of an invalid domain ([`Domain::bounding_box`]), and [`SfsError::TooManyPoints`] for
    /// more points than pixels.
    /// points than pixels.
    fn sample(
        &self,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError>;

    /// Like [`sample`](Self::sample), but into `points`, whose contents are replaced, with the
    /// buffers of `workspace`. The samplers of this crate do not allocate once both have grown.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{ControlPointSampler, Domain, EquallySpaced, SurfaceWorkspace};
    /// let (z, mut workspace, mut points) = (
    ///     Array2::<f64>::zeros((9, 9)),
    ///     SurfaceWorkspace::default(),
    ///     Vec::new(),
    /// );
    /// for count in [20, 5] {
    ///     EquallySpaced.sample_with(
    ///         &mut workspace,
    ///         z.view(),
    ///         &Domain::default(),
    ///         count,
    ///         &mut points,
    ///     )?;
    ///     assert_eq!(points.len(), count);
    /// }
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`sample`](Self::sample). `points` is then empty.
    fn sample_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
        points: &mut Vec<Point3<T>>,
    ) -> Result<(), SfsError> {
        let _ = workspace;
        points.clear();
        *points = self.sample(heights, domain, count)?;
        Ok(())
    }
}

/// Implements the trait for boxed, shared and borrowed samplers.
impl<T: PixelScalar, P: Deref<Target: ControlPointSampler<T>> + Send + Sync> ControlPointSampler<T>
    for P
{
    fn sample(
        &self,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError> {
        (**self).sample(heights, domain, count)
    }

    fn sample_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
        points: &mut Vec<Point3<T>>,
    ) -> Result<(), SfsError> {
        (**self).sample_with(workspace, heights, domain, count, points)
    }
}

/// The points that a method finds with a new workspace.
fn made_by<T: PixelScalar>(
    method: impl FnOnce(&mut SurfaceWorkspace<T>, &mut Vec<Point3<T>>) -> Result<(), SfsError>,
) -> Result<Vec<Point3<T>>, SfsError> {
    let mut points = Vec::new();
    method(&mut SurfaceWorkspace::default(), &mut points)?;
    Ok(points)
}

/// Buffers of the samplers, kept between calls.
#[derive(Debug, Default)]
pub(crate) struct SampleBuffers {
    /// Squared heights.
    squares: Vec<f64>,
    /// Weights of the nodes of the lattice.
    weight: Vec<f64>,
    strips: Strips,
    pixels: Vec<[usize; 2]>,
}

/// Equally spaced control points: each represents the same area of the surface (not of its
/// projection). Slopes above 2 (63°) count as 2, because the area of a rim depends on the positions
/// of the pixels.
///
/// The surface is divided into strips of rows and the strips into cells of equal area, with a point
/// in the centroid of each cell. Cuts and centroids are accurate to a fraction of a pixel: a scaled
/// or shifted surface has the same points, so that the points of two loads correspond. Areas are
/// measured on at least 100 pixels per point, if there are enough pixels. The result is
/// deterministic. O(count), and O(pixels) for the mask's box.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, Domain, EquallySpaced};
/// // Flat on the left, a roof of slope √3 on the right: twice the area, so twice the points.
/// let z = Array2::from_shape_fn((60, 120), |(_, c)| 3.0_f64.sqrt() * (c as f64 - 60.0).max(0.0));
/// let points = EquallySpaced.sample(z.view(), &Domain::new([1.0, 1.0])?, 90)?;
/// let level = points.iter().filter(|point| point.x < 60.0).count();
/// assert!((27..=33).contains(&level));
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EquallySpaced;

impl<T: PixelScalar> ControlPointSampler<T> for EquallySpaced {
    fn sample(
        &self,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError> {
        made_by(|workspace, points| self.sample_with(workspace, heights, domain, count, points))
    }

    fn sample_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
        points: &mut Vec<Point3<T>>,
    ) -> Result<(), SfsError> {
        points.clear();
        let buffers = &mut workspace.points;
        let weight = core::mem::take(&mut buffers.weight);
        let lattice = Lattice::sparse(heights, domain, count, weight)?;
        spread(&lattice, count, buffers, points);
        buffers.weight = lattice.weight;
        Ok(())
    }
}

/// Adds `count` points, each of which represents the same weight.
fn spread<T: PixelScalar>(
    lattice: &Lattice<'_, '_, T>,
    count: usize,
    buffers: &mut SampleBuffers,
    points: &mut Vec<Point3<T>>,
) {
    if count == 0 || lattice.has_room_for(count) && at_centroids(lattice, count, buffers, points) {
        return;
    }
    // The points are nearly as dense as the nodes: nodes themselves are chosen, evenly in reading
    // order.
    points.clear();
    let nodes = lattice.nodes().enumerate();
    // In integer arithmetic exactly `count` of the nodes are chosen.
    let chosen = nodes.filter(|(k, _)| (k + 1) * count / lattice.count > k * count / lattice.count);
    points.extend(chosen.map(|(_, node)| lattice.point(lattice.pixel(node))));
}

/// Adds the centroids of the cells. Returns false if two of them share a pixel.
fn at_centroids<T: PixelScalar>(
    lattice: &Lattice<'_, '_, T>,
    count: usize,
    buffers: &mut SampleBuffers,
    points: &mut Vec<Point3<T>>,
) -> bool {
    let SampleBuffers { strips, pixels, .. } = buffers;
    let grid = Weights {
        weight: &lattice.weight,
        columns: lattice.columns,
        rows: lattice.rows,
        count: lattice.count as f64,
        aspect: lattice.aspect(),
    };
    strips.find(&grid, count);
    pixels.clear();
    for &place in &strips.places {
        let (pixel, point) = lattice.point_near(place);
        pixels.push(pixel);
        points.push(point);
    }
    pixels.sort_unstable();
    pixels.windows(2).all(|pair| pair[0] != pair[1])
}

/// Number of nodes per point for the measurement of areas, if the surface fills its box. With every
/// pixel of most surfaces, points follow a growing or moving surface to a hundredth of a pixel, and
/// with every other pixel to a third.
const NODES_PER_POINT: usize = 100;
/// Upper limit of slopes (63°). At the rim of a round body the slope is infinite, and the part of
/// it on a lattice depends on the pixels. The points would follow the pixels instead of the body.
const STEEPEST: f64 = 2.0;
/// Minimum number of nodes per point at which points can move between nodes.
const ROOM: usize = 8;

/// A regular lattice of pixels of a surface.
struct Lattice<'s, 'd, T> {
    surface: ArrayView2<'s, T>,
    domain: Domain<'d, T>,
    area: BoundingBox,
    /// Number of pixels between nodes.
    stride: usize,
    /// Nodes per row.
    columns: usize,
    /// Rows of nodes.
    rows: usize,
    /// Area of the surface over the pixels of the node, divided by the area of the pixels. 0 if
    /// there is no node.
    weight: Vec<f64>,
    /// Number of nodes on the surface.
    count: usize,
}

impl<'s, 'd, T: PixelScalar> Lattice<'s, 'd, T> {
    /// The fewest pixels that measure the spacing of `points` well, or all pixels if the points
    /// cannot move between nodes. `weight` is a buffer that is reused.
    fn sparse(
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
            // A thin or small mask in a large box has fewer nodes than the box.
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

    /// Position of the first node in a box of `length` pixels: in the middle of its cell.
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
    fn has_room_for(&self, points: usize) -> bool {
        self.count >= ROOM * points
    }

    /// Row and column of a node's pixel.
    fn pixel(&self, node: usize) -> [usize; 2] {
        let [row, column] = [node / self.columns, node % self.columns];
        [
            self.area.row_start + Self::first(self.stride, self.area.rows()) + row * self.stride,
            self.area.column_start
                + Self::first(self.stride, self.area.columns())
                + column * self.stride,
        ]
    }

    /// Height of a pixel divided by its width.
    fn aspect(&self) -> f64 {
        self.domain.pixel_size_m[1].as_f64() / self.domain.pixel_size_m[0].as_f64()
    }

    /// The point at a position (x, y) of the lattice with interpolated height, and the pixel that
    /// contains it. If that pixel is not inside the surface, the nearest node is used.
    fn point_near(&self, [x, y]: [f64; 2]) -> ([usize; 2], Point3<T>) {
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

    /// The node on the surface that is nearest to a position.
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

    /// Bilinear height between four pixels. `None` if one of the four is not on the surface.
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
    fn point(&self, [row, column]: [usize; 2]) -> Point3<T> {
        let [hx, hy] = self.domain.pixel_size_m;
        Point3::new(
            T::of(column as f64) * hx,
            T::of(row as f64) * hy,
            self.surface[[row, column]],
        )
    }

    /// The nodes on the surface, in reading order.
    fn nodes(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.weight.len()).filter(|&node| self.weight[node] > 0.0)
    }
}

/// A grid of weights that is divided into cells.
struct Weights<'a> {
    /// Row by row, 0 outside the surface.
    weight: &'a [f64],
    columns: usize,
    /// Rows with a weight.
    rows: usize,
    /// Pixels on the surface.
    count: f64,
    /// Height of a pixel divided by its width.
    aspect: f64,
}

/// Weight of a part of a column, and its moment along the column.
#[derive(Clone, Copy, Debug, Default)]
struct Piece {
    weight: f64,
    moment: f64,
}

/// Buffers, and the centroids found.
#[derive(Debug, Default)]
struct Strips {
    rows: Cuts,
    cells: Cuts,
    pieces: Vec<Piece>,
    /// Centroids (x, y) in units of the lattice.
    places: Vec<[f64; 2]>,
}

impl Strips {
    /// Finds the centroids of `points` cells of equal weight.
    fn find(&mut self, grid: &Weights<'_>, points: usize) {
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

    /// Divides the last gathered strip into `cells` of equal weight and adds their centroids.
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

/// Number of strips for cells that are about as wide as high.
fn bands(grid: &Weights<'_>, points: usize) -> usize {
    let width = grid.count / grid.rows as f64;
    // Cells of side s: there are rows · aspect/s strips of width/s cells each.
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
    /// Positions at which the running sum of `weights` reaches each of the increasing `shares` of
    /// its total.
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

/// Parts of the nodes between two cuts: node, fraction of the node, and middle of that fraction.
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
        // Without any weight the cuts are finite nevertheless.
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
