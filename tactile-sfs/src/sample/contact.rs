//! Control points of a round body that meets a plane: up to the sub-pixel contour, with heights
//! that follow the vertical boundary.
//!
//! Near the boundary z rises as the square root of the distance, and no interpolation of z between
//! pixels is accurate. The square of z is smooth: z² = a² − x² − y² for a ball, and its zero is the
//! contour. Therefore squares are extrapolated one pixel beyond the mask, and the area of a pixel
//! counts by its fraction inside the contour. Heights between pixels are roots of interpolated
//! squares.

use nalgebra::Point3;
use ndarray::ArrayView2;

use super::{ControlPointSampler, SampleBuffers, Weights, made_by};
use crate::{BoundingBox, Domain, PixelScalar, SfsError, SurfaceWorkspace};

/// Upper limit of the squared slope (63°), as for [`EquallySpaced`](super::EquallySpaced).
const STEEPEST_SQUARED: f64 = 4.0;

/// The eight neighbours (down, right), with the weight of the extrapolation from each: a diagonal
/// is a longer distance.
const NEIGHBOURS: [(isize, isize, f64); 8] = [
    (0, 1, 1.0),
    (1, 0, 1.0),
    (0, -1, 1.0),
    (-1, 0, 1.0),
    (1, 1, 0.5),
    (1, -1, 0.5),
    (-1, 1, 0.5),
    (-1, -1, 0.5),
];

/// Equally spaced control points on a round body that meets the plane z = 0 at its contour, as in a
/// contact. Each represents the same area of the surface. Cells and heights extend to the contour
/// between the pixels.
///
/// The points of two loads correspond even in contacts of twenty pixels' radius, whereas those of
/// [`EquallySpaced`](super::EquallySpaced) follow the pixels at the boundary. With heights below
/// zero, the plane is lowered to the lowest height. O(pixels of the mask's box).
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ContactSampler, ControlPointSampler, Domain};
/// // Two balls of 12.0 and 14.4 pixels: the second is the first, scaled by 1.2.
/// let points = |radius: f64| {
///     let z = Array2::from_shape_fn((40, 40), |(r, c)| {
///         (radius * radius - (r as f64 - 19.7).powi(2) - (c as f64 - 20.2).powi(2))
///             .max(0.0)
///             .sqrt()
///     });
///     ContactSampler.sample(
///         z.view(),
///         &Domain::default().with_mask(z.mapv(|z| z > 0.0).view()),
///         50,
///     )
/// };
/// let centre = nalgebra::Vector3::new(20.2, 19.7, 0.0);
/// let farthest = points(12.0)?.iter().zip(points(14.4)?).map(|(small, large)| {
///     ((small.coords - centre) * 1.2 - (large.coords - centre)).norm()
/// }).fold(0.0, f64::max);
/// assert!(farthest < 0.6, "in pixels: {farthest}");
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContactSampler;

impl<T: PixelScalar> ControlPointSampler<T> for ContactSampler {
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
        let area = domain.bounding_box(heights.dim())?;
        let SampleBuffers {
            squares,
            weight,
            strips,
            ..
        } = &mut workspace.points;
        let field = Field::load(core::mem::take(squares), weight, heights, domain, area);
        let available = field.solved;
        if available == 0 {
            return Err(SfsError::EmptyMask);
        }
        if count > available {
            return Err(SfsError::TooManyPoints {
                requested: count,
                available,
            });
        }
        let grid = field.weigh(weight);
        if count > 0 {
            strips.find(&grid, count);
            points.extend(strips.places.iter().map(|&place| field.point(place)));
        }
        *squares = field.squares;
        Ok(())
    }
}

/// Squared heights over the mask's box and one pixel around it, in squares of the pixel width. NaN
/// if unknown.
struct Field<T> {
    squares: Vec<f64>,
    columns: usize,
    rows: usize,
    /// Pixel of the frame at the first position, less one.
    area: BoundingBox,
    pixel_size_m: [T; 2],
    aspect: f64,
    /// Height of the plane in pixel widths.
    plane: f64,
    /// Number of pixels with a height.
    solved: usize,
}

impl<T: PixelScalar> Field<T> {
    fn load(
        mut squares: Vec<f64>,
        spare: &mut Vec<f64>,
        surface: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        area: BoundingBox,
    ) -> Self {
        let [width, height] = domain.pixel_size_m.map(T::as_f64);
        let (rows, columns) = (area.rows() + 2, area.columns() + 2);
        squares.clear();
        // One more row, which is never filled, stands for positions above and below the field.
        squares.resize((rows + 1) * columns, f64::NAN);
        let (mut plane, mut solved) = (0.0_f64, 0);
        let heights = area.of(surface);
        let lines = squares.chunks_exact_mut(columns).skip(1);
        for ((row, heights), line) in heights.rows().into_iter().enumerate().zip(lines) {
            for ((column, height), place) in heights.iter().enumerate().zip(&mut line[1..]) {
                let height = height.as_f64() / width;
                if height.is_finite()
                    && domain.contains(area.row_start + row, area.column_start + column)
                {
                    *place = height;
                    plane = plane.min(height);
                    solved += 1;
                }
            }
        }
        for height in &mut squares {
            // Squares of depths above the plane. Without the shift, negative and positive heights
            // would have equal squares.
            *height = (*height - plane).powi(2);
        }
        let mut field = Self {
            squares,
            columns,
            rows,
            area,
            pixel_size_m: domain.pixel_size_m,
            aspect: height / width,
            plane,
            solved,
        };
        field.continue_outwards(spare);
        field
    }

    /// Extrapolates the squares to the pixels next to the mask like those of a ball, whose second
    /// difference is −2 per squared pixel.
    ///
    /// The centre of a pixel outside the mask lies outside the contour. If the extrapolation is
    /// above zero there (a cliff at the boundary), the contour is placed half way.
    fn continue_outwards(&mut self, inner: &mut Vec<f64>) {
        inner.clone_from(&self.squares);
        for row in 0..self.rows {
            // Whether one of the three pixels of a column about this row has a square, for the
            // previous, the present and the next column.
            let is_reached = |column: usize| {
                (row.saturating_sub(1)..(row + 2).min(self.rows))
                    .any(|row| !inner[row * self.columns + column].is_nan())
            };
            let mut reached = [false, false, is_reached(0)];
            for column in 0..self.columns {
                let after = column + 1 < self.columns && is_reached(column + 1);
                reached = [reached[1], reached[2], after];
                let place = row * self.columns + column;
                if !inner[place].is_nan() || reached == [false; 3] {
                    continue;
                }
                let (r, c) = (row as isize, column as isize);
                let (mut sum, mut nearest, mut total) = (0.0, 0.0, 0.0);
                for (down, right, weight) in NEIGHBOURS {
                    let near = self.of(inner, r + down, c + right);
                    if near.is_nan() {
                        continue;
                    }
                    let far = self.of(inner, r + 2 * down, c + 2 * right);
                    if far.is_nan() {
                        continue;
                    }
                    let step = (down as f64 * self.aspect).powi(2) + (right * right) as f64;
                    sum += weight * (2.0 * near - far - 2.0 * step);
                    nearest += weight * near;
                    total += weight;
                }
                if total > 0.0 {
                    let continued = sum / total;
                    self.squares[place] = if continued > 0.0 {
                        -nearest / total
                    } else {
                        continued
                    };
                }
            }
        }
    }

    /// One of the squares, or NaN outside the field.
    fn of(&self, squares: &[f64], row: isize, column: isize) -> f64 {
        let inside = row >= 0
            && column >= 0
            && (row as usize) < self.rows
            && (column as usize) < self.columns;
        if inside {
            squares[row as usize * self.columns + column as usize]
        } else {
            f64::NAN
        }
    }

    /// A row of the field, or the empty row above and below it.
    fn line(&self, row: usize) -> &[f64] {
        &self.squares[row.min(self.rows) * self.columns..][..self.columns]
    }

    /// Area of the surface over the part of every pixel inside the contour, divided by the area of
    /// a pixel.
    fn weigh<'a>(&self, weight: &'a mut Vec<f64>) -> Weights<'a> {
        weight.clear();
        let (mut covered, mut filled) = (0.0, 0);
        for row in 0..self.rows {
            let before = covered;
            let [above, line, below] =
                [row.wrapping_sub(1), row, row + 1].map(|row| self.line(row));
            for (column, &here) in line.iter().enumerate() {
                if here.is_nan() {
                    weight.push(0.0);
                    continue;
                }
                let beside = |column: usize| line.get(column).copied().unwrap_or(f64::NAN);
                let along = [beside(column.wrapping_sub(1)), beside(column + 1)];
                let down = [above[column], below[column]];
                let (gx, gy) = (difference(here, along), difference(here, down));
                // The contour crosses the pixel if |square| is below half of its change over the
                // pixel.
                let change = (gx.abs() + gy.abs()).max(f64::MIN_POSITIVE);
                let cover = if here >= 0.5 * change {
                    1.0
                } else {
                    (0.5 + here / change).max(0.0)
                };
                // With s = z² the slope is ∇s/(2z), so that its square is |∇s|²/(4s).
                let slope_squared = if here > 0.0 {
                    (gx * gx + (gy / self.aspect).powi(2)) / (4.0 * here)
                } else {
                    STEEPEST_SQUARED
                };
                weight.push(cover * (1.0 + slope_squared.min(STEEPEST_SQUARED)).sqrt());
                covered += cover;
            }
            filled += usize::from(covered > before);
        }
        Weights {
            weight,
            columns: self.columns,
            rows: filled.max(1),
            count: covered,
            aspect: self.aspect,
        }
    }

    /// The point at a position (x, y) of the field. Its height is the root of the bilinear square.
    fn point(&self, [x, y]: [f64; 2]) -> Point3<T> {
        let (left, top) = (x.floor(), y.floor());
        let (right, down) = (x - left, y - top);
        let (mut sum, mut total) = (0.0, 0.0);
        for (row, column, share) in [
            (0, 0, (1.0 - down) * (1.0 - right)),
            (0, 1, (1.0 - down) * right),
            (1, 0, down * (1.0 - right)),
            (1, 1, down * right),
        ] {
            let square = self.of(&self.squares, top as isize + row, left as isize + column);
            if !square.is_nan() {
                sum += share * square;
                total += share;
            }
        }
        let square = if total > 0.0 { sum / total } else { 0.0 };
        // Outside the contour the interpolated square is negative, and the point lies in the plane.
        let height = self.plane + square.max(0.0).sqrt();
        let [width_m, height_m] = self.pixel_size_m;
        Point3::new(
            T::of(x + self.area.column_start as f64 - 1.0) * width_m,
            T::of(y + self.area.row_start as f64 - 1.0) * height_m,
            T::of(height) * width_m,
        )
    }
}

/// Central difference, or one-sided if a neighbour is missing.
fn difference(here: f64, [before, after]: [f64; 2]) -> f64 {
    match (before.is_nan(), after.is_nan()) {
        (false, false) => 0.5 * (after - before),
        (false, true) => here - before,
        (true, false) => after - here,
        (true, true) => 0.0,
    }
}
